//! What a device states before it runs: the roles it fills, and its ports in each, by name.

use std::borrow::Cow;
use std::marker::PhantomData;

use super::silence::{OnSilence, Silence};
use super::{Again, RoleType};
use crate::node::PortSpec;
use crate::signal::{Joint, JointsShape, Kind, Shape, Signal, Unit};

/// A name that is written in the source or made at load.
type Name = Cow<'static, str>;

/// What a device states of itself before it runs.
///
/// The ports of a role are stated by name. Each statement returns a handle, with which the device reads and writes the
/// port while it runs; so two ports cannot be mixed up, and no name is looked up in a tick. The loader compares what is
/// stated with the [`RoleType`](super::RoleType) and reports every difference.
///
/// ```
/// use tactflow_runtime::device::Description;
/// use tactflow_runtime::signal::{Image, ImageShape, Unit};
///
/// let shape = ImageShape { rows: 16, cols: 16, pitch: [0.005; 2], unit: Unit::NEWTON };
/// let mut description = Description::every(0.004);
/// let mut pad = description.fills("tactile_pad");
/// let image = pad.output::<Image>("image", shape);
/// pad.fact_in("threshold", 0.015, Unit::NEWTON);
/// # let _ = image;
/// ```
#[derive(Debug, Clone, Default)]
pub struct Description {
    /// Nominal time between two samples [s].
    pub period: f64,
    /// Time from the measurement of a sample to its arrival, as far as it is known [s]. The stamps of a live device are
    /// earlier by this time.
    pub latency: f64,
    /// What a device that moves does without commands; `None` if it declares nothing. Only a live device needs it.
    pub on_silence: Option<Silence>,
    /// Whether it moves something real: a run uses a tenth of its limits until somebody has proven, with the command
    /// that commissions a bench, that it stops by itself.
    pub needs_commissioning: bool,
    /// Whether it follows no command, as one that plays a recording. A run says so at its start.
    pub is_open_loop: bool,
    /// What a run says at its start about the commands to the device, one sentence each.
    pub(crate) notes: Vec<String>,
    /// Whether the bench lets the device come back after it was lost.
    pub(crate) may_return: bool,
    /// Opens it once more; `None` if it was not opened from a bench.
    pub(crate) again: Option<Again>,
    pub(crate) fills: Vec<Filled>,
    pub(crate) outputs: Vec<StatedPort>,
    pub(crate) commands: Vec<StatedPort>,
    pub(crate) reports: Vec<StatedPort>,
}

/// A role that a device can fill, and the facts that go with it.
#[derive(Debug, Clone)]
pub(crate) struct Filled {
    pub(crate) role: Name,
    /// Name of the side of the device, if it fills this type of role more than once.
    pub(crate) side: Option<Name>,
    pub(crate) facts: Vec<(Name, toml::Value)>,
}

/// A port that a device states.
#[derive(Debug, Clone)]
pub(crate) struct StatedPort {
    /// Index of the role among those that the device fills.
    pub(crate) fill: usize,
    pub(crate) name: Name,
    /// Its shape; of a report only the kind is known.
    pub(crate) shape: Shape,
}

impl Description {
    /// A device that samples every `period` [s] and fills no role yet.
    #[must_use]
    pub fn every(period: f64) -> Self {
        Self { period, ..Self::default() }
    }

    /// Declares what a device that moves does without commands: it is at rest `within` this time [s].
    pub fn on_silence(&mut self, reaction: OnSilence, within: f64) {
        self.on_silence = Some(Silence { reaction, within });
    }

    /// Returns the time after which the device has stopped by itself, if nothing is sent to it [s]. 100 ms if it
    /// declares none.
    pub(crate) fn silence(&self) -> f64 {
        self.on_silence.as_ref().map_or(0.1, |silence| silence.within)
    }

    /// Adds a sentence about the commands to the device, which a run says at its start.
    pub fn note(&mut self, text: impl Into<String>) {
        self.notes.push(text.into());
    }

