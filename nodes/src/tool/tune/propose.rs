//! The gains that are proposed for a feature, and how often it is measured for them.

use std::ops::RangeInclusive;

use serde::Serialize;
use tactflow_runtime::cli::Shell;
use tactflow_runtime::graph::{Outline, OutlinedMode};

use super::Stop;
use super::amplitudes::{PRESSES, Unknown};
use super::cases::Case;
use super::climb::{self, Followed, Rung};
use super::experiment::{Experiment, HALF};
use super::identify::{Identified, answer, identify, quantity};
use super::signal::Pace;
use super::step::{Planned, STEPS};
use super::task::Task;
use super::trial::{Run, Trial};
use crate::tool::control::choose::{Wanted, bound, factor};
use crate::tool::control::contacts::Contact;
use crate::tool::control::digits::{down_to_two_digits, to_three_digits, to_two_digits};
use crate::tool::control::law::Feature;
use crate::tool::control::margins::{Margins, margins};
use crate::tool::control::response::Loop;

/// What allows no larger gains.
#[derive(Debug, Serialize)]
pub(super) struct Bound {
    pub(super) object: String,
    /// The margin with a tenth more, for a sentence.
    pub(super) margin: String,
}

/// One feature, over all contacts.
#[derive(Debug, Serialize)]
pub(super) struct TunedFeature {
    pub(super) name: String,
    /// The answers, for each contact.
    pub(super) answers: Vec<Identified>,
    /// Proportional, integral and derivative gain of the graph.
    pub(super) old: [f64; 3],
    /// The gains that are proposed, with two digits of `kp`; `None` if there are none that hold.
    pub(super) new: Option<[f64; 3]>,
    /// The margins of the new gains, for each contact over which the response is known.
    pub(super) margins: Vec<Option<Margins>>,
    /// What allows no larger gains, if the margins decide.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) bound: Option<Bound>,
    /// The gains that were compared by steps, because the response is not known over a contact.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(super) climbed: Vec<Rung>,
    /// Largest multiple of the gains of the graph up to which what is known of the loops keeps the margins, such as their
    /// geometry and filters [1].
    #[serde(skip)]
    pub(super) most: f64,
    #[serde(skip)]
    pub(super) feature: Feature,
    /// The loops with the new gains, or with those of the graph if there are no new ones, each with its contact.
    #[serde(skip)]
    pub(super) loops: Vec<(usize, Loop)>,
}

impl TunedFeature {
    /// Returns whether its response is known over all contacts.
    pub(super) fn is_measured(&self) -> bool {
        self.answers.iter().all(|found| found.refused.is_none())
    }

    /// Returns whether a contact is so light that only small motions say how it answers.
    pub(super) fn is_light(&self) -> bool {
        self.answers.iter().any(|found| found.lifts_off.is_some())
    }

    /// Returns whether this hides the response over a contact.
    pub(super) fn is(&self, unknown: Unknown) -> bool {
        self.answers.iter().any(|found| found.unknown == Some(unknown))
    }

    /// Returns the proportional gains with which a feature is measured that loses its mode, the largest one first.
    pub(super) fn tried(&self) -> [f64; 3] {
        let [(least, _), (more, _)] = SMALLER;
        [HALF, more, least].map(|share| to_two_digits(share * self.old[0], libm::round))
    }

    /// Returns whether noise or friction alone hide the responses that are not known.
    fn is_hidden(&self) -> bool {
        !self.is_measured() && !self.is(Unknown::Lost) && !self.is(Unknown::NotReached)
    }

    /// Returns the gains of the graph times a factor: `kp` with a few digits, and the others in their ratio to it.
    fn times(&self, factor: f64, round: impl Fn(f64) -> f64) -> [f64; 3] {
        let size = self.old[0].abs();
        let factor = round(size * factor) / size;
        self.old.map(|gain| to_three_digits(gain * factor))
    }

    /// Returns gains near a multiple of those of the graph, and no larger ones than the margins allow.
    fn near(&self, factor: f64) -> [f64; 3] {
        let gains = self.times(factor, |gain| to_two_digits(gain, libm::round));
        if gains[0] <= self.most * self.old[0] { gains } else { self.times(factor, down_to_two_digits) }
    }

    /// Sets the gains that are proposed, with their loops and margins.
    fn set(&mut self, new: Option<[f64; 3]>) {
        let before = self.factor().unwrap_or(1.0);
        self.new = new;
        let factor = self.factor().unwrap_or(1.0) / before;
        self.loops.iter_mut().for_each(|(_, around)| *around = around.times(factor));
        let measured = |i: usize| self.new.is_some() && self.answers[i].refused.is_none();
        let over = |i: usize| self.loops.iter().find(|(contact, _)| *contact == i && measured(i));
        self.margins = (0..self.answers.len()).map(|i| over(i).map(|(_, around)| margins(around))).collect();
    }

