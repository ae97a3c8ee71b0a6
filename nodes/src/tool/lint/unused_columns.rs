//! Columns that no mode uses, although their features have gains.

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics};

use super::arm::Arm;
use super::geometry::{Geometry, moved};
use super::lines::line_axis;
use super::mode_law::ModeLaw;
use crate::tool::control::exits::Exit;
use crate::tool::control::law::Feature;

/// Returns the warnings about columns that no mode uses, although their features have gains.
pub(super) fn check(arm: &Arm<'_>) -> Diagnostics {
    let Some(first) = arm.modes.first() else { return Diagnostics::new() };
    // Several nodes can turn the same control into motion.
    let moved_in = |wanted: &Feature| {
        let moves = |mode: &&ModeLaw<'_>| {
            mode.law.features.iter().any(|feature| feature.has_gains_of(wanted) && feature.moves())
        };
        arm.modes.iter().find(moves)
    };
    let controls = |wanted: &Feature| moved_in(wanted).is_some() && !is_before_touch(arm, wanted);
    let is_selected = |wanted: &Feature| {
        let mut features = arm.modes.iter().flat_map(|mode| &mode.law.features);
        features.any(|one| one.has_gains_of(wanted) && one.column != [0.0; 6])
    };
    let features = first.law.features.iter().filter(|feature| feature.has_gain());
    let dead = features.filter(|feature| !controls(feature) && !is_along_line(arm, feature));
    let found = dead.filter_map(|feature| {
        let column = first.column(feature)?;
        // What to select: the components that change the feature, if its column has one of them.
        let geometry = first.quantity(feature).and_then(Geometry::of).filter(|geometry| geometry.changes(&column));
        let components = geometry.map(|geometry| geometry.components(" or "));
        let (message, help) = match moved_in(feature) {
            Some(mode) => (
                format!(
                    "the column of `{}` is selected only in mode `{}`, which ends at the first touch: its gains do nothing",
                    feature.name,
                    mode.own_name()
                ),
                format!(
                    "select {} in a mode that has a contact, {}",
                    components.unwrap_or_else(|| moved(&column)),
                    without(arm, feature)
                ),
            ),
            None if column == [0.0; 6] => (
                format!("the column of `{}` is zero, so its gains do nothing", feature.name),
                "write how the sensor should move for it, or remove the feature".to_owned(),
            ),
            None if is_selected(feature) => (
                format!(
                    "`{0}` has gains only where no component of its column is selected: they do nothing",
                    feature.name
                ),
                format!("give `{}` a gain in a mode that selects its column, or remove the feature", feature.name),
            ),
            None => (
                format!("no mode selects a component of the column of `{}`, so its gains do nothing", feature.name),
                format!(
                    "select {} in a projector, {}",
                    components.unwrap_or_else(|| moved(&column)),
                    without(arm, feature)
                ),
            ),
        };
        Some(Diagnostic::new(Code::UnusedColumn, first.place_of_column(feature), message).help(help))
    });
    found.collect()
}

/// Time for which a mode goes on after the first touch, and in which a feature moves the sensor by nothing that counts [ms].
const TOUCH_MS: f64 = 200.0;

/// Returns whether all modes in which what a feature measures moves the sensor end at the first touch.
fn is_before_touch(arm: &Arm<'_>, feature: &Feature) -> bool {
    let moves =
        |mode: &&ModeLaw<'_>| mode.law.features.iter().any(|other| other.measured == feature.measured && other.moves());
    arm.modes.iter().filter(moves).all(|mode| ends_at_touch(mode, feature))
}

/// Returns whether a mode waits for the contact that a feature measures, and ends there: until then the feature is absent.
fn ends_at_touch(mode: &ModeLaw<'_>, feature: &Feature) -> bool {
    let is_of_it = |port: &str| {
        let part = port.rsplit_once('.').map(|(part, _)| part);
        let measured = feature.measured.as_deref();
        part.zip(measured).is_some_and(|(part, measured)| measured.starts_with(&format!("{part}.")))
    };
    mode.exits("go").any(|exit| {
        exit.is_found() && exit.when().is_some_and(is_of_it) && exit.number("for_ms").unwrap_or(0.0) <= TOUCH_MS
    })
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
    let exits = arm.modes.iter().flat_map(ModeLaw::conditions);
    exits.filter_map(Exit::when).any(|port| feature.is_error(port))
}

/// Returns whether a feature is the position along a line whose direction the task controls. Such a position has no
/// meaning where the line is longer than the pad, and a task is right to leave it out.
fn is_along_line(arm: &Arm<'_>, feature: &Feature) -> bool {
    let is_along = |mode: &ModeLaw<'_>| line_axis(mode).is_some_and(|axis| mode.quantity(feature) == Some(axis));
    arm.modes.iter().any(is_along)
}
