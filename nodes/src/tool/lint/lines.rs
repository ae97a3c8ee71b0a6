//! Lines: the angle at which a mode holds one, and positions that are controlled along it.

use std::f64::consts::{FRAC_PI_2, PI};
use std::fmt;

use nalgebra::Vector3;
use tactflow_runtime::source::{Code, Diagnostic, Diagnostics, Table, Value};

use super::arm::Arm;
use super::geometry::is_force;
use super::guides::{follows_line, rests};
use super::mode_law::ModeLaw;
use crate::motion::pose::pose_of;
use crate::tool::control::law::{Feature, Guidance};

/// Largest angle between a line and an axis of the sensor along which the line lies [rad].
const ALONG: f64 = 0.35;
/// Largest part of an axis along z of the sensor with which it lies in the plane of the pad [1].
const LYING: f64 = 0.5;
/// Time in which the control of a position moves the sensor noticeably along a line [ms].
const LONG_MS: f64 = 5000.0;

pub(super) fn check(arm: &Arm<'_>) -> Diagnostics {
    arm.modes.iter().filter_map(|mode| along_line(arm, mode).or_else(|| over_line(arm, mode))).collect()
}

/// Returns the warning about both positions over a pen or a cable that the bench states to be longer than the pad, where
/// nothing holds its angle: at least one of them lies along it.
fn over_line(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    let is_free = !mode.moving().any(|one| mode.quantity(one) == Some("orientation"));
    // How hard the sensor presses says nothing about whether the contact is centred.
    let is_press = |when: &str| arm.watched(mode, when).is_some_and(|quantity| is_force(&quantity));
    let mut exits = mode.conditions();
    let lasts = exits.all(|exit| exit.is_lost() || exit.waits() >= LONG_MS || exit.when().is_some_and(is_press));
    let fails_early = mode.fails().any(|exit| (1.0..LONG_MS).contains(&exit.waits()));
    if !is_free || !lasts || fails_early || !arm.objects().all(is_thin) {
        return None;
    }
    let [x, y] = [held(mode, 0)?, held(mode, 1)?];
    // The line may lie along the diagonal of the pad.
    let [width, height] = [x, y].map(|feature| mode.range(feature).map(|[from, to]| to - from));
    let diagonal = libm::hypot(width?, height?);
    let Line { shape, length, .. } = shortest_line(arm, mode, y).filter(|line| line.length > diagonal)?;
    let [length, diagonal] = [length, diagonal].map(|length| (length * 1e3).round());
    let message = format!(
        "{}`{}` and `{}` are controlled over the {shape} of {length} mm, which is longer than the {diagonal} mm of the \
         diagonal over which the pad measures places: the middle of a long print says nothing about a position along it",
        mode.prefix(),
        x.name,
        y.name
    );
    let help = "control the angle of the line too, and the position across it only";
    Some(Diagnostic::new(Code::LinePosition, mode.place_of_column(y), message).help(help))
}

/// Returns whether an object is a line, whichever side of it is touched.
fn is_thin(object: &Table) -> bool {
    object.get("shape").and_then(Value::as_str).is_some_and(|shape| ["pen", "cable"].contains(&shape))
}

/// Returns the feature that holds the position along an axis: 0 is x, and 1 is y.
fn held<'m>(mode: &'m ModeLaw<'_>, i: usize) -> Option<&'m Feature> {
    let axis = ["x", "y"][i];
    mode.moving().find(|feature| mode.quantity(feature) == Some(axis) && feature.column[i] != 0.0)
}

