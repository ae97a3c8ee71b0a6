//! What every force sensor states: the role `force_sensor`, its ports, and the weight of the tool that it does not
//! report.
//!
//! A wrench is a force [N] and a torque [N m], `[fx, fy, fz, tx, ty, tz]`: what the environment exerts on the tool, about
//! the origin of the tip and in its axes. A pad that presses against a table along its own z feels fz < 0.
//!
//! The weight of a tool of mass m with its centre of mass at c in the frame of the tip is, with the rotation R of the
//! tip in the base and g down: f = R' (0, 0, -m g), t = c x f. The base stands upright.

use nalgebra::{IsometryMatrix3, Rotation3, Vector3};
use tactflow_runtime::device::{Description, Link, Output, Samples};
use tactflow_runtime::signal::{Features, FeaturesShape, Scalar, ScalarShape, Unit};

use super::Facts;
use crate::motion::weight::weight;

/// A force and a torque, `[fx, fy, fz, tx, ty, tz]` [N, N m].
pub(crate) type Wrench = [f64; 6];

const NAMES: [&str; 6] = ["fx", "fy", "fz", "tx", "ty", "tz"];

/// The ports of the role `force_sensor`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct WrenchPorts {
    wrench: Output<Features>,
    components: [Output<Scalar>; 6],
}

impl WrenchPorts {
    /// Adds the role `force_sensor` to a description.
    pub(crate) fn fill(description: &mut Description, facts: Facts) -> Self {
        let mut sensor = description.fills("force_sensor");
        sensor.facts(facts);
        let wrench = sensor.output("wrench", FeaturesShape::new(NAMES.into_iter().zip(units())));
        let mut i = 0;
        let components = NAMES.map(|name| {
            i += 1;
            sensor.output(name, ScalarShape::of(units()[i - 1]))
        });
        Self { wrench, components }
    }

    /// Writes a sample of all ports.
    pub(crate) fn write(&self, samples: &mut Samples, stamp: i64, sequence: u64, wrench: &Wrench) {
        samples.write(self.wrench, stamp, sequence).fill(&wrench.map(Some));
        for (port, value) in self.components.iter().zip(wrench) {
            *samples.write(*port, stamp, sequence) = *value;
        }
    }

    /// Makes all outputs absent until they are written again.
    pub(crate) fn lose(&self, link: &mut Link, why: &str) {
        link.lost(self.wrench, why.to_owned());
        self.components.iter().for_each(|port| link.lost(*port, why.to_owned()));
    }
}

/// Returns the unit of each component.
fn units() -> [Unit; 6] {
    let [n, t] = [Unit::NEWTON, Unit::NEWTON_METRE];
    [n, n, n, t, t, t]
}

/// The weight of a tool.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ToolWeight {
    mass: f64,
    centre: Vector3<f64>,
}

impl ToolWeight {
    /// A tool of a mass [kg] with its centre of mass in the frame of the tip [m].
    pub(crate) fn new(mass: f64, centre: [f64; 3]) -> Self {
        Self { mass, centre: centre.into() }
    }

    /// Returns the facts of the weight that is subtracted.
    #[cfg(feature = "drivers")]
    pub(crate) fn facts(&self) -> Facts {
        let centre: Vec<f64> = self.centre.iter().copied().collect();
        vec![("tool_mass".into(), self.mass.into()), ("tool_com".into(), centre.into())]
    }

    /// Returns a wrench without the weight of the tool, at the rotation of the tip in the base. It has the axes of the
    /// tip.
    pub(crate) fn without(&self, measured: &Wrench, tip: &Rotation3<f64>) -> Wrench {
        let weight = weight(self.mass, &self.centre, tip);
        std::array::from_fn(|i| measured[i] - weight[i])
    }
}

/// Returns a wrench in another frame, of which `pose` is that of its own: f' = R f, t' = R t + p x R f.
pub(crate) fn moved(wrench: &Wrench, pose: &IsometryMatrix3<f64>) -> Wrench {
    let [fx, fy, fz, tx, ty, tz] = *wrench;
    let force = pose.rotation * Vector3::new(fx, fy, fz);
    let torque = pose.rotation * Vector3::new(tx, ty, tz) + pose.translation.vector.cross(&force);
    [force.x, force.y, force.z, torque.x, torque.y, torque.z]
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_PI_2;

    use super::*;
    use crate::motion::pose::pose_of;

    fn assert_near(found: &Wrench, expected: &Wrench) {
        let off = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < 1e-12, "{found:?} instead of {expected:?}");
    }

    /// A tool of 1 kg whose centre is 10 cm in front of the tip and 2 cm along its x: roll, pitch and yaw of the tip,
    /// and the weight as the sensor reads it, by hand.
    #[test]
    fn an_unloaded_tool_reads_zero_in_every_posture() {
        let g = 9.80665;
        let tool = ToolWeight::new(1.0, [0.02, 0.0, 0.1]);
        let cases: [([f64; 3], Wrench); 5] = [
            // The tip points up: the weight is along -z, and turns the tip about +y by 2 cm.
            ([0.0, 0.0, 0.0], [0.0, 0.0, -g, 0.0, 0.02 * g, 0.0]),
            ([0.0, 0.0, 1.2], [0.0, 0.0, -g, 0.0, 0.02 * g, 0.0]),
            // It points down.
            ([2.0 * FRAC_PI_2, 0.0, 0.0], [0.0, 0.0, g, 0.0, -0.02 * g, 0.0]),
            // Its y points up, its z along -y of the base.
            ([FRAC_PI_2, 0.0, 0.0], [0.0, -g, 0.0, 0.1 * g, 0.0, -0.02 * g]),
            // Its x points down, its z along x of the base.
            ([0.0, FRAC_PI_2, 0.0], [g, 0.0, 0.0, 0.0, 0.1 * g, 0.0]),
        ];
        for (rpy, reading) in cases {
            let tip = pose_of([0.3, -0.2, 0.5], rpy).rotation;
            assert_near(&tool.without(&reading, &tip), &[0.0; 6]);
            let pressed: Wrench = std::array::from_fn(|i| reading[i] + if i == 2 { -5.0 } else { 0.0 });
            assert_near(&tool.without(&pressed, &tip), &[0.0, 0.0, -5.0, 0.0, 0.0, 0.0]);
        }
    }

    #[test]
    fn without_a_tool_nothing_is_subtracted() {
        let wrench = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0];
        assert_eq!(
            ToolWeight::new(0.0, [0.1, 0.2, 0.3]).without(&wrench, &pose_of([0.0; 3], [1.0; 3]).rotation),
            wrench
        );
    }

    #[test]
    fn a_force_aside_of_the_tip_is_a_torque_about_it() {
        // 10 N along x at 0.2 m along z: 2 N m about y. The frame of the tool is turned by a right angle about z.
        let tool = pose_of([0.0, 0.0, 0.2], [0.0, 0.0, FRAC_PI_2]);
        assert_near(&moved(&[0.0, -10.0, 0.0, 0.0, 0.0, 0.5], &tool), &[10.0, 0.0, 0.0, 0.0, 2.0, 0.5]);
    }
}
