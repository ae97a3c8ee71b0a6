//! Motions that work against each other in one mode, and motions into an object that is already pressed.

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics, Edit, Item, Table};

use super::arm::Arm;
use super::geometry::is_force;
use super::guides::{holds, may_press, parks};
use super::mode_law::ModeLaw;
use super::stability::over;
use crate::motion::COMPONENTS;
use crate::tool::control::contacts::Contact;
use crate::tool::control::digits::to_two_digits;
use crate::tool::control::exits::Exit;
use crate::tool::control::law::{Feature, Guidance};

pub(super) fn check(arm: &Arm<'_>) -> Diagnostics {
    let mut found = Diagnostics::new();
    for mode in &arm.modes {
        let contradiction = retreat(arm, mode).or_else(|| held(mode)).or_else(|| push(arm, mode));
        found.extend(
            contradiction
                .or_else(|| pressed(arm, mode))
                .or_else(|| dragged(arm, mode))
                .or_else(|| contended(mode))
                .or_else(|| divided(mode)),
        );
    }
    found
}

/// Returns the warning about a force that is controlled while the sensor moves away from the object: the contact does not
/// end.
fn retreat(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    let (node, speed) = away(mode)?;
    let presses = |feature: &&Feature| {
        let (factor, _) = largest_factor(arm, feature);
        let limit = mode.gain(feature, "limit").unwrap_or(f64::INFINITY);
        let most = feature.setpoint.map(|setpoint| (feature.kp * setpoint).min(limit) * factor * feature.column[2]);
        mode.quantity(feature).is_some_and(is_force)
            && feature.is_open_in_contact(&mode.nodes)
            && most.is_some_and(|most| most > 0.0 && most >= speed)
    };
    let feature = mode.moving().find(presses)?;
    let (_, contact) = largest_factor(arm, feature);
    let over = contact.map(|contact| format!(" {}", over(contact.name()))).unwrap_or_default();
    let message = format!(
        "{}`{node}` moves the sensor away from the object, but `{}` presses it back{over}: the contact does not end",
        mode.prefix(),
        feature.name
    );
    Some(report(mode, feature, message, &deselect(2)))
}

/// Returns the largest factor that the schedules of a feature have over a contact of the bench, and this contact [1]. Where
/// no contact says how the feature answers, that is 1, and the smallest one of a schedule that follows anything else.
fn largest_factor<'a>(arm: &'a Arm<'_>, feature: &Feature) -> (f64, Option<&'a Contact>) {
    let schedules = &feature.schedules;
    let factor = |contact: &Contact| schedules.iter().map(|one| one.factor(contact)).product::<Option<f64>>();
    let known = arm.contacts.iter().filter(|_| !schedules.is_empty());
    let known = known.filter_map(|contact| Some((factor(contact)?, Some(contact))));
    let usual = schedules.iter().map(|schedule| schedule.nominal.map_or(schedule.min, |_| 1.0));
    let usual = (usual.product(), None);
    known.max_by(|(one, _), (other, _)| one.total_cmp(other)).unwrap_or(usual)
}

/// Returns the node that moves the sensor away from the object in a mode, and its speed [m/s].
fn away<'a>(mode: &'a ModeLaw<'_>) -> Option<(&'a str, f64)> {
    let all_open = mode.law.constants.iter().all(|constant| constant.is_open || constant.twist[2] == 0.0);
    let constants = || mode.law.constants.iter().map(|constant| (&*constant.node, constant.twist[2]));
    let speed: f64 = constants().map(|(_, speed)| speed).sum();
    let constant = constants().find(|(_, own)| all_open && speed < 0.0 && *own < 0.0).map(|(node, _)| (node, -speed));
    let parks = |guide: &&Guidance| guide.is_open && parks(&mode.nodes, guide);
    // A node that parks slows down at its place, so that any force presses faster there.
    let park = || mode.law.guidance.iter().find(parks).map(|guide| (guide.node(), 0.0));
    constant.or_else(park)
}

/// Returns the warning about a feature that moves the sensor along a component in which a node holds it at a place.
fn held(mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    let (guide, feature, i) = mode.law.guidance.iter().find_map(|guide| {
        let holds = holds(&mode.nodes, guide)?;
        let moves = |feature: &Feature| (0..6).find(|i| holds[*i] && guide.passes[*i] && feature.column[*i] != 0.0);
        let mut open = mode.moving().filter(|feature| guide.is_open && feature.is_open_in_contact(&mode.nodes));
        open.find_map(|feature| Some((guide, feature, moves(feature)?)))
    })?;
    let message = format!(
        "{}`{}` and `{}` both move `{}`: one holds the sensor at a place, the other one moves it to its setpoint, and it \
         rests between them",
        mode.prefix(),
        guide.node(),
        feature.name,
        COMPONENTS[i]
    );
    let (help, written) = release(mode, guide, i);
    Some(written.into_iter().fold(report(mode, feature, message, &help), Diagnostic::edit))
}

