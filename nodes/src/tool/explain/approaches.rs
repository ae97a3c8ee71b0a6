//! The stopping distance of each motion, and the impact force of a touch.

use serde::Serialize;

use crate::tool::control::chain::{Limiter, smallest};
use crate::tool::control::contacts::{Answer, Contact};
use crate::tool::control::law::Law;
use crate::tool::control::nodes::Nodes;

/// A motion that meets an object: the constant twist of a mode, or the search for a lost contact.
#[derive(Debug, Serialize)]
pub(super) struct Approach {
    /// The node that makes it.
    pub(super) node: String,
    /// Whether it searches for a lost contact.
    pub(super) is_search: bool,
    /// Speed of the sensor [m/s].
    pub(super) speed_m_per_s: f64,
    /// Time until the arm follows a command: two periods, and the largest lag with which a contact answers a motion in
    /// this direction [s].
    pub(super) reaction_s: f64,
    /// Deceleration of the sensor [m/s²].
    pub(super) deceleration_m_per_s2: f64,
    /// How the arm swings after a stop; `None` if the bench states no resonance along x or y.
    pub(super) swing: Option<Swing>,
    /// Largest distance from the tick that commands the stop until the sensor rests [m].
    pub(super) stopping_distance_m: f64,
    pub(super) impacts: Vec<Impact>,
    /// The objects of which the bench does not state the resonance of the pressure.
    pub(super) unknown_impacts: Vec<String>,
}

/// The swing of an arm with springs in its joints after a stop in the air.
#[derive(Debug, Serialize)]
pub(super) struct Swing {
    /// Lowest resonance along x or y that the bench states [Hz].
    pub(super) resonance_hz: f64,
    /// Speed / ω [m].
    pub(super) length_m: f64,
}

/// What the moving mass of the arm adds to the force at a touch.
#[derive(Debug, Serialize)]
pub(super) struct Impact {
    pub(super) object: String,
    /// Stiffness of the stiffest contact, as `contact_limit` has it [N/m].
    pub(super) contact_n_per_m: f64,
    /// Resonance of the arm in contact [Hz].
    pub(super) resonance_hz: f64,
    /// Its force, v √(k m) with m = k/ω² and the speed v out of the pad [N].
    pub(super) force_n: f64,
}

/// Returns the approaches of a mode, and then the search of each limiter for lost contacts.
pub(super) fn approaches(nodes: &Nodes<'_>, limits: &[Limiter], law: &Law, contacts: &[Contact]) -> Vec<Approach> {
    let constants = law.constants.iter().map(|constant| {
        let [x, y, z, ..] = constant.twist;
        (constant.node.clone(), [x, y, z], false)
    });
    let searches = limits.iter().filter_map(|limiter| {
        let node = nodes.node(&limiter.node)?;
        Some((limiter.node.clone(), [0.0, 0.0, nodes.number(node, "search_m_per_s")?], true))
    });
    let moves = |(_, velocity, _): &(String, [f64; 3], bool)| velocity.iter().any(|part| *part != 0.0);
    constants.chain(searches).filter(moves).filter_map(|found| approach(nodes, limits, contacts, found)).collect()
}

/// Returns by how much a contact answers a motion late at most [ms].
///
/// The response of what answers a motion in another direction says nothing about this one: a place on the pad sticks
/// before it slides. Its latency counts where nothing answers in this direction.
fn lag_ms(contact: &Contact, velocity: [f64; 3]) -> f64 {
    let is_along = |answer: &&Answer| (0..3).any(|i| velocity[i] != 0.0 && answer.row()[i] != 0.0);
    let along = contact.features.values().filter(is_along).filter_map(Answer::lag_ms).reduce(f64::max);
    let latencies = || contact.features.values().filter_map(|answer| answer.latency_ms).reduce(f64::max);
    along.or_else(latencies).unwrap_or_default().max(contact.latency_ms)
}

/// Returns the stopping distance and the impacts of one motion, or `None` if no limiter says how the sensor decelerates.
fn approach(
    nodes: &Nodes<'_>,
    limits: &[Limiter],
    contacts: &[Contact],
    (node, velocity, is_search): (String, [f64; 3], bool),
) -> Option<Approach> {
    let decelerations = ["linear_m_per_s2", "deceleration_m_per_s2"];
    let deceleration = decelerations.iter().filter_map(|key| smallest(nodes, limits, key)).min_by(f64::total_cmp)?;
    let wanted = velocity.iter().map(|part| part * part).sum::<f64>().sqrt();
    let speed = smallest(nodes, limits, "linear_m_per_s").map_or(wanted, |most| wanted.min(most));
    let into = velocity[2].max(0.0) * speed / wanted;
    let latency = contacts.iter().map(|contact| lag_ms(contact, velocity));
    let reaction = 2.0 * nodes.period() + 1e-3 * latency.fold(0.0, f64::max);
    let stiffness = smallest(nodes, limits, "contact_n_per_m").filter(|_| into > 0.0);
    let resonance = |contact: &Contact| contact.features.get("pressure").and_then(|pressure| pressure.resonance_hz);
    let impact = |contact: &Contact| {
        let (stiffness, resonance) = (stiffness?, resonance(contact)?);
        Some(Impact {
            object: contact.object.clone(),
            contact_n_per_m: stiffness,
            resonance_hz: resonance,
            force_n: into * stiffness / (std::f64::consts::TAU * resonance),
        })
    };
    let unknown = contacts.iter().filter(|contact| stiffness.is_some() && resonance(contact).is_none());
    // Without a contact the arm swings as slowly as along the object, where the contact is hardly a spring.
    let along = contacts.iter().flat_map(|contact| contact.features.values());
    let along = along.filter(|answer| answer.vx.or(answer.vy).is_some());
    let resonances = along.filter_map(|answer| answer.resonance_hz);
    let swing = resonances.reduce(f64::min);
    let swing = swing.map(|hz| Swing { resonance_hz: hz, length_m: speed / (std::f64::consts::TAU * hz) });
    let braking = speed * reaction + speed * speed / (2.0 * deceleration);
    Some(Approach {
        node,
        is_search,
        speed_m_per_s: speed,
        reaction_s: reaction,
        deceleration_m_per_s2: deceleration,
        stopping_distance_m: braking + swing.as_ref().map_or(0.0, |swing| swing.length_m),
        swing,
        impacts: contacts.iter().filter_map(impact).collect(),
        unknown_impacts: unknown.map(|contact| contact.object.clone()).collect(),
    })
}
