//! Columns: those that increase an error, those that change another feature, and those that nothing uses.

use std::collections::BTreeSet;
use std::f64::consts::FRAC_PI_2;

use tactflow_runtime::graph::OutlinedBlock;
use tactflow_runtime::source::{Code, Diagnostic, Diagnostics, Edit, Item};

use super::arm::Arm;
use super::geometry::{Confusion, Geometry, KnownSign};
use super::lines::{line_angle, line_axis};
use super::mode_law::ModeLaw;
use crate::motion::COMPONENTS;
use crate::motion::axis::wrap_axial;
use crate::tool::control::collect::law;
use crate::tool::control::contacts::Contact;
use crate::tool::control::digits::to_three_digits;
use crate::tool::control::exits::Exit;
use crate::tool::control::law::{Feature, Law};
use crate::tool::control::settings::{Nodes, source};

/// Largest radius of an object that a pad rolls on [m].
const LARGEST_RADIUS: f64 = 0.1;

pub(super) fn check(arm: &Arm<'_>, found: &mut Diagnostics) {
    for mode in &arm.modes {
        found.extend(mode.moving().filter_map(|feature| wrong(arm, mode, feature)));
        found.extend(idle(arm, mode));
    }
    found.extend(unused(arm));
}

/// Returns the warning about a column that increases the error of its feature, or that does not change the feature.
fn wrong(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let Some((quantity, row)) = mode.quantity(feature).and_then(|quantity| Some((quantity, Geometry::of(quantity)?)))
    else {
        return reversed(arm, mode, feature).or_else(|| offset(arm, mode, feature));
    };
    let column = written(mode, feature)?;
    if !row.changes(&column) {
        return if row.is_needed { foreign(mode, feature, quantity, column) } else { reversed(arm, mode, feature) };
    }
    if !row.changes(&feature.column) {
        return if row.is_needed { Some(blocked(mode, feature, &row)) } else { reversed(arm, mode, feature) };
    }
    if let Some(aside) = aside(arm, mode, feature, (quantity, column)) {
        return Some(aside);
    }
    let is_reversed = |known: &&KnownSign| {
        // What the bench says about this object counts more than geometry.
        let said = arm.contacts.iter().filter_map(|contact| contact.features.get(quantity));
        let is_said = said.map(|answer| answer.row()).any(|row| row[known.component] * known.sign < 0.0);
        feature.column[known.component] * known.sign < 0.0 && !is_said && !is_outweighed(&row, &feature.column, known)
    };
    let Some(first) = row.known.iter().find(is_reversed) else { return reversed(arm, mode, feature) };
    let name = COMPONENTS[first.component];
    // Of what is not selected, too.
    let right = row.signed(column);
    let message = format!(
        "the column of `{}` increases its error: `{name}` is {}, but {}",
        feature.name,
        to_three_digits(column[first.component]),
        first.reason
    );
    Some(replaced(mode, feature, message, right))
}

/// Returns the column of a feature before all projectors, as it is behind a mount that turns it.
fn written(mode: &ModeLaw<'_>, feature: &Feature) -> Option<[f64; 6]> {
    if feature.mount.is_some() { Some(feature.column) } else { mode.column(feature) }
}

/// Returns the start of a message about a column that a mount turns.
fn behind(feature: &Feature) -> String {
    feature.mount.as_ref().map(|turner| format!("behind `{turner}`, ")).unwrap_or_default()
}

/// Returns the warning about a column that slides or rolls a contact more along the other axis than along its own, or that
/// slides it more than it presses. With two such columns the contact circles around its setpoint, or runs away from it.
fn aside(
    arm: &Arm<'_>,
    mode: &ModeLaw<'_>,
    feature: &Feature,
    (quantity, column): (&str, [f64; 6]),
) -> Option<Diagnostic> {
    let name = &feature.name;
    let geometry = Geometry::of(quantity)?;
    let answers = || arm.contacts.iter().filter_map(|contact| contact.features.get(quantity));
    let is_aside = |Confusion { own, other }: &&Confusion| {
        // A bench that states an answer to the other component knows more.
        let is_stated = answers().any(|answer| answer.row()[*other] != 0.0);
        !is_stated && feature.column[*other].abs() > feature.column[*own].abs()
    };
    let Confusion { own, other } = *geometry.confused.iter().find(is_aside)?;
    let mut right = column;
    for Confusion { own, other } in geometry.confused {
        let sign = geometry.sign(*own)?;
        let size = if *own == 2 { column[*own].abs() } else { column[*own].hypot(column[*other]) };
        (right[*own], right[*other]) = (sign * to_three_digits(size), 0.0);
    }
    let message = format!(
        "the column of `{name}` moves the sensor more with `{}`, which does not change `{quantity}`, than with `{}`, which does",
        COMPONENTS[other], COMPONENTS[own]
    );
    Some(replaced(mode, feature, message, right))
}

