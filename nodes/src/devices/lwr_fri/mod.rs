//! `lwr_fri`: a KUKA LWR 4+ over FRI 1.0, as UDP datagrams. `docs/lwr.md` describes how to set up the controller.
//!
//! The controller (KRC) sends its measurements every 1 to 100 ms, and the driver answers each of them with joint
//! positions. FRI 1.0 has no joint velocities, so the driver integrates them. While the controller takes no positions,
//! the answer is the posture that it commands itself, to the last bit.

mod driver;
mod intake;
mod listen;
mod permit;
mod target;
mod wire;

use std::net::IpAddr;

use tactflow_runtime::device::{Description, Device, Driver, OnSilence, Opened};
use tactflow_runtime::node::{Describe, FilePath, Map, Mistake, Mistakes, Param, collect_both, refuse_any};

use super::arm::{self, ArmPorts};
use super::pad;
use super::per_joint::PerJoint;
use super::start::{StartBounds, StartCheck};
use super::wrench::{ToolWeight, WrenchPorts};
use crate::arm::chain::Chain;
use crate::arm::model::load;
use crate::arm::mount::Mount;
use driver::{Fri, Settings};
pub(crate) use listen::listen;
use target::{Bounds, Target};
use wire::{Impedance, JOINTS, KRL_INT_COUNT};

/// Parameters of `lwr_fri`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// UDP port on which the controller finds this machine.
    #[param(unit = "1", range = 1..=65535, default = 49938)]
    port: usize,
    /// IP address of the controller. Without it, the first host that sends is the controller.
    controller: Option<String>,
    /// Model of the arm. Its seven joints from the base to `tip` are A1, A2, E1, A3, A4, A5 and A6.
    urdf: FilePath,
    /// Link of the flange.
    tip: String,
    /// Pose of the tool that is set on the controller (`$TOOL`), in the frame of `tip`.
    #[param(default = Mount::NONE)]
    tool: Mount,
    /// Posture that the arm prefers, stated as a fact.
    #[param(unit = "rad")]
    home: Option<Vec<f64>>,
    /// Maximum acceleration of each joint.
    #[param(unit = "rad/s2", above = 0.0, default = 10.0)]
    acceleration: f64,
    /// Time between two measurements, as the KRL program opens FRI.
    #[param(unit = "ms", range = 1.0..=100.0, default = 4.0)]
    sample_ms: f64,
    /// Maximum step of a joint from one answer to the next; what its maximum speed allows if not given.
    #[param(unit = "rad", above = 0.0)]
    max_step: Option<f64>,
    /// Stiffness of the joints, which needs joint impedance control. Without it, the KRL program sets the stiffness.
    #[param(unit = "N m/rad", range = 0.01..=2000.0)]
    stiffness: Option<PerJoint>,
    /// Damping of the joints as a fraction of the critical one, which needs joint impedance control. Without it, the KRL
    /// program sets the damping.
    #[param(unit = "1", range = 0.0..=1.0)]
    damping_ratio: Option<PerJoint>,
    /// Integers for the KRL program by their number in `$FRI_FRM_INT`, from 1 to 16. All other values of the program come
    /// back as it sends them.
    #[param(unit = "1", default = Map(Default::default()))]
    krl_ints: Map<f64>,
    /// Integers for the KRL program at the end of the run, so that it leaves the state command.
    #[param(unit = "1", default = Map(Default::default()))]
    krl_ints_at_end: Map<f64>,
    /// Posture from which runs begin. A run refuses to move an arm that is elsewhere, and the check knows where the sensor
    /// starts.
    #[param(unit = "rad")]
    start: Option<Vec<f64>>,
    /// Bounds of the checks before the first command.
    #[param(default = StartBounds::default())]
    start_bounds: StartBounds,
    /// Time that the controller has to reach the state command after it has sent its first measurement. The arm rests
    /// meanwhile.
    #[param(unit = "s", range = 0.0.., default = 10.0)]
    wait_s: f64,
    /// Time without answers after which the arm is at rest. It depends on the settings of the controller and is not
    /// measured.
    #[param(unit = "ms", above = 0.0, default = 200.0)]
    silence_ms: f64,
    /// Mass of what the arm carries beyond the load data of the controller.
    #[param(unit = "kg", range = 0.0.., default = 0.0)]
    tool_mass: f64,
    /// Centre of mass of what the arm carries beyond the load data of the controller, in the frame of `tip`.
    #[param(unit = "m", default = [0.0; 3])]
    tool_com: [f64; 3],
}

