//! The joints of an arm that nobody commands.

use tactflow_runtime::signal::{Joint, Joints, JointsShape};

use super::Finding;

/// Largest motion of a joint of a still arm [rad].
const MAX_MOTION_RAD: f64 = 0.005;

/// Collects the range of each joint.
#[derive(Debug, Clone)]
pub(super) struct Posture {
    joints: Vec<Joint>,
    /// The newest position and the range of each joint [rad].
    last: Vec<f64>,
    low: Vec<f64>,
    high: Vec<f64>,
}

impl Posture {
    pub(super) fn new(shape: &JointsShape) -> Self {
        let count = shape.joints.len();
        let [low, high] = [f64::INFINITY, f64::NEG_INFINITY].map(|bound| vec![bound; count]);
        Self { joints: shape.joints.clone(), last: vec![f64::NAN; count], low, high }
    }

    pub(super) fn add(&mut self, joints: &Joints) {
        self.last.copy_from_slice(&joints.0);
        for ((low, high), q) in self.low.iter_mut().zip(&mut self.high).zip(&joints.0) {
            (*low, *high) = (low.min(*q), high.max(*q));
        }
    }

    /// Describes the joints in the order in which the device sends them.
    pub(super) fn describe(&self, port: &str) -> Vec<Finding> {
        let width = self.joints.iter().map(|joint| joint.name.chars().count()).max().unwrap_or(0);
        let mut findings = Vec::new();
        for (i, (joint, q)) in self.joints.iter().zip(&self.last).enumerate().filter(|(_, (_, q))| q.is_finite()) {
            let Joint { name, lower, upper, .. } = joint;
            let (low, high) = (lower.to_degrees(), upper.to_degrees());
            let text = format!(
                "{port} {}: {name:width$} {q:9.4} rad ({:7.1}°), range {low:.0}° to {high:.0}°",
                i + 1,
                q.to_degrees()
            );
            let is_outside = q < lower || q > upper;
            findings.push(if is_outside {
                Finding::problem(format!(
                    "{text}: it is outside of its range; check the order of the joints and `urdf`"
                ))
            } else {
                Finding::fine(text)
            });
        }
        let moved = |i: &usize| self.high[*i] - self.low[*i] > MAX_MOTION_RAD;
        findings.extend((0..self.joints.len()).filter(moved).map(|i| {
            let (name, range) = (&self.joints[i].name, self.high[i] - self.low[i]);
            Finding::warning(format!("joint `{name}` moved by {range:.4} rad, although nobody commands it"))
        }));
        findings
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::signal::Unit;

    use super::super::Severity;
    use super::*;

    fn posture(samples: &[[f64; 2]]) -> Vec<Finding> {
        let joint = |name: &str| Joint { name: name.into(), lower: -2.0, upper: 2.0, ..Joint::default() };
        let mut posture =
            Posture::new(&JointsShape { joints: vec![joint("shoulder"), joint("elbow")], unit: Unit::RADIAN });
        samples.iter().for_each(|q| posture.add(&Joints((*q).into())));
        posture.describe("position")
    }

    #[test]
    fn the_joints_are_listed_in_the_order_of_the_device() {
        let findings = posture(&[[0.5, -1.0]]);
        assert_eq!(findings[0].text, "position 1: shoulder    0.5000 rad (   28.6°), range -115° to 115°");
        assert!(findings.iter().all(|finding| finding.severity == Severity::Fine));
        assert_eq!(findings.len(), 2);
    }

    #[test]
    fn a_joint_outside_of_its_range_and_one_that_moves_are_found() {
        let findings = posture(&[[2.5, 0.0], [2.5, 0.006]]);
        assert_eq!(findings[0].severity, Severity::Problem);
        assert_eq!(findings[2].text, "joint `elbow` moved by 0.0060 rad, although nobody commands it");
    }
}
