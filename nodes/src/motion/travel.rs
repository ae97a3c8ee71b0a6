//! The distance that a sensor has moved, for guidance that counts metres and not seconds.

use nalgebra::Vector3;
use tactflow_runtime::node::Tick;
use tactflow_runtime::signal::Pose;

/// Measures the steps of a sensor along the sensor's own axes. It does not add them up.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Odometer {
    last: Option<Vector3<f64>>,
}

impl Odometer {
    /// Returns the step since the last pose along the sensor's x and y, R' (p - p_last) [m]; zero for the first pose
    /// and for a step that is not finite.
    pub fn step(&mut self, pose: &Pose) -> [f64; 2] {
        let position = pose.0.translation.vector;
        let moved = self.last.replace(position).map_or_else(Vector3::zeros, |last| position - last);
        let step = pose.0.rotation.inverse_transform_vector(&moved);
        if step.iter().all(|part| part.is_finite()) { [step.x, step.y] } else { [0.0; 2] }
    }
}

/// Measures how far a sensor is inclined to its first pose.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Inclination {
    /// The sensor's z in the base, in the first pose.
    first: Option<Vector3<f64>>,
}

impl Inclination {
    /// Returns the angle between the sensor's z in a pose and in the first pose [rad]; NaN for a pose that is not finite.
    pub fn of(&mut self, pose: &Pose) -> f64 {
        let z = pose.0.rotation * Vector3::z();
        let first = self.first.get_or_insert(z);
        libm::atan2(first.cross(&z).norm(), first.dot(&z))
    }
}

/// The direction across parallel planes, in the plane of a sensor that moves over a surface.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Planes {
    /// The normal of the planes in the base: an axis of the sensor in the first pose.
    normal: Option<Vector3<f64>>,
}

/// A sensor whose plane is inclined to the normal by less than this has no direction across: the sine of 6° [1].
const MIN_ACROSS: f64 = 0.1;

impl Planes {
    /// Returns the unit vector across the planes in the x and y of the sensor. `axis` is the normal of the planes in the
    /// first pose, and the direction of a sensor that faces along the planes' normal.
    pub fn across(&mut self, pose: &Pose, axis: [f64; 2]) -> [f64; 2] {
        let first = || pose.0.rotation * Vector3::new(axis[0], axis[1], 0.0);
        let normal = pose.0.rotation.inverse_transform_vector(self.normal.get_or_insert_with(first));
        let length = libm::hypot(normal.x, normal.y);
        if length > MIN_ACROSS { [normal.x / length, normal.y / length] } else { axis }
    }
}

/// Detects that a sensor no longer makes progress, because an obstacle or a limit stops it.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Stall {
    /// Distance at the last progress [m].
    best: f64,
    /// Time of the last progress [ns].
    since: Option<i64>,
}

/// Time within which a sensor must make progress [ns].
const STALL_NS: i64 = 2_000_000_000;
/// Progress that it must make in that time, as a fraction of the distance at full speed [1].
const MIN_PROGRESS: f64 = 0.2;

