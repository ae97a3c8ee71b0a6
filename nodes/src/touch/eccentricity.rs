//! `eccentricity`: sqrt(1 - b² / a²) of the ellipse with the same second central moments as the contact.

use tactflow_runtime::node::{Describe, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{ImageShape, Scalar};

use super::moments::{Inputs, Weighing, Weight, ellipse, image_shape};

/// Distinguishes a round contact from a long one: the eccentricity of its ellipse.
///
/// The ellipse with the same second central moments as the region has the half axes a and b, up to a common factor. The
/// output is sqrt(1 - b² / a²): 0 for a circle or a square, 0.87 for twice as long as wide, 0.98 for five times, 1 for
/// a single row of tactels.
///
/// It grows steeply for shapes that are almost round. The `anisotropy` A of `moments` is flat there and contains the
/// same information: the eccentricity is sqrt(2 A / (1 + A)), so an anisotropy of 0.05 is an eccentricity of 0.31.
/// `principal_axes` measures a and b in metres.
///
/// Tactels count as points, each with its `weight` as in `moments`. A region without extent, such as a single tactel,
/// has no eccentricity: the output is absent.
///
/// ```toml
/// [nodes.eccentricity]
/// type = "eccentricity"
/// in.image = "calibrate.image"
/// in.region = "label.region"
/// ```
#[derive(Describe)]
pub struct Eccentricity {
    shape: ImageShape,
    weighing: Weighing,
}

/// Parameters of `eccentricity`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Weight of each tactel: its value, its excess over `threshold`, or 1.
    #[param(default = Weight::Force)]
    weight: Weight,
    /// Zero of the excess, for `weight = "excess"`: the threshold of `binarize`, or its `release` if it has one.
    #[param(unit = "U")]
    threshold: Option<f64>,
}

/// What `eccentricity` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// From 0 for a circle to 1 for a line; absent for a region without extent, such as a single tactel.
    #[port(unit = "1", frame = "A", quantity = "eccentricity")]
    eccentricity: Out<Scalar>,
}

