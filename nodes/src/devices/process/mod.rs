//! `process`: a program in any language, as a node that computes beside the tick or as a pad. `docs/processes.md` has the
//! protocol.
//!
//! `signature` is what the program states of itself, `wire` the bytes of both directions, `ports` the ports of the graph,
//! `child` the operating system, `session` the conversation. `stepped`, `live` and `pad` are the three ways to run.

mod child;
mod launch;
mod live;
mod pad;
mod ports;
mod session;
pub(crate) mod signature;
mod stepped;
mod wire;

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use tactflow_runtime::device::{Description, Device, Driver, Opened, RoleType};
use tactflow_runtime::node::{Describe, FilePath, Map, Mistake, Mistakes, Param, Reader, Written, refuse_any};
use tactflow_runtime::signal::Unit;
use tactflow_runtime::source::Value;

use super::pad as pads;
use launch::Launch;
use live::Beside;
use pad::PadProcess;
use ports::Ports;
use session::signature_command;
pub(crate) use session::{ask_signature, in_shell};
use signature::{PadShape, Signature};
use stepped::InLockstep;

/// Parameters of `process`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// The program and its arguments, as `["python3", "my_feature.py"]`. It runs in the folder of `signature`.
    command: Vec<String>,
    /// The file with what the program states of itself, which `tactflow signature` writes.
    signature: SignatureFile,
    /// The parameters of the program, by name; the others have the defaults that it states.
    #[param(unit = "_", default = Map(Default::default()))]
    params: Map<f64>,
    /// Nominal time between two answers, or between two frames of a pad. An answer is too old after five of them, unless
    /// the section `[policy]` says otherwise.
    #[param(unit = "ms", range = 0.1..=60_000.0, default = 20.0)]
    period_ms: f64,
    /// Longest time for an answer, or between two frames of a pad. A program that takes longer has failed, and is ended.
    #[param(unit = "ms", range = 1.0..=600_000.0, default = 1000.0)]
    timeout_ms: f64,
    /// Longest time until the program has stated its signature: the time to start it and to load its libraries.
    #[param(unit = "s", range = 0.1..=600.0, default = 30.0)]
    start_s: f64,
    /// Of a pad: the noise threshold, stated as a fact, in the unit of its image.
    #[param(unit = "_", range = 0.0..)]
    threshold: Option<f64>,
    /// Of a pad: the unit of pressure per tactel, stated as a fact, in the unit of its image.
    #[param(unit = "_", above = 0.0)]
    pressure: Option<f64>,
}

/// The path of the file of a signature. Where there is none, the mistake says how to write it.
#[derive(Debug, Clone)]
struct SignatureFile(FilePath);

impl Param for SignatureFile {
    const EXPECTS: &'static str = FilePath::EXPECTS;

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let before = reader.mistakes.len();
        let file = FilePath::read(value, reader);
        for mistake in &mut reader.mistakes[before..] {
            let help = "write it with `tactflow signature -- PROGRAM`, in the folder of the graph";
            mistake.help.get_or_insert_with(|| help.to_owned());
        }
        file.map(Self)
    }

    fn written(&self) -> Option<Written> {
        self.0.written()
    }
}

/// A program in any language: a node beside the tick, or a pad.
///
/// The program writes one line with its signature: its ports, its parameters, their units and their documentation. Then
/// it exchanges binary frames over its standard input and output. `docs/processes.md` describes the protocol on one page,
/// and the Python package beside this device speaks it.
///
/// **As a node.** A block of the section `[nodes]` has `type = "process"`, and wires every input of the signature. It
/// computes beside the tick, which never waits for it: the program gets the newest values, and those that come while it
/// computes are skipped and counted. An answer carries the stamp of what it was computed from, so `max_age_ms` and the
/// policies apply to it as to any sample. In virtual time the graph waits for each answer, and two runs are the same. A
/// recording keeps the answers, so a replay needs no program. A loop through such a node is a loop through the world: its
/// answer is there one tick later at the earliest.
///
/// **As a pad.** In a bench, a program without inputs whose only output is the image `image` fills the role
/// `tactile_pad`. One whose only output is the vector image `vectors` fills the role `three_axis_pad`; its z is the image.
/// A program is never an arm: nothing outside of it would stop the motion when it hangs.
///
/// **What goes wrong.** A program that ends, hangs, writes anything but frames, answers with another size or states
/// another signature than the file has failed, and the policy `device` decides. With `restart = true` in the block of a
/// node, and `reconnect = true` in that of a pad, it is started once more, after 50 ms and then after twice the time up to
/// 2 s. At the end of a run, and when this tool dies, its whole process group ends.
///
/// `check` reads the file with the signature and runs nothing. `tactflow signature` writes it. The program gets no more
/// than the values of its wires: it cannot see the rest of the graph.
///
/// ```toml
/// [roles]
/// pad = "tactile_pad"
///
/// [bind]
/// pad = "skin"
///
/// [devices.skin]                      # nodes/python/examples/wave_pad.py
/// type = "process"
/// command = ["python3", "wave_pad.py"]
/// signature = "builtin:programs/wave_pad.node.toml"
/// period_ms = 10
/// threshold = 0.02                    # [N]
/// ```
#[derive(Debug, Describe)]
pub struct Process;

