//! Columns that increase an error, or that change another feature.

use std::f64::consts::FRAC_PI_2;

use nalgebra::Vector6;
use tactflow_runtime::source::{Code, Diagnostic, Diagnostics, Edit};

use super::arm::Arm;
use super::geometry::{Confusion, Geometry, KnownSign, moved};
use super::lines::line_angle;
use super::mode_law::ModeLaw;
use crate::motion::COMPONENTS;
use crate::motion::axis::wrap_axial;
use crate::tool::control::contacts::Contact;
use crate::tool::control::digits::to_three_digits;
use crate::tool::control::law::Feature;

/// Part of its largest answer with which a feature answers a column at least, if the bench states that it does [1].
const MOST: f64 = 0.5;
/// Largest radius of an object that a pad rolls on [m].
const LARGEST_RADIUS: f64 = 0.1;

/// Returns the warnings about the columns of a mode.
pub(super) fn check(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Diagnostics {
    mode.moving().filter_map(|feature| wrong(arm, mode, feature)).collect()
}

/// Returns the warning about a column that increases the error of its feature, or that does not change the feature.
fn wrong(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let known = mode.quantity(feature).and_then(|quantity| Some((quantity, Geometry::of(quantity)?)));
    let Some((quantity, geometry)) = known else {
        return reversed(arm, mode, feature).or_else(|| offset(arm, mode, feature));
    };
    let column = judged_column(mode, feature)?;
    let judged = JudgedColumn { arm, mode, feature, quantity, geometry, column };
    let (changes, is_selected) = (geometry.changes(&column), geometry.changes(&feature.column));
    match (changes && is_selected, geometry.is_needed) {
        (true, _) => judged.aside().or_else(|| judged.against()).or_else(|| reversed(arm, mode, feature)),
        (false, false) => reversed(arm, mode, feature),
        // What the bench says about this object counts more than geometry.
        (false, true) if judged.is_stated() => reversed(arm, mode, feature),
        (false, true) if changes => Some(judged.blocked()),
        (false, true) => judged.foreign(),
    }
}

/// Returns the column of a feature as it is written, before all projectors. Where a mount turns it, returns what
/// reaches the arm.
fn judged_column(mode: &ModeLaw<'_>, feature: &Feature) -> Option<[f64; 6]> {
    if feature.turn.is_some() { Some(feature.column) } else { mode.column(feature) }
}

/// A column, and what geometry says of its feature.
struct JudgedColumn<'a> {
    arm: &'a Arm<'a>,
    mode: &'a ModeLaw<'a>,
    feature: &'a Feature,
    quantity: &'a str,
    geometry: Geometry,
    /// As [`judged_column`] returns it.
    column: [f64; 6],
}

