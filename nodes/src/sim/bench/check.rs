//! Checks of the parameters of a simulated bench.

use tactflow_runtime::node::{At, Mistake, Mistakes, refuse_any};
use tactflow_runtime::signal::ImageShape;
use tactflow_runtime::source::Code;

use super::{INERTIA, MAX_TACTELS, Params};
use crate::sim::joints::MAX_STRAIN;
use crate::sim::object::MOUNT_DAMPING;
use crate::sim::world::is_resolved;

/// Largest number of points of a simulated pad.
const MAX_POINTS: f64 = 4e6;
/// Largest latency of an image [frames].
const MAX_LATENCY_FRAMES: f64 = 1000.0;

/// Checks that a bench with these parameters, and an arm of so many joints, can be simulated.
///
/// # Errors
/// All parameters that are outside of what the simulation supports.
pub(super) fn check(params: &Params, joints: usize, shape: &ImageShape) -> Result<(), Mistakes> {
    let Params { pitch, points_apart, foam, .. } = params;
    let (rows, cols) = (shape.rows, shape.cols);
    let points = (pitch / points_apart).ceil().max(1.0).powi(2) * shape.tactels() as f64;
    let limits = [
        (
            shape.tactels() <= MAX_TACTELS,
            "rows",
            format!("{rows} by {cols} tactels are more than the {MAX_TACTELS} that can be simulated"),
        ),
        (
            points <= MAX_POINTS,
            "pitch",
            format!("a pitch of {pitch} m with points {points_apart} m apart needs more than {MAX_POINTS} points"),
        ),
        (
            params.latency_s * params.rate_hz <= MAX_LATENCY_FRAMES,
            "latency_s",
            format!("the latency must be at most {MAX_LATENCY_FRAMES} frames"),
        ),
        (foam.damping <= 10.0, "foam.damping", "the damping under a tactel must be at most 10 N s/m".into()),
        ((0.0002..=0.05).contains(&foam.spread), "foam.spread", "the spread must be from 0.0002 to 0.05 m".into()),
        (
            foam.static_friction >= foam.sliding_friction,
            "foam.static_friction",
            "static friction must not be less than sliding friction".into(),
        ),
        ((0.0001..=0.001).contains(points_apart), "points_apart", "points must be from 0.0001 to 0.001 m apart".into()),
        ((1e-6..=0.002).contains(&params.step_s), "step_s", "the step must be from 1e-6 to 0.002 s".into()),
    ];
    let broken = limits.into_iter().filter(|(holds, ..)| !holds);
    let mut mistakes: Mistakes = broken.map(|(_, name, message)| Mistake::param(name, message)).collect();
    if let Some(inertia) = &params.inertia {
        if inertia.len() != joints {
            let message = format!("`inertia` has {} entries, but the arm has {joints} joints", inertia.len());
            mistakes.push(Mistake::param("inertia", message));
        }
        if inertia.iter().any(|inertia| !(0.01..=1e3).contains(inertia)) {
            mistakes.push(Mistake::param("inertia", "each inertia must be from 0.01 to 1000 kg m²"));
        }
    } else if joints != INERTIA.len() {
        let message = format!("an arm of {joints} joints needs `inertia`");
        mistakes.push(Mistake::new(Code::MissingKey, At::Node, message));
    }
    refuse_any(mistakes)?;
    check_motion(params)
}

/// Checks that every spring is slow enough for the steps: a faster one gains energy, and the simulation diverges.
fn check_motion(params: &Params) -> Result<(), Mistakes> {
    let mut mistakes = Mistakes::new();
    let dt = params.step_s;
    for (i, thing) in params.objects.iter().enumerate() {
        let Some(mount) = thing.mount else { continue };
        let rate = mount / thing.mass;
        if !is_resolved(rate, 2.0 * MOUNT_DAMPING * rate.sqrt(), dt) {
            let message = format!(
                "a mount of {} N/m with {} kg oscillates too fast for a `step_s` of {dt} s: make `step_s` smaller",
                mount, thing.mass
            );
            mistakes.push(object(i, message));
        }
    }
    let inertia = params.inertia.as_deref().unwrap_or(&INERTIA);
    let min_inertia = inertia.iter().copied().fold(f64::INFINITY, f64::min);
    let rate = params.stiffness / min_inertia;
    let parts = [
        ("stiffness", rate, 0.0),
        ("damping_ratio", 0.0, 2.0 * params.damping_ratio * rate.sqrt()),
        ("friction", params.friction / MAX_STRAIN / min_inertia, 0.0),
    ];
    for (name, _, _) in parts.iter().filter(|(_, stiffness, damping)| !is_resolved(*stiffness, *damping, dt)) {
        let message =
            format!("a joint of {min_inertia} kg m² moves too fast for a `step_s` of {dt} s: make `step_s` smaller");
        mistakes.push(Mistake::param(*name, message));
    }
    refuse_any(mistakes)
}

/// Returns the mistake of an object, by its number from 0; the message counts from 1.
pub(super) fn object(index: usize, message: impl std::fmt::Display) -> Mistake {
    Mistake::param(format!("objects.{index}"), format!("object {}: {message}", index + 1))
}
