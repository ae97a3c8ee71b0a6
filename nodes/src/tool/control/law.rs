//! The control law of a twist: what each component answers, and with which gain.

use serde::Serialize;
use tactflow_runtime::graph::OutlinedBlock;

use super::filters::{Filter, filters};
use super::schedule::Schedule;
use super::settings::{Nodes, source};

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
#[derive(Debug, Clone, Serialize)]
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
    /// The port of its error.
    #[serde(skip)]
    pub(crate) error: Option<String>,
    /// Filters from the measurement to the error.
    pub(crate) filters: Vec<Filter>,
    /// What multiplies all three gains, depending on the contact.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) schedule: Option<Schedule>,
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

    /// Returns the delay of all filters [s].
    pub(crate) fn delay(&self) -> f64 {
        self.filters.iter().map(|filter| filter.delay_s).sum()
    }
}

/// Returns what the twist of a port is made of.
pub(crate) fn law(nodes: &Nodes<'_>, port: &str) -> Law {
    let mut law = Law::default();
    collect(nodes, port, [true; 6], &mut law);
    law
}

fn collect(nodes: &Nodes<'_>, port: &str, passes: [bool; 6], law: &mut Law) {
    let Some(node) = nodes.writer(port) else { return };
    let masked = |values: [f64; 6]| std::array::from_fn(|i| if passes[i] { values[i] } else { 0.0 });
    match node.kind.text.as_str() {
        "twist_adder" => node.wires.iter().for_each(|wire| collect(nodes, &wire.source, passes, law)),
        "projector" => {
            let select: [f64; 6] =
                nodes.value(node, "select").and_then(|select| select.value.read()).unwrap_or_default();
            let passes = std::array::from_fn(|i| passes[i] && select[i] != 0.0);
            source(node, "twist").into_iter().for_each(|twist| collect(nodes, twist, passes, law));
        }
        "pivot" => source(node, "twist").into_iter().for_each(|twist| collect(nodes, twist, passes, law)),
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
}

/// Follows a feature from its column back to its measurement.
fn feature(nodes: &Nodes<'_>, jacobian: &OutlinedBlock, name: String, column: [f64; 6]) -> Feature {
    let before = |node: &OutlinedBlock, input: &str, kind: &str| {
        source(node, input).and_then(|port| nodes.writer(port)).filter(|writer| writer.kind.text == kind)
    };
    let scheduled = before(jacobian, "control", "gain_schedule");
    let pid = before(scheduled.unwrap_or(jacobian), "control", "pid");
    let gain = |which: &str| pid.and_then(|pid| nodes.number(pid, &format!("gains.{name}.{which}"))).unwrap_or(0.0);
    let behind = pid.map(|pid| before(pid, "error", "deadband").unwrap_or(pid));
    let error = behind.and_then(|node| before(node, "error", "feature_error"));
    let setpoint = error.and_then(|error| {
        let one = nodes.number(error, &format!("setpoint.{name}"));
        let table = || nodes.value(error, "setpoint")?.value.as_table()?.get(&name)?.read();
        one.or_else(table)
    });
    let (filters, measured) = match error.and_then(|error| source(error, &name)) {
        Some(port) => filters(nodes, port),
        None => (Vec::new(), None),
    };
    let [kp, ki, kd] = ["kp", "ki", "kd"].map(gain);
    let error = pid.and_then(|pid| source(pid, "error")).map(|port| format!("{port}.{name}"));
    let pid = pid.map(|pid| pid.name.clone());
    let schedule = scheduled.and_then(|node| Schedule::of(nodes, node, &name, measured.as_deref()));
    let jacobian = jacobian.name.clone();
    Feature { column, kp, ki, kd, measured, setpoint, filters, schedule, name, jacobian, pid, error }
}
