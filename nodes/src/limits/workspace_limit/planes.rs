//! Keep-out planes: the sensor's origin p stays where n·p >= d. n is a unit vector in the base that points to the free
//! side, and d is the distance of the plane from the base's origin along n.

use nalgebra::{Matrix3, Vector3};
use tactflow_runtime::node::{At, Bounds, Contents, Mistake, Mistakes, Param, Reader, Spanned, Written, refuse_any};
use tactflow_runtime::signal::Unit;
use tactflow_runtime::source::{Code, Item, Value};

use crate::motion::bounds::scale_within;
use crate::motion::braking::stopping_speed;
use crate::usual::{USUAL_REACH_M, unusual};

/// Maximum number of planes, since each of them costs time in every tick [1].
const MAX_PLANES: usize = 32;
/// Maximum difference of the length of a normal from 1, for rows that are rounded [1].
const MAX_LENGTH_ERROR: f64 = 1e-3;
/// Room that the help of a warning leaves between a start and a plane [m].
const START_ROOM_M: f64 = 0.05;
/// Distance by which a corner of the room may violate a bound through rounding [m].
const ROUNDING_M: f64 = 1e-9;

/// The rows `[nx, ny, nz, d]` of the parameter.
#[derive(Debug, Clone, Default)]
pub(super) struct Rows(Vec<Spanned<[f64; 4]>>);

impl Param for Rows {
    const EXPECTS: &'static str = "a list of planes";
    const CONTENTS: Contents = <Vec<Spanned<[f64; 4]>> as Param>::CONTENTS;

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let is_flat = matches!(&value.item, Item::Array(items) if items.first().is_some_and(is_no_list));
        if !is_flat {
            return Vec::read(value, reader).map(Self);
        }
        let row: [f64; 4] = Param::read(value, reader)?;
        let mistake =
            Mistake::new(Code::BadValue, At::Span(value.span.clone()), "expected a list of planes, found one");
        reader.mistakes.push(mistake.help(format!("write `[{row:?}]`")));
        None
    }

    fn takes(bounds: Option<&Bounds>) -> String {
        <Vec<[f64; 4]> as Param>::takes(bounds)
    }

    fn written(&self) -> Option<Written> {
        self.0.written()
    }
}

const fn is_no_list(value: &Value) -> bool {
    !matches!(value.item, Item::Array(_))
}

/// A half-space of the base in which the sensor's origin stays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plane {
    /// Unit vector that points to the free side.
    pub normal: Vector3<f64>,
    /// Coordinate of the plane along the normal [m].
    pub distance: f64,
}

impl Plane {
    /// Returns how far a point is on the free side; negative behind the plane [m].
    #[must_use]
    pub fn room(&self, point: &Vector3<f64>) -> f64 {
        self.normal.dot(point) - self.distance
    }

    /// Returns the row of the parameter.
    #[must_use]
    pub fn row(&self) -> [f64; 4] {
        [self.normal.x, self.normal.y, self.normal.z, self.distance]
    }
}

/// Returns the planes of some rows.
///
/// # Errors
/// More planes than a tick has time for, and each normal whose length is not 1.
pub(super) fn planes(rows: &Rows) -> Result<Box<[Plane]>, Mistakes> {
    if rows.0.len() > MAX_PLANES {
        let message = format!("there are {} planes, but at most {MAX_PLANES} are possible", rows.0.len());
        return Err(Mistake::param("keep_out", message).help("keep those that the sensor can reach").into());
    }
    let (planes, mistakes): (Vec<_>, Vec<_>) = rows.0.iter().map(plane).partition(Result::is_ok);
    refuse_any(mistakes.into_iter().filter_map(Result::err))?;
    Ok(planes.into_iter().flatten().collect())
}

fn plane(row: &Spanned<[f64; 4]>) -> Result<Plane, Mistake> {
    let [x, y, z, distance] = row.value;
    let normal = Vector3::new(x, y, z);
    let length = normal.norm();
    if (length - 1.0).abs() <= MAX_LENGTH_ERROR {
        // The same plane, with a normal of length 1 to the last bit.
        return Ok(Plane { normal: normal / length, distance: distance / length });
    }
    let message = format!("the normal {:?} of a plane has the length {}, not 1", [x, y, z], rounded(length));
    let help = if length > 0.0 && length.is_finite() {
        format!("write `{:?}`, which is the same plane", row.value.map(|number| rounded(number / length)))
    } else {
        "write the direction to the free side, for example `[0.0, 0.0, 1.0, 0.1]` for a table at z = 0.1 m".to_owned()
    };
    Err(Mistake::new(Code::BadValue, At::Span(row.span.clone()), message).help(help))
}

