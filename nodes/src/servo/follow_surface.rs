//! `follow_surface`: the rolling with which a flat sensor follows a curved surface.
//!
//! The pad is tangent to the surface where it touches, so its normal z is the normal of the surface at the contact.
//! While the contact moves over the surface by d in the plane of the sensor, the normal changes by dz = B d, where the
//! 2 by 2 matrix B is the shape operator of the surface, with the sign of z. It is learned along the way by normalized
//! least mean squares, and forgotten slowly across it:
//!
//! ```text
//! B += (1 - exp(-|d| / D)) (dz - B d) d' / (d' d) - (1 - exp(-|d| / 4D)) B (I - d d' / (d' d))
//! ```
//!
//! A sensor that is guided with v must roll so that dz/dt = B v. The rotation ω changes z by ω × z, which is (ω_y, -ω_x)
//! in the plane of the sensor.

use nalgebra::{IsometryMatrix3, Matrix2, Rotation2, Rotation3, Translation3, Vector2, Vector3};
use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::{Pose, Scalar, Twist};

use crate::usual::USUAL_LENGTH_M;

/// Rolls a sensor as the surface curves on which a guide moves it.
///
/// A controller that keeps the contact in the middle of the pad rolls only after the contact has left the middle: the
/// faster the guide and the steeper the surface, the further the contact stays behind. On a cylinder of the radius r the
/// sensor must roll with v / r. This node learns from the way of the contact how the surface curves, and rolls at once
/// with the speed of `in.twist`. Only the rest is left to the controller. Add its twist to the servoing and the guidance
/// with a `twist_adder`.
///
/// Where a stroke turns back, the rolling turns back with it, and the surface is known from before. The sensor rolls
/// about the contact, as behind a `pivot`. An arm with compliant joints swings when its rolling turns at once: with a
/// `share` below 1 the contact stays behind a little, and the turns are softer.
///
/// **Learning.** The normal of the pad is that of the surface, and the contact moves on the surface: both are measured,
/// so a sensor that lags or oscillates still measures the surface. The curvature counts over the last `distance_m` of the
/// way, for each direction by itself: a step across forgets a stroke four times more slowly. Without a contact for
/// `reset_after_ms` the surface is unknown again, and counts as flat.
///
/// The curvature of a surface with a smaller radius than `min_radius_m` counts as that radius. An edge is no curvature
/// that one way over it could teach.
///
/// Without `in.x`, `in.y` or a guide, the twist is absent.
///
/// ```toml
/// [nodes.follow]                      # rolls as the surface curves, with the speed of the scan
/// type = "follow_surface"
/// in.twist = "scan.twist"
/// in.x = "moments.x"
/// in.y = "moments.y"
/// in.pose = "state.sensor_pose"
/// ```
#[derive(Describe)]
pub struct FollowSurface {
    params: Params,
}

/// Parameters of `follow_surface`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Distance of the contact over the surface within which 63 % of a new curvature are learned.
    #[param(unit = "m", above = 0.0, usual = ..=USUAL_LENGTH_M, default = 0.015)]
    distance_m: f64,
    /// Smallest radius that is followed.
    #[param(unit = "m", above = 0.0, default = 0.02)]
    min_radius_m: f64,
    /// Part of the rolling that is not left to the controller.
    #[param(unit = "1", range = 0.0..=1.0, default = 1.0)]
    share: f64,
}

/// What `follow_surface` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The guide's motion over the surface.
    #[port(frame = "A", optional, sampled)]
    twist: Option<In<'a, Twist>>,
    /// Centre of the contact along the sensor's x, from the middle of the pad.
    #[port(unit = "m", frame = "A", quantity = "x")]
    x: In<'a, Scalar>,
    /// Centre of the contact along the sensor's y, from the middle of the pad.
    #[port(unit = "m", frame = "A", quantity = "y")]
    y: In<'a, Scalar>,
    /// Pose of the sensor in the base.
    #[port(frame = "A", reference = "B", quantity = "sensor_pose", sampled)]
    pose: In<'a, Pose>,
}

