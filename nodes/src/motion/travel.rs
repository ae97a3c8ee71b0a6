//! The way that a sensor goes: for guidance that counts metres and not seconds.

use nalgebra::Vector3;
use tactflow_runtime::node::Tick;
use tactflow_runtime::signal::Pose;

/// Adds up nothing by itself: tells each step of a sensor along the sensor's own axes.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Odometer {
    last: Option<Vector3<f64>>,
}

impl Odometer {
    /// The step since the last pose along the sensor's x and y: R' (p - p_last), zero for the first [m].
    pub fn step(&mut self, pose: &Pose) -> [f64; 2] {
        let place = pose.0.translation.vector;
        let moved = self.last.replace(place).map_or_else(Vector3::zeros, |last| place - last);
        let step = pose.0.rotation.inverse_transform_vector(&moved);
        if step.iter().all(|part| part.is_finite()) { [step.x, step.y] } else { [0.0; 2] }
    }
}

/// Notices that a way gets no longer: something stands in it, or a limit holds.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Stall {
    /// How long the way was when it last grew [m].
    best: f64,
    /// When that was [ns].
    since: Option<i64>,
}

/// A way stands still if for this long [ns] ...
const PATIENCE: i64 = 2_000_000_000;
/// ... it has not grown by this share of what the speed promises for that time.
const SHARE: f64 = 0.2;

impl Stall {
    /// Whether the `way` of a sensor that is told to go at `speed` stands still [m, m/s]. Time in which the runtime
    /// holds all commands does not count.
    pub fn is_stuck(&mut self, way: f64, speed: f64, tick: &Tick) -> bool {
        let since = *self.since.get_or_insert(tick.now);
        if tick.is_halted || way > self.best + SHARE * speed * PATIENCE as f64 * 1e-9 {
            (self.best, self.since) = (way.max(self.best), Some(tick.now));
            return false;
        }
        tick.now - since >= PATIENCE
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
            (pose(0.52, 0.07, 0.0), [0.02, -0.03], "as the base"),
            (pose(0.53, 0.07, quarter), [0.0, -0.01], "turned"),
            (pose(0.53, 0.07, 0.0), [0.0, 0.0], "a turn is no way"),
        ];
        for (pose, expected, what) in cases {
            let step = odometer.step(&pose);
            assert!(step.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{what}: {step:?}");
        }
        odometer.step(&pose(1e308, 0.0, 0.7));
        assert_eq!(odometer.step(&pose(-1e308, 0.0, 0.7)), [0.0, 0.0], "what is out of all bounds is no step");
    }

    /// When a sensor that goes at a share of its speed is found to be stuck, within 10 s [s].
    fn stuck_after(share: impl Fn(f64) -> f64, is_halted: bool) -> Option<f64> {
        let (mut stall, mut way) = (Stall::default(), 0.0);
        (0..2500).find_map(|i| {
            let time = f64::from(i) * 0.004;
            way += share(time) * 0.01 * 0.004;
            let tick = Tick { now: i64::from(i) * 4_000_000, is_halted, ..Tick::first() };
            stall.is_stuck(way, 0.01, &tick).then_some(time)
        })
    }

    #[test]
    fn what_goes_slowly_is_not_stuck() {
        assert_eq!(stuck_after(|_| 1.0, false), None);
        assert_eq!(stuck_after(|_| 0.25, false), None);
        assert_eq!(stuck_after(|_| 0.0, false), Some(2.0));
        assert_eq!(stuck_after(|_| 0.0, true), None, "commands are held");
        let stops = stuck_after(|time| if time < 5.0 { 1.0 } else { 0.0 }, false).unwrap();
        assert!((6.6..7.01).contains(&stops), "{stops}");
        let to_and_fro = stuck_after(|time| libm::sin(40.0 * time), false).unwrap();
        assert!(to_and_fro < 2.5, "trembling is no way: {to_and_fro}");
    }
}
