//! Scripted faults of a pad.

use tactflow_runtime::node::Param;

use crate::devices::nanos;

/// A kind of fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
pub enum GlitchKind {
    /// The last frame is repeated with its old sequence number.
    Repeat,
    /// The last frame is repeated with new sequence numbers and stamps: a stuck sensor.
    Freeze,
    /// There is no frame.
    Silence,
    /// One tactel is not a number.
    Nan,
    /// The stamps go back in time.
    Back,
    /// The device fails, and does not recover.
    Unplug,
}

/// A fault that lasts for a while.
#[derive(Debug, Clone, Param)]
pub struct Glitch {
    /// Begin.
    #[param(unit = "s", range = 0.0..)]
    pub(crate) at_s: f64,
    /// Duration.
    #[param(unit = "s", above = 0.0)]
    pub(crate) for_s: f64,
    /// Kind of the fault.
    pub(crate) kind: GlitchKind,
}

impl Glitch {
    /// Returns the begin [ns].
    #[must_use]
    pub fn start(&self) -> i64 {
        nanos(self.at_s)
    }

    /// Returns the end [ns].
    #[must_use]
    pub fn end(&self) -> i64 {
        self.start().saturating_add(nanos(self.for_s))
    }

    /// Returns whether the fault is active at `time` [ns].
    #[must_use]
    pub fn holds_at(&self, time: i64) -> bool {
        (self.start()..self.end()).contains(&time)
    }
}
