//! The erased contract: ports and parameters as data.
//!
//! [`of`] makes it from a [`Node`]; a node that is known only at run time, in another process say, implements
//! [`NodeType`] itself.

use std::any::Any;
use std::borrow::Cow;
use std::marker::PhantomData;

use super::{
    Bus, Components, InputSet, Limits, Mistakes, Node, OutputSet, Param, ParamSpec, PortId, PortSpec, Reader, Setup,
    Tick, Wires,
};
use crate::signal::Shape;
use crate::source::Value;

/// What is known of a node type without a graph.
#[derive(Debug, Clone)]
pub struct NodeSpec {
    /// Its `type` in a graph file.
    pub name: Cow<'static, str>,
    /// What it does, in one line.
    pub summary: Cow<'static, str>,
    /// How it does it, in Markdown; empty if there is nothing more to say.
    pub doc: Cow<'static, str>,
    /// A block to paste; empty if there is none.
    pub example: Cow<'static, str>,
    /// What a graph file may set.
    pub params: Vec<ParamSpec>,
    /// What it reads.
    pub inputs: Vec<PortSpec>,
    /// What it writes.
    pub outputs: Vec<PortSpec>,
    /// Whether it steps in every tick.
    pub every_tick: bool,
    /// Whether the tool logs what came in on its wires; see [`Describe::LOGS`](super::Describe::LOGS).
    pub logs: bool,
    /// What holds of the motion it gives.
    pub limits: Limits,
}

/// What a node is made from: the shapes its wires bring, by input in the order of the declaration.
#[derive(Debug, Clone, Default)]
pub struct Given {
    /// For each input its wires, with the names that the graph file gives a variadic one's.
    pub inputs: Vec<Vec<(String, Shape)>>,
    /// Nominal time between two ticks [s].
    pub period: f64,
}

/// A node type: what a catalogue lists.
pub trait NodeType: Send + Sync {
    /// Ports, parameters and docs.
    fn spec(&self) -> NodeSpec;

    /// Reads the parameters from the node's table; every mistake goes to the reader.
    fn configure(&self, table: &Value, reader: &mut Reader<'_>) -> Option<Box<dyn Configured>>;
}

/// A node whose parameters are read, but whose wires are not known yet.
pub trait Configured {
    /// Makes the node.
    ///
    /// # Errors
    /// What is wrong with the parameters or the wires.
    fn build(self: Box<Self>, given: Given) -> Result<Built, Mistakes>;
}

/// A node that can run, and the shapes of its outputs.
pub struct Built {
    /// The node.
    pub node: Box<dyn AnyNode>,
    /// Shape of each output in the order of the declaration.
    pub outputs: Vec<Shape>,
    /// Whether it starts no motion by itself; see [`Setup`].
    pub is_still: bool,
}

/// A node that can run.
pub trait AnyNode: Any + Send {
    /// One step: reads its wires from the bus and writes and marks its outputs.
    fn step(&mut self, tick: &Tick, bus: &mut Bus, wires: &Wires, outputs: &[PortId]);
    /// Makes every output absent.
    fn lose(&mut self, tick: u64, bus: &mut Bus, outputs: &[PortId]);
    /// Puts the state back to what it was at first, without allocating.
    fn reset(&mut self);
    /// Takes over the configuration of another node of its type, for a mode; its number, or the other if it cannot. That
    /// of the node itself has number 0.
    ///
    /// # Errors
    /// The other node, if its type knows no modes.
    fn adopt(&mut self, other: Box<dyn AnyNode>) -> Result<usize, Box<dyn AnyNode>> {
        Err(other)
    }
    /// Goes on with the configuration of that number, without allocating; the state stays. Whether it is another.
    fn switch(&mut self, configuration: usize) -> bool {
        let _ = configuration;
        false
    }
    /// See [`Node::uses`].
    fn uses(&self, wanted: &[Components]) -> Vec<Components> {
        let _ = wanted;
        Vec::new()
    }
    /// See [`Node::want`].
    fn want(&mut self, wanted: &[Components]) -> bool {
        let _ = wanted;
        false
    }
}

/// The erased form of a node written against the typed contract.
#[must_use]
pub fn of<N: Node>() -> Box<dyn NodeType> {
    Box::new(Typed::<N>(PhantomData))
}

struct Typed<N>(PhantomData<fn() -> N>);

impl<N: Node> NodeType for Typed<N> {
    fn spec(&self) -> NodeSpec {
        NodeSpec {
            name: N::NAME.into(),
            summary: N::SUMMARY.into(),
            doc: N::DOC.into(),
            example: N::EXAMPLE.into(),
            params: N::Params::fields(),
            inputs: <N::Inputs<'static> as InputSet<'static>>::specs(),
            outputs: N::Outputs::specs(),
            every_tick: N::EVERY_TICK,
            logs: N::LOGS,
            limits: N::LIMITS,
        }
    }

