//! The way to brake, and the hit of a touch.

use serde::Serialize;
use tactflow_runtime::graph::OutlinedBlock;

use crate::tool::control::chain::Limiter;
use crate::tool::control::contacts::Contact;
use crate::tool::control::law::Law;
use crate::tool::control::settings::Nodes;

/// A motion that meets an object: the constant twist of a mode, or the search for a lost contact.
#[derive(Debug, Serialize)]
pub(super) struct Approach {
    /// The node that makes it.
    pub(super) node: String,
    /// Speed of the sensor [m/s].
    pub(super) speed_m_per_s: f64,
    /// Time until the arm follows a command: two periods, and the largest latency of a contact [s].
    pub(super) reaction_s: f64,
    /// Deceleration of the sensor [m/s²].
    pub(super) deceleration_m_per_s2: f64,
    /// Way from the image that shows a contact until the sensor rests [m].
    pub(super) way_m: f64,
    pub(super) hits: Vec<Hit>,
}

/// What the moving mass of the arm adds to the force at a touch.
#[derive(Debug, Serialize)]
pub(super) struct Hit {
    pub(super) object: String,
    /// Stiffness of the stiffest contact, as `contact_limit` has it [N/m].
    pub(super) contact_n_per_m: f64,
    /// Resonance of the arm in contact [Hz].
    pub(super) resonance_hz: f64,
    /// Its force, v √(k m) with m = k/ω² [N].
    pub(super) force_n: f64,
}

/// Returns the approaches of a mode, and then the search of each limiter for lost contacts.
pub(super) fn approaches(nodes: &Nodes<'_>, limits: &[Limiter], law: &Law, contacts: &[Contact]) -> Vec<Approach> {
    let speed = |twist: [f64; 6]| twist[..3].iter().map(|part| part * part).sum::<f64>().sqrt();
    let constants = law.constants.iter().map(|constant| (constant.node.clone(), speed(constant.twist)));
    let searches = limits.iter().filter_map(|limiter| {
        let node = nodes.node(&limiter.node)?;
        Some((limiter.node.clone(), nodes.number(node, "search_m_per_s")?))
    });
    let largest = smallest(nodes, limits, "linear_m_per_s").unwrap_or(f64::INFINITY);
    let found = constants.chain(searches).filter(|(_, speed)| *speed > 0.0);
    found.filter_map(|(node, speed)| approach(nodes, limits, contacts, (node, speed.min(largest)))).collect()
}

/// Returns the way to brake and the hits of one motion, or `None` if no limiter says how the sensor decelerates.
fn approach(
    nodes: &Nodes<'_>,
    limits: &[Limiter],
    contacts: &[Contact],
    (node, speed): (String, f64),
) -> Option<Approach> {
    let decelerations = ["linear_m_per_s2", "deceleration_m_per_s2"];
    let deceleration = decelerations.iter().filter_map(|key| smallest(nodes, limits, key)).min_by(f64::total_cmp)?;
    let latency = contacts.iter().flat_map(|contact| {
        let own = contact.features.values().filter_map(|answer| answer.latency_ms);
        own.chain([contact.latency_ms])
    });
    let reaction = 2.0 * nodes.period() + 1e-3 * latency.fold(0.0, f64::max);
    let stiffness = smallest(nodes, limits, "contact_n_per_m");
    let hit = |contact: &Contact| {
        let (stiffness, resonance) = (stiffness?, contact.features.get("pressure")?.resonance_hz?);
        Some(Hit {
            object: contact.object.clone(),
            contact_n_per_m: stiffness,
            resonance_hz: resonance,
            force_n: speed * stiffness / (std::f64::consts::TAU * resonance),
        })
    };
    Some(Approach {
        node,
        speed_m_per_s: speed,
        reaction_s: reaction,
        deceleration_m_per_s2: deceleration,
        way_m: speed * reaction + speed * speed / (2.0 * deceleration),
        hits: contacts.iter().filter_map(hit).collect(),
    })
}

/// Returns the smallest value that the limiters have for a parameter.
fn smallest(nodes: &Nodes<'_>, limits: &[Limiter], key: &str) -> Option<f64> {
    let blocks = limits.iter().filter_map(|limiter| nodes.node(&limiter.node));
    blocks.filter_map(|node: &OutlinedBlock| nodes.number(node, key)).min_by(f64::total_cmp)
}
