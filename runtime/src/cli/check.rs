//! `check`: checks and builds graphs without running them.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::shell::command::{GraphArgs, OutputFormat};
use super::shell::json::{DiagnosticJson, diagnosed};
use super::shell::{NOT_LOADED, Shell};
use super::text::number::milliseconds;
use crate::graph::{Compiled, compile};
use crate::scenario::Scenario;
use crate::source::Report;

/// Check graphs and scenarios without running them, and report every mistake
#[derive(clap::Parser)]
#[command(
    name = "check",
    after_help = "Examples:
  tactflow check graphs/*.toml
  tactflow check graphs/hybrid.toml --bench benches/lab.toml --deny-warnings"
)]
pub(crate) struct CheckArgs {
    /// Graph files and scenario files
    #[arg(required = true)]
    graphs: Vec<PathBuf>,
    #[command(flatten)]
    graph_args: GraphArgs,
    /// Treat warnings as errors
    #[arg(long)]
    deny_warnings: bool,
    /// Output format
    #[arg(long, value_enum, default_value_t = OutputFormat::Text, value_name = "FORMAT")]
    format: OutputFormat,
}

pub(crate) fn check(args: CheckArgs, shell: &Shell) -> u8 {
    let mut code = 0;
    let mut results = Vec::new();
    for graph in &args.graphs {
        if is_scenario(graph) {
            let (scenario_code, result) = check_scenario(graph, &args, shell);
            code = code.max(scenario_code);
            results.extend(result);
            continue;
        }
        let result = compile(shell.catalogue(), &args.graph_args.request(graph.clone()));
        let (report, figures) = match &result {
            Ok(plan) => (plan.warnings(), Some(PlanJson::of(plan))),
            Err(report) => (Some(report.clone()), None),
        };
        let is_good = figures.is_some() && (report.is_none() || !args.deny_warnings);
        if !is_good {
            code = NOT_LOADED;
        }
        match args.format {
            OutputFormat::Json => results.push(CheckJson::of(graph, is_good, report.as_ref(), figures)),
            OutputFormat::Text => {
                report.iter().for_each(|report| shell.show(report));
                if let Some(figures) = figures.filter(|_| is_good) {
                    let tick = milliseconds(figures.period_s);
                    shell.say(&format!("{}: ok, {} nodes, one tick every {tick}", graph.display(), figures.nodes));
                }
            }
        }
    }
    if args.format == OutputFormat::Json {
        shell.say_json(&results);
    }
    code
}

/// Whether a file is a scenario. A file that cannot be read is reported as a graph.
fn is_scenario(path: &Path) -> bool {
    std::fs::read_to_string(path).is_ok_and(|text| Scenario::is_one(&text))
}

/// Checks a scenario with its graph and its bench. Returns the exit code and the result as JSON.
fn check_scenario(path: &Path, args: &CheckArgs, shell: &Shell) -> (u8, Option<CheckJson>) {
    if args.graph_args.bench.is_some() || !args.graph_args.set.is_empty() {
        shell.error(format_args!(
            "`{}` is a scenario, which names its own bench: remove `--bench` and `--set`",
            path.display()
        ));
        return (NOT_LOADED, None);
    }
    let loaded = Scenario::load(shell.catalogue(), path);
    let code = if loaded.is_ok() { 0 } else { NOT_LOADED };
    match (&loaded, args.format) {
        (_, OutputFormat::Json) => {
            return (code, Some(CheckJson::of(path, loaded.is_ok(), loaded.as_ref().err(), None)));
        }
        (Ok(scenario), OutputFormat::Text) => {
            let (runs, length) = (scenario.runs().len(), scenario.for_s);
            let runs = if runs == 1 { "1 run".to_owned() } else { format!("{runs} runs") };
            shell.say(&format!(
                "{}: ok, a scenario of {runs}, {length} s each; run it with `tactflow verify`",
                path.display()
            ));
        }
        (Err(report), OutputFormat::Text) => shell.show(report),
    }
    (code, None)
}

/// The result of one file as JSON.
#[derive(Serialize)]
struct CheckJson {
    graph: String,
    ok: bool,
    diagnostics: Vec<DiagnosticJson>,
    /// Figures of a graph that loads.
    figures: Option<PlanJson>,
}

impl CheckJson {
    fn of(graph: &Path, ok: bool, report: Option<&Report>, figures: Option<PlanJson>) -> Self {
        let diagnostics = report.map(diagnosed).unwrap_or_default();
        Self { graph: graph.display().to_string(), ok, diagnostics, figures }
    }
}

/// Figures of a plan as JSON.
#[derive(Serialize)]
struct PlanJson {
    nodes: usize,
    ports: usize,
    /// Nominal time between two ticks [s].
    period_s: f64,
    /// Whether a device runs in real time.
    is_live: bool,
    /// The nodes in the order in which they step.
    order: Vec<String>,
}

impl PlanJson {
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
