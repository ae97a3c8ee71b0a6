//! A box around visited points.

use nalgebra::Vector3;
use toml::Value;

use super::site::read_numbers;

/// Smallest side of a taught box [m].
const MIN_SIDE_M: f64 = 0.01;
const AXES: [&str; 3] = ["x", "y", "z"];

/// The workspace: a box in the base of the arm.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Workspace {
    /// Corner with the smallest coordinates [m].
    pub(super) min: [f64; 3],
    /// Corner with the largest coordinates [m].
    pub(super) max: [f64; 3],
}

impl Workspace {
    /// Returns the box around some points, larger by a margin on each side [m].
    ///
    /// # Errors
    /// If there are fewer than two points, or if a side is too short.
    pub(super) fn around(points: &[Vector3<f64>], margin: f64) -> Result<Self, String> {
        if points.len() < 2 {
            return Err(format!("a box needs two points, not {}", points.len()));
        }
        let bound =
            |axis: usize, outer: fn(f64, f64) -> f64| points.iter().map(|p| p[axis]).reduce(outer).unwrap_or(0.0);
        let min = [0, 1, 2].map(|axis| bound(axis, f64::min) - margin);
        let max = [0, 1, 2].map(|axis| bound(axis, f64::max) + margin);
        match (0..3).find(|axis| max[*axis] - min[*axis] < MIN_SIDE_M) {
            Some(axis) => Err(format!(
                "the box would be {:.1} mm along {}: visit points that are farther apart along {}, or use a larger `--margin`",
                (max[axis] - min[axis]) * 1e3,
                AXES[axis],
                AXES[axis]
            )),
            None => Ok(Self { min, max }),
        }
    }

    /// Returns in words where the box of a section `[limits]`, which holds too, leaves less than this one.
    pub(super) fn narrowed_by(&self, limits: &Value) -> Vec<String> {
        let corner = |key: &str| limits.get(key).map(|value| (key.to_owned(), read_numbers(value)));
        let low = corner("workspace_min_m").map(|(key, corner)| (key, corner, true));
        let high = corner("workspace_max_m").map(|(key, corner)| (key, corner, false));
        low.into_iter().chain(high).filter_map(|(key, corner, is_min)| self.narrowed(&key, corner?, is_min)).collect()
    }

    fn narrowed(&self, key: &str, corner: Vec<f64>, is_min: bool) -> Option<String> {
        let (near, far) = if is_min { (self.min, self.max) } else { (self.max, self.min) };
        let sign = if is_min { 1.0 } else { -1.0 };
        let inside =
            |axis: &usize, bound: &[f64; 3]| corner.get(*axis).is_some_and(|q| (q - bound[*axis]) * sign > 0.0);
        let is_disjoint = (0..3).any(|axis| inside(&axis, &far));
        let axes: Vec<&str> = (0..3).filter(|axis| inside(axis, &near)).map(|axis| AXES[axis]).collect();
        let what = if is_disjoint { "leaves nothing of the taught box" } else { "is tighter than the taught box" };
        (!axes.is_empty())
            .then(|| format!("`{key} = {corner:?}` of `[limits]` holds too, and {what}, along {}", axes.join(", ")))
    }

    /// Returns the first coordinate of a point that is outside of the box, in words.
    pub(super) fn outside(&self, point: &Vector3<f64>) -> Option<String> {
        let axis = (0..3).find(|axis| !(self.min[*axis]..=self.max[*axis]).contains(&point[*axis]))?;
        let [min, max] = [self.min, self.max].map(|corner| corner[axis]);
        Some(format!("its {} is {:.4} m, and the box is from {min:.4} to {max:.4} m", AXES[axis], point[axis]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_box_is_around_all_points_with_a_margin() {
        let points = [[0.4, 0.2, 0.1], [0.5, -0.2, 0.3], [0.45, 0.0, 0.5]].map(Vector3::from);
        let found = Workspace::around(&points, 0.0).unwrap();
        assert_eq!((found.min, found.max), ([0.4, -0.2, 0.1], [0.5, 0.2, 0.5]));
        let wider = Workspace::around(&points, 0.1).unwrap();
        assert!((wider.min[0] - 0.3).abs() < 1e-12 && (wider.max[2] - 0.6).abs() < 1e-12, "{wider:?}");
        assert_eq!(found.outside(&points[2]), None);
        let outside = found.outside(&Vector3::new(0.45, 0.3, 0.0)).unwrap();
        assert_eq!(outside, "its y is 0.3000 m, and the box is from -0.2000 to 0.2000 m");
    }

    #[test]
    fn tighter_and_disjoint_corners_of_all_arms_are_named() {
        let found = Workspace { min: [0.0; 3], max: [0.5; 3] };
        let narrowed = |text: &str| found.narrowed_by(&toml::from_str(text).unwrap());
        let wide = "workspace_min_m = [-1.0, 0.0, -1.0]\nworkspace_max_m = [1, 1, 0.5]";
        assert!(narrowed(wide).is_empty() && narrowed("force_n = 5.0").is_empty());
        let tight = narrowed("workspace_min_m = [0.1, -1.0, 0.2]\nworkspace_max_m = [1.0, -0.1, 1.0]");
        assert_eq!(tight.len(), 2, "{tight:?}");
        assert!(tight[0].ends_with("holds too, and is tighter than the taught box, along x, z"), "{tight:?}");
        assert!(tight[1].starts_with("`workspace_max_m = [1.0, -0.1, 1.0]` of `[limits]`"), "{tight:?}");
        assert!(tight[1].ends_with("leaves nothing of the taught box, along y"), "{tight:?}");
    }

    #[test]
    fn a_flat_box_is_refused() {
        let flat = [[0.4, 0.2, 0.1], [0.5, -0.2, 0.105]].map(Vector3::from);
        let message = Workspace::around(&flat, 0.0).unwrap_err();
        assert!(message.starts_with("the box would be 5.0 mm along z"), "{message}");
        assert!(Workspace::around(&flat, 0.005).is_ok());
        assert!(Workspace::around(&flat, -0.06).unwrap_err().contains("along x"));
        assert!(Workspace::around(&flat[..1], 0.1).unwrap_err().contains("needs two points"));
    }
}
