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
    /// With the old gains; `None` if the task did not run with them.
    pub(super) old: Option<Held>,
    /// Why it did not run with the old gains.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) left_out: Option<String>,
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

    /// Returns what is wrong with it, if it is worse than with the old gains, or if nothing is known of those.
    fn failure(&self, old: Option<&Self>) -> Option<String> {
        if let Some(new) = self.step.filter(|_| old.is_none_or(|old| old.step.is_some())) {
            return new.failure(old.and_then(|old| old.step).as_ref());
        }
        let lost = "it is not held, or absent for a while".to_owned();
        let Some(old) = old else { return self.error.is_none().then_some(lost) };
        let growth = self.error.zip(old.error).map(|(new, old)| new / old).filter(|growth| *growth > WORSE);
        let grows = growth.map(|growth| format!("the error grows to {growth:.1} times what it was"));
        let is_lost = old.step.is_some() || old.error.is_some() && self.error.is_none();
        grows.or_else(|| is_lost.then_some(lost))
    }
}

impl Settled {
    pub(super) const fn is_good(&self) -> bool {
        self.failure.is_none()
    }
}

/// Runs the task over a contact with both gains, and compares how it holds each feature that has new ones. Old gains that
/// are near instability do not run again.
pub(super) fn compare(
    trial: &Trial<'_>,
    features: &[TunedFeature],
    (contact, object): (usize, &str),
) -> Result<Vec<Settled>, Stop> {
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
    let left_out = changed.iter().find_map(|one| {
        let [kp, ..] = one.old;
        Some(format!("those of `{}` (kp = {kp}) {}", one.name, one.unsafe_as_it_was(contact)?))
    });
    let old = if left_out.is_some() { None } else { Some(held(&[])?.0) };
    let (new, failure) = held(&new)?;
    let settled = changed.iter().zip(new).enumerate().map(|(i, (one, new))| {
        let old = old.as_ref().map(|old| old[i]);
        let failure = failure.clone().or_else(|| new.failure(old.as_ref()));
        let (object, feature, left_out) = (object.to_owned(), one.name.clone(), left_out.clone());
        Settled { object, feature, old, left_out, new, failure }
    });
    Ok(settled.collect())
}

/// Returns the root mean square of what is finite.
fn deviation(values: impl Iterator<Item = f64>) -> Option<f64> {
    let values: Vec<f64> = values.filter(|value| value.is_finite()).collect();
    let square: f64 = values.iter().map(|value| value * value).sum();
    (!values.is_empty()).then(|| (square / values.len() as f64).sqrt())
}
