//! `shear`: the force and the torque with which an object drags a contact.

use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{ImageShape, Mask, Scalar, VectorImage, VectorImageShape};

use super::common::check_same_array;

/// Measures how an object drags a contact: the tangential force, and the torque about the normal.
///
/// For the forces t_ij (tangential) and n_ij (normal) of the tactels of a region R, at the positions c_ij:
///
/// - `fx`, `fy`: the sum of t_ij, along the sensor's x and y;
/// - `force`: the sum of n_ij, as `force` of `moments`;
/// - `torque`: the sum of (c_ij - c) × t_ij about the centre of pressure c, from +x toward +y. A pure push through the
///   centre has none; an object that turns on the pad has one without a push;
/// - `lever`: the mean distance of the normal force from the centre of pressure, Σ n_ij |c_ij - c| / Σ n_ij. `friction_margin` needs it.
///
/// `torque` and `lever` are absent if the normal force is not positive. All outputs are absent without a region.
///
/// The region must be of an image with the rows and columns of the vector image: leave `flip_x`, `flip_y` and `transpose`
/// of `tactile_source` out for such a pad.
///
/// The centre and the lever are as exact as the resolution of the pad: foam that spreads a load over several tactels
/// makes the lever of a point longer by about the width of the spread.
///
/// ```toml
/// [nodes.shear]
/// type = "shear"
/// in.vectors = "calibrate_vectors.vectors"
/// in.region = "label.region"
/// ```
#[derive(Describe)]
pub struct Shear {
    shape: ImageShape,
}

/// Parameters of `shear`: none.
#[derive(Debug, Clone, Param)]
pub struct Params {}

/// What `shear` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The force on each tactel.
    #[port(unit = "N", frame = "A", quantity = "three_axis_image")]
    vectors: In<'a, VectorImage>,
    /// The tactels of the contact, R.
    #[port(frame = "A")]
    region: In<'a, Mask>,
}

/// What `shear` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Force of the object on the pad along the sensor's x.
    #[port(unit = "N", frame = "A", quantity = "fx")]
    fx: Out<Scalar>,
    /// Force of the object on the pad along the sensor's y.
    #[port(unit = "N", frame = "A", quantity = "fy")]
    fy: Out<Scalar>,
    /// Normal force, positive when the object presses the pad.
    #[port(unit = "N", frame = "A", quantity = "force")]
    force: Out<Scalar>,
    /// Torque of the object on the pad about the sensor's z, through the centre of pressure.
    #[port(unit = "N m", frame = "A", quantity = "torque")]
    torque: Out<Scalar>,
    /// Mean distance of the normal force from the centre of pressure.
    #[port(unit = "m", frame = "A", quantity = "lever")]
    lever: Out<Scalar>,
}

impl Node for Shear {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(_: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let VectorImageShape(shape) = setup.inputs.vectors.clone();
        check_same_array(&shape, "region", &setup.inputs.region)?;
        Ok(Self { shape })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let tactels = || self.tactels(&inputs.vectors, &inputs.region);
        let (mut fx, mut fy, mut force, mut moment) = (0.0, 0.0, 0.0, [0.0; 2]);
        for Tactel { at, force: [x, y, z] } in tactels() {
            fx += x;
            fy += y;
            force += z;
            moment[0] += z * at[0];
            moment[1] += z * at[1];
        }
        out.fx.set(fx);
        out.fy.set(fy);
        out.force.set(force);
        if force <= 0.0 {
            return;
        }
        let centre = moment.map(|moment| moment / force);
        let (mut torque, mut lever) = (0.0, 0.0);
        for Tactel { at, force: [x, y, z] } in tactels() {
            let [along, across] = [at[0] - centre[0], at[1] - centre[1]];
            torque += along * y - across * x;
            lever += z * libm::hypot(along, across);
        }
        out.torque.set(torque);
        out.lever.set((lever / force).max(0.0));
    }
}

/// A tactel of the region.
struct Tactel {
    /// Position along the sensor's x and y [m].
    at: [f64; 2],
    /// Force along x, y and z [N].
    force: [f64; 3],
}

impl Shear {
    /// Returns the tactels of a region, row by row.
    fn tactels<'a>(&'a self, vectors: &'a VectorImage, region: &'a Mask) -> impl Iterator<Item = Tactel> + 'a {
        let rows = (0..region.rows()).flat_map(move |i| {
            let words = region.row(i).iter().enumerate();
            words.flat_map(|(k, word)| bits(*word).map(move |bit| 64 * k + bit)).map(move |j| (i, j))
        });
        rows.map(move |(i, j)| Tactel {
            at: [self.shape.x(j as f64), self.shape.y(i as f64)],
            force: vectors.cells()[i * self.shape.cols + j].map(f64::from),
        })
    }
}