/// Angle from the wrap of a direction within which noise takes it to the other side [rad].
const WRAP: f64 = 0.2;

/// Returns the warning about a column that increases the offset of a line. The direction of the line is the setpoint of
/// its angle, and the offset is positive on the side of the direction turned by +90 degrees.
fn offset(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let is_stated = arm.contacts.iter().any(|contact| contact.features.contains_key("offset"));
    if mode.quantity(feature)? != "offset" || is_stated {
        return None;
    }
    let setpoint = line_angle(mode)?;
    let angle = wrap_axial(setpoint);
    let moves = feature.column[0] != 0.0 || feature.column[1] != 0.0;
    if moves && angle.abs() > FRAC_PI_2 - WRAP {
        let message = format!(
            "`{}` changes its sign where the direction of the line wraps from pi/2 to -pi/2, near its setpoint of {setpoint} \
             rad: no column is right on both sides",
            feature.name
        );
        let help =
            "hold the line along x, with a setpoint of 0 rad, or measure its place with `moments` or `curvature`";
        return Some(Diagnostic::new(Code::WrongColumn, mode.place_of_column(feature), message).help(help));
    }
    let (across_x, across_y) = (libm::sin(angle), -libm::cos(angle));
    let column = written(mode, feature)?;
    if across_x * feature.column[0] + across_y * feature.column[1] >= 0.0 {
        return None;
    }
    let message = format!(
        "the column of `{}` increases its error: the offset of a line at {angle} rad grows when the sensor moves along \
         ({:.2}, {:.2})",
        feature.name, across_x, across_y
    );
    let mut right = column;
    (right[0], right[1]) = (-column[0] + 0.0, -column[1] + 0.0);
    Some(replaced(mode, feature, message, right))
}

/// Returns whether a column rolls the sensor the wrong way, but less than it slides the right way on any object.
fn is_outweighed(row: &Geometry, column: &[f64; 6], known: &KnownSign) -> bool {
    let rolls = known.component > 2;
    let slides = row.known.iter().filter(|other| other.component < 3);
    rolls
        && slides.map(|other| column[other.component] * other.sign).sum::<f64>()
            > column[known.component].abs() * LARGEST_RADIUS
}

/// Returns the warning about a column that increases the error of a feature of which only the bench says how it answers.
fn reversed(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let quantity = feature.quantity()?;
    let column = mode.column(feature)?;
    let gain = |contact: &&Contact| Some(contact.features.get(quantity)?.along(&feature.column));
    let contact = arm.contacts.iter().find(|contact| gain(contact).is_some_and(|gain| gain < 0.0))?;
    let message = format!(
        "the column of `{}` increases its error over `{}`: there, `contacts` of the bench says how `{quantity}` answers",
        feature.name, contact.object
    );
    Some(replaced(mode, feature, message, column.map(|entry| -entry)))
}

/// Returns the warning about a column of which the projectors leave only what does not change the feature.
fn blocked(mode: &ModeLaw<'_>, feature: &Feature, row: &Geometry) -> Diagnostic {
    let name = &feature.name;
    let message = format!(
        "{}the projector leaves only {} of the column of `{name}`, which does not change `{name}` in a known direction",
        mode.named(),
        moved(&feature.column)
    );
    let help = format!(
        "select {} in the projector, or let the column of `{name}` move no other component",
        row.components(" or ")
    );
    Diagnostic::new(Code::UnusedColumn, mode.place_of_column(feature), message).help(help)
}

/// Returns the components that a column moves, for a message.
fn moved(column: &[f64; 6]) -> String {
    let moved: Vec<String> = (0..6).filter(|i| column[*i] != 0.0).map(|i| format!("`{}`", COMPONENTS[i])).collect();
    moved.join(" and ")
}

