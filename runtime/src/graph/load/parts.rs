//! Expands the parts of a graph, each in a scope of its own.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::flat::{Entity, FlatGraph, FlatNode, Scope};
use super::loader::{Loader, canonical, wrong_file_type};
use super::task::Task;
use super::task_roles::TaskPart;
use crate::graph::syntax::{Block, GraphDocument, OnFail, PartBlock, TASK_SECTIONS, Use, WireEntry};
use crate::node::FilePath;
use crate::source::{Code, Diagnostic, Item, Key, Named, Table, Value, quoted, suggest_name};

/// Maximum depth of parts inside parts.
const MAX_PART_DEPTH: usize = 32;
/// Maximum number of parts in a graph.
const MAX_PARTS: usize = 4096;

impl Loader {
    /// Adds the nodes and parts of a document to the graph, and returns the index of its scope.
    pub(super) fn flatten(
        &mut self,
        document: GraphDocument,
        prefix: &str,
        mut scope: Scope,
        flat: &mut FlatGraph,
    ) -> usize {
        let index = flat.scopes.len();
        // Parts inside look up the roles while the rest of the scope is being read.
        let (roles, text, parent, task) = (scope.roles.clone(), scope.text.clone(), scope.parent, scope.task);
        flat.scopes.push(Scope { roles, text, parent, task, ..Scope::default() });
        let mut reads: BTreeMap<String, Vec<Use>> = BTreeMap::new();
        let uses = if document.parts.is_empty() { Vec::new() } else { document.uses() };
        for reference in uses {
            let inside = reference.inside(&reference.name);
            reads.entry(reference.name).or_default().extend(inside);
        }
        (scope.exports, scope.declared) = (document.exports, document.inputs);
        for (key, _) in document.roles.iter() {
            let role = flat.roles.position(scope.roles.get(&key.name).unwrap_or(&key.name));
            self.declare(&mut scope, key, role.map_or(Entity::Unknown, Entity::Role));
        }
        let role = |scope: &Scope, name: &str| flat.roles.position(scope.roles.get(name).map_or(name, |role| role));
        let nodes = leave_out(document.nodes, |name| role(&scope, name).is_some());
        for only_with in nodes.iter().filter_map(|block| block.only_with.as_ref()) {
            let known = scope.names.get(&only_with.value).is_some_and(|(_, entity)| matches!(entity, Entity::Role(_)));
            let key = Key { name: only_with.value.clone(), span: only_with.span.clone() };
            let entity = role(&scope, &key.name).filter(|_| !known).map(Entity::Role);
            entity.into_iter().for_each(|role| self.declare(&mut scope, &key, role));
        }
        for block in nodes {
            self.declare(&mut scope, &block.key, Entity::Node(flat.nodes.len()));
            flat.nodes.push(FlatNode { name: format!("{prefix}{}", block.key.name), scope: index, block });
        }
        let listed = document.parts.iter().flat_map(|part| part.roles.iter());
        let outer = |name: &String| scope.roles.get(name).unwrap_or(name).clone();
        let taken: BTreeSet<String> = listed.map(|(_, role)| outer(&role.value)).collect();
        for part in document.parts {
            let reads = reads.get(&part.key.name).map_or(&[][..], Vec::as_slice);
            let inner = self.part(&part, (reads, &taken), prefix, index, flat);
            self.declare(&mut scope, &part.key, inner.map_or(Entity::Unknown, Entity::Part));
        }
        flat.scopes[index] = scope;
        index
    }

    fn declare(&mut self, scope: &mut Scope, key: &Key, entity: Entity) {
        if let Some((first, _)) = scope.names.get(&key.name) {
            let message = format!("the name `{}` is used twice", key.name);
            let (first, second) = if first.span.start < key.span.start { (first, key) } else { (key, first) };
            let diagnostic = Diagnostic::new(Code::DuplicateName, second.span.clone(), message);
            let diagnostic = diagnostic.note(first.span.clone(), "first used here");
            self.diagnostics.push(diagnostic.help("roles, nodes and parts share one namespace: rename one of them"));
            return;
        }
        scope.names.insert(key.name.clone(), (key.clone(), entity));
    }

