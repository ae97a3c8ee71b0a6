//! The commands for recordings of whole runs: `replay`, `diff`, `export` and `recover`.

mod diff;
mod export;
mod recover;
mod replay;

use super::shell::command::{Subcommand, derived};
use super::text::table::table;
use crate::recording::PortDifference;

/// Returns the commands.
pub(super) fn commands() -> Vec<Subcommand> {
    vec![derived(replay::replay), derived(diff::diff), derived(export::export), derived(recover::recover)]
}

/// Lists the ports that differ, in the order of their first difference.
fn difference_table<'d>(ports: impl Iterator<Item = (&'d String, &'d PortDifference)>) -> String {
    let mut ports: Vec<_> = ports.collect();
    ports.sort_by_key(|(_, difference)| difference.order);
    let mut rows = vec![["port", "from tick", "at", "ticks", "first", "largest difference"].map(String::from)];
    for (port, difference) in ports {
        let seconds = |nanos: i64| format!("{:.3} s", nanos as f64 * 1e-9);
        let largest = difference.largest.as_ref().map_or_else(String::new, |(by, component, time)| {
            let of = if component == "value" { String::new() } else { format!(" in `{component}`") };
            format!("{by:.6e}{of} at {}", seconds(*time))
        });
        rows.push([
            port.clone(),
            difference.tick.to_string(),
            seconds(difference.time),
            difference.ticks.to_string(),
            first(difference),
            largest,
        ]);
    }
    table(&rows, 1, 3)
}

/// Describes the first difference of a port.
fn first(difference: &PortDifference) -> String {
    let [one, other] = &difference.values;
    match difference.component.as_str() {
        "value" => format!("{one}, then {other}"),
        component => format!("`{component}`: {one}, then {other}"),
    }
}
