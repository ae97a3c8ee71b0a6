//! `ros2_arm`: an arm behind topics.

use std::time::Duration;

use tactflow_runtime::device::{Description, Device, Driver, OnSilence, Opened};
use tactflow_runtime::node::{At, Describe, FilePath, Mistake, Mistakes, Param};
use tactflow_runtime::signal::{Joint, JointsShape};
use tactflow_runtime::source::Code;

use super::beyond::Beyond;
use super::driver::ArmDriver;
use super::output::{Commanded, Form};
use super::place::{Place, check_topic};
use crate::arm::chain::Chain;
use crate::arm::model::load;
use crate::arm::mount::Mount;
use crate::devices::arm::{self, ArmPorts};
use crate::devices::start::{StartBounds, StartCheck};
use crate::usual::USUAL_RAD;

/// Time that a controller needs to take a message and to act on it, at most [s].
const REACTION_S: f64 = 0.02;
/// The same for MoveIt Servo, which publishes every 34 ms by default, and smooths what it publishes [s].
const SERVO_REACTION_S: f64 = 0.15;

/// The type of the commands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
enum Kind {
    /// `trajectory_msgs/msg/JointTrajectory`: each message ends at rest.
    Trajectory,
    /// `std_msgs/msg/Float64MultiArray`: velocities [rad/s] in the order of `joints`. Something on the robot must stop it
    /// when no message comes: see `watchdog_ms`.
    Velocity,
    /// `geometry_msgs/msg/TwistStamped` for MoveIt Servo: the velocity of the origin of the tip [m/s] and its angular
    /// velocity [rad/s], in the axes of `frame`. See `command_in_type` and `watchdog_ms`.
    Twist,
}

/// What MoveIt Servo takes the numbers of a twist for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
enum CommandIn {
    /// Fractions of a speed that Servo knows alone. It is the default of Servo, and is refused.
    Unitless,
    /// m/s and rad/s.
    SpeedUnits,
}

/// Parameters of `ros2_arm`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// The topic of `sensor_msgs/msg/JointState`.
    #[param(default = "/joint_states")]
    states: String,
    /// The topic of the commands, such as `/joint_trajectory_controller/joint_trajectory`.
    command: String,
    /// The type of the commands.
    #[param(default = Kind::Trajectory)]
    message: Kind,
    /// Names of the joints on the robot, in the order of the model from its root; those of the model if not given.
    joints: Option<Vec<String>>,
    #[param(flatten)]
    place: Place,
    /// The arm's model. The robot file that `robot` names has it, and `tip` and `home` too.
    urdf: FilePath,
    /// Link that carries the sensor.
    tip: String,
    /// Posture that the arm prefers, stated as a fact.
    #[param(unit = "rad")]
    home: Option<Vec<f64>>,
    /// Posture from which runs begin. A run refuses to move an arm that is elsewhere, and the check knows where the sensor
    /// starts.
    #[param(unit = "rad")]
    start: Option<Vec<f64>>,
    /// Bounds of the posture.
    #[param(default = PostureBounds::default())]
    start_bounds: PostureBounds,
    /// Maximum acceleration of each joint.
    #[param(unit = "rad/s2", above = 0.0, default = 10.0)]
    acceleration: f64,
    /// Joint states per second.
    #[param(unit = "Hz", range = 10.0..=2000.0)]
    rate_hz: f64,
    /// Time without a joint state after which the arm is lost.
    #[param(unit = "ms", range = 10.0..=10_000.0, default = 200.0)]
    timeout_ms: f64,
    /// How far a trajectory goes on before it slows down. It must bridge the time between two commands and the delay of
    /// the network.
    #[param(unit = "ms", range = 5.0..=200.0, default = 40.0)]
    horizon_ms: f64,
    /// Largest difference between the clock of the robot and that of this machine. A command of the type `trajectory`
    /// states when it was made, so that one that arrives late does not move the arm.
    #[param(unit = "ms", above = 0.0, default = 20.0)]
    clock_bound_ms: f64,
    /// Time without a command after which the robot stops by itself. Velocities and twists need it: state here what the
    /// controller on the robot does. For MoveIt Servo, it is its parameter `incoming_command_timeout`.
    #[param(unit = "ms", range = 1.0..=1000.0)]
    watchdog_ms: Option<f64>,
    /// Of twists: the parameter `command_in_type` of MoveIt Servo, which must be `speed_units`.
    command_in_type: Option<CommandIn>,
    /// Of twists: the name of the base of the model on the robot. It must be the planning frame of MoveIt Servo.
    frame: Option<String>,
}

