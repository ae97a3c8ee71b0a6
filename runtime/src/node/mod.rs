//! The node contract: plain data in, plain data out.
//!
//! A node is one file: a struct with its documentation, the structs of its parameters, inputs, outputs and state, and
//! one `impl` [`Node`]. `docs/writing-a-node.md` builds one.
//!
//! | Derive | implements | reads |
//! |---|---|---|
//! | `#[derive(Describe)]` | [`Describe`](trait@Describe) | the name, the doc comment, `#[describe(name = "…", every_tick, logs)]` |
//! | `#[derive(Param)]` | [`Param`](trait@Param) for a table or a word | `#[param(unit = "…", range = …, above = …, usual = …, default = …, live, from_bench)]`, `#[param(flatten)]` |
//! | `#[derive(Inputs)]` | [`InputSet`] | `#[port(unit = "…", frame = "…", …)]` |
//! | `#[derive(Outputs)]` | [`OutputSet`] | the same |
//! | `#[derive(State)]` | [`Default`]; [`Clone`], field by field, so that a reset does not allocate | |
//!
//! The type of an input and its attribute declare what it needs. The three properties are independent: whether it must
//! be wired (`optional`), whether it must be present while the node steps (`Option`), and whether a new value wakes the
//! node (`sampled`).
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
//! A port declares the arguments of its kind, with `"_"` for none: `unit` and `frame` (`Scalar`, `Features`, `Image`,
//! `VectorImage`, `Regions`), `frame` (`Mask`, `Twist`), `frame` and `reference` (`Pose`), `unit` and `robot` (`Joints`), `frame` and
//! `robot` (`Jacobian`), nothing (`Flag`). A capital letter is a variable: its value is known when the graph is loaded,
//! and is the same for all ports of the node. `"$name"` is the frame or unit that the parameter `name` holds.
//!
//! Any port may declare its `quantity`, which says what the value is: `position` is not `equilibrium`, although kind,
//! unit and frame are the same. A capital letter passes a quantity through. A port without one outputs an unknown quantity and accepts
//! any. An input with `known` refuses an unknown quantity too.

mod bounds;
mod bus;
mod bus_access;
mod declare;
mod erased;
mod file_path;
mod inputs;
mod known_units;
mod limits;
mod measured;
mod mistake;
mod motion;
mod outputs;
mod param_spec;
mod params;
mod pattern;
mod ports;
mod reader;
mod reading;
mod tick;
mod time;
mod usual;

pub use bounds::Bounds;
pub use bus::{Bus, PortId, Wires};
pub use bus_access::ScalarId;
pub use erased::{AnyNode, Built, Configured, Given, NodeSpec, NodeType, of};
pub use file_path::FilePath;
pub use inputs::{In, InputSet, Many, View};
pub use known_units::KnownUnits;
pub use limits::{Components, Limits};
pub(crate) use measured::Amount;
pub use mistake::{At, Mistake, Mistakes, collect_both, refuse_any};
pub use motion::Motion;
pub use outputs::{Out, OutputSet};
pub use param_spec::{Contents, Declared, ParamSpec, Repeats, Written, written_table};
pub use params::{Map, Spanned};
pub(crate) use pattern::{UnitPattern, declares_a_unit, frame_args, may_fit, unit_pattern};
pub use ports::{LetterKind, Letters, Need, PortSpec};
pub use reader::{Measured, OpenTable, Param, ParamTable, Reader, read_leaf};
pub use reading::Reading;
pub use tactflow_derive::{Describe, Inputs, Outputs, Param, State};
pub use tick::Tick;
pub use time::{Absence, Interval};
pub(crate) use usual::shortest;

/// The name and the documentation of a node or a device. `#[derive(Describe)]` takes them from the struct and its doc
/// comment.
pub trait Describe {
    /// The `type` in a graph file.
    const NAME: &'static str;
    /// The summary in one line.
    const SUMMARY: &'static str;
    /// The documentation for the reference, in Markdown: the equation and its source, when to use the node, its
    /// pitfalls.
    const DOC: &'static str = "";
    /// A block `[nodes.…]` to paste, or the blocks that connect a device. Its wires may name the blocks of other nodes'
    /// examples and the roles of devices' examples: `describe` composes a complete graph from them.
    const EXAMPLE: &'static str = "";
    /// Whether the node steps in every tick, and not only when a trigger is new or lost. Sinks and generators do.
    const EVERY_TICK: bool = false;
    /// Whether the tool logs the inputs after each tick in which the first output, a flag, is new and set. A step
    /// itself never logs.
    const LOGS: bool = false;
}