/// Returns the places of the bits that are set, from the lowest.
fn bits(mut word: u64) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        let bit = word.trailing_zeros() as usize;
        word &= word.wrapping_sub(1);
        (bit < 64).then_some(bit)
    })
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::random::Random;
    use tactflow_runtime::signal::{Grid, Unit};

    use super::*;

    fn shape() -> ImageShape {
        ImageShape { rows: 20, cols: 70, pitch: [0.004, 0.005], unit: Unit::NEWTON }
    }

    /// Shows the forces of the tactels, whose region is where the normal force is not 0. Returns fx, fy, force, torque and
    /// lever.
    fn show(force: impl Fn([f64; 2]) -> [f64; 3]) -> [Option<f64>; 5] {
        let shape = shape();
        let inputs = [("vectors", VectorImageShape(shape.clone()).into()), ("region", Grid::from(&shape).into())];
        let mut rig = NodeRig::new::<Shear>("", &inputs).unwrap();
        let (mut image, mut region) = (VectorImage::zeros(20, 70), Mask::empty(20, 70));
        for (i, j) in (0..20).flat_map(|i| (0..70).map(move |j| (i, j))) {
            let force = force([shape.x(j as f64), shape.y(i as f64)]);
            // Beside the region, the pad has other forces, which do not count.
            image.cells_mut()[i * 70 + j] = if force[2] == 0.0 { [5.0; 3] } else { force.map(|force| force as f32) };
            if force[2] != 0.0 {
                region.insert(i, j);
            }
        }
        rig.set("vectors", image);
        rig.set("region", region);
        rig.step();
        ["fx", "fy", "force", "torque", "lever"].map(|name| rig.get::<Scalar>(name).copied())
    }

    fn near(found: Option<f64>, wanted: f64, within: f64) -> bool {
        found.is_some_and(|found| (found - wanted).abs() <= within)
    }

    #[test]
    fn a_disc_that_is_pushed_and_turned_in_closed_form() {
        // Even pressure on a disc of radius a: the mean distance from its middle is 2 a / 3.
        let (a, middle) = (0.03, [0.02, -0.01]);
        let disc = |push: [f64; 2], turn: f64| {
            move |at: [f64; 2]| {
                let [x, y] = [at[0] - middle[0], at[1] - middle[1]];
                let inside = libm::hypot(x, y) < a;
                if inside { [push[0] - turn * y, push[1] + turn * x, 0.1] } else { [0.0; 3] }
            }
        };
        let count = show(disc([0.0; 2], 0.0))[2].unwrap() / 0.1;
        assert!((count * 0.004 * 0.005 / (std::f64::consts::PI * a * a) - 1.0).abs() < 0.02, "{count} tactels");
        let pushed = show(disc([0.01, -0.02], 0.0));
        assert!(near(pushed[0], 0.01 * count, 1e-6) && near(pushed[1], -0.02 * count, 1e-6), "{pushed:?}");
        assert!(near(pushed[3], 0.0, 1e-7), "a push through the centre has no torque: {pushed:?}");
        assert!(near(pushed[4], 2.0 / 3.0 * a, 0.01 * a), "{pushed:?}");
        let turned = show(disc([0.0; 2], 0.5));
        // The sum of the squares of the distances is the area times a² / 2.
        assert!(near(turned[3], 0.5 * count * a * a / 2.0, 0.02 * 0.5 * count * a * a / 2.0), "{turned:?}");
        assert!(near(turned[0], 0.0, 2e-3) && near(turned[1], 0.0, 2e-3), "{turned:?}");
    }

    #[test]
    fn the_torque_is_about_the_centre_of_pressure() {
        // Two tactels of unequal pressure, both pushed along y.
        let [left, right] = [shape().x(10.0), shape().x(60.0)];
        let row = shape().y(3.0);
        let found = show(move |at| match at {
            _ if (at[1] - row).abs() > 1e-9 => [0.0; 3],
            [x, _] if (x - left).abs() < 1e-9 => [0.0, 0.5, 3.0],
            [x, _] if (x - right).abs() < 1e-9 => [0.0, 0.5, 1.0],
            _ => [0.0; 3],
        });
        let centre = 0.75 * left + 0.25 * right;
        assert!(near(found[3], 0.5 * (left - centre) + 0.5 * (right - centre), 1e-9), "{found:?}");
        assert!(near(found[4], 0.75 * (centre - left) + 0.25 * (right - centre), 1e-9), "{found:?}");
    }

    #[test]
    fn it_agrees_with_a_sum_over_all_tactels() {
        let mut random = Random::new(5, 0);
        for _ in 0..20 {
            let cells: Vec<[f64; 3]> = (0..1400)
                .map(|_| {
                    let z = random.uniform(-1.0, 1.0);
                    [random.normal(), random.normal(), if z > 0.2 { z } else { 0.0 }].map(|v| f64::from(v as f32))
                })
                .collect();
            let at = |i: usize| [shape().x((i % 70) as f64), shape().y((i / 70) as f64)];
            let index = |[x, y]: [f64; 2]| {
                let [j, i] = [(x - shape().x(0.0)) / 0.004, (y - shape().y(0.0)) / 0.005].map(|v| v.round() as usize);
                i * 70 + j
            };
            let found = show(|place| cells[index(place)]);
            let within = || cells.iter().enumerate().filter(|(_, cell)| cell[2] != 0.0);
            let total = |axis: usize| within().map(|(_, cell)| cell[axis]).sum::<f64>();
            let centre = [0, 1].map(|axis| within().map(|(i, cell)| cell[2] * at(i)[axis]).sum::<f64>() / total(2));
            let moment = within().map(|(i, cell)| at(i)[0] * cell[1] - at(i)[1] * cell[0]).sum::<f64>();
            let torque = moment - (centre[0] * total(1) - centre[1] * total(0));
            assert!([0, 1, 2].iter().all(|axis| near(found[*axis], total(*axis), 1e-9)), "{found:?}");
            assert!(near(found[3], torque, 1e-9), "{found:?} {torque}");
        }
    }

    #[test]
    fn without_a_normal_force_there_is_no_centre() {
        let found = show(|at| if at[0].abs() < 0.01 { [0.1, 0.0, -0.2] } else { [0.0; 3] });
        assert!(found[0].is_some() && found[2].is_some_and(|force| force < 0.0), "{found:?}");
        assert_eq!(found[3..], [None, None]);
    }

    #[test]
    fn the_region_must_be_of_the_same_pad() {
        let small = ImageShape { rows: 4, ..shape() };
        let inputs = [("vectors", VectorImageShape(shape()).into()), ("region", Grid::from(&small).into())];
        assert!(NodeRig::new::<Shear>("", &inputs).is_err());
    }
}
