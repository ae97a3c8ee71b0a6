//! `mock_arm`: an arm that follows its commands exactly, q_eq += v dt.

use tactflow_runtime::device::{Commands, Description, Device, DeviceError, Driver, Opened, Samples, Stepped};
use tactflow_runtime::node::{Describe, FilePath, Mistake, Mistakes, Param, refuse_any};
use tactflow_runtime::signal::Joint;

use super::arm::{self, ArmPorts};
use super::{nanos, period_of};
use crate::arm::model::load;
use crate::arm::mount::Mount;

/// Parameters of `mock_arm`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// The arm's model.
    urdf: FilePath,
    /// Link that carries the sensor.
    tip: String,
    /// Posture that the arm prefers, stated as a fact; in m for a prismatic joint.
    #[param(unit = "rad")]
    home: Option<Vec<f64>>,
    /// Position of each joint at the start, `home` if not given; in m for a prismatic joint.
    #[param(unit = "rad")]
    start: Option<Vec<f64>>,
    /// Samples per second.
    #[param(unit = "1/s", range = 0.001..=1e6, default = 250.0)]
    rate_hz: f64,
    /// Maximum acceleration that the arm states for each joint, in m/s² for a prismatic joint; the arm does not keep to
    /// it.
    #[param(unit = "rad/s2", above = 0.0, default = 10.0)]
    acceleration: f64,
    /// Periods in which the arm is held in place.
    #[param(default = vec![])]
    hold: Vec<Hold>,
}

/// A period in which the arm is held in place.
#[derive(Debug, Clone, Param)]
struct Hold {
    /// Start.
    #[param(unit = "s", range = 0.0..)]
    from_s: f64,
    /// End.
    #[param(unit = "s", range = 0.0..)]
    to_s: f64,
}

/// An arm without dynamics that follows its commands exactly.
///
/// The device integrates the commanded joint velocity exactly: the result is its `equilibrium`, where a compliant arm
/// would be if nothing held it. Its `position` is the same, but it stops at the ends of the joints, and it stays in
/// place while the arm is held (`hold`). Meanwhile the equilibrium runs ahead, also past the end of a joint, and the
/// position springs to it when the arm is released. A `joint_limit` keeps this lead small.
///
/// Inertia, friction, stiffness, delay and noise are not simulated: what works on this arm may fail on a real one. The
/// arm states its `acceleration` and does not keep to it.
///
/// It states the facts `urdf` and `tip` for `arm_state`, and `home`, which is its start if no `home` is given.
///
/// ```toml
/// [roles]
/// arm = "velocity_arm"
///
/// [commands]
/// arm.velocity = "joint_limit.velocity"
///
/// [bind]
/// arm = "arm"
///
/// [devices.arm]
/// type = "mock_arm"
/// urdf = "builtin:lwr4p.urdf"          # a KUKA LWR 4+
/// tip = "lwr_7_link"
/// start = [0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0]   # [rad]
/// ```
#[derive(Debug, Describe)]
pub struct MockArm {
    ports: ArmPorts,
    joints: Vec<Joint>,
    position: Vec<f64>,
    /// The sum of the commands.
    equilibrium: Vec<f64>,
    holds: Vec<Hold>,
    period: i64,
    last: Option<i64>,
    sequence: u64,
}

impl Device for MockArm {
    type Params = Params;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let chain = load(&params.urdf, &params.tip, &Mount::NONE)?;
        params.home.as_ref().map_or(Ok(()), |home| arm::check_posture("home", home, chain.joints()))?;
        let start = arm::start_of(params.start.as_deref(), params.home.as_deref())?;
        let joints = arm::joints(&chain, params.acceleration, &start)?;
        check_holds(&params.hold)?;
        let period = period_of(params.rate_hz);
        let mut description = Description::every(period as f64 * 1e-9);
        let facts = arm::facts(&params.urdf, &params.tip, Some(params.home.as_deref().unwrap_or(&start)))?;
        let ports = ArmPorts::fill(description.fills(arm::ROLE), &joints, facts);
        let arm = Self::new(ports, joints.joints, start, params.hold, period);
        Ok(Opened { description, driver: Driver::Stepped(Box::new(arm)) })
    }
}

impl Stepped for MockArm {
    fn next(&self) -> Option<i64> {
        Some(self.last.map_or(0, |last| (last / self.period + 1) * self.period))
    }

    fn exchange(&mut self, now: i64, commands: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        let is_due = self.next().is_none_or(|next| next <= now);
        if self.advance(now, commands.joints(self.ports.velocity))? && is_due {
            self.sequence += 1;
            self.ports.write(samples, now, self.sequence, [&self.position, &self.equilibrium]);
        }
        Ok(())
    }
}