/// A node. `self` is the configuration, built at load. The state is separate, so that a mode can exchange the
/// configuration.
pub trait Node: Describe + Sized + Send + 'static {
    /// The parameters; `()` for none.
    type Params: Param;
    /// The inputs; `()` for none.
    type Inputs<'a>: InputSet<'a>;
    /// The outputs; `()` for none.
    type Outputs: OutputSet;
    /// The state that lasts from one step to the next; `()` for none.
    type State: Clone + Default + Send + 'static;

    /// The limits that the node holds, passes on or breaks.
    const LIMITS: Limits = Limits::NONE;

    /// Builds the node: reads the shapes of the inputs and sets those of the outputs. It may allocate.
    ///
    /// # Errors
    /// The mistakes in the parameters or the wires, each with its place.
    fn new(params: Self::Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes>;

    /// Returns the initial state. A reset restores it. Implement it for a state that depends on the configuration.
    fn state(&self) -> Self::State {
        Self::State::default()
    }

    /// Returns the components of each input that the `wanted` components of the outputs depend on, in the order of the
    /// declarations. Implement it for a node that passes on components one by one. An empty list stands for all
    /// components of all inputs.
    fn uses(&self, wanted: &[Components]) -> Vec<Components> {
        let _ = wanted;
        Vec::new()
    }

    /// Receives at load the components of each output that something reads. A feature that a projector removes is not
    /// among them, so the node need not compute it. Returns whether the node leaves the other components absent.
    fn want(&mut self, wanted: &[Components]) -> bool {
        let _ = wanted;
        false
    }

    /// Returns what the node has found out so far, for the summary of a run and for the fault of
    /// [`Limits::fails`]. It is called outside of the steps, so it may allocate.
    fn found(&self, state: &Self::State) -> Option<String> {
        let _ = state;
        None
    }

    /// Forgets what held for the device behind an input: the bench lets this device come back (`reconnect`), and its
    /// port was lost. The next sample may come from a device that was opened again. It must not allocate.
    fn returned(&self, state: &mut Self::State) {
        let _ = state;
    }

    /// Whether the operator may take the zero of the sensor behind the node anew, and why not; `None` for a node that
    /// keeps no zero. The inputs are those of the last tick. It is called between two ticks, so it may allocate.
    fn can_tare(&self, inputs: Self::Inputs<'_>, state: &Self::State) -> Option<Result<(), String>> {
        let _ = (inputs, state);
        None
    }

    /// Takes the zero anew, from the next samples on. It is called only after [`can_tare`](Self::can_tare) has agreed.
    fn tare(&self, state: &mut Self::State) {
        let _ = state;
    }

    /// Runs one step. It must not block, allocate, log or read a clock. An output that it does not write becomes
    /// absent.
    fn step(&self, tick: &Tick, inputs: Self::Inputs<'_>, out: &mut Self::Outputs, state: &mut Self::State);
}

/// The wiring that a node is built with.
pub struct Setup<N: Node> {
    /// Shapes of the inputs, from the wires.
    pub inputs: <N::Inputs<'static> as InputSet<'static>>::Shapes,
    /// Shapes of the outputs, which the node sets. The runtime then fills in the units that follow from the
    /// declarations.
    pub outputs: <N::Outputs as OutputSet>::Shapes,
    /// Nominal time between two ticks of the graph [s].
    pub period: f64,
    /// The sample period of each input, see [`Setup::sample_period`] [s].
    pub(crate) sample_periods: Vec<f64>,
    /// The motion that the node generates. A node whose output is computed from samples leaves it `Any`.
    pub motion: Motion,
    /// What the first output says about the first input, if the node only smooths, delays or compares it.
    pub reading: Reading,
    /// Set by a limiter whose limits are in raw readings, so that nothing is limited in newtons. The bench must allow
    /// it.
    pub is_uncalibrated: bool,
    /// Warnings, which the node adds: what is valid, but probably a mistake. Each code has the severity of a warning,
    /// so that the graph still loads.
    pub warnings: Mistakes,
}

impl<N: Node> Setup<N> {
    /// Returns the nominal time between two samples of an input [s]: that of the slowest device whose samples it waits
    /// for, and at least `period`. Use it for the default age at which a value is too old.
    ///
    /// # Panics
    /// If the node has no input of this name.
    #[must_use]
    pub fn sample_period(&self, input: &str) -> f64 {
        let inputs = <N::Inputs<'static> as InputSet<'static>>::specs();
        let at = inputs.iter().position(|declared| declared.name == input);
        let at = at.unwrap_or_else(|| panic!("`{}` has no input `{input}`", N::NAME));
        self.sample_periods[at]
    }
}
