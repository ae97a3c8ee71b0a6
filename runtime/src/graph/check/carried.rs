//! The sensors on an arm that limiters protect. Reports those on an arm of a type that has no such limits.

use crate::device::RoleType;
use crate::graph::net::Net;
use crate::graph::plan::Producer;
use crate::node::{NodeSpec, PortSpec};
use crate::source::{Code, Diagnostic};

/// Reports sensors on an arm whose type has none of the limits that protect them.
pub(super) fn on_bare_arm(net: &Net<'_>, arm: usize) -> Vec<Diagnostic> {
    let Some(role) = net.roles[arm].filter(|role| !role.limits.is_empty()) else { return Vec::new() };
    if !limits_of_sensors(net, role).is_empty() {
        return Vec::new();
    }
    let has_limits = |known: &&RoleType| !limits_of_sensors(net, known).is_empty();
    let fitting = net.catalogue.roles().iter().filter(has_limits).find(|known| role.is_filled_by(&known.name));
    let arm_name = net.name(Producer::Role(arm));
    let report = |sensor: usize| {
        let (key, kind) = &net.flat.roles[sensor];
        let message =
            format!("`{}` is on `{arm_name}`, but no limiter of a `{}` bounds the force on it", key.name, role.name);
        let other = fitting.map(|known| format!("\notherwise write `{arm_name} = \"{}\"`", known.name));
        let help = format!("{}{}", on_no_arm(&key.name, &kind.value), other.unwrap_or_default());
        Diagnostic::new(Code::UnlimitedCommand, key.span.clone(), message).help(help)
    };
    sensors_on(net, arm).into_iter().map(report).collect()
}

/// Returns whether an arm has limits that protect a sensor on it.
pub(super) fn can_carry(net: &Net<'_>, arm: usize) -> bool {
    net.roles[arm].is_none_or(|role| role.limits.is_empty() || !limits_of_sensors(net, role).is_empty())
}

/// Returns the declarations of limiters that hold for one sensor each, with the input that reads it.
pub(super) fn guards<'n>(net: &'n Net<'_>) -> impl Iterator<Item = (&'n NodeSpec, &'n PortSpec)> {
    net.catalogue.specs().filter_map(|spec| {
        let guards = spec.limits.guards?;
        Some((spec, spec.inputs.iter().find(|input| input.name == guards)?))
    })
}

/// Returns the limits of an arm that hold for one sensor each, in their order.
pub(super) fn limits_of_sensors<'r>(net: &Net<'_>, arm: &'r RoleType) -> Vec<&'r str> {
    let is_held = |limit: &&str| guards(net).any(|(spec, _)| spec.limits.holds.contains(limit));
    arm.limits.iter().map(|limit| &**limit).filter(is_held).collect()
}

/// Returns the sensors on an arm that such limiters can read.
pub(super) fn sensors_on(net: &Net<'_>, arm: usize) -> Vec<usize> {
    let fits =
        |port: &PortSpec| guards(net).any(|(_, input)| input.kind == port.kind && input.quantity == port.quantity);
    let is_read = |role: &usize| net.roles[*role].is_some_and(|role| role.outputs.iter().any(fits));
    (0..net.roles.len()).filter(|role| net.carrier(*role) == Some(arm)).filter(is_read).collect()
}

pub(super) fn on_no_arm(sensor: &str, kind: &str) -> String {
    format!("if it is on no arm, write `{sensor} = {{ type = \"{kind}\", on = \"none\" }}`")
}
