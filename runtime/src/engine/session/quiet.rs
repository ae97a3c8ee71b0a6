//! Whether a run is quiet: its tasks are halted, its arms rest, and nothing touches its sensors. New zeros and another
//! graph need that.

use std::fmt;

use super::engine::Engine;

/// Why a run is not quiet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Unquiet {
    /// A task is not halted. Its name, empty for the graph itself.
    Runs(String),
    /// An arm is not at rest. The name of its device.
    Moves(String),
    /// Something touches a sensor, or nothing can exclude it. The reason.
    Touched(String),
}

impl fmt::Display for Unquiet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Runs(task) if task.is_empty() => f.write_str("the task runs: send `stop` first"),
            Self::Runs(task) => write!(f, "`{task}` runs: send `{task}.stop` first"),
            Self::Moves(device) => write!(f, "`{device}` is not at rest yet"),
            Self::Touched(why) => f.write_str(why),
        }
    }
}

impl Engine {
    /// Checks that the run is quiet.
    ///
    /// # Errors
    /// Why it is not. A run without a node that keeps the zero of a sensor never is: nothing would notice a touch.
    pub fn check_quiet(&self) -> Result<(), Unquiet> {
        self.check_still()?;
        self.check_untouched().map(drop)
    }

    /// Checks that every task is halted, and every arm at rest.
    pub(super) fn check_still(&self) -> Result<(), Unquiet> {
        if let Some(task) = self.tasks.iter().find(|task| task.is_awaited() && !task.is_halted()) {
            return Err(Unquiet::Runs(task.name().to_owned()));
        }
        match self.devices.iter().find(|device| !device.rests()) {
            Some(device) => Err(Unquiet::Moves(device.name.clone())),
            None => Ok(()),
        }
    }

    /// Returns the nodes that keep the zeros of sensors, if nothing touches any of them.
    pub(super) fn check_untouched(&self) -> Result<Vec<usize>, Unquiet> {
        let answers = (0..self.names.len()).filter_map(|at| self.core.can_tare(at).map(|free| (at, free)));
        let free = |(at, free): (usize, Result<(), String>)| match free {
            Ok(()) => Ok(at),
            Err(why) => Err(Unquiet::Touched(format!("`{}`: {why}", self.names[at].0))),
        };
        let keepers = answers.map(free).collect::<Result<Vec<_>, _>>()?;
        if keepers.is_empty() {
            return Err(Unquiet::Touched("no node of the graph keeps the zero of a sensor".into()));
        }
        Ok(keepers)
    }
}