    /// Adds a role that the device can fill.
    pub fn fills(&mut self, role: impl Into<Name>) -> Fill<'_> {
        self.add_role(role.into(), None)
    }

    /// Adds a role that the device can fill on one of its sides.
    ///
    /// A device with two pads adds `tactile_pad` twice, each with the name of its side. A bench binds a role to one of
    /// them by this name: `left_pad = "cell.left"`.
    pub fn fills_on(&mut self, side: impl Into<Name>, role: impl Into<Name>) -> Fill<'_> {
        self.add_role(role.into(), Some(side.into()))
    }

    fn add_role(&mut self, role: Name, side: Option<Name>) -> Fill<'_> {
        self.fills.push(Filled { role, side, facts: Vec::new() });
        let index = self.fills.len() - 1;
        Fill { description: self, index }
    }

    /// The roles that the device can fill, in the order in which they were added.
    pub fn roles(&self) -> impl Iterator<Item = &str> {
        self.fills.iter().map(|fill| &*fill.role)
    }

    /// Adds the reports of a role that the device does not read, and the optional outputs that it does not state, so that
    /// each has its number. These outputs are always absent.
    pub(crate) fn add_optional_ports(&mut self, fill: usize, role: &RoleType) {
        add_missing(&mut self.reports, fill, role.reports.iter());
        add_missing(&mut self.outputs, fill, role.outputs.iter().filter(|port| !port.need.must_be_wired));
    }

    /// Multiplies the maximum speed of each joint.
    pub(crate) fn slow_down(&mut self, fraction: f64) {
        self.joints().for_each(|joint| joint.speed *= fraction);
    }

    /// Takes back that the maximum speed of each joint was multiplied. The same fraction gives the same speeds again, to
    /// the last bit.
    #[cfg(feature = "mcap")]
    pub(crate) fn undo_slow_down(&mut self, fraction: f64) {
        for joint in self.joints() {
            let whole = joint.speed / fraction;
            let gives_it = |speed: &f64| (speed * fraction).to_bits() == joint.speed.to_bits();
            joint.speed = [whole, whole.next_up(), whole.next_down()].into_iter().find(gives_it).unwrap_or(whole);
        }
    }

    /// Returns the joints of all ports.
    fn joints(&mut self) -> impl Iterator<Item = &mut Joint> {
        let ports = self.outputs.iter_mut().chain(&mut self.commands);
        ports.flat_map(|port| match &mut port.shape {
            Shape::Joints(shape) => shape.joints.as_mut_slice(),
            _ => &mut [],
        })
    }

    /// The outputs of all roles with their shapes, in the order in which they were stated.
    pub fn outputs(&self) -> impl Iterator<Item = (&str, &Shape)> {
        self.outputs.iter().map(|port| (&*port.name, &port.shape))
    }

    /// The side of each output, in the order of [`outputs`](Self::outputs); `None` for a role without a side.
    pub fn output_sides(&self) -> impl Iterator<Item = Option<&str>> {
        self.outputs.iter().map(|port| self.fills[port.fill].side.as_deref())
    }

    /// Returns the first output of that name and kind.
    #[must_use]
    pub fn output<T: Signal>(&self, name: &str) -> Option<Output<T>> {
        find(&self.outputs, name, T::KIND).map(Output::at)
    }

    /// Returns the output of that name and kind on a side of the device, or on any side if `side` is `None`.
    #[must_use]
    pub fn output_on<T: Signal>(&self, side: Option<&str>, name: &str) -> Option<Output<T>> {
        let is_on = |port: &StatedPort| side.is_none() || self.fills[port.fill].side.as_deref() == side;
        let is_it = |port: &StatedPort| port.name == name && port.shape.kind() == T::KIND && is_on(port);
        self.outputs.iter().position(is_it).map(Output::at)
    }

    /// Returns the first command of that name.
    #[must_use]
    pub fn command(&self, name: &str) -> Option<Command> {
        find(&self.commands, name, Kind::Joints).map(Command)
    }

    /// Returns the first report of that name and kind.
    #[must_use]
    pub fn report<T: Signal>(&self, name: &str) -> Option<Report<T>> {
        find(&self.reports, name, T::KIND).map(Report::at)
    }

    /// Returns the shape of the first output or command of that name.
    #[must_use]
    pub fn shape(&self, name: &str) -> Option<&Shape> {
        self.outputs.iter().chain(&self.commands).find(|port| port.name == name).map(|port| &port.shape)
    }

    /// Returns the shape of an output.
    #[must_use]
    pub fn shape_of<T: Signal>(&self, output: Output<T>) -> &Shape {
        &self.outputs[output.port].shape
    }

    /// Returns a fact of the role of a type that the device fills on a side, or on any side if `side` is `None`.
    #[must_use]
    pub fn fact_on(&self, side: Option<&str>, role: &str, name: &str) -> Option<&toml::Value> {
        let is_it = |fill: &&Filled| fill.role == role && (side.is_none() || fill.side.as_deref() == side);
        let facts = &self.fills.iter().find(is_it)?.facts;
        facts.iter().find(|(fact, _)| fact == name).map(|(_, value)| value)
    }

    /// Returns the first fact of that name.
    #[must_use]
    pub fn fact(&self, name: &str) -> Option<&toml::Value> {
        let facts = self.fills.iter().flat_map(|fill| &fill.facts);
        facts.into_iter().find(|(fact, _)| fact == name).map(|(_, value)| value)
    }
}

