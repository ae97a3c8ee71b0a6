//! Objects: a shape with a pose, a stiffness, a compliant mount and a script of motions.

use parry3d_f64::math::{Pose3, Rot3, Vec3};
use parry3d_f64::shape::{Ball, Cuboid, Cylinder};
use tactflow_runtime::node::Param;
use tactflow_runtime::signal::Pose;

use super::shape::{Geometry, pose3};
use super::wrench::Wrench;
use crate::motion::pose::pose_of;
use crate::usual::{USUAL_RAD, USUAL_REACH_M};

/// Shape of an object.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
pub enum ShapeKind {
    /// An infinite plane.
    Plane,
    /// A ball.
    Ball,
    /// A box with edges.
    Box,
    /// A cylinder with round ends along its y.
    Pen,
    /// A cylinder with sharp rims along its y.
    Disc,
    /// An ellipsoid.
    Ellipsoid,
    /// A round cable along a smooth curve.
    Cable,
}

/// Parameters of an object.
#[derive(Debug, Clone, Param)]
pub struct ObjectParams {
    /// Shape.
    pub(crate) shape: ShapeKind,
    /// Position of its centre relative to the sensor at the start, in the sensor's axes; for a plane, a point on it.
    #[param(unit = "m", usual = -USUAL_REACH_M..=USUAL_REACH_M)]
    pub(crate) at: [f64; 3],
    /// Roll, pitch and yaw in the sensor's axes at the start.
    #[param(unit = "rad", usual = -USUAL_RAD..=USUAL_RAD, default = [0.0; 3])]
    pub(crate) turn: [f64; 3],
    /// Radius of a ball, a pen, a disc or a cable.
    #[param(unit = "m", above = 0.0, usual = ..=USUAL_REACH_M)]
    pub(crate) radius: Option<f64>,
    /// Length of a pen between the centres of its ends, or thickness of a disc.
    #[param(unit = "m", above = 0.0, usual = ..=USUAL_REACH_M)]
    pub(crate) length: Option<f64>,
    /// Edge lengths of a box, or full axes of an ellipsoid.
    #[param(unit = "m", usual = ..=USUAL_REACH_M)]
    pub(crate) size: Option<[f64; 3]>,
    /// Points that a cable passes through, in its own frame.
    #[param(unit = "m")]
    pub(crate) points: Option<Vec<[f64; 3]>>,
    /// Stiffness of its surface under a tactel of 5 mm by 5 mm; rigid if not given.
    #[param(unit = "N/m", above = 0.0)]
    pub(crate) stiffness: Option<f64>,
    /// Stiffness of its mount in every direction; fixed if not given.
    #[param(unit = "N/m", above = 0.0)]
    pub(crate) mount: Option<f64>,
    /// Mass, used with a `mount`; the damping of the mount is half of the critical one.
    #[param(unit = "kg", above = 0.0, default = 1.0)]
    pub(crate) mass: f64,
    /// Stiffness of its mount against a rotation about its centre, which must stay below 0.3 rad; it does not turn under a
    /// load if not given.
    #[param(unit = "N m/rad", above = 0.0)]
    pub(crate) turn_mount: Option<f64>,
    /// Moment of inertia about every axis, used with a `turn_mount`; its damping is half of the critical one.
    #[param(unit = "kg m2", above = 0.0, default = 0.001)]
    pub(crate) inertia: f64,
    /// Largest random offset of its position along the sensor's x and y; it depends on the seed.
    #[param(unit = "m", range = 0.0.., default = 0.0)]
    pub(crate) scatter: f64,
    /// Motions over time.
    #[param(default = vec![])]
    pub(crate) motion: Vec<ScriptedMove>,
}

/// A motion of an object over time.
#[derive(Debug, Clone, Param)]
pub struct ScriptedMove {
    /// Start of the motion.
    #[param(unit = "s", range = 0.0..)]
    pub(crate) from_s: f64,
    /// End of the motion.
    #[param(unit = "s", range = 0.0..)]
    pub(crate) to_s: f64,
    /// Displacement in the sensor's axes at the start.
    #[param(unit = "m", default = [0.0; 3])]
    pub(crate) by: [f64; 3],
    /// Rotation about its centre and the sensor's z at the start.
    #[param(unit = "rad", default = 0.0)]
    pub(crate) turn: f64,
    /// Whether the speed is the same all the time, and so begins and ends with a jump. Otherwise the motion speeds up
    /// and slows down smoothly, and is 1.5 times as fast in the middle.
    #[param(default = false)]
    pub(crate) steady: bool,
}