    fn configure(&self, table: &Value, reader: &mut Reader<'_>) -> Option<Box<dyn Configured>> {
        let params = N::Params::read(table, reader)?;
        Some(Box::new(WithParams::<N>(params)))
    }
}

struct WithParams<N: Node>(N::Params);

impl<N: Node> Configured for WithParams<N> {
    fn build(self: Box<Self>, given: Given) -> Result<Built, Mistakes> {
        let inputs = <N::Inputs<'static> as InputSet<'static>>::shapes(given.inputs);
        let mut setup = Setup::<N> { inputs, outputs: Default::default(), period: given.period, is_still: false };
        let node = N::new(self.0, &mut setup)?;
        let (outputs, is_still) = (N::Outputs::into_shapes(setup.outputs), setup.is_still);
        let state = node.state();
        let cell = Cell { active: Configuration { fresh: node.state(), node }, state, parked: vec![None], number: 0 };
        Ok(Built { node: Box::new(cell), outputs, is_still })
    }
}

struct Cell<N: Node> {
    active: Configuration<N>,
    state: N::State,
    /// The other configurations by their numbers; the place of the active one is empty.
    parked: Vec<Option<Configuration<N>>>,
    /// Number of the active one.
    number: usize,
}

struct Configuration<N: Node> {
    node: N,
    fresh: N::State,
}

impl<N: Node> AnyNode for Cell<N> {
    fn step(&mut self, tick: &Tick, bus: &mut Bus, wires: &Wires, outputs: &[PortId]) {
        let mut out = N::Outputs::take(bus, outputs, tick);
        let inputs = N::Inputs::fetch(bus, wires, tick.index);
        self.active.node.step(tick, inputs, &mut out, &mut self.state);
        out.put(bus, outputs, tick);
    }

    fn lose(&mut self, tick: u64, bus: &mut Bus, outputs: &[PortId]) {
        N::Outputs::lose(bus, outputs, tick);
    }

    fn reset(&mut self) {
        self.state.clone_from(&self.active.fresh);
    }

    fn adopt(&mut self, other: Box<dyn AnyNode>) -> Result<usize, Box<dyn AnyNode>> {
        if (&*other as &dyn Any).is::<Self>() {
            let other = (other as Box<dyn Any>).downcast::<Self>().expect("just asked");
            self.parked.push(Some(other.active));
            return Ok(self.parked.len() - 1);
        }
        Err(other)
    }

    fn switch(&mut self, configuration: usize) -> bool {
        let Some(next) = self.parked[configuration].take() else { return false };
        self.parked[self.number] = Some(std::mem::replace(&mut self.active, next));
        self.number = configuration;
        true
    }

    fn uses(&self, wanted: &[Components]) -> Vec<Components> {
        self.active.node.uses(wanted)
    }

    fn want(&mut self, wanted: &[Components]) -> bool {
        self.active.node.want(wanted)
    }
}
