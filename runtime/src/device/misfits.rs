//! What a device states of a role, compared with what the role declares.

use super::{Description, RoleType, StatedPort};
use crate::node::{PortSpec, UnitPattern, unit_pattern};
use crate::signal::{ImageShape, Shape};
use crate::source::suggestion;

impl Description {
    /// Returns every difference between what the device states of one of its roles and what the role declares.
    pub(crate) fn misfits(&self, fill: usize, role: &RoleType) -> Vec<String> {
        let outputs = misfits("output", &self.outputs, fill, &role.outputs, true);
        let commands = misfits("command", &self.commands, fill, &role.commands, true);
        [outputs, commands, misfits("report", &self.reports, fill, &role.reports, false)].concat()
    }
}

/// Compares one sort of ports. A device states all outputs and commands of a role that are not optional, and the reports
/// that it reads.
fn misfits(sort: &str, stated: &[StatedPort], fill: usize, declared: &[PortSpec], is_complete: bool) -> Vec<String> {
    let stated: Vec<&StatedPort> = stated.iter().filter(|port| port.fill == fill).collect();
    let is_stated = |name: &str| stated.iter().any(|port| port.name == name);
    let missing = declared.iter().filter(|port| is_complete && port.need.must_be_wired && !is_stated(&port.name));
    let missing = missing.map(|port| format!("{sort} `{}` is missing", port.name));
    let wrong = stated.iter().enumerate().filter_map(|(i, port)| {
        let is_second = stated[..i].iter().any(|other| other.name == port.name);
        let what = if is_second { Some("is stated twice".to_owned()) } else { misfit(sort, port, declared) };
        what.map(|what| format!("{sort} `{}` {what}", port.name))
    });
    missing.chain(wrong).collect()
}

/// Returns what is wrong with one port.
fn misfit(sort: &str, port: &StatedPort, declared: &[PortSpec]) -> Option<String> {
    let Some(spec) = declared.iter().find(|spec| spec.name == port.name) else {
        let help = suggestion(&port.name, declared.iter().map(|spec| &*spec.name), &format!("{sort}s"));
        return Some(format!("is unknown ({help})"));
    };
    let kind = port.shape.kind();
    if kind != spec.kind {
        return Some(format!("is {}, but the role declares {}", kind.with_article(), spec.kind.with_article()));
    }
    if let Shape::Image(ImageShape { rows, cols, .. }) = &port.shape
        && rows * cols == 0
        // Of a report only the kind is known.
        && sort != "report"
    {
        return Some(format!("is an image of {rows} by {cols}, which has no tactels"));
    }
    match (unit_pattern(spec), port.shape.unit()) {
        (Some(UnitPattern::Known(takes)), Some(has)) if takes != has && sort != "report" => {
            Some(format!("is in `{has}`, but the role declares `{takes}`"))
        }
        _ => None,
    }
}
