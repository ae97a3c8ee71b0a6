//! The tables of `run --ports`: all ports, and the time of all nodes.

use std::fmt::Write;

use crate::cli::text::number::number;
use crate::cli::text::series::Series;
use crate::cli::text::table::table;
use crate::engine::{Engine, Outcome};
use crate::record::PortColumns;
use crate::signal::{Freshness, Shape};

/// Collects the freshness and the values of all ports.
pub(crate) struct PortTable {
    columns: PortColumns,
    row: Vec<f64>,
    /// For each port, the number of ticks in which it is new, held and absent.
    counts: Vec<[u64; 3]>,
    /// The values of each column.
    series: Vec<Series>,
}

impl PortTable {
    pub(crate) fn new(engine: &Engine) -> Self {
        let columns = PortColumns::new(engine.ports());
        Self {
            row: vec![0.0; columns.list.len()],
            counts: vec![[0; 3]; engine.ports().len()],
            series: vec![Series::new(); columns.list.len()],
            columns,
        }
    }

    /// Adds the last tick of the engine.
    pub(crate) fn add(&mut self, engine: &Engine) {
        for ((_, id), counts) in engine.ports().iter().zip(&mut self.counts) {
            let column = match engine.bus().mark(*id).freshness(engine.ticks()) {
                Freshness::New => 0,
                Freshness::Held => 1,
                Freshness::Lost | Freshness::Absent => 2,
            };
            counts[column] += 1;
        }
        self.columns.read(engine.bus(), &mut self.row);
        for (series, value) in self.series.iter_mut().zip(&self.row) {
            series.add(*value);
        }
    }

    /// Writes the table of all ports.
    pub(crate) fn render(&self, engine: &Engine) -> String {
        let mut rows =
            vec![["port", "unit", "new", "held", "absent", "min", "mean", "max", "over time"].map(String::from)];
        let mut columns = self.columns.list.iter().zip(&self.series);
        for ((port, _), counts) in engine.ports().iter().zip(&self.counts) {
            let width = PortColumns::width(&port.shape);
            let first = rows.len();
            // A vector has a row of its own, even with a single component.
            let is_scalar = matches!(port.shape, Shape::Scalar(_) | Shape::Flag(_));
            if !is_scalar {
                let unit = port.shape.unit().filter(|_| width == 0).map_or_else(String::new, |unit| unit.to_string());
                let mut row: [String; 9] = Default::default();
                (row[0], row[1]) = (port.name.clone(), unit);
                rows.push(row);
            }
            for (column, series) in columns.by_ref().take(width) {
                let name = if column.part.is_empty() { port.name.clone() } else { format!("  {}", column.part) };
                let whole = series.tail(1.0);
                let [low, mean, high] = match whole.is_present() {
                    true => [whole.low, whole.mean, whole.high].map(number),
                    false => ["-"; 3].map(String::from),
                };
                let [new, held, absent] = Default::default();
                rows.push([name, column.unit.to_string(), new, held, absent, low, mean, high, series.sparkline()]);
            }
            // The counts stand in the first row of the port.
            rows[first][2..5].clone_from_slice(&counts.map(|count| count.to_string()));
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
