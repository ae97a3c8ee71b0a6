//! How a plan runs. [`Engine`] holds everything that a tick touches.
//!
//! `core` is what runs inside a tick: latch, step, commit, and the conditions of modes. It names no lock, no clock and no
//! tokio. `session` is what stands around a tick: the exchange with devices, faults and halts, pacing, real time and
//! the operator.

mod core;
mod session;

pub(crate) use self::core::NodeRunner;
pub use self::core::{Change, Counters, Timing};
pub use session::{End, Engine, Halt, Interrupt, Logged, Outcome, RunOptions, View, run, run_virtual};