impl Device for Process {
    type Params = Params;

    const IS_NODE: bool = true;

    fn role(params: &Params) -> Result<RoleType, Mistakes> {
        let signature = read(params)?;
        if signature.inputs.is_empty() {
            let message = format!("`{}` has no inputs, so it is no node", signature.name);
            let help = "bind it as a pad in a bench, or give the program an input and write its signature once more";
            return Err(Mistake::param("signature", message).help(help).into());
        }
        Ok(ports::role(&signature))
    }

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let signature = read(&params)?;
        let known = || signature.params.iter().map(|param| param.name.as_str());
        let strange = params.params.0.keys().filter(|name| !known().any(|known| known == *name));
        let strange = strange.map(|name| {
            let message = format!("`{}` has no parameter `{name}`", signature.name);
            Mistake::key(format!("params.{name}"), message).suggest(name, known(), "parameters")
        });
        let mut mistakes: Mistakes = strange.collect();
        if params.command.iter().all(String::is_empty) {
            let message = "there is no program to run";
            mistakes.push(Mistake::param("command", message).help("for example `[\"python3\", \"my_feature.py\"]`"));
        }
        refuse_any(mistakes)?;
        let launch = Arc::new(launch(&params, signature));
        if launch.signature.inputs.is_empty() { open_pad(&params, &launch) } else { open_node(&params, &launch) }
    }
}

fn open_node(params: &Params, launch: &Arc<Launch>) -> Result<Opened, Mistakes> {
    for (name, is_given) in [("threshold", params.threshold.is_some()), ("pressure", params.pressure.is_some())] {
        if is_given {
            let message = format!("`{name}` is for a pad, and `{}` has inputs", launch.signature.name);
            return Err(Mistake::key(name, message).help("remove it, or set it under `params`").into());
        }
    }
    let mut description = Description::every(params.period_ms * 1e-3);
    let ports = Ports::state(&mut description, &launch.signature);
    let live = Box::new(Beside::new(Arc::clone(launch), ports.clone()));
    let stepped = Box::new(InLockstep::new(Arc::clone(launch), ports));
    Ok(Opened { description, driver: Driver::Beside { stepped, live } })
}

fn open_pad(params: &Params, launch: &Arc<Launch>) -> Result<Opened, Mistakes> {
    let Some(PadShape { image: shape, has_three_axes }) = launch.signature.pad() else {
        let name = &launch.signature.name;
        let message = format!(
            "`{name}` is no pad: a pad has the image `image`, or with three axes the vector image `vectors`, and no other \
             port"
        );
        let help = "a program is never an arm: nothing outside of it would stop the motion when it hangs";
        return Err(Mistake::param("signature", message).help(help).into());
    };
    let mut description = Description::every(params.period_ms * 1e-3);
    let mut facts: super::Facts = vec![
        ("dead".into(), toml::Value::Array(Vec::new())),
        ("calibration".into(), toml::Table::from_iter([("gain".to_owned(), 1.0.into())]).into()),
    ];
    let fact = |value: f64, unit: Unit| toml::Value::from(format!("{value} {unit}"));
    facts.extend(params.threshold.map(|value| ("threshold".into(), fact(value, shape.unit))));
    facts.extend(params.pressure.map(|value| ("pressure".into(), fact(value, shape.unit.per_tactel()))));
    let (image, vectors) = if has_three_axes {
        let (image, vectors) = pads::fill_three_axes(description.fills(pads::THREE_AXES), shape, facts);
        (image, Some(vectors))
    } else {
        (pads::fill(description.fills(pads::ROLE), shape, facts), None)
    };
    let driver = Driver::Live(Box::new(PadProcess::new(Arc::clone(launch), image, vectors)));
    Ok(Opened { description, driver })
}

/// Reads the signature of a program from its file.
fn read(params: &Params) -> Result<Signature, Mistakes> {
    let SignatureFile(file) = &params.signature;
    let bytes = file.bytes()?;
    let text = String::from_utf8_lossy(&bytes);
    Signature::from_toml(&text).map_err(|why| {
        let message = format!("`{}` is no signature of a program: {why}", shown(&file.path));
        let help = format!("write it once more with `{}`", signature_command(&params.command));
        Mistake::param("signature", message).help(help).into()
    })
}

/// Returns the name of a file for a command to paste.
fn shown(path: &Path) -> String {
    path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned()
}

fn launch(params: &Params, signature: Signature) -> Launch {
    let SignatureFile(file) = &params.signature;
    let folder = file.path.parent().filter(|folder| file.builtin.is_none() && !folder.as_os_str().is_empty());
    let values = signature.params.iter().map(|param| {
        let value = params.params.0.get(&param.name).copied().unwrap_or(param.default);
        (param.name.clone(), value)
    });
    Launch {
        command: params.command.clone(),
        folder: folder.map_or_else(|| PathBuf::from("."), Path::to_path_buf),
        values: values.collect(),
        signature,
        period: Duration::from_secs_f64(params.period_ms * 1e-3),
        timeout: Duration::from_secs_f64(params.timeout_ms * 1e-3),
        start: Duration::from_secs_f64(params.start_s),
    }
}
