//! Steps of the setpoints, one after the other, and how the features follow them.

use serde::Serialize;
use tactflow_runtime::graph::{Outline, OutlinedMode};

use super::{TunedFeature, lift};
use crate::tool::control::settings::toml;

/// How long a task holds its setpoints before the first step [s].
pub(super) const BEFORE_S: f64 = 12.0;
/// How long a setpoint stays changed [s].
const LASTS_S: f64 = 8.0;
/// Beginning of the names of the modes with a changed setpoint.
const MODE: &str = "tune_step";
/// Step of a place [m], and of an angle [rad]; that of another feature as a share of its setpoint [1].
const PLACE: f64 = 2e-3;
const ANGLE: f64 = 0.05;
const SHARE: f64 = 0.2;
/// Time over which the response is averaged [s], so that noise makes no overshoot.
const MEAN_S: f64 = 0.04;
/// Share of a step at which it counts as followed [1].
const FOLLOWED: f64 = 0.9;
/// Part of the end of a step in which a feature must rest [1].
const REST: f64 = 0.25;
/// Largest overshoot, and largest error at the end, of gains that are good [1]. A peak of the sensitivity of 1.7 has an
/// overshoot of about 0.4.
const MAX_OVERSHOOT: f64 = 0.6;
const MAX_REST: f64 = 0.3;

/// How a feature follows a step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub(super) struct Step {
    /// Size of the step, in the unit of the feature.
    pub(super) size: f64,
    /// Time until 90 % are reached [s]; `None` if they are not.
    pub(super) rise_s: Option<f64>,
    /// How far the feature goes beyond the setpoint, as a share of the step [1].
    pub(super) overshoot: f64,
    /// Root mean square of the error at the end, as a share of the step [1].
    pub(super) rest: f64,
}

impl Step {
    /// Returns what a response says: the errors [unit of the feature] after a step of a size, one in each period [s].
    pub(super) fn of(size: f64, errors: &[f64], period: f64) -> Option<Self> {
        let window = ((MEAN_S / period).round() as usize).max(1);
        let values: Vec<f64> = errors.iter().copied().filter(|error| error.is_finite()).collect();
        let mean = |part: &[f64]| 1.0 - part.iter().sum::<f64>() / part.len() as f64 / size;
        let followed: Vec<f64> = values.windows(window).map(mean).collect();
        let end = &followed[(followed.len() as f64 * (1.0 - REST)) as usize..];
        let square = end.iter().map(|share| (1.0 - share) * (1.0 - share)).sum::<f64>();
        let most = followed.iter().copied().reduce(f64::max)?;
        let rise = followed.iter().position(|share| *share >= FOLLOWED);
        Some(Self {
            size,
            rise_s: rise.map(|i| (i + window - 1) as f64 * period),
            overshoot: (most - 1.0).max(0.0),
            rest: (square / end.len() as f64).sqrt(),
        })
    }

    /// Returns what is wrong with a response.
    pub(super) fn failure(&self) -> Option<String> {
        let percent = |share: f64| format!("{:.0} %", 100.0 * share);
        match self {
            Self { overshoot, .. } if *overshoot > MAX_OVERSHOOT => {
                Some(format!("after a step of the setpoint it overshoots by {}", percent(*overshoot)))
            }
            Self { rest, .. } if *rest > MAX_REST => {
                Some(format!("it does not settle after a step of the setpoint: the error is {} of it", percent(*rest)))
            }
            _ => None,
        }
    }
}

/// Returns the size of the step of each feature; `None` if no step is known, or if a flag of the mode would miss it.
pub(super) fn sizes(outline: &Outline, mode: &OutlinedMode, features: &[&TunedFeature]) -> Vec<Option<f64>> {
    let flag = format!("modes.{}", mode.name);
    let reads_mode = outline.nodes.iter().flat_map(|node| &node.wires).any(|wire| wire.source == flag);
    let size = |one: &&TunedFeature| {
        one.feature.compared.as_ref().filter(|_| !reads_mode)?;
        let size = match one.feature.quantity()? {
            "x" | "y" => PLACE,
            "orientation" | "angle" => ANGLE,
            _ => SHARE * one.feature.setpoint?.abs(),
        };
        (size > 0.0).then_some(size)
    };
    features.iter().map(size).collect()
}

/// Returns the name of the mode in which a feature has another setpoint.
pub(super) fn mode_name(i: usize) -> String {
    format!("{MODE}_{i}")
}

/// Returns the settings that let a mode go on through a step of each feature to the lift.
pub(super) fn settings(mode: &OutlinedMode, features: &[&TunedFeature], sizes: &[Option<f64>]) -> Vec<String> {
    let steps: Vec<usize> = (0..sizes.len()).filter(|i| sizes[*i].is_some()).collect();
    let next = |at: usize| steps.get(at).map_or_else(|| lift::MODE.to_owned(), |i| mode_name(*i));
    let mut set = vec![lift::go(mode, &next(0), BEFORE_S)];
    for (at, i) in steps.iter().enumerate() {
        let (name, feature) = (mode_name(*i), &features[*i].feature);
        let kept = mode.settings.iter().filter(|setting| setting.path != "go" && setting.path != "done");
        set.extend(kept.map(|setting| format!("modes.{name}.{}={}", setting.path, toml(setting))));
        set.push(format!("modes.{name}.go=[{}]", lift::after(&next(at + 1), LASTS_S)));
        let (Some(node), Some(size)) = (&feature.compared, sizes[*i]) else { continue };
        let setpoint = feature.setpoint.unwrap_or_default() + size;
        set.push(format!("modes.{name}.set.{node}.setpoint.{}={setpoint:?}", feature.name));
    }
    set
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The errors after a step of 2 of a second-order system with a damping ratio, for 8 s.
    fn errors(damping: f64) -> Vec<f64> {
        let (own, period) = (6.0, 0.004);
        let (mut place, mut speed) = (0.0, 0.0);
        let step = |_| {
            speed += (own * own * (2.0 - place) - 2.0 * damping * own * speed) * period;
            place += speed * period;
            2.0 - place
        };
        (0..2000).map(step).collect()
    }

    #[test]
    fn a_step_has_the_overshoot_of_its_damping() {
        for damping in [0.3_f64, 0.5, 0.9] {
            let step = Step::of(2.0, &errors(damping), 0.004).unwrap();
            let overshoot = (-std::f64::consts::PI * damping / (1.0 - damping * damping).sqrt()).exp();
            assert!((step.overshoot - overshoot).abs() < 0.02, "{damping}: {step:?}, {overshoot}");
            assert!(step.rest < 0.01 && step.failure().is_none() && step.rise_s.unwrap() < 0.8, "{step:?}");
        }
    }

    #[test]
    fn a_swing_and_a_step_that_is_not_followed_are_failures() {
        let failure = |errors: &[f64]| Step::of(2.0, errors, 0.004).unwrap().failure().unwrap();
        assert!(failure(&errors(0.0)).contains("overshoots by"), "{}", failure(&errors(0.0)));
        assert!(failure(&[2.0; 2000]).contains("the error is 100 %"));
        assert_eq!(Step::of(2.0, &[f64::NAN; 2000], 0.004), None, "an absent feature says nothing");
    }
}