/// A KUKA LWR 4+ over FRI 1.0.
///
/// The device answers each datagram that the controller sends to `port`. `docs/lwr.md` shows the settings of the
/// controller, the KRL program and the first run. **It has not been run on a robot.**
///
/// **Motion.** While the controller takes positions (FRI state command, drives on), the device integrates the commanded
/// velocity from the posture that the controller commanded at its start. Each step lasts the sample time that the
/// controller states. At any other time, it mirrors the posture that the controller commands. Lost datagrams add no
/// motion. A step is never longer than `max_step`, and ends at the limits of the joints.
///
/// **Start.** Before each motion from the state monitor, the device compares the commanded posture with the measured
/// one, and the pose of the tool with the model. A difference that is greater than `start_bounds` allows refuses the
/// motion. An arm that is deflected because it presses goes on after a halt, unless its deflection has changed by more
/// than that. If the bench states `start`, the first motion of a run begins there: the device refuses it as long as a
/// joint is farther than `start_bounds.posture` from `start`.
/// The arm rests until the controller reaches the state command for the first time, for `wait_s` at most.
///
/// **Safety.** A drop to monitor, drives that are off, an error, a wrong control mode and a quality below ok stop the
/// run, and it waits for `resume`. The port `safety` is set while the controller follows commands.
///
/// **Impedance.** With `stiffness` or `damping_ratio`, one number or one per joint, the device sets them and needs joint
/// impedance control (3). They do not change during a session. Without both, position control (1) is legal too.
/// The robot file `lwr4p.toml` states both.
///
/// **Joints.** The joints of the model from the base to `tip` are A1, A2, E1, A3, A4, A5 and A6, the order of FRI. The
/// comparison of the pose at the start finds a wrong order.
///
/// **Force.** The role `force_sensor` is the external wrench that the controller estimates at its tool, moved to `tip`,
/// without the weight of `tool_mass`. Give `tool_mass` only for a load that the controller does not know; `tactflow
/// calibrate tool` measures it.
///
/// Without answers, the session drops to monitor and the arm stops, within `silence_ms`. The device counts `bad
/// datagrams`, `lost datagrams`, `late datagrams`, `repeated datagrams`, `datagrams of a second controller`, `shortened
/// steps` and `unsent answers`. It states the facts `urdf`, `tip` and, if it is given, `home` of the arm, and of the
/// force sensor the `mount`, which is the tip itself, and the weight that is subtracted, `tool_mass` and `tool_com`.
///
/// ```toml
/// [roles]
/// arm = "velocity_arm"
///
/// [commands]
/// arm.velocity = "joint_limit.velocity"
///
/// [bind]
/// arm = "lwr"
///
/// [devices.lwr]
/// type = "lwr_fri"
/// urdf = "builtin:lwr4p.urdf"
/// tip = "lwr_7_link"
/// sample_ms = 4.0                     # [ms]
/// stiffness = 200.0                   # [N m/rad]
/// damping_ratio = 0.2
/// ```
#[derive(Describe)]
pub struct LwrFri;

impl Device for LwrFri {
    type Params = Params;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let (description, driver) = opened(params)?;
        Ok(Opened { description, driver: Driver::Live(Box::new(driver)) })
    }
}