impl Node for Eccentricity {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.outputs.eccentricity.range = [0.0, 1.0];
        let shape = image_shape(&setup.inputs)?;
        Ok(Self { shape, weighing: Weighing::new(params.weight, params.threshold)? })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let sums = self.weighing.add_up(&inputs.image, &inputs.region);
        if sums.force > 0.0 {
            let [long, short] = ellipse(&sums, self.shape.pitch).variances();
            if long > 0.0 {
                out.eccentricity.set((1.0 - short / long).sqrt());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::{NodeRig, places};
    use tactflow_runtime::node::At;
    use tactflow_runtime::signal::{Grid, Image, Mask, Unit};

    use super::super::moments::Moments;
    use super::*;
    use tactflow_runtime::random::Random;

    fn rig<N: Node>(params: &str) -> Result<NodeRig, Mistakes> {
        let image = ImageShape { rows: 20, cols: 24, pitch: [0.005, 0.004], unit: Unit::NEWTON };
        NodeRig::new::<N>(params, &[("region", Grid::from(&image).into()), ("image", image.into())])
    }

    /// Shows an image whose region is the tactels above zero, and returns an output.
    fn show(rig: &mut NodeRig, value: &dyn Fn(usize, usize) -> f64, output: &str) -> Option<f64> {
        let (mut image, mut region) = (Image::zeros(20, 24), Mask::empty(20, 24));
        for (i, j) in (0..20).flat_map(|i| (0..24).map(move |j| (i, j))).filter(|(i, j)| value(*i, *j) > 0.0) {
            image.cells_mut()[i * 24 + j] = value(i, j) as f32;
            region.insert(i, j);
        }
        rig.set("image", image);
        rig.set("region", region);
        rig.step();
        rig.get::<Scalar>(output).copied()
    }

    #[test]
    fn shapes_in_closed_form() {
        let patch = |rows: usize, cols: usize| {
            move |i: usize, j: usize| if (3..3 + rows).contains(&i) && (2..2 + cols).contains(&j) { 2.0 } else { 0.0 }
        };
        // An ellipse of half axes a and b [m] about the middle, with its values cut at 10 standard deviations.
        let print = |a: f64, b: f64| {
            move |i: usize, j: usize| {
                let (x, y) = ((j as f64 - 11.5) * 0.005 / a, (i as f64 - 9.5) * 0.004 / b);
                libm::exp(-0.5 * (x * x + y * y))
            }
        };
        let even = |rows: f64, cols: f64| {
            let (x, y) = ((cols * cols - 1.0) * 0.005 * 0.005, (rows * rows - 1.0) * 0.004 * 0.004);
            (1.0 - x.min(y) / x.max(y)).sqrt()
        };
        type Value = Box<dyn Fn(usize, usize) -> f64>;
        let cases: [(&str, Value, Option<f64>); 7] = [
            ("nothing", Box::new(patch(0, 0)), None),
            ("a tactel", Box::new(patch(1, 1)), None),
            ("a row", Box::new(patch(1, 7)), Some(1.0)),
            ("a column", Box::new(patch(7, 1)), Some(1.0)),
            ("a patch", Box::new(patch(3, 7)), Some(even(3.0, 7.0))),
            ("a round print", Box::new(print(0.008, 0.008)), Some(0.0)),
            ("a long print", Box::new(print(0.012, 0.006)), Some(0.75_f64.sqrt())),
        ];
        for (what, value, expected) in cases {
            let found = show(&mut rig::<Eccentricity>("").unwrap(), &value, "eccentricity");
            let near = |(a, b): (f64, f64)| (a * a - b * b).abs() < 2e-2;
            assert!(found.zip(expected).map_or(found == expected, near), "{what}: {found:?}, not {expected:?}");
        }
    }

    #[test]
    fn it_follows_from_the_anisotropy_with_any_weight() {
        let mut random = Random::new(9, 0);
        for round in 0..60 {
            let cells: Vec<f64> = (0..480).map(|_| random.uniform(0.0, 1.0) - 0.7).collect();
            for weight in ["", "weight = \"area\"", "weight = \"excess\"\nthreshold = 0.1"] {
                let value = |i: usize, j: usize| cells[i * 24 + j];
                let found = show(&mut rig::<Eccentricity>(weight).unwrap(), &value, "eccentricity").unwrap();
                let a = show(&mut rig::<Moments>(weight).unwrap(), &value, "anisotropy").unwrap();
                assert!((found * found - 2.0 * a / (1.0 + a)).abs() < 1e-12, "round {round}, {weight}");
            }
        }
    }

    #[test]
    fn without_a_positive_variance_it_is_absent() {
        // A strong tactel between two negative ones: the sum is positive, the variance along x is not.
        let (mut image, mut region) = (Image::zeros(20, 24), Mask::empty(20, 24));
        for (i, j, value) in [(2, 5, 0.3), (3, 4, -1.0), (3, 5, 9.0), (3, 6, -1.0), (4, 5, 0.3)] {
            image.cells_mut()[i * 24 + j] = value;
            region.insert(i, j);
        }
        let mut rig = rig::<Eccentricity>("").unwrap();
        rig.set("image", image);
        rig.set("region", region);
        rig.step();
        assert_eq!(rig.get::<Scalar>("eccentricity"), None);
    }

    #[test]
    fn wrong_weights_are_refused() {
        let cases = [
            ("weight = \"excess\"", At::Param("weight".into())),
            ("threshold = 0.1", At::Key("threshold".into())),
            ("weight = \"area\"\nthreshold = 0.1", At::Key("threshold".into())),
        ];
        for (params, at) in cases {
            assert_eq!(rig::<Eccentricity>(params).err().unwrap()[0].at, at, "{params}");
        }
        let unknown = "weight = \"mass\"";
        assert_eq!(places(unknown, &rig::<Eccentricity>(unknown)), ["bad-value: `\"mass\"`"]);
    }
}
