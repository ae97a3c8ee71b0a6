//! Two ways out of a mode that may hold at once: the file does not decide between them.

use crate::graph::plan::{Condition, PlannedExit, PlannedMode, Test};
use crate::graph::syntax::Sort;
use crate::source::{Code, Diagnostic};

/// Two `go` of a mode that can hold in one tick and do not say which wins. What ends the run or follows a loss has its
/// fixed order, so only `go` has to be asked.
pub(crate) fn overlaps(mode: &PlannedMode, names: &[&str], found: &mut Vec<Diagnostic>) {
    let ways: Vec<&PlannedExit> = mode.exits.iter().filter(|exit| exit.sort == Sort::Go).collect();
    for (i, second) in ways.iter().enumerate() {
        let is_clash = |first: &&&PlannedExit| {
            first.to != second.to && first.priority == second.priority && !excludes(&first.condition, &second.condition)
        };
        let Some(first) = ways[..i].iter().find(is_clash) else { continue };
        let name = |exit: &PlannedExit| exit.to.map_or("", |to| names[to]);
        let message = format!(
            "two ways out of `{}` can hold at once: to `{}` when {}, and to `{}` when {}",
            mode.name,
            name(first),
            first.text,
            name(second),
            second.text
        );
        let diagnostic = Diagnostic::new(Code::OverlappingConditions, second.span.clone(), message);
        let more = second.priority + 1;
        let help = format!("give the one that shall win `priority = {more}`, or let them exclude each other");
        found.push(diagnostic.note(first.span.clone(), "the other is here").help(help));
    }
}

/// Whether one of them never holds while the other does.
fn excludes(a: &Condition, b: &Condition) -> bool {
    match (a, b) {
        (Condition::Port(one, a), Condition::Port(other, b)) => one == other && are_apart(*a, *b),
        (Condition::Sent(a), Condition::Sent(b)) => a != b,
        _ => false,
    }
}

fn are_apart(a: Test, b: Test) -> bool {
    match (a, b) {
        (Test::Absent, Test::Absent) => false,
        (Test::Absent, _) | (_, Test::Absent) => true,
        (Test::Flag(a), Test::Flag(b)) => a != b,
        (
            Test::Between { least: a, greatest: b, hysteresis: h },
            Test::Between { least: c, greatest: d, hysteresis: k },
        ) => b + h <= c - k || d + k <= a - h,
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_excludes_what() {
        let between = |least, greatest, hysteresis| Test::Between { least, greatest, hysteresis };
        let (low, high) = (f64::NEG_INFINITY, f64::INFINITY);
        let cases = [
            (Test::Flag(true), Test::Flag(false), true),
            (Test::Flag(true), Test::Flag(true), false),
            (Test::Absent, Test::Flag(false), true),
            (Test::Absent, Test::Absent, false),
            (Test::New, Test::Present, false),
            (Test::New, between(1.0, high, 0.0), false),
            (between(2.0, high, 0.0), between(low, 1.0, 0.0), true),
            (between(2.0, high, 0.6), between(low, 1.0, 0.6), false),
            (between(2.0, high, 0.0), between(low, 3.0, 0.0), false),
            (between(2.0, high, 0.0), between(low, 2.0, 0.0), true),
        ];
        for (a, b, is_apart) in cases {
            assert_eq!((are_apart(a, b), are_apart(b, a)), (is_apart, is_apart), "{a:?} {b:?}");
        }
    }
}