/// Returns what the device states, and its driver.
fn opened(params: Params) -> Result<(Description, Fri), Mistakes> {
    let chain = load(&params.urdf, &params.tip, &Mount::NONE)?;
    check_chain(&chain, &params)?;
    let (krl_ints, krl_ints_at_end) =
        collect_both(krl_ints("krl_ints", &params.krl_ints), krl_ints("krl_ints_at_end", &params.krl_ints_at_end))?;
    let (stiffness, damping) = collect_both(
        per_joint("stiffness", params.stiffness.as_ref()),
        per_joint("damping_ratio", params.damping_ratio.as_ref()),
    )?;
    let allowed = params.controller.as_deref().map(address).transpose()?;
    let shape = arm::live_joints(&chain, params.acceleration, params.start.as_deref())?;
    let target = Target::new(Bounds::new(&shape.joints, params.max_step.unwrap_or(f64::INFINITY)));
    let mut description = Description::every(params.sample_ms * 1e-3);
    description.on_silence(OnSilence::Stops, params.silence_ms * 1e-3);
    description.needs_commissioning = true;
    let mut facts = arm::facts(&params.urdf, &params.tip, params.home.as_deref())?;
    let stiffest = stiffness.map(|joints| joints.into_iter().fold(0.0, f64::max));
    facts.extend(stiffest.map(|stiffest| ("joint_n_m_per_rad".into(), stiffest.into())));
    let least = damping.as_ref().map(|joints| joints.iter().copied().fold(1.0, f64::min));
    facts.extend(least.map(|least| ("joint_damping_ratio".into(), least.into())));
    let ports = ArmPorts::fill(description.fills(arm::ROLE), &shape, facts);
    let weight = ToolWeight::new(params.tool_mass, params.tool_com);
    let force = WrenchPorts::fill(&mut description, [vec![pad::mount(&Mount::NONE)], weight.facts()].concat());
    let settings = Settings {
        port: params.port as u16,
        sample_time: params.sample_ms * 1e-3,
        impedance: Impedance { stiffness, damping },
        krl_ints,
        krl_ints_at_end,
        wait_s: params.wait_s,
        tool: params.tool.pose(),
        weight,
    };
    let check = StartCheck::new(load(&params.urdf, &params.tip, &params.tool)?, params.start_bounds, params.start);
    Ok((description, Fri::new(settings, ports, force, target, check, chain, allowed)))
}

/// Checks that the model has the joints of an LWR, and that `home` is a posture of them.
fn check_chain(chain: &Chain, params: &Params) -> Result<(), Mistakes> {
    let count = chain.joints().len();
    if count != JOINTS {
        let message = format!("the model has {count} joints up to `{}`, but an LWR has {JOINTS}", params.tip);
        return Err(Mistake::param("tip", message).into());
    }
    params.home.as_ref().map_or(Ok(()), |home| arm::check_posture("home", home, chain.joints()))
}

/// Returns the values of the joints, `None` without any.
fn per_joint(param: &str, values: Option<&PerJoint>) -> Result<Option<[f64; JOINTS]>, Mistakes> {
    let joints = |values: &PerJoint| {
        let joints = values.joints(JOINTS).map_err(|message| Mistake::param(param, message))?;
        Ok(std::array::from_fn(|i| joints[i]))
    };
    values.map(joints).transpose()
}

/// Returns the integers for the KRL program, each with its place, the first of which is 0.
fn krl_ints(param: &str, ints: &Map<f64>) -> Result<Vec<(usize, i32)>, Mistakes> {
    let read = |(number, value): (&String, &f64)| {
        let place = number.parse::<usize>().ok().filter(|place| (1..=KRL_INT_COUNT).contains(place));
        let is_int = value.fract() == 0.0 && (f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(value);
        let message = match (place, is_int) {
            (Some(place), true) => return Ok((place - 1, *value as i32)),
            (None, _) => format!("`{number}` is no number of an integer of KRL: they are 1 to {KRL_INT_COUNT}"),
            (_, false) => format!("integer {number} of KRL cannot be {value}: write a whole number of 32 bits"),
        };
        Err(Mistake::key(format!("{param}.{number}"), message))
    };
    let (ints, mistakes): (Vec<_>, Vec<_>) = ints.0.iter().map(read).partition(Result::is_ok);
    refuse_any(mistakes.into_iter().filter_map(Result::err))?;
    Ok(ints.into_iter().flatten().collect())
}

/// Returns the address of the controller.
fn address(text: &str) -> Result<IpAddr, Mistakes> {
    text.parse().map_err(|_| {
        let mistake = Mistake::param("controller", format!("`{text}` is not an IP address"));
        mistake.help("write the address of the controller, for example `controller = \"192.168.0.20\"`").into()
    })
}

#[cfg(test)]
mod tests;
