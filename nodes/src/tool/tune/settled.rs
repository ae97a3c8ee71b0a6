//! The task with the old and with the new gains: how it holds its setpoints, and how it follows steps of them.

use serde::Serialize;

use super::propose::TunedFeature;
use super::step::{self, Planned, Step};
use super::trial::{Run, Seen, Trial};
use super::{Stop, gain_keys};
use crate::tool::control::law::Feature;

/// How a task holds a feature.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(super) struct Settled {
    pub(super) object: String,
    pub(super) feature: String,
    /// With the old gains.
    pub(super) old: Held,
    /// With the new gains.
    pub(super) new: Held,
    /// Why the run with the new gains is no success.
    pub(super) failure: Option<String>,
}

/// How a feature is held with some gains.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Held {
    /// Root mean square of the error before the step.
    pub(super) error: Option<f64>,
    pub(super) step: Option<Step>,
}

/// Largest error, as a multiple of that with the old gains, where no step says more [1].
const WORSE: f64 = 1.5;

impl Held {
    /// Returns how a run with a step has held a feature, with samples every `period` [s].
    fn of(seen: &Seen, step: Option<Planned>, period: f64) -> Self {
        let step = step.and_then(|step| Step::after_rest(step.size, &seen.before, &seen.after, period));
        Self { error: deviation(seen.held.iter().copied()), step }
    }

    /// Returns what is wrong with it, if it is worse than with the old gains.
    fn failure(&self, old: &Self) -> Option<String> {
        if let Some((new, old)) = self.step.zip(old.step) {
            return new.failure(&old);
        }
        let growth = self.error.zip(old.error).map(|(new, old)| new / old).filter(|growth| *growth > WORSE);
        let grows = growth.map(|growth| format!("the error grows to {growth:.1} times what it was"));
        let is_lost = old.step.is_some() || old.error.is_some() && self.error.is_none();
        grows.or_else(|| is_lost.then(|| "it is not held, or absent for a while".to_owned()))
    }
}

impl Settled {
    pub(super) const fn is_good(&self) -> bool {
        self.failure.is_none()
    }
}

/// Runs the task with both gains, and compares how it holds each feature that has new ones.
pub(super) fn compare(trial: &Trial<'_>, features: &[TunedFeature], object: &str) -> Result<Vec<Settled>, Stop> {
    let changed: Vec<&TunedFeature> = features.iter().filter(|one| one.new.is_some()).collect();
    if changed.is_empty() {
        return Ok(Vec::new());
    }
    let gains = |one: &&TunedFeature| gain_keys::gains(&one.feature, trial.mode, one.new.unwrap_or(one.old));
    let new: Vec<String> = changed.iter().flat_map(gains).collect();
    let features: Vec<&Feature> = changed.iter().map(|one| &one.feature).collect();
    let steps = step::plan(trial.outline, trial.mode, &features);
    let held = |gains: &[String]| -> Result<(Vec<Held>, Option<String>), Stop> {
        let Run { each: seen, failure, .. } = trial.follow(&features, &steps, gains)?;
        let each = seen.iter().zip(&steps).map(|(seen, step)| Held::of(seen, *step, trial.outline.period_s));
        Ok((each.collect(), failure))
    };
    let [(old, _), (new, failure)] = [held(&[])?, held(&new)?];
    let each = changed.iter().zip(old.into_iter().zip(new));
    let settled = each.map(|(one, (old, new))| {
        let failure = failure.clone().or_else(|| new.failure(&old));
        Settled { object: object.to_owned(), feature: one.name.clone(), old, new, failure }
    });
    Ok(settled.collect())
}

/// Returns the root mean square of what is finite.
fn deviation(values: impl Iterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    let square: f64 = values.iter().map(|value| value * value).sum();
    (!values.is_empty()).then(|| (square / values.len() as f64).sqrt())
}
