//! `mock_arm`: an arm that does exactly as it is told.
//!
//! It integrates the commanded velocity exactly, q += v dt, and stops at its position limits. It is kinematic: it
//! leaves out inertia, friction, compliance, delay and noise, so what works on it need not work on an arm.

use std::borrow::Cow;

use tactflow_runtime::device::{Commands, Description, Device, DeviceError, Driver, Filled, Opened, Samples, Stepped};
use tactflow_runtime::node::{FilePath, Mistake, Mistakes, Rate};
use tactflow_runtime::params;
use tactflow_runtime::signal::{Joint, Joints, JointsShape, Unit};

use super::period_of;
use crate::arm::model::load;
use crate::arm::mount::Mount;

params! {
    /// The arm's model.
    urdf: FilePath,
    /// Link that carries the sensor.
    tip: String,
    /// Pose of the sensor on that link.
    mount: Mount = Mount::NONE,
    /// Joint positions at the start, one a joint [rad; m for a prismatic joint].
    start: Vec<f64>,
    /// Samples of the positions per second [1/s].
    rate_hz: Rate = Rate(250.0),
}

/// The arm's joints and where they are.
#[derive(Debug)]
pub struct MockArm {
    joints: Vec<Joint>,
    position: Vec<f64>,
    period: i64,
    last: Option<i64>,
    sequence: u64,
}

impl Device for MockArm {
    type Params = Params;

    const NAME: &'static str = "mock_arm";
    const SUMMARY: &'static str = "an arm without dynamics that does exactly as it is told";
    const DOC: &'static str = "It integrates the commanded joint velocity exactly and stops at its position limits. It \
        leaves out inertia, friction, compliance, delay and noise: what works on it need not work on an arm.\n\n\
        It states the facts `urdf`, `tip` and `mount` for `arm_state`.";
    const EXAMPLE: &'static str = r#"
[roles]
arm = "velocity_arm"

[commands]
arm.velocity = "ik.velocity"

[bind]
arm = "arm"

[devices.arm]
type = "mock_arm"
urdf = "builtin:lwr4p.urdf"          # a KUKA LWR 4+
tip = "lwr_7_link"
mount = { xyz = [0.0, 0.0, 0.03] }   # of the sensor on the tip [m]
start = [0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0]   # [rad]
"#;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let chain = load(&params.urdf, &params.tip, &params.mount)?;
        let period = period_of(params.rate_hz);
        let joints = chain.joints().to_vec();
        check_start(&joints, &params.start)?;
        let shape = JointsShape { joints: joints.clone(), unit: Unit::RADIAN };
        let filled = Filled {
            role: "velocity_arm".into(),
            outputs: vec![shape.clone().into()],
            commands: vec![shape.in_unit(Unit::RADIAN.per_second()).into()],
            facts: facts(&params)?,
        };
        let arm = Self { joints, position: params.start, period, last: None, sequence: 0 };
        let description = Description { fills: vec![filled], period: period as f64 * 1e-9 };
        Ok(Opened { description, driver: Driver::Stepped(Box::new(arm)) })
    }
}

impl Stepped for MockArm {
    fn next(&self) -> Option<i64> {
        Some(self.last.map_or(0, |last| (last / self.period + 1) * self.period))
    }

    fn exchange(&mut self, now: i64, commands: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        if self.advance(now, commands.joints(0))? {
            samples.write::<Joints>(0, now, self.sequence).0.copy_from_slice(&self.position);
        }
        Ok(())
    }
}

impl MockArm {
    /// Moves with `velocity` from the last exchange to `now`; whether time went on, so that there is a new sample.
    fn advance(&mut self, now: i64, velocity: &[f64]) -> Result<bool, DeviceError> {
        if self.last.is_some_and(|last| now <= last) {
            return Ok(false);
        }
        let dt = (now - self.last.unwrap_or(now)) as f64 * 1e-9;
        for ((q, v), joint) in self.position.iter_mut().zip(velocity).zip(&self.joints) {
            if !v.is_finite() {
                return Err(DeviceError(format!("the velocity commanded to joint `{}` is not finite", joint.name)));
            }
            *q = (*q + v * dt).clamp(joint.lower, joint.upper);
        }
        (self.last, self.sequence) = (Some(now), self.sequence + 1);
        Ok(true)
    }
}

fn check_start(joints: &[Joint], start: &[f64]) -> Result<(), Mistakes> {
    if start.len() != joints.len() {
        let message = format!("`start` has {} entries, but the arm has {} joints", start.len(), joints.len());
        return Err(Mistake::param("start", message).into());
    }
    let outside = joints.iter().zip(start).filter(|(joint, q)| !(joint.lower..=joint.upper).contains(*q));
    let mistakes: Mistakes = outside
        .map(|(Joint { name, lower, upper, .. }, q)| {
            let message = format!("joint `{name}` cannot start at {q}: it goes from {lower:.4} to {upper:.4}");
            Mistake::param("start", message)
        })
        .collect();
    if mistakes.is_empty() { Ok(()) } else { Err(mistakes) }
}

