//! Names the corners of a pad, in the base of the arm that carries it or in its own frame.

use nalgebra::{IsometryMatrix3, Point3, Vector3};
use tactflow_runtime::signal::ImageShape;

/// Part of the largest component of a direction from which another one is named.
const MIN_COMPONENT: f64 = 0.4;

/// Returns the place of a corner in the frame of the pad [m].
pub(super) fn corner(corner: [f64; 2], shape: &ImageShape) -> [f64; 2] {
    [corner[0] * shape.x(shape.cols as f64 - 1.0), corner[1] * shape.y(shape.rows as f64 - 1.0)]
}

/// Names a corner, given by the signs of its x and y, of a pad that the person looks at.
pub(super) fn of_pad(corner: [f64; 2]) -> String {
    let [right, up] = corner.map(|side| side > 0.0);
    let (height, side) = (if up { "upper" } else { "lower" }, if right { "right" } else { "left" });
    let sign = |is_positive: bool| if is_positive { '+' } else { '-' };
    format!("the {height} {side} corner ({}x, {}y)", sign(right), sign(up))
}

/// Names a corner of a pad whose pose in the base is known.
pub(super) fn in_base(corner: [f64; 2], pose: &IsometryMatrix3<f64>) -> String {
    let [x, y] = [Vector3::x() * corner[0], Vector3::y() * corner[1]].map(|side| direction(&(pose.rotation * side)));
    format!("the corner toward {x} and toward {y}")
}

/// Names the direction in the base to which z of the pad points.
pub(super) fn facing(pose: &IsometryMatrix3<f64>) -> String {
    direction(&(pose.rotation * Vector3::z()))
}

/// Returns a point of the pad in the base [m].
pub(super) fn point(place: [f64; 2], pose: &IsometryMatrix3<f64>) -> [f64; 3] {
    (pose * Point3::new(place[0], place[1], 0.0)).coords.into()
}

/// Names the axes of the base along which a direction goes, the first one first: `-z +x`.
fn direction(direction: &Vector3<f64>) -> String {
    let mut axes: Vec<(f64, char)> = direction.iter().copied().zip(['x', 'y', 'z']).collect();
    axes.sort_by(|(a, _), (b, _)| b.abs().total_cmp(&a.abs()));
    let largest = axes[0].0.abs();
    let named = axes.iter().filter(|(part, _)| part.abs() >= MIN_COMPONENT * largest);
    let words = named.map(|(part, axis)| format!("{}{axis}", if *part < 0.0 { '-' } else { '+' }));
    words.collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    use tactflow_runtime::signal::Unit;

    use super::super::symmetry::CORNERS;
    use super::*;
    use crate::motion::pose::pose_of;

    #[test]
    fn corners_of_a_pad_are_named_counterclockwise() {
        let names = CORNERS.map(of_pad);
        let expected =
            ["the lower left corner (-x, -y)", "the lower right corner (+x, -y)", "the upper right corner (+x, +y)"];
        assert_eq!(names[..3], expected);
        assert_eq!(names[3], "the upper left corner (-x, +y)");
        let shape = ImageShape { rows: 3, cols: 5, pitch: [0.01, 0.02], unit: Unit::RAW };
        assert_eq!(corner(CORNERS[1], &shape), [0.02, -0.02]);
    }

    #[test]
    fn corners_are_named_in_the_base() {
        // The sensor looks down: a half turn about x takes y to -y and z to -z.
        let down = pose_of([0.5, 0.1, 0.3], [2.0 * FRAC_PI_2, 0.0, 0.0]);
        assert_eq!(in_base(CORNERS[1], &down), "the corner toward +x and toward +y");
        assert_eq!(facing(&down), "-z");
        let [x, y, z] = point([0.02, -0.01], &down);
        assert!((x - 0.52).abs() < 1e-12 && (y - 0.11).abs() < 1e-12 && (z - 0.3).abs() < 1e-12);
        // x of the sensor is between x and z of the base, and y is y.
        let oblique = pose_of([0.0; 3], [0.0, FRAC_PI_4 + 0.1, 0.0]);
        assert_eq!(in_base(CORNERS[2], &oblique), "the corner toward -z +x and toward +y");
        let names = CORNERS.map(|corner| in_base(corner, &oblique));
        assert!((0..4).all(|i| (0..i).all(|j| names[i] != names[j])), "{names:?}");
    }
}
