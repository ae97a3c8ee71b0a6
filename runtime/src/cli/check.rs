//! `check`: graphs are checked and built, and nothing runs.

use super::{CheckArgs, Colour, complain, say};
use crate::catalogue::Catalogue;
use crate::graph::plan;

pub(super) fn check(catalogue: &Catalogue, args: CheckArgs, colour: Colour) -> u8 {
    let mut code = 0;
    for graph in args.graphs {
        match plan(catalogue, &args.on.request(graph.clone())) {
            Ok(plan) => {
                let (nodes, period) = (plan.order().count(), plan.period());
                say(&format!("{}: ok, {nodes} nodes, a tick each {}", graph.display(), milliseconds(period)));
            }
            Err(report) => code = complain(&report, colour),
        }
    }
    code
}

/// A time for a person [s].
pub(super) fn milliseconds(seconds: f64) -> String {
    format!("{} ms", (seconds * 1e6).round() * 1e-3)
}
