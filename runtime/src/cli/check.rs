//! `check`: graphs are checked and built, and nothing runs.

use std::path::PathBuf;

use super::{OnArgs, Shell};
use crate::graph::plan;

/// Check graphs like a compiler would, without running them
#[derive(clap::Parser)]
#[command(name = "check")]
pub(super) struct Check {
    /// The graph files
    #[arg(required = true)]
    graphs: Vec<PathBuf>,
    #[command(flatten)]
    on: OnArgs,
}

pub(super) fn check(args: Check, shell: &Shell) -> u8 {
    let mut code = 0;
    for graph in args.graphs {
        match plan(shell.catalogue(), &args.on.request(graph.clone())) {
            Ok(plan) => {
                let (nodes, period) = (plan.order().count(), plan.period());
                shell.say(&format!("{}: ok, {nodes} nodes, a tick each {}", graph.display(), milliseconds(period)));
            }
            Err(report) => code = shell.complain(&report),
        }
    }
    code
}

/// A time for a person [s].
pub(super) fn milliseconds(seconds: f64) -> String {
    format!("{} ms", (seconds * 1e6).round() * 1e-3)
}
