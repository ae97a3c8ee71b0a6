//! The margins of the loops of one mode.

use serde::Serialize;

use crate::motion::COMPONENTS;
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
    /// How far the sensor moves after a turn until a contact that sticks follows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) play: Option<Play>,
    /// The component that rolls the sensor for a place, where the bench does not say how far the contact then moves.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) left_out: Option<&'static str>,
    /// `None` if nothing says how the feature answers.
    pub(super) margins: Option<Margins>,
}

/// Part of a step from which on a play makes its answer slower: with half of it, a step of 5 mm has 0.6 of the bandwidth
/// [1].
const HOLDS: f64 = 0.4;

/// What the play of a contact does to a step.
#[derive(Debug, Serialize)]
pub(super) struct Play {
    /// The play [m] or [rad].
    pub(super) play: f64,
    /// The step [m] or [rad].
    pub(super) step: f64,
    /// How much later a step is answered than the margins say, at most [s].
    pub(super) late_s: f64,
    /// Both lengths with their unit.
    #[serde(skip)]
    pub(super) texts: [String; 2],
}

impl Play {
    /// Returns the play of a feature over a contact. By the proportional gain, the sensor moves as fast as a step decays at
    /// first.
    fn of(feature: &Feature, contact: &Contact, margins: &Margins) -> Option<Self> {
        let play = contact.features.get(feature.quantity()?)?.play.filter(|play| *play > 0.0)?;
        let step = feature.usual_step()?;
        let late_s = play * margins.ramp_lag_s / step;
        Some(Self { play, step, late_s, texts: [play, step].map(|value| feature.in_units(value)) })
    }

    /// Returns whether the play is a large part of a step: the contact then follows more slowly than its bandwidth says.
    pub(super) fn holds_a_step(&self) -> bool {
        self.play > HOLDS * self.step
    }
}

/// Returns the component that rolls the sensor for a place, where the bench does not say how far the contact then moves. A
/// column that rolls against its own sliding has its own warning.
fn left_out(feature: &Feature, contact: &Contact) -> Option<&'static str> {
    let quantity = feature.quantity()?;
    let answer = contact.answer(quantity)?;
    let [vx, vy, _, wx, wy, _] = feature.column;
    let (rolling, is_unknown, is_with) = match quantity {
        "x" => (4, answer.wy.is_none(), vx * wy > 0.0),
        "y" => (3, answer.wx.is_none(), vy * wx < 0.0),
        _ => return None,
    };
    (is_unknown && is_with).then_some(COMPONENTS[rolling])
}

/// Returns the margins of all features that a law controls, with the contacts that the bench declares for the arm.
pub(super) fn stability(declared: &[Contact], law: &Law) -> Vec<Stability> {
    let alone = [Contact::by_geometry()];
    let declared = if declared.is_empty() { &alone[..] } else { declared };
    let controlled: Vec<&Feature> = law.features.iter().filter(|feature| feature.moves()).collect();
    let over = |contact: &Contact, feature: &Feature| {
        let margins = Loop::over(feature, contact).map(|around| margins(&around));
        Stability {
            object: contact.name().map(str::to_owned),
            feature: feature.name.clone(),
            by_geometry: feature.quantity().is_some_and(|quantity| contact.is_by_geometry(quantity)),
            is_unknown: feature.schedules.iter().any(|schedule| schedule.nominal.is_none()),
            play: margins
                .as_ref()
                .filter(|margins| margins.is_stable)
                .and_then(|margins| Play::of(feature, contact, margins)),
            left_out: left_out(feature, contact),
            margins,
        }
    };
    declared.iter().flat_map(|contact| controlled.iter().map(move |feature| over(contact, feature))).collect()
}
