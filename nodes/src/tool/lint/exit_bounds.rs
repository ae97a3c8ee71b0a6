//! Exits that wait for a larger force than a limit allows.

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics};

use super::arm::Arm;
use super::mode_law::ModeLaw;

/// Returns the warnings about exits that wait for a larger force than a limit allows.
pub(super) fn exit_bounds(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Diagnostics {
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
