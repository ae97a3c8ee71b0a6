//! Warns of exits that are never taken, because a bound on time or travel always ends their mode before.

use std::cmp::Reverse;

use crate::graph::plan::{Condition, PlannedExit, PlannedMode};
use crate::graph::syntax::ExitKind;
use crate::source::{Code, Diagnostic, Diagnostics};

/// Warns of each `go` and `done` that another exit of its mode always precedes. A late `fail` is a second bound.
///
/// A bound that is shorter than the `period` of the graph [s] has its own warning.
pub(crate) fn check(modes: &[PlannedMode], period: f64, diagnostics: &mut Diagnostics) {
    let is_short =
        |exit: &PlannedExit| matches!(exit.condition, Condition::Elapsed(time) if (time as f64) < period * 1e9);
    for mode in modes {
        let late = mode.exits.iter().enumerate().filter(|(_, exit)| matches!(exit.kind, ExitKind::Go | ExitKind::Done));
        for (i, exit) in late {
            let mut others = mode.exits.iter().enumerate().filter(|(other, first)| *other != i && !is_short(first));
            let first = others.find(|(other, first)| precedes((*other, first), (i, exit)));
            let Some((_, first)) = first else { continue };
            diagnostics.push(report(mode, first, exit));
        }
    }
}

/// Returns whether an exit always comes before another one of its mode. Both have their index.
fn precedes((i, first): (usize, &PlannedExit), (j, exit): (usize, &PlannedExit)) -> bool {
    let rank = |i: usize, exit: &PlannedExit| (exit.kind, Reverse(exit.priority), i);
    let wins = rank(i, first) < rank(j, exit);
    match (&first.condition, &exit.condition) {
        (Condition::Elapsed(bound), _) => {
            earliest(exit).is_some_and(|earliest| *bound < earliest || *bound == earliest && wins)
        }
        (Condition::Travel(pose, bound), Condition::Travel(other, way)) => {
            pose == other && (bound < way || bound == way && wins)
        }
        _ => false,
    }
}

/// Returns the earliest time in its mode at which an exit is taken [ns], if it is not at once.
const fn earliest(exit: &PlannedExit) -> Option<i64> {
    match exit.condition {
        Condition::Elapsed(time) => Some(time),
        Condition::Port(..) if exit.lasts > 0 => Some(exit.lasts),
        _ => None,
    }
}

fn report(mode: &PlannedMode, first: &PlannedExit, exit: &PlannedExit) -> Diagnostic {
    let (key, name, kind) = (exit.kind.key(), &mode.name, first.kind.key());
    let lasts = match exit.lasts {
        0 => String::new(),
        lasts => format!(" for {} ms", lasts as f64 * 1e-6),
    };
    let message = format!(
        "mode `{name}` never takes `{key}` when {}{lasts}: `{kind}` comes first, when {}",
        exit.text, first.text
    );
    let later = match exit.condition {
        Condition::Travel(_, way) => format!("after_travel_mm = {:.0}", way * 2e3),
        _ => format!("after_ms = {:.0}", earliest(exit).map_or(0.0, |time| time as f64 * 2e-6)),
    };
    let help = format!("let `{kind}` come later, for example `{later}`, or remove one of the two");
    Diagnostic::new(Code::LateExit, first.span.clone(), message).note(exit.span.clone(), "never taken").help(help)
}
