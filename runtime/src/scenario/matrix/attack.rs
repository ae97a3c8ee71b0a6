//! Runs a task with faults, and keeps what the scene shows in each tick.

use nalgebra::Vector3;

use super::scene::Scene;
use crate::catalogue::Catalogue;
use crate::engine::Engine;
use crate::graph::{Request, compile};
use crate::node::PortId;
use crate::scenario::inject::{Injection, inject};
use crate::signal::{Image, Pose, Scalar, Twist};

/// What one tick shows of a pad.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Reading {
    /// True force [N].
    pub(super) force: f64,
    /// Place of the sensor in the base [m], and its z.
    pub(super) place: Vector3<f64>,
    pub(super) axis: Vector3<f64>,
    /// Commanded velocity of the sensor in its own frame, while there is one [m/s].
    pub(super) velocity: Option<Vector3<f64>>,
}

/// One tick.
#[derive(Debug, Clone)]
pub(super) struct Moment {
    /// Time [s].
    pub(super) time: f64,
    pub(super) sides: Vec<Reading>,
    /// Whether a limiter reduces the motion.
    pub(super) is_limited: bool,
    /// Commands of all devices.
    pub(super) commands: Vec<f64>,
}

/// One run.
#[derive(Debug, Default)]
pub(super) struct Run {
    pub(super) moments: Vec<Moment>,
    /// The named fault that has ended it, if one has.
    pub(super) fault: Option<String>,
    /// The halts: time [s] and cause.
    pub(super) halts: Vec<(f64, String)>,
    /// Whether every command was zero at the end, within the time that the ramp takes.
    pub(super) is_at_rest: bool,
    /// Largest reading of the image that is attacked.
    pub(super) largest: f64,
}

/// How long a run goes on, and when the operator stops it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Course {
    /// End [s].
    pub(super) until: f64,
    pub(super) stop: Option<f64>,
}

const fn nanos(seconds: f64) -> i64 {
    (seconds * 1e9) as i64
}

fn seconds(nanos: i64) -> f64 {
    nanos as f64 * 1e-9
}

/// Runs the task. Returns `None` if it was interrupted.
pub(super) fn run(
    (catalogue, request): (&Catalogue, &Request),
    scene: &Scene,
    injections: &[Injection],
    seed: u64,
    course: Course,
    is_interrupted: &dyn Fn() -> bool,
) -> Result<Option<Run>, String> {
    let first = |report: crate::source::Report| report.diagnostics.first().map(|one| one.message.clone());
    let mut compiled = compile(catalogue, request).map_err(|report| first(report).unwrap_or_default())?;
    inject(&mut compiled, injections, seed);
    let mut engine = Engine::new(compiled);
    let probe = Probe::new(scene, &engine);
    let (mut run, mut stop) = (Run::default(), course.stop.map(nanos));
    while let Some(next) = engine.next().filter(|next| *next <= nanos(course.until)) {
        if is_interrupted() {
            return Ok(None);
        }
        if stop.is_some_and(|at| next >= at) {
            stop = None;
            engine.send("stop")?;
        }
        if let Err(fault) = engine.tick(next) {
            run.fault = Some(fault.to_string());
            break;
        }
        run.moments.push(probe.look(scene, &engine));
        run.largest = run.largest.max(probe.largest(&engine));
        run.fault = engine.failures().next().map(|(_, fault)| fault.to_string());
        if run.fault.is_some() || engine.is_done() {
            break;
        }
    }
    let halts = engine.tasks().iter().flat_map(|task| task.halts());
    let rests = engine.rests().iter().map(|rest| &rest.fault);
    let faults = halts.map(|halt| &halt.fault).chain(rests);
    run.halts = faults.map(|fault| (seconds(fault.time), fault.to_string())).collect();
    run.is_at_rest = comes_to_rest(scene, &mut engine);
    engine.finish("the matrix has seen enough");
    Ok(Some(run))
}

/// Ramps every command to zero. Returns whether all are zero within the time that their accelerations take.
fn comes_to_rest(scene: &Scene, engine: &mut Engine) -> bool {
    let ticks = ramp_s(scene, &commands(scene, engine)) / scene.period;
    let is_still = (0..=ticks.ceil() as u64 + 3).any(|_| engine.wind_down());
    engine.wind_down();
    is_still && commands(scene, engine).iter().all(|command| *command == 0.0)
}

fn commands(scene: &Scene, engine: &Engine) -> Vec<f64> {
    scene.devices.iter().flat_map(|(name, _)| engine.commands(name).unwrap_or_default()).collect()
}

/// Returns how long commands take to zero with the accelerations that they may have [s].
pub(super) fn ramp_s(scene: &Scene, commands: &[f64]) -> f64 {
    let accelerations = scene.devices.iter().flat_map(|(_, accelerations)| accelerations);
    commands.iter().zip(accelerations).map(|(command, most)| command.abs() / most).fold(0.0, f64::max)
}

/// The ports of a scene in an engine.
struct Probe {
    sides: Vec<[Option<PortId>; 3]>,
    image: Option<PortId>,
}

impl Probe {
    fn new(scene: &Scene, engine: &Engine) -> Self {
        let id = |name: &String| engine.port(name).map(|(_, id)| *id);
        let side = |side: &super::scene::Side| {
            [id(&side.force), side.pose.as_ref().and_then(id), side.twist.as_ref().and_then(id)]
        };
        Self {
            sides: scene.sides.iter().map(side).collect(),
            image: scene.sides.first().and_then(|side| id(&side.image)),
        }
    }

    fn look(&self, scene: &Scene, engine: &Engine) -> Moment {
        let bus = engine.bus();
        let side = |[force, pose, twist]: &[Option<PortId>; 3]| {
            let pose = pose.and_then(|id| bus.get::<Pose>(id));
            Reading {
                force: force.and_then(|id| bus.get::<Scalar>(id)).copied().unwrap_or_default(),
                place: pose.map(|pose| pose.0.translation.vector).unwrap_or_default(),
                axis: pose.map(|pose| pose.0.rotation * Vector3::z()).unwrap_or_default(),
                velocity: twist.and_then(|id| bus.get::<Twist>(id)).map(Twist::linear),
            }
        };
        Moment {
            time: seconds(engine.now()),
            sides: self.sides.iter().map(side).collect(),
            is_limited: engine.limits().any(|(_, scale)| scale < 0.999),
            commands: commands(scene, engine),
        }
    }

    fn largest(&self, engine: &Engine) -> f64 {
        let image = self.image.and_then(|id| engine.bus().get::<Image>(id));
        image.map_or(0.0, |image| image.cells().iter().fold(0.0, |most: f32, cell| most.max(*cell))).into()
    }
}
