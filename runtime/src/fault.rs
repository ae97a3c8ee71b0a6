//! Faults: the node, the port, the tick and the cause of what went wrong in a run.

use std::fmt;

/// The cause of a fault.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Cause {
    /// A value is not finite.
    NotFinite,
    /// A node panicked, with this message.
    Panicked(String),
    /// A device failed, with this message.
    Device(String),
    /// A device has reported a port as lost, for this reason.
    Lost(String),
    /// The newest sample of a role is too old.
    Stale {
        /// Age of the sample [ns].
        age: i64,
        /// Maximum age [ns].
        max_age: i64,
    },
    /// A role has had no sample since the start.
    NeverSampled,
    /// The value of a wire is too old for its node, command or report.
    StaleWire(Box<StaleWire>),
    /// The clock device sends no samples.
    SilentClock,
    /// A tick began too late.
    Late {
        /// Delay of the tick [ns].
        by: i64,
    },
    /// A device got no valid command in time, so it has stopped by itself: the tick hung, the process was suspended, or
    /// its driver sent nothing.
    LostLease,
    /// A device does not follow commands, for this reason.
    Refused(String),
    /// A budget of a limiter is spent.
    Spent,
    /// A node has found that its task must not go on, for this reason.
    Found(String),
    /// The operator sent `stop`.
    Operator,
    /// A `fail` condition of a mode holds: its text.
    Mode(String),
}

/// A value that is older than its wire allows.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StaleWire {
    /// The source port.
    pub from: String,
    /// Age of the value [ns].
    pub age: i64,
    /// Maximum age [ns].
    pub max_age: i64,
}

/// A fault of a run: what went wrong, where and when.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Fault {
    /// Name of the node, the role, the device or the mode.
    pub node: String,
    /// Name of the port, if the fault is at a port.
    pub port: Option<String>,
    /// Number of the tick.
    pub tick: u64,
    /// Time of the tick in the graph's clock [ns].
    pub time: i64,
    /// The cause.
    pub cause: Cause,
    /// Source location of the node, device, wire or condition as `file:line:column`; empty if there is none.
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
                write!(f, "`{name}` is {:.1} ms old, but the maximum is {:.1} ms", ms(*age), ms(*max_age))?;
            }
            Cause::StaleWire(wire) => {
                let StaleWire { from, age, max_age } = &**wire;
                write!(f, "`{from}` is {:.1} ms old at `{name}`, but the maximum is {:.1} ms", ms(*age), ms(*max_age))?;
            }
            Cause::NeverSampled => write!(f, "`{name}` has had no sample since the start")?,
            Cause::SilentClock => write!(f, "the clock device `{name}` sends no samples")?,
            Cause::Late { by } => write!(f, "a tick began {:.1} ms late", ms(*by))?,
            Cause::LostLease => {
                write!(f, "device `{name}` got no valid command in time, so it stops by itself")?;
            }
            Cause::Refused(why) => write!(f, "device `{name}` does not follow commands: {why}")?,
            Cause::Spent => write!(f, "`{name}` has spent its budget of motion without a contact")?,
            Cause::Found(why) => write!(f, "`{name}` has found a fault: {why}")?,
            Cause::Operator => write!(f, "the operator sent `stop`")?,
            Cause::Mode(why) => write!(f, "a `fail` condition of mode `{name}` holds: {why}")?,
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