/// Returns what to write so that a node no longer holds the sensor along a component that a feature moves.
fn release(mode: &ModeLaw<'_>, guide: &Guidance, i: usize) -> (String, Option<Edit>) {
    let name = guide.node();
    let (key, value, why) = match &*guide.kind {
        "follow_path" if i == 2 => {
            ("in_plane", "true", "the path then lies in the plane of the pad, and leaves `vz` free")
        }
        "hold_pose" if i < 3 => (
            "speed_m_per_s",
            "0.0",
            "it then holds the orientation alone. To hold a part of the position too, put a `projector` behind it",
        ),
        _ => return (deselect(i), None),
    };
    // A default is written nowhere, so it has no text to replace.
    let place =
        Some(mode.place(name, key)).filter(|place| mode.nodes.node(name).is_some_and(|node| node.span != *place));
    (format!("write `{key} = {value}` in `{name}`: {why}"), place.map(|place| Edit::Replace(place, value.to_owned())))
}

/// Returns the warning about a mode that moves on into the object that the modes before have pressed, where nothing that
/// the pad feels ends it.
fn push(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    let speed: f64 = mode.law.constants.iter().map(|constant| constant.twist[2]).sum();
    let controls = |mode: &ModeLaw<'_>| mode.moving().any(|feature| feature.column[2] != 0.0);
    let feels = mode.watches() || mode.lost().next().is_some();
    if speed <= 0.0 || controls(mode) || feels || mode.law.guidance.iter().any(may_press) {
        return None;
    }
    let leads = |exit: Exit<'_>| exit.to() == Some(mode.own_name()) && !exit.is_lost();
    let before = |other: &&ModeLaw<'_>| controls(other) && other.exits("go").any(leads);
    let before = arm.modes.iter().find(before)?;
    let constant = mode.law.constants.iter().find(|constant| constant.twist[2] > 0.0)?;
    let message = format!(
        "{}`{}` moves the sensor into the object with {speed} m/s: mode `{}` before it presses, and no exit of this one waits \
         for what the pad feels",
        mode.prefix(),
        constant.node,
        before.own_name()
    );
    let help = "move along -z to leave the object, or let a `go` or `done` wait for a force: `touch.present` does not \
                change while the sensor presses";
    Some(Diagnostic::new(Code::OpposedMotion, mode.place(&constant.node, "twist"), message).help(help))
}

/// Share of its setpoint by which a constant motion may shift a force [1].
const SHIFTED: f64 = 0.15;

/// Returns the warning about a constant motion into the object beside the control of a force: without an integral, the
/// force rests above its setpoint, where the controller moves back as fast.
fn pressed(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    // An approach ends with the contact by which the force is measured, or with the force.
    if mode.waits_for_contact() || waits_for_force(arm, mode) {
        return None;
    }
    let open = || mode.law.constants.iter().filter(|constant| constant.is_open_in_contact);
    let speed: f64 = open().map(|constant| constant.twist[2]).sum();
    let constant = open().find(|constant| constant.twist[2] > 0.0)?;
    let shift = |feature: &Feature| speed / (feature.kp * feature.column[2]);
    let is_shifted = |feature: &&Feature| {
        let within = mode.gain(feature, "within").filter(|_| feature.ki > 0.0);
        let is_left = feature.ki == 0.0 || within.is_some_and(|within| within < shift(feature));
        mode.quantity(feature).is_some_and(is_force)
            && is_left
            && feature.kp > 0.0
            && feature.is_open_in_contact(&mode.nodes)
            && feature.schedules.is_empty()
            && feature.column[2] > 0.0
            && feature.setpoint.is_some_and(|setpoint| setpoint > 0.0 && shift(feature) > SHIFTED * setpoint)
    };
    let feature = mode.moving().find(is_shifted)?;
    let message = format!(
        "{}`{}` moves the sensor into the object with {speed} m/s beside the control of `{}`, which then rests {} above its \
         setpoint",
        mode.prefix(),
        constant.node,
        feature.name,
        to_two_digits(shift(feature), libm::round)
    );
    let help = format!("set 0 for `vz` of `{}` in this mode: the control of the force presses", constant.node);
    Some(Diagnostic::new(Code::OpposedMotion, mode.place(&constant.node, "twist"), message).help(&*help))
}