    /// Returns why the task does not run again with the gains of the graph over a contact: they leave a gain margin that is
    /// not larger than what a margin can be wrong by. `None` if they leave more, or if the response is not known.
    pub(super) fn unsafe_as_it_was(&self, contact: usize) -> Option<String> {
        let (_, around) = self.loops.iter().find(|(i, _)| *i == contact && self.answers[*i].refused.is_none())?;
        let found = margins(&around.times(1.0 / self.factor().unwrap_or(1.0)));
        if !found.is_stable {
            return Some("are unstable there".to_owned());
        }
        found.gain_db.filter(|db| *db < UNSURE_DB).map(|db| format!("have a gain margin of {db:.1} dB there"))
    }

    /// Returns the proposed gains as a multiple of those of the graph.
    fn factor(&self) -> Option<f64> {
        self.new.map(|new| new[0] / self.old[0])
    }
}

/// Proposed gains, as a multiple of those of the graph, with which a loop is not measured again [1].
const NEAR: RangeInclusive<f64> = 0.83..=3.0;
/// Gains that steps have found, as a multiple of those of the graph, with which a response that was hidden stays hidden [1].
const ALIKE: RangeInclusive<f64> = 0.77..=1.3;
/// Parts of its speed with which the test signal presses again, if it has ended the mode [1].
const SLOWER: [f64; 2] = [0.4, 0.2];
/// Shares of the gains of the graph with which a loop is measured again that loses its mode [1].
const SMALLER: [(f64, &str); 2] = [(0.125, "an eighth of its gains"), (0.25, "a quarter of its gains")];
/// By how much a gain margin can be too large [dB].
const UNSURE_DB: f64 = 3.0;
/// Share of the proposed gains with which it is measured again [1].
const QUARTER: f64 = 0.25;

/// What is measured for each feature.
pub(super) struct Measurement<'a> {
    pub(super) shell: &'a Shell,
    pub(super) task: &'a Task,
    pub(super) outline: &'a Outline,
    pub(super) mode: &'a OutlinedMode,
    /// The node that adds the test signal to the motion.
    pub(super) adder: &'a str,
    pub(super) cases: &'a [Case],
    /// How fast the test signal moves along each component at most.
    pub(super) pace: [Pace; 6],
    pub(super) wanted: Wanted,
}

