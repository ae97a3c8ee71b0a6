//! The control law of a twist: what each component answers, and with which gain.

use serde::Serialize;
use tactflow_runtime::graph::OutlinedBlock;

use super::filters::{Filter, way};
use super::schedule::Schedule;
use super::settings::{Nodes, source};
use super::shape::Shape;
use crate::motion::COMPONENTS;

/// What a twist is made of.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Law {
    pub(crate) features: Vec<Feature>,
    /// Constant motions.
    pub(crate) constants: Vec<Constant>,
    /// Other nodes that move the arm, which this command does not know in numbers.
    pub(crate) guidance: Vec<Guidance>,
}

/// A feature that is controlled.
#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct Feature {
    pub(crate) name: String,
    /// Speed of each component for one unit of control, after the projectors.
    pub(crate) column: [f64; 6],
    pub(crate) kp: f64,
    pub(crate) ki: f64,
    pub(crate) kd: f64,
    /// The port that is measured, before its filters.
    pub(crate) measured: Option<String>,
    pub(crate) setpoint: Option<f64>,
    /// The node that turns its control into a twist.
    #[serde(skip)]
    pub(crate) jacobian: String,
    /// Its controller.
    #[serde(skip)]
    pub(crate) pid: Option<String>,
    /// The node that compares it with its setpoint.
    #[serde(skip)]
    pub(crate) compared: Option<String>,
    /// Filters from the measurement to the motion.
    pub(crate) filters: Vec<Filter>,
    /// The flags without which it moves nothing.
    #[serde(skip)]
    pub(crate) gates: Vec<String>,
    /// What multiplies all three gains, depending on the contact.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) schedules: Vec<Schedule>,
    /// What else moves the arm by the same measurement: its loop adds to this one.
    #[serde(skip)]
    pub(crate) beside: Vec<Self>,
}

/// A constant twist, after the projectors.
#[derive(Debug, Serialize)]
pub(crate) struct Constant {
    pub(crate) node: String,
    pub(crate) twist: [f64; 6],
}

/// A node that moves the arm by a law of its own.
#[derive(Debug, Serialize)]
pub(crate) struct Guidance {
    pub(crate) port: String,
    #[serde(rename = "type")]
    pub(crate) kind: String,
    /// Components that the projectors behind it pass.
    pub(crate) passes: [bool; 6],
}

impl Guidance {
    /// Returns the name of the node.
    pub(crate) fn node(&self) -> &str {
        self.port.rsplit_once('.').map_or(&*self.port, |(node, _)| node)
    }
}

impl Law {
    /// Returns whether anything moves a component.
    pub(crate) fn moves(&self, i: usize) -> bool {
        self.features.iter().any(|feature| feature.column[i] != 0.0 && feature.has_gain())
            || self.constants.iter().any(|constant| constant.twist[i] != 0.0)
            || self.guidance.iter().any(|guidance| guidance.passes[i])
    }
}

impl Feature {
    /// Returns whether the feature has any gain.
    pub(crate) fn has_gain(&self) -> bool {
        [self.kp, self.ki, self.kd].iter().any(|gain| *gain != 0.0)
    }

    /// Returns whether the feature moves anything.
    pub(crate) fn moves(&self) -> bool {
        self.has_gain() && self.column.iter().any(|entry| *entry != 0.0)
    }

    /// Returns the name of what is measured, as a bench states it.
    pub(crate) fn quantity(&self) -> Option<&str> {
        self.measured.as_ref()?.rsplit('.').next()
    }

    /// Adds a node that its motion passes.
    fn pass(&mut self, nodes: &Nodes<'_>, node: &OutlinedBlock) {
        self.gates.extend(source(node, "gate").map(str::to_owned));
        if node.kind.text == "twist_delay" {
            let (node, kind) = (node.name.clone(), node.kind.text.clone());
            let shape = Shape::Delay { samples: 1.0 };
            self.filters.push(Filter { node, kind, delay_s: shape.delay(nodes.period()), shape });
        }
    }

    /// Returns the delay of the filters that smooth it [s].
    pub(crate) fn smoothing(&self) -> f64 {
        self.filters.iter().filter(|filter| filter.shape.smooths()).map(|filter| filter.delay_s).sum()
    }

    /// Returns the delay of all filters [s].
    pub(crate) fn delay(&self) -> f64 {
        self.filters.iter().map(|filter| filter.delay_s).sum()
    }
}

/// Returns what the twist of a port is made of.
pub(crate) fn law(nodes: &Nodes<'_>, port: &str) -> Law {
    let mut law = Law::default();
    collect(nodes, port, [true; 6], &mut law, &mut Vec::new());
    let alone = law.features.clone();
    for (i, feature) in law.features.iter_mut().enumerate() {
        let others = alone.iter().enumerate().filter(|(other, _)| *other != i).map(|(_, other)| other);
        let is_beside =
            |other: &&Feature| other.moves() && other.measured.is_some() && other.measured == feature.measured;
        feature.beside = others.filter(is_beside).cloned().collect();
    }
    law
}

