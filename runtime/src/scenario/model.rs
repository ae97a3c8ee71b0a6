//! A checked scenario: its runs, its checks and the rows of its table.

use super::figure::{Bound, Figure};
use super::inject::Injection;
use super::judge::FigureRow;
use super::vary::Vary;
use super::window::{ModeName, Window};
use crate::graph::Request;
use crate::source::Report;

/// A scenario that has been checked with its task and its bench: every port it names exists.
#[derive(Debug, Clone)]
pub struct Scenario {
    /// Duration of a run [s].
    pub for_s: f64,
    /// The seeds. A scenario without seeds runs once.
    pub seeds: Vec<u64>,
    /// Facts and parameters of devices to print beside the figures.
    pub facts: Vec<(String, toml::Value)>,
    /// Name of the bench, if the file names several.
    pub bench: Option<String>,
    pub(super) request: Request,
    /// The faults that every run injects.
    pub(super) injections: Vec<Injection>,
    /// The parameters that differ between the runs.
    pub vary: Vary,
    /// `devices.NAME.seed` of each device that has a seed.
    pub(super) seed_keys: Vec<String>,
    /// The flag that defines time 0: its name in the file, and its column.
    pub(super) from: Option<(String, String)>,
    /// Column of the flag that must never be lost.
    pub(super) never_lost: Option<String>,
    pub(super) stays_in: Option<ModeName>,
    pub(super) ends_in: Option<(String, Option<ModeName>)>,
    pub(super) checks: Vec<Check>,
    /// The rows of all figures, without values: those of the checks, then those of the run as a whole.
    pub(super) rows: Vec<FigureRow>,
    pub(super) warnings: Option<Report>,
}

/// A check on one value.
#[derive(Debug, Clone)]
pub(super) struct Check {
    /// Name of the section.
    pub(super) name: String,
    pub(super) column: String,
    /// The column to subtract.
    pub(super) minus: Option<String>,
    /// Half a turn, if the value is the direction of a line [unit of the check].
    pub(super) period: Option<f64>,
    /// Size of the check's unit in the unit of the port.
    pub(super) unit: f64,
    /// The target, and the half width of the band around it [unit of the check].
    pub(super) settles: Option<(f64, f64)>,
    /// The expected change, if there is one [unit of the check].
    pub(super) changes: Option<f64>,
    /// Time from which the value is checked, after time 0 or after each entry into the mode of the window [s].
    pub(super) after: Option<f64>,
    /// Length of the steady state at the end of the run [s].
    pub(super) steady: f64,
    /// The ticks that the figures use.
    pub(super) window: Window,
    /// The figures, in the order of the rows.
    pub(super) figures: Vec<Figure>,
}

impl Scenario {
    /// Whether a text is a scenario file: it has a section [scenario].
    #[must_use]
    pub fn is_one(text: &str) -> bool {
        text.lines().any(|line| line.trim() == "[scenario]" || line.trim_start().starts_with("scenario."))
    }

    /// Returns the warnings of its task on its bench. A node is used if a check reads it.
    #[must_use]
    pub const fn warnings(&self) -> Option<&Report> {
        self.warnings.as_ref()
    }

    /// Replaces the seeds by 1 to `count`. A scenario without seeds does not change.
    pub fn set_seeds(&mut self, count: u64) {
        if !self.seeds.is_empty() {
            self.seeds = (1..=count).collect();
        }
    }

    /// Returns the seed of each run.
    #[must_use]
    pub fn runs(&self) -> Vec<Option<u64>> {
        if self.seeds.is_empty() { vec![None] } else { self.seeds.iter().copied().map(Some).collect() }
    }
}

/// Creates a row without values.
pub(super) fn row(check: &str, of: &str, figure: Figure, unit: &str, bound: Bound) -> FigureRow {
    let unit = if figure.is_time() { "s" } else { unit };
    FigureRow {
        check: check.into(),
        of: of.into(),
        during: None,
        until: None,
        figure,
        unit: unit.into(),
        bound,
        paper: None,
        goal: None,
        missed: None,
        values: Vec::new(),
        not_checked: 0,
    }
}
