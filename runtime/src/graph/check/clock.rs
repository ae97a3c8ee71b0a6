//! Checks the clock of a graph, and that `max_gap_ms` is not shorter than its period.

use crate::graph::bench::OpenedBench;
use crate::graph::load::FlatGraph;
use crate::graph::net::{Net, Resolved, report};
use crate::graph::plan::Clock;
use crate::source::{Code, Diagnostic, Diagnostics, Edit};

/// Returns what triggers the ticks and the period [s], or reports why there is no clock.
pub(crate) fn check(net: &Net<'_>, opened: &OpenedBench, diagnostics: &mut Diagnostics) -> Option<(Clock, f64)> {
    let task = net.flat.root();
    let has_clock = task.table.as_ref().is_some_and(|table| table.clock.is_some() || table.rate_hz.is_some());
    if !has_clock && task.has_wrong_setting(diagnostics) {
        return None;
    }
    let (clock, period) = report(find_clock(net, opened), diagnostics)?;
    diagnostics.extend(short_gap(net.flat, period));
    Some((clock, period))
}

fn find_clock(net: &Net<'_>, opened: &OpenedBench) -> Resolved<(Clock, f64)> {
    let flat = net.flat;
    // An invalid section [graph] has its own diagnostic.
    let (table, place) = (flat.root().table.as_ref().ok_or(None)?, &flat.root().place);
    let (message, span, help) = match (&table.clock, table.rate_hz) {
        (None, Some(rate)) => return Ok((Clock::Rate, 1.0 / rate)),
        (Some(word), None) => {
            let Some(role) = flat.roles.position(&word.value) else {
                let message = format!("the clock `{}` is not a role", word.value);
                let diagnostic = Diagnostic::new(Code::BadClock, word.span.clone(), message);
                return diagnostic.suggest(&word.value, flat.roles.names(), "roles").into_err();
            };
            let bound = opened.roles.get(role).and_then(Option::as_ref).ok_or(None)?;
            return Ok((Clock::Device(bound.device), opened.period(bound)));
        }
        (Some(word), Some(_)) => ("the graph has two clocks", &word.span, "keep `clock` or `rate_hz`"),
        (None, None) => {
            // The first sensor, or a rate.
            let is_sensor = |role: &usize| net.roles[*role].is_some_and(|role| role.commands.is_empty());
            let sensor = (0..flat.roles.len()).find(is_sensor).map(|role| &flat.roles[role].0.name);
            let line = sensor.map_or_else(|| "rate_hz = 250".to_owned(), |role| format!("clock = \"{role}\""));
            let diagnostic = Diagnostic::new(Code::BadClock, place.clone(), "the graph has no clock");
            let diagnostic = diagnostic.help(format!("add `{line}` under [graph]"));
            return diagnostic.edit(Edit::Below(place.clone(), line)).into_err();
        }
    };
    Diagnostic::new(Code::BadClock, span.clone(), message).help(help).into_err()
}

fn short_gap(flat: &FlatGraph, period: f64) -> Option<Diagnostic> {
    let gap = flat.root().table.as_ref()?.max_gap_ms?;
    let span = flat.root().settings.as_ref()?.as_table()?.get("max_gap_ms")?.span.clone();
    // The period of a device is rounded to nanoseconds, so it may be slightly longer than the same number here.
    let is_short = gap * 1e-3 < period * (1.0 - 1e-6);
    let message = format!("`max_gap_ms` is {gap} ms, but the period of the graph is {:.3} ms", period * 1e3);
    is_short.then(|| {
        Diagnostic::new(Code::BadValue, span, message).help(
            "write at least one period, or remove `max_gap_ms` (the default is five periods of the slowest device)",
        )
    })
}
