//! Steps of the setpoints, one after the other, and how the features follow them.

use serde::Serialize;
use tactflow_runtime::graph::{Outline, OutlinedMode};

use super::lift::{self, Lost};
use crate::tool::control::digits::to_three_digits;
use crate::tool::control::law::{Feature, setpoint};
use crate::tool::control::nodes::{Index, Nodes, mode_flag, toml};

/// How long a task holds its setpoints before the first step [s].
const BEFORE_S: f64 = 12.0;
/// How long a setpoint stays changed [s].
const LASTS_S: f64 = 5.0;
/// Number of steps with which gains are compared.
pub(super) const STEPS: usize = 8;
/// Beginning of the names of the modes with a changed setpoint.
const MODE: &str = "tune_step";
/// Largest step of a place as a share of the pad, and the step of what is no place and no angle as a share of its setpoint
/// [1].
const PLACE_SHARE: f64 = 0.1;
const SHARE: f64 = 0.2;
/// Time over which the response is averaged [s], so that noise makes no overshoot.
const MEAN_S: f64 = 0.04;
/// Share of a step at which it counts as followed [1].
const FOLLOWED: f64 = 0.9;
/// Part of the end of a step in which a feature must rest [1].
const REST: f64 = 0.25;
/// Largest overshoot, and largest error at the end, of gains that are good whatever the old ones do [1]. A peak of the
/// sensitivity of 1.7 has an overshoot of about 0.4.
pub(super) const MAX_OVERSHOOT: f64 = 0.6;
pub(super) const MAX_REST: f64 = 0.3;
/// Overshoot or error at the end, as a multiple of that with the old gains, from which on it is worse [1].
const WORSE: f64 = 1.2;
/// Error before a step, as a share of it, up to which the response to the step says something [1].
const MAX_ERROR: f64 = 0.2;

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
    /// Integral of the absolute error, as a share of the step [s]. A loop without delay has 1 / (kp g).
    pub(super) error_s: f64,
}

impl Step {
    /// Returns what a response says, beside the mean error before it: see [`Self::of`]. `None` if the feature was absent
    /// for a while, or if it was not held before the step.
    pub(super) fn after_rest(size: f64, before: &[f64], errors: &[f64], period: f64) -> Option<Self> {
        let count = before.len() as f64;
        let square = before.iter().map(|error| error * error).sum::<f64>() / count;
        let is_held = square.is_finite() && square.sqrt() <= MAX_ERROR * size.abs();
        is_held.then_some(())?;
        let offset = before.iter().sum::<f64>() / count;
        let errors: Vec<f64> = errors.iter().map(|error| error - offset).collect();
        Self::of(size, &errors, period)
    }

    /// Returns what a response says: the errors [unit of the feature] after a step of a size, one in each period [s]. `None`
    /// if the feature was absent for a while.
    pub(super) fn of(size: f64, errors: &[f64], period: f64) -> Option<Self> {
        let window = ((MEAN_S / period).round() as usize).max(1);
        if errors.iter().any(|error| !error.is_finite()) || errors.len() < 2 * window {
            return None;
        }
        let mean = |part: &[f64]| 1.0 - part.iter().sum::<f64>() / part.len() as f64 / size;
        let followed: Vec<f64> = errors.windows(window).map(mean).collect();
        let end = end(&followed);
        let square = end.iter().map(|share| (1.0 - share) * (1.0 - share)).sum::<f64>();
        let most = followed.iter().copied().reduce(f64::max)?;
        let rise = followed.iter().position(|share| *share >= FOLLOWED);
        Some(Self {
            size,
            rise_s: rise.map(|i| (i + window - 1) as f64 * period),
            overshoot: (most - 1.0).max(0.0),
            rest: (square / end.len() as f64).sqrt(),
            error_s: followed.iter().map(|share| (1.0 - share).abs()).sum::<f64>() * period,
        })
    }

    /// Returns what is wrong with a response that is worse than the old one, if there is one.
    pub(super) fn failure(&self, old: Option<&Self>) -> Option<String> {
        let percent = |share: f64| format!("{:.0} %", 100.0 * share);
        let is_bad =
            |of: fn(&Self) -> f64, most: f64| of(self) > most && old.is_none_or(|old| of(self) > WORSE * of(old));
        if is_bad(|step| step.overshoot, MAX_OVERSHOOT) {
            return Some(format!("after a step of the setpoint it overshoots by {}", percent(self.overshoot)));
        }
        is_bad(|step| step.rest, MAX_REST).then(|| {
            format!("it does not settle after a step of the setpoint: the error is {} of the step", percent(self.rest))
        })
    }
}

