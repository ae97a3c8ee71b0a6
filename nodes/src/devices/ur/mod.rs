//! `ur`: an arm of Universal Robots, over RTDE and a program on the robot. `docs/ur.md` describes its set-up.
//!
//! The state comes by RTDE, 500 times a second. Velocities go to a program on the robot, which connects to us and runs
//! `speedj`. Each message states when the program must stop without another one.

mod checks;
mod course;
mod driver;
mod geometry;
mod listen;
mod message;
mod packet;
mod program;
mod recipe;
mod robot;
mod rtde;
mod script;
mod session;
mod status;
mod template;

use std::net::IpAddr;
use std::time::Duration;

use tactflow_runtime::device::{Description, Device, Driver, OnSilence, Opened};
use tactflow_runtime::node::{At, Describe, FilePath, Mistake, Mistakes, Param};
use tactflow_runtime::signal::{Joint, JointsShape};

use super::arm::{self, ArmPorts};
use super::pad;
use super::start::{StartBounds, StartCheck};
use super::wrench::WrenchPorts;
use crate::arm::chain::Chain;
use crate::arm::model::load;
use crate::arm::mount::Mount;
use checks::Checks;
pub(crate) use listen::listen;
use program::PortNumbers;
use recipe::JOINTS;
use robot::Robot;
use rtde::Request;
use script::Script;
use status::Allowed;

/// Deceleration with which the program stops the robot by itself [rad/s²].
const STOP_DECELERATION: f64 = 4.0;
/// Longest time that a message may give to the next one [ms].
const MAX_TIMEOUT_MS: f64 = 200.0;
/// Shortest default of this time [ms].
const MIN_DEFAULT_TIMEOUT_MS: f64 = 20.0;
/// Steps of the controller in the default of this time, if they are longer.
const DEFAULT_TIMEOUT_STEPS: f64 = 5.0;
/// Steps that the controller needs to see that no message has come, and to begin its stop.
const REACTION_STEPS: f64 = 3.0;
/// The joints in the order of the controller, as the usual descriptions name them.
const USUAL_JOINTS: [&str; JOINTS] =
    ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"];

/// Parameters of `ur`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Host name or address of the robot.
    address: String,
    /// The arm's model.
    urdf: FilePath,
    /// Link that carries the sensor.
    tip: String,
    /// Link of the model that is the flange of the robot; `tip` if not given.
    flange: Option<String>,
    /// Names of the joints in the model, in the order base, shoulder, elbow, wrist 1, wrist 2, wrist 3; those that end
    /// with `shoulder_pan_joint` and so on if not given.
    joints: Option<Vec<String>>,
    /// Angle about z from the root of the model to the base of the controller: 0 for the model that is built in, π for
    /// the usual ROS description, whose root is `base_link`.
    #[param(unit = "rad", default = 0.0)]
    base_yaw: f64,
    /// Posture that the arm prefers, stated as a fact.
    #[param(unit = "rad")]
    home: Option<Vec<f64>>,
    /// Maximum acceleration of each joint.
    #[param(unit = "rad/s2", above = 0.0, default = 10.0)]
    acceleration: f64,
    /// How the program gets to the robot.
    #[param(default = Start::Send)]
    start_by: Start,
    /// The maker's program, `external_control.urscript`; our own if not given.
    script: Option<FilePath>,
    /// Samples per second: 500 for the e-Series, 125 for CB3.
    #[param(unit = "Hz", range = 10.0..=500.0, default = 500.0)]
    rate_hz: f64,
    /// Time after which the program stops the robot without a message: from one sample to 200 ms; 20 ms or five samples
    /// if not given.
    #[param(unit = "ms", above = 0.0)]
    receive_timeout_ms: Option<f64>,
    /// Time without a sample after which the robot is lost.
    #[param(unit = "s", range = 0.01..=10.0, default = 0.2)]
    silence_s: f64,
    /// Maximum time until the program on the robot runs.
    #[param(unit = "s", range = 0.1..=120.0, default = 5.0)]
    start_s: f64,
    /// Maximum time to connect, and for an answer.
    #[param(unit = "s", range = 0.1..=120.0, default = 3.0)]
    connect_s: f64,
    /// Whether the robot may move in the safety mode `reduced`.
    #[param(default = false)]
    allow_reduced: bool,
    /// Lowest position of the speed slider at which the robot is moved. A lower one slows every motion. Below 0.2 a joint
    /// that moves cannot be told from one that is stuck.
    #[param(unit = "1", range = 0.2..=1.0, default = 1.0)]
    min_speed_fraction: f64,
    /// Pose of the tool centre point in the flange, x, y, z and a rotation vector, for a robot that does not report it.
    #[param(unit = "m, rad")]
    tcp_offset: Option<[f64; 6]>,
    /// Mass of the tool, to be compared with the payload that is set on the robot.
    #[param(unit = "kg", range = 0.0..=100.0)]
    tool_mass: Option<f64>,
    /// Maximum difference between the two.
    #[param(unit = "kg", above = 0.0, default = 0.1)]
    tool_mass_bound: f64,
    /// Posture from which runs begin, with the joints in the order of the model. A run refuses to move an arm that is
    /// elsewhere, and the check knows where the sensor starts.
    #[param(unit = "rad")]
    start: Option<Vec<f64>>,
    /// Bounds of the checks before the first command.
    #[param(default = StartBounds::default())]
    start_bounds: StartBounds,
    /// Our address, as the robot sees it; that of our connection to the robot if not given.
    host: Option<String>,
    /// IP address from which the robot connects to us, behind a translation of addresses or from a container; that of our
    /// connection to the robot if not given. Connections from elsewhere are closed.
    robot_host: Option<String>,
    /// Our port that the program on the robot connects to; 0 is any free one.
    #[param(range = 0..=65535, default = 50001)]
    reverse_port: usize,
    /// Our port where a node of External Control asks for its program.
    #[param(range = 0..=65535, default = 50002)]
    request_port: usize,
    /// Our port that the maker's program opens for trajectories. Nothing is sent on it.
    #[param(range = 0..=65535, default = 50003)]
    trajectory_port: usize,
    /// Our port that the maker's program opens for commands. Nothing is sent on it.
    #[param(range = 0..=65535, default = 50004)]
    command_port: usize,
    /// Port of the robot for RTDE.
    #[param(range = 1..=65535, default = 30004)]
    rtde_port: usize,
    /// Port of the robot that takes programs.
    #[param(range = 1..=65535, default = 30002)]
    script_port: usize,
}