/// An object in the base.
pub struct Object {
    pub(super) shape: Geometry,
    /// Compliance of its surface under a tactel of 5 mm by 5 mm [m/N].
    pub(super) softness: f64,
    /// The same, without a disturbance [m/N].
    own_softness: f64,
    /// Whether it touches nothing, because it is gone.
    pub(super) is_gone: bool,
    /// Velocity of a disturbance [m/s].
    drift: Vec3,
    home: Pose3,
    /// Motions, with displacements in the base.
    script: Vec<ScriptedMove>,
    /// Axis of its rotation, in the base.
    axis: Vec3,
    /// Stiffness of the mount [N/m] and mass on it [kg].
    mount: Option<(f64, f64)>,
    /// Deflection of the mount [m].
    pub(super) sag: Vec3,
    sag_speed: Vec3,
    /// Stiffness of the mount against a rotation [N m/rad] and moment of inertia [kg m²].
    turn_mount: Option<(f64, f64)>,
    /// Rotation of the mount in the base, as its axis times its angle [rad].
    pub(super) tilt: Vec3,
    tilt_speed: Vec3,
    pub(super) pose: Pose3,
    velocity: Vec3,
    /// Angular velocity in the base [rad/s].
    spin: Vec3,
}

/// Damping of a mount as a fraction of the critical one [1].
pub(super) const MOUNT_DAMPING: f64 = 0.5;

impl Object {
    /// Returns an object placed relative to a sensor that starts at `start` in the base, shifted by `offset` [m] along
    /// the sensor's x and y.
    ///
    /// # Errors
    /// If a parameter of the shape is missing, not used or not positive, or if a motion has no duration.
    pub fn new(params: &ObjectParams, start: Pose3, offset: [f64; 2]) -> Result<Self, String> {
        let shape = shape_of(params)?;
        if let Some(step) = params.motion.iter().find(|step| step.to_s <= step.from_s) {
            return Err(format!("a motion must end after it starts, not go from {} s to {} s", step.from_s, step.to_s));
        }
        let at = Vec3::from(params.at) + Vec3::new(offset[0], offset[1], 0.0);
        let home = start * Pose3::from_parts(at, pose3(&Pose(pose_of([0.0; 3], params.turn))).rotation);
        let in_base =
            |step: &ScriptedMove| ScriptedMove { by: (start.rotation * Vec3::from(step.by)).into(), ..step.clone() };
        let softness = params.stiffness.map_or(0.0, |stiffness| 1.0 / stiffness);
        Ok(Self {
            script: params.motion.iter().map(in_base).collect(),
            axis: start.rotation * Vec3::Z,
            mount: params.mount.map(|stiffness| (stiffness, params.mass)),
            turn_mount: params.turn_mount.map(|stiffness| (stiffness, params.inertia)),
            ..Self::free(shape, softness, home)
        })
    }

    /// Returns an object that is at rest at a pose in the base until [`Object::place`] moves it. Its surface has a
    /// compliance of `softness` under a tactel of 5 mm by 5 mm [m/N].
    #[must_use]
    pub fn free(shape: Geometry, softness: f64, pose: Pose3) -> Self {
        Self {
            shape,
            softness,
            own_softness: softness,
            is_gone: false,
            drift: Vec3::ZERO,
            home: pose,
            script: Vec::new(),
            axis: Vec3::Z,
            mount: None,
            sag: Vec3::ZERO,
            sag_speed: Vec3::ZERO,
            turn_mount: None,
            tilt: Vec3::ZERO,
            tilt_speed: Vec3::ZERO,
            pose,
            velocity: Vec3::ZERO,
            spin: Vec3::ZERO,
        }
    }

    /// Moves the object to a pose, with a velocity of its centre [m/s] and an angular velocity [rad/s] in the base.
    pub fn place(&mut self, pose: Pose3, velocity: Vec3, spin: Vec3) {
        (self.pose, self.velocity, self.spin) = (pose, velocity, spin);
    }

    /// Disturbs the object from now on: it moves at `velocity` in the base [m/s], its surface is stiffer by a factor, or
    /// it is gone.
    pub fn disturb(&mut self, velocity: Vec3, stiffness: f64, is_gone: bool) {
        (self.drift, self.softness, self.is_gone) = (velocity, self.own_softness / stiffness, is_gone);
    }

    /// Advances by `dt` [s] to `time` [s] under a load, with its moment about the centre of the object.
    pub fn step(&mut self, time: f64, dt: f64, load: &Wrench) {
        give_way(self.mount, [&mut self.sag, &mut self.sag_speed], load.force, dt);
        give_way(self.turn_mount, [&mut self.tilt, &mut self.tilt_speed], load.moment, dt);
        self.home.translation += self.drift * dt;
        let (mut position, mut velocity) = (self.home.translation + self.sag, self.sag_speed + self.drift);
        let (mut angle, mut spin) = (0.0, 0.0);
        for step in &self.script {
            let span = step.to_s - step.from_s;
            let t = (time - step.from_s) / span;
            let (part, rate) = if step.steady { ramp(t) } else { ease(t) };
            position += Vec3::from(step.by) * part;
            velocity += Vec3::from(step.by) * (rate / span);
            angle += step.turn * part;
            spin += step.turn * rate / span;
        }
        let (sin, cos) = libm::sincos(angle / 2.0);
        let turned = Rot3::from_xyzw(self.axis.x * sin, self.axis.y * sin, self.axis.z * sin, cos);
        let turned = turned * self.home.rotation;
        let tilted = if self.turn_mount.is_some() { Rot3::from_scaled_axis(self.tilt) * turned } else { turned };
        self.pose = Pose3::from_parts(position, tilted);
        // The tilt is small, so the rate of its rotation vector is its angular velocity.
        (self.velocity, self.spin) = (velocity, self.axis * spin + self.tilt_speed);
    }

