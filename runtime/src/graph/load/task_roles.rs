//! Checks the roles of a part that is a task: those that its block lists, and those that its file declares and names.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::flat::{FlatGraph, Scope};
use super::loader::Loader;
use crate::graph::syntax::{GraphDocument, NO_ARM, PartBlock};
use crate::node::Spanned;
use crate::source::{Code, Diagnostic, Diagnostics, Key, suggest_name};

/// A part that is a task, with its file.
pub(super) struct TaskPart<'a> {
    pub(super) part: &'a PartBlock,
    pub(super) document: &'a GraphDocument,
    pub(super) scope: &'a Scope,
    /// The roles that the parts beside it list.
    pub(super) taken: &'a BTreeSet<String>,
}

impl Loader {
    /// Reports the wrong roles of a part. What follows from them is not reported.
    pub(super) fn check_roles(&mut self, task: &TaskPart<'_>, flat: &FlatGraph) {
        let mut found = task.missing(flat);
        found.extend(task.misspelt().map(|(diagnostic, _)| diagnostic));
        found.extend(task.of_other_type(flat));
        found.extend(task.taken_twice());
        found.extend(task.undeclared());
        // A value that is no text has its own diagnostic.
        let has_invalid = task.part.listed_roles.len() > task.part.roles.iter().count();
        self.has_wrong_roles |= has_invalid || !found.is_empty();
        self.diagnostics.extend(found);
    }
}

impl TaskPart<'_> {
    /// Returns the role of the graph that a name in the file of the part means.
    fn outer<'n>(&'n self, name: &'n str) -> &'n str {
        self.scope.roles.get(name).map_or(name, String::as_str)
    }

    /// Returns where the block of the part says which role a name means: the whole block if it does not list the name.
    fn place(&self, name: &str) -> Range<usize> {
        self.part.roles.get(name).map_or_else(|| self.part.key.span.clone(), |outer| outer.span.clone())
    }

    /// Reports names that the block lists and that the file does not declare, each with the name that is meant.
    fn misspelt(&self) -> impl Iterator<Item = (Diagnostic, Option<&str>)> {
        let declared = &self.document.roles;
        let strange = self.part.roles.iter().map(|(key, _)| key);
        let strange = strange.filter(|key| declared.position(&key.name).is_none() && !declared.is_empty());
        strange.map(|key| {
            let message = format!("part `{}` has no role `{}`", self.part.key.name, key.name);
            let diagnostic = Diagnostic::new(Code::UnknownKey, key.span.clone(), message);
            (diagnostic.suggest(&key.name, declared.names(), "roles"), suggest_name(&key.name, declared.names()))
        })
    }

    /// Reports roles that the file declares and that neither the block lists nor the graph has.
    fn missing(&self, flat: &FlatGraph) -> Diagnostics {
        let meant: BTreeSet<&str> = self.misspelt().filter_map(|(_, meant)| meant).collect();
        let is_listed = |name: &str| self.part.listed_roles.contains(name) || meant.contains(name);
        let declared = self.document.roles.iter().filter(|(key, _)| !is_listed(&key.name));
        let missing = declared.filter(|(key, _)| flat.roles.position(self.outer(&key.name)).is_none());
        let report = |(key, kind): &(Key, Spanned<String>)| {
            let (name, part) = (&key.name, &self.part.key);
            let message = format!("part `{}` takes a role `{name}`, and the graph has none of that name", part.name);
            let fits = flat.roles.iter().filter(|(_, other)| other.value == kind.value);
            let fits: Vec<&str> = fits.map(|(key, _)| key.name.as_str()).collect();
            let free = fits.iter().find(|fit| !self.taken.contains(**fit));
            let help = match free.or(fits.first()) {
                None => format!("declare it under [roles]: `{name} = \"{}\"`", kind.value),
                Some(fit) => format!("name the role of the graph in [parts.{}]: `roles.{name} = \"{fit}\"`", part.name),
            };
            let diagnostic = Diagnostic::new(Code::UnknownPort, part.span.clone(), message);
            diagnostic.note(key.span.clone(), "the part declares it here").help(help)
        };
        missing.map(report).collect()
    }

    /// Reports roles of the graph that are of another type than the file declares.
    fn of_other_type(&self, flat: &FlatGraph) -> Diagnostics {
        let report = |(key, kind): &(Key, Spanned<String>)| {
            let outer = self.outer(&key.name);
            let known = flat.roles.get(outer).filter(|known| known.value != kind.value)?;
            let part = &self.part.key.name;
            let message = format!("part `{part}` takes a `{}`, but `{outer}` is a `{}`", kind.value, known.value);
            let diagnostic = Diagnostic::new(Code::WrongRole, self.place(&key.name), message);
            let diagnostic = diagnostic.note(kind.span.clone(), "the part declares it here");
            let help = format!("name another role in [parts.{part}] with `roles.{}`", key.name);
            Some(diagnostic.note(known.span.clone(), "the graph declares it here").help(help))
        };
        self.document.roles.iter().filter_map(report).collect()
    }

    /// Reports roles of the graph for which the file has two names. Those of other types have their own diagnostic.
    fn taken_twice(&self) -> Diagnostics {
        let mut first: BTreeMap<(&str, &str), &str> = BTreeMap::new();
        let (mut found, part) = (Diagnostics::new(), &self.part.key.name);
        for (key, kind) in self.document.roles.iter() {
            let (name, outer) = (&key.name, self.outer(&key.name));
            let Some(other) = first.insert((outer, &kind.value), name) else { continue };
            let message = format!("part `{part}` takes `{other}` and `{name}`, and both are `{outer}`");
            let diagnostic = Diagnostic::new(Code::WrongRole, self.place(name), message);
            found.push(diagnostic.help(format!("name another role for one of them in [parts.{part}] under `roles`")));
        }
        found
    }

    /// Reports roles that the file commands, limits or puts a sensor on, and that it does not declare.
    fn undeclared(&self) -> Diagnostics {
        let GraphDocument { roles, carriers, commands, limits, .. } = self.document;
        let is_known = |name: &str| roles.is_empty() || roles.position(name).is_some();
        let commands = commands.iter().map(|(role, _)| (&role.name, &role.span));
        let limits = limits.iter().filter_map(|section| section.role.as_ref()).map(|role| (&role.name, &role.span));
        let carriers = carriers.iter().map(|(_, on)| (&on.value, &on.span)).filter(|(on, _)| *on != NO_ARM);
        let strange = commands.chain(limits).chain(carriers).filter(|(name, _)| !is_known(name));
        let mut seen = BTreeSet::new();
        let report = |(name, span): (&String, &Range<usize>)| {
            let known = roles.names().find(|own| self.outer(own) == name.as_str());
            let diagnostic = Diagnostic::unknown(Code::UnknownPort, "role", name, span, roles.names());
            match known {
                Some(own) => diagnostic.instead(name, own),
                None => diagnostic,
            }
        };
        strange.filter(|(name, _)| seen.insert(*name)).map(report).collect()
    }
}
