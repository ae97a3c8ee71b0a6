//! Exits that wait for a larger force than a limit allows, or for bounds beside the setpoint that their mode holds.

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics};

use super::arm::Arm;
use super::mode_law::ModeLaw;
use crate::tool::control::exits::Exit;
use crate::tool::control::law::Feature;

/// A value that is passed, and not held, may be meant: it lasts for less than this [ms].
const HELD_MS: f64 = 100.0;

/// Returns the warnings about exits whose bounds are out of reach.
pub(super) fn exit_bounds(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Diagnostics {
    // An object that pushes the pad can take it anywhere, and then the sensor is right to leave.
    let exits = || mode.conditions().filter(|exit| !exit.to().is_some_and(|to| arm.leaves(to)));
    let mut found: Diagnostics = exits().filter_map(|exit| beyond_limit(arm, mode, exit)).collect();
    found.extend(exits().filter_map(|exit| beside_setpoint(arm, mode, exit)));
    found
}

/// Returns the warning about an exit that waits for a larger force than a limit allows.
fn beyond_limit(arm: &Arm<'_>, mode: &ModeLaw<'_>, exit: Exit<'_>) -> Option<Diagnostic> {
    let (when, above) = (exit.when()?, exit.entry("above")?);
    let quantity = arm.watched(mode, when)?;
    let (limit, key) = arm.force_limit(mode, &quantity)?;
    let bound = above.read::<f64>().filter(|bound| *bound >= limit)?;
    let message = format!(
        "an exit of mode `{}` waits for `{when}` above {bound}, but the limit `{key}` is {limit}: the sensor never presses \
         that hard",
        mode.own_name()
    );
    let help = format!("write a bound well below {limit}, or raise `{key}` in [limits]");
    Some(Diagnostic::new(Code::UnreachableSetpoint, above.span.clone(), message).help(help))
}

/// Returns the warning about an exit that waits for a value to stay between two bounds, if the mode holds this value at a
/// setpoint beside them.
fn beside_setpoint(arm: &Arm<'_>, mode: &ModeLaw<'_>, exit: Exit<'_>) -> Option<Diagnostic> {
    let (when, above, below) = (exit.when()?, exit.number("above")?, exit.number("below")?);
    let feature = mode.moving().find(|feature| arm.watches(mode, when, feature) && is_held(arm, mode, feature))?;
    let setpoint = feature.setpoint.filter(|setpoint| above < below && !(above..=below).contains(setpoint))?;
    exit.number("for_ms").filter(|ms| *ms >= HELD_MS)?;
    let message = format!(
        "an exit of mode `{}` waits until `{when}` stays between {above} and {below}, but this mode holds it at its \
         setpoint {setpoint}",
        mode.own_name()
    );
    let help = format!("write bounds around {setpoint}, or a setpoint between {above} and {below}");
    Some(Diagnostic::new(Code::UnreachableSetpoint, exit.entry("above")?.span.clone(), message).help(help))
}

/// Returns whether a mode holds a feature at its setpoint while there is a contact. A direction has no single number, and a
/// setpoint that can change while the task runs is not known.
fn is_held(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> bool {
    let key = format!("setpoint.{}", feature.name);
    let is_below = |(most, _): (f64, String)| feature.setpoint.is_some_and(|setpoint| setpoint < most);
    mode.quantity(feature)
        .is_some_and(|quantity| quantity != "orientation" && arm.force_limit(mode, quantity).is_none_or(is_below))
        && mode.deadband(feature).is_none()
        && feature.is_open_in_contact(&mode.nodes)
        && !arm.outline.live.iter().any(|range| range.name.ends_with(&key))
}
