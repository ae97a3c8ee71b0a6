//! A capsule around the tool of an arm: all points within a radius of a segment.

use nalgebra::Vector3;
use tactflow_runtime::node::Param;
use tactflow_runtime::signal::Twist;

use super::mount::Mount;
use crate::usual::USUAL_LENGTH_M;

/// A capsule in the frame of the tip: the tool, with the housing of the sensor.
#[derive(Debug, Clone, Param)]
pub struct Capsule {
    /// Both ends of its axis, `[[x, y, z], [x, y, z]]`.
    #[param(unit = "m", usual = -USUAL_LENGTH_M..=USUAL_LENGTH_M)]
    pub ends_m: [[f64; 3]; 2],
    /// Distance of its surface from its axis.
    #[param(unit = "m", above = 0.0, usual = ..=USUAL_LENGTH_M)]
    pub radius_m: f64,
}

/// A tool in the frame of a sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tool {
    /// Both ends of its axis [m].
    pub ends: [Vector3<f64>; 2],
    /// Distance of its surface from its axis [m].
    pub radius: f64,
}

impl Tool {
    /// Returns a capsule in the frame of a sensor on that `mount`; without a capsule, the line from the tip to the
    /// sensor.
    #[must_use]
    pub fn new(capsule: Option<&Capsule>, mount: &Mount) -> Self {
        let to_sensor = mount.pose().inverse();
        let (ends, radius) = capsule.map_or(([[0.0; 3], mount.xyz], 0.0), |capsule| (capsule.ends_m, capsule.radius_m));
        Self { ends: ends.map(|end| (to_sensor * nalgebra::Point3::from(end)).coords), radius }
    }

    /// Returns the velocity of an end of the axis for a twist of the sensor [m/s].
    #[must_use]
    pub fn velocity(twist: &Twist, end: &Vector3<f64>) -> Vector3<f64> {
        twist.linear() + twist.angular().cross(end)
    }

    /// Returns a bound of the speed of all points for a twist of the sensor [m/s].
    ///
    /// The speed is convex along the axis, so an end is the fastest point of it.
    #[must_use]
    pub fn speed(&self, twist: &Twist) -> f64 {
        let [one, other] = self.ends.map(|end| Self::velocity(twist, &end).norm());
        one.max(other) + self.radius * twist.angular().norm()
    }

    /// Returns the largest distance of a point from the origin of the tip, for a sensor on that `mount` [m].
    #[must_use]
    pub fn reach(&self, mount: &Mount) -> f64 {
        let pose = mount.pose();
        let [one, other] = self.ends.map(|end| (pose * nalgebra::Point3::from(end)).coords.norm());
        one.max(other) + self.radius
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn a_tool_is_seen_from_the_sensor() {
        // The sensor is 0.1 m along z of the tip, and turned about x by a right angle: its y is z of the tip.
        let mount = Mount { xyz: [0.0, 0.0, 0.1], rpy: [FRAC_PI_2, 0.0, 0.0] };
        let tool = Tool::new(None, &mount);
        assert!((tool.ends[0] - Vector3::new(0.0, -0.1, 0.0)).norm() < 1e-12 && tool.ends[1].norm() < 1e-12);
        assert!((tool.reach(&mount) - 0.1).abs() < 1e-12);
        let capsule = Capsule { ends_m: [[0.0; 3], [0.03, 0.0, 0.1]], radius_m: 0.02 };
        let tool = Tool::new(Some(&capsule), &mount);
        assert!((tool.ends[1] - Vector3::new(0.03, 0.0, 0.0)).norm() < 1e-12);
        // 2 rad/s about x of the sensor move the tip at 0.2 m/s, and the surface about it by 0.04 m/s more.
        let turn = Twist::new(Vector3::zeros(), Vector3::new(2.0, 0.0, 0.0));
        assert!((tool.speed(&turn) - 0.24).abs() < 1e-12);
    }
}
