//! Modes: rolling without force control, a recovery that is faster than the approach, a position along a line, and
//! setpoints that a limit keeps a task from.

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics, Value};

use super::columns::line_axis;
use super::{Controlled, ModeLaw};
use crate::motion::COMPONENTS;
use crate::tool::control::law::Feature;
use crate::tool::control::settings::source;

/// Nodes that guide the sensor along the object, and do not press.
const GUIDES: [&str; 6] = ["scan_guide", "ridge_guide", "hold_pose", "follow_path", "follow_surface", "park"];

pub(super) fn check(arm: &Controlled<'_>, found: &mut Diagnostics) {
    for mode in &arm.modes {
        found.extend(rolling(mode));
        found.extend(recovery(arm, mode));
        found.extend(along_line(mode));
        found.extend(mode.moving().filter_map(|feature| setpoint(arm, mode, feature)));
    }
}

/// Returns the warning about a mode whose features roll the sensor while nothing controls the force.
fn rolling(mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    let rolls = |feature: &&Feature| {
        let is_place = matches!(mode.quantity(feature), Some("x" | "y"));
        is_place && (feature.column[3] != 0.0 || feature.column[4] != 0.0)
    };
    let rolling = mode.moving().find(rolls)?;
    let presses = |feature: &Feature| {
        let is_place = matches!(mode.quantity(feature), Some("x" | "y" | "orientation"));
        // `pid` warns of a force without a gain.
        feature.column[2] != 0.0 && !is_place
    };
    let mut guides = mode.law.guidance.iter();
    if mode.law.features.iter().any(presses) || guides.any(|it| it.passes[2] && !GUIDES.contains(&&*it.kind)) {
        return None;
    }
    let i = if rolling.column[3] == 0.0 { 4 } else { 3 };
    let message = format!(
        "{}`{}` rolls the sensor with `{}`, but no feature of the force moves `vz`: the pad loses the contact, or presses \
         harder and harder",
        mode.named(),
        rolling.name,
        COMPONENTS[i]
    );
    let help = "control the pressure along `vz` in this mode, or select no rolling: 0 for `wx` and `wy`";
    Some(Diagnostic::new(Code::UnforcedRolling, mode.place_of_column(rolling), message).help(help))
}

/// Returns the speed along +z with which a mode moves the sensor whatever it feels [m/s].
fn approach(mode: &ModeLaw<'_>) -> f64 {
    mode.law.constants.iter().map(|constant| constant.twist[2]).sum()
}

/// Returns the warning about a lost contact that is searched for faster than the task has approached it.
fn recovery(arm: &Controlled<'_>, mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    let exit = mode.mode?.settings.iter().find(|setting| setting.path == "on_lost")?;
    let target: &Value = exit.value.as_table()?.get("to")?;
    let named = |name: &str| {
        let is_named = |mode: &&ModeLaw<'_>| mode.mode.is_some_and(|mode| mode.name.rsplit('.').next() == Some(name));
        arm.modes.iter().find(is_named)
    };
    let task = arm.outline.tasks.iter().find(|task| task.name == arm.task);
    let settings = task.map_or(&arm.outline.settings, |task| &task.settings);
    let start = settings.iter().find(|setting| setting.path == "start")?.value.as_str()?;
    let (first, again) = (approach(named(start)?), approach(named(target.as_str()?)?));
    if !(first > 0.0 && again > first * (1.0 + 1e-9)) {
        return None;
    }
    let name = target.as_str()?;
    let message = format!(
        "after a lost contact, mode `{name}` moves toward the object with {again} m/s: faster than mode `{start}`, which \
         approaches with {first} m/s"
    );
    let help = format!(
        "let `{name}` move with {first} m/s or less along +z: the object is near, and a fast touch presses hard"
    );
    Some(Diagnostic::new(Code::FastRecovery, target.span.clone(), message).help(help))
}

/// Returns the warning about a position that a mode controls along a line, while it moves the sensor along this line.
///
/// A task that follows a line moves along it. Where the line is longer than the pad, the middle of its print is that of
/// the pad, and where it ends, the control of the position works against the motion.
fn along_line(mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    let axis = line_axis(mode)?;
    let i = usize::from(axis == "y");
    let constant = mode.law.constants.iter().find(|constant| constant.twist[i] != 0.0)?;
    let is_held = |feature: &&Feature| mode.quantity(feature) == Some(axis) && feature.column[i] != 0.0;
    let feature = mode.moving().find(is_held)?;
    let message = format!(
        "{}`{}` is controlled along the line that `{}` follows: the middle of a long print says nothing about a position \
         along it",
        mode.named(),
        feature.name,
        constant.node
    );
    let help = format!("select 0 for `{}` in the projector behind the column of `{}`", COMPONENTS[i], feature.name);
    Some(Diagnostic::new(Code::LinePosition, mode.place_of_column(feature), message).help(help))
}

/// Returns the warning about a setpoint that a limit of the force keeps the feature from.
fn setpoint(arm: &Controlled<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let (quantity, setpoint) = (mode.quantity(feature)?, feature.setpoint?);
    let limit = match quantity {
        "pressure" => "peak",
        "force" => "force",
        _ => return None,
    };
    let limiters = arm.limits.iter().filter(|limiter| limiter.kind.ends_with("contact_limit"));
    let limits = limiters.filter_map(|limiter| {
        let node = mode.nodes.node(&limiter.node)?;
        let keys = [format!("{limit}_n"), format!("{limit}_raw")];
        keys.into_iter().find_map(|key| Some((mode.nodes.number(node, &key)?, key)))
    });
    let (most, key) = limits.min_by(|(one, _), (other, _)| one.total_cmp(other))?;
    if setpoint < most {
        return None;
    }
    let name = &feature.name;
    let why = if limit == "peak" { "one tactel" } else { "the whole pad" };
    let message = format!(
        "the setpoint of `{name}` is {setpoint}, but the limit `{key}` of {why} is {most}: it is never reached"
    );
    let help = format!("write a setpoint well below {most}, or raise `{key}` in [limits]");
    let node = feature_error(mode, feature)?;
    Some(Diagnostic::new(Code::UnreachableSetpoint, mode.place(node, &format!("setpoint.{name}")), message).help(help))
}

/// Returns the name of the node that compares a feature with its setpoint.
fn feature_error<'a>(mode: &ModeLaw<'a>, feature: &Feature) -> Option<&'a str> {
    let port = feature.error.as_deref()?.rsplit_once('.')?.0;
    let node = mode.nodes.writer(port)?;
    let input = source(node, "error");
    let behind = input.and_then(|port| mode.nodes.writer(port)).filter(|node| node.kind.text == "feature_error");
    Some(&behind.unwrap_or(node).name)
}