    /// Loads a part whose ports the `reads` of its parent name, and returns the index of its scope. The parts of the
    /// parent list the roles `taken`.
    fn part(
        &mut self,
        part: &PartBlock,
        (reads, taken): (&[Use], &BTreeSet<String>),
        prefix: &str,
        parent: usize,
        flat: &mut FlatGraph,
    ) -> Option<usize> {
        let file = part.file.as_ref().filter(|_| !self.is_full)?;
        if self.open_parts.len() >= MAX_PART_DEPTH || flat.scopes.len() > MAX_PARTS {
            let message =
                format!("parts are nested more than {MAX_PART_DEPTH} deep, or there are more than {MAX_PARTS} parts");
            self.diagnostics.push(Diagnostic::new(Code::EndlessPart, file.span.clone(), message));
            self.is_full = true;
            return None;
        }
        let canonical = canonical(&file.path);
        if self.open_parts.contains(&canonical) {
            let message = format!("part `{}` contains itself", part.key.name);
            self.diagnostics.push(Diagnostic::new(Code::EndlessPart, file.span.clone(), message));
            return None;
        }
        let (mut root, start) = self.read(&file.path, Some(file.span.clone()))?;
        let text = self.sources.file_at(start.start).span();
        let is_task = TASK_SECTIONS.iter().any(|section| root.get(section).is_some());
        let strange = wrong_file_type(&root, if is_task { "graph" } else { "exports" });
        if let Some(what) = strange.filter(|_| root.get("inputs").is_none()) {
            let message = format!("this file is {what}, not a part");
            self.diagnostics.push(Diagnostic::new(Code::WrongFile, file.span.clone(), message));
            return None;
        }
        self.sections(|sections| sections.correct_part(&mut root));
        ignore_bench(&mut root);
        let strange = override_with(&mut root, &part.set);
        self.override_file(&canonical, &mut root);
        let mut document = self.sections(|sections| sections.part(&root));
        self.refuse_beside(&mut document);
        let wires: Vec<&Key> = part.wires.valid.iter().map(|wire| &wire.key).collect();
        if let Some(mistake) = wrong_part(&document, file, &wires, reads).filter(|_| !is_task) {
            self.diagnostics.push(mistake);
            return None;
        }
        self.diagnostics.extend(document.correct_ports(&wires, reads, &self.sources));
        let set: Vec<&Key> = part.set.entries.iter().map(|(key, _)| key).collect();
        self.diagnostics.extend(document.correct_names(&Named::default(), &set, &self.sources));
        // What sets a node with a misspelt name is right.
        let names = || document.nodes.iter().map(|node| &node.key).chain(document.parts.iter().map(|part| &part.key));
        for key in strange.iter().filter(|key| !names().any(|name| name.name == key.name)) {
            let message = format!("the part has no node or part `{}`", key.name);
            let diagnostic = Diagnostic::new(Code::UnknownKey, key.span.clone(), message);
            let known = names().map(|key| key.name.as_str());
            self.diagnostics.push(diagnostic.suggest(&key.name, known, "nodes and parts"));
        }
        self.check_part_wires(part, &document);
        self.open_parts.push(canonical);
        let inputs = part.wires.valid.iter().map(|wire| (wire.key.clone(), wire.clone())).collect();
        let key = part.key.clone();
        let (roles, around) = (self.part_roles(part, is_task, parent, flat), flat.scopes[parent].task);
        let prefix = format!("{prefix}{}.", part.key.name);
        flat.live.extend(self.sections(|sections| sections.live(&root, &prefix)));
        let (parent, part_key) = (Some(parent), Some(key));
        let mut scope = Scope { inputs, parent, part: part_key, roles, text, task: around, ..Scope::default() };
        let ends_run = part.on_fail.as_ref().is_some_and(|(on_fail, _)| *on_fail == OnFail::Run);
        if is_task {
            scope.task = flat.tasks.len();
            self.check_roles(&TaskPart { part, document: &document, scope: &scope, taken }, flat);
            let settings = root.get("graph").cloned();
            let (place, parent, index) = (start, Some(around), flat.scopes.len());
            let task =
                Task { prefix: prefix.clone(), parent, place, settings, scope: index, ends_run, ..Task::default() };
            self.add_task(&document, task, &scope, flat);
        } else if let Some((_, place)) = &part.on_fail {
            let message =
                format!("part `{}` has no modes, commands or roles of its own, so it cannot fail", part.key.name);
            self.diagnostics.push(Diagnostic::new(Code::UnknownKey, place.clone(), message).help("remove `on_fail`"));
        }
        let inner = self.flatten(document, &prefix, scope, flat);
        self.open_parts.pop();
        Some(inner)
    }

    /// Merges what the request says about a file of parts into its content.
    fn override_file(&self, file: &Path, root: &mut Table) {
        let own = self.part_set.iter().filter(|(of, _)| of == file);
        own.for_each(|(_, set)| root.merge(set.clone()));
    }

    /// Returns the role of the graph for each name of a role in a part: those that the part lists, and those of the file
    /// around it.
    fn part_roles(
        &mut self,
        part: &PartBlock,
        is_task: bool,
        parent: usize,
        flat: &FlatGraph,
    ) -> BTreeMap<String, String> {
        let mut roles = flat.scopes[parent].roles.clone();
        for (inner, outer) in part.roles.iter() {
            let role = flat.role_at(parent, &outer.value, outer.span.start);
            if flat.roles.position(role).is_none() {
                let unknown = Diagnostic::unknown(Code::UnknownPort, "role", role, &outer.span, flat.roles.names());
                self.diagnostics.push(unknown);
                // What follows from the mistake is not reported.
                self.has_wrong_roles |= is_task;
                roles
                    .extend(suggest_name(role, flat.roles.names()).map(|meant| (inner.name.clone(), meant.to_owned())));
                continue;
            }
            // The name occurs here, and at least once in the file of the part. That of a task declares its roles.
            if !is_task && self.sources.occurrences(&inner.name) < 2 {
                let message = format!("part `{}` has no role `{}`", part.key.name, inner.name);
                self.diagnostics.push(Diagnostic::new(Code::UnknownKey, inner.span.clone(), message));
            }
            roles.insert(inner.name.clone(), role.to_owned());
        }
        roles
    }

