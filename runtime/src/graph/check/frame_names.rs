//! Checks the frames that parameters name: each is the frame of a role.
//!
//! The frame of a sensor has the name of its role, and the base of an arm is `ROLE.base`. While one role has a base,
//! `base` is short for it.

use std::collections::BTreeSet;
use std::ops::Range;

use crate::graph::net::Net;
use crate::node::{PortSpec, frame_args};
use crate::source::{Code, Diagnostic};

/// Returns the frame that a parameter of a node names, and its place. Returns `None` if it names none.
pub(super) fn named_frame(net: &Net<'_>, node: usize, param: &str) -> Option<(String, Range<usize>)> {
    let value = net.flat.nodes[node].block.params.as_table()?.get(param)?;
    let name = resolve(net, value.as_str()?).ok()?;
    Some((name, value.span.clone()))
}

/// Reports roles whose name is short for a frame of another role, and parameters that name no frame.
pub(super) fn find_named(net: &Net<'_>) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    let parts: BTreeSet<&str> = instances(net).map(|(_, part)| part).collect();
    for (key, _) in net.flat.roles.iter().filter(|(key, _)| parts.contains(key.name.as_str())) {
        let message = format!("`{}` is short for a frame of an arm, so no role can have this name", key.name);
        found.push(Diagnostic::new(Code::BadName, key.span.clone(), message).help("rename the role"));
    }
    for (node, flat) in net.flat.nodes.iter().enumerate() {
        let Some(spec) = net.spec(node) else { continue };
        let ports = spec.inputs.iter().chain(&spec.outputs);
        let params: BTreeSet<&str> = ports.flat_map(frame_args).filter_map(|arg| arg.strip_prefix('$')).collect();
        for param in params {
            let value = flat.block.params.as_table().and_then(|table| table.get(param));
            let Some((name, value)) = value.and_then(|value| Some((value.as_str()?, value))) else { continue };
            if let Err((message, help)) = resolve(net, name) {
                found.push(Diagnostic::new(Code::UnknownFrame, value.span.clone(), message).help(help));
            }
        }
    }
    found
}

/// Returns the full name of a frame, or the message and the help for a name that no frame has.
fn resolve(net: &Net<'_>, name: &str) -> Result<String, (String, String)> {
    let full = |(role, part): (&str, &str)| format!("{role}.{part}");
    let mut short = instances(net).filter(|(_, part)| *part == name);
    match (short.next(), short.next()) {
        (Some(only), None) => return Ok(full(only)),
        (Some(first), Some(_)) => {
            let help = format!("write `{}`, or the frame of another role", full(first));
            return Err((format!("several roles have a frame `{name}`"), help));
        }
        (None, _) => {}
    }
    let parts: Vec<String> = instances(net).map(full).collect();
    let known: Vec<&str> = net.flat.role_names().chain(parts.iter().map(String::as_str)).collect();
    if known.contains(&name) {
        return Ok(name.to_owned());
    }
    Err((format!("there is no frame `{name}`"), crate::source::suggestion(name, known.into_iter(), "frames")))
}

/// Returns the frames that roles have beside their own, each as the role and the last part of the name.
fn instances<'n>(net: &'n Net<'_>) -> impl Iterator<Item = (&'n str, &'n str)> {
    let roles = net.flat.role_names().zip(&net.roles);
    roles.flat_map(|(name, role)| {
        let ports = role.iter().flat_map(|role| role.outputs.iter().chain(&role.commands).chain(&role.reports));
        let parts: BTreeSet<&str> = ports.flat_map(own_parts).collect();
        parts.into_iter().map(move |part| (name, part))
    })
}

/// Returns the parts of its role's frame that a port declares: `base` of `self.base`.
fn own_parts(port: &PortSpec) -> impl Iterator<Item = &str> {
    frame_args(port).iter().filter_map(|arg| arg.strip_prefix("self."))
}
