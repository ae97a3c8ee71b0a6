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
    /// A mode came to what it calls a failure.
    Mode(String),
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
            Cause::Mode(why) => write!(f, "mode `{name}` failed: {why}")?,
            Cause::Device(message) => write!(f, "device `{name}` failed: {message}")?,
        }
        write!(f, " in tick {} at {:.3} s ({})", self.tick, self.time as f64 * 1e-9, self.place)
    }
}

impl std::error::Error for Fault {}