/// What `follow_surface` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The rolling about the contact; absent without a guide.
    #[port(frame = "A")]
    twist: Out<Twist>,
}

/// What `follow_surface` remembers.
#[derive(State)]
pub struct State {
    surface: Option<Surface>,
}

/// A surface, as the contact has found it.
#[derive(Debug, Clone, Copy)]
struct Surface {
    /// The contact in the base, with the axes of the sensor, where the sensor has learned last.
    at: IsometryMatrix3<f64>,
    /// Change of the normal in the plane of the sensor per way of the contact, with those axes [rad/m].
    bend: Matrix2<f64>,
}

/// Way of the contact from one lesson to the next: well above the noise of its place [m].
const LESSON_M: f64 = 0.003;

/// A curvature across the way is forgotten over so many times the distance within which one along it is learned [1].
const ACROSS: f64 = 4.0;

impl Surface {
    /// Returns a flat surface.
    fn flat(at: IsometryMatrix3<f64>) -> Self {
        Self { at, bend: Matrix2::zeros() }
    }

    fn is_finite(&self) -> bool {
        self.at.to_homogeneous().iter().chain(&self.bend).all(|part| part.is_finite())
    }

    /// Learns from the contact, if it has moved far enough.
    fn learn(&mut self, contact: &IsometryMatrix3<f64>, distance: f64) {
        let moved = self.at.inv_mul(contact);
        let way = moved.translation.vector.xy();
        if way.norm() < LESSON_M {
            return;
        }
        let tilt = (moved.rotation * Vector3::z()).xy();
        let along = way * way.transpose() / way.norm_squared();
        let [new, old] = [distance, ACROSS * distance].map(|distance| 1.0 - libm::exp(-way.norm() / distance));
        let found = tilt * way.transpose() / way.norm_squared();
        self.bend += (found - self.bend * along) * new - self.bend * (Matrix2::identity() - along) * old;
        let turn = turn(&moved.rotation);
        *self = Self { at: *contact, bend: turn.transpose() * self.bend * turn };
    }

    /// Returns the change of the normal for a velocity of the sensor over the surface, both in the plane of a sensor
    /// with these axes in the base [rad/s].
    fn tilting(&self, axes: &Rotation3<f64>, velocity: Vector2<f64>) -> Vector2<f64> {
        let turn = turn(&(self.at.rotation.inverse() * axes));
        turn.inverse() * (self.bend * (turn * velocity))
    }
}

/// Returns the part of a rotation that is about z.
fn turn(rotation: &Rotation3<f64>) -> Rotation2<f64> {
    let m = rotation.matrix();
    Rotation2::new(libm::atan2(m[(1, 0)] - m[(0, 1)], m[(0, 0)] + m[(1, 1)]))
}