/// Returns the warning about a position that a mode controls along a line, while it moves the sensor along this line, or
/// while the bench states that the line is longer than the pad.
///
/// A task that follows a line moves along it. Where the line is longer than the pad, the middle of its print is that of
/// the pad, and where it ends, the control of the position works against the motion.
fn along_line(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> Option<Diagnostic> {
    let positions = line_positions(mode);
    let along = |moves: &dyn Fn(usize) -> bool| {
        let mut axes = positions.iter().map(|axis| usize::from(*axis == "y"));
        !positions.is_empty() && axes.all(moves)
    };
    let mut constants = mode.law.constants.iter().filter(|constant| along(&|i| constant.twist[i] != 0.0));
    let is_guide = |guide: &&Guidance| follows_line(guide) && !rests(&mode.nodes, guide) && along(&|i| guide.passes[i]);
    let guide = || mode.law.guidance.iter().find(is_guide).map(Guidance::node);
    let first = usize::from(*positions.first()? == "y");
    let feature = held(mode, first).filter(|_| along(&|i| held(mode, i).is_some()))?;
    let stated = shortest_line(arm, mode, feature);
    let why = match constants.next().map(|constant| &*constant.node).or_else(guide) {
        Some(follower) if stated.as_ref().is_none_or(Line::is_longer) => format!("the line that `{follower}` follows"),
        // Without a follower, the control of the position itself moves slowly along the line. This matters in a mode
        // that lasts.
        _ if !mode.lasts_for(LONG_MS) => return None,
        _ => stated.filter(Line::is_longer)?.to_string(),
    };
    let message = format!(
        "{}`{}` is controlled along {why}: the middle of a long print says nothing about a position along it",
        mode.prefix(),
        feature.name
    );
    let help = match positions[..] {
        ["x", "y"] => {
            "let the setpoint of the angle turn the line along `x` or `y`, and control the position across it only"
                .to_owned()
        }
        [axis, ..] => format!("select 0 for `v{axis}` in the projector behind the column of `{}`", feature.name),
        [] => return None,
    };
    Some(Diagnostic::new(Code::LinePosition, mode.place_of_column(feature), message).help(help))
}

/// Returns the position along the line that a mode holds at an angle, `x` or `y`; `None` without a line, or if it lies
/// along neither axis.
pub(super) fn line_axis(mode: &ModeLaw<'_>) -> Option<&'static str> {
    match line_positions(mode)[..] {
        [axis] => Some(axis),
        _ => None,
    }
}

/// Returns the positions that change along the line that a mode holds at an angle: both, if it lies along neither axis,
/// and none without a line.
fn line_positions(mode: &ModeLaw<'_>) -> Vec<&'static str> {
    let Some(angle) = line_angle(mode) else { return Vec::new() };
    match angle.rem_euclid(PI) {
        angle if (angle - FRAC_PI_2).abs() < ALONG => vec!["y"],
        angle if !(ALONG..=PI - ALONG).contains(&angle) => vec!["x"],
        _ => vec!["x", "y"],
    }
}

/// Returns the angle at which a mode holds a line [rad].
pub(super) fn line_angle(mode: &ModeLaw<'_>) -> Option<f64> {
    let mut lines = mode.moving().filter(|feature| mode.quantity(feature) == Some("orientation"));
    lines.find_map(|feature| feature.setpoint)
}

/// A line among the objects of a simulated bench.
struct Line<'a> {
    shape: &'a str,
    /// Its length and that of the pad [m].
    length: f64,
    pad: f64,
}

impl Line<'_> {
    fn is_longer(&self) -> bool {
        self.length > self.pad
    }
}

impl fmt::Display for Line<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [length, pad] = [self.length, self.pad].map(|length| (length * 1e3).round());
        write!(f, "the {} of {length} mm, where the pad measures places over {pad} mm", self.shape)
    }
}

/// Returns the shortest line that a simulated bench states, on a pad that measures a place: any of them may be touched.
fn shortest_line<'a>(arm: &Arm<'a>, mode: &ModeLaw<'_>, feature: &Feature) -> Option<Line<'a>> {
    let [from, to] = mode.range(feature)?;
    let lines = arm.objects().filter_map(line);
    let (shape, length) = lines.min_by(|(_, one), (_, other)| one.total_cmp(other))?;
    Some(Line { shape, length, pad: to - from })
}

/// Returns the shape and the length [m] of an object whose print is a line or the face of a box, as far as it lies in the
/// plane of the pad.
fn line(object: &Table) -> Option<(&str, f64)> {
    let shape = object.get("shape")?.as_str()?;
    let turn = object.get("turn").and_then(Value::read).unwrap_or_default();
    let rotation = pose_of([0.0; 3], turn).rotation;
    let lies = |axis: usize| (rotation * Vector3::ith(axis, 1.0)).z.abs() < LYING;
    let length = match shape {
        "pen" => object.get("length")?.read().filter(|_| lies(1))?,
        "box" => {
            let size: [f64; 3] = object.get("size")?.read()?;
            (0..3).filter(|axis| lies(*axis)).map(|axis| size[axis]).fold(0.0, f64::max)
        }
        "cable" => {
            let points: Vec<[f64; 3]> = object.get("points")?.read()?;
            let steps = points.windows(2).map(|pair| (0..3).map(|i| (pair[1][i] - pair[0][i]).powi(2)).sum::<f64>());
            steps.map(f64::sqrt).sum()
        }
        _ => return None,
    };
    Some((shape, length))
}