impl Measurement<'_> {
    /// Measures a feature, and again with other gains where the first ones say too little, and proposes gains. Returns
    /// the contacts with its answers too.
    pub(super) fn proposal(
        &self,
        feature: &Feature,
        contacts: &[Contact],
    ) -> Result<(TunedFeature, Vec<Contact>), Stop> {
        let say = |how: &str| self.shell.say_beside(&format!("`{}`: again, with {how}", feature.name));
        let (mut found, mut part) = (self.measured(feature, contacts, HALF, 1.0)?, 1.0);
        let is_lost = |found: &TunedFeature| found.is(Unknown::Lost) && !found.is(Unknown::NotReached);
        // At its resonance, a contact swings further than the test signal moves, and is nearly left.
        for slower in SLOWER {
            if !is_lost(&found.0) || feature.column[PRESSES] == 0.0 {
                break;
            }
            say(&format!("{:.0} % of the speed", 100.0 * slower));
            let again = self.measured(feature, contacts, HALF, slower)?;
            if !again.0.is(Unknown::Lost) && !again.0.is(Unknown::NotReached) {
                (found, part) = (again, slower);
            }
        }
        for (share, name) in SMALLER {
            if !is_lost(&found.0) {
                break;
            }
            // A loop that hardly holds the contact loses it with a test signal.
            say(name);
            let again = self.measured(feature, contacts, share, part)?;
            // The first reason is that of the task as it is.
            found = if again.0.is_measured() { again } else { found };
        }
        // A stiff loop holds the contact against the test signal, and friction then hides more of the motion. A soft one
        // has not settled when the signal begins.
        if let Some(factor) = found.0.factor().filter(|factor| !NEAR.contains(factor)) {
            say("a quarter of the gains that were found");
            let again = self.measured(feature, contacts, QUARTER * factor, part)?;
            found = if again.0.new.is_some() { again } else { found };
        }
        // What a test signal drives out of its mode may be near instability, and steps would not show it. Friction can hide
        // small motions, so what is known of them alone bounds the gains, and steps must show that they are good.
        if found.0.is_measured() && found.0.is_light() {
            found.0 = self.climbed(found.0)?;
        } else if found.0.is_hidden() {
            found.0 = self.climbed(found.0)?;
            found = self.again_with_what_was_found(feature, contacts, found, part)?;
        }
        Ok(found)
    }

    /// Measures a feature whose response was hidden with half of the gains that steps have found, unless these are near
    /// those with which it was measured: a loop that is much too soft or too stiff hides its response. Returns what was
    /// found before if that does not help.
    fn again_with_what_was_found(
        &self,
        feature: &Feature,
        contacts: &[Contact],
        found: (TunedFeature, Vec<Contact>),
        part: f64,
    ) -> Result<(TunedFeature, Vec<Contact>), Stop> {
        let Some(factor) = found.0.factor().filter(|factor| !ALIKE.contains(factor)) else { return Ok(found) };
        self.shell.say_beside(&format!("`{}`: again, with half of the gains that were found", feature.name));
        let again = self.measured(feature, contacts, HALF * factor, part)?;
        Ok(if again.0.new.is_some() && !again.0.is_light() { again } else { found })
    }

    /// Compares gains of a feature by steps of its setpoint over all contacts, and proposes the best ones. A setpoint that
    /// cannot step gives none.
    fn climbed(&self, mut found: TunedFeature) -> Result<TunedFeature, Stop> {
        let trial = |case| Trial::new(self.shell.catalogue(), self.task, case, (self.mode, self.adder));
        let trials: Vec<Trial<'_>> = self.cases.iter().map(trial).collect();
        let steps: Option<Vec<[Planned; STEPS]>> = trials.iter().map(|trial| trial.steps(&found.feature)).collect();
        let Some(steps) = steps else {
            found.set(None);
            found.bound = None;
            return Ok(found);
        };
        while let Some(factor) = climb::next(&found.climbed, found.most) {
            let gains = found.near(factor);
            self.shell.say_beside(&format!("`{}`: steps with kp = {}", found.name, gains[0]));
            let followed = trials.iter().zip(&steps).zip(&found.answers).map(|((trial, steps), answer)| {
                let Run { each: steps, failure, limited } = trial.to_and_fro(&found.feature, steps, gains)?;
                Ok(Followed { object: answer.object.clone(), steps, failure, limited })
            });
            let followed = followed.collect::<Result<Vec<Followed>, Stop>>()?;
            found.climbed.push(Rung::new(factor, gains, &followed).beside(&found.climbed));
        }
        found.set(climb::best(&found.climbed).map(|rung| rung.gains));
        found.bound = None;
        Ok(found)
    }

    /// Measures a feature over all contacts with a share of its gains and of the speed, and proposes gains.
    fn measured(
        &self,
        feature: &Feature,
        contacts: &[Contact],
        share: f64,
        part: f64,
    ) -> Result<(TunedFeature, Vec<Contact>), Stop> {
        let Self { task, outline, mode, adder, .. } = *self;
        let pace = self.pace.map(|pace| pace.times(part));
        let (catalogue, period) = (self.shell.catalogue(), outline.period_s);
        let mut contacts = contacts.to_vec();
        let found = self.cases.iter().zip(&mut contacts).map(|(case, contact)| {
            let request = &case.request;
            let experiment =
                Experiment { catalogue, task, request, outline, mode, adder, feature, pace, period, share };
            let found = identify(&experiment, &case.object, self.shell)?;
            if found.refused.is_none() || found.play.is_some() {
                contact.features.insert(quantity(feature).to_owned(), answer(feature, &found));
            }
            Ok(found)
        });
        let found = found.collect::<Result<Vec<Identified>, Stop>>()?;
        Ok((propose(feature.clone(), found, &contacts, self.wanted), contacts))
    }
}

/// Returns the largest gains of a feature that keep the margins over all contacts.
fn propose(feature: Feature, answers: Vec<Identified>, contacts: &[Contact], wanted: Wanted) -> TunedFeature {
    let old = [feature.kp, feature.ki, feature.kd];
    let loops = contacts.iter().enumerate();
    let loops: Vec<(usize, Loop)> =
        loops.filter_map(|(i, contact)| Some((i, Loop::over(&feature, contact)?))).collect();
    let each: Vec<Loop> = loops.iter().map(|(_, around)| around.clone()).collect();
    let known = factor(&each, wanted);
    let factor = known.filter(|_| loops.len() == contacts.len() && answers.iter().all(|found| found.refused.is_none()));
    let (name, climbed, margins) = (feature.name.clone(), Vec::new(), Vec::new());
    let most = if each.is_empty() { f64::INFINITY } else { known.unwrap_or_default() };
    let mut found = TunedFeature { name, answers, old, new: None, margins, bound: None, climbed, most, feature, loops };
    // Rounded down, so that the margins hold.
    let new = factor.map(|factor| found.times(factor, down_to_two_digits));
    found.bound = new.and_then(|new| {
        let scaled: Vec<Loop> = each.iter().map(|around| around.times(new[0] / old[0])).collect();
        let (which, margin) = bound(&scaled, wanted)?;
        let (contact, _) = found.loops.get(which)?;
        Some(Bound { object: found.answers[*contact].object.clone(), margin })
    });
    found.set(new);
    found
}
