//! The time of a step.

use crate::signal::Stamp;

/// The time of a step. A node reads no clock.
#[derive(Debug, Clone, Copy)]
pub struct Tick {
    /// Number of the tick, from 1.
    pub index: u64,
    /// Time of the tick in the graph's clock [ns].
    pub now: i64,
    /// Time since the last tick [s]; what every-tick nodes integrate with.
    pub dt: f64,
    /// Oldest stamp among the node's triggers; its outputs carry it.
    pub stamp: Stamp,
    /// Greatest time between two samples that counts as one step [s].
    pub max_gap: f64,
    /// How long something must be absent before its state is reset [ns].
    pub reset_after: i64,
    /// Whether the runtime holds all commands at zero: what remembers its own motion comes to rest too.
    pub is_halted: bool,
}

impl Tick {
    /// A first tick at time zero, for tests of a node.
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
        }
    }
}