impl Node for FollowSurface {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self { params })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let (pose, at) = (&inputs.pose.0, Vector3::new(*inputs.x, *inputs.y, 0.0));
        let contact = pose * Translation3::from(at);
        let surface = state.surface.get_or_insert_with(|| Surface::flat(contact));
        surface.learn(&contact, self.params.distance_m);
        if !surface.is_finite() {
            *surface = Surface::flat(contact);
        }
        let Some(guide) = inputs.twist else { return };
        let velocity = guide.linear().xy();
        let tilting =
            surface.tilting(&pose.rotation, velocity).cap_magnitude(velocity.norm() / self.params.min_radius_m);
        let rolling = Vector3::new(-tilting.y, tilting.x, 0.0) * self.params.share;
        out.twist.set(Twist::new(-rolling.cross(&at), rolling));
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{PoseShape, ScalarShape, Shape, TwistShape, Unit};

    use super::*;

    /// A pad that touches a cylinder along the base's y. The contact is where the test says.
    struct Cylinder {
        rig: NodeRig,
        radius: f64,
        /// Way of the contact around the cylinder and along it, from its top [m].
        way: [f64; 2],
        /// Turn of the pad about its normal [rad].
        yaw: f64,
        /// The contact on the pad [m].
        at: Vector3<f64>,
        /// The guide's velocity around the cylinder and along it [m/s].
        guide: Option<[f64; 2]>,
    }

    impl Cylinder {
        fn new(params: &str, radius: f64) -> Self {
            let place = || Shape::from(ScalarShape::of(Unit::METRE));
            let pose = PoseShape::default().into();
            let wires = [("twist", Shape::from(TwistShape)), ("x", place()), ("y", place()), ("pose", pose)];
            let rig = NodeRig::new::<FollowSurface>(params, &wires).unwrap();
            Self { rig, radius, way: [0.0; 2], yaw: 0.0, at: Vector3::zeros(), guide: Some([0.04, 0.0]) }
        }

        /// Shows the pad to the node, and returns the rolling about the base's x and y, had the pad no yaw [rad/s].
        fn step(&mut self) -> Option<[f64; 2]> {
            // A pad that looks down: its z is the base's -z at the top.
            let down = Rotation3::from_axis_angle(&Vector3::y_axis(), std::f64::consts::PI);
            let roll = Rotation3::from_axis_angle(&Vector3::y_axis(), self.way[0] / self.radius) * down;
            let contact = roll * Vector3::new(0.0, self.way[1], -self.radius);
            let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), self.yaw);
            let rotation = roll * turn;
            let pose = IsometryMatrix3::from_parts(Translation3::from(contact - rotation * self.at), rotation);
            if let Some([around, along]) = self.guide {
                // The pad that looks down has its x along the base's -x.
                self.rig.set("twist", Twist::new(turn.inverse() * Vector3::new(-around, along, 0.0), Vector3::zeros()));
            }
            self.rig.set("pose", Pose(pose));
            self.rig.set("x", self.at.x);
            self.rig.set("y", self.at.y);
            self.rig.step_ms(4.0);
            let twist = self.rig.get::<Twist>("twist")?;
            let moved = twist.linear() + twist.angular().cross(&self.at);
            assert!(moved.amax() <= 1e-15 || moved.x.is_nan(), "the contact rests on the pad: {moved}");
            let rolling = turn * twist.angular();
            assert!(rolling.z == 0.0 || rolling.z.is_nan());
            Some([-rolling.x, rolling.y])
        }

        /// Moves the contact over the surface by a way around and along the cylinder, and returns the rolling in the end.
        fn go(&mut self, [around, along]: [f64; 2]) -> [f64; 2] {
            let steps = (libm::hypot(around, along) / 0.000_16).ceil();
            for _ in 0..steps as usize {
                self.way = [self.way[0] + around / steps, self.way[1] + along / steps];
                self.step();
            }
            self.step().unwrap()
        }
    }

    fn assert_rolls(found: [f64; 2], expected: [f64; 2], within: f64) {
        let is_near = found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() <= within);
        assert!(is_near, "{found:?}, not {expected:?}");
    }

    proptest! {
        #[test]
        fn around_a_cylinder_it_rolls_with_its_speed_over_its_radius(
            radius in 0.03..0.3_f64, angle in -3.1..3.1_f64, yaw in -3.1..3.1_f64,
            at in prop::array::uniform2(-0.02..0.02_f64),
        ) {
            let mut cylinder = Cylinder::new("", radius);
            (cylinder.yaw, cylinder.at) = (yaw, Vector3::new(at[0], at[1], 0.0));
            let (sine, cosine) = libm::sincos(angle);
            cylinder.guide = Some([0.04 * cosine, 0.04 * sine]);
            // Around by at most a quarter, to and fro.
            let way = 0.05 * cosine.signum();
            for way in [way, -way, way, -way, way] {
                cylinder.go([way * cosine.abs(), way * sine * cosine.signum()]);
            }
            // The normal of the pad follows the surface in the sense of the way, by v / r.
            assert_rolls(cylinder.step().unwrap(), [0.0, 0.04 * cosine / radius], 2e-3);
        }
    }

    #[test]
    fn a_contact_that_swings_on_the_pad_and_a_pad_that_turns_change_nothing() {
        let mut cylinder = Cylinder::new("", 0.08);
        for i in 0..1000 {
            let phase = 0.02 * f64::from(i);
            cylinder.way[0] = 0.000_1 * f64::from(i);
            cylinder.at = Vector3::new(0.01 * libm::sin(phase), 0.005 * libm::cos(phase), 0.0);
            cylinder.yaw = libm::sin(0.3 * phase);
            cylinder.step();
        }
        // A pad that turned while it learned has mixed up the two directions a little.
        assert_rolls(cylinder.step().unwrap(), [0.0, 0.5], 0.02);
    }

    #[test]
    fn where_the_guide_turns_back_the_rolling_turns_back() {
        let mut cylinder = Cylinder::new("", 0.08);
        assert_rolls(cylinder.go([0.1, 0.0]), [0.0, 0.5], 1e-3);
        for guide in [-0.04, 0.04, 0.02] {
            cylinder.guide = Some([guide, 0.0]);
            assert_rolls(cylinder.step().unwrap(), [0.0, guide / 0.08], 1e-3);
        }
        cylinder.guide = Some([0.0, 0.04]);
        assert_rolls(cylinder.step().unwrap(), [0.0, 0.0], 1e-9);
        cylinder.yaw = 1.5;
        cylinder.guide = Some([0.04, 0.0]);
        assert_rolls(cylinder.step().unwrap(), [0.0, 0.5], 1e-3);
    }

    #[test]
    fn a_curvature_is_learned_along_the_way_and_forgotten_slowly_across() {
        let mut cylinder = Cylinder::new("distance_m = 0.02", 0.08);
        let learned = cylinder.go([0.0215, 0.0])[1] / 0.5;
        assert!((0.6..0.67).contains(&learned), "{learned}");
        cylinder.go([0.1, 0.0]);
        let kept = cylinder.go([0.0, 0.04])[1] / 0.5;
        assert!((0.59..0.63).contains(&kept), "half of the distance of 80 mm across: {kept}");
        let gone = cylinder.go([0.0, 0.8])[1] / 0.5;
        assert!(gone < 1e-4, "{gone}");
    }

    #[test]
    fn a_share_of_the_rolling_is_left_to_the_controller() {
        let mut cylinder = Cylinder::new("share = 0.4", 0.08);
        cylinder.go([0.2, 0.0]);
        assert_rolls(cylinder.step().unwrap(), [0.0, 0.4 * 0.5], 1e-4);
    }

    #[test]
    fn an_edge_counts_as_the_smallest_radius() {
        let mut cylinder = Cylinder::new("min_radius_m = 0.03", 0.01);
        cylinder.go([0.1, 0.0]);
        assert_rolls(cylinder.step().unwrap(), [0.0, 0.04 / 0.03], 1e-9);
    }

    #[test]
    fn without_a_guide_or_a_contact_it_does_not_roll() {
        let mut cylinder = Cylinder::new("", 0.08);
        cylinder.guide = None;
        assert_eq!(cylinder.step(), None);
        cylinder.guide = Some([0.04, 0.0]);
        cylinder.go([0.1, 0.0]);
        cylinder.rig.lose("x");
        cylinder.rig.step_ms(30.0);
        assert_eq!(cylinder.rig.get::<Twist>("twist"), None);
        cylinder.rig.step();
        assert_rolls(cylinder.step().unwrap(), [0.0, 0.0], 0.0);
    }

    #[test]
    fn a_pose_that_is_no_number_is_not_learned() {
        let mut cylinder = Cylinder::new("", 0.08);
        cylinder.go([0.05, 0.0]);
        let way = std::mem::replace(&mut cylinder.way[0], f64::NAN);
        cylinder.step();
        cylinder.way[0] = way;
        cylinder.step();
        assert_rolls(cylinder.go([0.1, 0.0]), [0.0, 0.5], 1e-3);
    }
}
