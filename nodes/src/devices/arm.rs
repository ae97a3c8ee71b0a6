//! What every arm states: the role `velocity_arm`, its joints, its ports and its facts.

#[cfg(feature = "drivers")]
use tactflow_runtime::device::Link;
use tactflow_runtime::device::{Command, DeviceError, Fill, Output, Report, Samples};
use tactflow_runtime::node::{At, FilePath, Mistake, Mistakes, refuse_any};
use tactflow_runtime::signal::{Flag, FlagShape, Joint, Joints, JointsShape, Pose, Unit};
use tactflow_runtime::source::Code;

use super::Facts;
use crate::arm::chain::Chain;
use crate::usual::USUAL_RAD;

/// The ports of the role `velocity_arm`.
#[derive(Debug, Clone, Copy)]
pub(crate) struct ArmPorts {
    position: Output<Joints>,
    equilibrium: Output<Joints>,
    safety: Output<Flag>,
    pub(crate) velocity: Command,
    pub(crate) contact: Report<Pose>,
}

/// The type of the role of an arm.
pub(crate) const ROLE: &str = "velocity_arm";

impl ArmPorts {
    /// States what an arm gives and takes in its role.
    pub(crate) fn fill(mut arm: Fill<'_>, joints: &JointsShape, facts: Facts) -> Self {
        arm.facts(facts);
        Self {
            position: arm.output("position", joints.clone()),
            equilibrium: arm.output("equilibrium", joints.clone()),
            safety: arm.output("safety", FlagShape),
            velocity: arm.command("velocity", joints.in_unit(Unit::RADIAN.per_second())),
            contact: arm.report("contact"),
        }
    }

    /// Writes a sample of both postures of an arm that always follows its commands.
    pub(crate) fn write(&self, samples: &mut Samples, stamp: i64, sequence: u64, postures: [&[f64]; 2]) {
        self.write_with_safety(samples, stamp, sequence, postures, true);
    }

    /// Writes a sample of both postures, and whether the controller follows commands.
    pub(crate) fn write_with_safety(
        &self,
        samples: &mut Samples,
        stamp: i64,
        sequence: u64,
        [position, equilibrium]: [&[f64]; 2],
        follows_commands: bool,
    ) {
        samples.write(self.position, stamp, sequence).0.copy_from_slice(position);
        samples.write(self.equilibrium, stamp, sequence).0.copy_from_slice(equilibrium);
        *samples.write(self.safety, stamp, sequence) = follows_commands;
    }

    /// Makes all outputs absent until they are written again.
    #[cfg(feature = "drivers")]
    pub(crate) fn lose(&self, link: &mut Link, why: &str) {
        link.lost(self.position, why.to_owned());
        link.lost(self.equilibrium, why.to_owned());
        link.lost(self.safety, why.to_owned());
    }
}

/// Returns the joints of an arm with a maximum `acceleration`, which a model does not state.
///
/// # Errors
/// If the arm cannot start at the positions `start` [rad; m for a prismatic joint].
pub(crate) fn joints(chain: &Chain, acceleration: f64, start: &[f64]) -> Result<JointsShape, Mistakes> {
    let joints = chain.joints().iter().enumerate();
    let joints = joints.map(|(i, joint)| Joint { acceleration, start: start.get(i).copied(), ..joint.clone() });
    let joints: Vec<Joint> = joints.collect();
    check_posture("start", start, &joints)?;
    Ok(JointsShape { joints, unit: Unit::RADIAN })
}

/// Checks that a posture has one position for each joint, and that each is in its range.
///
/// # Errors
/// The difference, at the parameter that states the posture.
pub(crate) fn check_posture(param: &str, posture: &[f64], joints: &[Joint]) -> Result<(), Mistakes> {
    if posture.len() != joints.len() {
        let message = format!("`{param}` has {} entries, but the arm has {} joints", posture.len(), joints.len());
        return Err(Mistake::param(param, message).into());
    }
    let outside = joints.iter().zip(posture).filter(|(joint, q)| !(joint.lower..=joint.upper).contains(*q));
    refuse_any(outside.map(|(Joint { name, lower, upper, .. }, q)| {
        let message = format!(
            "`{param}` puts joint `{name}` at {q}, outside of its range from {lower:.4} to {upper:.4} (rad, or m if \
             prismatic)"
        );
        let is_degrees = (*lower..=*upper).contains(&q.to_radians()) && q.abs() > USUAL_RAD;
        let mistake = Mistake::param(param, message);
        if is_degrees { mistake.help(format!("if it is in degrees, write `{:.4}`", q.to_radians())) } else { mistake }
    }))
}

/// Returns the joints of a real arm, which may be anywhere when a run begins if the bench does not state its `start`.
///
/// # Errors
/// Those of `joints`, if a start is given.
#[cfg(feature = "drivers")]
pub(crate) fn live_joints(chain: &Chain, acceleration: f64, start: Option<&[f64]>) -> Result<JointsShape, Mistakes> {
    if let Some(start) = start {
        return joints(chain, acceleration, start);
    }
    let of_model = |joint: &Joint| Joint { acceleration, start: None, ..joint.clone() };
    Ok(JointsShape { joints: chain.joints().iter().map(of_model).collect(), unit: Unit::RADIAN })
}

/// Checks that every commanded velocity is finite.
///
/// # Errors
/// The first joint whose velocity is not.
pub(crate) fn check_velocity(joints: &[Joint], velocity: &[f64]) -> Result<(), DeviceError> {
    match joints.iter().zip(velocity).find(|(_, v)| !v.is_finite()) {
        Some((joint, _)) => Err(DeviceError(format!("the velocity commanded to joint `{}` is not finite", joint.name))),
        None => Ok(()),
    }
}

/// Returns the facts that `arm_state` and `ik_sink` read. The posture `home` is left out if it is not known.
///
/// # Errors
/// If the path of the model is not UTF-8 or cannot be made absolute.
pub(crate) fn facts(urdf: &FilePath, tip: &str, home: Option<&[f64]>) -> Result<Facts, Mistakes> {
    let path = fact_of("urdf", urdf)?;
    let mut facts: Facts = vec![("urdf".into(), path.into()), ("tip".into(), tip.into())];
    facts.extend(home.map(|home| ("home".into(), home.to_vec().into())));
    Ok(facts)
}

/// Returns the posture in which an arm starts: `start`, or else `home` [rad; m for a prismatic joint].
///
/// # Errors
/// If neither is given.
pub(crate) fn start_of(start: Option<&[f64]>, home: Option<&[f64]>) -> Result<Vec<f64>, Mistakes> {
    let mistake = || {
        let message = "the arm needs `start`, the positions of its joints at the start";
        let mistake = Mistake::new(Code::MissingKey, At::Node, message);
        mistake.help("write `start = [...]`, or name a `robot` whose file has a `home`")
    };
    start.or(home).map(<[f64]>::to_vec).ok_or_else(|| mistake().into())
}

/// Returns the path of a file as a fact. It is absolute, because the graph may be in another folder; `param` names the
/// file.
///
/// # Errors
/// If the path is not UTF-8 or cannot be made absolute.
pub(crate) fn fact_of(param: &str, file: &FilePath) -> Result<String, Mistakes> {
    let path = match file.builtin {
        Some(_) => file.path.clone(),
        None => std::path::absolute(&file.path).map_err(|error| Mistake::unreadable(file, &error))?,
    };
    path.into_os_string()
        .into_string()
        .map_err(|_| Mistake::param(param, format!("the path of `{param}` is not UTF-8 text")).into())
}
