//! Scripted faults of a pad.

use std::ops::Range;

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
    /// Start.
    #[param(unit = "s", range = 0.0..)]
    pub(crate) at_s: f64,
    /// Duration.
    #[param(unit = "s", above = 0.0)]
    pub(crate) for_s: f64,
    /// Kind of the fault.
    pub(crate) kind: GlitchKind,
}

impl Glitch {
    /// Returns the time of the fault [ns].
    #[must_use]
    pub fn time(&self) -> Range<i64> {
        let start = nanos(self.at_s);
        start..start.saturating_add(nanos(self.for_s))
    }
}
