//! Warnings about poor controllers, before the robot moves.
//!
//! [`lint`] follows each command of an arm back to the features that move it, in each mode, and asks what the graph, the
//! geometry of the features and the contacts of the bench say about the loops. A check stays silent about what it does
//! not know: a feature that no known node measures, a gain that another node changes, or a stiffness that no bench
//! states.
//!
//! | question | file |
//! |---|---|
//! | what moves an arm, and how far may it press? | `arm` |
//! | what moves it in one mode, and where is that written? | `mode_law` |
//! | which exits of a mode wait for what? | `exits` |
//! | how does a feature answer a motion, by geometry? | `geometry` |
//! | what does a node do that guides the arm? | `guides` |
//! | can the contacts of the bench be read? | `contacts` |
//! | does a mode roll without a force? | `rolling` |
//! | does a mode wait for a contact without a motion? | `approach` |
//! | does the blind limit stop a search before it fails? | `blind` |
//! | is a setpoint or a threshold out of reach? | `reach` |
//! | does an exit wait for too large a force? | `exit_bounds` |
//! | does a feature always rest in a deadband, or move through it? | `deadbands` |
//! | is a place controlled along a line? | `lines` |
//! | do motions work against each other? | `opposed` |
//! | is a lost contact searched for too fast? | `recovery` |
//! | is a feature never present? | `presence` |
//! | does a column increase an error, or change another feature? | `wrong_columns` |
//! | does a projector select what nothing moves? | `idle_axes` |
//! | is a column used in no mode? | `unused_columns` |
//! | does a gain do harm whatever is touched? | `gains` |
//! | does a limit of the acceleration stop a place too late? | `braking` |
//! | is a loop near instability over a contact? | `stability` |
//! | is a loop too fast for an arm with springs in its joints? | `springs` |
//! | may a change while the arm moves make one unstable? | `live` |
//!
//! `reach` asks `exit_bounds` and `deadbands`, `gains` asks `deadbands`, `braking` asks `gains`, and `live` and `springs`
//! ask `stability`.

mod approach;
mod arm;
mod blind;
mod braking;
mod contacts;
mod deadbands;
mod exit_bounds;
mod exits;
mod faster_filters;
mod gains;
mod geometry;
mod guides;
mod idle_axes;
mod lines;
mod live;
mod mode_law;
mod opposed;
mod presence;
mod reach;
mod recovery;
mod rolling;
mod springs;
mod stability;
mod unused_columns;
mod wrong_columns;

use std::collections::BTreeSet;

use tactflow_runtime::graph::Outline;
use tactflow_runtime::source::{Code, Diagnostics};

use super::control::contacts::contacts;
use super::control::nodes::{Index, commands};
use arm::{Arm, carried};
use mode_law::ModeLaw;

/// The checks of an arm, in the order of their warnings.
const CHECKS: [fn(&Arm<'_>) -> Diagnostics; 13] = [
    contacts::misnamed,
    touches,
    reach::check,
    lines::check,
    opposed::check,
    recovery::check,
    presence::check,
    columns,
    gains::check,
    braking::check,
    springs::check,
    stability::check,
    live::check,
];

/// Returns the warnings about the control law of a graph.
pub(crate) fn lint(outline: &Outline, facts: &[(String, toml::Value)]) -> Diagnostics {
    if commands(outline).next().is_none() {
        return Diagnostics::new();
    }
    let index = Index::new(outline);
    let carried = carried(outline);
    let mut found = Diagnostics::new();
    for command in commands(outline) {
        let declared = contacts(facts, command.arm).unwrap_or_else(|why| {
            found.push(contacts::unreadable(outline, command.arm, why));
            Vec::new()
        });
        let ratio = format!("{}.joint_damping_ratio", command.arm);
        let ratio = facts.iter().find(|(fact, _)| *fact == ratio).and_then(|(_, value)| value.as_float());
        let Some(arm) = Arm::of(&index, &carried, command, declared, ratio) else { continue };
        found.extend(without_consequences(CHECKS.iter().flat_map(|check| check(&arm)).collect()));
    }
    // Several modes, and several parts of the same file, read the same number.
    let mut seen = BTreeSet::new();
    found.retain(|one| seen.insert((one.code, one.span.start)));
    found
}

/// Returns the warnings about modes that lose their contact, or that never touch.
fn touches(arm: &Arm<'_>) -> Diagnostics {
    let of_mode = |mode| [rolling::check(arm, mode), approach::check(arm, mode), blind::check(arm, mode)];
    arm.modes.iter().flat_map(of_mode).flatten().collect()
}

/// Returns the warnings about columns and about what projectors select of them.
fn columns(arm: &Arm<'_>) -> Diagnostics {
    let of_mode = |mode: &ModeLaw<'_>| [wrong_columns::check(arm, mode), idle_axes::check(arm, mode)].concat();
    arm.modes.iter().flat_map(of_mode).chain(unused_columns::check(arm)).collect()
}

/// Removes what another warning about the same arm causes: a task that rolls without its force has a column that nothing
/// selects, and a column with an entry in the wrong place leaves a component without one.
fn without_consequences(mut found: Diagnostics) -> Diagnostics {
    let has = |code: Code| found.iter().any(|one| one.code == code);
    let (has_wrong, rolls) = (has(Code::WrongColumn), has(Code::UnforcedRolling));
    let is_along_line = has(Code::LinePosition);
    found.retain(|one| match one.code {
        Code::IdleAxis => !has_wrong,
        Code::UnusedColumn => !has_wrong && !rolls,
        Code::OpposedMotion => !is_along_line,
        _ => true,
    });
    found
}
