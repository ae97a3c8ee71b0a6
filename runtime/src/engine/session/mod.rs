//! Runs around the tick: the exchange with devices, faults and halts, pacing, real time and the operator.

mod blame;
mod budgets;
mod build;
mod caught;
mod changer;
mod cycle;
mod drive;
mod drivers;
mod engine;
mod failures;
mod halt;
mod input_items;
mod inputs;
mod leases;
mod line_reader;
mod live_values;
mod measure;
mod operator;
mod outcome;
mod punctuality;
mod real_time;
mod replay;
mod run_requests;
mod schedule;
mod scheduled_changes;
mod signals;
mod tare;
mod task_run;
mod trouble;
mod words;

pub use caught::block_io_signals;
pub use changer::{Changer, Walk};
pub use drive::run_virtual;
pub use engine::{DisplayedPort, Engine, Logged};
pub use halt::{Halt, Rest};
#[cfg(feature = "mcap")]
pub(crate) use input_items::{InputItem, read_port};
pub use live_values::{LiveValue, ValueChange};
pub use outcome::{End, Outcome, RunOptions};
pub use punctuality::{Beginning, LateTick, Punctuality, TickUse};
pub use real_time::{run, run_changing};
pub use run_requests::{RunRequests, TareAnswer};
pub use scheduled_changes::{ChangeRequest, ScheduledChanges};
pub use signals::Interrupt;
pub use task_run::{TaskEnd, TaskRun};