    /// Returns its velocity at a point in the base [m/s].
    #[must_use]
    pub fn velocity_at(&self, point: Vec3) -> Vec3 {
        self.velocity + self.spin.cross(point - self.pose.translation)
    }

    /// Returns its angular velocity in the base [rad/s].
    #[must_use]
    pub fn spin(&self) -> Vec3 {
        self.spin
    }

    /// Returns the energy of the mount and of the mass on it [J].
    #[cfg(test)]
    pub(super) fn energy(&self) -> f64 {
        let energy = |mount: Option<(f64, f64)>, way: Vec3, speed: Vec3| {
            let energy = |(spring, mass)| spring * way.length_squared() + mass * speed.length_squared();
            mount.map_or(0.0, energy) / 2.0
        };
        energy(self.mount, self.sag, self.sag_speed) + energy(self.turn_mount, self.tilt, self.tilt_speed)
    }
}

/// Advances a damped spring with a mass on it by `dt` [s] under a load.
fn give_way(mount: Option<(f64, f64)>, [way, speed]: [&mut Vec3; 2], load: Vec3, dt: f64) {
    let Some((stiffness, mass)) = mount else { return };
    let damping = 2.0 * MOUNT_DAMPING * (stiffness * mass).sqrt();
    *speed += (load - *way * stiffness - *speed * damping) / mass * dt;
    *way += *speed * dt;
}

/// Returns a value that goes from 0 to 1 for t from 0 to 1 without a jump of its slope, and the slope.
fn ease(t: f64) -> (f64, f64) {
    if (0.0..1.0).contains(&t) { (t * t * (3.0 - 2.0 * t), 6.0 * t * (1.0 - t)) } else { (f64::from(t >= 1.0), 0.0) }
}

/// Returns a value that goes from 0 to 1 for t from 0 to 1 with the slope 1, and the slope.
fn ramp(t: f64) -> (f64, f64) {
    if (0.0..1.0).contains(&t) { (t, 1.0) } else { (f64::from(t >= 1.0), 0.0) }
}

fn shape_of(params: &ObjectParams) -> Result<Geometry, String> {
    let (word, _) = ShapeKind::CONTENTS.words[params.shape as usize];
    let used: &[&str] = match params.shape {
        ShapeKind::Plane => &[],
        ShapeKind::Ball => &["radius"],
        ShapeKind::Box | ShapeKind::Ellipsoid => &["size"],
        ShapeKind::Pen | ShapeKind::Disc => &["radius", "length"],
        ShapeKind::Cable => &["radius", "points"],
    };
    let ObjectParams { radius, length, size, points, .. } = params;
    let given = [
        ("radius", radius.is_some()),
        ("length", length.is_some()),
        ("size", size.is_some()),
        ("points", points.is_some()),
    ];
    if let Some((name, _)) = given.iter().find(|(name, is_given)| *is_given && !used.contains(name)) {
        return Err(format!("a {word} does not use `{name}`: remove it"));
    }
    if let Some((name, _)) = given.iter().find(|(name, is_given)| !is_given && used.contains(name)) {
        return Err(format!("a {word} needs `{name}`"));
    }
    if size.is_some_and(|size| !size.iter().all(|size| *size > 0.0 && size.is_finite())) {
        return Err("each `size` must be greater than 0".to_owned());
    }
    let is_far = |pair: &[[f64; 3]]| Vec3::from(pair[0]).distance(Vec3::from(pair[1])) > 1e-4;
    if points.as_ref().is_some_and(|points| points.len() < 2 || !points.windows(2).all(is_far)) {
        return Err("`points` of a cable must be two or more, each at least 0.1 mm from the one before".to_owned());
    }
    let (radius, half_size) = (radius.unwrap_or_default(), size.unwrap_or_default().map(|size| size / 2.0));
    Ok(match params.shape {
        ShapeKind::Plane => Geometry::plane(),
        ShapeKind::Ball => Geometry::Ball(Ball::new(radius)),
        ShapeKind::Box => Geometry::Box(Cuboid::new(Vec3::from(half_size))),
        ShapeKind::Ellipsoid => Geometry::ellipsoid(half_size),
        ShapeKind::Pen => Geometry::pen(radius, length.unwrap_or_default()),
        ShapeKind::Disc => Geometry::Disc(Cylinder::new(length.unwrap_or_default() / 2.0, radius)),
        ShapeKind::Cable => Geometry::cable(radius, points.as_deref().unwrap_or_default()),
    })
}