/// A step of one feature.
#[derive(Debug, Clone, Copy)]
pub(super) struct Planned {
    /// The setpoint before it.
    setpoint: f64,
    pub(super) size: f64,
    /// Whether the setpoint may also become less: a light press would lose its contact.
    may_be_less: bool,
}

/// Returns the step of each feature; `None` if its setpoint is not known, or if a node reads the flag of the mode.
pub(super) fn plan(outline: &Outline, mode: &OutlinedMode, features: &[&Feature]) -> Vec<Option<Planned>> {
    let flag = mode_flag(&mode.name);
    let reads_mode = outline.nodes.iter().flat_map(|node| &node.wires).any(|wire| wire.source == flag);
    let index = Index::new(outline);
    let nodes = Nodes::new(&index, Some(mode));
    let one = |feature: &&Feature| {
        let compared = feature.compared.as_deref().filter(|_| !reads_mode)?;
        let setpoint = setpoint(&nodes, compared, &feature.name)?;
        feature.quantity()?;
        let is_place = feature.unit() == Some("m");
        let most = extent(&nodes, feature).filter(|_| is_place).map_or(f64::INFINITY, |extent| PLACE_SHARE * extent);
        let (size, may_be_less) = match feature.usual_step() {
            Some(step) => (step.min(most), true),
            None => (SHARE * setpoint, false),
        };
        (size != 0.0).then_some(Planned { setpoint, size, may_be_less })
    };
    features.iter().map(one).collect()
}

/// Returns how far the values of a place reach over the pad [m], if its node states their range.
fn extent(nodes: &Nodes<'_>, feature: &Feature) -> Option<f64> {
    feature.range(nodes).map(|[least, most]| most - least)
}

/// Returns the size of a step of a feature with its unit, where the unit is known.
pub(super) fn size(feature: &Feature, size: f64) -> String {
    let size = to_three_digits(size.abs());
    feature.unit().map_or_else(|| size.to_string(), |unit| format!("{size} {unit}"))
}

/// Returns the size of the steps of a feature, for a sentence: as a share where its unit is not known.
pub(super) fn heading(feature: &Feature, size: Option<f64>) -> String {
    let size = size.filter(|_| feature.unit().is_some()).map(|size| self::size(feature, size));
    size.unwrap_or_else(|| format!("{:.0} % of the setpoint", 100.0 * SHARE))
}

/// Returns steps of one feature: up, back, down, and back, and so on. What may not be less only steps up and back.
pub(super) fn to_and_fro(step: Planned) -> [Planned; STEPS] {
    let Planned { setpoint, size, may_be_less } = step;
    let from = |setpoint: f64, size: f64| Planned { setpoint, size, may_be_less };
    let up = [from(setpoint, size), from(setpoint + size, -size)];
    let down = if may_be_less { [from(setpoint, -size), from(setpoint - size, size)] } else { up };
    let once = [up[0], up[1], down[0], down[1]];
    std::array::from_fn(|i| once[i % once.len()])
}

/// Returns the end of the rows of a mode, in which its features must rest.
pub(super) fn end<R>(rows: &[R]) -> &[R] {
    &rows[(rows.len() as f64 * (1.0 - REST)) as usize..]
}

/// Returns the name of the mode in which a feature has another setpoint.
pub(super) fn mode_name(i: usize) -> String {
    format!("{MODE}_{i}")
}

/// Returns the modes of a trial in their order: the mode itself, one for each step, and the lift.
pub(super) fn modes(mode: &OutlinedMode, steps: &[Option<Planned>]) -> Vec<String> {
    let steps = (0..steps.len()).filter(|i| steps[*i].is_some()).map(mode_name);
    [mode.name.clone()].into_iter().chain(steps).chain([lift::MODE.to_owned()]).collect()
}

