//! Whether a simulated bench can be what its parameters say.

use tactflow_runtime::node::{At, Mistake, Mistakes};
use tactflow_runtime::signal::ImageShape;
use tactflow_runtime::source::Code;

use super::{INERTIA, MOST, Params};
use crate::sim::joints::GIVES_WAY;
use crate::sim::object::MOUNT_DAMPING;
use crate::sim::world::is_resolved;

/// The most points at which a simulated pad is felt.
const MOST_POINTS: f64 = 4e6;
/// The most frames that an image may be late by.
const LATEST: f64 = 1000.0;

/// Whether such a bench can be simulated.
///
/// # Errors
/// What is wrong with its parameters.
pub(super) fn check(params: &Params, shape: &ImageShape) -> Result<(), Mistakes> {
    let mut mistakes = Mistakes::new();
    if shape.tactels() > MOST {
        let message = format!("{} by {} tactels are more than {MOST}", shape.rows, shape.cols);
        mistakes.push(Mistake::param("rows", message));
    }
    let points = (*params.pitch / *params.points_apart).ceil().max(1.0).powi(2) * shape.tactels() as f64;
    if points > MOST_POINTS {
        let (apart, pitch) = (*params.points_apart, *params.pitch);
        let message = format!("a tactel each {pitch} m, felt each {apart} m, asks for more than {MOST_POINTS} points");
        mistakes.push(Mistake::param("pitch", message));
    }
    if *params.latency_s * *params.rate_hz > LATEST {
        mistakes.push(Mistake::param("latency_s", format!("an image may be late by {LATEST} frames at most")));
    }
    let foam = &params.foam;
    if *foam.damping > 10.0 {
        mistakes
            .push(Mistake::param("foam.damping", "more than 10 N s/m under a tactel is no foam that steps can follow"));
    }
    if !(0.0002..=0.05).contains(&*foam.spread) {
        mistakes.push(Mistake::param("foam.spread", "foam spreads a load by 0.0002 to 0.05 m"));
    }
    if *foam.static_friction < *foam.sliding_friction {
        mistakes.push(Mistake::param("foam.static_friction", "friction at rest is not less than in motion"));
    }
    if !(0.0001..=0.001).contains(&*params.points_apart) {
        mistakes.push(Mistake::param("points_apart", "the points of the pad are 0.0001 to 0.001 m apart"));
    }
    if !(1e-6..=0.002).contains(&*params.step_s) {
        mistakes.push(Mistake::param("step_s", "the foam's motion needs steps of 1e-6 to 0.002 s"));
    }
    if let Some(inertia) = &params.inertia {
        if inertia.len() != params.start.len() {
            let message =
                format!("`inertia` has {} entries, but the arm has {} joints", inertia.len(), params.start.len());
            mistakes.push(Mistake::param("inertia", message));
        }
        if inertia.iter().any(|inertia| !(0.01..=1e3).contains(inertia)) {
            mistakes.push(Mistake::param("inertia", "an inertia is from 0.01 to 1000 kg m²"));
        }
    } else if params.start.len() != INERTIA.len() {
        let message = format!("an arm of {} joints needs `inertia`", params.start.len());
        mistakes.push(Mistake::new(Code::MissingKey, At::Node, message));
    }
    if mistakes.is_empty() { check_motion(params) } else { Err(mistakes) }
}

/// What moves faster than the steps can follow gains energy, and is nowhere in the end.
fn check_motion(params: &Params) -> Result<(), Mistakes> {
    let mut mistakes = Mistakes::new();
    let dt = *params.step_s;
    for (i, thing) in params.objects.iter().enumerate() {
        let Some(mount) = thing.mount else { continue };
        let rate = *mount / *thing.mass;
        if !is_resolved(rate, 2.0 * MOUNT_DAMPING * rate.sqrt(), dt) {
            let message =
                format!("a mount of {} N/m under {} kg swings too fast for steps of {dt} s", *mount, *thing.mass);
            mistakes.push(object(i, message));
        }
    }
    let inertia = params.inertia.as_deref().unwrap_or(&INERTIA);
    let least = inertia.iter().copied().fold(f64::INFINITY, f64::min);
    let rate = *params.stiffness / least;
    let parts = [
        ("stiffness", rate, 0.0),
        ("damping_ratio", 0.0, 2.0 * *params.damping_ratio * rate.sqrt()),
        ("friction", *params.friction / GIVES_WAY / least, 0.0),
    ];
    for (name, _, _) in parts.iter().filter(|(_, stiffness, damping)| !is_resolved(*stiffness, *damping, dt)) {
        let message = format!("a joint of {least} kg m² moves too fast for steps of {dt} s");
        mistakes.push(Mistake::param(*name, message));
    }
    if mistakes.is_empty() { Ok(()) } else { Err(mistakes) }
}

/// What is wrong with an object; a place within a list has no span, so it is told by its number.
pub(super) fn object(index: usize, message: impl std::fmt::Display) -> Mistake {
    Mistake::param("objects", format!("object {}: {message}", index + 1))
}
