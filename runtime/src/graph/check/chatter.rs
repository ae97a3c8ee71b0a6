//! Warns of two modes that lead to each other again and again, because the same value ends both.

use super::contact::ContactPorts;
use super::immediate::{immediate, stays};
use crate::graph::net::Net;
use crate::graph::plan::{Condition, PlannedExit, PlannedMode, Test, WatchedPort};
use crate::graph::syntax::{ExitKind, PortState};
use crate::source::{Code, Diagnostic, Diagnostics};

/// Two modes that switch to and fro in less than this chatter [ns].
const SLOW: i64 = 250_000_000;
/// Part of a bound that is left as a gap to another bound, in the help [1].
const GAP: f64 = 0.2;

/// Warns of each pair of modes that lead to each other, where a value that does not change, or one that is at the bound,
/// ends both.
///
/// A mode that ends as soon as it begins has its own warning. `period` is that of the graph [s].
pub(crate) fn check(
    net: &Net<'_>,
    contact: &ContactPorts,
    modes: &[PlannedMode],
    period: f64,
    diagnostics: &mut Diagnostics,
) {
    let period = (period * 1e9) as i64;
    for (from, mode) in modes.iter().enumerate() {
        for there in &mode.exits {
            let Some(to) = there.to.filter(|to| *to > from) else { continue };
            let chatters = |back: &&PlannedExit| {
                let is_apart = |port: WatchedPort| !stays(net, from, to, port.source);
                let reported = immediate(there, back, period).is_some() || immediate(back, there, period).is_some();
                let slow = match cause(there, back) {
                    Some(Cause::Bounds(port)) if !is_apart(port) => SLOW,
                    Some(Cause::Contact(port)) if contact.need(net, port.source) && !is_apart(port) => 2 * period,
                    Some(Cause::Time) => SLOW,
                    _ => return false,
                };
                back.to == Some(from) && !reported && lasts(there) + lasts(back) < slow
            };
            if let Some(back) = modes[to].exits.iter().find(chatters) {
                diagnostics.push(report((mode, there), (&modes[to], back)));
                break;
            }
        }
    }
}

/// Why two modes chatter.
enum Cause {
    /// The bounds on a number overlap or meet.
    Bounds(WatchedPort),
    /// The contact comes and goes.
    Contact(WatchedPort),
    /// Both modes end by themselves.
    Time,
}

/// Returns why two exits can follow each other at once: there is a value that fulfils both, or that noise lets fulfil both.
fn cause(there: &PlannedExit, back: &PlannedExit) -> Option<Cause> {
    use PortState::{Absent, False, Present, True};
    let (one, other) = match (&there.condition, &back.condition) {
        (Condition::Elapsed(_), Condition::Elapsed(_)) => return Some(Cause::Time),
        (Condition::Port(one, test), Condition::Lost(other, _))
        | (Condition::Lost(other, _), Condition::Port(one, test)) => {
            let is_found = matches!(test, Test::Is(True | Present));
            return (one == other && is_found).then_some(Cause::Contact(*one));
        }
        (Condition::Port(one, test), Condition::Port(port, other)) if one == port => ((*one, *test), *other),
        _ => return None,
    };
    let (port, one) = one;
    match (one, other) {
        (Test::Between { min, max, .. }, Test::Between { min: low, max: high, .. }) => {
            (min.max(low) <= max.min(high)).then_some(Cause::Bounds(port))
        }
        (Test::Is(True | Present), Test::Is(False | Absent)) | (Test::Is(False | Absent), Test::Is(True | Present)) => {
            Some(Cause::Contact(port))
        }
        _ => None,
    }
}

/// Returns the shortest time until an exit is taken [ns].
const fn lasts(exit: &PlannedExit) -> i64 {
    match exit.condition {
        Condition::Elapsed(time) | Condition::Lost(_, time) => time,
        _ => exit.lasts,
    }
}

fn report((mode, there): (&PlannedMode, &PlannedExit), (other, back): (&PlannedMode, &PlannedExit)) -> Diagnostic {
    let (one, two) = (&mode.name, &other.name);
    let message = format!(
        "`{one}` and `{two}` follow each other again and again: `{one}` ends when {}, and `{two}` leads back when {}",
        there.text, back.text
    );
    let help = help(there, back);
    Diagnostic::new(Code::ChatteringModes, back.span.clone(), message)
        .note(there.span.clone(), format!("leads from `{one}` to `{two}`"))
        .help(help)
}

/// Returns what leaves a gap between two exits.
fn help(there: &PlannedExit, back: &PlannedExit) -> String {
    let bounds = |exit: &PlannedExit| match exit.condition {
        Condition::Port(_, Test::Between { min, max, .. }) => Some((min, max)),
        _ => None,
    };
    let (Some((min, max)), Some((low, high))) = (bounds(there), bounds(back)) else {
        let key = if back.kind == ExitKind::OnLost { "after_ms" } else { "for_ms" };
        return match back.condition {
            Condition::Elapsed(_) => "let the modes last longer, or let one of them wait for something else".into(),
            _ => format!("let the way back wait for longer, for example `{key} = 100`"),
        };
    };
    let gap = |bound: f64| GAP * bound.abs();
    let rounded = |bound: f64| (bound * 1e6).round() / 1e6;
    let bound = match (low.is_finite(), high.is_finite()) {
        (false, true) if min.is_finite() && min != 0.0 => format!("`below = {}`", rounded(min - gap(min))),
        (true, false) if max.is_finite() && max != 0.0 => format!("`above = {}`", rounded(max + gap(max))),
        (true, true) if min > 0.0 && low == -high => format!("`within = {}`", rounded(min - gap(min))),
        _ => return "leave a gap between the two bounds, so that no value is beyond both".into(),
    };
    format!(
        "leave a gap, so that noise does not switch back: for example {bound}. `hysteresis` leaves none: it counts \
             within one mode"
    )
}
