//! A scenario and its results.

use std::path::PathBuf;

use crate::scenario::judge::{FigureRow, Verdict};
use crate::scenario::{Scenario, Trial};
use crate::source::Report;

/// A scenario and its results.
pub(crate) struct Verified {
    pub(crate) path: PathBuf,
    pub(crate) loaded: Result<Scenario, Report>,
    /// The completed runs, in the order of the seeds.
    pub(crate) trials: Vec<Trial>,
    pub(crate) rows: Vec<FigureRow>,
}

impl Verified {
    pub(crate) fn name(&self) -> String {
        self.path.file_stem().unwrap_or(self.path.as_os_str()).to_string_lossy().into_owned()
    }

    /// Whether the scenario loads, no run failed and no check failed.
    pub(crate) fn has_passed(&self) -> bool {
        let is_complete = self.loaded.as_ref().is_ok_and(|scenario| scenario.runs().len() == self.trials.len());
        let has_failed = self.trials.iter().any(|trial| trial.failure.is_some());
        is_complete && !has_failed && self.rows.iter().all(|row| row.verdict() != Verdict::Failed)
    }
}
