//! The ranges of `[live]`: a gain that is tried may lie beyond them, and one that is saved must not.

use tactflow_runtime::engine::Engine;
use toml_edit::{InlineTable, Value};

use super::propose::TunedFeature;

/// Ends of the names of the gains that are tuned.
const GAINS: [&str; 3] = [".kp", ".ki", ".kd"];
/// Largest gain that is tried [1/s].
const LARGEST: f64 = 1e6;

/// A gain that may change while the graph runs.
#[derive(Debug, Clone)]
pub(super) struct Range {
    /// Its name in `[live]`.
    pub(super) name: String,
    min: f64,
    max: f64,
    rate: f64,
}

impl Range {
    /// Returns the ranges of all gains of the graph itself; those of its parts stay as they are.
    pub(super) fn all(engine: &Engine) -> Vec<Self> {
        let params = engine.live_values().map(|value| value.param);
        let is_gain =
            |name: &str| name.split('.').nth(1) == Some("gains") && GAINS.iter().any(|gain| name.ends_with(gain));
        let gains = params.filter(|param| is_gain(&param.name));
        gains.map(|it| Self { name: it.name.clone(), min: it.min, max: it.max, rate: it.rate }).collect()
    }

    /// Returns the settings with which any gain can be tried.
    pub(super) fn opened(&self) -> [String; 2] {
        let (name, min, max) = (&self.name, self.min.min(0.0), self.max.max(LARGEST));
        [format!("live.{name}.min={min:?}"), format!("live.{name}.max={max:?}")]
    }

    /// Returns the range as `[live]` must state it for the gains that are proposed; `None` if it holds them.
    pub(super) fn beyond(&self, features: &[TunedFeature]) -> Option<Self> {
        let gain = features.iter().find_map(|one| {
            let start = format!("{}.gains.{}.", one.feature.pid.as_ref()?, one.name);
            let key = self.name.strip_prefix(&start)?;
            Some(one.new?[["kp", "ki", "kd"].iter().position(|name| *name == key)?])
        })?;
        let is_beyond = !(self.min..=self.max).contains(&gain);
        is_beyond.then(|| Self { min: self.min.min(gain), max: self.max.max(gain), ..self.clone() })
    }

    /// Writes it as `[live]` does.
    pub(super) fn value(&self) -> Value {
        let numbers = [("min", self.min), ("max", self.max), ("rate", self.rate)];
        numbers.into_iter().collect::<InlineTable>().into()
    }
}
