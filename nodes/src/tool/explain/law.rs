//! The control law of a twist: what each component answers, and with which gain.

use serde::Serialize;
use tactflow_runtime::graph::OutlinedBlock;

use super::settings::{Nodes, source};

/// The components of a twist.
pub(super) const COMPONENTS: [&str; 6] = ["vx", "vy", "vz", "wx", "wy", "wz"];

/// What a twist is made of.
#[derive(Debug, Default, Serialize)]
pub(super) struct Law {
    pub(super) features: Vec<Feature>,
    /// Constant motions.
    pub(super) constants: Vec<Constant>,
    /// Other nodes that move the arm, which this command does not know in numbers.
    pub(super) guidance: Vec<Guidance>,
}

/// A feature that is controlled.
#[derive(Debug, Serialize)]
pub(super) struct Feature {
    pub(super) name: String,
    /// Speed of each component for one unit of control, after the projectors.
    pub(super) column: [f64; 6],
    pub(super) kp: f64,
    pub(super) ki: f64,
    pub(super) kd: f64,
    /// The port that is measured, before its filters.
    pub(super) measured: Option<String>,
    pub(super) setpoint: Option<f64>,
    /// Filters from the measurement to the error.
    pub(super) filters: Vec<Filter>,
}

/// A filter of a feature.
#[derive(Debug, Serialize)]
pub(super) struct Filter {
    pub(super) node: String,
    #[serde(rename = "type")]
    pub(super) kind: String,
    /// Delay of a slow ramp [s].
    pub(super) delay_s: f64,
}

/// A constant twist, after the projectors.
#[derive(Debug, Serialize)]
pub(super) struct Constant {
    pub(super) node: String,
    pub(super) twist: [f64; 6],
}

/// A node that moves the arm by a law of its own.
#[derive(Debug, Serialize)]
pub(super) struct Guidance {
    pub(super) port: String,
    #[serde(rename = "type")]
    pub(super) kind: String,
    /// Components that the projectors behind it pass.
    pub(super) passes: [bool; 6],
}

impl Law {
    /// Returns whether anything moves a component.
    pub(super) fn moves(&self, i: usize) -> bool {
        self.features.iter().any(|feature| feature.column[i] != 0.0 && feature.has_gain())
            || self.constants.iter().any(|constant| constant.twist[i] != 0.0)
            || self.guidance.iter().any(|guidance| guidance.passes[i])
    }
}

impl Feature {
    /// Returns whether the feature has any gain.
    pub(super) fn has_gain(&self) -> bool {
        [self.kp, self.ki, self.kd].iter().any(|gain| *gain != 0.0)
    }

    /// Returns the delay of all filters [s].
    pub(super) fn delay(&self) -> f64 {
        self.filters.iter().map(|filter| filter.delay_s).sum()
    }
}

/// Returns what the twist of a port is made of.
pub(super) fn law(nodes: &Nodes<'_>, port: &str) -> Law {
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
    let pid = before(jacobian, "control", "pid");
    let gain = |which: &str| pid.and_then(|pid| nodes.number(pid, &format!("gains.{name}.{which}"))).unwrap_or(0.0);
    let error = pid.and_then(|pid| before(pid, "error", "feature_error"));
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
    Feature { column, kp, ki, kd, measured, setpoint, filters, name }
}

/// Returns the filters behind a port, the first one first, and the port before all of them.
fn filters(nodes: &Nodes<'_>, port: &str) -> (Vec<Filter>, Option<String>) {
    let (mut filters, mut port) = (Vec::new(), port);
    while let Some((node, delay_s, input)) =
        nodes.writer(port).and_then(|node| Some((node, delay(nodes, node)?, source(node, "value")?)))
    {
        filters.push(Filter { node: node.name.clone(), kind: node.kind.text.clone(), delay_s });
        port = input;
    }
    filters.reverse();
    (filters, Some(port.to_owned()))
}

/// Returns the delay that a filter gives to a slow ramp [s]: the time constant of a low-pass, and half of a window. The
/// median of a ramp is its middle too.
fn delay(nodes: &Nodes<'_>, node: &OutlinedBlock) -> Option<f64> {
    let number = |path: &str| nodes.number(node, path);
    let half = |window: f64| (window - 1.0) / 2.0 * nodes.period();
    match node.kind.text.as_str() {
        "low_pass" => number("time_constant_ms")
            .map(|ms| ms * 1e-3)
            .or_else(|| number("cutoff_hz").map(|hz| 1.0 / (2.0 * std::f64::consts::PI * hz))),
        "moving_average" => match number("window_ms") {
            Some(ms) => Some(ms * 1e-3 / 2.0),
            None => Some(half(number("window").unwrap_or(10.0))),
        },
        "median" => Some(half(number("window").unwrap_or(5.0))),
        _ => None,
    }
}
