//! Gains that do harm whatever is touched: derivatives of noise, and integrals that wind up.

use std::f64::consts::FRAC_PI_2;

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics};

use super::modes::force_limit;
use super::{Controlled, ModeLaw};
use crate::tool::control::law::Feature;

pub(super) fn check(arm: &Controlled<'_>, found: &mut Diagnostics) {
    for mode in &arm.modes {
        found.extend(mode.moving().filter_map(|feature| unfiltered(mode, feature)));
        found.extend(mode.moving().filter_map(|feature| windup(arm, mode, feature)));
    }
}

/// Returns the warning about a derivative of a feature that no filter smooths.
fn unfiltered(mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let period = mode.nodes.period();
    // The difference of two samples has √2 times their noise.
    let factor = 2.0_f64.sqrt() * feature.kd / period;
    // A filter of less than a period smooths nothing, and a share below that of `kp` does no harm.
    if feature.smoothing() >= period || factor <= feature.kp {
        return None;
    }
    mode.quantity(feature)?;
    let name = &feature.name;
    let message = format!(
        "`kd` of `{name}` differentiates a signal without a filter: the noise of a sample moves the sensor with a gain of \
         {factor:.1} 1/s"
    );
    let smooth = (5.0 * period * 1e3).max(20.0).ceil();
    let help = format!(
        "remove `kd`, or put a `low_pass` with `time_constant_ms = {smooth}` on the wire that measures `{name}`"
    );
    Some(Diagnostic::new(Code::UnfilteredDerivative, mode.place_of_gain(feature, "kd"), message).help(help))
}

/// Returns the largest error that a feature can have, as far as it is known.
fn largest_error(arm: &Controlled<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> f64 {
    match mode.quantity(feature) {
        Some("orientation") => FRAC_PI_2,
        Some(quantity @ ("pressure" | "force")) => {
            force_limit(arm, mode, quantity).map_or(f64::INFINITY, |(most, _)| most)
        }
        _ => f64::INFINITY,
    }
}

/// Returns the warning about an integral that grows at every error, up to a motion at full speed.
fn windup(arm: &Controlled<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let pid = mode.nodes.node(feature.pid.as_deref()?)?;
    let number = |key: &str| mode.nodes.number(pid, &format!("gains.{}.{key}", feature.name));
    if feature.ki == 0.0 || number("within").is_some_and(|within| within < largest_error(arm, mode, feature)) {
        return None;
    }
    let limiter = arm.limits.iter().find(|limiter| limiter.kind == "twist_limit")?;
    let limiter = mode.nodes.node(&limiter.node)?;
    let [linear, angular] =
        ["linear_m_per_s", "angular_rad_per_s"].map(|key| mode.nodes.number(limiter, key).unwrap_or(f64::INFINITY));
    // The control at which the first component of the motion reaches its limit.
    let scheduled = feature.schedule.as_ref().map_or(1.0, |schedule| schedule.max.max(1.0));
    let shares = (0..6).map(|i| if i < 3 { linear } else { angular } / (scheduled * feature.column[i].abs()));
    let full = shares.fold(f64::INFINITY, f64::min);
    let bound = [number("bound"), number("limit")].into_iter().flatten().fold(f64::INFINITY, f64::min);
    if bound < full {
        return None;
    }
    let name = &feature.name;
    let message = format!(
        "the integral of `{name}` grows at every error until it alone moves the sensor at full speed: it winds up while \
         the object is far, and overshoots"
    );
    let full = (full * 1e3).round() / 1e3;
    let within = if number("within").is_some() { "a smaller `within`" } else { "`within`" };
    let help = format!(
        "write {within} in the gains of `{name}`, about five times its noise, or a `limit` below {full}, where the motion \
         reaches its limit"
    );
    Some(Diagnostic::new(Code::Windup, mode.place_of_gain(feature, "ki"), message).help(help))
}
