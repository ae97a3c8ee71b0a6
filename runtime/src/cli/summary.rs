//! What came out of a run: its story, what the graph shows, and where asked for a line a port and a line a node.

use std::fmt::Write;

use super::course::Course;
use super::prose::Look;
use super::timeline::Timeline;
use super::view::View;
use crate::engine::{Counters, Engine, Outcome};
use crate::record::Columns;
use crate::signal::{Freshness, Shape};

/// Freshness of one port, counted over the ticks.
#[derive(Debug, Clone, Copy, Default)]
struct Counts {
    new: u64,
    held: u64,
    absent: u64,
}

/// What one column did.
#[derive(Debug, Clone)]
struct Figures {
    low: f64,
    high: f64,
    sum: f64,
    count: u64,
    course: Course,
}

impl Figures {
    fn new() -> Self {
        Self { low: f64::INFINITY, high: f64::NEG_INFINITY, sum: 0.0, count: 0, course: Course::new() }
    }

    fn add(&mut self, value: f64) {
        self.course.add(value);
        if !value.is_nan() {
            self.low = self.low.min(value);
            self.high = self.high.max(value);
            self.sum += value;
            self.count += 1;
        }
    }
}

/// Collects what came out of every tick.
pub(super) struct Summary {
    columns: Columns,
    row: Vec<f64>,
    counts: Vec<Counts>,
    figures: Vec<Figures>,
    timeline: Timeline,
    /// What the graph shows; none where the table of all ports takes its place.
    view: Option<View>,
}

impl Summary {
    /// A summary of what the graph shows, or of all ports.
    pub(super) fn new(engine: &Engine, is_of_ports: bool) -> Self {
        let ports = if is_of_ports { engine.ports() } else { &[] };
        let columns = Columns::new(ports);
        Self {
            view: (!is_of_ports).then(|| View::new(engine)),
            row: vec![0.0; columns.list.len()],
            counts: vec![Counts::default(); ports.len()],
            figures: vec![Figures::new(); columns.list.len()],
            columns,
            timeline: Timeline::new(engine),
        }
    }

    /// Takes in the tick that the engine has just run.
    pub(super) fn add(&mut self, engine: &Engine) {
        for ((_, id), counts) in engine.ports().iter().zip(&mut self.counts) {
            match engine.bus().mark(*id).freshness(engine.ticks()) {
                Freshness::New => counts.new += 1,
                Freshness::Held => counts.held += 1,
                Freshness::Lost | Freshness::Absent => counts.absent += 1,
            }
        }
        self.timeline.add(engine);
        self.view.iter_mut().for_each(|view| view.add(engine));
        self.columns.read(engine.bus(), &mut self.row);
        for (figures, value) in self.figures.iter_mut().zip(&self.row) {
            figures.add(*value);
        }
    }

    /// What is shown while it runs, part by part.
    pub(super) fn live(&self, page: Look) -> Vec<String> {
        self.view.as_ref().map(|view| view.live(page)).unwrap_or_default()
    }

    /// The story and what is shown, or the tables of ports and of nodes and the story; then what else there is to say.
    pub(super) fn render(&self, engine: &Engine, outcome: &Outcome, page: Look) -> String {
        let story = Timeline::story(engine, outcome.time);
        let parts = match &self.view {
            Some(view) => [story, view.page(page), self.timeline.limits(outcome.time)],
            None => [self.ports(engine), nodes(engine, outcome), story + &self.timeline.limits(outcome.time)],
        };
        let parts = parts.iter().map(|part| part.trim_end()).filter(|part| !part.is_empty());
        let mut text = parts.collect::<Vec<_>>().join("\n\n");
        if !text.is_empty() {
            text.push('\n');
        }
        for ((port, _), counters) in engine.ports().iter().zip(engine.counters()) {
            let counted = counted(counters);
            if !counted.is_empty() {
                // Writing to a string cannot fail.
                let _ = writeln!(text, "samples of `{}`: {counted}", port.name);
            }
        }
        for (device, counts) in engine.counts().filter(|(_, counts)| !counts.is_empty()) {
            let counts: Vec<String> = counts.iter().map(|(what, count)| format!("{count} {what}")).collect();
            let _ = writeln!(text, "device `{device}`: {}", counts.join(", "));
        }
        if outcome.late > 0 {
            let _ = writeln!(text, "{} ticks began more than a period late", outcome.late);
        }
        if self.view.is_some() {
            let _ = writeln!(text, "every port and the time of every node: --ports");
        }
        text
    }

