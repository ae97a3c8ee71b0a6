//! Provenance: the roles whose samples a port descends from. What a node computes beside the tick descends from its
//! inputs too.

use std::iter::successors;

use super::Net;
use crate::graph::plan::Producer;

/// For each node, and then for each role, the roles upstream of it, as bits.
#[derive(Debug, Default)]
pub(crate) struct Provenance {
    /// Number of words of a node.
    width: usize,
    words: Vec<u64>,
    /// Number of nodes.
    nodes: usize,
}

impl Provenance {
    /// Follows all wires, delayed ones too.
    pub(super) fn new(net: &Net<'_>) -> Self {
        let width = net.roles.len().div_ceil(64);
        let nodes = net.wires.len();
        let mut found = Self { width, words: vec![0; width * (nodes + net.roles.len())], nodes };
        // A delayed wire comes from a later node, so one pass may not be enough.
        let mut has_changed = true;
        while has_changed {
            has_changed = net.order.iter().filter(|node| found.collect(net, **node)).count() > 0;
            for wire in net.commands.iter().filter(|wire| wire.is_report && net.is_beside(wire.role)) {
                has_changed |= found.add(nodes + wire.role, wire.source.producer);
            }
        }
        found
    }

    /// Adds the roles of the sources of a node, and returns whether there were new ones.
    fn collect(&mut self, net: &Net<'_>, node: usize) -> bool {
        let mut has_changed = false;
        for wire in &net.wires[node] {
            has_changed |= self.add(node, wire.source.producer);
        }
        has_changed
    }

    /// Adds the roles of a source to a node or a role, and returns whether there were new ones.
    fn add(&mut self, to: usize, source: Producer) -> bool {
        let (own, mut has_changed) = (to * self.width, false);
        for i in 0..self.width {
            let word = match source {
                Producer::Node(source) => self.words[source * self.width + i],
                Producer::Role(role) => {
                    let itself = if role / 64 == i { 1 << (role % 64) } else { 0 };
                    itself | self.words[(self.nodes + role) * self.width + i]
                }
                // A mode is decided by several ports; a flag of it carries no value of theirs.
                Producer::Task(_) => 0,
            };
            has_changed |= word & !self.words[own + i] != 0;
            self.words[own + i] |= word;
        }
        has_changed
    }

    /// Returns the roles that a producer descends from; a role descends from itself, and comes first.
    pub(crate) fn roles(&self, producer: Producer) -> impl Iterator<Item = usize> {
        let (role, words) = match producer {
            Producer::Role(role) => (Some(role), &self.words[(self.nodes + role) * self.width..][..self.width]),
            Producer::Task(_) => (None, &[][..]),
            Producer::Node(node) => (None, &self.words[node * self.width..][..self.width]),
        };
        // Each step clears the lowest bit, so that only bits that are set take time.
        let rest = |word: u64| successors(used(word), |word| used(word & (word - 1)));
        let bits = words
            .iter()
            .enumerate()
            .flat_map(move |(i, word)| rest(*word).map(move |word| i * 64 + word.trailing_zeros() as usize));
        let is_other = move |other: &usize| Some(*other) != role;
        role.into_iter().chain(bits.filter(is_other))
    }
}

/// Returns a word in which a bit is set.
fn used(word: u64) -> Option<u64> {
    (word != 0).then_some(word)
}
