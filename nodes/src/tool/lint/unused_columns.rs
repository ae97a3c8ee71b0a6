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
    let features = first.law.features.iter().filter(|feature| feature.has_gain() && !is_along_line(arm, feature));
    let found = features.filter_map(|feature| {
        let (message, help) = unused(arm, first, feature)?;
        Some(Diagnostic::new(Code::UnusedColumn, first.place_of_column(feature), message).help(help))
    });
    found.collect()
}

/// Returns why the column of a feature does nothing, and what to write; `None` if a mode uses it.
fn unused(arm: &Arm<'_>, first: &ModeLaw<'_>, feature: &Feature) -> Option<(String, String)> {
    let (name, column) = (&feature.name, first.column(feature)?);
    // What to select: the components that change the feature, if its column has one of them.
    let geometry = first.quantity(feature).and_then(Geometry::of).filter(|geometry| geometry.changes(&column));
    let components = geometry.map_or_else(|| moved(&column), |geometry| geometry.components(" or "));
    // Several nodes can turn the same control into motion.
    let each = || arm.modes.iter().flat_map(|mode| mode.law.features.iter().map(move |one| (mode, one)));
    if let Some((mode, _)) = each().find(|(_, one)| one.has_gains_of(feature) && one.moves()) {
        let mut same =
            each().filter(|(_, one)| one.moves() && (one.has_gains_of(feature) || one.measured == feature.measured));
        return same.all(|(mode, one)| ends_at_touch(arm, mode, one)).then(|| {
            (
                format!(
                    "only modes that end at the first touch select the column of `{name}`, such as `{}`: its gains do nothing",
                    mode.own_name()
                ),
                format!("select {components} in a mode that has a contact, {}", without(arm, feature)),
            )
        });
    }
    Some(if column == [0.0; 6] {
        (
            format!("the column of `{name}` is zero, so its gains do nothing"),
            "write how the sensor should move for it, or remove the feature".to_owned(),
        )
    } else if each().any(|(_, one)| one.has_gains_of(feature) && one.column != [0.0; 6]) {
        (
            format!("`{name}` has gains only where no component of its column is selected: they do nothing"),
            format!("give `{name}` a gain in a mode that selects its column, or remove the feature"),
        )
    } else {
        (
            format!("no mode selects a component of the column of `{name}`, so its gains do nothing"),
            format!("select {components} in a projector, {}", without(arm, feature)),
        )
    })
}

/// Time after the first touch in which a feature moves the sensor by nothing that counts [ms].
const TOUCH_MS: f64 = 50.0;

/// Returns whether a mode waits for the contact that a feature measures, and ends there: until then the feature is absent. A
/// mode that can lose the contact has begun with one. A `contact_debounce` may say later that there is a contact.
fn ends_at_touch(arm: &Arm<'_>, mode: &ModeLaw<'_>, feature: &Feature) -> bool {
    let is_of_it = |port: &str| {
        let port = arm.port(port);
        let inside = port.rsplit_once('.').and_then(|(part, _)| feature.measured.as_deref()?.strip_prefix(part));
        inside.is_some_and(|rest| rest.starts_with('.'))
    };
    let is_first = |exit: Exit<'_>| {
        exit.is_found() && exit.when().is_some_and(is_of_it) && exit.number("for_ms").unwrap_or(0.0) <= TOUCH_MS
    };
    let is_late = arm.outline.nodes.iter().any(|node| node.kind.text == "contact_debounce");
    let has_begun = mode.lost().next().is_some();
    mode.quantity(feature).is_some() && !is_late && !has_begun && mode.conditions().any(is_first)
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
