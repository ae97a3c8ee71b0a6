//! Warns of modes that wait for a contact and do not move toward it.

use std::ops::Range;

use super::endings::needs_contact;
use super::motion::find_generators;
use crate::graph::net::Net;
use crate::graph::plan::{Condition, PlannedExit, PlannedMode, Test};
use crate::graph::syntax::{ExitKind, PortState};
use crate::node::Motion;
use crate::source::{Code, Diagnostic, Diagnostics, Value, quoted};

/// Warns of each mode that waits for a contact and in which the sensor moves away from the object, or not at all.
///
/// `start` is the start mode. `motions` holds for each mode the motion that each node generates.
pub(crate) fn check(
    net: &Net<'_>,
    modes: &[PlannedMode],
    start: usize,
    motions: &[Vec<Motion>],
    diagnostics: &mut Diagnostics,
) {
    let generators = find_generators(net, &vec![false; net.wires.len()]);
    let is_still = |motions: &Vec<Motion>| -> Vec<bool> { motions.iter().map(|one| *one == Motion::Still).collect() };
    let moving: Vec<Vec<usize>> = motions.iter().map(|all| find_generators(net, &is_still(all))).collect();
    let free = find_free(net, modes, start);
    for i in (0..modes.len()).filter(|i| free[*i] && is_approach(net, &modes[*i], *i == start)) {
        let is_bounded = modes[i].exits.iter().any(|exit| matches!(exit.condition, Condition::Travel(..)));
        let is_set = generators.iter().any(|node| net.setting(i, *node).is_some());
        // A task may wait at rest until it is touched, and move in other modes.
        let is_meant_to_move = is_bounded || is_set || moving.iter().all(Vec::is_empty);
        if moving[i].is_empty() && is_meant_to_move && !generators.is_empty() {
            diagnostics.push(report(net, i, &generators, true));
        } else if !moving[i].is_empty() && moving[i].iter().all(|node| motions[i][*node] == Motion::Retreat) {
            diagnostics.push(report(net, i, &moving[i], false));
        }
    }
}

/// Returns for each mode whether it begins without a contact: at the start, after a contact is lost, or after such a
/// mode.
fn find_free(net: &Net<'_>, modes: &[PlannedMode], start: usize) -> Vec<bool> {
    let entries = |to: usize| {
        let exits = modes.iter().enumerate().flat_map(|(from, mode)| mode.exits.iter().map(move |exit| (from, exit)));
        exits.filter(move |(_, exit)| exit.to == Some(to))
    };
    let begins_with = |mode: usize| entries(mode).any(|(_, exit)| waits(net, exit));
    let mut free = vec![false; modes.len()];
    loop {
        let follows = |(from, exit): (usize, &PlannedExit)| free[from] || exit.kind == ExitKind::OnLost;
        let is_free = |mode: usize| !begins_with(mode) && (mode == start || entries(mode).any(follows));
        let next: Vec<bool> = (0..modes.len()).map(is_free).collect();
        if next == free {
            return free;
        }
        free = next;
    }
}

/// Returns whether only a contact leads on from a mode. A mode after the start may back off for a while.
fn is_approach(net: &Net<'_>, mode: &PlannedMode, is_start: bool) -> bool {
    let mut ways = mode.exits.iter().filter(|exit| matches!(exit.kind, ExitKind::Go | ExitKind::Done)).peekable();
    let is_only_way = ways.peek().is_some() && ways.clone().all(|exit| waits(net, exit));
    is_only_way || is_start && ways.any(|exit| waits(net, exit))
}

/// Returns whether an exit waits for a contact.
fn waits(net: &Net<'_>, exit: &PlannedExit) -> bool {
    let Condition::Port(watched, test) = &exit.condition else { return false };
    let is_met_by_contact = match test {
        Test::Is(state) => matches!(state, PortState::True | PortState::Present | PortState::New),
        Test::Between { min, .. } => *min > 0.0,
    };
    is_met_by_contact && needs_contact(net, watched.source)
}

fn report(net: &Net<'_>, mode: usize, generators: &[usize], is_still: bool) -> Diagnostic {
    let block = &net.flat.modes[mode];
    let (name, names) = (&block.key.name, quoted(generators.iter().map(|node| &net.flat.nodes[*node].name)));
    let message = match is_still {
        true => format!("mode `{name}` waits for a contact, but {names} does not move the sensor"),
        false => {
            format!("mode `{name}` waits for a contact, but {names} moves the sensor away from the object, along -z")
        }
    };
    let place = generators.iter().find_map(|node| net.setting(mode, *node)).and_then(first_place);
    let help = format!("let {names} move along +z of the sensor in this mode, which points toward the object");
    Diagnostic::new(Code::NoApproach, place.unwrap_or_else(|| block.key.span.clone()), message).help(help)
}

/// Returns the place of the first parameter in a table.
fn first_place(settings: &Value) -> Option<Range<usize>> {
    settings.as_table()?.entries.first().map(|(_, value)| value.span.clone())
}
