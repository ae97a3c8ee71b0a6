//! Looks up the types of roles and nodes in the catalogue.

use super::Net;
use crate::catalogue::Catalogue;
use crate::device::RoleType;
use crate::graph::load::FlatGraph;
use crate::node::Spanned;
use crate::source::{Code, Diagnostic, Diagnostics, Key};

impl<'a> Net<'a> {
    /// Creates a net with all types looked up and without wires.
    pub(super) fn declare(flat: &'a FlatGraph, catalogue: &'a Catalogue, diagnostics: &mut Diagnostics) -> Self {
        let mut unknown = |word: &Spanned<String>, what: &str, names: Vec<&str>| {
            diagnostics.push(Diagnostic::unknown(Code::UnknownType, what, &word.value, &word.span, names.into_iter()));
        };
        let role = |(_, kind): &(Key, Spanned<String>)| {
            let role = catalogue.role_type(&kind.value);
            if role.is_none() {
                let tasks = catalogue.roles().iter().filter(|role| !role.is_observed);
                unknown(kind, "role", tasks.map(|role| &*role.name).collect());
            }
            role
        };
        let roles: Vec<Option<&RoleType>> = flat.roles.iter().map(role).collect();
        let nodes = flat.nodes.iter().map(|node| {
            let kind = node.block.kind.as_ref()?;
            let known = catalogue.find_node(&kind.value);
            if known.is_none() {
                unknown(kind, "node type", catalogue.specs().map(|spec| &*spec.name).collect());
            }
            known
        });
        let nodes = nodes.collect();
        let roles =
            flat.roles.iter().zip(roles).map(|((_, kind), role)| reject_observed(kind, role?, diagnostics)).collect();
        let observed = observed_roles(flat, catalogue, diagnostics);
        Self { flat, catalogue, roles, nodes, observed, wires: Vec::new(), commands: Vec::new(), order: Vec::new() }
    }
}

/// Returns the type of a role, or reports that a task cannot declare it.
fn reject_observed<'r>(
    kind: &Spanned<String>,
    role: &'r RoleType,
    diagnostics: &mut Diagnostics,
) -> Option<&'r RoleType> {
    if role.is_observed {
        let message = format!("`{}` is only for scenarios and recordings: a task cannot declare it", kind.value);
        let help = format!("remove it, and bind it in the bench: `{} = \"device\"`", role.observed_name());
        diagnostics.push(Diagnostic::new(Code::ObservedRole, kind.span.clone(), message).help(help));
    }
    (!role.is_observed).then_some(role)
}

/// Returns the roles that the bench binds for scenarios and recordings only.
fn observed_roles<'a>(
    flat: &'a FlatGraph,
    catalogue: &'a Catalogue,
    diagnostics: &mut Diagnostics,
) -> Vec<(&'a Key, &'a Spanned<String>, &'a RoleType)> {
    let bound = flat.bench.iter().flat_map(|bench| &bench.bind);
    let undeclared = bound.filter(|(key, _)| !flat.roles.iter().any(|(role, _)| role.name == key.name));
    let all = undeclared.filter_map(|(key, device)| {
        let role = catalogue.roles().iter().find(|role| role.is_observed_as(&key.name))?;
        Some((key, device, role))
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
