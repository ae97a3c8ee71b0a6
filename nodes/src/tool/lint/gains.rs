//! Gains that do harm whatever is touched: derivatives of noise, integrals that wind up, and gains of zero.

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics};

use super::arm::Arm;
use super::deadbands::hunting;
use super::geometry::is_force;
use super::mode_law::ModeLaw;
use super::reach::unreachable;
use crate::tool::control::contacts::Answer;
use crate::tool::control::digits::{to_three_digits, to_two_digits};
use crate::tool::control::law::Feature;

pub(super) fn check(arm: &Arm<'_>) -> Diagnostics {
    let mut found = Diagnostics::new();
    for mode in &arm.modes {
        found.extend(mode.moving().filter_map(|feature| unfiltered(mode, feature, "remove `kd`")));
        found.extend(mode.moving().filter_map(|feature| slow(arm, mode, feature)));
        found.extend(mode.moving().filter_map(|feature| hunting(mode, feature).or_else(|| windup(arm, mode, feature))));
    }
    let first = arm.modes.first().into_iter();
    found.extend(first.flat_map(|mode| mode.law.features.iter().filter_map(|feature| resting(arm, mode, feature))));
    found
}

/// Returns the warning about a feature that has no gain in any mode. One that rests in some modes is right.
fn resting(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    if feature.pid.is_none() || arm.has_gain(feature) {
        return None;
    }
    let name = &feature.name;
    let message = format!("the gain `kp` of `{name}` is 0 1/s: nothing corrects the error");
    let help = format!("write a gain greater than 0, or remove the wire of `{name}` to stop controlling it");
    // A gain that is written nowhere has no place of its own.
    let pid = feature.pid.as_deref().and_then(|pid| mode.nodes.node(pid));
    let gain = mode.place_of_gain(feature, "kp");
    let place = if pid.is_some_and(|pid| pid.span == gain) { mode.place_of_column(feature) } else { gain };
    Some(Diagnostic::new(Code::UnusualGain, place, message).help(help))
}

/// A `within` bounds an integral below this share of the largest error [1].
const MOST_WITHIN: f64 = 0.9;

/// Gain of a loop that needs a minute for two thirds of an error [1/s].
const MIN_LOOP_GAIN: f64 = 1.0 / 60.0;

/// Returns the warning about a loop that hardly corrects an error: its column is in another unit, or its control has a
/// limit that is too small.
fn slow(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let quantity = mode.quantity(feature)?;
    let gain = largest_gain(arm, feature, quantity)?;
    let rate = feature.kp * feature.largest_schedule() * gain;
    let is_alone = feature.kp > 0.0 && feature.ki == 0.0 && feature.beside.is_empty();
    if rate >= MIN_LOOP_GAIN || !is_alone {
        return limited(mode, feature, quantity, gain);
    }
    let (name, time) = (&feature.name, (1.0 / rate).round());
    let message = format!("the loop of `{name}` takes {time} s for two thirds of an error: it hardly moves the sensor");
    let help =
        format!("write a larger `kp` of `{name}`, or check the unit of its column: it moves the sensor in m and rad");
    Some(Diagnostic::new(Code::UnusualGain, mode.place_of_column(feature), message).help(help))
}

/// Returns the largest change of a feature for one unit of its control, as the contacts of the bench or geometry say;
/// `None` if the column rolls, and no contact states how far a place moves then.
pub(super) fn largest_gain(arm: &Arm<'_>, feature: &Feature, quantity: &str) -> Option<f64> {
    let stated: Vec<&Answer> = arm.contacts.iter().filter_map(|contact| contact.features.get(quantity)).collect();
    let rolls = |i: &usize| feature.column[*i] != 0.0 && !stated.iter().any(|answer| answer.row()[*i] != 0.0);
    if matches!(quantity, "x" | "y") && [3, 4].iter().any(rolls) {
        return None;
    }
    let geometry = Answer::of_geometry(quantity);
    let gains = stated.into_iter().chain(&geometry).map(|answer| answer.along(&feature.column));
    gains.reduce(f64::max).filter(|gain| *gain > 0.0)
}

/// Returns the warning about a limit with which a usual error takes minutes.
fn limited(mode: &ModeLaw<'_>, feature: &Feature, quantity: &str, gain: f64) -> Option<Diagnostic> {
    let (usual, unit) = match quantity {
        "x" | "y" => (0.01_f64.min(mode.farthest(feature)?), "m"),
        "orientation" => (0.5, "rad"),
        // At the first touch the error is the setpoint.
        "pressure" => (feature.setpoint.filter(|setpoint| *setpoint > 0.0)?, "N/tactel"),
        "force" => (feature.setpoint.filter(|setpoint| *setpoint > 0.0)?, "N"),
        _ => return None,
    };
    let limit = mode.gain(feature, "limit")?;
    let time = usual / (limit * gain);
    if time * MIN_LOOP_GAIN <= 1.0 {
        return None;
    }
    let (name, place) = (&feature.name, mode.place_of_gain(feature, "limit"));
    let message = format!(
        "the control of `{name}` has a limit of {limit} {unit}/s: an error of {usual} {unit} takes {time:.0} s"
    );
    let least = to_two_digits(usual / gain, libm::ceil);
    let help = format!("write a `limit` of {least} {unit}/s or more, or remove it");
    Some(Diagnostic::new(Code::UnusualGain, place, message).help(help))
}

