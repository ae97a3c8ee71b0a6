//! `lockstep`: a pad and an arm in an external simulator, over TCP. `docs/lockstep.md` describes the protocol.

mod bridge;
mod frames;
mod free;
mod lines;
mod listen;
mod message;
mod socket;

use std::time::Duration;

use tactflow_runtime::device::{Description, Device, Driver, OnSilence, Opened, Output};
use tactflow_runtime::node::{At, Describe, FilePath, Mistake, Mistakes, Param};
use tactflow_runtime::signal::{Image, ImageShape, Joint, JointsShape, Unit};
use tactflow_runtime::source::{Code, quoted};

use super::arm::{self, ArmPorts};
use super::per_joint::PerJoint;
use super::{Facts, pad};
use crate::arm::model::load;
use crate::builtin;
use bridge::Bridge;
use free::FreeRunning;
pub(crate) use listen::listen;
use message::Hello;
use socket::Socket;

/// Parameters of `lockstep`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Address of the simulator, `host:port`.
    #[param(default = "127.0.0.1:7777")]
    address: String,
    /// Maximum time to connect.
    #[param(unit = "s", above = 0.0, default = 5.0)]
    connect_s: f64,
    /// Maximum time to wait for a message of the simulator.
    #[param(unit = "s", above = 0.0, default = 5.0)]
    reply_s: f64,
    /// Model of the arm; the one that the simulator names if not given.
    urdf: Option<FilePath>,
    /// Posture that the arm prefers, stated as a fact; the simulator does not name one.
    #[param(unit = "rad")]
    home: Option<Vec<f64>>,
    /// Maximum acceleration of each joint; it is not part of the protocol.
    #[param(unit = "rad/s2", above = 0.0, default = 10.0)]
    acceleration: f64,
    /// Stiffness of the joints of a compliant arm, stated as a fact. The simulated arm must not be stiffer. Without it,
    /// the arm counts as stiff, and `contact_limit` lets it press slowly.
    #[param(unit = "N m/rad", above = 0.0)]
    stiffness: Option<PerJoint>,
    /// Number of frames of the self-test at the start, stated as a fact; 0 for none.
    #[param(default = pad::REST_FRAMES)]
    rest_frames: usize,
    /// Largest difference of the zero of a tactel from 0, stated as a fact; three times the threshold of the simulator if
    /// not given.
    #[param(unit = "raw", above = 0.0)]
    tare_bound: Option<f64>,
}

/// A pad and an arm in another program: any simulator that speaks the lockstep protocol.
///
/// The device connects to a simulator that listens at `address` and exchanges lines of JSON with it; `docs/lockstep.md`
/// describes how to write one. It replaces the built-in bench: `tactflow run graphs/hybrid.toml --bench
/// graphs/benches/lockstep.toml`.
///
/// First the simulator describes itself: its joints with their limits, the mount of the sensor, and the size, pitch,
/// scale and threshold of the pad. So the simulator must also run while a graph is checked. It names the model of the
/// arm: `lwr4p`, `ur5e` and `panda` are built in, and `urdf` names the file of any other model.
///
/// In lockstep the simulator waits for each command, and a run is as fast as both allow. Otherwise it runs by its own
/// clock: the device uses the newest frame, and counts the frames before it as gaps. Frames carry the time of the
/// simulator.
///
/// At the end of a run the commands go to zero, frame by frame, and then the simulator receives the reason. The
/// simulator can also end the run itself. A wrong message, a value that is not finite, silence and a closed connection
/// are faults that name the message and the field. If the simulator still listens, the device brings the arm to rest
/// before it disconnects.
///
/// It states the facts `urdf`, `tip` and, if they are given, `home` and `joint_n_m_per_rad` of the arm, and `dead`,
/// `threshold`, `pressure`, `calibration`, `mount`, `rest_frames` and `tare_bound` of the pad. The `contact` that a task
/// reports is sent as `est`.
///
/// ```toml
/// [roles]
/// pad = "tactile_pad"
/// arm = "velocity_arm"
///
/// [commands]
/// arm.velocity = "joint_limit.velocity"
///
/// [bind]
/// pad = "bench"
/// arm = "bench"
///
/// [devices.bench]
/// type = "lockstep"
/// address = "127.0.0.1:7777"
/// ```
#[derive(Describe)]
pub struct Lockstep;

impl Device for Lockstep {
    type Params = Params;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let mut socket = connect(&params)?;
        let line =
            socket.line().map_err(|why| refusal(&params.address, format!("the simulator sent no `hello`: {why}")))?;
        let hello = message::hello(&line).map_err(|why| refusal(&params.address, format!("hello (line 1): {why}")))?;
        let (description, image, arm) = describe(&hello, &params)?;
        let driver = if hello.is_lockstep {
            Driver::Lockstep(Box::new(Bridge::new(image, arm, socket, hello, params)))
        } else {
            Driver::Live(Box::new(FreeRunning { image, arm, socket: Some(socket), hello, params }))
        };
        Ok(Opened { description, driver })
    }
}

