//! Misspelt definitions: nothing refers to the name, while other places refer to a similar name that does not exist.
//!
//! Such a name is reported once, at its definition, and the graph is then read as it was meant. Whether the definition
//! or the reference is misspelt is decided by the number of times that each name occurs in the files.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::binding::Binding;
use super::modes::ModeBlock;
use super::reserved::{INPUTS, LIMITS, MODES, is_name};
use super::sections::{BenchDocument, GraphDocument};
use crate::node::Spanned;
use crate::source::{Code, Diagnostic, Diagnostics, Edit, FactRef, Key, Named, SourceMap, quoted, suggest_name};

/// A reference to a port: the name of the node, role or part, and the port unless the reference is to the whole.
#[derive(Debug, Clone)]
pub(crate) struct Use {
    pub(crate) name: String,
    pub(crate) port: Option<String>,
    pub(crate) span: Range<usize>,
}

impl Use {
    fn of(word: &Spanned<String>) -> Self {
        let (name, port) = word.value.split_once('.').map_or((&*word.value, None), |(name, port)| (name, Some(port)));
        Self { name: name.to_owned(), port: port.map(str::to_owned), span: word.span.clone() }
    }

    fn of_key(key: &Key) -> Self {
        Self { name: key.name.clone(), port: None, span: key.span.clone() }
    }

    /// Returns the reference to the port inside `name`, as a reference to a name of its own.
    pub(crate) fn inside(&self, name: &str) -> Option<Self> {
        let port = self.port.as_ref().filter(|_| self.name == name)?;
        // Behind the port, the name of a feature may follow.
        let port = port.split('.').next().unwrap_or_default();
        Some(Self { name: port.to_owned(), port: None, span: self.span.clone() })
    }
}

/// Gives each misspelt definition the name that its references use, and reports it.
///
/// `may_be` tests whether a definition, by its index, could be what a name refers to. With `by_use`, the
/// references decide: two of them outweigh a definition, and the only unused definition is what the only unknown name
/// refers to, even if they are not alike.
fn correct<'k>(
    code: Code,
    defined: impl IntoIterator<Item = &'k mut Key>,
    uses: &[Use],
    may_be: &dyn Fn(usize, &str) -> bool,
    by_use: bool,
    sources: &SourceMap,
) -> Diagnostics {
    let mut defined: Vec<&mut Key> = defined.into_iter().collect();
    let names: Vec<String> = defined.iter().map(|key| key.name.clone()).collect();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    uses.iter().for_each(|reference| *counts.entry(&reference.name).or_default() += 1);
    let count = |name: &str| counts.get(name).copied().unwrap_or(0);
    let mut unused: Vec<usize> = (0..names.len()).filter(|i| count(&names[*i]) == 0).collect();
    let known: BTreeSet<&str> = names.iter().map(String::as_str).collect();
    let mut seen = BTreeSet::new();
    let strange = uses.iter().filter(|reference| !known.contains(&*reference.name));
    let unknown: Vec<&Use> = strange.filter(|reference| seen.insert(reference.name.as_str())).collect();
    let mut found = Diagnostics::new();
    for first in &unknown {
        let wanted = &first.name;
        let candidates: Vec<usize> = unused.iter().copied().filter(|i| may_be(*i, wanted)).collect();
        let near = suggest_name(wanted, candidates.iter().map(|i| names[*i].as_str()));
        let is_nearest =
            count(wanted) > 1 || near == suggest_name(wanted, near.into_iter().chain(names.iter().map(String::as_str)));
        let close = candidates.iter().find(|i| near == Some(&names[**i])).filter(|_| is_nearest);
        let is_only = by_use && (unknown.len(), candidates.len()) == (1, 1);
        let only = candidates.first().filter(|_| is_only && count(wanted) > 1);
        let Some(&i) = close.or(only) else { continue };
        let is_invalid = !is_name(&names[i]);
        if is_invalid || (by_use && count(wanted) > 1) || sources.is_misspelt(&names[i], wanted) {
            let message = if is_invalid {
                format!("`{}` is not a valid name", names[i])
            } else {
                format!("nothing refers to `{}`, but `{wanted}` is used and does not exist", names[i])
            };
            let code = if is_invalid { Code::BadName } else { code };
            let diagnostic = Diagnostic::new(code, defined[i].span.clone(), message);
            let diagnostic = diagnostic.note(first.span.clone(), format!("`{wanted}` is used here"));
            // A number with a decimal point is a name in a name: its first part alone cannot be replaced.
            let is_number = names[i].bytes().all(|byte| byte.is_ascii_digit());
            found.push(match is_number {
                true => diagnostic.help(format!("did you mean `{wanted}`?")),
                false => diagnostic.instead(&names[i], wanted),
            });
            defined[i].name.clone_from(wanted);
            unused.retain(|other| *other != i);
        }
    }
    found
}

