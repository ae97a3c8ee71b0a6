//! What runs inside a tick. Nothing here allocates, waits or calls the operating system.

mod command;
mod inlet;
mod modes;
mod runner;
mod slot;
mod tick;

pub(crate) use command::{CommandSlot, ReportSlot};
pub use inlet::Counters;
pub(crate) use inlet::{Inlet, START_TIME};
pub use modes::ModeChange;
pub(crate) use modes::{ModeMachine, Transition};
pub(crate) use runner::{AgedWire, NodeRunner};
pub(crate) use slot::{DeviceLink, DeviceSlot};
pub use tick::Timing;
pub(crate) use tick::{Core, TaskTick};
