//! Gains that do harm whatever is touched: derivatives of noise, and integrals that wind up.

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics};

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
    if feature.kd == 0.0 || !feature.filters.is_empty() {
        return None;
    }
    mode.quantity(feature)?;
    let name = &feature.name;
    // The difference of two samples has √2 times their noise.
    let factor = 2.0_f64.sqrt() * feature.kd / mode.nodes.period();
    let message = format!(
        "`kd` of `{name}` differentiates a signal without a filter: the noise of a sample moves the sensor with a gain of \
         {factor:.1} 1/s"
    );
    let help =
        format!("remove `kd`, or put a `low_pass` with `time_constant_ms = 20` on the wire that measures `{name}`");
    Some(Diagnostic::new(Code::UnfilteredDerivative, mode.place_of_gain(feature, "kd"), message).help(help))
}

/// Returns the warning about an integral that grows at every error, up to a motion at full speed.
fn windup(arm: &Controlled<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let pid = mode.nodes.node(feature.pid.as_deref()?)?;
    let number = |key: &str| mode.nodes.number(pid, &format!("gains.{}.{key}", feature.name));
    if feature.ki == 0.0 || number("within").is_some() {
        return None;
    }
    let limiter = arm.limits.iter().find(|limiter| limiter.kind == "twist_limit")?;
    let limiter = mode.nodes.node(&limiter.node)?;
    let [linear, angular] =
        ["linear_m_per_s", "angular_rad_per_s"].map(|key| mode.nodes.number(limiter, key).unwrap_or(f64::INFINITY));
    // The control at which the first component of the motion reaches its limit.
    let shares = (0..6).map(|i| if i < 3 { linear } else { angular } / feature.column[i].abs());
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
    let help = format!(
        "write `within` in the gains of `{name}`, about five times its noise, or a `limit` below {full}, where the motion \
         reaches its limit"
    );
    Some(Diagnostic::new(Code::Windup, mode.place_of_gain(feature, "ki"), message).help(help))
}
