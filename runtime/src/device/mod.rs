//! The edge: what a sensor or a robot looks like to a graph. Time and I/O exist only here.
//!
//! A task declares *roles*, such as `tactile_pad` and `velocity_arm`. A *device* fills one role or several. There are
//! two contracts. A [`Stepped`] device is synchronous and deterministic: a simulation, a replay, a mock, a simulator in
//! lockstep. A [`Live`] device is an async driver that fills a latest-value slot, so a slow disk or network makes a
//! sample old and never a tick late.

mod attached;
mod clock;
mod description;
mod exchange;
mod lease;
mod live;
mod misfits;
mod recorded;
mod silence;

use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use crate::node::{Describe, Mistakes, Param, ParamSpec, PortSpec, Reader};
use crate::source::Value;

pub use attached::Attached;
pub use clock::ClockReading;
pub(crate) use description::StatedPort;
pub use description::{AnyReport, Command, Description, Fill, Output, Report};
pub use exchange::{Commands, ReportAge, Samples};
pub(crate) use exchange::{PortSample, SampleState};
pub use live::{Link, Live};
pub(crate) use live::{LinkSetup, Linked, start, wait};
pub use recorded::RecordedDevice;
pub use silence::{OnSilence, Silence};

/// The type of a role: the ports that a task reads, and the ports that it commands.
#[derive(Debug, Clone, Default)]
#[must_use]
pub struct RoleType {
    /// Its name in the section `[roles]`.
    pub name: Cow<'static, str>,
    /// A summary in one line.
    pub summary: Cow<'static, str>,
    /// The outputs. The frame `"self"` is the frame of the role.
    pub outputs: Vec<PortSpec>,
    /// The commands, which are joint vectors.
    pub commands: Vec<PortSpec>,
    /// The reports: values of any kind that move nothing. A wire to them is optional, and no limits apply.
    pub reports: Vec<PortSpec>,
    /// The limits that every command must pass, in the order in which a motion passes them. They are names in the
    /// `holds` of nodes; see [`Limits`](crate::node::Limits).
    pub limits: Vec<Cow<'static, str>>,
    /// Of a sensor: those limits of the arm that carries it which the commands must pass only because of the sensor.
    pub arm_limits: Vec<Cow<'static, str>>,
    /// The name under which a bench adds a role of this type to every task: a task need not declare it.
    pub joined_as: Option<Cow<'static, str>>,
    /// Whether only scenarios and recordings may read it: a simulation knows its values, and no sensor does. A bench
    /// binds it under its name, or under one that ends with the last word of it, and no task declares it.
    pub is_observed: bool,
    /// Another type that has at least the ports of this one: a device that fills it fills this one as well.
    pub filled_as: Option<Cow<'static, str>>,
}

impl RoleType {
    /// Whether a device that fills roles of type `kind` can fill this one.
    #[must_use]
    pub fn is_filled_by(&self, kind: &str) -> bool {
        self.name == kind || self.filled_as.as_deref() == Some(kind)
    }

    /// Whether it is for scenarios and recordings only, and a bench binds it as `name`.
    #[must_use]
    pub fn is_observed_as(&self, name: &str) -> bool {
        self.is_observed && (self.name == name || name.rsplit('_').next() == Some(self.observed_name()))
    }

    /// Returns the last word of its name, under which a bench binds it if it is for scenarios and recordings only.
    #[must_use]
    pub fn observed_name(&self) -> &str {
        self.name.rsplit('_').next().unwrap_or(&self.name)
    }
}

/// The failure of a device during a run: its message. A text and an `io::Error` convert to it with `?` or `into`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeviceError(pub String);

impl From<String> for DeviceError {
    fn from(message: String) -> Self {
        Self(message)
    }
}

impl From<&str> for DeviceError {
    fn from(message: &str) -> Self {
        Self(message.to_owned())
    }
}

impl From<std::io::Error> for DeviceError {
    fn from(error: std::io::Error) -> Self {
        Self(error.to_string())
    }
}

impl fmt::Display for DeviceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for DeviceError {}

/// What disturbs the world of a simulation. Directions are along the axes of the sensor at the start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disturbance {
    /// Force on the origin of the sensor, as of a hand [N].
    pub push: [f64; 3],
    /// Velocity of the objects, beside that of their own [m/s].
    pub velocity: [f64; 3],
    /// Factor of the stiffness of the surfaces of the objects [1].
    pub stiffness: f64,
    /// Whether the objects are gone.
    pub is_gone: bool,
}

impl Default for Disturbance {
    fn default() -> Self {
        Self { push: [0.0; 3], velocity: [0.0; 3], stiffness: 1.0, is_gone: false }
    }
}

/// A synchronous device: deterministic, without a thread.
pub trait Stepped: Send {
    /// Returns the time of the next sample from the start of the device [ns], or `None` if there are no more.
    fn next(&self) -> Option<i64>;

    /// Returns the time of the last sample, if the device knows it [ns]. A progress bar uses it, and it shows that a
    /// run ends by itself.
    fn end(&self) -> Option<i64> {
        None
    }

    /// Receives the commands since the last call, and writes everything sampled up to `now` [ns].
    ///
    /// # Errors
    /// If the device fails. The run ends.
    fn exchange(&mut self, now: i64, commands: &Commands, samples: &mut Samples) -> Result<(), DeviceError>;

    /// Disturbs the simulated world from now on. Returns whether the device simulates one.
    fn disturb(&mut self, disturbance: &Disturbance) -> bool {
        let _ = disturbance;
        false
    }

    /// Receives a flag that is set when the operator ends the run. A device that waits for another program looks at it
    /// while it waits, and soon gives up.
    fn watch(&mut self, is_ending: &'static AtomicBool) {
        let _ = is_ending;
    }

