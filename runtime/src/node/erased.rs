//! The erased contract: ports and parameters as data.
//!
//! [`of`] creates it from a [`Node`]. A node that is known only at run time, for example one in another process,
//! implements [`NodeType`] itself.

use std::any::Any;
use std::borrow::Cow;
use std::marker::PhantomData;

use super::{
    Bus, Components, InputSet, Limits, Mistakes, Motion, Node, OutputSet, Param, ParamSpec, PortId, PortSpec, Reader,
    Reading, Setup, Tick, Wires,
};
use crate::signal::Shape;
use crate::source::Value;

/// The description of a node type, independent of any graph.
#[derive(Debug, Clone)]
pub struct NodeSpec {
    /// The `type` in a graph file.
    pub name: Cow<'static, str>,
    /// What the node does, in one line.
    pub summary: Cow<'static, str>,
    /// The full documentation in Markdown; may be empty.
    pub doc: Cow<'static, str>,
    /// An example block to paste into a graph; may be empty.
    pub example: Cow<'static, str>,
    /// The parameters.
    pub params: Vec<ParamSpec>,
    /// The inputs.
    pub inputs: Vec<PortSpec>,
    /// The outputs.
    pub outputs: Vec<PortSpec>,
    /// Whether the node steps in every tick.
    pub every_tick: bool,
    /// Whether the tool logs the inputs; see [`Describe::LOGS`](super::Describe::LOGS).
    pub logs: bool,
    /// The limits that the node holds, passes on or breaks.
    pub limits: Limits,
}

/// The wiring from which a node is built.
#[derive(Debug, Clone, Default)]
pub struct Given {
    /// For each input, in the order of the declarations, the names and shapes of its wires. The names matter only for
    /// `Many`.
    pub inputs: Vec<Vec<(String, Shape)>>,
    /// Nominal time between two ticks [s].
    pub period: f64,
    /// For each input, the nominal time between two samples of the slowest device behind its wires, at least `period`
    /// [s].
    pub sample_periods: Vec<f64>,
}

/// A node type: an entry of a catalogue.
pub trait NodeType: Send + Sync {
    /// Returns the ports, the parameters and the documentation.
    fn spec(&self) -> NodeSpec;

    /// Reads the parameters from the node's table. The reader collects the mistakes.
    fn configure(&self, table: &Value, reader: &mut Reader<'_>) -> Option<Box<dyn Configured>>;
}

/// A node whose parameters are known, but not its wires.
pub trait Configured {
    /// Builds the node.
    ///
    /// # Errors
    /// The mistakes in the parameters or the wires.
    fn build(self: Box<Self>, given: Given) -> Result<Built, Mistakes>;
}

/// A built node and the shapes of its outputs.
pub struct Built {
    /// The node.
    pub node: Box<dyn AnyNode>,
    /// Shape of each output in the order of the declarations.
    pub outputs: Vec<Shape>,
    /// The motion that the node generates; see [`Setup`].
    pub motion: Motion,
    /// What its first output says about its first input; see [`Setup`].
    pub reading: Reading,
    /// Whether its limits are in raw readings; see [`Setup`].
    pub is_uncalibrated: bool,
    /// The warnings about its parameters and its wires.
    pub warnings: Mistakes,
}

/// A node that can run.
pub trait AnyNode: Any + Send {
    /// Runs one step: reads the wires from the bus, then writes and marks the outputs.
    fn step(&mut self, tick: &Tick, bus: &mut Bus, wires: &Wires, outputs: &[PortId]);
    /// Makes every output absent.
    fn lose(&mut self, tick: u64, bus: &mut Bus, outputs: &[PortId]);
    /// Resets the state in place, without allocating.
    fn reset(&mut self);
    /// Adds the configuration of another node of the same type, for a mode. Returns its number; the node's own
    /// configuration has number 0.
    ///
    /// # Errors
    /// Returns the other node if this type does not support modes.
    fn adopt(&mut self, other: Box<dyn AnyNode>) -> Result<usize, Box<dyn AnyNode>> {
        Err(other)
    }
    /// Switches to a configuration by its number, without allocating. The state stays. Returns whether the
    /// configuration changed.
    fn switch(&mut self, configuration: usize) -> bool {
        let _ = configuration;
        false
    }
    /// Exchanges all configurations with another node of the same type, without allocating. The state and the number of
    /// the active configuration stay. Returns whether the other node has as many configurations; nothing changes
    /// otherwise.
    fn exchange(&mut self, other: &mut dyn AnyNode) -> bool {
        let _ = other;
        false
    }
    /// See [`Node::found`].
    fn found(&self) -> Option<String> {
        None
    }
    /// See [`Node::returned`].
    fn returned(&mut self) {}
    /// See [`Node::can_tare`].
    fn can_tare(&self, tick: &Tick, bus: &Bus, wires: &Wires) -> Option<Result<(), String>> {
        let _ = (tick, bus, wires);
        None
    }
    /// See [`Node::tare`].
    fn tare(&mut self) {}
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

/// Returns the erased form of a node.
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
        let (outputs, period, sample_periods) = (Default::default(), given.period, given.sample_periods);
        let (motion, reading, warnings) = (Motion::Any, Reading::Other, Mistakes::new());
        let is_uncalibrated = false;
        let mut setup =
            Setup::<N> { inputs, outputs, period, sample_periods, motion, reading, is_uncalibrated, warnings };
        let node = N::new(self.0, &mut setup)?;
        let Setup { motion, reading, is_uncalibrated, warnings, .. } = setup;
        let outputs = N::Outputs::into_shapes(setup.outputs);
        let state = node.state();
        let cell = Cell { active: Configuration { fresh: node.state(), node }, state, parked: vec![None], number: 0 };
        Ok(Built { node: Box::new(cell), outputs, motion, reading, is_uncalibrated, warnings })
    }
}

struct Cell<N: Node> {
    active: Configuration<N>,
    state: N::State,
    /// The inactive configurations by number; the entry of the active one is `None`.
    parked: Vec<Option<Configuration<N>>>,
    /// Number of the active configuration.
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

    fn exchange(&mut self, other: &mut dyn AnyNode) -> bool {
        let Some(other) = (other as &mut dyn Any).downcast_mut::<Self>() else { return false };
        if other.parked.len() != self.parked.len() {
            return false;
        }
        other.switch(self.number);
        std::mem::swap(&mut self.active, &mut other.active);
        std::mem::swap(&mut self.parked, &mut other.parked);
        true
    }

    fn found(&self) -> Option<String> {
        self.active.node.found(&self.state)
    }

    fn returned(&mut self) {
        self.active.node.returned(&mut self.state);
    }

    fn can_tare(&self, tick: &Tick, bus: &Bus, wires: &Wires) -> Option<Result<(), String>> {
        self.active.node.can_tare(N::Inputs::fetch(bus, wires, tick.index), &self.state)
    }

    fn tare(&mut self) {
        self.active.node.tare(&mut self.state);
    }

    fn uses(&self, wanted: &[Components]) -> Vec<Components> {
        self.active.node.uses(wanted)
    }

    fn want(&mut self, wanted: &[Components]) -> bool {
        self.active.node.want(wanted)
    }
}
