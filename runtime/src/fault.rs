//! What a run says when it went wrong: which node, which port, in which tick, and why.

use std::fmt;

/// Why a run ended in a fault.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Cause {
    /// A value that is not finite was written.
    NotFinite,
    /// A node panicked.
    Panicked(String),
    /// A device failed.
    Device(String),
    /// A device has no value for a port at present, and says why.
    Lost(String),
    /// The newest sample of a role is too old.
    Stale {
        /// How old it is [ns].
        age: i64,
        /// How old it may be [ns].
        max_age: i64,
    },
    /// What comes to a node over a wire is too old.
    StaleWire(Box<StaleWire>),
    /// The clock device is silent.
    SilentClock,
    /// A tick began too late.
    Late {
        /// By how much [ns].
        by: i64,
    },
    /// The operator wanted it.
    Operator,
    /// A mode came to what it calls a failure.
    Mode(String),
}

/// What came over a wire that may grow only so old.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StaleWire {
    /// The port it comes from.
    pub from: String,
    /// How old it is [ns].
    pub age: i64,
    /// How old it may be [ns].
    pub max_age: i64,
}

/// A controlled stop with its reason.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// The node, the role or the device.
    pub node: String,
    /// The port, where it was one.
    pub port: Option<String>,
    /// Number of the tick.
    pub tick: u64,
    /// Time of the tick in the graph's clock [ns].
    pub time: i64,
    /// Why.
    pub cause: Cause,
    /// `file:line:column` of what is at fault.
    pub place: String,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = match &self.port {
            Some(port) => format!("{}.{port}", self.node),
            None => self.node.clone(),
        };
        match &self.cause {
            Cause::NotFinite => write!(f, "`{name}` is not a finite number")?,
            Cause::Panicked(message) => write!(f, "node `{name}` panicked: {message}")?,
            Cause::Stale { age, max_age } => {
                write!(f, "`{name}` is {:.1} ms old, and may be {:.1} ms old", ms(*age), ms(*max_age))?;
            }
            Cause::StaleWire(wire) => {
                let StaleWire { from, age, max_age } = &**wire;
                write!(f, "`{from}` is {:.1} ms old for `{name}`, and may be {:.1} ms old", ms(*age), ms(*max_age))?;
            }
            Cause::SilentClock => write!(f, "the clock device `{name}` is silent")?,
            Cause::Late { by } => write!(f, "a tick began {:.1} ms late", ms(*by))?,
            Cause::Operator => write!(f, "the operator stopped it")?,
            Cause::Mode(why) => write!(f, "mode `{name}` failed: {why}")?,
            Cause::Lost(why) => write!(f, "`{name}` is lost: {why}")?,
            Cause::Device(message) => write!(f, "device `{name}` failed: {message}")?,
        }
        write!(f, " in tick {} at {:.3} s", self.tick, self.time as f64 * 1e-9)?;
        if self.place.is_empty() { Ok(()) } else { write!(f, " ({})", self.place) }
    }
}

fn ms(nanos: i64) -> f64 {
    nanos as f64 * 1e-6
}

impl std::error::Error for Fault {}
