//! Observes a node while it steps, and compares it with a new node of the same type.

use std::sync::{Arc, Mutex, PoisonError};

use super::CountAllocations;
use crate::graph::PlannedNode;
use crate::node::{AnyNode, Bus, Components, PortId, Tick, Wires};
use crate::signal::{Arenas, Scalar, Shape};

/// The step before which the node is reset. From there on it is compared with a new node.
const RESET_AT: u64 = 100;
/// Number of steps that are compared.
const COMPARED: u64 = 50;

/// The observations of a run.
#[derive(Debug, Default)]
pub(super) struct StepRecord {
    pub(super) steps: u64,
    /// Whether each output had a value.
    pub(super) written: Vec<bool>,
    /// The first value of each scalar that was out of its range, and the range.
    pub(super) out_of_range: Vec<Option<(f64, [f64; 2])>>,
    /// Steps that allocated.
    pub(super) allocating: u64,
    /// The first output that differs from that of a fresh node.
    pub(super) differs: Option<usize>,
}

/// A node that wraps another and observes it.
pub(super) struct Watched {
    node: Box<dyn AnyNode>,
    /// A new node, which first steps after the reset of the other.
    twin: Box<dyn AnyNode>,
    shapes: Vec<Shape>,
    /// The outputs as they were before a step.
    before: Bus,
    saved: Vec<PortId>,
    count: Option<CountAllocations>,
    record: Arc<Mutex<StepRecord>>,
}

impl Watched {
    /// Wraps a planned node.
    pub(super) fn watch(
        planned: PlannedNode,
        twin: PlannedNode,
        count: Option<CountAllocations>,
        record: Arc<Mutex<StepRecord>>,
    ) -> PlannedNode {
        let shapes: Vec<Shape> = planned.ports.iter().map(|port| port.shape.clone()).collect();
        let mut before = Bus::default();
        let saved = shapes.iter().map(|shape| before.add(shape)).collect();
        let watched = Self { node: planned.node, twin: twin.node, shapes, before, saved, count, record };
        PlannedNode { node: Box::new(watched), ..planned }
    }

    /// Steps the node. Returns how often it allocated.
    fn measure(&mut self, tick: &Tick, bus: &mut Bus, wires: &Wires, outputs: &[PortId]) -> u64 {
        let node = &mut self.node;
        match self.count {
            Some(count) => count(&mut || node.step(tick, bus, wires, outputs)),
            None => {
                node.step(tick, bus, wires, outputs);
                0
            }
        }
    }

    /// Steps the fresh node on the same inputs. Returns the first output that differs.
    fn compare(&mut self, tick: &Tick, bus: &mut Bus, wires: &Wires, outputs: &[PortId]) -> Option<usize> {
        let after = self.snapshots(bus, outputs);
        copy(&self.shapes, (&self.before, &self.saved), (bus, outputs));
        self.twin.step(tick, bus, wires, outputs);
        let fresh = self.snapshots(bus, outputs);
        (0..outputs.len()).find(|i| after[*i] != fresh[*i])
    }

    fn snapshots(&self, bus: &Bus, outputs: &[PortId]) -> Vec<String> {
        outputs.iter().zip(&self.shapes).map(|(id, shape)| snapshot(bus, *id, shape)).collect()
    }
}

/// Copies ports with their marks from one bus to another.
fn copy(shapes: &[Shape], (bus, from): (&Bus, &[PortId]), (other, to): (&mut Bus, &[PortId])) {
    for (shape, (from, to)) in shapes.iter().zip(from.iter().zip(to)) {
        bus.arenas.copy(shape.kind(), from.slot, &mut other.arenas, to.slot);
        *other.mark_mut(*to) = *bus.mark(*from);
    }
}

impl AnyNode for Watched {
    fn step(&mut self, tick: &Tick, bus: &mut Bus, wires: &Wires, outputs: &[PortId]) {
        let record = Arc::clone(&self.record);
        let mut record = record.lock().unwrap_or_else(PoisonError::into_inner);
        record.steps += 1;
        let is_compared = (RESET_AT..RESET_AT + COMPARED).contains(&record.steps);
        if record.steps == RESET_AT {
            self.node.reset();
        }
        copy(&self.shapes, (bus, outputs), (&mut self.before, &self.saved));
        record.allocating += u64::from(self.measure(tick, bus, wires, outputs) > 0);
        record.written.resize(outputs.len(), false);
        record.out_of_range.resize(outputs.len(), None);
        for (i, id) in outputs.iter().enumerate() {
            record.written[i] |= bus.mark(*id).is_present();
            if let Shape::Scalar(shape) = &self.shapes[i]
                && let Some(&value) = bus.get::<Scalar>(*id)
            {
                let is_within = (shape.range[0]..=shape.range[1]).contains(&value);
                record.out_of_range[i] = record.out_of_range[i].or((!is_within).then_some((value, shape.range)));
            }
        }
        if is_compared {
            let differs = self.compare(tick, bus, wires, outputs);
            record.differs = record.differs.or(differs);
        }
    }

    fn lose(&mut self, tick: u64, bus: &mut Bus, outputs: &[PortId]) {
        self.node.lose(tick, bus, outputs);
    }

    fn reset(&mut self) {
        self.node.reset();
        self.twin.reset();
    }

    fn switch(&mut self, configuration: usize) -> bool {
        self.twin.switch(configuration);
        self.node.switch(configuration)
    }

    fn uses(&self, wanted: &[Components]) -> Vec<Components> {
        self.node.uses(wanted)
    }

    fn want(&mut self, wanted: &[Components]) -> bool {
        self.twin.want(wanted);
        self.node.want(wanted)
    }
}

/// Writes an output in words: its mark, and its value while it has one.
fn snapshot(bus: &Bus, id: PortId, shape: &Shape) -> String {
    let mark = bus.mark(id);
    if !mark.is_present() {
        return "absent".into();
    }
    let mut value = Arenas::default();
    let slot = value.add(shape);
    bus.arenas.copy(shape.kind(), id.slot, &mut value, slot);
    format!("{mark:?} {value:?}")
}
