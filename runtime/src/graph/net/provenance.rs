//! Provenance: the roles whose samples a port descends from.

use std::iter::successors;

use super::Net;
use crate::graph::plan::Producer;

/// For each node, the roles upstream of it, as bits.
#[derive(Debug, Default)]
pub(crate) struct Provenance {
    /// Number of words of a node.
    width: usize,
    words: Vec<u64>,
}

impl Provenance {
    /// Follows all wires, delayed ones too.
    pub(super) fn new(net: &Net<'_>) -> Self {
        let width = net.roles.len().div_ceil(64);
        let mut found = Self { width, words: vec![0; width * net.wires.len()] };
        // A delayed wire comes from a later node, so one pass may not be enough.
        let mut has_changed = true;
        while has_changed {
            has_changed = net.order.iter().filter(|node| found.collect(net, **node)).count() > 0;
        }
        found
    }

    /// Adds the roles of the sources of a node, and returns whether there were new ones.
    fn collect(&mut self, net: &Net<'_>, node: usize) -> bool {
        let mut has_changed = false;
        let own = node * self.width;
        for wire in &net.wires[node] {
            for i in 0..self.width {
                let word = match wire.source.producer {
                    Producer::Node(source) => self.words[source * self.width + i],
                    Producer::Role(role) if role / 64 == i => 1 << (role % 64),
                    // A mode is decided by several ports; a flag of it carries no value of theirs.
                    Producer::Role(_) | Producer::Task(_) => 0,
                };
                has_changed |= word & !self.words[own + i] != 0;
                self.words[own + i] |= word;
            }
        }
        has_changed
    }

    /// Returns the roles that a producer descends from; a role descends from itself.
    pub(crate) fn roles(&self, producer: Producer) -> impl Iterator<Item = usize> {
        let (role, words) = match producer {
            Producer::Role(role) => (Some(role), &[][..]),
            Producer::Task(_) => (None, &[][..]),
            Producer::Node(node) => (None, &self.words[node * self.width..][..self.width]),
        };
        // Each step clears the lowest bit, so that only bits that are set take time.
        let rest = |word: u64| successors(used(word), |word| used(word & (word - 1)));
        let bits = words
            .iter()
            .enumerate()
            .flat_map(move |(i, word)| rest(*word).map(move |word| i * 64 + word.trailing_zeros() as usize));
        role.into_iter().chain(bits)
    }
}

/// Returns a word in which a bit is set.
fn used(word: u64) -> Option<u64> {
    (word != 0).then_some(word)
}
