//! The filters of a feature, from its measurement to its error.

use serde::Serialize;
use tactflow_runtime::graph::OutlinedBlock;

use super::settings::{Nodes, source};
use super::shape::Shape;

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

/// Returns the filters behind a port, the first one first, and the port before all of them.
pub(super) fn filters(nodes: &Nodes<'_>, port: &str) -> (Vec<Filter>, Option<String>) {
    let (mut filters, mut port) = (Vec::new(), port);
    while let Some((node, shape, input)) =
        nodes.writer(port).and_then(|node| Some((node, shape(nodes, node)?, source(node, "value")?)))
    {
        let delay_s = shape.delay(nodes.period());
        filters.push(Filter { node: node.name.clone(), kind: node.kind.text.clone(), delay_s, shape });
        port = input;
    }
    filters.reverse();
    (filters, Some(port.to_owned()))
}

/// Returns the filter that a node is.
fn shape(nodes: &Nodes<'_>, node: &OutlinedBlock) -> Option<Shape> {
    let number = |path: &str| nodes.number(node, path);
    let samples = |usual: f64| match number("window_ms") {
        Some(ms) => (ms * 1e-3 / nodes.period()).round().max(1.0),
        None => number("window").unwrap_or(usual),
    };
    match node.kind.text.as_str() {
        "low_pass" => number("time_constant_ms")
            .map(|ms| ms * 1e-3)
            .or_else(|| number("cutoff_hz").map(|hz| 1.0 / (2.0 * std::f64::consts::PI * hz)))
            .map(|time| Shape::LowPass { time }),
        "moving_average" => Some(Shape::Mean { samples: samples(10.0) }),
        "median" => Some(Shape::Median { samples: samples(5.0) }),
        _ => None,
    }
}