/// Returns the warning about a column that does not change its feature.
fn foreign(mode: &ModeLaw<'_>, feature: &Feature, quantity: &str, column: [f64; 6]) -> Option<Diagnostic> {
    let moved = moved(&feature.column);
    let row = Geometry::of(quantity)?;
    // The feature whose column changes this one, and that this column changes.
    let other = mode.law.features.iter().find_map(|other| {
        let other_column = written(mode, other)?;
        let other_row = Geometry::of(mode.quantity(other)?)?;
        let is_exchanged =
            row.changes(&other_column) && other_row.changes(&column) && !other_row.changes(&other_column);
        is_exchanged.then_some((other, other_column))
    });
    // Behind a mount, the columns that are written are others.
    if let Some((other, other_column)) = other.filter(|_| feature.mount.is_none()) {
        let message = format!(
            "the columns of `{}` and `{}` are exchanged: {moved} does not change `{}`",
            feature.name, other.name, feature.name
        );
        // The second one of the pair would say the same.
        let is_second = mode.place_of_column(other).start < mode.place_of_column(feature).start;
        let (own, others) = (row.signed(other_column), Geometry::of(mode.quantity(other)?)?.signed(column));
        let diagnostic = replaced(mode, feature, message, own);
        let place = mode.place_of_column(other);
        let is_shown = other.moves();
        return (!is_second || !is_shown).then(|| {
            let help = format!(
                "exchange them: `columns.{} = {}` and `columns.{} = {}`",
                feature.name,
                array(&own),
                other.name,
                array(&others)
            );
            let edit = Edit::Replace(place.clone(), array(&others));
            diagnostic.edit(edit).help(help).note(place, "the other column")
        });
    }
    let message = format!(
        "the column of `{}` moves {moved}, which does not change `{quantity}` in a known direction",
        feature.name
    );
    let help = format!("`{quantity}` answers to {}: write the entry there", row.components(" and "));
    Some(Diagnostic::new(Code::WrongColumn, mode.place_of_column(feature), behind(feature) + &message).help(help))
}

/// Returns the warning about a column, with the right one as a fix.
fn replaced(mode: &ModeLaw<'_>, feature: &Feature, message: String, right: [f64; 6]) -> Diagnostic {
    // A column that is written keeps its digits; one that is turned has as many as the pose leaves.
    let right = if feature.mount.is_some() { right.map(to_three_digits) } else { right };
    let (place, right) = (mode.place_of_column(feature), array(&right));
    let diagnostic = Diagnostic::new(Code::WrongColumn, place.clone(), behind(feature) + &message);
    match &feature.mount {
        Some(turner) => diagnostic.help(format!(
            "behind `{turner}`, the column must be {right}: turn the column that is written, or check the pose"
        )),
        None => {
            diagnostic.help(format!("write `columns.{} = {right}`", feature.name)).edit(Edit::Replace(place, right))
        }
    }
}

/// Writes a column as TOML.
fn array(column: &[f64; 6]) -> String {
    let entries = column.map(|entry| format!("{}", entry + 0.0));
    format!("[{}]", entries.join(", "))
}

/// Returns the projectors between a port and what moves the sensor.
fn projectors<'a>(nodes: &Nodes<'a>, port: &str) -> Vec<&'a OutlinedBlock> {
    let Some(node) = nodes.writer(port) else { return Vec::new() };
    let all = |inputs: &[&str]| -> Vec<&'a OutlinedBlock> {
        let ports = inputs.iter().filter_map(|input| source(node, input));
        ports.flat_map(|port| projectors(nodes, port)).collect()
    };
    match node.kind.text.as_str() {
        "twist_adder" => node.wires.iter().flat_map(|wire| projectors(nodes, &wire.source)).collect(),
        "twist_switch" => nodes.sides(node).flat_map(|side| projectors(nodes, side)).collect(),
        // Not through a `twist_delay`, which can close a loop.
        "twist_gate" => all(&["value"]),
        "pivot" | "adjoint" => all(&["twist"]),
        "projector" => [vec![node], all(&["twist"])].concat(),
        _ => Vec::new(),
    }
}

