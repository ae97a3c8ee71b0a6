//! The type that a block has by its keys, where it names another one.

use std::collections::BTreeSet;

use crate::catalogue::Catalogue;
use crate::graph::load::{FlatGraph, FlatNode};
use crate::graph::syntax::Block;
use crate::node::{NodeSpec, PortSpec, Spanned};
use crate::source::{Code, Diagnostic, quoted, suggest_name};

/// A block, and the ports of it that wires in the same file read.
pub(super) struct Candidate<'a> {
    catalogue: &'a Catalogue,
    block: &'a Block,
    reads: BTreeSet<&'a str>,
}

impl<'a> Candidate<'a> {
    pub(super) fn new(flat: &'a FlatGraph, node: usize, catalogue: &'a Catalogue) -> Self {
        let FlatNode { scope, block, .. } = &flat.nodes[node];
        let wires = flat.nodes.iter().filter(|other| other.scope == *scope).flat_map(|other| &other.block.wires.valid);
        let parts =
            flat.scopes.iter().filter(|inner| inner.parent == Some(*scope)).flat_map(|inner| inner.inputs.iter());
        let words = wires.map(|wire| &wire.from).chain(parts.map(|(_, wire)| &wire.from));
        let words = words.chain(flat.scopes[*scope].exports.iter().map(|(_, word)| word));
        let port = |word: &'a Spanned<String>| word.value.strip_prefix(&block.key.name)?.strip_prefix('.');
        Self { catalogue, block, reads: words.filter_map(port).collect() }
    }

    /// Reports that the type of the block does not exist.
    pub(super) fn unknown_type(&self, kind: &Spanned<String>) -> Diagnostic {
        let names = || self.catalogue.specs().map(|spec| &*spec.name);
        match self.only_fitting().filter(|_| suggest_name(&kind.value, names()).is_none()) {
            Some(meant) => {
                let message = format!("there is no node type `{}`", kind.value);
                Diagnostic::new(Code::UnknownType, kind.span.clone(), message).instead(&kind.value, &meant.name)
            }
            None => Diagnostic::unknown(Code::UnknownType, "node type", &kind.value, &kind.span, names()),
        }
    }

    /// Reports that the keys of the block do not fit its type, but those of only one other type.
    pub(super) fn wrong_type(&self, kind: &Spanned<String>, spec: &NodeSpec) -> Option<Diagnostic> {
        let Fit { unknown, missing } = self.fit(spec);
        // Most often, a key that does not fit is misspelt.
        let names = || spec.inputs.iter().map(|input| &*input.name).chain(spec.params.iter().map(|param| param.name));
        let is_misspelt = |name: &&str| suggest_name(name, names()).is_some();
        let is_clear = (unknown.len() + missing >= 2 && !unknown.iter().all(is_misspelt))
            || (self.wires().next().is_none() && self.lacks_all_params(spec));
        let meant = if unknown.is_empty() { None } else { self.only_fitting() }?;
        let named = |spec: &NodeSpec| self.wires().filter(|name| has_input(spec, name)).count();
        // A type that takes inputs of any name has all keys of every block.
        if takes_any(meant) && named(spec) > 0 {
            return None;
        }
        if !is_clear && named(meant) <= named(spec) {
            return None;
        }
        let (name, kind_name) = (&self.block.key.name, &kind.value);
        let message = format!("`{name}` is no `{kind_name}`: that type has no {}", quoted(&unknown));
        Some(Diagnostic::new(Code::UnknownType, kind.span.clone(), message).instead(&kind.value, &meant.name))
    }

    /// Returns the only type that has all keys of the block and all ports that are read, and requires no other keys.
    fn only_fitting(&self) -> Option<&'a NodeSpec> {
        let mut fitting = self.catalogue.specs().filter(|spec| {
            let Fit { unknown, missing } = self.fit(spec);
            unknown.is_empty() && missing == 0
        });
        fitting.next().filter(|_| fitting.next().is_none() && !self.block.wires.has_invalid())
    }

    fn lacks_all_params(&self, spec: &NodeSpec) -> bool {
        let entries = self.block.params.as_table().into_iter().flat_map(|table| &table.entries);
        entries.into_iter().all(|(key, _)| spec.params.iter().all(|param| param.name != key.name))
    }

    fn wires(&self) -> impl Iterator<Item = &'a str> {
        self.block.wires.valid.iter().map(|wire| &*wire.key.name)
    }

    fn fit(&self, spec: &NodeSpec) -> Fit<'a> {
        let wires: BTreeSet<&str> = self.wires().collect();
        let entries = self.block.params.as_table().into_iter().flat_map(|table| &table.entries);
        let params: BTreeSet<&str> = entries.map(|(key, _)| &*key.name).collect();
        let strange_wires = wires.iter().copied().filter(|name| !takes_any(spec) && !has_input(spec, name));
        let has_param = |name: &&str| spec.params.iter().any(|param| *param.name == **name);
        let has_output = |name: &&str| spec.outputs.iter().any(|output| output.name == **name);
        let strange_params = params.iter().copied().filter(|name| !has_param(name));
        let strange_reads = self.reads.iter().copied().filter(|name| !has_output(name));
        let unknown = strange_wires.chain(strange_params).chain(strange_reads).collect();
        let is_open = |input: &&PortSpec| {
            let is_given = if input.need.is_many { !wires.is_empty() } else { wires.contains(&*input.name) };
            input.need.must_be_wired && !is_given
        };
        let inputs = spec.inputs.iter().filter(is_open).count();
        let open = spec.params.iter().filter(|param| !param.is_optional && !params.contains(param.name));
        Fit { unknown, missing: inputs + open.count() }
    }
}

/// Returns whether a type has all keys of a block.
pub(super) fn has_keys_of(spec: &NodeSpec, block: &Block) -> bool {
    let entries = block.params.as_table().into_iter().flat_map(|table| &table.entries);
    let has_params = entries.into_iter().all(|(key, _)| spec.params.iter().any(|param| param.name == key.name));
    has_params && (takes_any(spec) || block.wires.valid.iter().all(|wire| has_input(spec, &wire.key.name)))
}

/// Returns whether a type has inputs of any name.
fn takes_any(spec: &NodeSpec) -> bool {
    spec.inputs.iter().any(|input| input.need.is_many)
}

/// Returns whether a type has an input with this fixed name.
fn has_input(spec: &NodeSpec, name: &str) -> bool {
    spec.inputs.iter().any(|input| !input.need.is_many && input.name == name)
}

/// How the keys of a block fit a type.
struct Fit<'b> {
    /// Wires, parameters and outputs that the type does not have.
    unknown: Vec<&'b str>,
    /// Number of wires and parameters that it requires and the block lacks.
    missing: usize,
}
