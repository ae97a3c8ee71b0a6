//! Checks the frames that parameters name: each is the frame of a role.
//!
//! The frame of a sensor has the name of its role, and the base of an arm is `ROLE.base`. While one role has a base,
//! `base` is short for it.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use crate::graph::net::Net;
use crate::node::{PortSpec, frame_args};
use crate::source::{Code, Diagnostic, Diagnostics};

/// The names of all frames that roles have.
pub(super) struct FrameNames<'a> {
    net: &'a Net<'a>,
    /// The roles that have a frame beside their own, by the last part of its name: those with a `base`.
    parts: BTreeMap<&'a str, Vec<&'a str>>,
}

impl<'a> FrameNames<'a> {
    pub(super) fn new(net: &'a Net<'a>) -> Self {
        let mut parts = BTreeMap::<&str, Vec<&str>>::new();
        for (name, role) in net.flat.roles.names().zip(&net.roles) {
            let ports = role.iter().flat_map(|role| role.outputs.iter().chain(&role.commands).chain(&role.reports));
            let own: BTreeSet<&str> = ports.flat_map(own_parts).collect();
            own.into_iter().for_each(|part| parts.entry(part).or_default().push(name));
        }
        Self { net, parts }
    }

    /// Returns the frame that a parameter of a node names, and its place. Returns `None` if it names none.
    pub(super) fn named(&self, node: usize, param: &str) -> Option<(String, Range<usize>)> {
        let value = self.net.flat.nodes[node].block.params.as_table()?.get(param)?;
        let name = self.resolve(&self.outer(node, value.as_str()?, value.span.start), &value.span).ok()?;
        Some((name, value.span.clone()))
    }

    /// Reports roles whose name is short for a frame of another role, and parameters that name no frame.
    pub(super) fn check(&self, diagnostics: &mut Diagnostics) {
        for (key, _) in self.net.flat.roles.iter().filter(|(key, _)| self.parts.contains_key(key.name.as_str())) {
            let message = format!("`{}` is short for a frame of an arm, so no role can have this name", key.name);
            diagnostics.push(Diagnostic::new(Code::BadName, key.span.clone(), message).help("rename the role"));
        }
        for (node, flat) in self.net.flat.nodes.iter().enumerate() {
            let Some(spec) = self.net.spec(node) else { continue };
            let ports = spec.inputs.iter().chain(&spec.outputs);
            let params: BTreeSet<&str> = ports.flat_map(frame_args).filter_map(|arg| arg.strip_prefix('$')).collect();
            for param in params {
                let value = flat.block.params.as_table().and_then(|table| table.get(param));
                let Some((name, value)) = value.and_then(|value| Some((value.as_str()?, value))) else { continue };
                if let Err(unknown) = self.resolve(&self.outer(node, name, value.span.start), &value.span) {
                    diagnostics.push(*unknown);
                }
            }
        }
    }

    /// Returns the name of a frame outside of the part of a node, where a role may have another name. The name is
    /// written at `at`.
    fn outer(&self, node: usize, name: &str, at: usize) -> String {
        let (role, rest) = name.split_once('.').map_or((name, None), |(role, rest)| (role, Some(rest)));
        let role = self.net.role_at(Some(node), role, at);
        rest.map_or_else(|| role.to_owned(), |rest| format!("{role}.{rest}"))
    }

    /// Returns the full name of a frame, or the diagnostic of a name at `span` that no frame has.
    fn resolve(&self, name: &str, span: &Range<usize>) -> Result<String, Box<Diagnostic>> {
        let unknown = |message: String| Diagnostic::new(Code::UnknownFrame, span.clone(), message);
        let roles = &self.net.flat.roles;
        match self.parts.get(name).map(Vec::as_slice) {
            Some([only]) => return Ok(format!("{only}.{name}")),
            Some([first, ..]) => {
                let help = format!("write `{first}.{name}`, or the frame of another role");
                return Err(Box::new(unknown(format!("several roles have a frame `{name}`")).help(help)));
            }
            Some([]) | None => {}
        }
        let is_part = name
            .split_once('.')
            .is_some_and(|(role, part)| self.parts.get(part).is_some_and(|roles| roles.contains(&role)));
        if is_part || roles.position(name).is_some() {
            return Ok(name.to_owned());
        }
        let full = self.parts.iter().flat_map(|(part, roles)| roles.iter().map(move |role| format!("{role}.{part}")));
        let full: Vec<String> = full.collect();
        let known = roles.names().chain(full.iter().map(String::as_str));
        Err(Box::new(unknown(format!("there is no frame `{name}`")).suggest(name, known, "frames")))
    }
}

/// Returns the parts of its role's frame that a port declares: `base` of `self.base`.
fn own_parts(port: &PortSpec) -> impl Iterator<Item = &str> {
    frame_args(port).iter().filter_map(|arg| arg.strip_prefix("self."))
}