impl JudgedColumn<'_> {
    /// Returns the warning about a column that slides or rolls a contact more along the other axis than along its own,
    /// or that slides it more than it presses. With two such columns the contact circles around its setpoint, or runs
    /// away from it.
    fn aside(&self) -> Option<Diagnostic> {
        let Self { feature, quantity, .. } = self;
        let answers = || self.arm.contacts.iter().filter_map(|contact| contact.features.get(*quantity));
        let is_aside = |Confusion { own, other }: &&Confusion| {
            // A bench that states an answer to the other component knows more.
            let is_stated = answers().any(|answer| answer.row()[*other] != 0.0);
            !is_stated && feature.column[*other].abs() > feature.column[*own].abs()
        };
        let Confusion { own, other } = *self.geometry.confused.iter().find(is_aside)?;
        let right = self.straightened()?;
        let message = format!(
            "the column of `{}` moves the sensor more with `{}`, which does not change `{quantity}`, than with `{}`, \
             which does",
            feature.name, COMPONENTS[other], COMPONENTS[own]
        );
        Some(replaced(self.mode, feature, message, right))
    }

    /// Returns the column that moves with the components of the feature alone, as much as this one moves with those beside
    /// them too.
    fn straightened(&self) -> Option<[f64; 6]> {
        if self.feature.turn.is_some() {
            return self.wanted();
        }
        let mut right = self.column;
        for Confusion { own, other } in self.geometry.confused {
            let sign = self.geometry.sign(*own)?;
            let size = if *own == 2 { right[*own].abs() } else { right[*own].hypot(right[*other]) };
            (right[*own], right[*other]) = (sign * to_three_digits(size), 0.0);
        }
        Some(right)
    }

    /// Returns the column that moves with the components of the feature alone, as far as the written one slides and turns.
    fn wanted(&self) -> Option<[f64; 6]> {
        let written = self.mode.column(self.feature)?;
        let length = |first: usize| written[first].hypot(written[first + 1]).hypot(written[first + 2]);
        let lengths = [0, 3].map(|first| to_three_digits(length(first)));
        let sign = |i: usize| self.geometry.sign(i).unwrap_or_default();
        Some(std::array::from_fn(|i| sign(i) * lengths[i / 3]))
    }

    /// Returns the warning about a column that increases the error of its feature, by geometry.
    fn against(&self) -> Option<Diagnostic> {
        let Self { feature, quantity, column, .. } = self;
        let is_reversed = |known: &&KnownSign| {
            // What the bench says about this object counts more than geometry.
            let said = self.arm.contacts.iter().filter_map(|contact| contact.features.get(*quantity));
            let is_said = said.map(|answer| answer.row()).any(|row| row[known.component] * known.sign < 0.0);
            feature.column[known.component] * known.sign < 0.0 && !is_said && !self.is_outweighed(known)
        };
        let first = self.geometry.known.iter().find(is_reversed)?;
        // The entries that no projector selects get their signs too.
        let right = if feature.turn.is_some() { self.wanted()? } else { self.geometry.signed(*column) };
        let message = format!(
            "the column of `{}` increases its error: `{}` is {}, but {}",
            feature.name,
            COMPONENTS[first.component],
            to_three_digits(column[first.component]),
            first.reason
        );
        Some(replaced(self.mode, feature, message, right))
    }

    /// Returns whether the column rolls the sensor the wrong way, but less than it slides the right way on any object.
    fn is_outweighed(&self, known: &KnownSign) -> bool {
        let column = &self.feature.column;
        let rolls = known.component > 2;
        let slides = self.geometry.known.iter().filter(|other| other.component < 3);
        rolls
            && slides.map(|other| column[other.component] * other.sign).sum::<f64>()
                > column[known.component].abs() * LARGEST_RADIUS
    }

    /// Returns whether the bench states that the feature answers this column over each contact, and no other motion much
    /// more.
    fn is_stated(&self) -> bool {
        let largest = |row: &[f64; 6]| row.iter().fold(0.0_f64, |most, entry| most.max(entry.abs()));
        let column = &self.feature.column;
        let answers = |contact: &Contact| {
            contact.features.get(self.quantity).is_some_and(|answer| {
                let change = answer.along(column).abs();
                change > 0.0 && change >= MOST * largest(&answer.row()) * largest(column)
            })
        };
        !self.arm.contacts.is_empty() && self.arm.contacts.iter().all(answers)
    }

    /// Returns the warning about a column of which the projectors leave only what does not change the feature.
    fn blocked(&self) -> Diagnostic {
        let Self { mode, feature, .. } = self;
        let name = &feature.name;
        let message = format!(
            "{}the projector leaves only {} of the column of `{name}`, which does not change `{name}` in a known direction",
            mode.prefix(),
            moved(&feature.column)
        );
        let help = format!(
            "select {} in the projector, or let the column of `{name}` move no other component",
            self.geometry.components(" or ")
        );
        Diagnostic::new(Code::UnusedColumn, mode.place_of_column(feature), message).help(help)
    }

    /// Returns the warning about a column that does not change its feature.
    fn foreign(&self) -> Option<Diagnostic> {
        let Self { mode, feature, quantity, geometry, .. } = self;
        // Behind a mount, the columns that are written are others.
        if let Some(other) = self.exchanged().filter(|_| feature.turn.is_none()) {
            return self.exchange(&other);
        }
        let message = format!(
            "the column of `{}` moves {}, which does not change `{quantity}` in a known direction",
            feature.name,
            moved(&feature.column)
        );
        if let Some(right) = self.wanted().filter(|right| feature.turn.is_some() && geometry.changes(right)) {
            return Some(replaced(mode, feature, message, right));
        }
        let help = format!("`{quantity}` answers to {}: write the entry there", geometry.components(" and "));
        let place = mode.place_of_column(feature);
        Some(Diagnostic::new(Code::WrongColumn, place, behind(feature) + &message).help(help))
    }

    /// Returns the feature whose column changes this one, and that this column changes.
    fn exchanged(&self) -> Option<Other<'_>> {
        self.mode.law.features.iter().find_map(|feature| {
            let column = judged_column(self.mode, feature)?;
            let geometry = Geometry::of(self.mode.quantity(feature)?)?;
            let is_exchanged =
                self.geometry.changes(&column) && geometry.changes(&self.column) && !geometry.changes(&column);
            is_exchanged.then_some(Other { feature, geometry, column })
        })
    }

    /// Returns the warning about two columns that are exchanged; `None` for the second one of the pair, whose warning
    /// would be the same.
    fn exchange(&self, other: &Other<'_>) -> Option<Diagnostic> {
        let Self { mode, feature, .. } = self;
        let (name, other_name) = (&feature.name, &other.feature.name);
        let place = mode.place_of_column(other.feature);
        if place.start < mode.place_of_column(feature).start && other.feature.moves() {
            return None;
        }
        let message = format!(
            "the columns of `{name}` and `{other_name}` are exchanged: {} does not change `{name}`",
            moved(&feature.column)
        );
        let (own, others) = (self.geometry.signed(other.column), other.geometry.signed(self.column));
        let diagnostic = replaced(mode, feature, message, own);
        let [own, others] = [&own, &others].map(array);
        let help = format!("exchange them: `columns.{name} = {own}` and `columns.{other_name} = {others}`");
        let edit = Edit::Replace(place.clone(), others);
        Some(diagnostic.edit(edit).help(help).note(place, "the other column"))
    }
}

