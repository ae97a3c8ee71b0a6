//! Warns of modes that wait for a contact and do not move toward it.

use std::ops::Range;

use super::contact::ContactPorts;
use super::generators::{Generators, Motions};
use crate::graph::net::Net;
use crate::graph::plan::{Condition, PlannedExit, PlannedMode, Producer, Test};
use crate::graph::syntax::{ExitKind, PortState};
use crate::node::{Limits, Motion};
use crate::signal::Kind;
use crate::source::{Code, Diagnostic, Diagnostics, Value, quoted};

/// Warns of each mode that waits for a contact and in which the sensor moves away from the object, or not at all.
///
/// `starts` are the start modes of the tasks.
pub(crate) fn check(
    net: &Net<'_>,
    contact: &ContactPorts,
    modes: &[PlannedMode],
    starts: &[usize],
    (motions, generators): (&Motions, &Generators),
    diagnostics: &mut Diagnostics,
) {
    let waits = |exit: &PlannedExit| waits(net, contact, exit);
    let free = find_free(modes, starts, &waits);
    for i in (0..modes.len()).filter(|i| free[*i] && is_approach(&modes[*i], starts.contains(i), &waits)) {
        let task = net.flat.modes[i].task;
        let mut own = (0..modes.len()).filter(|mode| net.flat.modes[*mode].task == task);
        let is_always_still = own.all(|mode| generators.of(mode).is_empty());
        let all = generators.all_in(net, task);
        let moving = generators.of(i);
        let is_bounded = modes[i].exits.iter().any(|exit| matches!(exit.condition, Condition::Travel(..)));
        let is_set = || all.iter().any(|node| net.setting(i, *node).is_some());
        // A task may wait at rest until it is touched, and move in other modes.
        let is_meant_to_move = is_bounded || is_always_still || is_set();
        if moving.is_empty() && is_meant_to_move && !all.is_empty() && !motions.wakes(i) {
            diagnostics.push(report(net, i, &all, Some(is_always_still)));
        } else if !moving.is_empty()
            && moving.iter().all(|node| motions.of(i, *node) == Motion::Retreat && !may_be_turned(net, *node))
        {
            diagnostics.push(report(net, i, moving, None));
        }
    }
}

/// Returns whether the motion of a node may have another direction when it reaches the arm: it crosses more than the one
/// change of frame that leads from the sensor to the base of the arm.
fn may_be_turned(net: &Net<'_>, generator: usize) -> bool {
    let turns = |node: &usize| {
        let passes = net.spec(*node).is_some_and(|spec| {
            let Limits { through, holds, breaks, .. } = spec.limits;
            through.is_some() && holds.is_empty() && breaks.is_empty()
        });
        let output = net.outputs(Producer::Node(*node)).and_then(|outputs| outputs.first());
        passes && output.is_some_and(|port| port.kind == Kind::Twist) && net.upstream([*node])[generator]
    };
    (0..net.wires.len()).filter(turns).count() > 1
}

/// Returns for each mode whether it begins without a contact: at the start, after a contact is lost, or after such a
/// mode.
fn find_free(modes: &[PlannedMode], starts: &[usize], waits: &dyn Fn(&PlannedExit) -> bool) -> Vec<bool> {
    let mut begins_with_contact = vec![false; modes.len()];
    let mut open = starts.to_vec();
    for exit in modes.iter().flat_map(|mode| &mode.exits) {
        let Some(to) = exit.to else { continue };
        begins_with_contact[to] |= waits(exit);
        if exit.kind == ExitKind::OnLost {
            open.push(to);
        }
    }
    let mut free = vec![false; modes.len()];
    while let Some(mode) = open.pop() {
        if !begins_with_contact[mode] && !std::mem::replace(&mut free[mode], true) {
            open.extend(modes[mode].exits.iter().filter_map(|exit| exit.to));
        }
    }
    free
}

/// Returns whether only a contact leads on from a mode. A mode after the start may back off for a while.
fn is_approach(mode: &PlannedMode, is_start: bool, waits: &dyn Fn(&PlannedExit) -> bool) -> bool {
    let mut ways = mode.exits.iter().filter(|exit| matches!(exit.kind, ExitKind::Go | ExitKind::Done)).peekable();
    let is_only_way = ways.peek().is_some() && ways.clone().all(waits);
    is_only_way || is_start && ways.any(waits)
}

/// Returns whether an exit waits for a contact.
fn waits(net: &Net<'_>, contact: &ContactPorts, exit: &PlannedExit) -> bool {
    let Condition::Port(watched, test) = &exit.condition else { return false };
    let is_met_by_contact = match test {
        Test::Is(state) => matches!(state, PortState::True | PortState::Present | PortState::New),
        Test::Between { min, .. } => *min > 0.0,
    };
    is_met_by_contact && contact.need(net, watched.source)
}

/// `still` is whether the nodes rest in all modes, if they rest in this one.
fn report(net: &Net<'_>, mode: usize, generators: &[usize], still: Option<bool>) -> Diagnostic {
    let block = &net.flat.modes[mode];
    let (name, names) = (net.flat.mode_name(mode), quoted(generators.iter().map(|node| &net.flat.nodes[*node].name)));
    let message = match still {
        Some(_) => format!("mode `{name}` waits for a contact, but {names} does not move the sensor"),
        None => {
            format!("mode `{name}` waits for a contact, but {names} moves the sensor away from the object, along -z")
        }
    };
    let place = generators.iter().find_map(|node| net.setting(mode, *node)).and_then(first_place);
    let useless = if still == Some(true) {
        format!("; or remove {names}, if the object comes to the sensor")
    } else {
        String::new()
    };
    let help = format!("let {names} move along +z of the sensor in this mode, which points toward the object{useless}");
    Diagnostic::new(Code::NoApproach, place.unwrap_or_else(|| block.key.span.clone()), message).help(help)
}

/// Returns the place of the first parameter in a table.
fn first_place(settings: &Value) -> Option<Range<usize>> {
    settings.as_table()?.entries.first().map(|(_, value)| value.span.clone())
}
