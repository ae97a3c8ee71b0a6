//! Warns of times that are shorter than a period: they end before the next sample.

use std::ops::Range;

use crate::graph::bench::OpenedBench;
use crate::graph::load::{Entity, Task};
use crate::graph::net::{Net, WireOrigin};
use crate::graph::plan::PortRef;
use crate::node::shortest;
use crate::source::{Code, Diagnostic, Diagnostics};

/// Warns of each time outside the parameters of nodes that is shorter than a period.
///
/// `period` is that of the graph [s]. The age of a sample is compared with the period of its device.
pub(crate) fn check(net: &Net<'_>, opened: &OpenedBench, period: f64, diagnostics: &mut Diagnostics) {
    let flat = net.flat;
    let exits = flat.modes.iter().flat_map(|mode| &mode.exits);
    diagnostics.extend(exits.flat_map(|exit| {
        let times = [("for_ms", exit.table.for_ms), ("after_ms", exit.table.after_ms)];
        times.into_iter().filter_map(|(key, time)| short(key, time?, period, &exit.span))
    }));
    let root = flat.root();
    let reset = root.settings.iter().filter_map(|settings| settings.as_table()?.get("reset_after_ms"));
    let time = root.table.as_ref().map(|table| table.reset_after_ms);
    diagnostics.extend(reset.filter_map(|value| short("reset_after_ms", time?, period, &value.span)));
    let wires = net.wires.iter().flatten().map(|wire| (&wire.origin, wire.source));
    let wires = wires.chain(net.commands.iter().map(|wire| (&wire.origin, wire.source)));
    diagnostics.extend(wires.filter_map(|(origin, source)| short_age(net, opened, period, origin, source)));
    diagnostics.extend(flat.tasks.iter().flat_map(|task| short_policies(net, opened, task)));
}

/// Returns the warning about a wire whose maximum age is shorter than the periods of all devices that it descends from.
fn short_age(
    net: &Net<'_>,
    opened: &OpenedBench,
    period: f64,
    origin: &WireOrigin,
    source: PortRef,
) -> Option<Diagnostic> {
    let age = origin.age?.max_age as f64 * 1e-6;
    let period = opened.shortest_period(net.roles_of(source.producer)).unwrap_or(period);
    short("max_age_ms", age, period, &origin.word.span)
}

/// Returns the warnings about maximum ages in [policy], each compared with the device of its role.
fn short_policies(net: &Net<'_>, opened: &OpenedBench, task: &Task) -> Diagnostics {
    let Some((written, Some(policy))) = &task.policy else { return Diagnostics::new() };
    let Some(table) = written.as_table() else { return Diagnostics::new() };
    let names = &net.flat.scopes[task.scope].names;
    let roles = || {
        names.iter().filter_map(|(name, (_, entity))| match entity {
            Entity::Role(role) => Some((*role, name.as_str())),
            _ => None,
        })
    };
    let all = table.get("max_age_ms").and_then(|value| {
        let period = opened.shortest_period(roles().map(|(role, _)| role))?;
        short("max_age_ms", policy.max_age_ms?, period, &value.span)
    });
    let of_role = |(role, name): (usize, &str)| {
        let value = table.get("roles")?.as_table()?.get(name)?.as_table()?.get("max_age_ms")?;
        let period = opened.shortest_period(std::iter::once(role))?;
        short("max_age_ms", policy.roles.0.get(name)?.max_age_ms?, period, &value.span)
    };
    all.into_iter().chain(roles().filter_map(of_role)).collect()
}

/// Returns the warning about a `time` [ms] that is shorter than a `period` [s].
fn short(key: &str, time: f64, period: f64, span: &Range<usize>) -> Option<Diagnostic> {
    let shortest = shortest(time, period * 1e3)?;
    let message = format!("`{key}` is {time} ms, but a new sample comes every {shortest} ms");
    let help = format!("write `{key} = {shortest}` or more");
    Some(Diagnostic::new(Code::ShortTime, span.clone(), message).help(help))
}
