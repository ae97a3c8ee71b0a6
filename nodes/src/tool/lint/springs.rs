//! Gains that are too large for an arm with springs in its joints, where no contact of the bench says how it swings.

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics, Edit};

use super::arm::Arm;
use super::mode_law::ModeLaw;
use super::stability::{FIRST_GAIN, over};
use crate::tool::control::contacts::Contact;
use crate::tool::control::digits::{down_to_two_digits, to_three_digits};
use crate::tool::control::law::Feature;

/// Gain of a loop with which an arm oscillates for ever that resonates at 5 Hz, with a damping ratio of 0.2: 4 π ζ f. Arms
/// with springs in their joints resonate at 2 to 5 Hz, so they do from 5 1/s on [1/s].
const SWINGS: f64 = 12.5;

pub(super) fn check(arm: &Arm<'_>) -> Diagnostics {
    let mut found = Diagnostics::new();
    for mode in arm.modes.iter().filter(|mode| has_springs(arm, mode)) {
        found.extend(mode.moving().filter_map(|feature| shaken(mode, feature, &arm.contacts_or_geometry())));
    }
    found
}

/// Returns the warning about a place or an angle whose loop only geometry knows, with a gain that the springs in the joints
/// do not bear.
fn shaken(mode: &ModeLaw<'_>, feature: &Feature, contacts: &[Contact]) -> Option<Diagnostic> {
    let quantity = mode.quantity(feature).filter(|quantity| matches!(*quantity, "x" | "y" | "orientation"))?;
    let contact = contacts.first().filter(|_| contacts.iter().all(|contact| contact.is_by_geometry(quantity)))?;
    let gain = feature.largest_schedule() * contact.answer(quantity)?.along(&feature.column);
    let rate = feature.kp * gain;
    if rate <= SWINGS {
        return None;
    }
    let (name, place) = (&feature.name, mode.place_of_gain(feature, "kp"));
    let message = format!(
        "the loop of `{name}` has a gain of {} 1/s {}, but the arm has springs in its joints: such an arm usually \
         oscillates with 5 to 12.5 1/s",
        to_three_digits(rate),
        over(contact.name())
    );
    let first = down_to_two_digits(FIRST_GAIN / gain);
    let help = format!(
        "begin with `kp = {first}`, as in the recipe of docs/control.md, and measure the response with `tactflow tune`"
    );
    let edit = Edit::Replace(place.clone(), first.to_string());
    Some(Diagnostic::new(Code::LowMargin, place, message).help(help).edit(edit))
}

/// Returns whether the robot file states the stiffness of the joints.
fn has_springs(arm: &Arm<'_>, mode: &ModeLaw<'_>) -> bool {
    let limiters = arm.limits.iter().filter(|limiter| limiter.kind.ends_with("contact_limit"));
    let mut nodes = limiters.filter_map(|limiter| mode.nodes.node(&limiter.node));
    nodes.any(|node| mode.nodes.number(node, "joint_n_m_per_rad").is_some())
}