impl GraphDocument {
    /// Returns the references in this file to its roles, nodes and parts, and to the inputs of the part.
    pub(crate) fn uses(&self) -> Vec<Use> {
        let nodes = self.nodes.iter().map(|node| &node.wires).chain(self.parts.iter().map(|part| &part.wires));
        let wires = nodes.flat_map(|wires| &wires.valid).chain(self.commands.iter().map(|(_, wire)| wire));
        let mut uses: Vec<Use> = wires.map(|wire| Use::of(&wire.from)).collect();
        uses.extend(self.exports.iter().map(|(_, word)| Use::of(word)));
        uses.extend(self.commands.iter().map(|(role, _)| Use::of_key(role)));
        let exits = self.modes.iter().flat_map(|mode| &mode.exits);
        uses.extend(exits.flat_map(|exit| [&exit.table.when, &exit.table.of]).flatten().map(Use::of));
        uses.extend(self.modes.iter().flat_map(|mode| &mode.set.entries).map(|(key, _)| Use::of_key(key)));
        // The facts in a part are those of the roles of the graph.
        let facts = self.nodes.iter().filter(|_| !self.roles.is_empty()).flat_map(|node| node.params.facts());
        let fact = |fact: FactRef<'_>| Use::of(&Spanned { value: fact.word.into(), span: fact.place.clone() });
        uses.extend(facts.map(fact).filter(|reference| reference.name != LIMITS));
        if let Some((_, Some(graph))) = &self.graph {
            let mark = graph.mark.iter().flatten();
            uses.extend(graph.clock.iter().chain(graph.show.iter().flatten()).chain(mark).map(Use::of));
        }
        uses
    }

    /// Corrects the names of roles, nodes, parts and modes. Only a role can have a name that the bench `binds`.
    ///
    /// `set` are the names of nodes and parts that the graph around a part sets.
    pub(crate) fn correct_names(&mut self, binds: &Named<Binding>, set: &[&Key], sources: &SourceMap) -> Diagnostics {
        let uses = self.uses().into_iter().filter(|reference| ![INPUTS, MODES].contains(&&*reference.name));
        let uses: Vec<Use> = uses.chain(set.iter().map(|key| Use::of_key(key))).collect();
        let roles = self.roles.len();
        let may_be = |i: usize, name: &str| i < roles || binds.position(name).is_none();
        let nodes =
            self.nodes.iter_mut().map(|node| &mut node.key).chain(self.parts.iter_mut().map(|part| &mut part.key));
        let mut role_keys = self.roles.to_vec();
        let names = role_keys.iter_mut().map(|(key, _)| key).chain(nodes);
        let mut found = correct(Code::UnknownPort, names, &uses, &may_be, true, sources);
        self.roles = role_keys.into_iter().collect();
        let start = self.graph.iter().filter_map(|(_, graph)| graph.as_ref()?.start.as_ref());
        let mut targets: Vec<Use> = start.map(Use::of).collect();
        let written = self.modes.iter().flat_map(ModeBlock::written_targets);
        targets.extend(
            written.filter_map(|to| Some(Use { name: to.as_str()?.into(), port: None, span: to.span.clone() })),
        );
        let modes = self.modes.iter_mut().map(|mode| &mut mode.key);
        found.extend(correct(Code::UnknownMode, modes, &targets, &|_, _| true, true, sources));
        found
    }