    fn check_part_wires(&mut self, part: &PartBlock, document: &GraphDocument) {
        let names = document.inputs.names();
        for key in part.wires.valid.iter().map(|wire| &wire.key) {
            if document.inputs.position(&key.name).is_none() {
                let message = format!("part `{}` has no input `{}`", part.key.name, key.name);
                let diagnostic = Diagnostic::new(Code::UnknownInput, key.span.clone(), message);
                self.diagnostics.push(match part.wires.only_lacks(names.clone(), names.clone()) {
                    Some(name) => diagnostic.instead(&key.name, name),
                    None => diagnostic.suggest(&key.name, names.clone(), "inputs"),
                });
            }
        }
        let lacking = part.wires.lacking(names.clone());
        let renamed = part.wires.only_lacks(names.clone(), names);
        for (input, doc) in document.inputs.iter() {
            if lacking.contains(input.name.as_str()) && renamed != Some(&input.name) {
                let message = format!("part `{}` needs a wire to `in.{}`: {}", part.key.name, input.name, doc.value);
                let diagnostic = Diagnostic::new(Code::MissingInput, part.key.span.clone(), message);
                let help = format!("wire a port to `in.{}`", input.name);
                self.diagnostics.push(diagnostic.note(input.span.clone(), "the part declares it here").help(help));
            }
        }
    }
}

/// Reports the file of another part: none of the exports that are used are its own, nor most of the wired inputs.
fn wrong_part(document: &GraphDocument, file: &FilePath, wires: &[&Key], reads: &[Use]) -> Option<Diagnostic> {
    let inputs: Vec<&str> = wires.iter().map(|key| &*key.name).collect();
    let strange: Vec<&str> = inputs.iter().copied().filter(|name| document.inputs.position(name).is_none()).collect();
    let exports: BTreeSet<&str> = reads.iter().map(|reference| &*reference.name).collect();
    let has_export = exports.iter().any(|name| document.exports.position(name).is_some());
    let has_inputs = strange.len() < 2 || 2 * strange.len() <= inputs.len();
    if exports.is_empty() || has_export || has_inputs && exports.len() < 2 {
        return None;
    }
    let message = format!("this part has no exports {}", quoted(&exports));
    let more = if strange.is_empty() { String::new() } else { format!(", and no inputs {}", quoted(&strange)) };
    let own = quoted(document.exports.names());
    let help = format!("name the file of the part that is meant; the exports of this one are {own}");
    Some(Diagnostic::new(Code::UnknownPort, file.span.clone(), message + &more).help(help))
}

/// Leaves out the nodes that are only for roles which the graph lacks. What reads an output of such a node reads what its
/// input with the same name reads.
fn leave_out(nodes: Vec<Block>, has_role: impl Fn(&str) -> bool) -> Vec<Block> {
    let is_kept = |block: &Block| block.only_with.as_ref().is_none_or(|role| has_role(&role.value));
    let (mut kept, left): (Vec<_>, Vec<_>) = nodes.into_iter().partition(is_kept);
    // The last one first: it may read another one.
    for Block { key, wires, .. } in left.into_iter().rev() {
        for WireEntry { key: port, from, .. } in wires.valid {
            let output = format!("{}.{}", key.name, port.name);
            let readers = kept.iter_mut().flat_map(|block| &mut block.wires.valid);
            readers.filter(|wire| wire.from.value == output).for_each(|wire| wire.from = from.clone());
        }
    }
    kept
}

/// Removes the bench that a task names for itself, so that its file need not be there.
fn ignore_bench(root: &mut Table) {
    let graph = root.entries.iter_mut().find(|(key, _)| key.name == "graph");
    if let Some((_, Value { item: Item::Table(table), .. })) = graph {
        table.remove("bench");
    }
}

/// Merges `set.NAME` of a part into its node NAME, or into the `set` of its part NAME. Returns the names of neither.
fn override_with(root: &mut Table, set: &Table) -> Vec<Key> {
    let names = |section: &str| -> Vec<String> {
        let table = root.get(section).and_then(Value::as_table);
        table.map(|table| table.entries.iter().map(|(key, _)| key.name.clone()).collect()).unwrap_or_default()
    };
    let (nodes, parts) = (names("nodes"), names("parts"));
    let mut strange = Vec::new();
    for (key, value) in &set.entries {
        let entry = |name: &str, value: Value| Table {
            entries: vec![(Key { name: name.to_owned(), span: key.span.clone() }, value)],
        };
        let wrap = |name: &str, inner: Value| Value { span: value.span.clone(), item: Item::Table(entry(name, inner)) };
        if nodes.contains(&key.name) {
            root.merge(entry("nodes", wrap(&key.name, value.clone())));
        } else if parts.contains(&key.name) {
            root.merge(entry("parts", wrap(&key.name, wrap("set", value.clone()))));
        } else {
            strange.push(key.clone());
        }
    }
    strange
}
