//! The storage of all values of a running graph, and the wires of a node into it.

use super::Need;
use crate::signal::{Arenas, Mark, Shape};

/// The location of a port's value and mark.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PortId {
    /// Index into the arena of its kind.
    pub slot: u32,
    /// Index of the mark.
    pub mark: u32,
}

impl PortId {
    /// No port, for an input that is not wired.
    pub const NONE: Self = Self { slot: u32::MAX, mark: u32::MAX };
}

/// All values of a running graph and their marks.
#[derive(Debug, Default)]
pub struct Bus {
    /// Marks of all ports.
    pub marks: Vec<Mark>,
    /// Values of all ports.
    pub arenas: Arenas,
}

impl Bus {
    /// Adds a port.
    pub fn add(&mut self, shape: &Shape) -> PortId {
        self.marks.push(Mark::default());
        PortId { slot: self.arenas.add(shape), mark: self.marks.len() as u32 - 1 }
    }
}

/// The wires of one node: a port for each input, in the order of the declarations.
#[derive(Debug, Clone, Default)]
pub struct Wires {
    pub(super) single: Box<[PortId]>,
    many: Box<[PortId]>,
}

impl Wires {
    /// Creates the wires from the ports of each input: at most one for a plain input, any number for `Many`.
    #[must_use]
    pub fn new(inputs: &[(Need, Vec<PortId>)]) -> Self {
        let mut many = Vec::new();
        let single = inputs.iter().map(|(need, ports)| match need {
            need if need.is_many => {
                let start = many.len() as u32;
                many.extend_from_slice(ports);
                PortId { slot: start, mark: ports.len() as u32 }
            }
            _ => ports.first().copied().unwrap_or(PortId::NONE),
        });
        let single = single.collect();
        Self { single, many: many.into() }
    }

    /// Returns the port of input `i`, or `None` if it is not wired.
    #[must_use]
    pub fn port(&self, i: usize) -> Option<PortId> {
        Some(self.single[i]).filter(|port| *port != PortId::NONE)
    }

    /// Returns the ports of the variadic input `i`.
    #[must_use]
    pub fn ports(&self, i: usize) -> &[PortId] {
        let PortId { slot, mark } = self.single[i];
        &self.many[slot as usize..(slot + mark) as usize]
    }
}