/// Returns the warnings about components that a projector selects and that nothing moves.
fn idle(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Diagnostics {
    projectors(&mode.nodes, &arm.twist).into_iter().flat_map(|projector| idle_axes(arm, mode, projector)).collect()
}

fn idle_axes(arm: &Arm<'_>, mode: &ModeLaw<'_>, projector: &OutlinedBlock) -> Diagnostics {
    let select = mode.nodes.node(&projector.name).and_then(|node| mode.nodes.value(node, "select"));
    let behind = source(projector, "twist").map(|twist| law(&mode.nodes, twist));
    let Some((setting, behind)) = select.zip(behind) else { return Diagnostics::new() };
    let Some(select) = setting.value.read::<[f64; 6]>() else { return Diagnostics::new() };
    // All components: the projector selects nothing.
    let selects_all = select.iter().all(|entry| *entry != 0.0);
    if selects_all || !behind.guidance.is_empty() || behind.features.is_empty() {
        return Diagnostics::new();
    }
    // A component without a motion here may be selected for that of another mode.
    let twist = source(projector, "twist").unwrap_or_default();
    let laws: Vec<Law> = arm.modes.iter().map(|mode| law(&mode.nodes, twist)).collect();
    let is_driven = |i: usize| laws.iter().flat_map(|law| &law.constants).any(|constant| constant.twist[i] != 0.0);
    let columns = || laws.iter().flat_map(|law| &law.features).map(|feature| &feature.column);
    let is_idle = |i: &usize| select[*i] != 0.0 && columns().all(|column| column[*i] == 0.0) && !is_driven(*i);
    let jacobians: BTreeSet<&str> = behind.features.iter().map(|feature| &*feature.jacobian).collect();
    let jacobians: Vec<String> = jacobians.into_iter().map(|name| format!("`{name}`")).collect();
    let report = |i: usize| {
        let name = COMPONENTS[i];
        let entry = match &setting.value.item {
            Item::Array(entries) => entries.get(i),
            _ => None,
        };
        let place = entry.map_or_else(|| setting.value.span.clone(), |entry| entry.span.clone());
        let (projector, jacobians) = (&projector.name, jacobians.join(" and "));
        let message = format!("`{projector}` selects `{name}`, but no column of {jacobians} moves it");
        let help = format!("write 0 for `{name}`, or add an entry to the column of the feature that it should control");
        let diagnostic = Diagnostic::new(Code::IdleAxis, place.clone(), message).help(help);
        match entry {
            Some(_) => diagnostic.edit(Edit::Replace(place, "0".into())),
            None => diagnostic,
        }
    };
    (0..6).filter(is_idle).map(report).collect()
}

/// Returns the warnings about columns that no mode uses, although their features have gains.
fn unused(arm: &Arm<'_>) -> Diagnostics {
    let Some(first) = arm.modes.first() else { return Diagnostics::new() };
    // Several nodes can turn the same control into motion.
    let controls = |wanted: &Feature| {
        let mut features = arm.modes.iter().flat_map(|mode| &mode.law.features);
        features.any(|feature| feature.name == wanted.name && feature.pid == wanted.pid && feature.moves())
    };
    let is_selected = |wanted: &Feature| {
        let mut features = arm.modes.iter().flat_map(|mode| &mode.law.features);
        features.any(|one| one.name == wanted.name && one.pid == wanted.pid && one.column != [0.0; 6])
    };
    let features = first.law.features.iter().filter(|feature| feature.has_gain());
    let dead = features.filter(|feature| !controls(feature) && !is_along_line(arm, feature));
    let found = dead.filter_map(|feature| {
        let column = first.column(feature)?;
        // Of the components of the column, those that change the feature.
        let row = first.quantity(feature).and_then(Geometry::of).filter(|row| row.changes(&column));
        let answers = row.map(|row| row.components(" or "));
        let (message, help) = match column == [0.0; 6] {
            true => (
                format!("the column of `{}` is zero, so its gains do nothing", feature.name),
                "write how the sensor should move for it, or remove the feature".to_owned(),
            ),
            false if is_selected(feature) => (
                format!(
                    "`{0}` has gains only where no component of its column is selected: they do nothing",
                    feature.name
                ),
                format!("give `{}` a gain in a mode that selects its column, or remove the feature", feature.name),
            ),
            false => (
                format!("no mode selects a component of the column of `{}`, so its gains do nothing", feature.name),
                format!(
                    "select {} in a projector, {}",
                    answers.unwrap_or_else(|| moved(&column)),
                    without(arm, feature)
                ),
            ),
        };
        Some(Diagnostic::new(Code::UnusedColumn, first.place_of_column(feature), message).help(help))
    });
    found.collect()
}

/// Returns how to do without the gains of a feature.
fn without(arm: &Arm<'_>, feature: &Feature) -> String {
    match is_watched(arm, feature) {
        true => {
            format!("or measure the error of `{}` in a `feature_error` of its own, which no `pid` reads", feature.name)
        }
        false => "or remove the feature".into(),
    }
}

/// Returns whether an exit of a mode waits for the error of a feature.
fn is_watched(arm: &Arm<'_>, feature: &Feature) -> bool {
    let Some(error) = feature.compared.as_ref().map(|node| format!("{node}.error.{}", feature.name)) else {
        return false;
    };
    let exits = arm.modes.iter().flat_map(ModeLaw::conditions);
    exits.filter_map(Exit::when).any(|port| error.ends_with(port))
}

/// Returns whether a feature is the position along a line whose direction the task controls. Such a position has no
/// meaning where the line is longer than the pad, and a task is right to leave it out.
fn is_along_line(arm: &Arm<'_>, feature: &Feature) -> bool {
    let is_along = |mode: &ModeLaw<'_>| line_axis(mode).is_some_and(|axis| mode.quantity(feature) == Some(axis));
    arm.modes.iter().any(is_along)
}
