//! A search for a contact that the blind limit stops before its mode fails.

use tactflow_runtime::source::{Code, Diagnostic};

use super::arm::Arm;
use super::mode_law::ModeLaw;

/// Returns the warning about a mode that waits for a contact and fails after a longer way than the blind limit allows.
pub(super) fn check(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    let limiter = arm.limits.iter().find(|limiter| limiter.kind == "blind_limit")?;
    let limiter = mode.nodes.node(&limiter.node)?;
    let most = mode.nodes.number(limiter, "blind_mm")?;
    // Inside of a clear box nothing counts, and the search may be there.
    if mode.nodes.value(limiter, "clear_min_m").is_some() {
        return None;
    }
    let ways = mode.fails().filter_map(|exit| exit.entry("after_travel_mm"));
    let ways = ways.filter_map(|way| Some((way.read::<f64>()?, way)));
    // The shortest one ends the mode.
    let (long, way) = ways.min_by(|(one, _), (other, _)| one.total_cmp(other))?;
    let ends_before = way_in_time(mode).is_some_and(|way| way <= most);
    if long <= most || ends_before || !mode.waits_for_contact() {
        return None;
    }
    let message = format!(
        "mode `{}` fails after {long} mm, but the limit `blind_mm` is {most}: the sensor stops there, and waits",
        mode.own_name()
    );
    let help = format!("write a way below {most} mm, or raise `blind_mm` in [limits]");
    Some(Diagnostic::new(Code::UnreachableSetpoint, way.span.clone(), message).help(help))
}

/// Returns how far a mode moves the sensor at most until its time ends it [mm]; `None` if it has none, or if its speed is
/// not known.
fn way_in_time(mode: &ModeLaw<'_>) -> Option<f64> {
    let times = mode.conditions().chain(mode.fails()).filter_map(|exit| exit.number("after_ms"));
    let time_ms = times.reduce(f64::min)?;
    let along = |i: usize| mode.law.constants.iter().map(|constant| constant.twist[i]).sum::<f64>();
    // A corner of the pad moves further when the sensor turns.
    let turns = (3..6).any(|i| mode.law.constants.iter().any(|constant| constant.twist[i] != 0.0));
    let is_known = mode.law.guidance.is_empty() && !turns;
    is_known.then(|| libm::sqrt((0..3).map(|i| along(i) * along(i)).sum::<f64>()) * time_ms)
}
