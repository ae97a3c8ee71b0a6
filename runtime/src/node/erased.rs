//! The erased contract: ports and parameters as data.
//!
//! [`of`] makes it from a [`Node`]; a node that is known only at run time, in another process say, implements
//! [`NodeType`] itself.

use std::borrow::Cow;
use std::marker::PhantomData;

use super::{
    Bus, InputSet, Mistakes, Node, OutputSet, Param, ParamSpec, PortId, PortSpec, Reader, Setup, Tick, Value, Wires,
};
use crate::signal::Shape;

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
    /// Whether the tool logs what came in on its wires; see [`Node::LOGS`].
    pub logs: bool,
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
}

/// A node that can run.
pub trait AnyNode: Send {
    /// One step: reads its wires from the bus and writes and marks its outputs.
    fn step(&mut self, tick: &Tick, bus: &mut Bus, wires: &Wires, outputs: &[PortId]);
    /// Makes every output absent.
    fn lose(&mut self, tick: u64, bus: &mut Bus, outputs: &[PortId]);
    /// Puts the state back to what it was at first, without allocating.
    fn reset(&mut self);
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
        let mut setup = Setup::<N> { inputs, outputs: Default::default(), period: given.period };
        let node = N::new(self.0, &mut setup)?;
        let outputs = N::Outputs::into_shapes(setup.outputs);
        let (state, fresh) = (node.state(), node.state());
        Ok(Built { node: Box::new(Cell { node, state, fresh }), outputs })
    }
}

struct Cell<N: Node> {
    node: N,
    state: N::State,
    fresh: N::State,
}

impl<N: Node> AnyNode for Cell<N> {
    fn step(&mut self, tick: &Tick, bus: &mut Bus, wires: &Wires, outputs: &[PortId]) {
        let mut out = N::Outputs::take(bus, outputs);
        let inputs = N::Inputs::fetch(bus, wires, tick.index);
        self.node.step(tick, inputs, &mut out, &mut self.state);
        out.put(bus, outputs, tick);
    }

    fn lose(&mut self, tick: u64, bus: &mut Bus, outputs: &[PortId]) {
        N::Outputs::lose(bus, outputs, tick);
    }

    fn reset(&mut self) {
        self.state.clone_from(&self.fresh);
    }
}
