//! `check`: graphs are checked and built, and nothing runs.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::describe::Format;
use super::json::{Diagnosed, diagnosed};
use super::{NOT_LOADED, OnArgs, Shell};
use crate::graph::{Compiled, compile};
use crate::scenario::Scenario;
use crate::source::Report;

/// Check graphs like a compiler would, without running them
#[derive(clap::Parser)]
#[command(
    name = "check",
    after_help = "Examples:
  tactflow check graphs/*.toml
  tactflow check graphs/hybrid.toml --bench benches/lab.toml --deny-warnings"
)]
pub(super) struct Check {
    /// The graph files, and scenarios
    #[arg(required = true)]
    graphs: Vec<PathBuf>,
    #[command(flatten)]
    on: OnArgs,
    /// Fail on warnings too
    #[arg(long)]
    deny_warnings: bool,
    /// How to print it
    #[arg(long, value_enum, default_value_t = Format::Text, value_name = "FORMAT")]
    format: Format,
}

pub(super) fn check(args: Check, shell: &Shell) -> u8 {
    let mut code = 0;
    let mut checked = Vec::new();
    for graph in &args.graphs {
        if is_scenario(graph) {
            let (scenario, checked_as) = scenario(graph, &args, shell);
            code = code.max(scenario);
            checked.extend(checked_as);
            continue;
        }
        let result = compile(shell.catalogue(), &args.on.request(graph.clone()));
        let (report, figures) = match &result {
            Ok(plan) => (plan.warnings(), Some(Figures::of(plan))),
            Err(report) => (Some(report.clone()), None),
        };
        let is_good = figures.is_some() && (report.is_none() || !args.deny_warnings);
        if !is_good {
            code = NOT_LOADED;
        }
        match args.format {
            Format::Json => checked.push(Checked::of(graph, is_good, report.as_ref(), figures)),
            Format::Text => {
                report.iter().for_each(|report| shell.show(report));
                if let Some(figures) = figures.filter(|_| is_good) {
                    let tick = milliseconds(figures.period_s);
                    shell.say(&format!("{}: ok, {} nodes, a tick each {tick}", graph.display(), figures.nodes));
                }
            }
        }
    }
    if args.format == Format::Json {
        shell.say_json(&checked);
    }
    code
}

/// Whether a file is a scenario; what cannot be read is told of as a graph.
fn is_scenario(path: &Path) -> bool {
    std::fs::read_to_string(path).is_ok_and(|text| Scenario::is_one(&text))
}

/// Checks a scenario with its task and its bench: the exit code, and what the JSON says.
fn scenario(path: &Path, args: &Check, shell: &Shell) -> (u8, Option<Checked>) {
    if args.on.bench.is_some() || !args.on.set.is_empty() {
        shell.error(format_args!("`{}` is a scenario: it names its bench, and sets nothing", path.display()));
        return (NOT_LOADED, None);
    }
    let loaded = Scenario::load(shell.catalogue(), path);
    let code = if loaded.is_ok() { 0 } else { NOT_LOADED };
    match (&loaded, args.format) {
        (_, Format::Json) => return (code, Some(Checked::of(path, loaded.is_ok(), loaded.as_ref().err(), None))),
        (Ok(scenario), Format::Text) => {
            let (runs, length) = (scenario.runs().len(), scenario.for_s);
            let runs = if runs == 1 { "1 run".to_owned() } else { format!("{runs} runs") };
            shell.say(&format!("{}: ok, a scenario of {runs}, {length} s each; `verify` runs it", path.display()));
        }
        (Err(report), Format::Text) => shell.show(report),
    }
    (code, None)
}

/// What the JSON says of one graph.
#[derive(Serialize)]
struct Checked {
    graph: String,
    ok: bool,
    diagnostics: Vec<Diagnosed>,
    /// Of a graph that loads.
    figures: Option<Figures>,
}

impl Checked {
    fn of(graph: &Path, ok: bool, report: Option<&Report>, figures: Option<Figures>) -> Self {
        let diagnostics = report.map(diagnosed).unwrap_or_default();
        Self { graph: graph.display().to_string(), ok, diagnostics, figures }
    }
}

#[derive(Serialize)]
struct Figures {
    nodes: usize,
    ports: usize,
    /// Nominal time between two ticks [s].
    period_s: f64,
    /// Whether a device runs in real time.
    is_live: bool,
    /// The nodes in the order in which they step.
    order: Vec<String>,
}

impl Figures {
    fn of(plan: &Compiled) -> Self {
        Self {
            nodes: plan.order().count(),
            ports: plan.ports().count(),
            period_s: plan.period(),
            is_live: plan.is_live(),
            order: plan.order().map(str::to_owned).collect(),
        }
    }
}

/// A time for a person [s].
pub(super) fn milliseconds(seconds: f64) -> String {
    format!("{} ms", (seconds * 1e6).round() * 1e-3)
}
