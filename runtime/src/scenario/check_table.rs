//! The section [check.NAME] of a scenario file, and the mistakes in it that show without the task.

use std::ops::Range;

use crate::node::{Amount, Map, Param, Spanned};
use crate::source::{Code, Diagnostic, Key, Value};

/// Default length of the steady state at the end of a run [s].
const DEFAULT_STEADY_S: f64 = 10.0;

/// One check of a scenario.
#[derive(Debug, Clone, Param)]
pub(crate) struct CheckTable {
    /// Port or component to check, by its name in a recording or in the task's wires.
    pub(crate) of: Spanned<String>,
    /// Port or component to subtract from it, for example the true value from the measured one.
    pub(crate) minus: Option<Spanned<String>>,
    /// Mode of the task to which the check is restricted.
    pub(crate) during: Option<Spanned<String>>,
    /// Mode or flag that ends the check: when the mode is entered or the flag becomes true, after time 0.
    pub(crate) until: Option<Spanned<String>>,
    /// Value that it must settle to.
    #[param(unit = "$unit")]
    pub(crate) settles_to: Option<Amount>,
    /// Half width of the band around `settles_to` or `changes_by`.
    #[param(unit = "$unit", above = 0.0)]
    pub(crate) within: Option<Amount>,
    /// Change from the first value to the last.
    #[param(unit = "$unit")]
    pub(crate) changes_by: Option<Amount>,
    /// Maximum distance between the first value and the last.
    #[param(unit = "$unit", above = 0.0)]
    pub(crate) returns_within: Option<Amount>,
    /// Maximum response time.
    #[param(unit = "s", above = 0.0)]
    pub(crate) response_below_s: Option<f64>,
    /// Maximum steady-state error.
    #[param(unit = "$unit", above = 0.0)]
    pub(crate) steady_state_error_below: Option<Amount>,
    /// Length of the steady state at the end of the run; 10 by default.
    #[param(unit = "s", above = 0.0)]
    pub(crate) steady_s: Option<f64>,
    /// Maximum standard deviation.
    #[param(unit = "$unit", above = 0.0)]
    pub(crate) std_below: Option<Amount>,
    /// Value that it must never exceed.
    #[param(unit = "$unit")]
    pub(crate) never_above: Option<Amount>,
    /// Value that it must never fall below.
    #[param(unit = "$unit")]
    pub(crate) never_below: Option<Amount>,
    /// Time from which it is checked, after time 0 or after each entry into the mode of `during`. The response and the
    /// steady state have their own times.
    #[param(unit = "s", range = 0.0..)]
    pub(crate) after_s: Option<f64>,
    /// Unit of all numbers of the check: its name, and its size in the unit of the port.
    #[param(unit = "1", above = 0.0)]
    pub(crate) unit: Option<Map<f64>>,
    /// Values from the paper to print beside the figures.
    #[param(unit = "$unit")]
    pub(crate) paper: Option<FigureValues>,
    /// Values that the task should reach. What it does not reach is printed, and is no failure.
    #[param(unit = "$unit")]
    pub(crate) goal: Option<FigureValues>,
    /// Why the task does not reach its goal.
    pub(crate) missed: Option<Spanned<String>>,
}

/// Values to compare figures with.
#[derive(Debug, Clone, Param)]
pub(crate) struct FigureValues {
    /// Response time.
    #[param(unit = "s")]
    pub(crate) response_s: Option<f64>,
    /// Steady-state error.
    #[param(unit = "$unit")]
    pub(crate) error: Option<Amount>,
    /// Mean.
    #[param(unit = "$unit")]
    pub(crate) mean: Option<Amount>,
    /// Standard deviation.
    #[param(unit = "$unit")]
    pub(crate) std: Option<Amount>,
    /// Maximum.
    #[param(unit = "$unit")]
    pub(crate) max: Option<Amount>,
    /// Minimum.
    #[param(unit = "$unit")]
    pub(crate) min: Option<Amount>,
}

impl CheckTable {
    /// Returns the length of the steady state [s].
    pub(super) fn steady(&self) -> f64 {
        self.steady_s.unwrap_or(DEFAULT_STEADY_S)
    }

