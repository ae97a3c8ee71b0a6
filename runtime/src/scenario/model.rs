//! A scenario that is checked: its runs, what is looked at, and the rows of its table.

use std::path::PathBuf;

use super::judge::{self, Bound, Row};
use crate::graph::Request;

/// A scenario that is checked, with its task and its bench: every port it speaks of is there.
#[derive(Debug, Clone)]
pub struct Scenario {
    /// The file.
    pub path: PathBuf,
    /// Length of a run [s].
    pub for_s: f64,
    /// The seeds; none in a scenario without any, which runs once.
    pub seeds: Vec<u64>,
    /// What devices state and shall be printed beside the figures.
    pub facts: Vec<(String, toml::Value)>,
    pub(super) request: Request,
    /// `devices.NAME.seed` of each device that has a seed.
    pub(super) seed_keys: Vec<String>,
    /// Name of the flag that says when time 0 is, as it is written, and its column.
    pub(super) from: Option<(String, String)>,
    /// Column of the flag that is never lost.
    pub(super) never_lost: Option<String>,
    pub(super) stays_in: Option<String>,
    pub(super) ends_in: Option<String>,
    pub(super) checks: Vec<Check>,
    /// Every figure, without values: those of the checks, then those of the scenario as a whole.
    pub(super) rows: Vec<Row>,
}

/// What is looked at, and how.
#[derive(Debug, Clone)]
pub(super) struct Check {
    pub(super) column: String,
    /// The number that is taken off.
    pub(super) minus: Option<String>,
    /// Half a turn, if it is the direction of a line [unit of the check].
    pub(super) period: Option<f64>,
    /// How much its unit is in the port's.
    pub(super) unit: f64,
    /// What it settles to, and how near.
    pub(super) settles: Option<(f64, f64)>,
    pub(super) after: Option<f64>,
    pub(super) steady: f64,
    /// Its figures, in the order of the rows.
    pub(super) figures: Vec<judge::Figure>,
}

impl Scenario {
    /// Whether a text is a scenario: it has a section [scenario].
    #[must_use]
    pub fn is_one(text: &str) -> bool {
        text.lines().any(|line| line.trim() == "[scenario]" || line.trim_start().starts_with("scenario."))
    }

    /// Its name: that of its file.
    #[must_use]
    pub fn name(&self) -> String {
        self.path.file_stem().unwrap_or(self.path.as_os_str()).to_string_lossy().into_owned()
    }

    /// The same with other seeds, from 1 to `count`; one without seeds stays as it is.
    #[must_use]
    pub fn with_seeds(mut self, count: u64) -> Self {
        if !self.seeds.is_empty() {
            self.seeds = (1..=count).collect();
        }
        self
    }

    /// The seed of each run.
    #[must_use]
    pub fn runs(&self) -> Vec<Option<u64>> {
        if self.seeds.is_empty() { vec![None] } else { self.seeds.iter().copied().map(Some).collect() }
    }
}

/// A row without values.
pub(super) fn row(check: &str, of: &str, figure: judge::Figure, unit: &str, bound: Bound, paper: Option<f64>) -> Row {
    let unit = if figure.is_time() { "s" } else { unit };
    Row { check: check.into(), of: of.into(), figure, unit: unit.into(), bound, paper, values: Vec::new() }
}
