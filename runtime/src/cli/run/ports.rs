//! The tables of `run --ports`: all ports, and the time of all nodes.

use std::fmt::Write;

use crate::cli::text::number::number;
use crate::cli::text::series::Series;
use crate::cli::text::table::table;
use crate::engine::{Engine, Outcome};
use crate::record::Columns;
use crate::signal::{Freshness, Shape};

/// Freshness of one port, counted over the ticks.
#[derive(Debug, Clone, Copy, Default)]
struct FreshnessCounts {
    new: u64,
    held: u64,
    absent: u64,
}

/// Statistics of one column over the ticks.
#[derive(Debug, Clone)]
struct ColumnStats {
    low: f64,
    high: f64,
    sum: f64,
    count: u64,
    series: Series,
}

impl ColumnStats {
    fn new() -> Self {
        Self { low: f64::INFINITY, high: f64::NEG_INFINITY, sum: 0.0, count: 0, series: Series::new() }
    }

    fn add(&mut self, value: f64) {
        self.series.add(value);
        if !value.is_nan() {
            self.low = self.low.min(value);
            self.high = self.high.max(value);
            self.sum += value;
            self.count += 1;
        }
    }
}

/// Collects the freshness and the values of all ports.
pub(crate) struct PortTable {
    columns: Columns,
    row: Vec<f64>,
    counts: Vec<FreshnessCounts>,
    stats: Vec<ColumnStats>,
}

impl PortTable {
    pub(crate) fn new(engine: &Engine) -> Self {
        let columns = Columns::new(engine.ports());
        Self {
            row: vec![0.0; columns.list.len()],
            counts: vec![FreshnessCounts::default(); engine.ports().len()],
            stats: vec![ColumnStats::new(); columns.list.len()],
            columns,
        }
    }

    /// Adds the last tick of the engine.
    pub(crate) fn add(&mut self, engine: &Engine) {
        for ((_, id), counts) in engine.ports().iter().zip(&mut self.counts) {
            match engine.bus().mark(*id).freshness(engine.ticks()) {
                Freshness::New => counts.new += 1,
                Freshness::Held => counts.held += 1,
                Freshness::Lost | Freshness::Absent => counts.absent += 1,
            }
        }
        self.columns.read(engine.bus(), &mut self.row);
        for (stats, value) in self.stats.iter_mut().zip(&self.row) {
            stats.add(*value);
        }
    }

    /// Writes the table of all ports.
    pub(crate) fn render(&self, engine: &Engine) -> String {
        let mut rows =
            vec![["port", "unit", "new", "held", "absent", "min", "mean", "max", "over time"].map(String::from)];
        let mut columns = self.columns.list.iter().zip(&self.stats);
        for ((port, _), counts) in engine.ports().iter().zip(&self.counts) {
            let counted = [counts.new, counts.held, counts.absent].map(|count| count.to_string());
            let width = Columns::width(&port.shape);
            let mut counted = Some(counted);
            // A vector has a row of its own, even with a single component.
            let is_scalar = matches!(port.shape, Shape::Scalar(_) | Shape::Flag(_));
            if !is_scalar {
                let unit = port.shape.unit().filter(|_| width == 0).map_or_else(String::new, |unit| unit.to_string());
                let [new, held, absent] = counted.take().unwrap_or_default();
                let name = port.name.clone();
                rows.push([name, unit, new, held, absent, String::new(), String::new(), String::new(), String::new()]);
            }
            for (column, stats) in columns.by_ref().take(width) {
                let [new, held, absent] = counted.take().unwrap_or_default();
                let part = column.name.strip_prefix(&port.name).filter(|part| !part.is_empty());
                let name = part.map_or_else(|| port.name.clone(), |part| format!("  {part}"));
                let [low, mean, high] = match stats.count {
                    0 => ["-"; 3].map(String::from),
                    count => [stats.low, stats.sum / count as f64, stats.high].map(number),
                };
                let sparkline = stats.series.sparkline();
                rows.push([name, column.unit.to_string(), new, held, absent, low, mean, high, sparkline]);
            }
        }
        table(&rows, 2, 8)
    }
}

/// Writes the table of the time that each node takes.
pub(crate) fn node_times(engine: &Engine, outcome: &Outcome) -> String {
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
    // Writing to a string cannot fail.
    let _ = writeln!(text, "measured in {} of {} ticks", timing.ticks, outcome.ticks);
    text
}
