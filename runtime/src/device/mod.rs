//! The edge: what a sensor or a robot looks like to a graph. Time and I/O exist only here.
//!
//! A *role* is what a task asks for: `tactile_pad`, `velocity_arm`. A *device* fills one role or several. There are two
//! contracts: a [`Stepped`] device is synchronous and deterministic (simulation, replay, mock, lockstep); a [`Live`] one
//! is an async driver that fills a latest-value slot, so that a slow disk or network makes a sample old, never a tick
//! late.

mod description;
mod exchange;
mod live;
mod misfits;

use std::borrow::Cow;
use std::fmt;
use std::marker::PhantomData;

use crate::node::{Describe, Mistakes, Param, ParamSpec, PortSpec, Reader};
use crate::source::Value;

pub(crate) use description::StatedPort;
pub use description::{Command, Description, Fill, Output, Report};
pub use exchange::{Commands, Samples};
pub(crate) use exchange::{PortSample, SampleState};
pub use live::{Link, Live};
pub(crate) use live::{Linked, link};

/// What a task asks of the world: ports it reads and ports it commands.
#[derive(Debug, Clone)]
pub struct RoleType {
    /// Its name under `[roles]`.
    pub name: Cow<'static, str>,
    /// What it is, in one line.
    pub summary: Cow<'static, str>,
    /// What it gives; the frame `"self"` is the role's own.
    pub outputs: Vec<PortSpec>,
    /// What it takes; joint vectors only.
    pub commands: Vec<PortSpec>,
    /// What a task may tell it without moving it, of any kind; a graph need not. No limits hold of them.
    pub reports: Vec<PortSpec>,
    /// What must hold of every command; see [`Limits`](crate::node::Limits). The names of a node's `holds`, in the order
    /// in which a motion crosses them.
    pub limits: Vec<Cow<'static, str>>,
    /// Whether only a scenario and the recorder may read it: what a simulation knows and no sensor can. A bench binds it
    /// under the last word of its name, and no task declares it.
    pub is_observed: bool,
}

impl RoleType {
    /// Whether a bench means this role by `name`, if it is one that only a scenario and the recorder may read.
    #[must_use]
    pub fn is_observed_as(&self, name: &str) -> bool {
        self.is_observed && (self.name == name || self.observed_name() == name)
    }

    /// The last word of its name: under this a bench binds it, if it is observed.
    #[must_use]
    pub fn observed_name(&self) -> &str {
        self.name.rsplit('_').next().unwrap_or(&self.name)
    }
}

/// What went wrong with a device while it ran.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct DeviceError(pub String);

impl fmt::Display for DeviceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for DeviceError {}

/// A synchronous device: deterministic, without a thread.
pub trait Stepped: Send {
    /// Time of the next sample in the device's own time from its start [ns]; `None` when there will be no more.
    fn next(&self) -> Option<i64>;

    /// Time of the last sample there will be, if that is known [ns]: for a progress bar, and to know that a
    /// run ends by itself.
    fn end(&self) -> Option<i64> {
        None
    }

    /// Takes the commands that hold since the last call and gives everything sampled up to `now` [ns].
    ///
    /// # Errors
    /// When the device fails; the run ends.
    fn exchange(&mut self, now: i64, commands: &Commands, samples: &mut Samples) -> Result<(), DeviceError>;

    /// The run is over, for that reason, and every command has been zero in the last exchange. A device that failed is
    /// not called: the engine dropped it when it failed.
    fn finish(&mut self, reason: &str) {
        let _ = reason;
    }
}

/// How a device runs.
pub enum Driver {
    /// Step by step with the graph.
    Stepped(Box<dyn Stepped>),
    /// On its own, in real time.
    Live(Box<dyn Live>),
}

/// A device that is described and ready to run.
pub struct Opened {
    /// What it says of itself.
    pub description: Description,
    /// How it runs.
    pub driver: Driver,
}

/// A device type. Its example plugs it into a graph: `[roles]`, `[commands]`, `[bind]` and `[devices.…]`.
pub trait Device: Describe + Sized + 'static {
    /// What a bench file may set.
    type Params: Param;

    /// Opens the device. A live one does not connect yet: it connects when it runs.
    ///
    /// # Errors
    /// What is wrong with the parameters or with the files they name.
    fn open(params: Self::Params) -> Result<Opened, Mistakes>;
}

/// The erased form of a device type: what a catalogue lists.
pub trait DeviceType: Send + Sync {
    /// Its `type` in a bench file.
    fn name(&self) -> Cow<'static, str>;
    /// What it is, in one line.
    fn summary(&self) -> Cow<'static, str>;
    /// What else there is to know, in Markdown; empty if nothing.
    fn doc(&self) -> Cow<'static, str> {
        "".into()
    }
    /// What plugs it into a graph, to paste; empty if there is nothing.
    fn example(&self) -> Cow<'static, str> {
        "".into()
    }
    /// What a bench file may set.
    fn params(&self) -> Vec<ParamSpec>;
    /// Reads the parameters and opens the device; every mistake goes to the reader.
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

    fn open(&self, table: &Value, reader: &mut Reader<'_>) -> Option<Opened> {
        let params = D::Params::read(table, reader)?;
        match D::open(params) {
            Ok(opened) => Some(opened),
            Err(mistakes) => {
                reader.mistakes.extend(mistakes);
                None
            }
        }
    }
}
