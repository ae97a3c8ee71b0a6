//! What the nodes that log have to say: written after the tick, since a step neither formats nor writes.

use tracing::Level;

use super::summary::number;
use crate::engine::{Engine, Logged};
use crate::node::PortId;
use crate::record::{Column, Columns};
use crate::signal::{Flag, Freshness, Unit};

/// The target of these lines; the tool shows it without a switch.
pub(super) const TARGET: &str = "probe";

/// The nodes of a graph that log, and room to read their inputs into.
pub(super) struct Log {
    nodes: Vec<Entry>,
}

struct Entry {
    node: String,
    due: PortId,
    columns: Columns,
    row: Vec<f64>,
}

impl Log {
    pub(super) fn new(engine: &Engine) -> Self {
        let entry = |logged: &Logged| {
            let columns = Columns::new(&logged.inputs);
            let row = vec![0.0; columns.list.len()];
            Entry { node: logged.node.clone(), due: logged.due, columns, row }
        };
        Self { nodes: engine.logged().iter().map(entry).collect() }
    }

    /// Whether a node said so in the tick that the engine has just run, and somebody listens.
    pub(super) fn is_due(&self, engine: &Engine) -> bool {
        self.nodes.iter().any(|entry| entry.is_due(engine)) && tracing::enabled!(target: TARGET, Level::INFO)
    }

    /// Writes a line for each node that said so in the tick that the engine has just run.
    pub(super) fn write(&mut self, engine: &Engine) {
        let seconds = engine.now() as f64 * 1e-9;
        for entry in self.nodes.iter_mut().filter(|entry| entry.is_due(engine)) {
            entry.columns.read(engine.bus(), &mut entry.row);
            let values = line(&entry.columns.list, &entry.row);
            tracing::info!(target: TARGET, "at {seconds:.3} s: {}: {values}", entry.node);
        }
    }
}

impl Entry {
    fn is_due(&self, engine: &Engine) -> bool {
        let bus = engine.bus();
        let is_new = bus.mark(self.due).freshness(engine.ticks()) == Freshness::New;
        is_new && *bus.slot::<Flag>(self.due)
    }
}

/// Every value with its name and its unit.
fn line(columns: &[Column], row: &[f64]) -> String {
    let show = |(column, value): (&Column, &f64)| match value {
        value if value.is_nan() => format!("{} is absent", column.name),
        // A flag or a code has no decimals.
        value if column.unit == Unit::ONE && value.fract() == 0.0 => format!("{} = {value}", column.name),
        value if column.unit == Unit::ONE => format!("{} = {}", column.name, number(*value)),
        value => format!("{} = {} {}", column.name, number(*value), column.unit),
    };
    columns.iter().zip(row).map(show).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_has_names_values_and_units() {
        let column = |name: &str, unit: Unit| Column { name: name.into(), unit };
        let columns = [
            column("moments.force", Unit::NEWTON),
            column("moments.x", Unit::METRE),
            column("label.present", Unit::ONE),
            column("jacobian.twist.wz", Unit::RADIAN.per_second()),
        ];
        let expected =
            "moments.force = 1.500 N, moments.x is absent, label.present = 1, jacobian.twist.wz = -0.01000 rad/s";
        assert_eq!(line(&columns, &[1.5, f64::NAN, 1.0, -0.01]), expected);
    }
}
