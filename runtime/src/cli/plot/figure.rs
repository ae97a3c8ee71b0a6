//! The figure: a panel for each unit, over one axis of time.

use crate::cli::text::figure::{FigureBand, LINE, bands, curve, legend, legend_rows, range};
use crate::cli::text::svg::{PlotAxis, Svg};
use crate::record::{RunColumn, RunRows};

/// Width of the figure [px].
const WIDTH: f64 = 760.0;
/// Left and right end of the curves [px].
const ACROSS: [f64; 2] = [84.0, 740.0];
/// Height of a panel [px].
const PANEL_HEIGHT: f64 = 204.0;
/// Space between two panels, and below the last one [px].
const GAPS: [f64; 2] = [14.0, 56.0];

/// Draws columns within a span of time [s].
pub(super) fn draw(title: &str, rows: &RunRows, columns: &[&RunColumn], [from, to]: [f64; 2]) -> String {
    let is_shown = |time: &f64| (from..=to).contains(time);
    let shown: Vec<usize> = (0..rows.times.len()).filter(|i| is_shown(&rows.times[*i])).collect();
    let ends = [shown.first(), shown.last()].map(|i| i.map_or(0.0, |i| rows.times[*i]));
    let time = PlotAxis::linear(ends[0], if ends[1] > ends[0] { ends[1] } else { ends[0] + 1.0 }, ACROSS);
    let panels = panels(columns);
    let names = |panel: &Vec<usize>| -> Vec<(usize, &str)> {
        panel.iter().enumerate().map(|(number, i)| (number, columns[*i].name.as_str())).collect()
    };
    let modes = modes(rows, &shown);
    let has_modes = if modes.is_empty() { 0.0 } else { LINE };
    let rows_of = |panel: &Vec<usize>| LINE * legend_rows(&names(panel), ACROSS) as f64;
    let heights: f64 = panels.iter().map(|panel| rows_of(panel) + has_modes + PANEL_HEIGHT + GAPS[0]).sum();
    let mut svg = Svg::new([WIDTH, 8.0 + heights + GAPS[1] - GAPS[0]], title);
    let mut bottom = 8.0 - GAPS[0];
    for (k, panel) in panels.iter().enumerate() {
        let names = names(panel);
        let head = bottom + GAPS[0];
        let top = head + LINE * legend(&mut svg, &names, ACROSS, head) as f64 + has_modes;
        bottom = top + PANEL_HEIGHT;
        bands(&mut svg, &modes, time, [top, bottom]);
        let values = panel.iter().flat_map(|i| shown.iter().map(|row| columns[*i].values[*row]));
        let unit = &columns[panel[0]].unit;
        let is_last = (k + 1 == panels.len()).then_some("time [s]");
        let Some([low, high]) = range(values) else {
            svg.axes(time, PlotAxis::linear(0.0, 1.0, [bottom, top]), [is_last, Some(&format!("[{unit}]"))]);
            svg.text([0.5 * (ACROSS[0] + ACROSS[1]), 0.5 * (top + bottom)], "middle", "absent in this time");
            continue;
        };
        let y = PlotAxis::linear(low, high, [bottom, top]);
        svg.axes(time, y, [is_last, Some(&format!("[{unit}]"))]);
        for (number, i) in panel.iter().enumerate() {
            let points: Vec<[f64; 2]> = shown.iter().map(|row| [rows.times[*row], columns[*i].values[*row]]).collect();
            curve(&mut svg, number, &points, [time, y]);
        }
    }
    svg.finish()
}

/// Groups the columns by their units, each with its number among all columns.
fn panels(columns: &[&RunColumn]) -> Vec<Vec<usize>> {
    let mut panels: Vec<Vec<usize>> = Vec::new();
    for (i, column) in columns.iter().enumerate() {
        match panels.iter_mut().find(|panel| columns[panel[0]].unit == column.unit) {
            Some(panel) => panel.push(i),
            None => panels.push(vec![i]),
        }
    }
    panels
}

/// Returns the modes of the graph over the shown rows. The column of a row has the mode of the next tick.
fn modes(rows: &RunRows, shown: &[usize]) -> Vec<FigureBand> {
    let of_graph = rows.modes.iter().find(|(task, _)| task.is_empty());
    let (Some((_, names)), Some(column)) = (of_graph, rows.column("mode")) else { return Vec::new() };
    let mut found: Vec<(f64, FigureBand)> = Vec::new();
    for row in shown {
        let (time, mode) = (rows.times[*row], column.values[*row]);
        if let Some((last, band)) = found.last_mut() {
            band.span[1] = time;
            if *last == mode {
                continue;
            }
        }
        let name = names.get(mode as usize).filter(|_| mode.is_finite()).cloned().unwrap_or_default();
        found.push((mode, FigureBand { span: [time, time], name }));
    }
    found.into_iter().map(|(_, band)| band).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn modes_are_spans_and_units_are_panels() {
        let column = |name: &str, unit: &str, values: &[f64]| RunColumn {
            name: name.into(),
            unit: unit.into(),
            values: values.to_vec(),
        };
        let rows = RunRows {
            times: vec![0.0, 1.0, 2.0, 3.0],
            columns: vec![
                column("mode", "1", &[0.0, 0.0, 1.0, 1.0]),
                column("a", "m", &[1.0; 4]),
                column("b", "N", &[1.0; 4]),
                column("c", "m", &[1.0; 4]),
            ],
            modes: vec![(String::new(), vec!["approach".into(), "servo".into()])],
        };
        let spans: Vec<([f64; 2], String)> =
            modes(&rows, &[0, 1, 2, 3]).into_iter().map(|band| (band.span, band.name)).collect();
        assert_eq!(spans, [([0.0, 2.0], "approach".to_owned()), ([2.0, 3.0], "servo".to_owned())]);
        let drawn: Vec<&RunColumn> = rows.columns.iter().skip(1).collect();
        assert_eq!(panels(&drawn), [vec![0, 2], vec![1]]);
    }
}
