//! Exits that wait for a larger force than a limit allows, or for bounds beside the setpoint that their mode holds.

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics};

use super::arm::Arm;
use super::mode_law::ModeLaw;
use crate::tool::control::digits::to_three_digits;
use crate::tool::control::exits::Exit;

/// Returns the warnings about exits whose bounds are out of reach.
pub(super) fn exit_bounds(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Diagnostics {
    let mut found = beyond_limits(arm, mode);
    found.extend(mode.conditions().filter_map(|exit| beside_setpoint(arm, mode, exit)));
    found
}

/// Returns the warning about an exit between two bounds, if the mode holds what it waits for at a setpoint beside them.
fn beside_setpoint(arm: &Arm<'_>, mode: &ModeLaw<'_>, exit: Exit<'_>) -> Option<Diagnostic> {
    let (when, above, below) = (exit.when()?, exit.number("above")?, exit.number("below")?);
    let feature = mode.moving().find(|feature| arm.watches(mode, when, feature))?;
    let setpoint = feature.setpoint.filter(|setpoint| above < below && !(above..=below).contains(setpoint))?;
    let message = format!(
        "an exit of mode `{}` waits for `{when}` between {above} and {below}, but this mode holds it at its setpoint \
         {setpoint}: at most it passes there",
        mode.own_name()
    );
    let [from, to] = [-0.5, 0.5].map(|side| to_three_digits(setpoint + side * (below - above)));
    let help = format!(
        "write bounds around the setpoint, for example `above = {from}, below = {to}`, or a setpoint between {above} and \
         {below}"
    );
    Some(Diagnostic::new(Code::UnreachableSetpoint, exit.entry("above")?.span.clone(), message).help(help))
}

/// Returns the warnings about exits that wait for a larger force than a limit allows.
fn beyond_limits(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Diagnostics {
    let never = mode.conditions().filter_map(|exit| {
        let (when, above) = (exit.when()?, exit.entry("above")?);
        // An object that pushes the pad can exceed the limit, and then the sensor is right to leave.
        if exit.to().is_some_and(|to| arm.leaves(to)) {
            return None;
        }
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
    });
    never.collect()
}