impl Stall {
    /// Returns whether the `distance` [m] of a sensor that is commanded to move at `speed` [m/s] has stopped growing.
    ///
    /// Time in which the runtime holds all commands does not count.
    pub fn is_stuck(&mut self, distance: f64, speed: f64, tick: &Tick) -> bool {
        let since = *self.since.get_or_insert(tick.now);
        if tick.is_halted || distance > self.best + MIN_PROGRESS * speed * STALL_NS as f64 * 1e-9 {
            (self.best, self.since) = (distance.max(self.best), Some(tick.now));
            return false;
        }
        tick.now - since >= STALL_NS
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{IsometryMatrix3, Rotation3, Translation3};

    use super::*;

    fn pose(x: f64, y: f64, yaw: f64) -> Pose {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), yaw);
        Pose(IsometryMatrix3::from_parts(Translation3::new(x, y, 0.3), turn))
    }

    #[test]
    fn steps_are_along_the_sensors_own_axes() {
        let mut odometer = Odometer::default();
        let quarter = std::f64::consts::FRAC_PI_2;
        let cases = [
            (pose(0.5, 0.1, 0.0), [0.0, 0.0], "the first"),
            (pose(0.52, 0.07, 0.0), [0.02, -0.03], "along the axes of the base"),
            (pose(0.53, 0.07, quarter), [0.0, -0.01], "turned"),
            (pose(0.53, 0.07, 0.0), [0.0, 0.0], "a rotation moves no distance"),
        ];
        for (pose, expected, what) in cases {
            let step = odometer.step(&pose);
            assert!(step.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{what}: {step:?}");
        }
        odometer.step(&pose(1e308, 0.0, 0.7));
        assert_eq!(odometer.step(&pose(-1e308, 0.0, 0.7)), [0.0, 0.0], "a step that is not finite counts as none");
    }

    #[test]
    fn the_inclination_is_the_angle_between_the_normals() {
        let tilted = |roll: f64, yaw: f64| {
            let turn =
                Rotation3::from_axis_angle(&Vector3::z_axis(), yaw) * Rotation3::from_euler_angles(roll, 0.0, 0.0);
            Pose(IsometryMatrix3::from_parts(Translation3::identity(), turn))
        };
        let mut inclination = Inclination::default();
        for (pose, expected) in [(tilted(0.1, 0.0), 0.0), (tilted(0.1, 2.0), 0.168), (tilted(0.8, 0.0), 0.7)] {
            let angle = inclination.of(&pose);
            assert!((angle - expected).abs() < 1e-3, "{angle} {expected}");
        }
    }

    #[test]
    fn the_direction_across_keeps_to_the_planes_of_the_start() {
        let of = |turn: Rotation3<f64>| Pose(IsometryMatrix3::from_parts(Translation3::identity(), turn));
        let start = Rotation3::from_euler_angles(0.2, -0.4, 1.0);
        let mut planes = Planes::default();
        assert!((planes.across(&of(start), [0.0, 1.0])[1] - 1.0).abs() < 1e-12);
        let normal = start * Vector3::y();
        for turn in [[0.5, 0.0, 0.0], [0.0, 0.6, 0.0], [0.3, -0.7, 2.0]] {
            let pose = start * Rotation3::from_euler_angles(turn[0], turn[1], turn[2]);
            let [x, y] = planes.across(&of(pose), [0.0, 1.0]);
            assert!((libm::hypot(x, y) - 1.0).abs() < 1e-12);
            let along = pose * Vector3::new(y, -x, 0.0);
            assert!(along.dot(&normal).abs() < 1e-12, "{turn:?}");
        }
        let upright = start * Rotation3::from_euler_angles(std::f64::consts::FRAC_PI_2, 0.0, 0.0);
        assert_eq!(planes.across(&of(upright), [0.0, 1.0]), [0.0, 1.0]);
    }

    /// Returns when a sensor that moves at a fraction of its speed is found to be stuck, within 10 s [s].
    fn stuck_after(fraction: impl Fn(f64) -> f64, is_halted: bool) -> Option<f64> {
        let (mut stall, mut distance) = (Stall::default(), 0.0);
        (0..2500).find_map(|i| {
            let time = f64::from(i) * 0.004;
            distance += fraction(time) * 0.01 * 0.004;
            let tick = Tick { now: i64::from(i) * 4_000_000, is_halted, ..Tick::first() };
            stall.is_stuck(distance, 0.01, &tick).then_some(time)
        })
    }

    #[test]
    fn a_slow_sensor_is_not_stuck() {
        assert_eq!(stuck_after(|_| 1.0, false), None);
        assert_eq!(stuck_after(|_| 0.25, false), None);
        assert_eq!(stuck_after(|_| 0.0, false), Some(2.0));
        assert_eq!(stuck_after(|_| 0.0, true), None, "time with held commands does not count");
        let stops = stuck_after(|time| if time < 5.0 { 1.0 } else { 0.0 }, false).unwrap();
        assert!((6.6..7.01).contains(&stops), "{stops}");
        let back_and_forth = stuck_after(|time| libm::sin(40.0 * time), false).unwrap();
        assert!(back_and_forth < 2.5, "an oscillation is no progress: {back_and_forth}");
    }
}
