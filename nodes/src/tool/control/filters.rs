//! The filters of a feature, from its measurement to its error.

use serde::Serialize;
use tactflow_runtime::graph::OutlinedBlock;

use super::nodes::{Nodes, source};
use super::shape::Shape;

/// What a division of times leaves beyond a whole number [1].
const ROUNDING: f64 = 1e-6;

/// A filter of a feature.
#[derive(Debug, Clone, Serialize)]
pub(crate) struct Filter {
    pub(crate) node: String,
    #[serde(rename = "type")]
    pub(crate) kind: String,
    /// Delay of a slow ramp [s].
    pub(crate) delay_s: f64,
    #[serde(skip)]
    pub(crate) shape: Shape,
}

/// The way of a feature from its measurement to its error.
#[derive(Debug, Default)]
pub(crate) struct Way {
    /// The port that is measured.
    pub(crate) measured: String,
    /// The first one first.
    pub(crate) filters: Vec<Filter>,
    /// The flags without which the feature does not pass.
    pub(crate) gates: Vec<String>,
    /// By how much less a side of a switch smooths than the filters here [s].
    pub(crate) spared_s: f64,
}

impl Way {
    fn delay(&self) -> f64 {
        self.filters.iter().map(|filter| filter.delay_s).sum()
    }

    /// Returns the delay of the filters that smooth, on the side that smooths least [s].
    fn least_smoothing(&self) -> f64 {
        smoothing(&self.filters) - self.spared_s
    }
}

/// Returns the delay of the filters that smooth [s]. That of a median counts half: the median of three samples lets as
/// much noise pass as the mean of two.
pub(crate) fn smoothing(filters: &[Filter]) -> f64 {
    let smooth = filters.iter().filter(|filter| filter.shape.smooths());
    smooth.map(|filter| if matches!(filter.shape, Shape::Median { .. }) { 0.5 } else { 1.0 } * filter.delay_s).sum()
}

/// Follows a feature back to its measurement.
pub(crate) fn way(nodes: &Nodes<'_>, port: &str) -> Way {
    follow(nodes, port, &mut Vec::new()).unwrap_or_else(|| Way { measured: port.to_owned(), ..Way::default() })
}

/// Follows a port back to a measurement; `None` if it leads back to a node of the path, through a `delay`.
fn follow<'a>(nodes: &Nodes<'a>, port: &str, path: &mut Vec<&'a str>) -> Option<Way> {
    let measured = || Some(Way { measured: port.to_owned(), ..Way::default() });
    let Some(node) = nodes.writer(port) else { return measured() };
    if path.contains(&&*node.name) {
        return None;
    }
    path.push(&node.name);
    let own = |key: &str| nodes.number(node, key);
    let found = match node.kind.text.as_str() {
        "switch" => {
            // The other side of a switch that a contact selects passes only without a contact.
            let idle = source(node, "select").filter(|flag| nodes.is_open_in_contact(flag)).and(source(node, "off"));
            let mut sides = Vec::new();
            for side in nodes.sides(node) {
                sides.extend(follow(nodes, side, path).map(|way| (way, Some(side) == idle)));
            }
            slower(&sides)
        }
        "gate" => source(node, "value").map_or_else(measured, |value| {
            let mut found = follow(nodes, value, path)?;
            found.gates.extend(source(node, "gate").map(str::to_owned));
            Some(found)
        }),
        kind => shape(nodes, node, own).zip(source(node, "value")).map_or_else(measured, |(shape, value)| {
            let mut found = follow(nodes, value, path)?;
            let delay_s = shape.delay(node.sample_s);
            found.filters.push(Filter { node: node.name.clone(), kind: kind.to_owned(), delay_s, shape });
            Some(found)
        }),
    };
    path.pop();
    found
}

/// Returns the slower one of two sides, with the gates that stand on each side. The flag of a side says whether it passes
/// only without a contact.
fn slower(sides: &[(Way, bool)]) -> Option<Way> {
    let is_everywhere = |gate: &String| sides.iter().all(|(side, _)| side.gates.contains(gate));
    let (slowest, _) = sides.iter().max_by(|(one, _), (other, _)| one.delay().total_cmp(&other.delay()))?;
    // Only what is the same measurement has its noise.
    let noisy = sides.iter().filter(|(side, is_idle)| !is_idle && side.measured == slowest.measured);
    let own = smoothing(&slowest.filters);
    let least = noisy.map(|(side, _)| side.least_smoothing()).fold(own, f64::min);
    Some(Way {
        spared_s: own - least,
        measured: slowest.measured.clone(),
        filters: slowest.filters.clone(),
        gates: slowest.gates.iter().filter(|gate| is_everywhere(gate)).cloned().collect(),
    })
}

/// Returns the filter that a node is with these parameters.
pub(crate) fn shape(nodes: &Nodes<'_>, node: &OutlinedBlock, number: impl Fn(&str) -> Option<f64>) -> Option<Shape> {
    let samples = |usual: f64| match number("window_ms") {
        // Those that are less than the window older than the newest one.
        Some(ms) => libm::ceil(ms * 1e-3 / node.sample_s - ROUNDING).max(1.0),
        None => number("window").unwrap_or(usual),
    };
    match node.kind.text.as_str() {
        "low_pass" => number("time_constant_ms")
            .map(|ms| ms * 1e-3)
            .or_else(|| number("cutoff_hz").map(|hz| 1.0 / (2.0 * std::f64::consts::PI * hz)))
            .map(|time| Shape::LowPass { time }),
        "moving_average" => Some(Shape::Mean { samples: samples(10.0) }),
        "median" => Some(Shape::Median { samples: samples(5.0) }),
        "delay" => Some(Shape::Delay { time: nodes.period() }),
        _ => None,
    }
}