    /// Returns the numbers in the unit of the check.
    pub(super) fn amounts_mut(&mut self) -> impl Iterator<Item = &mut Amount> {
        let bounds = [
            &mut self.settles_to,
            &mut self.within,
            &mut self.changes_by,
            &mut self.returns_within,
            &mut self.steady_state_error_below,
            &mut self.std_below,
            &mut self.never_above,
            &mut self.never_below,
        ];
        let compared = [&mut self.paper, &mut self.goal].into_iter().flatten();
        let compared =
            compared.flat_map(|FigureValues { error, mean, std, max, min, .. }| [error, mean, std, max, min]);
        bounds.into_iter().chain(compared).flatten()
    }
}

/// A section [check.NAME].
pub(super) struct CheckBlock {
    pub(super) key: Key,
    pub(super) value: Value,
    /// The keys of the section, or `None` if a mistake in them has been reported.
    pub(super) table: Option<CheckTable>,
}

impl CheckBlock {
    /// Returns the span of a key of the check, or of the check's name if the key is missing.
    pub(super) fn span(&self, key: &str) -> Range<usize> {
        let entry = self.value.as_table().and_then(|table| table.entry(key));
        entry.map_or(self.value.span.clone(), |(key, _)| key.span.clone())
    }

    /// Returns a diagnostic for each key that contradicts the others or needs another one.
    pub(super) fn mistakes(&self, for_s: Option<f64>) -> Vec<Diagnostic> {
        let Some(table) = &self.table else { return Vec::new() };
        let mut found = Vec::new();
        let mut wrong = |code: Code, key: &str, message: String, help: &str| {
            found.push(Diagnostic::new(code, self.span(key), message).help(help));
        };
        self.targets(table, &mut wrong);
        if table.missed.is_some() && table.goal.is_none() {
            let help = "add `goal`, such as `goal = { response_s = 0.7 }`";
            wrong(Code::MissingKey, "missed", "`missed` needs `goal`".into(), help);
        }
        if let (Some(after), Some(for_s)) = (table.after_s, for_s)
            && after >= for_s
        {
            let message = format!("the run ends after {for_s} s, so there is nothing to check after {} s", after);
            wrong(Code::BadValue, "after_s", message, "write an earlier time, or a larger `for_s`");
        }
        if table.unit.as_ref().is_some_and(|unit| unit.0.len() != 1) {
            let message = "`unit` must have exactly one entry".into();
            wrong(
                Code::BadValue,
                "unit",
                message,
                "write one name and its size in the unit of the port, as in `unit = { tactel = 0.005 }`",
            );
        }
        found
    }

    /// Reports the keys that set what a value must reach, and lack or contradict another key.
    fn targets(&self, table: &CheckTable, wrong: &mut dyn FnMut(Code, &str, String, &str)) {
        let (target, change, within) = (&table.settles_to, &table.changes_by, &table.within);
        let is_given = |key: &&str| self.value.as_table().is_some_and(|table| table.get(key).is_some());
        if within.is_some() && target.is_none() && change.is_none() {
            let help = "add `settles_to`, the value that the port must reach, or `changes_by`, its change";
            wrong(Code::MissingKey, "within", "`within` needs `settles_to` or `changes_by`".into(), help);
        }
        let needs_target = ["response_below_s", "steady_state_error_below", "steady_s"];
        for key in needs_target.into_iter().filter(|key| target.is_none() && is_given(key)) {
            let help = "add `settles_to`: the value that the port must reach";
            wrong(Code::MissingKey, key, format!("`{key}` needs `settles_to`"), help);
        }
        let needs_within = [
            ("settles_to", target.is_some(), "add `within`: the largest error that counts as settled"),
            ("changes_by", change.is_some() && target.is_none(), "add `within`: the largest error of the change"),
        ];
        for (key, _, help) in needs_within.into_iter().filter(|(_, needs, _)| *needs && within.is_none()) {
            wrong(Code::MissingKey, key, format!("`{key}` needs `within`"), help);
        }
        let help = "write a second check with a name of its own";
        if target.is_some() && change.is_some() {
            let message = "`within` cannot belong to both `settles_to` and `changes_by`".into();
            wrong(Code::BadValue, "changes_by", message, help);
        }
        if change.is_some() && table.returns_within.is_some() {
            let message = "a check has either `changes_by` or `returns_within`".into();
            wrong(Code::BadValue, "returns_within", message, help);
        }
    }
}
