//! Parameters of devices that differ between the runs of a scenario.

use std::ops::Range;

use crate::catalogue::Catalogue;
use crate::graph::{Outline, Request, compile};
use crate::node::{Param, Reader};
use crate::random::Random;
use crate::source::{Code, Diagnostic, Item, Table, Value, suggestion};

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
        let Some(table) = value.as_table().filter(|table| !table.entries.is_empty()) else {
            return reader.wrong_type(value, Self::EXPECTS);
        };
        let mut found = Vec::new();
        match flatten("", table, &mut found) {
            Ok(()) => Some(Self(found)),
            Err(wrong) => reader.wrong_type(wrong, "two numbers, the smaller one first"),
        }
    }
}

/// Collects the ranges below a path, or returns the value that is none.
fn flatten<'v>(path: &str, table: &'v Table, found: &mut Vec<Varied>) -> Result<(), &'v Value> {
    for (key, value) in &table.entries {
        let path = if path.is_empty() { key.name.clone() } else { format!("{path}.{}", key.name) };
        match value.as_table() {
            Some(table) => flatten(&path, table, found)?,
            None => {
                let (low, high) = range(value).ok_or(value)?;
                found.push(Varied { path, low, high, span: value.span.clone() });
            }
        }
    }
    Ok(())
}

fn range(value: &Value) -> Option<(f64, f64)> {
    let number = |item: &Value| match item.item {
        Item::Integer(number) => Some(number as f64),
        Item::Float(number) => Some(number),
        _ => None,
    };
    let Item::Array(items) = &value.item else { return None };
    let [low, high] = items.as_slice() else { return None };
    Some((number(low)?, number(high)?)).filter(|(low, high)| low < high && (high - low).is_finite())
}

impl Vary {
    /// Returns what the run with this seed assigns: each parameter anywhere between its two values.
    pub(super) fn drawn(&self, seed: u64) -> Vec<(String, f64)> {
        let draw = |varied: &Varied| (varied.path.clone(), varied.drawn(seed));
        self.0.iter().map(draw).collect()
    }

    /// Returns the parameters with their ranges.
    pub fn ranges(&self) -> impl Iterator<Item = (&str, [f64; 2])> {
        self.0.iter().map(|varied| (&*varied.path, [varied.low, varied.high]))
    }

    /// Reports parameters that are none of a device, and values with which the task does not load.
    pub(super) fn mistakes(&self, catalogue: &Catalogue, request: &Request, outline: &Outline) -> Vec<Diagnostic> {
        let devices: Vec<&str> = outline.devices.iter().map(|device| &*device.name).collect();
        self.0.iter().filter_map(|varied| varied.mistake(catalogue, request, &devices)).collect()
    }
}

impl Varied {
    /// Returns the value in the run with this seed. It depends on no other parameter.
    fn drawn(&self, seed: u64) -> f64 {
        let stream =
            self.path.bytes().fold(STREAM, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3));
        Random::new(seed, stream).uniform(self.low, self.high)
    }

    fn mistake(&self, catalogue: &Catalogue, request: &Request, devices: &[&str]) -> Option<Diagnostic> {
        let wrong = |message: String| Diagnostic::new(Code::BadValue, self.span.clone(), message);
        let mut words = self.path.split('.');
        if words.next() != Some("devices") {
            let help = "write, for example, `vary = { devices.bench.friction = [0.1, 0.5] }`";
            return Some(
                wrong(format!("`{}` is no parameter of a device, and nothing else varies", self.path)).help(help),
            );
        }
        let device = words.next().unwrap_or_default();
        if !devices.contains(&device) {
            let message = format!("no role of this task has a device `{device}`, so `{}` changes nothing", self.path);
            return Some(wrong(message).help(suggestion(device, devices.iter().copied(), "devices")));
        }
        let refused = |value: f64| {
            let report = compile(catalogue, &request.clone().set(assignment(&self.path, value))).err()?;
            let first = report.diagnostics.first();
            let why = first.map(|first| first.message.clone()).unwrap_or_default();
            let found = wrong(format!("the task does not load with `{}`: {why}", assignment(&self.path, value)));
            Some(if why.contains("a whole number") {
                found.help("a parameter that takes any number can vary")
            } else {
                found.with_help(first.and_then(|first| first.help.clone()))
            })
        };
        [self.low, self.high].into_iter().find_map(refused)
    }
}

/// Returns the assignment of a value, as in `--set`.
pub(crate) fn assignment(path: &str, value: f64) -> String {
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
