//! Objects: a shape with a place, a stiffness, a mount that gives way, and a script of how it is moved.

use parry3d_f64::math::{Pose3, Rot3, Vec3};
use parry3d_f64::shape::{Ball, Cuboid};
use tactflow_runtime::node::{NonNegative, Positive};
use tactflow_runtime::params;

use super::shape::Shape;

words! {
    /// What an object looks like.
    Look {
        /// A flat surface that has no end.
        Plane = "plane",
        /// A ball.
        Ball = "ball",
        /// A box with edges.
        Box = "box",
        /// A cylinder with round ends, along its y.
        Pen = "pen",
        /// An ellipsoid.
        Ellipsoid = "ellipsoid",
        /// A round cable along a smooth curve.
        Cable = "cable",
    }
}

params! {
    Thing:
    /// What it looks like: `plane`, `ball`, `box`, `pen`, `ellipsoid` or `cable`.
    shape: Look,
    /// Where its middle is, seen from where the sensor starts, in the sensor's axes; of a plane, where it begins [m].
    at: [f64; 3],
    /// Its roll, pitch and yaw in the sensor's axes at the start [rad].
    turn: [f64; 3] = [0.0; 3],
    /// Radius of a ball, a pen or a cable [m].
    radius: Option<Positive>,
    /// Length of a pen between the centres of its ends [m].
    length: Option<Positive>,
    /// Edges of a box, or axes of an ellipsoid, from end to end [m].
    size: Option<[f64; 3]>,
    /// Points that a cable goes through, in its own frame [m].
    points: Option<Vec<[f64; 3]>>,
    /// Stiffness of its surface under a tactel of 5 mm by 5 mm; rigid unless given [N/m].
    stiffness: Option<Positive>,
    /// Stiffness of the mount that it stands on, in every direction; fixed unless given [N/m].
    mount: Option<Positive>,
    /// Its mass, which counts if it stands on a mount; the mount's damping is half of the critical [kg].
    mass: Positive = Positive(1.0),
    /// How far its place is off at most, along the sensor's x and y, by the seed [m].
    scatter: NonNegative = NonNegative(0.0),
    /// How it is moved.
    motion: Vec<Move> = vec![],
}

params! {
    Move:
    /// When it begins [s].
    from_s: NonNegative,
    /// When it ends [s].
    to_s: NonNegative,
    /// By how much, in the sensor's axes at the start [m].
    by: [f64; 3] = [0.0; 3],
    /// By how much it is turned about its middle, about the sensor's z at the start [rad].
    turn: f64 = 0.0,
}

/// An object in the base.
pub struct Object {
    pub(super) shape: Shape,
    /// How much its surface gives way under a tactel of 5 mm by 5 mm [m/N].
    pub(super) softness: f64,
    home: Pose3,
    script: Vec<Step>,
    /// What it is turned about, in the base.
    axis: Vec3,
    /// Stiffness of the mount [N/m], and the mass on it [kg].
    mount: Option<(f64, f64)>,
    /// How far the mount has given way [m].
    sag: Vec3,
    sag_speed: Vec3,
    pub(super) pose: Pose3,
    velocity: Vec3,
    /// [rad/s]
    spin: f64,
}

/// A step of the script.
struct Step {
    from: f64,
    to: f64,
    /// In the base.
    by: Vec3,
    turn: f64,
}

/// Damping of a mount, of the critical.
pub(super) const MOUNT_DAMPING: f64 = 0.5;

impl Object {
    /// An object seen from a sensor that starts at `start` in the base, moved aside by `offset` in the sensor's axes.
    ///
    /// # Errors
    /// What is wrong with its measures.
    pub fn new(thing: &Thing, start: Pose3, offset: [f64; 2]) -> Result<Self, String> {
        let shape = shape_of(thing)?;
        if let Some(step) = thing.motion.iter().find(|step| *step.to_s <= *step.from_s) {
            return Err(format!("a motion from {} s to {} s lasts no time", *step.from_s, *step.to_s));
        }
        let at = Vec3::from(thing.at) + Vec3::new(offset[0], offset[1], 0.0);
        let home = start * Pose3::from_parts(at, turned(thing.turn));
        let step = |step: &Move| Step {
            from: *step.from_s,
            to: *step.to_s,
            by: start.rotation * Vec3::from(step.by),
            turn: step.turn,
        };
        Ok(Self {
            shape,
            softness: thing.stiffness.map_or(0.0, |stiffness| 1.0 / *stiffness),
            home,
            script: thing.motion.iter().map(step).collect(),
            axis: start.rotation * Vec3::Z,
            mount: thing.mount.map(|stiffness| (*stiffness, *thing.mass)),
            sag: Vec3::ZERO,
            sag_speed: Vec3::ZERO,
            pose: home,
            velocity: Vec3::ZERO,
            spin: 0.0,
        })
    }