fn rounded(number: f64) -> f64 {
    // Without a negative zero.
    (number * 1e6).round() / 1e6 + 0.0
}

/// Returns the warnings about distances that are probably in another unit.
pub(super) fn unusual_distances(rows: &Rows) -> impl Iterator<Item = Mistake> {
    let range = [-USUAL_REACH_M, USUAL_REACH_M];
    rows.0.iter().filter_map(move |row| {
        let warning = unusual("keep_out", row.value[3], range, Unit::METRE)?;
        Some(Mistake { at: At::Span(row.span.clone()), ..warning })
    })
}

/// Returns the largest factor up to 1 with which a velocity can still be stopped before each plane.
///
/// It is the velocity [m/s] of the centre of a ball at `position` with that `radius` [m]. `deceleration` is in [m/s²].
/// The velocity stays the same for `delay` [s] before it decreases.
pub(super) fn scale(
    planes: &[Plane],
    velocity: &Vector3<f64>,
    (position, radius): (&Vector3<f64>, f64),
    deceleration: f64,
    delay: f64,
) -> f64 {
    let toward = |plane: &Plane| {
        let v = (-plane.normal.dot(velocity)).max(0.0);
        (v, stopping_speed(plane.room(position) - radius, deceleration, delay))
    };
    scale_within(velocity.norm(), planes.iter().map(toward))
}

/// Checks that a point of the box between the corners `min` and `max` is on the free side of all planes.
///
/// # Errors
/// The row that alone leaves no room, or all of them.
pub(super) fn check_room(rows: &Rows, planes: &[Plane], [min, max]: [&[f64; 3]; 2]) -> Result<(), Mistakes> {
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()].into_iter().zip(min.iter().zip(max));
    let faces = axes.flat_map(|(axis, (min, max))| {
        [Plane { normal: axis, distance: *min }, Plane { normal: -axis, distance: -max }]
    });
    let faces: Vec<Plane> = faces.collect();
    let with = |planes: &[Plane]| [faces.as_slice(), planes].concat();
    let help = "let the free side of each plane and the box have points in common; the normal points to the free side";
    for (row, plane) in rows.0.iter().zip(planes) {
        if !has_room(&with(&[*plane])) {
            let message = format!("the whole box is behind the plane {:?}", row.value);
            return Err(Mistake::new(Code::BadValue, At::Span(row.span.clone()), message).help(help).into());
        }
    }
    if has_room(&with(planes)) {
        return Ok(());
    }
    Err(Mistake::param("keep_out", "the planes together leave no room in the box").help(help).into())
}

/// Returns whether half-spaces whose intersection is bounded have a point in common: then they have a corner, in which
/// three of their planes meet.
fn has_room(bounds: &[Plane]) -> bool {
    let count = bounds.len();
    let triples = (0..count).flat_map(|i| (i + 1..count).flat_map(move |j| (j + 1..count).map(move |k| [i, j, k])));
    let mut corners = triples.filter_map(|triple| corner(triple.map(|index| &bounds[index])));
    corners.any(|corner| bounds.iter().all(|bound| bound.room(&corner) >= -ROUNDING_M))
}

/// Returns the point in which three planes meet.
fn corner(planes: [&Plane; 3]) -> Option<Vector3<f64>> {
    let normals = Matrix3::from_rows(&planes.map(|plane| plane.normal.transpose()));
    let distances = Vector3::from(planes.map(|plane| plane.distance));
    normals.try_inverse().map(|inverse| inverse * distances)
}

/// Returns the warning about a sensor that starts behind a plane, from which only the way back is free.
pub(super) fn start_behind(start: &[f64; 3], rows: &Rows, planes: &[Plane]) -> Option<Mistake> {
    // A mount in another unit has its own warning.
    if start.iter().any(|value| value.abs() > USUAL_REACH_M) {
        return None;
    }
    let point = Vector3::from(*start);
    let (row, plane) = rows.0.iter().zip(planes).find(|(_, plane)| plane.room(&point) < -ROUNDING_M)?;
    let at = start.map(|value| (value * 1e3).round() / 1e3);
    let message = format!(
        "the sensor starts outside the workspace, at {at:?} m: it is {:.1} mm behind the plane {:?}, so only motion \
         toward the free side is free",
        -plane.room(&point) * 1e3,
        row.value
    );
    let before = plane.normal.dot(&point) - START_ROOM_M;
    let room = Plane { distance: (before * 100.0).round() / 100.0, ..*plane };
    let row_with_room = room.row().map(rounded);
    let help = format!("write `{row_with_room:?}`, or change the start or the mount of the arm in the bench");
    Some(Mistake::new(Code::StartOutside, At::Span(row.span.clone()), message).help(help))
}
