//! The factor of a `gain_schedule` on the gains of a feature.

use serde::Serialize;
use tactflow_runtime::graph::OutlinedBlock;

use super::contacts::Contact;
use super::filters::way;
use super::nodes::{Nodes, source};

/// A node that multiplies the gains of a feature by a factor, which depends on the contact.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Schedule {
    pub(crate) node: String,
    /// Smallest factor.
    pub(crate) min: f64,
    /// Largest factor.
    pub(crate) max: f64,
    /// The answer to `vz` for which the factor is 1; `None` if the factor follows anything but the answer of this feature,
    /// or of another one of the same pad, to the commanded travel.
    pub(crate) nominal: Option<f64>,
    /// Name of what answers, as a bench states it.
    #[serde(skip)]
    pub(crate) quantity: String,
}

impl Schedule {
    /// Returns the schedule that a node is for a feature that a port measures; `None` if it passes the feature unchanged.
    pub(super) fn of(nodes: &Nodes<'_>, node: &OutlinedBlock, feature: &str, measured: Option<&str>) -> Option<Self> {
        let features: Vec<String> = nodes.value(node, "features")?.value.read()?;
        if !features.iter().any(|name| name == feature) {
            return None;
        }
        let (min, max) = (nodes.number(node, "min")?, nodes.number(node, "max")?);
        let (nominal, quantity) = nominal(nodes, node, measured?).unzip();
        Some(Self { node: node.name.clone(), min, max, nominal, quantity: quantity.unwrap_or_default() })
    }

    /// Returns whether the factor follows the answer of the feature with this name.
    pub(crate) fn follows(&self, quantity: Option<&str>) -> bool {
        self.nominal.is_some() && quantity == Some(&*self.quantity)
    }

    /// Returns the factor over a contact; `None` if it is not known.
    pub(crate) fn factor(&self, contact: &Contact) -> Option<f64> {
        let (nominal, answer) = (self.nominal?, contact.answer(&self.quantity)?);
        // A contact that does not answer more to a larger travel has no estimate.
        let ratio = answer.vz.map(|vz| vz / nominal).filter(|ratio| *ratio > 0.0);
        Some(ratio.map_or(1.0, |ratio| (1.0 / ratio).clamp(self.min, self.max)))
    }
}

/// Returns the answer for which the factor is 1, and what answers, if the ratio is that of a port of the same pad over the
/// commanded travel.
fn nominal(nodes: &Nodes<'_>, schedule: &OutlinedBlock, measured: &str) -> Option<(f64, String)> {
    let estimate = nodes.writer(source(schedule, "ratio")?)?;
    let is_commanded = estimate.kind.text == "stiffness_estimate" && source(estimate, "equilibrium").is_some();
    let origin = way(nodes, source(estimate, "value")?).measured;
    let frame = |port: &str| nodes.output(port)?.frames.first()?.as_deref();
    let is_of_pad = origin == measured || frame(measured).is_some_and(|own| frame(&origin) == Some(own));
    let nominal = nodes.number(estimate, "nominal").filter(|_| is_commanded && is_of_pad)?;
    Some((nominal, origin.rsplit('.').next()?.to_owned()))
}
