//! Checks that two exits of a mode cannot hold at once without a priority.

use super::readings::Readings;
use crate::graph::net::Net;
use crate::graph::plan::{Condition, PlannedExit, PlannedMode, Test};
use crate::graph::syntax::{ExitKind, PortState};
use crate::source::{Code, Diagnostic, Diagnostics};

/// Reports two `go` of a mode that can hold in one tick with the same priority.
///
/// Other exits have a fixed order.
pub(crate) fn check(net: &Net<'_>, readings: &Readings, modes: &[PlannedMode], diagnostics: &mut Diagnostics) {
    modes.iter().for_each(|mode| check_mode(net, readings, mode, diagnostics));
}

fn check_mode(net: &Net<'_>, readings: &Readings, mode: &PlannedMode, diagnostics: &mut Diagnostics) {
    let exits: Vec<&PlannedExit> = mode.exits.iter().filter(|exit| exit.kind == ExitKind::Go).collect();
    for (i, second) in exits.iter().enumerate() {
        let never_together = |first: &PlannedExit| {
            let mut one = readings.implied(net, &first.condition);
            one.any(|one| readings.implied(net, &second.condition).any(|other| excludes(&one, &other)))
        };
        let is_clash = |first: &&&PlannedExit| {
            first.to != second.to && first.priority == second.priority && !never_together(first)
        };
        let Some(first) = exits[..i].iter().find(is_clash) else { continue };
        let name = |exit: &PlannedExit| exit.to.map_or_else(String::new, |to| net.flat.mode_name(to));
        let message = format!(
            "two exits of `{}` can hold at once: to `{}` when {}, and to `{}` when {}",
            mode.name,
            name(first),
            first.text,
            name(second),
            second.text
        );
        let diagnostic = Diagnostic::new(Code::OverlappingConditions, second.span.clone(), message);
        let more = second.priority + 1;
        let help = format!("write `priority = {more}` in the one that should win, or make their conditions exclusive");
        diagnostics.push(diagnostic.note(first.span.clone(), "the other is here").help(help));
    }
}

/// Returns whether two conditions never hold at once.
fn excludes(a: &Condition, b: &Condition) -> bool {
    match (a, b) {
        (Condition::Port(one, a), Condition::Port(other, b)) => one == other && are_apart(*a, *b),
        (Condition::Sent(a), Condition::Sent(b)) => a != b,
        _ => false,
    }
}

fn are_apart(a: Test, b: Test) -> bool {
    use PortState::{Absent, False, True};
    match (a, b) {
        (Test::Is(Absent), Test::Is(Absent)) => false,
        (Test::Is(Absent), _) | (_, Test::Is(Absent)) => true,
        (Test::Is(True), Test::Is(False)) | (Test::Is(False), Test::Is(True)) => true,
        (Test::Between { min: a, max: b, hysteresis: h }, Test::Between { min: c, max: d, hysteresis: k }) => {
            b + h <= c - k || d + k <= a - h
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exclusive_tests_are_found() {
        let between = |min, max, hysteresis| Test::Between { min, max, hysteresis };
        let (low, high) = (f64::NEG_INFINITY, f64::INFINITY);
        let cases = [
            (Test::Is(PortState::True), Test::Is(PortState::False), true),
            (Test::Is(PortState::True), Test::Is(PortState::True), false),
            (Test::Is(PortState::Absent), Test::Is(PortState::False), true),
            (Test::Is(PortState::Absent), Test::Is(PortState::Absent), false),
            (Test::Is(PortState::New), Test::Is(PortState::Present), false),
            (Test::Is(PortState::New), between(1.0, high, 0.0), false),
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