/// Another column, and what geometry says of its feature.
struct Other<'a> {
    feature: &'a Feature,
    geometry: Geometry,
    column: [f64; 6],
}

/// Returns the warning about a column that increases the error of a feature of which only the bench says how it answers.
fn reversed(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Diagnostic> {
    let quantity = feature.quantity()?;
    let column = judged_column(mode, feature)?;
    let gain = |contact: &&Contact| Some(contact.features.get(quantity)?.along(&feature.column));
    let contact = arm.contacts.iter().find(|contact| gain(contact).is_some_and(|gain| gain < 0.0))?;
    let message = format!(
        "the column of `{}` increases its error over `{}`: there, `contacts` of the bench says how `{quantity}` answers",
        feature.name, contact.object
    );
    Some(replaced(mode, feature, message, column.map(|entry| -entry)))
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
    let column = judged_column(mode, feature)?;
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

/// Returns the start of a message about a column that a mount turns.
fn behind(feature: &Feature) -> String {
    feature.turn.as_ref().map(|turn| format!("behind `{}`, ", turn.node)).unwrap_or_default()
}

/// Returns the warning about a column, with the right one as a fix. Behind a mount, the right one is what has to reach the
/// arm.
fn replaced(mode: &ModeLaw<'_>, feature: &Feature, message: String, right: [f64; 6]) -> Diagnostic {
    let (place, name) = (mode.place_of_column(feature), &feature.name);
    let diagnostic = Diagnostic::new(Code::WrongColumn, place.clone(), behind(feature) + &message);
    let Some(turn) = &feature.turn else {
        let right = array(&right);
        return diagnostic.help(format!("write `columns.{name} = {right}`")).edit(Edit::Replace(place, right));
    };
    let written = turn.written(right).map(|column| column.map(to_three_digits));
    let node = &turn.node;
    match written.filter(|written| arrives(feature, *written, right)).as_ref().map(array) {
        Some(written) => diagnostic
            .help(format!("write `columns.{name} = {written}`: `{node}` turns it. Or check the pose that `{node}` reads"))
            .edit(Edit::Replace(place, written)),
        None => diagnostic.help(format!(
            "behind `{node}`, the column must be {}: check the pose that `{node}` reads, and what the projectors before it select",
            array(&right.map(to_three_digits))
        )),
    }
}

/// Difference of two columns that are the same, as a share of their largest entry of the same unit [1].
const SAME: f64 = 5e-3;

/// Returns whether a column, as it is written, moves the arm as wanted in all components that the projectors let pass.
fn arrives(feature: &Feature, written: [f64; 6], wanted: [f64; 6]) -> bool {
    let arrived = feature.way * Vector6::from(written);
    let most = |i: usize| wanted[i / 3 * 3..i / 3 * 3 + 3].iter().fold(0.0_f64, |most, entry| most.max(entry.abs()));
    let is_open = |i: usize| feature.way.row(i).iter().any(|entry| *entry != 0.0);
    let is_same = |i: usize| (arrived[i] - wanted[i]).abs() <= SAME * most(i);
    (0..6).all(|i| !is_open(i) || is_same(i)) && (0..6).any(|i| is_open(i) && wanted[i] != 0.0)
}

/// Writes a column as TOML.
fn array(column: &[f64; 6]) -> String {
    let entries = column.map(|entry| format!("{}", entry + 0.0));
    format!("[{}]", entries.join(", "))
}
