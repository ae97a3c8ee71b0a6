//! Warns of exits that are never taken, because a bound on time or travel always ends their mode before.

use std::cmp::Reverse;

use crate::graph::plan::{Condition, PlannedExit, PlannedMode};
use crate::graph::syntax::ExitKind;
use crate::source::{Code, Diagnostic, Diagnostics};

/// Warns of each `go` and `done` that another exit of its mode always precedes. A late `fail` is a second bound.
pub(crate) fn check(modes: &[PlannedMode], diagnostics: &mut Diagnostics) {
    for mode in modes {
        let late = mode.exits.iter().enumerate().filter(|(_, exit)| matches!(exit.kind, ExitKind::Go | ExitKind::Done));
        for (i, exit) in late {
            let mut others = mode.exits.iter().enumerate().filter(|(other, _)| *other != i);
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
    let (key, name) = (exit.kind.key(), &mode.name);
    let lasts = match exit.lasts {
        0 => String::new(),
        lasts => format!(" for {} ms", lasts as f64 * 1e-6),
    };
    let message = format!(
        "mode `{name}` never takes this `{key}`: `{}` comes first, when {}, but `{key}` needs that {}{lasts}",
        first.kind.key(),
        first.text,
        exit.text
    );
    let bound = if matches!(first.condition, Condition::Travel(..)) { "after_travel_mm" } else { "after_ms" };
    let help = format!("increase `{bound}` of `{}` above that of `{key}`, or remove one of the two", first.kind.key());
    Diagnostic::new(Code::LateExit, first.span.clone(), message).note(exit.span.clone(), "never taken").help(help)
}
