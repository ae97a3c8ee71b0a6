//! Checks of the parameters of a simulated bench.

use tactflow_runtime::node::{Mistake, Mistakes, refuse_any};

use super::Params;
use crate::sim::object::MOUNT_DAMPING;
use crate::sim::steps::{check_step, is_resolved};

/// Checks that a bench with an arm of so many joints can be simulated.
///
/// # Errors
/// All parameters that are outside of what the simulation supports.
pub(super) fn check(params: &Params, joints: usize) -> Result<(), Mistakes> {
    let Params { pad, arm, .. } = params;
    refuse_any(pad.check().into_iter().chain(check_step(params.step_s)).chain(arm.check_inertia(joints)))?;
    refuse_any(check_mounts(params).into_iter().chain(arm.check_motion(params.step_s)))
}

/// Returns the mounts that are too fast for the steps: a spring that they do not resolve gains energy, and the
/// simulation diverges.
fn check_mounts(params: &Params) -> Mistakes {
    let mut mistakes = Mistakes::new();
    let dt = params.step_s;
    for (i, thing) in params.objects.iter().enumerate() {
        for (mount, mass, [of, with]) in
            [(thing.mount, thing.mass, ["N/m", "kg"]), (thing.turn_mount, thing.inertia, ["N m/rad", "kg m²"])]
        {
            let Some(mount) = mount else { continue };
            let rate = mount / mass;
            if !is_resolved(rate, 2.0 * MOUNT_DAMPING * rate.sqrt(), dt) {
                let message = format!(
                    "a mount of {mount} {of} with {mass} {with} oscillates too fast for a `step_s` of {dt} s: make \
                     `step_s` smaller"
                );
                mistakes.push(object(i, message));
            }
        }
    }
    mistakes
}

/// Returns the mistake of an object, by its number from 0; the message counts from 1.
pub(super) fn object(index: usize, message: impl std::fmt::Display) -> Mistake {
    Mistake::param(format!("objects.{index}"), format!("object {}: {message}", index + 1))
}
