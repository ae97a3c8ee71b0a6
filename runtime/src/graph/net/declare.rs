//! Looks up the types of roles and nodes in the catalogue.

use std::cell::OnceCell;
use std::collections::BTreeMap;

use super::Net;
use super::meant_type::{Candidate, has_keys_of};
use super::provenance::Provenance;
use super::task_modes::TaskModes;
use crate::catalogue::Catalogue;
use crate::device::RoleType;
use crate::graph::load::FlatGraph;
use crate::graph::syntax::NO_ARM;
use crate::node::Spanned;
use crate::source::{Code, Diagnostic, Diagnostics, Key};

impl<'a> Net<'a> {
    /// Creates a net with all types looked up and without wires.
    pub(super) fn declare(
        flat: &'a FlatGraph,
        catalogue: &'a Catalogue,
        beside: &'a [RoleType],
        diagnostics: &mut Diagnostics,
    ) -> Self {
        let find = |(key, kind): &(Key, Spanned<String>)| match beside.iter().find(|role| role.name == kind.value) {
            Some(role) => Some(role),
            // One that has a mistake reports it when its device is opened.
            None if is_beside(&key.name, kind) => None,
            None => find_role(kind, catalogue, diagnostics),
        };
        let roles: Vec<_> = flat.roles.iter().map(find).collect();
        let nodes = flat.nodes.iter().enumerate().map(|(index, node)| {
            let kind = node.block.kind.as_ref()?;
            let known = catalogue.find_node(&kind.value);
            let candidate = || Candidate::new(flat, index, catalogue);
            let mistake = match known {
                Some((_, spec)) if has_keys_of(spec, &node.block) => None,
                Some((_, spec)) => candidate().wrong_type(kind, spec),
                None => Some(candidate().unknown_type(kind)),
            };
            let is_right = mistake.is_none();
            diagnostics.extend(mistake);
            known.filter(|_| is_right)
        });
        let nodes = nodes.collect();
        let observed = observed_roles(flat, catalogue, diagnostics);
        check_carriers(flat, &roles, diagnostics);
        let (wires, commands, order, arms) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        let scope_ports = flat.scopes.iter().map(|_| OnceCell::new()).collect();
        let (provenance, mut settings) = (Provenance::default(), BTreeMap::<String, Vec<_>>::new());
        for mode in &flat.modes {
            let prefix = &flat.tasks[mode.task].prefix;
            for (key, value) in &mode.set.entries {
                settings.entry(format!("{prefix}{}", key.name)).or_default().push(value);
            }
        }
        Self {
            flat,
            catalogue,
            beside,
            roles,
            nodes,
            observed,
            wires,
            commands,
            order,
            provenance,
            arms,
            settings,
            modes: TaskModes::all(flat),
            scope_ports,
        }
    }
}

/// Whether a role is a node that computes beside the tick.
fn is_beside(role: &str, kind: &Spanned<String>) -> bool {
    kind.value.strip_suffix(role).is_some_and(|kind| kind.ends_with(' '))
}

/// Returns the type of a role, or reports that there is none or that a task cannot declare it.
fn find_role<'a>(
    kind: &Spanned<String>,
    catalogue: &'a Catalogue,
    diagnostics: &mut Diagnostics,
) -> Option<&'a RoleType> {
    let Some(role) = catalogue.role_type(&kind.value) else {
        let names = catalogue.roles().iter().filter(|role| !role.is_observed).map(|role| &*role.name);
        diagnostics.push(Diagnostic::unknown(Code::UnknownType, "role", &kind.value, &kind.span, names));
        return None;
    };
    if role.is_observed {
        let message = format!("`{}` is only for scenarios and recordings: a task cannot declare it", kind.value);
        let help = format!("remove it, and add `{} = \"device\"` under [bind] in the bench", role.observed_name());
        diagnostics.push(Diagnostic::new(Code::ObservedRole, kind.span.clone(), message).help(help));
        return None;
    }
    Some(role)
}

/// Reports sensors that are on a role which is no arm, and arms that are on another role.
fn check_carriers(flat: &FlatGraph, roles: &[Option<&RoleType>], diagnostics: &mut Diagnostics) {
    let is_arm = |index: usize| roles[index].is_none_or(|role| !role.commands.is_empty());
    let arms = || (0..roles.len()).filter(|index| is_arm(*index)).map(|index| flat.roles[index].0.name.as_str());
    for (sensor, on) in flat.carriers.iter().filter(|(_, on)| on.value != NO_ARM) {
        let carries = flat.roles.position(&on.value);
        if carries.is_none_or(|index| !is_arm(index)) {
            diagnostics.push(Diagnostic::unknown(Code::UnknownPort, "arm", &on.value, &on.span, arms()));
        } else if flat.roles.position(&sensor.name).is_some_and(|sensor| roles[sensor].is_some() && is_arm(sensor)) {
            let message = format!("`{}` is an arm, and only a sensor can be on an arm", sensor.name);
            diagnostics.push(Diagnostic::new(Code::WrongRole, on.span.clone(), message).help("remove `on`"));
        }
    }
}

/// Returns the roles that the bench binds for scenarios and recordings only.
fn observed_roles<'a>(
    flat: &'a FlatGraph,
    catalogue: &'a Catalogue,
    diagnostics: &mut Diagnostics,
) -> Vec<(&'a Key, &'a RoleType)> {
    let bound = flat.bench.iter().flat_map(|bench| bench.bind.iter());
    let undeclared = bound.filter(|(key, _)| flat.roles.position(&key.name).is_none());
    let all = undeclared.filter_map(|(key, _)| {
        let role = catalogue.roles().iter().find(|role| role.is_observed_as(&key.name))?;
        Some((key, role))
    });
    let mut all: Vec<_> = all.collect();
    all.retain(|(key, ..)| {
        let taken = flat.scopes.first().and_then(|scope| scope.names.get(&key.name));
        if let Some((other, _)) = taken {
            let message = format!("the name `{}` is used twice", key.name);
            let diagnostic = Diagnostic::new(Code::DuplicateName, other.span.clone(), message);
            let diagnostic = diagnostic.note(key.span.clone(), "the bench binds a role with this name here");
            diagnostics.push(diagnostic.help("rename the node or the part: scenarios use the name in the bench"));
        }
        taken.is_none()
    });
    all
}
