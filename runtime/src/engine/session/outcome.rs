//! What a run is asked for, and how it ends.

use std::fmt;
use std::time::Duration;

use crate::fault::Fault;

/// How to run.
#[derive(Debug, Clone, Default)]
pub struct RunOptions {
    /// How long at most, in the graph's clock [s].
    pub duration: Option<f64>,
    /// Whether virtual time is paced by the wall clock; live devices always are.
    pub is_realtime: bool,
    /// Words that are sent from outside: when, in the graph's time [s], and which. `stop` halts all commands, `resume`
    /// lets them go on, others are for the modes.
    pub sends: Vec<(f64, String)>,
    /// Whether words come in over the standard input, one a line.
    pub listens: bool,
}

/// Why a run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum End {
    /// A device has no more samples.
    Finished,
    /// The time is over.
    Duration,
    /// A mode says that the task is done.
    Done,
    /// The operator wanted it.
    Interrupted,
    /// Something went wrong.
    Fault(Box<Fault>),
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Finished => f.write_str("a device has no more samples"),
            Self::Duration => f.write_str("the time is over"),
            Self::Done => f.write_str("the task is done"),
            Self::Interrupted => f.write_str("the operator ended it"),
            Self::Fault(fault) => fault.fmt(f),
        }
    }
}

/// How a run went.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Why it ended.
    pub end: End,
    /// Time of the last tick in the graph's clock, the ramp to zero aside [ns].
    pub time: i64,
    /// Number of ticks, the ramp to zero aside.
    pub ticks: u64,
    /// Time it took.
    pub wall: Duration,
    /// Ticks that began more than a period late; counted with a real clock only.
    pub late: u64,
}
