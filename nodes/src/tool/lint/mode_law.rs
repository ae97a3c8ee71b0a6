//! What moves an arm in one mode, and where it is written.

use std::collections::BTreeSet;
use std::ops::Range;

use tactflow_runtime::graph::{NO_SPAN, OutlinedBlock, OutlinedMode};

use super::guides::{is_composed, parks};
use crate::tool::control::law::{Feature, Guidance, Law};
use crate::tool::control::nodes::{Nodes, source};

/// Types of the nodes that measure a contact, and whose geometry is known.
const MEASURING: [&str; 7] =
    ["moments", "principal_axes", "hough", "curvature", "shear", "contact_area", "friction_margin"];

/// What moves an arm in one mode.
pub(super) struct ModeLaw<'a> {
    pub(super) mode: Option<&'a OutlinedMode>,
    /// The frames of the sensors that arms move.
    pub(super) carried: &'a BTreeSet<&'a str>,
    pub(super) nodes: Nodes<'a>,
    pub(super) law: Law,
}

impl<'a> ModeLaw<'a> {
    /// Returns the name of the mode in its task, "" in a graph without modes.
    pub(super) fn own_name(&self) -> &str {
        self.mode.map_or("", |mode| mode.name.rsplit('.').next().unwrap_or_default())
    }

    /// Returns the speed along +z with which the mode moves the sensor whatever it feels [m/s].
    pub(super) fn approach(&self) -> f64 {
        let constant: f64 = self.law.constants.iter().map(|constant| constant.twist[2]).sum();
        let composed = self.law.guidance.iter().filter(|guide| is_composed(guide) && guide.passes[2]);
        constant + composed.filter_map(|guide| self.generated(guide)).sum::<f64>()
    }

    /// Returns whether the mode moves the sensor away from the object.
    pub(super) fn backs_off(&self) -> bool {
        self.approach() < 0.0 || self.law.guidance.iter().any(|guide| parks(&self.nodes, guide))
    }

    /// Returns the largest speed along z that a `signal_generator` gives to a composed twist [m/s].
    fn generated(&self, guide: &Guidance) -> Option<f64> {
        let generator = self.nodes.writer(source(self.nodes.node(guide.node())?, "vz")?)?;
        let number = |key: &str| self.nodes.number(generator, key).unwrap_or_default();
        (generator.kind.text == "signal_generator").then(|| number("offset") + number("amplitude").abs())
    }

    /// Returns what a feature measures, such as `x`, if it comes from a sensor on an arm, by a node whose geometry is
    /// known.
    pub(super) fn quantity<'f>(&self, feature: &'f Feature) -> Option<&'f str> {
        self.quantity_of(feature.measured.as_deref()?)
    }

    /// Returns what a port measures, under the same conditions.
    pub(super) fn quantity_of<'p>(&self, port: &'p str) -> Option<&'p str> {
        let node = self.nodes.writer(port)?;
        let frame = self.nodes.output(port)?.frames.first()?.as_deref()?;
        let is_known = MEASURING.contains(&&*node.kind.text) && self.carried.contains(frame);
        is_known.then(|| port.rsplit('.').next())?
    }

    /// Returns the smallest and the largest value of what a feature measures, where its node states them.
    pub(super) fn range(&self, feature: &Feature) -> Option<[f64; 2]> {
        feature.range(&self.nodes)
    }

    /// Returns the largest distance of a measurement from its setpoint, where its node states the range of its values.
    pub(super) fn farthest(&self, feature: &Feature) -> Option<f64> {
        let ([min, max], setpoint) = (self.range(feature)?, feature.setpoint?);
        Some((setpoint - min).max(max - setpoint))
    }

    /// Returns the column of a feature before all projectors.
    pub(super) fn column(&self, feature: &Feature) -> Option<[f64; 6]> {
        let jacobian = self.nodes.node(&feature.jacobian)?;
        self.nodes.value(jacobian, &format!("columns.{}", feature.name))?.value.read()
    }

    /// Returns one of the gains of a feature, or a bound of its control.
    pub(super) fn gain(&self, feature: &Feature, key: &str) -> Option<f64> {
        let pid = self.nodes.node(feature.pid.as_deref()?)?;
        self.nodes.number(pid, &format!("gains.{}.{key}", feature.name))
    }

    /// Returns the place of the column of a feature.
    pub(super) fn place_of_column(&self, feature: &Feature) -> Range<usize> {
        self.place(&feature.jacobian, &format!("columns.{}", feature.name))
    }

    /// Returns the place of the column of a feature in the mode, if the mode sets another one than the graph.
    pub(super) fn place_of_own_column(&self, feature: &Feature) -> Option<Range<usize>> {
        let (node, path) = (self.nodes.node(&feature.jacobian)?, format!("columns.{}", feature.name));
        let usual = node.settings.iter().find(|setting| setting.path == path)?;
        let place = self.place_of_column(feature);
        (place != usual.value.span && place != node.span).then_some(place)
    }

    /// Returns the place of a gain of a feature.
    pub(super) fn place_of_gain(&self, feature: &Feature, gain: &str) -> Range<usize> {
        self.place(feature.pid.as_deref().unwrap_or_default(), &format!("gains.{}.{gain}", feature.name))
    }

    /// Returns the place of the setpoint of a feature; `None` if nothing compares the feature with one.
    pub(super) fn place_of_setpoint(&self, feature: &Feature) -> Option<Range<usize>> {
        Some(self.place(feature.compared.as_deref()?, &format!("setpoint.{}", feature.name)))
    }

    /// Returns where a value of a node is written; the place of the node if it is a default.
    pub(super) fn place(&self, node: &str, path: &str) -> Range<usize> {
        let Some(node) = self.nodes.node(node) else { return NO_SPAN };
        let written = self.nodes.value(node, path).map(|setting| setting.value.span.clone());
        written.filter(|span| *span != NO_SPAN).unwrap_or_else(|| node.span.clone())
    }

    /// Returns the start of a message about this mode.
    pub(super) fn prefix(&self) -> String {
        self.mode.map(|mode| format!("in mode `{}`, ", mode.name)).unwrap_or_default()
    }

    /// Returns the features that move the arm, and whose gains have the right sign.
    pub(super) fn moving(&self) -> impl Iterator<Item = &Feature> {
        let is_right = |feature: &&Feature| [feature.kp, feature.ki, feature.kd].iter().all(|gain| *gain >= 0.0);
        self.law.features.iter().filter(|feature| feature.moves()).filter(is_right)
    }

    /// Returns the node that lets a feature rest while its error is small.
    pub(super) fn deadband(&self, feature: &Feature) -> Option<&'a OutlinedBlock> {
        let pid = self.nodes.node(feature.pid.as_deref()?)?;
        self.nodes.writer(source(pid, "error")?).filter(|node| node.kind.text == "deadband")
    }
}