/// Returns whether an exit waits for a force.
fn waits_for_force(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> bool {
    let is_of_force = |when: &str| {
        let quantity = arm.watched(mode, when);
        quantity.as_deref().or(when.rsplit('.').next()).is_some_and(is_force)
    };
    let is_bound = |exit: &Exit<'_>| exit.entry("above").is_some() || exit.entry("within").is_some();
    mode.conditions().filter(is_bound).filter_map(Exit::when).any(is_of_force)
}

/// Distance from its setpoint at which a constant motion may hold a contact [m].
const MAX_SHIFT_M: f64 = 0.001;

/// Time after which a contact is at rest, as a multiple of the time constant of its loop [1].
const SETTLED: f64 = 5.0;

/// Returns the warning about a constant motion along a component in which a feature holds the place of an object that does
/// not move: the contact rests beside the setpoint, where the controller moves back as fast.
fn dragged(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    let is_still = |object: &Table| {
        object.get("motion").is_none_or(|motion| matches!(&motion.item, Item::Array(steps) if steps.is_empty()))
    };
    // A motion beside the control follows an object that moves, and a short one comes to no rest.
    if arm.objects().next().is_none() || !arm.objects().all(is_still) {
        return None;
    }
    let constants = mode.law.constants.iter().filter(|constant| constant.is_open_in_contact);
    let (constant, feature, shift) =
        constants.flat_map(|constant| [(constant, 0), (constant, 1)]).find_map(|(constant, i)| {
            let shift = |feature: &Feature| (constant.twist[i] / (feature.kp * feature.column[i])).abs();
            let is_shifted = |feature: &&Feature| {
                feature.ki == 0.0
                    && feature.kp > 0.0
                    && feature.schedules.is_empty()
                    && feature.column[i] != 0.0
                    && mode.lasts_for(SETTLED * 1e3 / (feature.kp * feature.column[i]).abs())
                    && feature.is_open_in_contact(&mode.nodes)
                    && mode.quantity(feature) == Some(["x", "y"][i])
                    && shift(feature) > MAX_SHIFT_M
            };
            let feature = mode.moving().find(is_shifted)?;
            Some((constant, feature, shift(feature)))
        })?;
    let message = format!(
        "{}`{}` moves the sensor along the object while `{}` holds its place: it rests {:.1} mm beside its setpoint",
        mode.prefix(),
        constant.node,
        feature.name,
        shift * 1e3
    );
    let help =
        format!("move along the component that `{}` leaves free, or select 0 for it in the projector", feature.name);
    Some(Diagnostic::new(Code::OpposedMotion, mode.place(&constant.node, "twist"), message).help(help))
}

/// Returns the warning about two forces whose integrals move the same component alone: both setpoints are not reached
/// together, so the integrals grow against each other.
fn contended(mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    let is_judged = |feature: &&Feature| {
        feature.ki > 0.0
            && feature.is_open_in_contact(&mode.nodes)
            && feature.presses_alone()
            && mode.quantity(feature).is_some_and(is_force)
    };
    let all: Vec<&Feature> = mode.moving().filter(is_judged).collect();
    let differs = |one: &Feature, other: &Feature| one.measured != other.measured || one.setpoint != other.setpoint;
    let differing = all.windows(2).find(|pair| differs(pair[0], pair[1]));
    let [one, other] = differing? else { return None };
    let message = format!(
        "{}the integrals of `{}` and `{}` both move `vz`, each toward its own setpoint: they wind up against each other",
        mode.prefix(),
        one.name,
        other.name
    );
    let help = "leave `ki` to one of them";
    Some(Diagnostic::new(Code::OpposedMotion, mode.place_of_gain(other, "ki"), message).help(help))
}

/// Returns the warning about one measurement that is controlled toward two setpoints along one component.
fn divided(mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    // An orientation has the same value after half a turn, and with deadbands two bounds can stand side by side.
    let has_band = |feature: &Feature| {
        let width = |band| mode.nodes.number(band, &format!("width.{}.outer", feature.name));
        mode.deadband(feature).and_then(width).is_some()
    };
    let is_judged = |feature: &&Feature| {
        let quantity = mode.quantity(feature);
        feature.is_open_in_contact(&mode.nodes)
            && quantity.is_some_and(|quantity| quantity != "orientation")
            && (feature.kp > 0.0 || feature.ki > 0.0)
            && feature.setpoint.is_some()
            && !has_band(feature)
    };
    let all: Vec<&Feature> = mode.moving().filter(is_judged).collect();
    let shared = |one: &Feature, other: &Feature| {
        let is_divided = one.measured == other.measured && one.setpoint != other.setpoint;
        (0..6).find(|i| is_divided && one.column[*i] * other.column[*i] > 0.0)
    };
    let pairs = all.iter().enumerate().flat_map(|(at, one)| all[at + 1..].iter().map(move |other| (one, other)));
    let (one, other, i) = pairs.into_iter().find_map(|(one, other)| Some((one, other, shared(one, other)?)))?;
    let [first, second] = [one, other].map(|feature| {
        let setpoint = feature.setpoint.unwrap_or_default();
        feature.in_units(setpoint)
    });
    let message = format!(
        "{}`{}` and `{}` both move `{}` by `{}`, one toward {first} and the other one toward {second}: it cannot rest at both",
        mode.prefix(),
        one.name,
        other.name,
        COMPONENTS[i],
        one.measured.as_deref().unwrap_or_default()
    );
    let nodes = [other.compared.as_deref()?, other.pid.as_deref()?, &*other.jacobian].map(|node| format!("`{node}`"));
    let help = format!("write the same setpoint for both, or remove `{}` from {}", other.name, nodes.join(", "));
    Some(Diagnostic::new(Code::OpposedMotion, mode.place_of_setpoint(other)?, message).help(help))
}

fn deselect(i: usize) -> String {
    format!("in this mode, select 0 for `{}` in the projector behind the column", COMPONENTS[i])
}

fn report(mode: &ModeLaw<'_>, feature: &Feature, message: String, help: &str) -> Diagnostic {
    Diagnostic::new(Code::OpposedMotion, mode.place_of_column(feature), message).help(help)
}
