//! The type that a block has by its keys, where it names another one.

use std::collections::BTreeSet;

use crate::catalogue::Catalogue;
use crate::graph::syntax::Block;
use crate::node::{NodeSpec, PortSpec, Spanned};
use crate::source::{Code, Diagnostic, quoted, suggest_name};

/// Reports that the type of a block does not exist.
pub(super) fn unknown_type(catalogue: &Catalogue, block: &Block, kind: &Spanned<String>) -> Diagnostic {
    let names = || catalogue.specs().map(|spec| &*spec.name);
    match only_fitting(catalogue, block).filter(|_| suggest_name(&kind.value, names()).is_none()) {
        Some(meant) => {
            let message = format!("there is no node type `{}`", kind.value);
            Diagnostic::new(Code::UnknownType, kind.span.clone(), message).instead(&kind.value, &meant.name)
        }
        None => Diagnostic::unknown(Code::UnknownType, "node type", &kind.value, &kind.span, names()),
    }
}

/// Reports that the keys of a block do not fit its type, but those of only one other type.
pub(super) fn wrong_type(
    catalogue: &Catalogue,
    block: &Block,
    kind: &Spanned<String>,
    spec: &NodeSpec,
) -> Option<Diagnostic> {
    let Fit { unknown, missing } = Fit::of(block, spec);
    // A single key that does not fit is misspelt.
    if unknown.is_empty() || unknown.len() + missing < 2 {
        return None;
    }
    let meant = only_fitting(catalogue, block)?;
    let message = format!("`{}` has no {}: this is the block of another type", kind.value, quoted(&unknown));
    Some(Diagnostic::new(Code::UnknownType, kind.span.clone(), message).instead(&kind.value, &meant.name))
}

/// Returns the only type that has all keys of a block and requires no others.
fn only_fitting<'a>(catalogue: &'a Catalogue, block: &Block) -> Option<&'a NodeSpec> {
    let mut fitting = catalogue.specs().filter(|spec| {
        let Fit { unknown, missing } = Fit::of(block, spec);
        unknown.is_empty() && missing == 0
    });
    fitting.next().filter(|_| fitting.next().is_none() && !block.wires.has_invalid())
}

/// How the keys of a block fit a type.
struct Fit<'b> {
    /// Wires and parameters that the type does not have.
    unknown: Vec<&'b str>,
    /// Number of wires and parameters that it requires and the block lacks.
    missing: usize,
}

impl<'b> Fit<'b> {
    fn of(block: &'b Block, spec: &NodeSpec) -> Self {
        let wires: BTreeSet<&str> = block.wires.valid.iter().map(|wire| &*wire.key.name).collect();
        let entries = block.params.as_table().into_iter().flat_map(|table| &table.entries);
        let params: BTreeSet<&str> = entries.map(|(key, _)| &*key.name).collect();
        let takes_any = spec.inputs.iter().any(|input| input.need.is_many);
        let has_input = |name: &&str| takes_any || spec.inputs.iter().any(|input| input.name == **name);
        let has_param = |name: &&str| spec.params.iter().any(|param| *param.name == **name);
        let strange_wires = wires.iter().copied().filter(|name| !has_input(name));
        let unknown = strange_wires.chain(params.iter().copied().filter(|name| !has_param(name))).collect();
        let is_open = |input: &&PortSpec| {
            input.need.must_be_wired
                && if input.need.is_many { wires.is_empty() } else { !wires.contains(&*input.name) }
        };
        let inputs = spec.inputs.iter().filter(is_open).count();
        let open = spec.params.iter().filter(|param| !param.is_optional && !params.contains(param.name));
        Self { unknown, missing: inputs + open.count() }
    }
}
