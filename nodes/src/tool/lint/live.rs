//! Gains and setpoints that may change while the arm moves, up to values with which the task fails.

use std::ops::Range;

use tactflow_runtime::graph::OutlinedRange;
use tactflow_runtime::source::{Code, Diagnostic, Diagnostics, Edit};

use super::arm::Arm;
use super::gains::unfiltered;
use super::mode_law::ModeLaw;
use super::reach::{beside_window, unreachable_setpoint};
use super::stability::{KEPT, is_known, over, unmeasured};
use crate::tool::control::choose::Wanted;
use crate::tool::control::digits::down_to_two_digits;
use crate::tool::control::law::Feature;
use crate::tool::control::margins::margins;
use crate::tool::control::response::Loop;

/// What a loop has to keep with the largest gain of a range.
const LEFT: Wanted = Wanted { peak: f64::INFINITY, gain_db: 3.0, phase_deg: 0.0 };
/// Number of gains that are tried, each 5 % smaller than the one before: down to a ten thousandth of the largest.
const TRIED: usize = 180;

pub(super) fn check(arm: &Arm<'_>) -> Diagnostics {
    let loops = || arm.modes.iter().flat_map(|mode| mode.moving().map(move |feature| (mode, feature)));
    let of_range = |range| loops().filter_map(move |(mode, feature)| Changed::of(feature, range)?.judge(arm, mode));
    let tightest = |range| of_range(range).min_by(|(one, _), (other, _)| one.total_cmp(other));
    let all = |range| {
        let tightest = tightest(range).map(|(_, found)| found);
        let noise = loops().find_map(|(mode, feature)| noisy(mode, feature, range));
        let mut found: Diagnostics = noise.or(tightest).into_iter().collect();
        found.extend(loops().find_map(|(_, feature)| reversed(feature, range)));
        found.extend(loops().find_map(|(mode, feature)| out_of_reach(arm, mode, feature, range)).into_iter().flatten());
        found
    };
    arm.outline.live.iter().flat_map(all).collect()
}

/// Returns the gain of a feature that a range is about, and its value as written.
fn gain(feature: &Feature, range: &OutlinedRange) -> Option<(&'static str, f64)> {
    let (node, gain) = range.name.split_once(".gains.")?;
    let (name, key) = gain.rsplit_once('.')?;
    let gains = [("kp", feature.kp), ("ki", feature.ki), ("kd", feature.kd)];
    let is_own = feature.pid.as_deref() == Some(node) && feature.name == name;
    gains.into_iter().find(|(one, _)| is_own && *one == key)
}

/// Returns a feature with another gain.
fn with(feature: &Feature, key: &str, gain: f64) -> Feature {
    let mut feature = feature.clone();
    match key {
        "kp" => feature.kp = gain,
        "ki" => feature.ki = gain,
        _ => feature.kd = gain,
    }
    feature
}

/// Returns the warning about a range that reaches down to a gain of the wrong sign.
fn reversed(feature: &Feature, range: &OutlinedRange) -> Option<Diagnostic> {
    let ([least, _], [place, _]) = (range.range, &range.spans);
    let (key, _) = gain(feature, range).filter(|_| least < 0.0)?;
    let what = if key == "kd" { "takes damping from the loop of" } else { "increases the error of" };
    let message = format!("`{}` may become {least}: the motion then {what} `{}`", range.name, feature.name);
    let diagnostic = Diagnostic::new(Code::UnusualGain, place.clone(), message);
    Some(diagnostic.help("write `min = 0.0` or more").edit(Edit::Replace(place.clone(), "0.0".into())))
}

/// Returns the warning about a range that reaches up to a derivative gain that makes too much of the noise.
fn noisy(mode: &ModeLaw<'_>, feature: &Feature, range: &OutlinedRange) -> Option<Diagnostic> {
    let ([_, most], [_, place]) = (range.range, &range.spans);
    gain(feature, range).filter(|(key, value)| *key == "kd" && *value < most)?;
    // Of this gain, noise is amplified as much as by `kp`.
    let good = down_to_two_digits(feature.kp * feature.period_s * std::f64::consts::FRAC_1_SQRT_2);
    let noise = |feature: &Feature| unfiltered(mode, feature, &format!("write `max = {good}` or less"));
    let found = noise(&with(feature, "kd", most)).filter(|_| noise(feature).is_none())?;
    let message = format!("`{}` may become {most}, and then {}", range.name, found.message);
    Some(Diagnostic { span: place.clone(), message, ..found })
}

