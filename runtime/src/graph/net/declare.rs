//! The declarations behind the names of types: roles, nodes, and what only scenarios read.

use super::Net;
use crate::catalogue::Catalogue;
use crate::device::RoleType;
use crate::graph::load::FlatGraph;
use crate::node::Word;
use crate::source::{Code, Diagnostic, Key};

impl<'a> Net<'a> {
    /// Looks up every type; nothing is wired yet.
    pub(super) fn declared(flat: &'a FlatGraph, catalogue: &'a Catalogue, found: &mut Vec<Diagnostic>) -> Self {
        let mut unknown = |word: &Word, what: &str, names: Vec<&str>| {
            let message = format!("there is no {what} `{}`", word.text);
            let diagnostic = Diagnostic::new(Code::UnknownType, word.span.clone(), message);
            found.push(diagnostic.suggest(&word.text, names.into_iter(), &format!("{what}s")));
        };
        let role = |(_, kind): &(Key, Word)| {
            let role = catalogue.role_type(&kind.text);
            if role.is_none() {
                let tasks = catalogue.roles().iter().filter(|role| !role.is_observed);
                unknown(kind, "role", tasks.map(|role| &*role.name).collect());
            }
            role
        };
        let roles: Vec<Option<&RoleType>> = flat.roles.iter().map(role).collect();
        let nodes = flat.nodes.iter().map(|node| {
            let kind = node.block.kind.as_ref()?;
            let known = catalogue.find_node(&kind.text);
            if known.is_none() {
                unknown(kind, "node type", catalogue.specs().map(|spec| &*spec.name).collect());
            }
            known
        });
        let nodes = nodes.collect();
        let roles = flat.roles.iter().zip(roles).map(|((_, kind), role)| not_observed(kind, role?, found)).collect();
        let observed = observed(flat, catalogue, found);
        Self { flat, catalogue, roles, nodes, observed, wires: Vec::new(), commands: Vec::new(), order: Vec::new() }
    }
}

/// The type of a role, unless it is one that no task may declare: that is told.
fn not_observed<'r>(kind: &Word, role: &'r RoleType, found: &mut Vec<Diagnostic>) -> Option<&'r RoleType> {
    if role.is_observed {
        let message = format!("a `{}` is for scenarios and the recorder: no task declares it", kind.text);
        let help = format!("take it out: a bench binds it, as `{} = \"device\"`", role.observed_name());
        found.push(Diagnostic::new(Code::ObservedRole, kind.span.clone(), message).help(help));
    }
    (!role.is_observed).then_some(role)
}

/// What the bench binds beside what the task declares, and only a scenario and the recorder may read.
fn observed<'a>(
    flat: &'a FlatGraph,
    catalogue: &'a Catalogue,
    found: &mut Vec<Diagnostic>,
) -> Vec<(&'a Key, &'a Word, &'a RoleType)> {
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
            let message = format!("`{}` is the name of two things", key.name);
            let diagnostic = Diagnostic::new(Code::DuplicateName, other.span.clone(), message);
            let diagnostic = diagnostic.note(key.span.clone(), "the bench binds a role of that name here");
            found.push(
                diagnostic.help("what a scenario reads has its name from the bench: rename the node or the part"),
            );
        }
        taken.is_none()
    });
    all
}
