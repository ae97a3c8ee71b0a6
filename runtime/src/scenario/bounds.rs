//! The figures of a check and of the run as a whole, with their bounds and the values from the paper.

use super::check_table::{CheckTable, FigureValues};
use super::document::ScenarioTable;
use super::figure::{Bound, Figure};
use super::judge::FigureRow;
use super::model::row;
use crate::node::Amount;

/// Returns the number of an amount in the unit of the check.
pub(super) fn number(amount: &Option<Amount>) -> Option<f64> {
    amount.as_ref().map(|amount| amount.number)
}

/// Returns the figures of a check with their bounds.
pub(super) fn figures(table: &CheckTable) -> Vec<(Figure, Bound)> {
    let median = |bound: &Option<Amount>| number(bound).map_or(Bound::None, Bound::Median);
    let std = (Figure::Std, median(&table.std_below));
    let mut figures = Vec::new();
    let extremes_and_ends = [&table.never_above, &table.never_below, &table.changes_by, &table.returns_within];
    let has_bound = extremes_and_ends.iter().any(|bound| bound.is_some());
    if table.settles_to.is_some() {
        let response = table.response_below_s.map_or(Bound::Settles, Bound::Median);
        figures.extend([(Figure::Response, response), (Figure::Error, median(&table.steady_state_error_below)), std]);
    } else if !has_bound || table.std_below.is_some() {
        figures.extend([(Figure::Mean, Bound::None), std]);
    }
    figures.extend(number(&table.never_above).map(|bound| (Figure::Max, Bound::AtMost(bound))));
    figures.extend(number(&table.never_below).map(|bound| (Figure::Min, Bound::AtLeast(bound))));
    let change = number(&table.changes_by).zip(number(&table.within));
    figures.extend(change.map(|(target, tolerance)| (Figure::Change, Bound::Near { target, tolerance })));
    figures.extend(number(&table.returns_within).map(|bound| (Figure::Return, Bound::AtMost(bound))));
    figures
}

/// Returns the figures with a value to compare them with.
pub(super) fn compared(values: &FigureValues) -> Vec<(Figure, f64)> {
    let values = [
        (Figure::Response, values.response_s),
        (Figure::Error, number(&values.error)),
        (Figure::Mean, number(&values.mean)),
        (Figure::Std, number(&values.std)),
        (Figure::Max, number(&values.max)),
        (Figure::Min, number(&values.min)),
    ];
    values.into_iter().filter_map(|(figure, value)| Some((figure, value?))).collect()
}

/// Returns the rows of the checks on the run as a whole.
pub(super) fn rows_of(table: &ScenarioTable) -> impl Iterator<Item = FigureRow> {
    let rows = [
        (&table.never_lost, "never_lost", Figure::Lost, Bound::AtMost(0.0)),
        (&table.stays_in, "stays_in", Figure::Away, Bound::AtMost(0.0)),
        (&table.ends_in, "ends_in", Figure::Ends, Bound::AtLeast(1.0)),
    ];
    let given = rows.into_iter().filter_map(|(word, key, figure, bound)| Some((word.as_ref()?, key, figure, bound)));
    given.map(|(word, key, figure, bound)| row(key, &word.value, figure, "1", bound))
}
