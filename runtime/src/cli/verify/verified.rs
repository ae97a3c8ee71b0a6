//! A scenario and its results.

use std::path::PathBuf;

use crate::scenario::judge::{FigureRow, Verdict};
use crate::scenario::{NotChecked, Scenario, Trial};
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
    /// Returns the name of the file, and that of the bench if the file names several.
    pub(crate) fn name(&self) -> String {
        let name = self.path.file_stem().unwrap_or(self.path.as_os_str()).to_string_lossy();
        match self.loaded.as_ref().ok().and_then(|scenario| scenario.bench.as_ref()) {
            Some(bench) => format!("{name} on {bench}"),
            None => name.into_owned(),
        }
    }

    /// Returns why runs could not be measured, each with its run.
    pub(crate) fn failures(&self) -> impl Iterator<Item = (&str, &Trial)> {
        self.trials.iter().filter_map(|trial| Some((trial.failure.as_deref()?, trial)))
    }

    /// Returns the checks without a tick to check, each with the seed of the run.
    pub(crate) fn not_checked(&self) -> impl Iterator<Item = (&NotChecked, Option<u64>)> {
        self.trials.iter().flat_map(|trial| trial.not_checked.iter().map(|one| (one, trial.seed)))
    }

    /// Whether the scenario loads, no run failed and no check failed.
    pub(crate) fn has_passed(&self) -> bool {
        let is_complete = self.loaded.as_ref().is_ok_and(|scenario| scenario.runs().len() == self.trials.len());
        is_complete && self.failures().next().is_none() && self.rows.iter().all(|row| row.verdict() != Verdict::Failed)
    }
}