    fn ports(&self, engine: &Engine) -> String {
        let mut rows =
            vec![["port", "unit", "new", "held", "absent", "min", "mean", "max", "over time"].map(String::from)];
        let mut columns = self.columns.list.iter().zip(&self.figures);
        for ((port, _), counts) in engine.ports().iter().zip(&self.counts) {
            let counted = [counts.new, counts.held, counts.absent].map(|count| count.to_string());
            let width = Columns::width(&port.shape);
            let mut counted = Some(counted);
            // A vector has a line of its own, even one of a single component.
            let is_scalar = matches!(port.shape, Shape::Scalar(_) | Shape::Flag(_));
            if !is_scalar {
                let unit = port.shape.unit().filter(|_| width == 0).map_or_else(String::new, |unit| unit.to_string());
                let [new, held, absent] = counted.take().unwrap_or_default();
                let name = port.name.clone();
                rows.push([name, unit, new, held, absent, String::new(), String::new(), String::new(), String::new()]);
            }
            for (column, figures) in columns.by_ref().take(width) {
                let [new, held, absent] = counted.take().unwrap_or_default();
                let part = column.name.strip_prefix(&port.name).filter(|part| !part.is_empty());
                let name = part.map_or_else(|| port.name.clone(), |part| format!("  {part}"));
                let [low, mean, high] = match figures.count {
                    0 => ["-"; 3].map(String::from),
                    count => [figures.low, figures.sum / count as f64, figures.high].map(number),
                };
                rows.push([name, column.unit.to_string(), new, held, absent, low, mean, high, figures.course.line()]);
            }
        }
        table(&rows, 2, 8)
    }
}

/// What came in and was not as it should be, in words.
fn counted(counters: &Counters) -> String {
    let counts = [
        (counters.repeated, "repeated"),
        (counters.gaps, "missing in the sequence"),
        (counters.late, "late by more than a period"),
        (counters.went_back, "dropped for going back"),
        (counters.ahead, "dropped for lying in the future"),
        (counters.not_finite, "dropped for not being finite"),
    ];
    let counts = counts.into_iter().filter(|(count, _)| *count > 0);
    counts.map(|(count, what)| format!("{count} {what}")).collect::<Vec<_>>().join(", ")
}

fn nodes(engine: &Engine, outcome: &Outcome) -> String {
    let timing = engine.timing();
    if timing.ticks == 0 {
        return String::new();
    }
    let mut rows = vec![["node", "mean", "longest"].map(String::from)];
    for (name, time) in engine.order().zip(&timing.nodes) {
        let mean = time.total.as_nanos() as u64 / timing.ticks;
        rows.push([name.to_owned(), format!("{mean} ns"), format!("{} ns", time.longest.as_nanos())]);
    }
    let mut text = table(&rows, 1, usize::MAX);
    let _ = writeln!(text, "timed in {} of {} ticks", timing.ticks, outcome.ticks);
    text
}

/// A number in few characters.
pub(super) fn number(value: f64) -> String {
    let size = value.abs();
    match size {
        0.0 => "0".into(),
        _ if !(1e-4..1e6).contains(&size) => format!("{value:.2e}"),
        _ if size < 1.0 => format!("{value:.5}"),
        _ if size < 100.0 => format!("{value:.3}"),
        _ => format!("{value:.1}"),
    }
}

/// Columns in line: those before `first_right` and from `first_left` on are flush left, those between flush right.
pub(super) fn table<const N: usize>(rows: &[[String; N]], first_right: usize, first_left: usize) -> String {
    let width = |i: usize| rows.iter().map(|row| row[i].chars().count()).max().unwrap_or(0);
    let widths: [usize; N] = std::array::from_fn(width);
    let mut text = String::new();
    for row in rows {
        let mut line = String::new();
        for (i, (cell, width)) in row.iter().zip(widths).enumerate() {
            let pad = " ".repeat(width - cell.chars().count());
            let is_right = (first_right..first_left).contains(&i);
            let cell = if is_right { format!("{pad}{cell}") } else { format!("{cell}{pad}") };
            line.push_str(&cell);
            line.push_str("  ");
        }
        text.push_str(line.trim_end());
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let cases = [(0.0, "0"), (0.0123456, "0.01235"), (12.3456, "12.346"), (1234.5, "1234.5"), (-1e-9, "-1.00e-9")];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }
}
