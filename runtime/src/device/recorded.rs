//! What a recording states of a device, so that a replay needs no device: its description, and whether it was live.

use serde::{Deserialize, Serialize};

use super::description::{Description, Filled, StatedPort};
use super::{Driver, Opened};
use crate::signal::Shape;

/// The description of a device in a recording.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RecordedDevice {
    /// Its name in the bench.
    pub name: String,
    /// The names of the roles that it filled in the graph.
    #[serde(default)]
    pub roles: Vec<String>,
    is_live: bool,
    /// Nominal time between two samples [s].
    period: f64,
    latency: f64,
    may_return: bool,
    #[serde(default)]
    is_open_loop: bool,
    #[serde(default)]
    fills: Vec<RecordedRole>,
    #[serde(default)]
    outputs: Vec<RecordedPort>,
    #[serde(default)]
    commands: Vec<RecordedPort>,
    #[serde(default)]
    reports: Vec<RecordedPort>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct RecordedRole {
    role: String,
    side: Option<String>,
    #[serde(default)]
    facts: Vec<RecordedFact>,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct RecordedFact {
    name: String,
    value: toml::Value,
}

#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct RecordedPort {
    name: String,
    /// Index of its role in `fills`.
    fill: usize,
    shape: Shape,
}

impl RecordedPort {
    fn of(port: &StatedPort) -> Self {
        Self { name: port.name.to_string(), fill: port.fill, shape: port.shape.clone() }
    }

    fn stated(&self) -> StatedPort {
        StatedPort { fill: self.fill, name: self.name.clone().into(), shape: self.shape.clone() }
    }
}

impl RecordedDevice {
    /// Describes a device of a run.
    pub(crate) fn of(name: &str, description: &Description, is_live: bool) -> Self {
        let role = |fill: &Filled| RecordedRole {
            role: fill.role.to_string(),
            side: fill.side.as_ref().map(ToString::to_string),
            facts: fill
                .facts
                .iter()
                .map(|(name, value)| RecordedFact { name: name.to_string(), value: value.clone() })
                .collect(),
        };
        let ports = |ports: &[StatedPort]| ports.iter().map(RecordedPort::of).collect();
        Self {
            name: name.to_owned(),
            roles: Vec::new(),
            is_live,
            period: description.period,
            latency: description.latency,
            may_return: description.may_return,
            is_open_loop: description.is_open_loop,
            fills: description.fills.iter().map(role).collect(),
            outputs: ports(&description.outputs),
            commands: ports(&description.commands),
            reports: ports(&description.reports),
        }
    }

    /// Names the roles that it filled in the graph.
    pub(crate) fn with_roles(self, roles: Vec<String>) -> Self {
        Self { roles, ..self }
    }

    /// Whether it computed beside the tick of its graph, as a node: such a role has the type and the name of the node.
    #[cfg(feature = "mcap")]
    pub(crate) fn is_node(&self) -> bool {
        self.fills.iter().any(|fill| fill.role.contains(' '))
    }

    /// Returns the facts of each role in which the device sends values of that shape.
    #[cfg(feature = "mcap")]
    pub(crate) fn facts_of(&self, shape: &Shape) -> Vec<toml::Table> {
        let fills =
            self.outputs.iter().filter(|port| port.shape == *shape).filter_map(|port| self.fills.get(port.fill));
        fills.map(|role| role.facts.iter().map(|fact| (fact.name.clone(), fact.value.clone())).collect()).collect()
    }

    /// Returns the device for a replay. `None` if a port names a role that the device does not fill.
    pub(crate) fn open(&self) -> Option<Opened> {
        let fill = |role: &RecordedRole| Filled {
            role: role.role.clone().into(),
            side: role.side.clone().map(Into::into),
            facts: role.facts.iter().map(|fact| (fact.name.clone().into(), fact.value.clone())).collect(),
        };
        let mut ports = self.outputs.iter().chain(&self.commands).chain(&self.reports);
        if ports.any(|port| port.fill >= self.fills.len()) {
            return None;
        }
        let stated = |ports: &[RecordedPort]| ports.iter().map(RecordedPort::stated).collect();
        let description = Description {
            period: self.period,
            latency: self.latency,
            may_return: self.may_return,
            is_open_loop: self.is_open_loop,
            fills: self.fills.iter().map(fill).collect(),
            outputs: stated(&self.outputs),
            commands: stated(&self.commands),
            reports: stated(&self.reports),
            ..Description::default()
        };
        Some(Opened { description, driver: Driver::Recorded { is_live: self.is_live } })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::{
        Flag, FlagShape, Image, ImageShape, Joint, JointsShape, Pose, PoseShape, Scalar, ScalarShape, Twist,
        TwistShape, Unit,
    };

    #[test]
    fn a_description_comes_back_from_its_text() {
        let mut description = Description::every(1.0 / 1900.0);
        let mut pad = description.fills_on("left", "tactile_pad");
        pad.output::<Image>("image", ImageShape { rows: 2, cols: 3, pitch: [0.1 + 0.2; 2], unit: Unit::NEWTON });
        pad.output::<Flag>("flag", FlagShape);
        pad.output::<Twist>("twist", TwistShape);
        pad.output::<Pose>("pose", PoseShape::default());
        pad.output::<Scalar>("force", ScalarShape::of(Unit::NEWTON.per_tactel().per_second()));
        pad.fact("table", toml::Value::Array(vec![toml::Value::Float(f64::INFINITY), "text".into()]));
        let joints = vec![Joint { name: "a1".into(), start: Some(0.1), ..Joint::default() }];
        description.fills("velocity_arm").command("velocity", JointsShape { joints, unit: Unit::RADIAN.per_second() });
        let device = RecordedDevice::of("bench", &description, true);
        let text = toml::to_string(&device).expect("a description is TOML");
        assert_eq!(toml::from_str(&text), Ok(device.clone()), "{text}");
        let opened = device.open().expect("its ports name its roles");
        assert_eq!(RecordedDevice::of("bench", &opened.description, true), device);
        assert!(matches!(opened.driver, Driver::Recorded { is_live: true }));
    }
}
