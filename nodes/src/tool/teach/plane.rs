//! A plane through touched points: the least squares of the distances, and the side that is free.

use nalgebra::{Matrix3, SymmetricEigen, Vector3};

use crate::tool::guided::vectors::direction;

/// Smallest extent of the touched points across their longest direction [m].
pub(super) const MIN_WIDTH_M: f64 = 0.02;
/// Smallest distance of a posture from a plane at which it shows the free side [m].
const MIN_FREE_M: f64 = 0.01;
/// Component of a normal along an axis from which on the axis names the direction.
const MIN_ALONG: f64 = 0.99;

/// A plane of which the free side is not known: n·p = d.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fit {
    /// A unit vector across the plane, in the base.
    normal: Vector3<f64>,
    /// Coordinate of the plane along the normal [m].
    distance: f64,
    /// Largest distance of a point from the plane [m].
    pub(super) residual: f64,
}

/// A plane whose normal points to the free side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct FreeSide {
    normal: Vector3<f64>,
    distance: f64,
}

/// Fits a plane to three points or more [m].
///
/// # Errors
/// If there are fewer, or if they are nearly on a line.
pub(super) fn fit(points: &[Vector3<f64>]) -> Result<Fit, String> {
    if points.len() < 3 {
        return Err(format!("a plane needs three points, not {}", points.len()));
    }
    let centre = points.iter().sum::<Vector3<f64>>() / points.len() as f64;
    let spread: Matrix3<f64> = points.iter().map(|point| (point - centre) * (point - centre).transpose()).sum();
    let SymmetricEigen { eigenvalues, eigenvectors } = spread.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigenvalues[*a].total_cmp(&eigenvalues[*b]));
    let [across, wide] = [0, 1].map(|i| eigenvectors.column(order[i]).into_owned());
    let along_wide = points.iter().map(|point| wide.dot(point));
    let [low, high] = [along_wide.clone().fold(f64::INFINITY, f64::min), along_wide.fold(f64::NEG_INFINITY, f64::max)];
    if high - low < MIN_WIDTH_M {
        return Err(format!(
            "the points are nearly on a line: across it they are {:.1} mm apart, and {} mm are needed",
            (high - low) * 1e3,
            MIN_WIDTH_M * 1e3
        ));
    }
    let distance = across.dot(&centre);
    let residual = points.iter().map(|point| (across.dot(point) - distance).abs()).fold(0.0, f64::max);
    Ok(Fit { normal: across, distance, residual })
}

impl Fit {
    /// Returns the plane with the side of a point as the free one, or `None` if the point is too near to the plane.
    pub(super) fn facing(&self, free: &Vector3<f64>) -> Option<FreeSide> {
        let height = FreeSide { normal: self.normal, distance: self.distance }.height(free);
        let sign = height.signum();
        (height.abs() >= MIN_FREE_M).then_some(FreeSide { normal: self.normal * sign, distance: self.distance * sign })
    }
}

impl FreeSide {
    /// Returns the plane of a row of `keep_out`.
    pub(super) fn of_row([x, y, z, distance]: [f64; 4]) -> Self {
        Self { normal: Vector3::new(x, y, z), distance }
    }

    /// Returns the height of a point over the plane; negative behind it [m].
    pub(super) fn height(&self, point: &Vector3<f64>) -> f64 {
        self.normal.dot(point) - self.distance
    }

    /// Returns the free direction in words: an axis of the base, or a unit vector.
    pub(super) fn direction(&self) -> String {
        direction(&self.normal, MIN_ALONG)
    }

    /// Returns the row of `keep_out` with the plane moved to the free side by a clearance [m]. It is rounded to 0.1 mm.
    pub(super) fn row(&self, clearance: f64) -> [f64; 4] {
        let tenths = ((self.distance + clearance) * 1e4).round() / 1e4;
        let [x, y, z] = self.normal.into();
        [x, y, z, tenths]
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn points(points: &[[f64; 3]]) -> Vec<Vector3<f64>> {
        points.iter().map(|point| Vector3::from(*point)).collect()
    }

    #[test]
    fn three_points_on_a_table_are_its_plane() {
        let table = fit(&points(&[[0.4, 0.0, 0.12], [0.5, 0.1, 0.12], [0.4, 0.2, 0.12]])).unwrap();
        assert!(table.residual < 1e-12);
        let above = table.facing(&Vector3::new(0.4, 0.0, 0.3)).unwrap().row(0.005);
        let below = table.facing(&Vector3::new(0.4, 0.0, 0.0)).unwrap().row(0.005);
        for (row, wanted) in [(above, [0.0, 0.0, 1.0, 0.125]), (below, [0.0, 0.0, -1.0, -0.115])] {
            assert!(row.iter().zip(wanted).all(|(found, wanted)| (found - wanted).abs() < 1e-9), "{row:?}");
        }
        assert_eq!([above, below].map(|row| FreeSide::of_row(row).direction()), ["+z", "-z"]);
        assert_eq!(FreeSide::of_row([0.6, 0.0, -0.8, 0.1]).direction(), "[0.60, 0.00, -0.80]");
        assert_eq!(table.facing(&Vector3::new(0.0, 0.0, 0.125)), None, "5 mm above it");
    }

    #[test]
    fn points_on_a_line_are_no_plane() {
        let line = fit(&points(&[[0.0, 0.0, 0.1], [0.2, 0.0, 0.1], [0.4, 0.019, 0.1]])).unwrap_err();
        assert!(line.starts_with("the points are nearly on a line") && line.ends_with("20 mm are needed"), "{line}");
        assert!(fit(&points(&[[0.0, 0.0, 0.1], [0.2, 0.0, 0.1]])).is_err());
        assert!(fit(&points(&[[0.1; 3]; 5])).is_err());
    }

    #[test]
    fn more_points_are_averaged_and_the_residual_is_the_largest_distance() {
        let bumpy = [[0.0, 0.0, 0.101], [0.2, 0.0, 0.099], [0.2, 0.2, 0.101], [0.0, 0.2, 0.099]];
        let fit = fit(&points(&bumpy)).unwrap();
        let row = fit.facing(&Vector3::new(0.0, 0.0, 1.0)).unwrap().row(0.0);
        assert!((row[3] - 0.1).abs() < 1e-9 && (fit.residual - 0.001).abs() < 1e-6, "{row:?}, {}", fit.residual);
    }

    fn a_point() -> impl Strategy<Value = Vector3<f64>> {
        prop::array::uniform3(-1.0..1.0f64).prop_map(Vector3::from)
    }

    proptest! {
        /// The plane through three points has the normal (b - a) × (c - a).
        #[test]
        fn three_points_agree_with_the_cross_product(a in a_point(), b in a_point(), c in a_point(), free in a_point()) {
            let cross = (b - a).cross(&(c - a));
            prop_assume!(cross.norm() > 0.1);
            let normal = cross.normalize();
            let height = normal.dot(&(free - a));
            prop_assume!(height.abs() > 0.02);
            let fit = fit(&[a, b, c]).unwrap();
            let row = fit.facing(&free).unwrap().row(0.0);
            let found = Vector3::new(row[0], row[1], row[2]);
            prop_assert!((found - normal * height.signum()).norm() < 1e-9);
            prop_assert!((row[3] - found.dot(&a)).abs() < 5.1e-5 && fit.residual < 1e-12);
            prop_assert!((FreeSide::of_row(row).height(&free) - height.abs()).abs() < 1e-4);
        }
    }
}
