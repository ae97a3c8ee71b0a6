//! The margins of the loops of one mode.

use serde::Serialize;

use crate::tool::control::contacts::Contact;
use crate::tool::control::law::{Feature, Law};
use crate::tool::control::margins::{Margins, margins};
use crate::tool::control::response::Loop;

/// The loop of a feature over one contact.
#[derive(Debug, Serialize)]
pub(super) struct Stability {
    /// The object that is touched; `None` where the bench declares no contact, and geometry alone says the response.
    pub(super) object: Option<String>,
    pub(super) feature: String,
    /// Whether geometry alone says how the feature answers: without the resonance of the arm.
    pub(super) by_geometry: bool,
    /// Whether a schedule multiplies the gains by what this command does not know.
    #[serde(skip)]
    pub(super) is_unknown: bool,
    /// `None` if nothing says how the feature answers.
    pub(super) margins: Option<Margins>,
}

/// Returns the margins of all features that a law controls, with the contacts that the bench declares for the arm.
pub(super) fn stability(declared: &[Contact], law: &Law) -> Vec<Stability> {
    let alone = [Contact::by_geometry()];
    let declared = if declared.is_empty() { &alone[..] } else { declared };
    let controlled: Vec<&Feature> = law.features.iter().filter(|feature| feature.moves()).collect();
    let loops = declared.iter().flat_map(|contact| {
        controlled.iter().map(|feature| Stability {
            object: contact.name().map(str::to_owned),
            feature: feature.name.clone(),
            by_geometry: feature.quantity().is_some_and(|quantity| contact.is_by_geometry(quantity)),
            is_unknown: feature.schedules.iter().any(|schedule| schedule.nominal.is_none()),
            margins: Loop::over(feature, contact).map(|around| margins(&around)),
        })
    });
    loops.collect()
}
