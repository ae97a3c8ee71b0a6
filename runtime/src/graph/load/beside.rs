//! Nodes that compute beside the tick: a block of `[nodes]` whose type is a device becomes a role, the device that fills
//! it, and the wires to its reports. So the engine records, ages, stops and replays its answers like any sample.

use super::loader::Loader;
use crate::graph::syntax::{BenchDocument, Binding, Block, GraphDocument};
use crate::node::{Param, Spanned};
use crate::source::{Code, Diagnostic, Item, Key};

/// The key that lets the program behind such a node be started once more after it has failed.
const RESTART: &str = "restart";

/// Returns the type of the role that such a block declares. No type in a catalogue has a space in its name.
pub(crate) fn role_type_of(kind: &str, block: &str) -> String {
    format!("{kind} {block}")
}

impl Loader {
    /// Moves the nodes of the graph that compute beside the tick to the roles and to the bench.
    pub(super) fn move_beside(&mut self, document: &mut GraphDocument, bench: Option<&mut BenchDocument>) {
        let (beside, nodes) = std::mem::take(&mut document.nodes).into_iter().partition(|node| self.is_beside(node));
        document.nodes = nodes;
        let Some(bench) = bench else { return };
        for block in beside {
            self.add_beside(block, document, bench);
        }
    }

    /// Reports the nodes of a part that compute beside the tick.
    pub(super) fn refuse_beside(&mut self, document: &mut GraphDocument) {
        document.nodes.retain(|block| {
            let Some(kind) = block.kind.as_ref().filter(|_| self.is_beside(block)) else { return true };
            let message = format!("`{}` computes beside the tick, so it cannot be in a part", block.key.name);
            let help = format!(
                "move [nodes.{}] to the graph file, and wire its outputs to an input of the part",
                block.key.name
            );
            self.diagnostics.push(Diagnostic::new(Code::UnknownType, kind.span.clone(), message).help(help));
            false
        });
    }

    fn is_beside(&self, block: &Block) -> bool {
        block.kind.as_ref().is_some_and(|kind| self.beside.contains(&kind.value))
    }

    fn add_beside(&mut self, mut block: Block, document: &mut GraphDocument, bench: &mut BenchDocument) {
        let (key, Some(kind)) = (block.key.clone(), block.kind.clone()) else { return };
        if let Some(other) = taken(&key, bench) {
            let message = format!("the bench has a device or a binding with the name `{}`", key.name);
            let diagnostic = Diagnostic::new(Code::DuplicateName, key.span.clone(), message);
            self.diagnostics.push(diagnostic.note(other, "it is here").help("rename the node"));
            return;
        }
        if document.roles.position(&key.name).is_some() {
            let message = format!("the name `{}` is used twice", key.name);
            let help = "roles, nodes and parts share one namespace: rename one of them";
            self.diagnostics.push(Diagnostic::new(Code::DuplicateName, key.span.clone(), message).help(help));
            return;
        }
        if let Some(role) = &block.only_with {
            let message = "a node that computes beside the tick cannot be left out with `only_with`";
            let diagnostic = Diagnostic::new(Code::UnknownKey, role.span.clone(), message);
            self.diagnostics.push(diagnostic.help("remove `only_with`"));
        }
        self.check_clock(&key, document);
        if let Item::Table(params) = &mut block.params.item {
            let restart = params.remove(RESTART).map(|(_, value)| value);
            block.reconnect = restart.and_then(|value| self.sections(|s| Spanned::read(&value, &mut s.reader)));
        }
        let kind = Spanned { value: role_type_of(&kind.value, &key.name), span: kind.span };
        document.roles.push(key.clone(), kind);
        document.commands.extend(block.wires.valid.drain(..).map(|wire| (key.clone(), wire)));
        let word = Spanned { value: key.name.clone(), span: key.span.clone() };
        bench.bind.push(key, Binding { word });
        bench.devices.push(block);
    }

    fn check_clock(&mut self, key: &Key, document: &GraphDocument) {
        let table = document.graph.as_ref().and_then(|(_, table)| table.as_ref());
        if let Some(clock) = table.and_then(|table| table.clock.as_ref()).filter(|clock| clock.value == key.name) {
            let message = format!("`{}` computes beside the tick, so it cannot trigger the ticks", key.name);
            let diagnostic = Diagnostic::new(Code::BadClock, clock.span.clone(), message);
            self.diagnostics.push(diagnostic.help("name the role of a sensor, for example the one that it reads"));
        }
    }
}

/// Returns the place in the bench that has the name of a block already.
fn taken(key: &Key, bench: &BenchDocument) -> Option<std::ops::Range<usize>> {
    let device = bench.devices.iter().map(|device| &device.key).find(|device| device.name == key.name);
    let binding = bench.bind.iter().map(|(role, _)| role).find(|role| role.name == key.name);
    device.or(binding).map(|other| other.span.clone())
}
