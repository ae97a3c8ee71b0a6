//! A node that is watched while it steps, beside a fresh one of the same kind.

use std::sync::{Arc, Mutex, PoisonError};

use super::CountAllocations;
use crate::graph::PlannedNode;
use crate::node::{AnyNode, Bus, Components, PortId, Tick, Wires};
use crate::signal::{
    Arenas, Features, Flag, Image, Jacobian, Joints, Kind, Mark, Mask, Pose, Regions, Scalar, Shape, Signal, Twist,
};

/// The node is reset before this step, and compared with a fresh one from there on.
const RESET_AT: u64 = 100;
/// So many steps are compared.
const COMPARED: u64 = 50;

/// What was found while a node ran.
#[derive(Debug, Default)]
pub(super) struct Finding {
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

/// A node in the place of itself.
pub(super) struct Watched {
    node: Box<dyn AnyNode>,
    /// A node that has not stepped before the other is reset.
    twin: Box<dyn AnyNode>,
    shapes: Vec<Shape>,
    /// Room for the outputs as they were before a step.
    before: Arenas,
    slots: Vec<u32>,
    count: Option<CountAllocations>,
    finding: Arc<Mutex<Finding>>,
}

impl Watched {
    /// Puts a watched node in the place of a planned one.
    pub(super) fn take_place_of(
        planned: &mut PlannedNode,
        twin: PlannedNode,
        count: Option<CountAllocations>,
        finding: Arc<Mutex<Finding>>,
    ) {
        let shapes: Vec<Shape> = planned.ports.iter().map(|port| port.shape.clone()).collect();
        let mut before = Arenas::default();
        let slots = shapes.iter().map(|shape| before.add(shape)).collect();
        let node = std::mem::replace(&mut planned.node, Box::new(Nothing));
        planned.node = Box::new(Self { node, twin: twin.node, shapes, before, slots, count, finding });
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
    fn compare(
        &mut self,
        tick: &Tick,
        bus: &mut Bus,
        wires: &Wires,
        outputs: &[PortId],
        marks: &[Mark],
    ) -> Option<usize> {
        let after = self.snapshots(bus, outputs);
        for ((id, mark), (shape, slot)) in outputs.iter().zip(marks).zip(self.shapes.iter().zip(&self.slots)) {
            self.before.copy(shape.kind(), *slot, &mut bus.arenas, id.slot);
            bus.marks[id.mark as usize] = *mark;
        }
        self.twin.step(tick, bus, wires, outputs);
        let fresh = self.snapshots(bus, outputs);
        (0..outputs.len()).find(|i| after[*i] != fresh[*i])
    }

    fn snapshots(&self, bus: &Bus, outputs: &[PortId]) -> Vec<String> {
        outputs.iter().zip(&self.shapes).map(|(id, shape)| snapshot(bus, *id, shape.kind())).collect()
    }
}

impl AnyNode for Watched {
    fn step(&mut self, tick: &Tick, bus: &mut Bus, wires: &Wires, outputs: &[PortId]) {
        let finding = Arc::clone(&self.finding);
        let mut finding = finding.lock().unwrap_or_else(PoisonError::into_inner);
        finding.steps += 1;
        let is_compared = (RESET_AT..RESET_AT + COMPARED).contains(&finding.steps);
        if finding.steps == RESET_AT {
            self.node.reset();
        }
        let marks: Vec<Mark> = outputs.iter().map(|id| bus.marks[id.mark as usize]).collect();
        for (id, (shape, slot)) in outputs.iter().zip(self.shapes.iter().zip(&self.slots)) {
            bus.arenas.copy(shape.kind(), id.slot, &mut self.before, *slot);
        }
        finding.allocating += u64::from(self.measure(tick, bus, wires, outputs) > 0);
        finding.written.resize(outputs.len(), false);
        finding.out_of_range.resize(outputs.len(), None);
        for (i, id) in outputs.iter().enumerate() {
            let is_present = bus.marks[id.mark as usize].is_present();
            finding.written[i] |= is_present;
            if let (true, Shape::Scalar(shape)) = (is_present, &self.shapes[i]) {
                let value = Scalar::arena(&bus.arenas)[id.slot as usize];
                let is_within = (shape.range[0]..=shape.range[1]).contains(&value);
                finding.out_of_range[i] = finding.out_of_range[i].or((!is_within).then_some((value, shape.range)));
            }
        }
        if is_compared {
            let differs = self.compare(tick, bus, wires, outputs, &marks);
            finding.differs = finding.differs.or(differs);
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

/// What stands in for a node that is being put elsewhere.
struct Nothing;

impl AnyNode for Nothing {
    fn step(&mut self, _: &Tick, _: &mut Bus, _: &Wires, _: &[PortId]) {}
    fn lose(&mut self, _: u64, _: &mut Bus, _: &[PortId]) {}
    fn reset(&mut self) {}
}

/// An output in words: its mark, and its value while it has one.
fn snapshot(bus: &Bus, id: PortId, kind: Kind) -> String {
    fn value<T: Signal + std::fmt::Debug>(bus: &Bus, id: PortId) -> String {
        format!("{:?}", T::arena(&bus.arenas)[id.slot as usize])
    }
    let mark = bus.marks[id.mark as usize];
    if !mark.is_present() {
        return "absent".into();
    }
    let value = match kind {
        Kind::Scalar => value::<Scalar>,
        Kind::Flag => value::<Flag>,
        Kind::Features => value::<Features>,
        Kind::Image => value::<Image>,
        Kind::Mask => value::<Mask>,
        Kind::Regions => value::<Regions>,
        Kind::Twist => value::<Twist>,
        Kind::Pose => value::<Pose>,
        Kind::Joints => value::<Joints>,
        Kind::Jacobian => value::<Jacobian>,
    };
    format!("{mark:?} {}", value(bus, id))
}
