//! What a device states of a role, compared with what the role declares.

use super::{Description, RoleType, StatedPort};
use crate::node::{PortSpec, UnitPattern, unit_pattern};
use crate::signal::{ImageShape, Shape, VectorImageShape};
use crate::source::suggestion;

impl Description {
    /// Returns every difference between what the device states of one of its roles and what the role declares.
    pub(crate) fn misfits(&self, fill: usize, role: &RoleType) -> Vec<String> {
        // A device that fills a type with more ports has them beside those of this role.
        let has_more = self.fills[fill].role != role.name;
        let misfits = |sort: &str, stated: &[StatedPort], declared: &[PortSpec], is_complete: bool| {
            let is_own = |port: &&StatedPort| {
                port.fill == fill && (!has_more || declared.iter().any(|spec| spec.name == port.name))
            };
            misfits(sort, &stated.iter().filter(is_own).collect::<Vec<_>>(), declared, is_complete)
        };
        let outputs = misfits("output", &self.outputs, &role.outputs, true);
        let commands = misfits("command", &self.commands, &role.commands, true);
        [outputs, commands, misfits("report", &self.reports, &role.reports, false)].concat()
    }
}

/// Compares one sort of ports. A device states all outputs and commands of a role that are not optional, and the reports
/// that it reads.
fn misfits(sort: &str, stated: &[&StatedPort], declared: &[PortSpec], is_complete: bool) -> Vec<String> {
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
    if let Shape::Image(ImageShape { rows, cols, .. })
    | Shape::VectorImage(VectorImageShape(ImageShape { rows, cols, .. })) = &port.shape
        && rows * cols == 0
        // Of a report only the kind is known.
        && sort != "report"
    {
        return Some(format!("is {} of {rows} by {cols}, which has no tactels", kind.with_article()));
    }
    match (unit_pattern(spec), port.shape.unit()) {
        (Some(UnitPattern::Known(takes)), Some(has)) if takes != has && sort != "report" => {
            Some(format!("is in `{has}`, but the role declares `{takes}`"))
        }
        _ => None,
    }
}