/// Returns the warnings about a range of a setpoint that reaches beyond a limit, a threshold, a window, or the pad.
fn out_of_reach(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature, range: &OutlinedRange) -> Option<Diagnostics> {
    let (node, name) = range.name.split_once(".setpoint.")?;
    let is_own = feature.compared.as_deref() == Some(node) && feature.name == name;
    if !is_own || beyond(arm, mode, feature).is_some() {
        return None;
    }
    let ends = range.range.into_iter().zip(&range.spans);
    let found = ends.filter_map(|(setpoint, place)| {
        let found = beyond(arm, mode, &Feature { setpoint: Some(setpoint), ..feature.clone() })?;
        let message = format!("`{}` may become {setpoint}: {}", range.name, found.message);
        Some(Diagnostic { span: place.clone(), message, ..found })
    });
    Some(found.collect())
}

/// Returns the warning about a setpoint that is out of reach.
fn beyond(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let known = unreachable_setpoint(arm, mode, feature).or_else(|| beside_window(mode, feature));
    known.or_else(|| {
        let setpoint = feature.setpoint.filter(|_| matches!(mode.quantity(feature), Some("x" | "y")))?;
        let [from, to] = mode.range(feature).filter(|[from, to]| !(*from..=*to).contains(&setpoint))?;
        let message = format!("the pad measures `{}` from {from} to {to} m", feature.name);
        let help = format!("let the range end well inside of {from} to {to}");
        Some(Diagnostic::new(Code::UnreachableSetpoint, mode.place_of_setpoint(feature)?, message).help(help))
    })
}

/// A feature with a gain that may change.
struct Changed<'a> {
    feature: &'a Feature,
    key: &'static str,
    value: f64,
    /// The largest value that it may have, and where that is written.
    most: f64,
    place: &'a Range<usize>,
    /// Its name in `[live]`.
    name: &'a str,
}

impl<'a> Changed<'a> {
    /// Returns the feature if the range is that of one of its gains, and allows a larger one.
    fn of(feature: &'a Feature, range: &'a OutlinedRange) -> Option<Self> {
        let (key, value) = gain(feature, range)?;
        let ([_, most], [_, place]) = (range.range, &range.spans);
        (value < most).then_some(Self { feature, key, value, most, place, name: &range.name })
    }

    /// Returns the feature with another gain.
    fn with(&self, gain: f64) -> Feature {
        with(self.feature, self.key, gain)
    }

    /// Returns the warning about a range that reaches up to a gain with which a loop is unstable or nearly so, and the
    /// largest gain that keeps the margins. A loop that is so as written has its own warning.
    fn judge(&self, arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Option<(f64, Diagnostic)> {
        let contacts = &*arm.contacts_or_geometry();
        if !is_known(mode, self.feature, contacts) {
            return None;
        }
        let around = |gain: f64, contact| Loop::over(&self.with(gain), contact).filter(|around| !around.is_reversed());
        let is = |holds: &dyn Fn(&Loop) -> bool, gain, contact| around(gain, contact).is_none_or(|one| holds(&one));
        let is_stable = |around: &Loop| margins(around).is_stable;
        let is_left = |around: &Loop| LEFT.holds(&margins(around));
        let unstable = contacts.iter().find(|contact| !is(&is_stable, self.most, contact));
        let shaken = unstable.or_else(|| contacts.iter().find(|contact| !is(&is_left, self.most, contact)))?;
        if !is(&is_left, self.value, shaken) {
            return None;
        }
        let holds = |gain: &f64| contacts.iter().all(|one| is(&|around| KEPT.holds(&margins(around)), *gain, one));
        let tried = std::iter::successors(Some(self.most), |gain| Some(gain * 0.95)).take(TRIED);
        let best = tried.take_while(|gain| *gain > self.value).find(holds).map(down_to_two_digits);
        let (key, name, place) = (self.key, &self.feature.name, self.place);
        let gain_db = around(self.most, shaken).and_then(|around| margins(&around).gain_db).unwrap_or_default();
        let then = match unstable {
            Some(_) => format!("the loop of `{name}` is then unstable"),
            None => format!("the gain margin of the loop of `{name}` is then only {gain_db:.1} dB"),
        };
        let message = format!("`{}` may become {}, and {then} {}", self.name, self.most, over(shaken.name()));
        let diagnostic = Diagnostic::new(Code::LowMargin, place.clone(), message)
            .note(mode.place_of_gain(self.feature, key), format!("`{key}` is {} as written", self.value));
        // A range that ends below the gain as written is a mistake.
        let best = best.filter(|best| *best > self.value);
        let found = match best {
            Some(best) => {
                let kp = Some(best).filter(|_| self.key == "kp");
                let why = unmeasured(self.feature, contacts, shaken.name(), kp).unwrap_or_default();
                let help = format!("write `max = {best}` or less{why}");
                diagnostic.help(help).edit(Edit::Replace(place.clone(), format!("{best:?}")))
            }
            None => diagnostic.help("no larger gain keeps the margins: remove the line from `[live]`"),
        };
        Some((best.unwrap_or(self.value), found))
    }
}