    /// Goes on by `dt` to `time` [s] under the force of the pad [N].
    pub fn step(&mut self, time: f64, dt: f64, force: Vec3) {
        if let Some((stiffness, mass)) = self.mount {
            let damping = 2.0 * MOUNT_DAMPING * (stiffness * mass).sqrt();
            self.sag_speed += (force - self.sag * stiffness - self.sag_speed * damping) / mass * dt;
            self.sag += self.sag_speed * dt;
        }
        let (mut place, mut velocity) = (self.home.translation + self.sag, self.sag_speed);
        let (mut turn, mut spin) = (0.0, 0.0);
        for step in &self.script {
            let span = step.to - step.from;
            let (share, rate) = eased((time - step.from) / span);
            place += step.by * share;
            velocity += step.by * (rate / span);
            turn += step.turn * share;
            spin += step.turn * rate / span;
        }
        let (sin, cos) = libm::sincos(turn / 2.0);
        let turned = Rot3::from_xyzw(self.axis.x * sin, self.axis.y * sin, self.axis.z * sin, cos);
        self.pose = Pose3::from_parts(place, turned * self.home.rotation);
        (self.velocity, self.spin) = (velocity, spin);
    }

    /// How fast it moves at a point in the base [m/s].
    #[must_use]
    pub fn velocity_at(&self, point: Vec3) -> Vec3 {
        self.velocity + self.spin().cross(point - self.pose.translation)
    }

    /// How far its mount has given way [m].
    #[must_use]
    pub const fn sag(&self) -> Vec3 {
        self.sag
    }

    /// How it turns, in the base [rad/s].
    #[must_use]
    pub fn spin(&self) -> Vec3 {
        self.axis * self.spin
    }

    /// The energy of the mount and of the mass on it [J].
    #[cfg(test)]
    pub(super) fn energy(&self) -> f64 {
        let energy = |(stiffness, mass): (f64, f64)| {
            stiffness * self.sag.length_squared() + mass * self.sag_speed.length_squared()
        };
        self.mount.map_or(0.0, energy) / 2.0
    }
}

/// From 0 to 1 without a jump of speed; and its rate.
fn eased(t: f64) -> (f64, f64) {
    if (0.0..1.0).contains(&t) { (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t)) } else { (f64::from(t >= 1.0), 0.0) }
}

/// A rotation from roll, pitch and yaw.
fn turned(rpy: [f64; 3]) -> Rot3 {
    let pose = crate::arm::mount::pose_of([0.0; 3], rpy);
    let quaternion = nalgebra::UnitQuaternion::from_rotation_matrix(&pose.rotation);
    Rot3::from_xyzw(quaternion.i, quaternion.j, quaternion.k, quaternion.w)
}

fn shape_of(thing: &Thing) -> Result<Shape, String> {
    let look = thing.shape;
    let given = |name: &str| format!("a {look} needs `{name}`");
    let radius = || thing.radius.map(|radius| *radius).ok_or_else(|| given("radius"));
    let size = || {
        let size = thing.size.ok_or_else(|| given("size"))?;
        let is_good = size.iter().all(|size| *size > 0.0 && size.is_finite());
        if is_good { Ok(size.map(|size| size / 2.0)) } else { Err("a size is greater than 0".to_owned()) }
    };
    let wanted: &[&str] = match look {
        Look::Plane => &[],
        Look::Ball => &["radius"],
        Look::Box | Look::Ellipsoid => &["size"],
        Look::Pen => &["radius", "length"],
        Look::Cable => &["radius", "points"],
    };
    let has = [
        ("radius", thing.radius.is_some()),
        ("length", thing.length.is_some()),
        ("size", thing.size.is_some()),
        ("points", thing.points.is_some()),
    ];
    if let Some((name, _)) = has.iter().find(|(name, is)| *is && !wanted.contains(name)) {
        return Err(format!("a {look} has no `{name}`"));
    }
    Ok(match look {
        Look::Plane => Shape::plane(),
        Look::Ball => Shape::Ball(Ball::new(radius()?)),
        Look::Box => Shape::Box(Cuboid::new(Vec3::from(size()?))),
        Look::Ellipsoid => Shape::ellipsoid(size()?),
        Look::Pen => Shape::pen(radius()?, *thing.length.ok_or_else(|| given("length"))?),
        Look::Cable => {
            let points = thing.points.as_ref().ok_or_else(|| given("points"))?;
            let is_far = |pair: &[[f64; 3]]| Vec3::from(pair[0]).distance(Vec3::from(pair[1])) > 1e-4;
            if points.len() < 2 || !points.windows(2).all(is_far) {
                return Err("a cable needs two points or more, each 0.1 mm or more from the one before".to_owned());
            }
            Shape::cable(radius()?, points)
        }
    })
}
