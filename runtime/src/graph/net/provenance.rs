//! Provenance: the roles whose samples a port descends from. What a node computes beside the tick descends from its
//! inputs too.

use std::collections::BTreeMap;
use std::iter::successors;

use super::Net;
use crate::graph::plan::Producer;

/// For each node, and then for each role whose node computes beside the tick, the roles upstream of it, as bits.
#[derive(Debug, Default)]
pub(crate) struct Provenance {
    /// Number of words of a node.
    width: usize,
    words: Vec<u64>,
    /// The roles whose nodes compute beside the tick, each with the place of its words, counted in nodes.
    beside: BTreeMap<usize, usize>,
}

impl Provenance {
    /// Follows all wires, delayed ones too.
    pub(super) fn new(net: &Net<'_>) -> Self {
        let width = net.roles.len().div_ceil(64);
        let beside = (0..net.roles.len()).filter(|role| net.is_beside(*role));
        let beside: BTreeMap<usize, usize> = beside.zip(net.wires.len()..).collect();
        let words = vec![0; width * (net.wires.len() + beside.len())];
        let mut found = Self { width, words, beside };
        // A delayed wire comes from a later node, so one pass may not be enough.
        let mut has_changed = true;
        while has_changed {
            has_changed = net.order.iter().filter(|node| found.collect(net, **node)).count() > 0;
            for wire in net.commands.iter().filter(|wire| wire.is_report) {
                let place = found.beside.get(&wire.role).copied();
                has_changed |= place.is_some_and(|place| found.add(place, wire.source.producer));
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

    /// Adds the roles of a source to the words at a place, and returns whether there were new ones.
    fn add(&mut self, to: usize, source: Producer) -> bool {
        let (own, from, mut has_changed) = (to * self.width, self.place(source), false);
        for i in 0..self.width {
            let itself = match source {
                Producer::Role(role) if role / 64 == i => 1 << (role % 64),
                Producer::Role(_) | Producer::Node(_) | Producer::Task(_) => 0,
            };
            let word = itself | from.map_or(0, |from| self.words[from * self.width + i]);
            has_changed |= word & !self.words[own + i] != 0;
            self.words[own + i] |= word;
        }
        has_changed
    }

    /// Returns the place of the words of a producer, if something is upstream of it.
    fn place(&self, producer: Producer) -> Option<usize> {
        match producer {
            Producer::Node(node) => Some(node),
            Producer::Role(role) => self.beside.get(&role).copied(),
            // A mode is decided by several ports; a flag of it carries no value of theirs.
            Producer::Task(_) => None,
        }
    }

    /// Returns the roles that a producer descends from; a role descends from itself, and comes first.
    pub(crate) fn roles(&self, producer: Producer) -> impl Iterator<Item = usize> {
        let role = match producer {
            Producer::Role(role) => Some(role),
            Producer::Node(_) | Producer::Task(_) => None,
        };
        let words = self.place(producer).map_or(&[][..], |place| &self.words[place * self.width..][..self.width]);
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