/// How far the joints may be from where they should be.
#[derive(Debug, Clone, Param)]
#[param(default)]
struct PostureBounds {
    /// Maximum difference between the measured and the commanded position of a joint, for trajectories.
    #[param(unit = "rad", above = 0.0, usual = 0.0..=USUAL_RAD, default = 0.05)]
    deflection: f64,
    /// Maximum difference between the position of a joint and `start` when a run begins.
    #[param(unit = "rad", above = 0.0, usual = 0.0..=USUAL_RAD, default = 0.1)]
    posture: f64,
}

/// An arm behind topics of ROS 2, such as one of `ros2_control`. It needs no ROS installation, and has not been run on a
/// robot.
///
/// The joints are found by name in the messages of `states`, whatever their order; messages of other joints are skipped.
/// The commands are trajectories that always end at rest: without another one, the arm is at rest after `horizon_ms` and
/// the time to slow down, whatever happens to this process, its machine or the network. While the arm is to rest, nothing
/// is sent. With `message = "velocity"`, velocities are sent, and only `watchdog_ms` on the robot stops it.
///
/// With `message = "twist"`, MoveIt Servo gets the twist of the tip that the joint velocities amount to, and computes joint
/// velocities of its own. The commands have crossed all limits, but those of single joints hold for what Servo makes of
/// them only as far as it keeps to them. So a joint that is measured outside of its range, or above 1.2 times its greatest
/// speed, stops the arm. Twists have absolute times, as trajectories have.
///
/// The arm is moved only if all of this holds, and the message says what does not: all joints are stated, by one publisher;
/// somebody reads the commands as the type that is sent; nobody else publishes on their topic; and the clocks agree. When
/// something changes, the output `safety` is false and the commands ramp to zero, until `resume`.
///
/// Commands are reliable, with a depth of 1 and a lifespan: a message is worth nothing when the next one is due. States are
/// read best effort. The device counts `bad messages` and `commands that were not sent`. It states the facts `urdf`, `tip`
/// and, if it is given, `home`. `docs/ros2.md` describes the set-up of a robot.
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
/// type = "ros2_arm"
/// command = "/joint_trajectory_controller/joint_trajectory"
/// urdf = "builtin:panda.urdf"
/// tip = "panda_hand"
/// rate_hz = 250.0
/// home = [0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785]   # [rad]
/// ```
#[derive(Debug, Describe)]
pub struct Ros2Arm;

impl Device for Ros2Arm {
    type Params = Params;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        check_topic("states", &params.states)?;
        check_topic("command", &params.command)?;
        let chain = load(&params.urdf, &params.tip, &Mount::NONE)?;
        params.home.as_ref().map_or(Ok(()), |home| arm::check_posture("home", home, chain.joints()))?;
        let joints = arm::live_joints(&chain, params.acceleration, params.start.as_deref())?;
        let names = names(&params, &joints)?;
        let commanded = commanded(&params, &joints, &chain)?;
        let mut description = Description::every(1.0 / params.rate_hz);
        let facts = arm::facts(&params.urdf, &params.tip, params.home.as_deref())?;
        let ports = ArmPorts::fill(description.fills(arm::ROLE), &joints, facts);
        description.on_silence(OnSilence::Stops, commanded.silence);
        description.needs_commissioning = true;
        let PostureBounds { deflection, posture } = params.start_bounds;
        // Nobody states a pose of the tip.
        let bounds = StartBounds { deflection, posture, ..StartBounds::default() };
        let limits =
            chain.joints().iter().zip(&names).map(|(joint, name)| Joint { name: name.clone(), ..joint.clone() });
        let beyond = commanded.is_of_tip().then(|| Beyond::new(limits.collect()));
        let driver = ArmDriver {
            beyond,
            ports,
            site: params.place.site()?,
            states: params.states,
            command: params.command,
            names,
            start: StartCheck::new(chain, bounds, params.start),
            deflection,
            acceleration: params.acceleration,
            timeout: Duration::from_secs_f64(params.timeout_ms * 1e-3),
            commanded,
        };
        Ok(Opened { description, driver: Driver::Live(Box::new(driver)) })
    }
}

