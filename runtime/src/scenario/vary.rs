//! Parameters of devices that differ between the runs of a scenario.

use std::ops::Range;

use crate::catalogue::Catalogue;
use crate::graph::{Request, compile};
use crate::node::{Param, Reader};
use crate::random::Random;
use crate::source::{Code, Diagnostic, Item, Value};

/// The parameters that vary, each between two values.
#[derive(Debug, Clone, Default)]
pub struct Vary(pub(super) Vec<Varied>);

/// A parameter that varies.
#[derive(Debug, Clone)]
pub(super) struct Varied {
    /// Its path, as in `--set`.
    pub(super) path: String,
    low: f64,
    high: f64,
    pub(super) span: Range<usize>,
}

/// The random numbers of parameters are apart from those of faults and devices.
const STREAM: u64 = 0x7661_7279;

impl Param for Vary {
    const EXPECTS: &'static str = "parameters of devices, each with its smallest and its largest value, such as \
                                   `{ devices.bench.friction = [0.1, 0.5] }`";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let mut found = Vec::new();
        let is_read = flatten("", value, &mut found) && !found.is_empty();
        is_read.then_some(Self(found)).or_else(|| reader.wrong_type(value, Self::EXPECTS))
    }
}

/// Collects the ranges below a path. Returns false if a value is none.
fn flatten(path: &str, value: &Value, found: &mut Vec<Varied>) -> bool {
    let number = |item: &Value| match item.item {
        Item::Integer(number) => Some(number as f64),
        Item::Float(number) => Some(number),
        _ => None,
    };
    match &value.item {
        Item::Table(table) => table.entries.iter().all(|(key, value)| {
            let path = if path.is_empty() { key.name.clone() } else { format!("{path}.{}", key.name) };
            flatten(&path, value, found)
        }),
        Item::Array(items) => match items.iter().map(number).collect::<Option<Vec<_>>>().as_deref() {
            Some(&[low, high]) if low < high && (high - low).is_finite() => {
                found.push(Varied { path: path.to_owned(), low, high, span: value.span.clone() });
                true
            }
            _ => false,
        },
        _ => false,
    }
}

impl Vary {
    /// Returns what the run with this seed assigns: each parameter anywhere between its two values.
    pub(super) fn drawn(&self, seed: u64) -> Vec<(String, f64)> {
        let draw = |(i, varied): (usize, &Varied)| {
            let value = Random::new(seed, STREAM + i as u64).uniform(varied.low, varied.high);
            (varied.path.clone(), value)
        };
        self.0.iter().enumerate().map(draw).collect()
    }

    /// Returns the parameters with their ranges.
    pub fn ranges(&self) -> impl Iterator<Item = (&str, [f64; 2])> {
        self.0.iter().map(|varied| (&*varied.path, [varied.low, varied.high]))
    }

    /// Reports parameters that are none of a device, and values with which the task does not load.
    pub(super) fn mistakes(&self, catalogue: &Catalogue, request: &Request) -> Vec<Diagnostic> {
        self.0.iter().filter_map(|varied| varied.mistake(catalogue, request)).collect()
    }
}

impl Varied {
    fn mistake(&self, catalogue: &Catalogue, request: &Request) -> Option<Diagnostic> {
        if !self.path.starts_with("devices.") {
            let message = format!("`{}` is no parameter of a device, and nothing else varies", self.path);
            let help = "write, for example, `vary = { devices.bench.friction = [0.1, 0.5] }`";
            return Some(Diagnostic::new(Code::BadValue, self.span.clone(), message).help(help));
        }
        let refused = |value: f64| {
            let report = compile(catalogue, &request.clone().set(assignment(&self.path, value))).err()?;
            let why = report.diagnostics.first().map(|first| first.message.clone()).unwrap_or_default();
            let message = format!("the task does not load with `{} = {value}`: {why}", self.path);
            Some(Diagnostic::new(Code::BadValue, self.span.clone(), message))
        };
        [self.low, self.high].into_iter().find_map(refused)
    }
}

/// Returns the assignment of a value, as in `--set`.
pub(super) fn assignment(path: &str, value: f64) -> String {
    format!("{path}={value:?}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_seed_draws_its_own_values_between_the_two_ends() {
        let varied = |path: &str, low, high| Varied { path: path.into(), low, high, span: 0..0 };
        let vary = Vary(vec![varied("devices.a.b", 1.0, 2.0), varied("devices.a.c", -1e-3, 1e-3)]);
        let draws: Vec<_> = (1..=1000).map(|seed| vary.drawn(seed)).collect();
        for (i, (path, [low, high])) in vary.ranges().enumerate() {
            let values: Vec<f64> = draws.iter().map(|draw| draw[i].1).collect();
            assert!(draws.iter().all(|draw| draw[i].0 == path));
            assert!(values.iter().all(|value| (low..=high).contains(value)));
            let mean = values.iter().sum::<f64>() / 1000.0;
            assert!((mean - 0.5 * (low + high)).abs() < 0.03 * (high - low), "{path}: {mean}");
        }
        assert_eq!(vary.drawn(7), vary.drawn(7));
        assert_ne!(draws[0][0].1 - 1.0, (draws[0][1].1 + 1e-3) / 2e-3);
    }
}
