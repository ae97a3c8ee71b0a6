//! The time at which a step runs.

use crate::signal::Stamp;

/// The time at which a step runs. Nodes use it instead of a clock.
#[derive(Debug, Clone, Copy)]
pub struct Tick {
    /// Number of the tick, from 1.
    pub index: u64,
    /// Time of the tick in the graph's clock [ns].
    pub now: i64,
    /// Time since the last tick [s]. A node that steps in every tick integrates with it.
    pub dt: f64,
    /// Oldest stamp among the node's triggers, and the stamp of its outputs.
    pub stamp: Stamp,
    /// Maximum time between two samples that counts as one step [s].
    pub max_gap: f64,
    /// Time of absence after which a state is reset [ns].
    pub reset_after: i64,
    /// Whether the runtime holds all commands at zero. A node that remembers its own motion brings it to rest.
    pub is_halted: bool,
    /// Whether the operator sent `resume` before this tick.
    pub is_resumed: bool,
    /// Whether the device did not get the command of this node in the last tick, although it is wired to it: the command
    /// was absent, a task that drives the device rests, so the runtime ramped to zero, or back to the command, or the
    /// device follows no command at all.
    pub is_overruled: bool,
}

impl Tick {
    /// Returns a first tick at time zero, for tests of a node.
    #[must_use]
    pub const fn first() -> Self {
        Self {
            index: 1,
            now: 0,
            dt: 0.0,
            stamp: Stamp::TIMELESS,
            max_gap: 0.1,
            reset_after: 20_000_000,
            is_halted: false,
            is_resumed: false,
            is_overruled: false,
        }
    }
}