fn add_missing<'s>(ports: &mut Vec<StatedPort>, fill: usize, declared: impl Iterator<Item = &'s PortSpec>) {
    for spec in declared {
        if !ports.iter().any(|port| port.fill == fill && port.name == spec.name) {
            ports.push(StatedPort { fill, name: spec.name.clone(), shape: spec.kind.default_shape() });
        }
    }
}

fn find(ports: &[StatedPort], name: &str, kind: Kind) -> Option<usize> {
    ports.iter().position(|port| port.name == name && port.shape.kind() == kind)
}

/// A role that is being described; see [`Description`].
pub struct Fill<'d> {
    description: &'d mut Description,
    index: usize,
}

impl Fill<'_> {
    /// States an output of the role, with its shape.
    pub fn output<T: Signal>(&mut self, name: impl Into<Name>, shape: T::Shape) -> Output<T> {
        Output::at(self.add(|description| &mut description.outputs, name, shape.into()))
    }

    /// States a command of the role, with the joints that it moves.
    pub fn command(&mut self, name: impl Into<Name>, shape: JointsShape) -> Command {
        Command(self.add(|description| &mut description.commands, name, shape.into()))
    }

    /// States a report of the role that the device reads. A device need not read the reports of its roles.
    pub fn report<T: Signal>(&mut self, name: impl Into<Name>) -> Report<T> {
        Report::at(self.add(|description| &mut description.reports, name, T::Shape::default().into()))
    }

    /// States a report whose kind is known only at run time.
    pub fn report_of(&mut self, name: impl Into<Name>, kind: Kind) -> AnyReport {
        AnyReport(self.add(|description| &mut description.reports, name, kind.default_shape()))
    }

    /// States a fact, which a graph file may use: `threshold = { from = "pad.threshold" }`.
    pub fn fact(&mut self, name: impl Into<Name>, value: impl Into<toml::Value>) {
        self.description.fills[self.index].facts.push((name.into(), value.into()));
    }

    /// States a fact with its unit. A parameter of another dimension does not accept it.
    pub fn fact_in(&mut self, name: impl Into<Name>, number: f64, unit: Unit) {
        self.fact(name, format!("{number} {unit}"));
    }

    /// States several facts.
    pub fn facts(&mut self, facts: impl IntoIterator<Item = (Name, toml::Value)>) {
        self.description.fills[self.index].facts.extend(facts);
    }

    /// States an output of a kind that is known only at run time.
    pub(crate) fn output_of(&mut self, name: impl Into<Name>, shape: Shape) {
        self.add(|description| &mut description.outputs, name, shape);
    }

    fn add(
        &mut self,
        list: fn(&mut Description) -> &mut Vec<StatedPort>,
        name: impl Into<Name>,
        shape: Shape,
    ) -> usize {
        let ports = list(self.description);
        ports.push(StatedPort { fill: self.index, name: name.into(), shape });
        ports.len() - 1
    }
}

/// A command port of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Command(pub(crate) usize);

/// A report port of a device whose kind is known only at run time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct AnyReport(pub(crate) usize);

macro_rules! handles {
    ($($(#[$doc:meta])* $name:ident)*) => { $(
        $(#[$doc])*
        #[derive(Debug)]
        pub struct $name<T> {
            pub(crate) port: usize,
            kind: PhantomData<fn() -> T>,
        }

        impl<T> $name<T> {
            pub(crate) const fn at(port: usize) -> Self {
                Self { port, kind: PhantomData }
            }
        }

        impl<T> Clone for $name<T> {
            fn clone(&self) -> Self {
                *self
            }
        }

        impl<T> Copy for $name<T> {}
    )* };
}

handles! {
    /// An output port of a device: what it writes as a sample.
    Output
    /// A report port of a device: what the task reports to it.
    Report
}
