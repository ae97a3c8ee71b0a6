//! The node contract: plain data in, plain data out.
//!
//! A node is one file: a struct with its documentation, the structs of its parameters, inputs, outputs and state, and one
//! `impl` [`Node`]. `docs/writing-a-node.md` builds one.
//!
//! | Derive | implements | reads |
//! |---|---|---|
//! | `#[derive(Describe)]` | [`Describe`](trait@Describe) | the doc comment, `#[describe(name = "…", every_tick, logs)]` |
//! | `#[derive(Param)]` | [`Param`](trait@Param) for a table or a word | `#[param(unit = "…", range = …, above = …, default = …, live)]` |
//! | `#[derive(Inputs)]` | [`InputSet`] | `#[port(unit = "…", frame = "…", …)]` |
//! | `#[derive(Outputs)]` | [`OutputSet`] | the same |
//! | `#[derive(State)]` | [`Clone`], field by field, so that a reset does not allocate | |
//!
//! The type of an input and its attribute say what it needs. Each fact is independent: whether it must be wired
//! (`optional`), whether it must be present while the node steps (`Option`), and whether a new value wakes the node
//! (`sampled`).
//!
//! | field | attribute | wakes the node when | when it is absent |
//! |---|---|---|---|
//! | `In<'a, T>` | | new or lost | the outputs are absent |
//! | `In<'a, T>` | `sampled` | lost | the outputs are absent |
//! | `Option<In<'a, T>>` | | new or lost | `None` |
//! | `Option<In<'a, T>>` | `sampled` | lost | `None` |
//! | `Option<In<'a, T>>` | `optional` | new or lost | `None`; it need not be wired |
//! | `Option<In<'a, T>>` | `optional, sampled` | lost | `None`; it need not be wired |
//! | `Option<In<'a, T>>` | `present_if_wired` | new or lost | the outputs are absent; `None` if it is not wired |
//! | `Option<In<'a, T>>` | `delayed` | new or lost one tick ago, if no other input wakes it | `None`; it is read as the last tick left it |
//! | `Many<'a, T>` | | any is new or lost | `None` for that wire; any number of wires, each named in the graph |
//!
//! A port names what its kind has, and `"_"` where there is nothing to name: `unit` and `frame` (`Scalar`, `Features`,
//! `Image`, `Regions`), `frame` (`Mask`, `Twist`), `frame` and `reference` (`Pose`), `unit` and `robot` (`Joints`), `frame`
//! and `robot` (`Jacobian`), nothing (`Flag`). A capital letter is a variable: what it stands for is known when the graph
//! is loaded, and it is the same for all ports of the node. `"$name"` is the frame or unit that the parameter `name` names.

mod bounds;
mod bus;
mod bus_access;
mod declare;
mod erased;
mod file_path;
mod inputs;
mod limits;
mod mistake;
mod outputs;
mod param_spec;
mod params;
mod pattern;
mod ports;
mod reader;
mod tick;
mod time;

pub use bounds::Bounds;
pub use bus::{Bus, PortId, Wires};
pub use bus_access::ScalarId;
pub use erased::{AnyNode, Built, Configured, Given, NodeSpec, NodeType, of};
pub use file_path::FilePath;
pub use inputs::{In, InputSet, Many, View};
pub use limits::{Components, Limits};
pub use mistake::{At, Mistake, Mistakes};
pub use outputs::{Out, OutputSet};
pub use param_spec::{Declared, ParamSpec, Repeats, Written, written_table};
pub use params::{Map, Spanned};
pub(crate) use pattern::{UnitPattern, declares_a_unit, frame_args, may_fit, unit_pattern};
pub use ports::{Letters, Need, PortSpec};
pub use reader::{Param, Reader, read_leaf};
pub use tactflow_derive::{Describe, Inputs, Outputs, Param, State};
pub use tick::Tick;
pub use time::{Absence, Interval};

/// The name and the documentation of a node or a device. `#[derive(Describe)]` takes them from the doc comment.
pub trait Describe {
    /// The `type` in a graph file.
    const NAME: &'static str;
    /// What it does, in one line.
    const SUMMARY: &'static str;
    /// How it does it, for the reference: the equation and its source, when to use it, what to look out for. Markdown.
    const DOC: &'static str = "";
    /// A block `[nodes.…]` to paste, or what plugs a device into a graph. Its wires may name the blocks of other nodes'
    /// examples and the roles of devices' examples: `describe` builds a graph from all of them, which loads.
    const EXAMPLE: &'static str = "";
    /// Whether a node steps in every tick, and not only when a trigger is new or lost: sinks and generators.
    const EVERY_TICK: bool = false;
    /// Whether the tool logs the inputs of a node after each tick in which its first output, a flag, is new and set. A
    /// step never logs: it decides, and the edge writes.
    const LOGS: bool = false;
}

/// A node: configuration in `self`, made at load; state apart, so that a mode is a second configuration.
pub trait Node: Describe + Sized + Send + 'static {
    /// What the graph file may set.
    type Params: Param;
    /// What the node reads.
    type Inputs<'a>: InputSet<'a>;
    /// What the node writes.
    type Outputs: OutputSet;
    /// What the node remembers from one step to the next; `()` if nothing.
    type State: Clone + Send + 'static;

    /// What holds of the motion it gives.
    const LIMITS: Limits = Limits::NONE;

    /// Makes the node: reads the shapes of the inputs and sets those of the outputs. May fail, may allocate.
    ///
    /// # Errors
    /// What is wrong with the parameters or the wires, each with its place.
    fn new(params: Self::Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes>;

    /// A fresh state: what a reset means.
    fn state(&self) -> Self::State;

    /// Which components of each input matter, in the order of the declaration, if of each output only those matter that
    /// are `wanted`: for a node that passes components on one by one. An empty list is all of all of them.
    fn uses(&self, wanted: &[Components]) -> Vec<Components> {
        let _ = wanted;
        Vec::new()
    }

    /// Told at load which components of each output anything reads: a feature that is projected out is not, and what
    /// is gathered for it would be gathered in vain. Whether the node leaves the others absent from then on.
    fn want(&mut self, wanted: &[Components]) -> bool {
        let _ = wanted;
        false
    }

    /// One step. Cannot fail, block, allocate, log or read a clock. An output that is not written is absent.
    fn step(&self, tick: &Tick, inputs: Self::Inputs<'_>, out: &mut Self::Outputs, state: &mut Self::State);
}

/// What a node is made from, beside its parameters.
pub struct Setup<N: Node> {
    /// Shapes of the inputs, as the wires give them.
    pub inputs: <N::Inputs<'static> as InputSet<'static>>::Shapes,
    /// Shapes of the outputs, for the node to set. Units that follow from the declaration are filled in afterwards.
    pub outputs: <N::Outputs as OutputSet>::Shapes,
    /// Nominal time between two ticks of the graph [s].
    pub period: f64,
    /// For the node to set: whether with these parameters it starts no motion by itself, though no sample is behind what
    /// it gives. What has samples behind it need not say so.
    pub is_still: bool,
}
