//! What `tune` has found, as a whole.

use serde::Serialize;
use tactflow_runtime::graph::Outline;

use super::cases::Stated;
use super::gain_keys;
use super::propose::TunedFeature;
use super::ranges::Range;
use super::settled::Settled;
use super::task::Task;
use crate::tool::control::choose::Wanted;
use crate::tool::control::contacts::{Answer, Contact};

/// What `tune` has found.
#[derive(Debug, Serialize)]
pub(super) struct Tuned {
    /// The task that is tuned, with the names of its own file.
    #[serde(skip)]
    pub(super) task: Task,
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
    /// Returns the gains that are proposed and not zero: where each stands in the file of the task, the old and the new one.
    pub(super) fn gains(&self, outline: &Outline) -> impl Iterator<Item = (String, [f64; 2])> {
        let mode = outline.modes.iter().find(|mode| mode.name == self.mode);
        let each = self.features.iter().filter_map(move |one| Some((one, one.feature.pid.as_ref()?, mode?, one.new?)));
        each.flat_map(|(one, pid, mode, new)| {
            let keys = ["kp", "ki", "kd"].into_iter().zip(one.old.into_iter().zip(new));
            let keys = keys.filter(|(_, (_, new))| *new != 0.0);
            let place = |key| gain_keys::gain_key(pid, &one.name, key, mode);
            keys.map(|(key, (old, new))| (place(key), [old, new])).collect::<Vec<_>>()
        })
    }

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
                Some(contact) => measured.features.iter().for_each(|(name, answer)| update(contact, name, answer)),
                None => contacts.push(measured.clone()),
            }
        }
        benches
    }
}

/// Lets a contact state what was measured of a feature. What it states stays if only a play was measured.
fn update(contact: &mut Contact, feature: &str, measured: &Answer) {
    match contact.features.get_mut(feature).filter(|_| !measured.states_dynamics()) {
        Some(stated) => stated.play = measured.play,
        None => {
            contact.features.insert(feature.to_owned(), measured.clone());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_play_alone_leaves_what_a_bench_states_of_the_answer() {
        let geometry = Answer::of_geometry("y").unwrap();
        let measured = Answer { play: Some(0.007), ..geometry.clone() };
        let stated =
            [Answer { resonance_hz: Some(1.7), ..geometry.clone() }, Answer { vy: Some(-0.85), ..Answer::default() }];
        for (stated, expected) in [
            (Some(stated[0].clone()), Answer { play: Some(0.007), ..stated[0].clone() }),
            (Some(stated[1].clone()), Answer { play: Some(0.007), ..stated[1].clone() }),
            (None, measured.clone()),
        ] {
            let mut contact = Contact::unmeasured("ball".into());
            contact.features.extend(stated.map(|stated| ("y".to_owned(), stated)));
            update(&mut contact, "y", &measured);
            assert_eq!(contact.features["y"], expected);
        }
    }
}
