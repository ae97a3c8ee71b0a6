//! `principal_axes`: length, width and direction of a contact, from the second central moments of its tactels (paper
//! section III uses the direction of the long axis).

use tactflow_runtime::node::{Describe, Mistakes, Node, Out, Outputs, Setup, Tick};
use tactflow_runtime::signal::{ImageShape, Scalar};

use super::moments::{Inputs, Params, Weighing, ellipse, image_shape};

/// Measures the length, the width and the direction of a contact.
///
/// The second central moments of a region are a 2 by 2 covariance in square metres. `major` and `minor` are the square
/// roots of its eigenvalues, the standard deviations along the long and the short axis; `orientation` is the direction
/// of the long axis, as in `moments`.
///
/// A uniform bar of length L has a standard deviation of L / sqrt(12), a uniform disc of radius r has r / 2 along every
/// axis. Tactels count as points, so a single row has a width of 0, and a bar of n tactels has a standard deviation of
/// sqrt((n² - 1) / 12) times the pitch.
///
/// The outputs are absent without a region, and when the sum of the weights is not positive. A contact whose anisotropy
/// (major² - minor²) / (major² + minor²) is below `min_anisotropy` has no orientation. `weight` is as in `moments`.
///
/// ```toml
/// [nodes.principal_axes]
/// type = "principal_axes"
/// in.image = "calibrate.image"
/// in.region = "label.region"
/// ```
#[derive(Describe)]
pub struct PrincipalAxes {
    shape: ImageShape,
    weighing: Weighing,
    min_anisotropy: f64,
}

/// What `principal_axes` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Standard deviation along the long axis.
    #[port(unit = "m", frame = "A", quantity = "major")]
    major: Out<Scalar>,
    /// Standard deviation along the short axis.
    #[port(unit = "m", frame = "A", quantity = "minor")]
    minor: Out<Scalar>,
    /// Direction of the long axis from +x toward +y, in (-pi/2, pi/2]; absent if the contact is round.
    #[port(unit = "rad mod pi", frame = "A", quantity = "orientation")]
    orientation: Out<Scalar>,
}

impl Node for PrincipalAxes {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let shape = image_shape(&setup.inputs)?;
        let weighing = Weighing::new(params.weight, params.threshold)?;
        Ok(Self { shape, weighing, min_anisotropy: params.min_anisotropy })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let sums = self.weighing.add_up(&inputs.image, &inputs.region);
        if sums.force > 0.0 {
            let ellipse = ellipse(&sums, self.shape.pitch);
            let [major, minor] = ellipse.variances().map(f64::sqrt);
            out.major.set(major);
            out.minor.set(minor);
            if let Some(orientation) = ellipse.orientation(self.min_anisotropy) {
                out.orientation.set(orientation);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use nalgebra::{Matrix2, Vector2};
    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Grid, Image, Mask, Unit};

    use super::super::binarize::binarize;
    use super::*;

    const PITCH: [f64; 2] = [0.005, 0.004];

    /// Returns the three outputs for an image whose region is the tactels above the threshold.
    fn run(params: &str, image: &Image, threshold: f32) -> [Option<f64>; 3] {
        let shape = ImageShape { rows: image.rows(), cols: image.cols(), pitch: PITCH, unit: Unit::NEWTON };
        let wires = [("region", Grid::from(&shape).into()), ("image", shape.into())];
        let mut rig = NodeRig::new::<PrincipalAxes>(params, &wires).unwrap();
        let mut region = Mask::empty(image.rows(), image.cols());
        binarize(image.cells(), threshold, &mut region);
        rig.set("image", image.clone());
        rig.set("region", region);
        rig.step();
        ["major", "minor", "orientation"].map(|output| rig.get::<Scalar>(output).copied())
    }

    #[test]
    fn rectangles_in_closed_form() {
        // rows, columns, and whether it has an orientation, of a patch on 16 by 16
        for (rows, cols, angle) in [
            (1, 1, None),
            (1, 9, Some(0.0)),
            (9, 1, Some(FRAC_PI_2)),
            (3, 12, Some(0.0)),
            (5, 4, None),
            (14, 2, Some(FRAC_PI_2)),
        ] {
            let mut cells = [0.0; 256];
            (0..rows * cols).for_each(|at| cells[(at / cols + 1) * 16 + at % cols + 2] = 3.0);
            let deviation = |n: usize, pitch: f64| ((n * n - 1) as f64 / 12.0).sqrt() * pitch;
            let (x, y) = (deviation(cols, PITCH[0]), deviation(rows, PITCH[1]));
            for params in ["", "weight = \"area\"", "weight = \"excess\"\nthreshold = 1"] {
                let [major, minor, orientation] = run(params, &Image::from_cells(16, &cells), 1.0);
                assert!((major.unwrap() - x.max(y)).abs() < 1e-9, "{rows} by {cols}: {major:?}");
                assert!((minor.unwrap() - x.min(y)).abs() < 1e-9, "{rows} by {cols}: {minor:?}");
                assert_eq!(orientation, angle, "{rows} by {cols}");
            }
        }
        assert_eq!(run("", &Image::zeros(4, 4), 1.0), [None; 3]);
    }

    proptest! {
        #[test]
        fn the_axes_are_those_of_the_covariance(
            cells in prop::collection::vec(0..4096u16, 63), threshold in 0..3500u16,
            weight in prop::sample::select(vec!["force", "excess", "area"]),
        ) {
            let cells: Vec<f32> = cells.into_iter().map(f32::from).collect();
            let floor = f64::from(threshold);
            let weigh = |value: f64| match weight { "force" => value, "excess" => value - floor, _ => 1.0 };
            let tactels = || {
                let above = cells.iter().enumerate().filter(|(_, value)| **value > f32::from(threshold));
                above.map(|(at, value)| {
                    (weigh(f64::from(*value)), Vector2::new((at % 9) as f64 * PITCH[0], (at / 9) as f64 * PITCH[1]))
                })
            };
            prop_assume!(tactels().count() > 1);
            let sum: f64 = tactels().map(|(weight, _)| weight).sum();
            let centre = tactels().fold(Vector2::zeros(), |sum, (weight, at)| sum + at * weight) / sum;
            let spread = tactels().fold(Matrix2::zeros(), |sum, (weight, at)| {
                sum + (at - centre) * (at - centre).transpose() * weight
            }) / sum;
            let eigen = spread.symmetric_eigen();
            let params = format!("weight = \"{weight}\"\nmin_anisotropy = 0{}",
                if weight == "excess" { format!("\nthreshold = {threshold}") } else { String::new() });
            let [major, minor, orientation] = run(&params, &Image::from_cells(9, &cells), f32::from(threshold));
            let (major, minor) = (major.unwrap(), minor.unwrap());
            prop_assert!((major * major - eigen.eigenvalues.max()).abs() < 1e-14);
            prop_assert!((minor * minor - eigen.eigenvalues.min()).abs() < 1e-14);
            prop_assume!(major > 1.01 * minor);
            let axis = eigen.eigenvectors.column(eigen.eigenvalues.imax());
            prop_assert!(libm::sin(libm::atan2(axis.y, axis.x) - orientation.unwrap()).abs() < 1e-6);
        }
    }
}