    /// Called at the end of the run, with its reason. Every command was zero in the last exchange. It is not called for
    /// a device that has failed.
    fn finish(&mut self, reason: &str) {
        let _ = reason;
    }
}

/// How a device runs.
pub enum Driver {
    /// Step by step with the graph.
    Stepped(Box<dyn Stepped>),
    /// Step by step with the graph and with another program: each waits for the other one. Such a device does not run
    /// beside a live one.
    Lockstep(Box<dyn Stepped>),
    /// By itself, in real time.
    Live(Box<dyn Live>),
    /// Step by step in virtual time, and by itself in real time: a program that computes beside the tick.
    Beside {
        /// The device in virtual time. A tick waits for it.
        stepped: Box<dyn Stepped>,
        /// The device in real time. A tick never waits for it.
        live: Box<dyn Live>,
    },
    /// Not at all: a replay writes its samples. `is_live`: whether the device was live when it was recorded.
    Recorded {
        /// Whether it ran in real time.
        is_live: bool,
    },
}

/// A device that is described and ready to run.
pub struct Opened {
    /// Its description.
    pub description: Description,
    /// How it runs.
    pub driver: Driver,
}

/// Opens a live device once more, with the parameters that it was opened with. `None` if it cannot be opened any more.
#[derive(Clone)]
pub(crate) struct Again(Arc<dyn Fn() -> Option<Box<dyn Live>> + Send + Sync>);

impl Again {
    pub(crate) fn open(&self) -> Option<Box<dyn Live>> {
        (self.0)()
    }
}

impl fmt::Debug for Again {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Again")
    }
}

/// A device type. Its example adds it to a graph: `[roles]`, `[commands]`, `[bind]` and `[devices.…]`.
pub trait Device: Describe + Sized + 'static {
    /// The parameters in a bench file. They are kept, to open a device once more whose driver has ended with an error.
    type Params: Param + Clone + Send + Sync;

    /// Whether a block of the section `[nodes]` may have this type: a node that computes beside the tick. Its inputs are
    /// the reports of the role that it [states](Self::role), and its outputs are the outputs of that role.
    const IS_NODE: bool = false;

    /// Returns the type of role that such a block fills. Its name is that of the role in the description.
    ///
    /// # Errors
    /// The mistakes in the parameters and in the files that they name.
    fn role(params: &Self::Params) -> Result<RoleType, Mistakes> {
        let _ = params;
        unreachable!("only a device that is a node states the type of its role")
    }

    /// Opens the device. A live device connects later, when it runs.
    ///
    /// # Errors
    /// The mistakes in the parameters and in the files that they name.
    fn open(params: Self::Params) -> Result<Opened, Mistakes>;
}

/// The erased form of a device type, as in a catalogue.
pub trait DeviceType: Send + Sync {
    /// Returns its `type` in a bench file.
    fn name(&self) -> Cow<'static, str>;
    /// Returns a summary in one line.
    fn summary(&self) -> Cow<'static, str>;
    /// Returns its documentation as Markdown; empty if it has none.
    fn doc(&self) -> Cow<'static, str> {
        "".into()
    }
    /// Returns the sections that add it to a graph; empty if it has no example.
    fn example(&self) -> Cow<'static, str> {
        "".into()
    }
    /// Returns the parameters in a bench file.
    fn params(&self) -> Vec<ParamSpec>;
    /// Whether a block of the section `[nodes]` may have this type.
    fn is_node(&self) -> bool {
        false
    }
    /// Reads the parameters of such a block, and returns the type of the role that it fills. The reader collects the
    /// mistakes.
    fn role(&self, table: &Value, reader: &mut Reader<'_>) -> Option<RoleType> {
        let _ = (table, reader);
        None
    }
    /// Reads the parameters and opens the device. The reader collects the mistakes.
    fn open(&self, table: &Value, reader: &mut Reader<'_>) -> Option<Opened>;
}

struct TypedDevice<D>(PhantomData<fn() -> D>);

pub(crate) fn device_type<D: Device>() -> Box<dyn DeviceType> {
    Box::new(TypedDevice::<D>(PhantomData))
}

impl<D: Device> DeviceType for TypedDevice<D> {
    fn name(&self) -> Cow<'static, str> {
        D::NAME.into()
    }

    fn summary(&self) -> Cow<'static, str> {
        D::SUMMARY.into()
    }

    fn doc(&self) -> Cow<'static, str> {
        D::DOC.into()
    }

    fn example(&self) -> Cow<'static, str> {
        D::EXAMPLE.into()
    }

    fn params(&self) -> Vec<ParamSpec> {
        D::Params::fields()
    }

    fn is_node(&self) -> bool {
        D::IS_NODE
    }

    fn role(&self, table: &Value, reader: &mut Reader<'_>) -> Option<RoleType> {
        let before = reader.mistakes.len();
        let params = D::Params::read(table, reader).filter(|_| reader.mistakes.len() == before)?;
        D::role(&params).map_err(|mistakes| reader.mistakes.extend(mistakes)).ok()
    }

    fn open(&self, table: &Value, reader: &mut Reader<'_>) -> Option<Opened> {
        let before = reader.mistakes.len();
        let params = D::Params::read(table, reader).filter(|_| reader.mistakes.len() == before)?;
        match D::open(params.clone()) {
            Ok(mut opened) => {
                opened.description.again = Some(Again(Arc::new(move || match D::open(params.clone()).ok()?.driver {
                    Driver::Live(driver) | Driver::Beside { live: driver, .. } => Some(driver),
                    Driver::Stepped(_) | Driver::Lockstep(_) | Driver::Recorded { .. } => None,
                })));
                Some(opened)
            }
            Err(mistakes) => {
                reader.mistakes.extend(mistakes);
                None
            }
        }
    }
}
