//! Recordings on the command line.

use std::path::Path;

use super::Shell;
use crate::recording::{Replay, ReplayChanges, ReplayError};

/// Whether a file is a recording of a whole run, by its name.
pub(crate) fn is_recording(path: &Path) -> bool {
    path.extension().is_some_and(|ending| ending == "mcap")
}

impl Shell {
    /// Opens a recording for its replay.
    ///
    /// # Errors
    /// Reports why it does not load, and returns the exit code.
    pub(crate) fn open_replay(&self, path: &Path, changes: &ReplayChanges) -> Result<Replay, u8> {
        Replay::open(self.catalogue(), path, changes).map_err(|error| match error {
            ReplayError::Message(message) => self.refuse(message),
            ReplayError::Graph(report) => self.reject(&report),
        })
    }
}