/// Returns what the device is, from the first message of the simulator.
fn describe(hello: &Hello, params: &Params) -> Result<(Description, Output<Image>, ArmPorts), Mistakes> {
    let mut description = Description::every((hello.dt * 1e9).round() * 1e-9);
    let shape = ImageShape { rows: hello.rows, cols: hello.cols, pitch: [hello.pitch; 2], unit: Unit::RAW };
    let image = pad::fill(description.fills(pad::ROLE), shape, pad_facts(hello, params));
    let joints = joints(hello, params.acceleration);
    let arm = ArmPorts::fill(description.fills(arm::ROLE), &joints, model_facts(hello, params)?);
    description.on_silence(OnSilence::Holds, free::COMMAND_TIMEOUT.as_secs_f64());
    Ok((description, image, arm))
}

fn connect(params: &Params) -> Result<Socket, Mistakes> {
    let [connect, reply] = [params.connect_s, params.reply_s].map(|time| Duration::from_secs_f64(time.min(1e6)));
    Socket::connect(&params.address, connect, reply).map_err(|why| {
        let message = format!("cannot connect to the simulator at `{}`: {why}", params.address);
        let mistake = Mistake::new(Code::Unreadable, At::Param("address".into()), message);
        let help = "start the simulator first, or give its address: `--set devices.bench.address=127.0.0.1:7777`";
        mistake.help(help).into()
    })
}

/// Returns the mistake of a simulator that cannot be used.
fn refusal(address: &str, why: String) -> Mistakes {
    Mistake::new(Code::BadData, At::Param("address".into()), format!("the simulator at `{address}`: {why}")).into()
}

fn pad_facts(hello: &Hello, params: &Params) -> Facts {
    let gain = hello.newton_per_unit / hello.counts_per_unit;
    let calibration = toml::Table::from_iter([("gain".to_owned(), gain.into()), ("unit".to_owned(), "N".into())]);
    let [threshold, pressure] = [hello.threshold_units, 1.0].map(|units| units * hello.newton_per_unit);
    let mut facts = pad::facts(threshold, pressure, Unit::NEWTON, calibration);
    facts.push(pad::mount(&hello.mount));
    let bound = params.tare_bound.unwrap_or(3.0 * hello.threshold_units * hello.counts_per_unit);
    facts.extend(pad::rest(params.rest_frames, (bound > 0.0).then_some(bound), Unit::RAW));
    facts
}

fn joints(hello: &Hello, acceleration: f64) -> JointsShape {
    let joint = |(i, name): (usize, &String)| Joint {
        name: name.clone(),
        lower: hello.q_min[i],
        upper: hello.q_max[i],
        speed: hello.dq_max[i],
        acceleration,
        start: None,
    };
    JointsShape { joints: hello.joints.iter().enumerate().map(joint).collect(), unit: Unit::RADIAN }
}

/// Returns the facts of the arm. The joints of its model must be those of the simulator.
fn model_facts(hello: &Hello, params: &Params) -> Result<Facts, Mistakes> {
    let urdf = match &params.urdf {
        Some(file) => file.clone(),
        None => model(&hello.urdf).ok_or_else(|| {
            let message = format!(
                "the simulator at `{}` names the model `{}`, which is not built in",
                params.address, hello.urdf
            );
            let mistake = Mistake::new(Code::Unreadable, At::Param("address".into()), message);
            mistake.help(format!(
                "name its file: `urdf = \"{}.urdf\"`; built-in models: {}",
                stem(&hello.urdf),
                models()
            ))
        })?,
    };
    let chain = load(&urdf, &hello.tip, &hello.mount).map_err(|mistakes| {
        // The simulator names the tip, so no file has its place.
        let of_hello = |mistake: Mistake| match mistake.at {
            At::Param(_) => refusal(&params.address, mistake.message),
            _ => vec![mistake],
        };
        mistakes.into_iter().flat_map(of_hello).collect::<Mistakes>()
    })?;
    let model: Vec<&str> = chain.joints().iter().map(|joint| joint.name.as_str()).collect();
    if hello.joints != model {
        let why =
            format!("its `joints` are {:?}, but those of the model up to `{}` are {model:?}", hello.joints, hello.tip);
        return Err(refusal(&params.address, why));
    }
    let mut facts = arm::facts(&urdf, &hello.tip, params.home.as_deref())?;
    let stiffness = params.stiffness.as_ref().map(|stiffness| stiffness.joints(hello.joints.len())).transpose();
    let stiffness = stiffness.map_err(|message| Mistake::param("stiffness", message))?;
    let stiffest = stiffness.map(|joints| joints.into_iter().fold(0.0, f64::max));
    facts.extend(stiffest.map(|stiffest| ("joint_n_m_per_rad".into(), stiffest.into())));
    Ok(facts)
}

/// Returns the name of a model without folders and extension.
fn stem(name: &str) -> &str {
    let file = name.rsplit(['/', '\\', ':']).next().unwrap_or(name);
    file.strip_suffix(".urdf").unwrap_or(file)
}

/// Returns the built-in model with a name, or `None`.
fn model(name: &str) -> Option<FilePath> {
    let has_name = |file: &str| file.strip_suffix(".urdf").is_some_and(|known| known.eq_ignore_ascii_case(stem(name)));
    let (file, bytes) = builtin::FILES.iter().find(|(file, _)| has_name(file))?;
    Some(FilePath {
        path: format!("builtin:{file}").into(),
        span: 0..0,
        builtin: Some(std::borrow::Cow::Borrowed(*bytes)),
    })
}

/// Returns the names of the built-in models.
fn models() -> String {
    quoted(builtin::FILES.iter().filter_map(|(file, _)| file.strip_suffix(".urdf")))
}