/// How the program gets to the robot.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
enum Start {
    /// We send it. The robot must be in remote control.
    Send,
    /// A node of External Control (a URCap) on the robot asks for it when somebody presses play.
    Urcap,
}

/// An arm of Universal Robots: e-Series, and CB3 with PolyScope 3.3 or newer. It has not been run on a robot.
///
/// The state comes by RTDE (port 30004). A program on the robot connects to our port 50001, gets a joint velocity for
/// each sample and runs `speedj`. Each message gives the program a time, `receive_timeout_ms`. Without another message
/// in this time it stops the robot at 4 rad/s² and ends, whatever happens to this process, its machine or the cable.
///
/// Before the first velocity, the device compares the posture, the pose of the flange and the payload with the model.
/// If the bench states `start`, it refuses the first motion of a run as long as a joint is farther than
/// `start_bounds.posture` from it.
/// The robot must be running, with normal safety, and its speed slider must not slow it. When this ends, or when the
/// program ends, the output `safety` is false and the commands ramp to zero. `resume` checks everything again, and
/// starts the program again.
///
/// `docs/ur.md` describes what to set on the robot. The device counts `bad packets`, `reconnects`,
/// `connections that were not expected` and `messages that the robot did not take`. It states the facts `urdf`, `tip`
/// and, if it is given, `home`.
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
/// type = "ur"
/// address = "192.168.0.10"
/// urdf = "builtin:ur5e.urdf"
/// tip = "tool0"
/// home = [0.0, -1.7, -2.0, -1.0124, 1.5708, 0.0]   # [rad]
/// ```
#[derive(Describe)]
pub struct Ur;

impl Device for Ur {
    type Params = Params;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let chain = load(&params.urdf, &params.tip, &Mount::NONE)?;
        let flange = params.flange.as_ref().unwrap_or(&params.tip);
        let to_flange = load(&params.urdf, flange, &Mount::NONE).map_err(|mistakes| of_flange(mistakes, &params))?;
        let order = order(chain.joints(), params.joints.as_deref())?;
        if to_flange.joints().len() != JOINTS {
            let message = format!("{} joints move between the root and `{flange}`, not 6", to_flange.joints().len());
            return Err(Mistake::param("flange", message).into());
        }
        params.home.as_ref().map_or(Ok(()), |home| arm::check_posture("home", home, chain.joints()))?;
        let timeout_ms = timeout(&params)?;
        let joints = arm::live_joints(&chain, params.acceleration, params.start.as_deref())?;
        let script = params.script.as_ref().map_or_else(|| Ok(Script::own()), Script::vendor)?;
        let mut description = Description::every(1.0 / params.rate_hz);
        let facts = arm::facts(&params.urdf, &params.tip, params.home.as_deref())?;
        let ports = ArmPorts::fill(description.fills(arm::ROLE), &joints, facts);
        let force = WrenchPorts::fill(&mut description, vec![pad::mount(&Mount::NONE)]);
        description.on_silence(OnSilence::Stops, silence(timeout_ms, params.rate_hz, &joints));
        description.needs_commissioning = true;
        let checks = Checks {
            start: StartCheck::new(to_flange, params.start_bounds.clone(), params.start.clone()),
            order,
            base: geometry::base(params.base_yaw),
            tcp_offset: params.tcp_offset,
            tool_mass: params.tool_mass.map(|mass| [mass, params.tool_mass_bound]),
        };
        let robot = Robot { peer: peer(&params)?, ..robot(&params, (ports, force), chain, checks, script, timeout_ms) };
        Ok(Opened { description, driver: Driver::Live(Box::new(robot)) })
    }
}

