//! Gains that are too large for an arm with springs in its joints, where no contact of the bench says how it swings.

use std::f64::consts::PI;

use tactflow_runtime::source::{Code, Diagnostic, Diagnostics, Edit};

use super::arm::Arm;
use super::mode_law::ModeLaw;
use super::stability::{first_gain, over};
use crate::tool::control::contacts::Contact;
use crate::tool::control::digits::{down_to_two_digits, to_three_digits};
use crate::tool::control::law::Feature;

/// Frequency at which an arm with springs in its joints resonates at most [Hz].
const RESONANCE: f64 = 5.0;

pub(super) fn check(arm: &Arm<'_>) -> Diagnostics {
    let mut found = Diagnostics::new();
    // With a resonance of f, and nothing else, a loop oscillates for ever with a gain of 4 π ζ f.
    let Some(bears) = arm.damping_ratio.map(|ratio| 4.0 * PI * ratio * RESONANCE) else { return found };
    for mode in &arm.modes {
        found.extend(mode.moving().filter_map(|feature| shaken(mode, feature, &arm.contacts_or_geometry(), bears)));
    }
    found
}

/// Returns the warning about a place whose loop only geometry knows, with a gain that the springs in the joints do not bear
/// [1/s]. The angle of a line resonates faster.
fn shaken(mode: &ModeLaw<'_>, feature: &Feature, contacts: &[Contact], bears: f64) -> Option<Diagnostic> {
    let quantity = mode.quantity(feature).filter(|quantity| matches!(*quantity, "x" | "y"))?;
    if !contacts.iter().all(|contact| contact.is_by_geometry(quantity)) {
        return None;
    }
    let rate = |contact: &Contact| {
        let factors = feature.schedules.iter().map(|schedule| schedule.factor(contact));
        Some(factors.product::<Option<f64>>()? * contact.answer(quantity)?.along(&feature.column))
    };
    let rates = contacts.iter().filter_map(|contact| Some((contact, rate(contact)?)));
    let (contact, gain) = rates.max_by(|(_, one), (_, other)| one.total_cmp(other))?;
    if feature.kp * gain <= bears {
        return None;
    }
    let (name, place) = (&feature.name, mode.place_of_gain(feature, "kp"));
    let message = format!(
        "the loop of `{name}` has a gain of {} 1/s {}, but the arm has springs in its joints: it begins to oscillate at {} \
         1/s or before",
        to_three_digits(feature.kp * gain),
        over(contact.name()),
        to_three_digits(bears)
    );
    let first = down_to_two_digits(first_gain(feature) / gain);
    let help = format!(
        "begin with `kp = {first}`, as in the recipe of docs/control.md, and measure the response with `tactflow tune`"
    );
    let edit = Edit::Replace(place.clone(), first.to_string());
    Some(Diagnostic::new(Code::LowMargin, place, message).help(help).edit(edit))
}
