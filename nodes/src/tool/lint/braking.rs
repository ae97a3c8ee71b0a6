//! Limits of the acceleration that stop a place too late.

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics};

use super::arm::Arm;
use super::gains::largest_gain;
use super::mode_law::ModeLaw;
use crate::tool::control::digits::{down_to_two_digits, to_two_digits};
use crate::tool::control::law::Feature;

/// Distance from which a place is usually centred [m].
const USUAL_ERROR_M: f64 = 0.01;
/// Part of the acceleration K² e with which a gain K begins to reduce an error e. With a limit below this part of it, the
/// place goes on beyond its setpoint by more than a tenth of the error [1].
const TOO_LATE: f64 = 0.15;
/// Part of the same acceleration that stops the place in time, also with a delay [1].
const IN_TIME: f64 = 0.4;
/// Gain from which on the gain is the mistake, and not the limit: other warnings ask for a smaller one [1/s].
const TOO_FAST: f64 = 12.0;

pub(super) fn check(arm: &Arm<'_>) -> Diagnostics {
    let mut found = Diagnostics::new();
    for mode in &arm.modes {
        found.extend(mode.moving().filter_map(|feature| too_late(arm, mode, feature)));
    }
    found
}

/// Returns the warning about a place that a limit of the acceleration carries beyond its setpoint.
fn too_late(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let quantity = mode.quantity(feature).filter(|quantity| matches!(*quantity, "x" | "y"))?;
    let gain = largest_gain(arm, feature, quantity)?;
    let moves = feature.column[..3].iter().map(|entry| entry.abs()).fold(0.0, f64::max);
    let rate = feature.kp * feature.largest_schedule() * gain;
    if rate > TOO_FAST || moves == 0.0 {
        return None;
    }
    let limit_of = |kind: &str, key: &str| {
        let limiter = arm.limits.iter().find(|limiter| limiter.kind == kind)?;
        mode.nodes.number(mode.nodes.node(&limiter.node)?, key)
    };
    let key = "linear_m_per_s2";
    let limit = limit_of("acceleration_limit", key)?;
    // The limits are those of the sensor, and the gain is that of the place. One that moves slowly stops as from a small error.
    let fastest = limit_of("twist_limit", "linear_m_per_s").unwrap_or(f64::INFINITY) * gain / moves;
    let fastest = fastest.min(feature.limit.unwrap_or(f64::INFINITY) * gain);
    let error = USUAL_ERROR_M.min(mode.farthest(feature)?).min(fastest / rate);
    let needed = rate * rate * error * moves / gain;
    if limit >= TOO_LATE * needed {
        return None;
    }
    let name = &feature.name;
    let message = format!(
        "{}the limit `{key}` of {limit} m/s² stops `{name}` too late: its loop has a gain of {rate:.1} 1/s, so the place goes \
         on beyond its setpoint by more than {:.1} mm",
        mode.prefix(),
        100.0 * error
    );
    let most = down_to_two_digits(feature.kp * (limit / (IN_TIME * needed)).sqrt());
    let least = to_two_digits(IN_TIME * needed, libm::ceil);
    let help =
        format!("write `{key} = {least}` or more in [limits], or `kp = {most}` or less in the gains of `{name}`");
    Some(Diagnostic::new(Code::UnusualGain, mode.place_of_gain(feature, "kp"), message).help(help))
}
