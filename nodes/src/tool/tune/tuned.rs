//! What `tune` has found, as a whole.

use serde::Serialize;

use super::cases::Stated;
use super::propose::TunedFeature;
use super::ranges::Range;
use super::settled::Settled;
use crate::tool::control::choose::Wanted;
use crate::tool::control::contacts::Contact;

/// What `tune` has found.
#[derive(Debug, Serialize)]
pub(super) struct Tuned {
    pub(super) mode: String,
    /// The nodes that rest while it is measured and compared: they would move the sensor along the object.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) resting: Vec<String>,
    /// Name of the role of the arm.
    pub(super) arm: String,
    pub(super) wanted: Wanted,
    pub(super) contacts: Vec<Contact>,
    /// The bench of each contact, and what it has stated before.
    #[serde(skip)]
    pub(super) benches: Vec<Stated>,
    pub(super) features: Vec<TunedFeature>,
    /// The ranges of `[live]` that do not hold the proposed gains, as wide as they must be.
    #[serde(skip)]
    pub(super) ranges: Vec<Range>,
    /// How the task holds its features with the old and with the new gains, for each bench.
    pub(super) settled: Vec<Settled>,
}

impl Tuned {
    /// Returns what each bench states now: what was measured, and what it has stated of other features and objects.
    pub(super) fn stated(&self) -> Vec<Stated> {
        let mut benches: Vec<Stated> = Vec::new();
        for (bench, measured) in self.benches.iter().zip(&self.contacts).filter(|(_, it)| !it.features.is_empty()) {
            if benches.iter().all(|known| known.file != bench.file) {
                benches.push(bench.clone());
            }
            let known = benches.iter_mut().find(|known| known.file == bench.file);
            let Some(Stated { contacts, .. }) = known else { continue };
            match contacts.iter_mut().find(|contact| contact.object == measured.object) {
                Some(contact) => contact.features.extend(measured.features.clone()),
                None => contacts.push(measured.clone()),
            }
        }
        benches
    }
}
