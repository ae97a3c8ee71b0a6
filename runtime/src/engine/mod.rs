//! Runs a compiled graph. [`Engine`] holds everything that a tick uses.
//!
//! `core` runs inside a tick: latch, step, commit, and the conditions of modes. It uses no lock and no tokio. `session`
//! runs around the tick: the exchange with devices, faults and halts, pacing, real time and the operator.

mod core;
mod session;

pub(crate) use self::core::NodeRunner;
pub use self::core::{Counters, ModeChange, Timing};
pub use session::{
    Beginning, ChangeRequest, Changer, DisplayedPort, End, Engine, Halt, Interrupt, LateTick, LiveValue, Logged,
    Outcome, Punctuality, Rest, RunOptions, RunRequests, ScheduledChanges, TareAnswer, TaskEnd, TaskRun, TickUse,
    Unquiet, ValueChange, Walk, block_io_signals, run, run_changing, run_virtual,
};
#[cfg(feature = "mcap")]
pub(crate) use session::{InputItem, read_port};
