//! What a device that moves does when it gets no commands any more.

use std::fmt;

/// What a device that moves does when this process is silent: after a crash, a loss of power or a cut cable.
///
/// Only the device itself can stop the motion then. A graph with a live device that moves and does not declare this does
/// not load.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum OnSilence {
    /// It is at rest within the time, and its session is over.
    Stops,
    /// It is at rest within the time, and its session goes on.
    Holds,
    /// It goes on with the last command. A graph loads only if a watchdog, with this name, stops the motion within the
    /// time.
    KeepsMoving {
        /// What watches the device, for example a program on the robot.
        watchdog: Option<String>,
    },
}

/// What a device does on silence, and the time after which it is at rest.
#[derive(Debug, Clone, PartialEq)]
pub struct Silence {
    /// What it does.
    pub reaction: OnSilence,
    /// Time from the last command until it is at rest [s].
    pub within: f64,
}

impl fmt::Display for Silence {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let ms = self.within * 1e3;
        match &self.reaction {
            OnSilence::Stops => write!(f, "it stops within {ms} ms, and its session ends"),
            OnSilence::Holds => write!(f, "it stops within {ms} ms, and its session goes on"),
            OnSilence::KeepsMoving { watchdog: Some(watchdog) } => {
                write!(f, "`{watchdog}` stops it within {ms} ms")
            }
            OnSilence::KeepsMoving { watchdog: None } => f.write_str("it keeps moving"),
        }
    }
}