/// Returns mistakes in the link of the flange at the parameter that names it.
fn of_flange(mut mistakes: Mistakes, params: &Params) -> Mistakes {
    let is_tip = |mistake: &&mut Mistake| params.flange.is_some() && mistake.at == At::Param("tip".into());
    mistakes.iter_mut().filter(is_tip).for_each(|mistake| mistake.at = At::Param("flange".into()));
    mistakes
}

fn robot(
    params: &Params,
    (ports, force): (ArmPorts, WrenchPorts),
    chain: Chain,
    checks: Checks,
    script: Script,
    timeout_ms: i32,
) -> Robot {
    let sends_program = params.start_by == Start::Send;
    let port = |number: usize| u16::try_from(number).expect("the range of the parameter");
    let vendor = [params.trajectory_port, params.command_port].map(port);
    Robot {
        ports,
        force,
        chain,
        request: Request {
            address: format!("{}:{}", params.address, params.rtde_port),
            rate_hz: params.rate_hz,
            patience: Duration::from_secs_f64(params.connect_s),
            needs_version: script.needs_version(),
        },
        script_address: format!("{}:{}", params.address, params.script_port),
        host: params.host.clone(),
        peer: None,
        port_numbers: PortNumbers {
            reverse: port(params.reverse_port),
            request: (!sends_program).then(|| port(params.request_port)),
            vendor: script.is_vendor.then_some(vendor),
        },
        script,
        sends_program,
        allowed: Allowed { reduced: params.allow_reduced, min_speed_fraction: params.min_speed_fraction },
        checks,
        rate_hz: params.rate_hz,
        timeout_ms,
        silence: Duration::from_secs_f64(params.silence_s),
        start: Duration::from_secs_f64(params.start_s),
        acceleration: params.acceleration,
    }
}

/// Returns where the program on the robot connects from, if it is given.
fn peer(params: &Params) -> Result<Option<IpAddr>, Mistakes> {
    let parsed = params.robot_host.as_ref().map(|host| {
        let message = format!("`{host}` is not an IP address: write one such as \"192.168.0.10\"");
        host.parse().map_err(|_| Mistake::param("robot_host", message))
    });
    Ok(parsed.transpose()?)
}

/// Returns the time that each message gives to the next one [ms].
fn timeout(params: &Params) -> Result<i32, Mistakes> {
    let step = 1e3 / params.rate_hz;
    let default = (DEFAULT_TIMEOUT_STEPS * step).clamp(MIN_DEFAULT_TIMEOUT_MS, MAX_TIMEOUT_MS);
    let timeout = params.receive_timeout_ms.unwrap_or(default);
    if (step..=MAX_TIMEOUT_MS).contains(&timeout) {
        return Ok(timeout.ceil() as i32);
    }
    let message = format!("a message must come after {step} ms (one sample) to {MAX_TIMEOUT_MS} ms, not {timeout} ms");
    Err(Mistake::param("receive_timeout_ms", message).into())
}

/// Returns the longest time from the last message until the robot is at rest [s]: the time that the message gives, the
/// reaction of the controller, and the stop from the highest speed.
fn silence(timeout_ms: i32, rate_hz: f64, joints: &JointsShape) -> f64 {
    let fastest = joints.joints.iter().map(|joint| joint.speed).fold(0.0, f64::max);
    let within = f64::from(timeout_ms) * 1e-3 + REACTION_STEPS / rate_hz + fastest / STOP_DECELERATION;
    // Whole milliseconds, as people read them.
    (within * 1e3).ceil() * 1e-3
}

/// Returns, for each joint of the controller, its place in the model.
fn order(model: &[Joint], names: Option<&[String]>) -> Result<[usize; JOINTS], Mistakes> {
    let known: Vec<&str> = model.iter().map(|joint| joint.name.as_str()).collect();
    let list = known.join("`, `");
    if model.len() != JOINTS {
        let message = format!("the arm has 6 joints, but the model has {} up to the tip: `{list}`", model.len());
        return Err(Mistake::param("tip", message).into());
    }
    let mut order = [0; JOINTS];
    for (i, place) in order.iter_mut().enumerate() {
        let found = match names {
            Some(names) => known.iter().position(|joint| names.get(i).is_some_and(|name| name == joint)),
            None => known.iter().position(|joint| joint.ends_with(USUAL_JOINTS[i])),
        };
        *place = found.ok_or_else(|| {
            let missing = names.map_or(USUAL_JOINTS[i], |names| names.get(i).map_or("", |name| name));
            let message = format!("no joint of the model is `{missing}`: it has `{list}`");
            let help = "write `joints` with the model's names of base, shoulder, elbow, wrist 1, wrist 2 and wrist 3";
            Mistake::param("joints", message).help(help)
        })?;
    }
    let mut sorted = order;
    sorted.sort_unstable();
    if sorted != [0, 1, 2, 3, 4, 5] {
        return Err(Mistake::param("joints", "`joints` names a joint twice").into());
    }
    Ok(order)
}
