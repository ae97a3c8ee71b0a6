//! Gains that do harm whatever is touched: derivatives of noise, integrals that wind up, and gains of zero.

use std::f64::consts::FRAC_PI_2;

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics};

use super::modes::{force_limit, setpoint};
use super::{Controlled, ModeLaw};
use crate::tool::control::law::Feature;

pub(super) fn check(arm: &Controlled<'_>, found: &mut Diagnostics) {
    for mode in &arm.modes {
        found.extend(mode.moving().filter_map(|feature| unfiltered(mode, feature)));
        found.extend(mode.moving().filter_map(|feature| windup(arm, mode, feature)));
    }
    let first = arm.modes.first().into_iter();
    found.extend(first.flat_map(|mode| mode.law.features.iter().filter_map(|feature| resting(arm, mode, feature))));
}

/// Returns the warning about a feature that has no gain in any mode. One that rests in some modes is right.
fn resting(arm: &Controlled<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    if feature.pid.is_none() || arm.has_gain(feature) {
        return None;
    }
    let name = &feature.name;
    let message = format!("the gain `kp` of `{name}` is 0 1/s: nothing corrects the error");
    let help = format!("write a gain greater than 0, or remove the wire of `{name}` to stop controlling it");
    Some(Diagnostic::new(Code::UnusualGain, mode.place_of_gain(feature, "kp"), message).help(help))
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
            // At the first touch it is the setpoint.
            let most = force_limit(arm, mode, quantity).map_or(f64::INFINITY, |(most, _)| most);
            feature.setpoint.filter(|setpoint| *setpoint > 0.0).map_or(most, |setpoint| most.min(setpoint))
        }
        _ => range(mode, feature).unwrap_or(f64::INFINITY),
    }
}

/// Returns the largest distance of a measurement from its setpoint, where its node states the range of its values.
fn range(mode: &ModeLaw<'_>, feature: &Feature) -> Option<f64> {
    let port = feature.measured.as_deref()?;
    let [min, max] = mode.nodes.writer(port)?.outputs.iter().find(|output| output.name == port)?.range?;
    let setpoint = feature.setpoint?;
    Some((setpoint - min).max(max - setpoint))
}

/// Returns the warning about an integral that grows at every error, up to a motion at full speed.
fn windup(arm: &Controlled<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    // A setpoint out of reach has its own warning.
    if setpoint(arm, mode, feature).is_some() {
        return None;
    }
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
    let scheduled = feature.schedules.iter().map(|schedule| schedule.max.max(1.0)).product::<f64>();
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
