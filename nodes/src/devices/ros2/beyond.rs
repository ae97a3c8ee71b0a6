//! Joints that another program moves beyond their limits.
//!
//! A twist of the tip determines the velocities of at most six joints, and near a singularity not even these. What a
//! program makes of it shows in the joint states.

use std::time::Instant;

use tactflow_runtime::signal::Joint;

/// Shortest time over which a speed is measured [s].
const WINDOW_S: f64 = 0.1;
/// Factor of the greatest speed of a joint above which it is too fast: noise and delays of the joint states.
const MAX_SPEED_FACTOR: f64 = 1.2;

/// Compares measured postures with the limits of the joints.
#[derive(Debug)]
pub(super) struct Beyond {
    joints: Vec<Joint>,
    /// The posture at the start of the window.
    begin: Option<(Instant, Vec<f64>)>,
    /// Why the last posture is beyond the limits.
    why: Option<String>,
}

impl Beyond {
    /// `joints` have the limits, and the names on the robot.
    pub(super) const fn new(joints: Vec<Joint>) -> Self {
        Self { joints, begin: None, why: None }
    }

    /// Takes a measured posture [rad; m for a prismatic joint].
    pub(super) fn hear(&mut self, now: Instant, position: &[f64]) {
        self.why = self.outside(position);
        let Some((since, begin)) = &self.begin else {
            self.begin = Some((now, position.to_vec()));
            return;
        };
        let time = now.duration_since(*since).as_secs_f64();
        let joints = self.joints.iter().zip(begin.iter().zip(position));
        let fast = joints.into_iter().find_map(|(joint, (from, to))| {
            let speed = (to - from).abs() / time.max(WINDOW_S);
            let bound = joint.speed * MAX_SPEED_FACTOR;
            (speed > bound).then(|| {
                format!("joint `{}` moves at {speed:.3} rad/s, and its limit is {} rad/s", joint.name, joint.speed)
            })
        });
        self.why = self.why.take().or(fast);
        if time >= WINDOW_S {
            self.begin = Some((now, position.to_vec()));
        }
    }

    fn outside(&self, position: &[f64]) -> Option<String> {
        let mut joints = self.joints.iter().zip(position);
        let (joint, q) = joints.find(|(joint, q)| **q < joint.lower || **q > joint.upper)?;
        let (name, lower, upper) = (&joint.name, joint.lower, joint.upper);
        Some(format!("joint `{name}` is at {q:.4} rad, outside of its limits {lower} and {upper} rad"))
    }

    /// Says which joint was beyond its limits in the last posture.
    pub(super) fn why(&self) -> Option<String> {
        self.why.as_ref().map(|why| format!("{why}: the program that takes the twists must keep to the limits"))
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn a_joint_that_leaves_its_range_or_is_too_fast_is_named() {
        let joint = Joint { name: "a1".into(), lower: -1.0, upper: 1.0, speed: 0.5, ..Joint::default() };
        // Positions each 10 ms.
        let cases = [
            (vec![0.0; 30], None),
            ((0..30).map(|i| f64::from(i) * 0.0055).collect(), None),
            (vec![0.99, 0.999, 1.001], Some("outside of its limits -1 and 1 rad")),
            (vec![-0.99, -1.01], Some("`a1` is at -1.0100 rad")),
            ((0..30).map(|i| f64::from(i) * 0.008).collect(), Some("and its limit is 0.5 rad/s")),
            (vec![0.0, 0.2], Some("joint `a1` moves at 2.000 rad/s")),
        ];
        for (positions, expected) in cases {
            let mut beyond = Beyond::new(vec![joint.clone()]);
            let begin = Instant::now();
            let mut first = None;
            for (i, q) in positions.iter().enumerate() {
                beyond.hear(begin + Duration::from_millis(10 * i as u64), &[*q]);
                first = first.or_else(|| beyond.why());
            }
            match expected {
                None => assert_eq!(first, None, "{positions:?}"),
                Some(text) => assert!(first.as_ref().is_some_and(|why| why.contains(text)), "{first:?}"),
            }
        }
    }
}