    /// Corrects the names of the inputs and exports of a part, given the wires into it and the references to it.
    pub(crate) fn correct_ports(&mut self, wires: &[&Key], reads: &[Use], sources: &SourceMap) -> Diagnostics {
        let inner: Vec<Use> = self.uses().iter().filter_map(|reference| reference.inside(INPUTS)).collect();
        let outer: Vec<Use> = wires.iter().map(|key| Use::of_key(key)).collect();
        let (mut inputs, mut exports) = (self.inputs.to_vec(), self.exports.to_vec());
        let uses = [&inner[..], &outer[..]].concat();
        let mut found =
            correct(Code::UnknownInput, inputs.iter_mut().map(|(key, _)| key), &uses, &|_, _| true, true, sources);
        found.extend(correct(
            Code::UnknownPort,
            exports.iter_mut().map(|(key, _)| key),
            reads,
            &|_, _| true,
            false,
            sources,
        ));
        found.extend(declare_missing(&mut inputs, &inner, &outer));
        (self.inputs, self.exports) = (inputs.into_iter().collect(), exports.into_iter().collect());
        found
    }
}

impl BenchDocument {
    /// Corrects the names of devices.
    pub(crate) fn correct_names(&mut self, sources: &SourceMap) -> Diagnostics {
        let uses: Vec<Use> = self.bind.iter().map(|(_, binding)| Use::of(&binding.word)).collect();
        let devices = self.devices.iter_mut().map(|device| &mut device.key);
        let found = correct(Code::UnknownDevice, devices, &uses, &|_, _| true, false, sources);
        // The files of a device go with it.
        for from in &mut self.model_files {
            if let Some(device) = self.devices.iter().find(|device| device.key.span == from.device.span) {
                from.device = device.key.clone();
            }
        }
        found
    }
}

/// Declares the inputs that the graph wires and the part reads, and reports that they are not declared.
fn declare_missing(inputs: &mut Vec<(Key, Spanned<String>)>, inner: &[Use], outer: &[Use]) -> Option<Diagnostic> {
    let is_declared = |name: &str| inputs.iter().any(|(key, _)| key.name == name);
    let is_wired = |name: &str| outer.iter().any(|wire| wire.name == name);
    let mut missing: Vec<&Use> = Vec::new();
    for read in inner.iter().filter(|read| !is_declared(&read.name) && is_wired(&read.name)) {
        if !missing.iter().any(|other| other.name == read.name) {
            missing.push(read);
        }
    }
    let first = missing.first()?;
    let names = quoted(missing.iter().map(|read| &read.name));
    let message = format!("the part reads {names} from its inputs and does not declare them");
    let lines: Vec<String> = missing.iter().map(|read| format!("{} = \"what it is\"", read.name)).collect();
    let lines = lines.join("\n");
    let help = format!("declare them under [inputs]:\n{lines}");
    let last = inputs.last().map(|(key, _)| key.span.clone());
    let diagnostic = match &last {
        Some(last) => Diagnostic::new(Code::UnknownInput, last.clone(), message)
            .note(first.span.clone(), "one is read here")
            .edit(Edit::Below(last.clone(), lines)),
        // The section may be there and empty.
        None => Diagnostic::new(Code::UnknownInput, first.span.clone(), message),
    };
    let place = last.unwrap_or_else(|| first.span.clone());
    for read in missing {
        let key = Key { name: read.name.clone(), span: place.clone() };
        inputs.push((key, Spanned { value: String::new(), span: place.clone() }));
    }
    Some(diagnostic.help(help))
}
