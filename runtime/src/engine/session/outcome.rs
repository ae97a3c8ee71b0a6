//! The options of a run and its outcome.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;
use std::time::Duration;

use super::run_requests::RunRequests;
use crate::fault::Fault;

/// Options of a run.
#[derive(Debug, Clone, Default)]
pub struct RunOptions {
    /// Maximum duration in the graph's time [s].
    pub duration: Option<f64>,
    /// Whether the wall clock paces virtual time. A run with live devices is always paced.
    pub is_realtime: bool,
    /// Operator words, each with its time in the graph [s]. `stop` halts all commands, `resume` ends the halt, other
    /// words go to the modes.
    pub sends: Vec<(f64, String)>,
    /// Whether to read operator words from the standard input, one per line.
    pub listens: bool,
    /// Ends the run as Ctrl-C does, once somebody sets it.
    pub cancel: Option<Arc<AtomicBool>>,
    /// Stops and tares that other threads request.
    pub requests: Option<Arc<RunRequests>>,
}

/// Why a run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum End {
    /// A device has no more samples.
    Finished,
    /// The maximum duration is reached.
    Duration,
    /// A `done` condition of a mode holds.
    Done,
    /// The operator interrupted it.
    Interrupted,
    /// A fault ended it.
    Fault(Box<Fault>),
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Finished => f.write_str("a device has no more samples"),
            Self::Duration => f.write_str("the time limit is reached"),
            Self::Done => f.write_str("the task is done"),
            Self::Interrupted => f.write_str("the operator interrupted the run"),
            Self::Fault(fault) => fault.fmt(f),
        }
    }
}

/// The outcome of a run.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Why it ended.
    pub end: End,
    /// The name of the signal that ended it, such as `SIGINT`, if one did.
    pub signal: Option<&'static str>,
    /// Time of the last tick in the graph's clock, without the ramp to zero [ns].
    pub time: i64,
    /// Number of ticks, without the ramp to zero.
    pub ticks: u64,
    /// Wall-clock time of the run.
    pub wall: Duration,
    /// Ticks that began more than a period late. Counted only in real time.
    pub late: u64,
}