/// Returns the settings that let a mode go on through a step of each feature to the lift. What has stepped stays there, so
/// that nothing else moves with the next step.
pub(super) fn settings(mode: &OutlinedMode, features: &[&Feature], steps: &[Option<Planned>]) -> Vec<String> {
    let order = modes(mode, steps);
    let mut set = vec![lift::go(mode, &order[1], BEFORE_S)];
    let planned = features.iter().zip(steps).filter_map(|(one, step)| Some((one, (*step)?)));
    let mut stepped = Vec::new();
    for ((feature, step), names) in planned.zip(order[1..].windows(2)) {
        let [name, next] = [&names[0], &names[1]];
        let kept = mode.settings.iter().filter(|setting| setting.path != "go" && setting.path != "done");
        set.extend(kept.map(|setting| format!("modes.{name}.{}={}", setting.path, toml(setting))));
        set.push(format!("modes.{name}.go=[{}]", lift::after(next, LASTS_S)));
        set.extend(Lost::Lifts.setting(mode, name));
        let node = feature.compared.as_deref().unwrap_or_default();
        let key = format!("{node}.setpoint.{}", feature.name);
        stepped.retain(|(other, _)| *other != key);
        stepped.push((key, step.setpoint + step.size));
        set.extend(stepped.iter().map(|(key, setpoint)| format!("modes.{name}.set.{key}={setpoint:?}")));
    }
    set
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::graph::{Request, compile};

    use super::*;
    use crate::tool::control::collect::law;

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

    const HELD: [f64; 500] = [0.01; 500];

    #[test]
    fn a_step_has_the_overshoot_of_its_damping() {
        for damping in [0.3_f64, 0.5, 0.9] {
            let errors: Vec<f64> = errors(damping).iter().map(|error| error + 0.01).collect();
            let step = Step::after_rest(2.0, &HELD, &errors, 0.004).unwrap();
            let overshoot = (-std::f64::consts::PI * damping / (1.0 - damping * damping).sqrt()).exp();
            assert!((step.overshoot - overshoot).abs() < 0.02, "{damping}: {step:?}, {overshoot}");
            // It goes beyond the setpoint for long if it is damped little, which counts too.
            assert!(damping < 0.9 || (step.error_s - 2.0 * damping / 6.0).abs() < 0.03, "{damping}: {step:?}");
            assert!(step.rest < 0.01 && step.rise_s.unwrap() < 0.8, "{step:?}");
            assert_eq!(step.failure(Some(&Step { overshoot: 0.0, rest: 0.0, ..step })), None, "{step:?}");
        }
    }

    #[test]
    fn a_swing_and_a_step_that_is_not_followed_are_failures_unless_the_old_gains_have_them_too() {
        let good = Step::after_rest(2.0, &HELD, &errors(0.7), 0.004).unwrap();
        for (errors, why) in [(errors(0.0), "overshoots by"), (vec![2.0; 2000], "the error is 100 %")] {
            let step = Step::after_rest(2.0, &HELD, &errors, 0.004).unwrap();
            let failure = step.failure(Some(&good)).unwrap();
            assert!(failure.contains(why), "{failure}");
            assert_eq!(step.failure(None), Some(failure), "nothing is known of the old ones");
            assert_eq!(step.failure(Some(&step)), None);
        }
    }

    #[test]
    fn what_is_absent_or_not_held_says_nothing() {
        let gap: Vec<f64> =
            errors(0.7).into_iter().enumerate().map(|(i, e)| if i == 900 { f64::NAN } else { e }).collect();
        assert_eq!(Step::after_rest(2.0, &HELD, &gap, 0.004), None);
        assert_eq!(
            Step::after_rest(2.0, &[0.5; 500], &errors(0.7), 0.004),
            None,
            "a fourth of the step was missing before"
        );
    }

    /// Returns the steps of the features of `hybrid` on a pad of this pitch.
    fn planned(pitch: &str) -> Vec<f64> {
        let path = format!("{}/../graphs/hybrid.toml", env!("CARGO_MANIFEST_DIR"));
        let request = Request { set: vec![format!("devices.bench.pitch={pitch}")], ..Request::file(path) };
        let compiled =
            compile(&crate::catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
        let index = Index::new(compiled.outline());
        let mode = compiled.outline().modes.iter().find(|mode| mode.name == "servo").unwrap();
        let law = law(&Nodes::new(&index, Some(mode)), "sum.twist");
        let features: Vec<&Feature> = law.features.iter().collect();
        let steps = plan(compiled.outline(), mode, &features);
        steps.into_iter().map(|step| step.unwrap().size).collect()
    }

    #[test]
    fn a_place_steps_to_both_sides_and_a_pressure_never_becomes_less() {
        for (may_be_less, setpoints) in [(true, [3.0, 2.0, 1.0, 2.0]), (false, [3.0, 2.0, 3.0, 2.0])] {
            let steps = to_and_fro(Planned { setpoint: 2.0, size: 1.0, may_be_less });
            let reached: Vec<f64> = steps.iter().map(|step| step.setpoint + step.size).collect();
            assert_eq!(reached, [setpoints, setpoints].concat());
        }
    }

    #[test]
    fn a_step_stays_on_a_small_pad() {
        let near = |sizes: &[f64], expected: [f64; 3]| sizes.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9);
        let [large, small] = ["0.005", "0.001"].map(planned);
        assert!(near(&large, [5e-3, 5e-3, 0.02]), "{large:?}");
        // Its tactels reach from -7.5 to 7.5 mm.
        assert!(near(&small, [1.5e-3, 1.5e-3, 0.02]), "{small:?}");
    }
}
