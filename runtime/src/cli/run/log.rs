//! The log lines of nodes that log their inputs. They are written after the tick, since a step does no output.

use tracing::Level;

use crate::cli::text::number::{number, seconds};
use crate::engine::{Engine, Logged};
use crate::node::PortId;
use crate::record::{PortColumn, PortColumns};
use crate::signal::{Flag, Freshness, Unit};

/// Target of these lines, which the tool prints without `-v`.
pub(crate) const TARGET: &str = "log";

/// The nodes of a graph that log their inputs.
pub(crate) struct NodeLog {
    nodes: Vec<LoggedNode>,
}

struct LoggedNode {
    name: String,
    /// The flag that asks for a line.
    due: PortId,
    columns: PortColumns,
    row: Vec<f64>,
}

impl NodeLog {
    pub(crate) fn new(engine: &Engine) -> Self {
        let node = |logged: &Logged| {
            let columns = PortColumns::new(&logged.inputs);
            let row = vec![0.0; columns.list.len()];
            LoggedNode { name: logged.node.clone(), due: logged.due, columns, row }
        };
        Self { nodes: engine.logged().iter().map(node).collect() }
    }

    /// Whether any node asked for a line in the last tick of the engine, and lines are printed.
    pub(crate) fn is_due(&self, engine: &Engine) -> bool {
        self.nodes.iter().any(|node| node.is_due(engine)) && tracing::enabled!(target: TARGET, Level::INFO)
    }

    /// Writes a line for each node that asked for one in the last tick of the engine.
    pub(crate) fn write(&mut self, engine: &Engine) {
        let time = seconds(engine.now());
        for node in self.nodes.iter_mut().filter(|node| node.is_due(engine)) {
            node.columns.read(engine.bus(), &mut node.row);
            let values = line(&node.columns.list, &node.row);
            tracing::info!(target: TARGET, "at {time:.3} s: {}: {values}", node.name);
        }
    }
}

impl LoggedNode {
    fn is_due(&self, engine: &Engine) -> bool {
        let bus = engine.bus();
        let is_new = bus.mark(self.due).freshness(engine.ticks()) == Freshness::New;
        is_new && *bus.slot::<Flag>(self.due)
    }
}

/// Writes each value with its name and its unit.
fn line(columns: &[PortColumn], row: &[f64]) -> String {
    let show = |(column, value): (&PortColumn, &f64)| match value {
        value if value.is_nan() => format!("{} is absent", column.name),
        // Flags and codes have no decimals.
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
        let column = |name: &str, unit: Unit| PortColumn { name: name.into(), part: String::new(), unit };
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
