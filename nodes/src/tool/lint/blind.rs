//! A search for a contact that the blind limit stops before its mode fails.

use tactflow_runtime::source::{Code, Diagnostic};

use super::arm::Arm;
use super::mode_law::ModeLaw;

/// Returns the warning about a mode that waits for a contact and fails after a longer way than the blind limit allows.
pub(super) fn check(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    let limiter = arm.limits.iter().find(|limiter| limiter.kind == "blind_limit")?;
    let most = mode.nodes.number(mode.nodes.node(&limiter.node)?, "blind_mm")?;
    let ways = mode.fails().filter_map(|exit| exit.entry("after_travel_mm"));
    let ways = ways.filter_map(|way| Some((way.read::<f64>()?, way)));
    // The shortest one ends the mode.
    let (long, way) = ways.min_by(|(one, _), (other, _)| one.total_cmp(other))?;
    if long <= most || !mode.waits_for_contact() {
        return None;
    }
    let message = format!(
        "mode `{}` fails after {long} mm, but the limit `blind_mm` is {most}: the sensor stops there, and waits",
        mode.own_name()
    );
    let help = format!("write a way below {most} mm, or raise `blind_mm` in [limits]");
    Some(Diagnostic::new(Code::UnreachableSetpoint, way.span.clone(), message).help(help))
}