/// Adds what moves a twist. A port that leads back to a node of the path, through a `twist_delay`, adds nothing.
fn collect<'a>(nodes: &Nodes<'a>, port: &str, passes: [bool; 6], law: &mut Law, path: &mut Vec<&'a str>) {
    let Some(node) = nodes.writer(port).filter(|node| !path.contains(&&*node.name)) else { return };
    path.push(&node.name);
    let masked = |values: [f64; 6]| std::array::from_fn(|i| if passes[i] { values[i] } else { 0.0 });
    match node.kind.text.as_str() {
        "twist_adder" => node.wires.iter().for_each(|wire| collect(nodes, &wire.source, passes, law, path)),
        "projector" => {
            let select: [f64; 6] =
                nodes.value(node, "select").and_then(|select| select.value.read()).unwrap_or_default();
            let passes = std::array::from_fn(|i| passes[i] && select[i] != 0.0);
            source(node, "twist").into_iter().for_each(|twist| collect(nodes, twist, passes, law, path));
        }
        "pivot" => source(node, "twist").into_iter().for_each(|twist| collect(nodes, twist, passes, law, path)),
        "twist_switch" => nodes.sides(node).for_each(|side| collect(nodes, side, passes, law, path)),
        "twist_gate" | "twist_delay" => {
            let before = law.features.len();
            source(node, "value").into_iter().for_each(|twist| collect(nodes, twist, passes, law, path));
            law.features[before..].iter_mut().for_each(|feature| feature.pass(nodes, node));
        }
        "compose_twist" => {
            let is_wired = |i: usize| source(node, COMPONENTS[i]).is_some();
            let passes = std::array::from_fn(|i| passes[i] && is_wired(i));
            law.guidance.push(Guidance { port: port.to_owned(), kind: node.kind.text.clone(), passes });
        }
        "twist_source" => {
            let twist: [f64; 6] = nodes.value(node, "twist").and_then(|twist| twist.value.read()).unwrap_or_default();
            let twist = masked(twist);
            if twist.iter().any(|part| *part != 0.0) {
                law.constants.push(Constant { node: node.name.clone(), twist });
            }
        }
        "inverse_jacobian" => {
            let columns = nodes.values(node).filter_map(|(path, setting)| {
                Some((path.strip_prefix("columns.")?.to_owned(), masked(setting.value.read()?)))
            });
            law.features.extend(columns.map(|(name, column)| feature(nodes, node, name, column)));
        }
        kind => law.guidance.push(Guidance { port: port.to_owned(), kind: kind.to_owned(), passes }),
    }
    path.pop();
}

/// Returns the setpoint of a feature in a node that compares it.
pub(crate) fn setpoint(nodes: &Nodes<'_>, compared: &str, feature: &str) -> Option<f64> {
    let node = nodes.node(compared)?;
    let one = nodes.number(node, &format!("setpoint.{feature}"));
    one.or_else(|| nodes.value(node, "setpoint")?.value.as_table()?.get(feature)?.read())
}

/// Follows a feature from its column back to its measurement.
fn feature<'a>(nodes: &Nodes<'a>, jacobian: &'a OutlinedBlock, name: String, column: [f64; 6]) -> Feature {
    let before = |node: &'a OutlinedBlock, input: &str, kind: &str| {
        source(node, input).and_then(|port| nodes.writer(port)).filter(|writer| writer.kind.text == kind)
    };
    let next = |node: &&'a OutlinedBlock| before(node, "control", "gain_schedule");
    let scheduled: Vec<_> = std::iter::successors(next(&jacobian), next).collect();
    let pid = before(scheduled.last().copied().unwrap_or(jacobian), "control", "pid");
    let gain = |which: &str| pid.and_then(|pid| nodes.number(pid, &format!("gains.{name}.{which}"))).unwrap_or(0.0);
    let behind = pid.map(|pid| before(pid, "error", "deadband").unwrap_or(pid));
    let error = behind.and_then(|node| before(node, "error", "feature_error"));
    let setpoint = error.and_then(|error| setpoint(nodes, &error.name, &name));
    let way = error.and_then(|error| source(error, &name)).map(|port| way(nodes, port));
    let measured = way.as_ref().map(|way| way.measured.clone());
    let (filters, gates) = way.map(|way| (way.filters, way.gates)).unwrap_or_default();
    let [kp, ki, kd] = ["kp", "ki", "kd"].map(gain);
    let compared = error.map(|error| error.name.clone());
    let pid = pid.map(|pid| pid.name.clone());
    let schedules = scheduled.into_iter().filter_map(|node| Schedule::of(nodes, node, &name, measured.as_deref()));
    let schedules = schedules.collect();
    let (jacobian, beside) = (jacobian.name.clone(), Vec::new());
    Feature { column, kp, ki, kd, measured, setpoint, filters, gates, schedules, name, jacobian, pid, compared, beside }
}