/// Returns the warning about a derivative of a feature that no filter smooths. `instead` is one way out.
pub(super) fn unfiltered(mode: &ModeLaw<'_>, feature: &Feature, instead: &str) -> Option<Diagnostic> {
    let period = feature.period_s;
    // The difference of two samples has √2 times their noise.
    let factor = 2.0_f64.sqrt() * feature.kd / period;
    let is_smooth = |smoothing: f64| smoothing >= period * (1.0 - 1e-9);
    // A filter of less than a period smooths nothing, and a share below that of `kp` does no harm.
    if is_smooth(feature.least_smoothing()) || factor <= feature.kp {
        return None;
    }
    mode.quantity(feature)?;
    let name = &feature.name;
    let is_switched = is_smooth(feature.smoothing());
    let filter = if feature.least_smoothing() > 0.0 { "behind a short filter" } else { "without a filter" };
    let side = if is_switched { " on one side of a `switch`" } else { "" };
    let message = format!(
        "`kd` of `{name}` differentiates a signal {filter}{side}: the noise of a sample moves the sensor with a gain of \
         {factor:.1} 1/s"
    );
    let smooth = (5.0 * period * 1e3).max(20.0).ceil();
    let place = if is_switched { "on this side" } else { &format!("on the wire that measures `{name}`") };
    let help = format!("{instead}, or put a `low_pass` with `time_constant_ms = {smooth}` {place}");
    Some(Diagnostic::new(Code::UnfilteredDerivative, mode.place_of_gain(feature, "kd"), message).help(help))
}

/// Returns the error at which a mode is left for one in which the feature has no integral. That of a force is large before
/// it is pressed, and that of a place can be large in both directions.
fn left_at(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<f64> {
    let rests = |name: &str| {
        let other = arm.mode(name);
        let mut features = other.into_iter().flat_map(|mode| &mode.law.features);
        features.any(|one| one.id() == feature.id() && one.ki == 0.0)
    };
    let exits = mode
        .exits("go")
        .filter(|exit| exit.when().is_some_and(|port| feature.is_error(port)) && exit.to().is_some_and(rests));
    let exits: Vec<_> = exits.collect();
    let above = exits.iter().find_map(|exit| exit.number("above"))?;
    let below = exits.iter().find_map(|exit| exit.number("below"));
    match mode.quantity(feature) {
        Some(quantity) if is_force(quantity) => Some(above),
        _ => below.map(|below| above.max(-below)),
    }
}

/// Returns the warning about an integral that grows at every error, up to a motion at full speed.
fn windup(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    // A setpoint out of reach has its own warning.
    if unreachable(arm, mode, feature).is_some() {
        return None;
    }
    let number = |key: &str| mode.gain(feature, key);
    let largest = arm.largest_error(mode, feature);
    let is_bound = |error: f64| error < MOST_WITHIN * largest;
    if feature.ki == 0.0 || number("within").is_some_and(is_bound) || left_at(arm, mode, feature).is_some_and(is_bound)
    {
        return None;
    }
    let limiter = arm.limits.iter().find(|limiter| limiter.kind == "twist_limit")?;
    let limiter = mode.nodes.node(&limiter.node)?;
    let [linear, angular] =
        ["linear_m_per_s", "angular_rad_per_s"].map(|key| mode.nodes.number(limiter, key).unwrap_or(f64::INFINITY));
    // The control at which the first component of the motion reaches its limit.
    let scheduled = feature.largest_schedule();
    let shares = (0..6).map(|i| if i < 3 { linear } else { angular } / (scheduled * feature.column[i].abs()));
    let full = shares.fold(f64::INFINITY, f64::min);
    let bound = [number("bound"), number("limit")].into_iter().flatten().fold(f64::INFINITY, f64::min);
    if bound < full {
        return None;
    }
    let name = &feature.name;
    let (why, within, key) = match number("within") {
        Some(own) => (
            format!(
                ", because its `within` of {own} is at least nine tenths of the largest error, {}",
                to_three_digits(largest)
            ),
            "a smaller `within`",
            "within",
        ),
        None => (String::new(), "`within`", "ki"),
    };
    let message = format!(
        "the integral of `{name}` grows at every error that occurs{why}. At last it alone moves the sensor at full speed: \
         it winds up while the contact sticks or the object moves, and overshoots"
    );
    let example = usual_within(mode, feature).filter(|within| is_bound(*within));
    let example = example.map(|within| format!(", for example `within = {within}`")).unwrap_or_default();
    let help = format!("write {within} in the gains of `{name}`, about five times its noise{example}");
    Some(Diagnostic::new(Code::Windup, mode.place_of_gain(feature, key), message).help(help))
}

/// Returns an error below which a feature is usually integrated: more than its noise, and much less than a step.
fn usual_within(mode: &ModeLaw<'_>, feature: &Feature) -> Option<f64> {
    match mode.quantity(feature)? {
        "x" | "y" => Some(0.002),
        "orientation" => Some(0.05),
        quantity if is_force(quantity) => feature.setpoint.map(|setpoint| to_two_digits(0.2 * setpoint, libm::floor)),
        _ => None,
    }
}