/// What `arm_state` wants to know. The path is absolute, since the graph that asks may stand in another folder.
fn facts(params: &Params) -> Result<Vec<(Cow<'static, str>, toml::Value)>, Mistakes> {
    let urdf = match params.urdf.builtin {
        Some(_) => params.urdf.path.clone(),
        None => std::path::absolute(&params.urdf.path).map_err(|error| Mistake::unreadable(&params.urdf, &error))?,
    };
    let Some(urdf) = urdf.to_str() else {
        return Err(Mistake::param("urdf", "the path of the model is not UTF-8 text").into());
    };
    let list = |numbers: [f64; 3]| toml::Value::from(numbers.to_vec());
    let mount = [("xyz".into(), list(params.mount.xyz)), ("rpy".into(), list(params.mount.rpy))];
    let mount = toml::Value::Table(mount.into_iter().collect());
    Ok(vec![("urdf".into(), urdf.into()), ("tip".into(), params.tip.as_str().into()), ("mount".into(), mount)])
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::devices::testing::{Bench, open};

    const URDF: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/robots/lwr4p.urdf");

    fn arm(more: &str) -> Result<Bench, Mistakes> {
        open::<MockArm>(&format!("urdf = '{URDF}'\ntip = 'lwr_7_link'\n{more}")).map(Bench::new)
    }

    #[test]
    fn it_samples_at_its_rate_and_says_what_it_is() {
        let mut bench = arm("start = [0, 0.5, 0, -1, 0, 1, 0]\nmount = { xyz = [0, 0, 0.05] }").unwrap();
        assert_eq!(bench.description.period, 0.004);
        for now in [0, 4_000_000, 8_000_000] {
            assert_eq!(bench.device.next(), Some(now));
            bench.exchange(now);
        }
        bench.exchange(9_000_000);
        assert_eq!(bench.device.next(), Some(12_000_000), "off the beat it stays on the beat");
        assert!(Path::new(bench.fact("urdf").unwrap().as_str().unwrap()).is_absolute());
        assert_eq!(bench.fact("tip"), Some(&"lwr_7_link".into()));
        assert_eq!(bench.fact("mount").unwrap()["xyz"], vec![0.0, 0.0, 0.05].into());
        assert_eq!(bench.fact("mount").unwrap()["rpy"], vec![0.0; 3].into());
    }

    #[test]
    fn it_integrates_exactly_and_stops_at_its_limits() {
        let joints = vec![
            Joint { name: "a".into(), lower: -1.0, upper: 1.0, speed: 1.0, acceleration: 10.0 },
            Joint { name: "b".into(), lower: -1.0, upper: 1.0, speed: 1.0, acceleration: 10.0 },
        ];
        let mut arm = MockArm { joints, position: vec![0.0, 0.5], period: 4_000_000, last: None, sequence: 0 };
        let steps = [
            (5_000_000, [9.0, 9.0], true, [0.0, 0.5], "the first exchange is where time starts"),
            (255_000_000, [1.0, -2.0], true, [0.25, 0.0], "a quarter of a second"),
            (255_000_000, [1.0, -2.0], false, [0.25, 0.0], "the same moment once more"),
            (200_000_000, [1.0, -2.0], false, [0.25, 0.0], "a moment that is gone"),
            (755_000_000, [2.0, 0.5], true, [1.0, 0.25], "against a stop"),
            (1_255_000_000, [-1.0, 0.0], true, [0.5, 0.25], "and back at once"),
        ];
        for (now, velocity, is_new, position, what) in steps {
            assert_eq!((arm.advance(now, &velocity), arm.position.as_slice()), (Ok(is_new), &position[..]), "{what}");
        }
        assert_eq!(arm.sequence, 4);
        assert!(arm.advance(2_000_000_000, &[f64::NAN, 0.0]).unwrap_err().0.contains("joint `a`"));
    }

    #[test]
    fn bad_settings() {
        let cases = [
            ("start = [0, 0]", "`start` has 2 entries, but the arm has 7 joints"),
            ("start = [0, 0, 0, 0, 0, 0, 3]", "joint `lwr_a6_joint` cannot start at 3: it goes from -2.9671 to 2.9671"),
            ("start = [0, 0, 0, 0, 0, 0, 0]\nrate_hz = 1e7", "expected a rate from 0.001 to 1000000, found 10000000"),
            (
                "start = [0, 0, 0, 0, 0, 0, 0]\nrate_hz = 1e-9",
                "expected a rate from 0.001 to 1000000, found 0.000000001",
            ),
        ];
        for (params, message) in cases {
            assert_eq!(arm(params).err().unwrap()[0].message, message);
        }
    }
}