/// Returns the names of the joints on the robot.
fn names(params: &Params, joints: &JointsShape) -> Result<Vec<String>, Mistakes> {
    let model = joints.joints.iter().map(|joint| joint.name.clone());
    let Some(names) = &params.joints else { return Ok(model.collect()) };
    if names.len() != joints.joints.len() {
        let model: Vec<String> = model.collect();
        let message =
            format!("`joints` has {} names, but the model has the joints `{}`", names.len(), model.join("`, `"));
        return Err(Mistake::param("joints", message).into());
    }
    let twice = names.iter().enumerate().find(|(i, name)| names[..*i].contains(name));
    twice.map_or(Ok(names.clone()), |(_, name)| {
        Err(Mistake::param("joints", format!("the joint `{name}` stands twice in `joints`")).into())
    })
}

/// Returns how the arm is commanded, and when it rests without a command.
fn commanded(params: &Params, joints: &JointsShape, chain: &Chain) -> Result<Commanded, Mistakes> {
    if params.message != Kind::Twist {
        let is_given = [("command_in_type", params.command_in_type.is_some()), ("frame", params.frame.is_some())];
        if let Some((name, _)) = is_given.into_iter().find(|(_, is_given)| *is_given) {
            let message = format!("`{name}` is for twists");
            let help = format!("remove `{name}`, or write `message = \"twist\"`");
            return Err(Mistake::key(name, message).help(help).into());
        }
    }
    let horizon = params.horizon_ms * 1e-3;
    let (form, lifespan, reaction) = match (params.message, params.watchdog_ms) {
        (Kind::Trajectory, None) => (Form::Trajectory { horizon }, horizon, REACTION_S),
        (Kind::Velocity, Some(watchdog_ms)) => (Form::Velocity, watchdog_ms * 1e-3, REACTION_S),
        (Kind::Twist, Some(watchdog_ms)) => (of_servo(params, chain)?, watchdog_ms * 1e-3, SERVO_REACTION_S),
        (Kind::Trajectory, Some(_)) => {
            let message = "a trajectory ends at rest by itself, so it needs no watchdog";
            return Err(Mistake::key("watchdog_ms", message).help("remove `watchdog_ms`").into());
        }
        (Kind::Velocity, None) => {
            let message = "nothing stops an arm that follows velocities when no message comes";
            let help = "write `watchdog_ms`, the time after which the controller on the robot stops by itself, or \
                        `message = \"trajectory\"`";
            return Err(Mistake::new(Code::MissingKey, At::Node, message).help(help).into());
        }
        (Kind::Twist, None) => {
            let message = "it is not stated when MoveIt Servo stops an arm for which no message comes";
            let help = "write `watchdog_ms`, with the value of Servo's `incoming_command_timeout`: `watchdog_ms = 100` for \
                        its default of 0.1 s";
            return Err(Mistake::new(Code::MissingKey, At::Node, message).help(help).into());
        }
    };
    let fastest = joints.joints.iter().map(|joint| joint.speed).fold(0.0, f64::max);
    let silence = ((lifespan + fastest / params.acceleration + reaction) * 1e3).ceil() * 1e-3;
    Ok(Commanded { form, lifespan, clock_bound: (params.clock_bound_ms * 1e6) as i64, silence })
}

/// Returns what MoveIt Servo is sent, if it takes m/s and rad/s.
fn of_servo(params: &Params, chain: &Chain) -> Result<Form, Mistakes> {
    const UNITS: &str = "set `command_in_type: speed_units` in the parameters of Servo, and write \
                         `command_in_type = \"speed_units\"` here";
    match params.command_in_type {
        Some(CommandIn::SpeedUnits) => {}
        Some(CommandIn::Unitless) => {
            let message = "with `unitless`, MoveIt Servo multiplies a twist in m/s by its own `scale`";
            return Err(Mistake::param("command_in_type", message).help(UNITS).into());
        }
        None => {
            let message =
                "MoveIt Servo takes twists without units, unless its parameter `command_in_type` says otherwise";
            return Err(Mistake::new(Code::MissingKey, At::Node, message).help(UNITS).into());
        }
    }
    let Some(frame) = params.frame.clone().filter(|frame| !frame.is_empty()) else {
        let message = "twists need `frame`, the name of the base of the model on the robot";
        let help = "write the planning frame of MoveIt Servo, such as `frame = \"base_link\"`";
        return Err(Mistake::new(Code::MissingKey, At::Node, message).help(help).into());
    };
    Ok(Form::Twist { chain: Box::new(chain.clone()), frame })
}