impl MockArm {
    fn new(ports: ArmPorts, joints: Vec<Joint>, start: Vec<f64>, holds: Vec<Hold>, period: i64) -> Self {
        Self { ports, joints, equilibrium: start.clone(), position: start, holds, period, last: None, sequence: 0 }
    }

    /// Moves at `velocity` from the last exchange to `now` [ns]. Returns whether time advanced, so that there is a new
    /// sample.
    fn advance(&mut self, now: i64, velocity: &[f64]) -> Result<bool, DeviceError> {
        if self.last.is_some_and(|last| now <= last) {
            return Ok(false);
        }
        arm::check_velocity(&self.joints, velocity)?;
        let dt = (now - self.last.unwrap_or(now)) as f64 * 1e-9;
        let is_held = self.holds.iter().any(|hold| (nanos(hold.from_s)..nanos(hold.to_s)).contains(&now));
        let places = self.equilibrium.iter_mut().zip(&mut self.position);
        for (((equilibrium, q), v), joint) in places.zip(velocity).zip(&self.joints) {
            *equilibrium += v * dt;
            if !is_held {
                *q = equilibrium.clamp(joint.lower, joint.upper);
            }
        }
        self.last = Some(now);
        Ok(true)
    }
}

/// Checks that every hold lasts for some time.
fn check_holds(holds: &[Hold]) -> Result<(), Mistakes> {
    let backward = holds.iter().filter(|hold| hold.to_s <= hold.from_s);
    let message =
        |hold: &Hold| format!("a hold must end after it starts, not go from {} s to {} s", hold.from_s, hold.to_s);
    refuse_any(backward.map(|hold| Mistake::param("hold", message(hold))))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Joints, JointsShape, Shape, Unit};

    use super::*;
    use crate::devices::testing::{Bench, open, read};
    use crate::limits::joint_limit::JointLimit;

    const URDF: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/robots/lwr4p.urdf");

    fn arm(more: &str) -> Result<Bench, Mistakes> {
        open::<MockArm>(&format!("urdf = '{URDF}'\ntip = 'lwr_7_link'\n{more}")).map(Bench::new)
    }

    #[test]
    fn it_samples_at_its_rate_and_states_its_facts() {
        let mut bench = arm("start = [0, 0.5, 0, -1, 0, 1, 0]").unwrap();
        assert_eq!(bench.description.period, 0.004);
        for port in ["position", "equilibrium", "velocity"] {
            let Some(Shape::Joints(shape)) = bench.description.shape(port) else { panic!("joints") };
            assert!(shape.joints.iter().all(|joint| joint.acceleration == 10.0));
        }
        for now in [0, 4_000_000, 8_000_000] {
            assert_eq!(bench.device.next(), Some(now));
            bench.exchange(now);
        }
        bench.exchange(9_000_000);
        assert_eq!(bench.device.next(), Some(12_000_000), "the next sample is at a multiple of the period");
        assert!(Path::new(bench.fact("urdf").unwrap().as_str().unwrap()).is_absolute());
        assert_eq!(bench.fact("tip"), Some(&"lwr_7_link".into()));
        assert_eq!(bench.fact("home"), Some(&vec![0.0, 0.5, 0.0, -1.0, 0.0, 1.0, 0.0].into()));
    }

    fn two_joints(holds: &str) -> MockArm {
        let joint = |name: &str| Joint {
            name: name.into(),
            lower: -1.0,
            upper: 1.0,
            speed: 1.0,
            acceleration: 10.0,
            start: None,
        };
        let params: Params = read(&format!("urdf = 'Cargo.toml'\ntip = ''\nstart = []\nhold = {holds}"));
        let mut description = Description::every(0.004);
        let ports = ArmPorts::fill(description.fills(arm::ROLE), &JointsShape::default(), vec![]);
        MockArm::new(ports, vec![joint("a"), joint("b")], vec![0.0, 0.5], params.hold, 4_000_000)
    }

    #[test]
    fn it_integrates_exactly_and_at_its_ends_the_equilibrium_runs_ahead() {
        let mut arm = two_joints("[]");
        let steps = [
            (5, [9.0, 9.0], true, [0.0, 0.5], [0.0, 0.5], "the first exchange is where time starts"),
            (255, [1.0, -2.0], true, [0.25, 0.0], [0.25, 0.0], "a quarter of a second"),
            (255, [1.0, -2.0], false, [0.25, 0.0], [0.25, 0.0], "the same time again"),
            (200, [1.0, -2.0], false, [0.25, 0.0], [0.25, 0.0], "a time in the past"),
            (755, [2.0, 0.5], true, [1.0, 0.25], [1.25, 0.25], "against an end"),
            (1255, [-0.25, 0.0], true, [1.0, 0.25], [1.125, 0.25], "it does not come back at once"),
            (1755, [-1.0, 0.0], true, [0.625, 0.25], [0.625, 0.25], "only when the lead is used up"),
        ];
        for (ms, velocity, is_new, position, equilibrium, what) in steps {
            assert_eq!(arm.advance(ms * 1_000_000, &velocity), Ok(is_new), "{what}");
            assert_eq!((&*arm.position, &*arm.equilibrium), (&position[..], &equilibrium[..]), "{what}");
        }
        assert!(arm.advance(2_000_000_000, &[f64::NAN, 0.0]).unwrap_err().0.contains("joint `a`"));
    }

    #[test]
    fn while_held_it_stays_and_when_released_it_springs() {
        let mut arm = two_joints("[{ from_s = 0.25, to_s = 0.75 }]");
        let steps = [
            (0, [0.0, 0.5], [0.0, 0.5], "the start"),
            (125, [0.125, 0.5], [0.125, 0.5], "free"),
            (250, [0.125, 0.5], [0.25, 0.5], "seized"),
            (625, [0.125, 0.5], [0.625, 0.5], "held"),
            (750, [0.75, 0.5], [0.75, 0.5], "let go"),
        ];
        for (ms, position, equilibrium, what) in steps {
            arm.advance(ms * 1_000_000, &[1.0, 0.0]).unwrap();
            assert_eq!((&*arm.position, &*arm.equilibrium), (&position[..], &equilibrium[..]), "{what}");
        }
    }

    #[test]
    fn behind_a_joint_limit_an_arm_that_is_held_springs_by_no_more_than_the_lead() {
        let mut arm = two_joints("[{ from_s = 0.1, to_s = 3 }]");
        let shape = JointsShape { joints: arm.joints.clone(), unit: Unit::RADIAN };
        let velocity = shape.in_unit(Unit::RADIAN.per_second());
        let wires = [("velocity", velocity.into()), ("position", shape.clone().into()), ("equilibrium", shape.into())];
        let mut rig = NodeRig::new::<JointLimit>("lead_rad = 0.1", &wires).unwrap();
        rig.tick.max_gap = 0.02;
        let (mut command, mut most, mut spring, mut last) = (vec![0.0; 2], 0.0f64, 0.0f64, 0.0);
        for tick in 0..1000 {
            arm.advance(tick * 4_000_000, &command).unwrap();
            most = most.max(arm.equilibrium[0] - arm.position[0]);
            spring = spring.max(arm.position[0] - last);
            last = arm.position[0];
            rig.set("velocity", Joints([0.5, 0.0].into()));
            rig.set("position", Joints(arm.position.as_slice().into()));
            rig.set("equilibrium", Joints(arm.equilibrium.as_slice().into()));
            rig.step_ms(4.0);
            command.copy_from_slice(&rig.get::<Joints>("velocity").unwrap().0);
        }
        assert!(most > 0.099 && most <= 0.1 + 1e-12, "the lead grows up to its bound: {most}");
        assert!(spring > 0.099 && spring < 0.11, "it springs by the lead: {spring}");
        assert!(arm.position[0] > 0.5, "then it moves on: {}", arm.position[0]);
    }

    #[test]
    fn bad_settings() {
        let cases = [
            ("start = [0, 0]", "`start` has 2 entries, but the arm has 7 joints"),
            (
                "start = [0, 0, 0, 0, 0, 0, 3]",
                "`start` puts joint `lwr_a6_joint` at 3, outside of its range from -2.9671 to 2.9671 (rad, or m if prismatic)",
            ),
            (
                "start = [0, 0, 0, 0, 0, 0, 0]\nhold = [{ from_s = 2, to_s = 1 }]",
                "a hold must end after it starts, not go from 2 s to 1 s",
            ),
            (
                "start = [0, 0, 0, 0, 0, 0, 0]\nrate_hz = 1e7",
                "expected a number from 0.001 to 1000000 [1/s], found 10000000",
            ),
            (
                "start = [0, 0, 0, 0, 0, 0, 0]\nrate_hz = 1e-9",
                "expected a number from 0.001 to 1000000 [1/s], found 0.000000001",
            ),
        ];
        for (params, message) in cases {
            assert_eq!(arm(params).err().unwrap()[0].message, message);
        }
    }
}
