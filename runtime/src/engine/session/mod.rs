//! Runs around the tick: the exchange with devices, faults and halts, pacing, real time and the operator.

mod blame;
mod budgets;
mod build;
mod caught;
mod cycle;
mod drive;
mod drivers;
mod engine;
mod failures;
mod halt;
mod inputs;
mod leases;
mod line_reader;
mod measure;
mod operator;
mod outcome;
mod punctuality;
mod real_time;
mod replay;
mod schedule;
mod signals;
mod task_run;
mod trouble;
mod words;

pub use caught::block_io_signals;
pub use drive::run_virtual;
pub use engine::{DisplayedPort, Engine, Logged};
pub use halt::{Halt, Rest};
pub use outcome::{End, Outcome, RunOptions};
pub use punctuality::{Beginning, LateTick, Punctuality, TickUse};
pub use real_time::run;
pub use signals::Interrupt;
pub use task_run::{TaskEnd, TaskRun};
