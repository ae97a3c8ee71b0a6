//! Limits of the acceleration that stop a place too late.

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics, Edit};

use super::arm::Arm;
use super::gains::largest_gain;
use super::mode_law::ModeLaw;
use crate::tool::control::digits::{down_to_two_digits, to_two_digits};
use crate::tool::control::law::Feature;

/// Distance from which a place is usually centred [m].
const USUAL_ERROR_M: f64 = 0.01;
/// Part of the acceleration K² e with which a gain K begins to reduce an error e. With a limit below this part of it, the
/// place goes on beyond its setpoint by more than a tenth of the error; from a quarter on, it does not [1].
const TOO_LATE: f64 = 0.15;

/// Gain from which on the gain is the mistake, and not the limit: other warnings ask for a smaller one [1/s].
const TOO_FAST: f64 = 12.0;

pub(super) fn check(arm: &Arm<'_>) -> Diagnostics {
    let of_mode = |mode| ModeLaw::moving(mode).filter_map(move |feature| too_late(arm, mode, feature));
    arm.modes.iter().flat_map(of_mode).collect()
}

/// Returns the warning about a place that a limit of the acceleration carries beyond its setpoint.
fn too_late(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let quantity = mode.quantity(feature).filter(|quantity| matches!(*quantity, "x" | "y"))?;
    let error = USUAL_ERROR_M.min(mode.farthest(feature)?);
    let gain = largest_gain(arm, feature, quantity)?;
    let rate = feature.kp * feature.largest_schedule() * gain;
    let limiter = arm.limits.iter().find(|limiter| limiter.kind == "acceleration_limit")?;
    let node = mode.nodes.node(&limiter.node)?;
    let key = "linear_m_per_s2";
    let limit = mode.nodes.number(node, key)?;
    // The limit is that of the sensor, and the gain that of the place.
    let moves = feature.column[..3].iter().map(|entry| entry.abs()).fold(0.0, f64::max);
    let needed = TOO_LATE * rate * rate * error * moves / gain;
    if limit >= needed || rate > TOO_FAST || moves == 0.0 {
        return None;
    }
    let name = &feature.name;
    let message = format!(
        "the limit `{key}` of {limit} m/s² stops `{name}` too late: its loop has a gain of {rate:.1} 1/s, so an error of \
         {:.0} mm goes on beyond the setpoint by more than a tenth",
        error * 1e3
    );
    let most = down_to_two_digits(feature.kp * (limit / needed).sqrt());
    let least = to_two_digits(needed, libm::ceil);
    let help =
        format!("write `{key} = {least}` or more in [limits], or `kp = {most}` or less in the gains of `{name}`");
    let place = mode.place_of_gain(feature, "kp");
    let edit = Edit::Replace(place.clone(), most.to_string());
    Some(Diagnostic::new(Code::UnusualGain, place, message).help(help).edit(edit))
}
