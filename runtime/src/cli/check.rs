//! `check`: checks and builds graphs without running them.

use std::path::{Path, PathBuf};

use serde::{Serialize, Serializer};

use super::explain::explain;
use super::shell::command::{GraphArgs, OutputFormat};
use super::shell::json::{DiagnosticJson, diagnosed};
use super::shell::{NOT_LOADED, Shell};
use super::text::number::{count_of, milliseconds};
use crate::graph::{AllowedWarning, compile};
use crate::scenario::Scenario;
use crate::source::Report;

/// Check graphs and scenarios without running them, and report every mistake
#[derive(clap::Parser)]
#[command(
    name = "check",
    after_help = "Examples:
  tactflow check graphs/*.toml
  tactflow check graphs/hybrid.toml --bench graphs/benches/pen.toml --deny-warnings
  tactflow check --explain unknown-port"
)]
pub(crate) struct CheckArgs {
    /// Graph files and scenario files
    #[arg(required_unless_present = "explain")]
    graphs: Vec<PathBuf>,
    /// Print the page of a code, such as unknown-port; without a code, list all codes
    #[arg(long, value_name = "CODE", num_args = 0..=1, default_missing_value = "", conflicts_with = "graphs")]
    explain: Option<String>,
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
    if let Some(code) = &args.explain {
        return explain(code, shell);
    }
    let mut results = Vec::new();
    for path in &args.graphs {
        // A file that cannot be read is reported as a graph.
        let is_scenario = std::fs::read_to_string(path).is_ok_and(|text| Scenario::is_one(&text));
        let checked = match is_scenario {
            true if args.graph_args.is_given() => {
                let path = path.display();
                shell.error(format_args!(
                    "`{path}` is a scenario, which names its own bench: remove `--bench` and `--set`"
                ));
                continue;
            }
            true => check_scenario(path, &args, shell),
            false => check_graph(path, &args, shell),
        };
        if args.format == OutputFormat::Text {
            checked.report.iter().for_each(|report| shell.show(report));
            if checked.ok {
                shell.say(&format!("{}: ok, {}", checked.graph, checked.summary));
            }
            checked.allowed.iter().for_each(|warning| shell.say(&warning.to_string()));
            checked.silences.iter().for_each(|line| shell.say(line));
        }
        results.push(checked);
    }
    if args.format == OutputFormat::Json {
        shell.say_json(&results);
    }
    let is_ok = results.len() == args.graphs.len() && results.iter().all(|checked| checked.ok);
    if is_ok { 0 } else { NOT_LOADED }
}

fn check_graph(path: &Path, args: &CheckArgs, shell: &Shell) -> Checked {
    match compile(shell.catalogue(), &args.graph_args.request(path.to_owned())) {
        Ok(plan) => {
            let (report, order): (_, Vec<String>) = (plan.warnings(), plan.order().map(str::to_owned).collect());
            let (ports, period_s, is_live) = (plan.ports().count(), plan.period(), plan.is_live());
            let figures = PlanJson { nodes: order.len(), ports, period_s, is_live, order };
            let summary = format!("{} nodes, one tick every {}", figures.nodes, milliseconds(figures.period_s));
            let ok = report.is_none() || !args.deny_warnings;
            let (allowed, silences) = (plan.allowed().to_vec(), plan.silences().to_vec());
            Checked { ok, figures: Some(figures), summary, allowed, silences, ..Checked::of(path, report) }
        }
        Err(report) => Checked::of(path, Some(report)),
    }
}

fn allowed_json<S: Serializer>(allowed: &[AllowedWarning], serializer: S) -> Result<S::Ok, S::Error> {
    let entry = |AllowedWarning { code, reason, count }: &AllowedWarning| serde_json::json!({ "code": code.name(), "reason": reason, "count": count });
    serializer.collect_seq(allowed.iter().map(entry))
}

/// Checks a scenario with its graph and its bench.
fn check_scenario(path: &Path, args: &CheckArgs, shell: &Shell) -> Checked {
    match Scenario::load(shell.catalogue(), path) {
        Ok(scenarios) => {
            let length = scenarios.first().map_or(0.0, |scenario| scenario.for_s);
            let runs = count_of(scenarios.iter().map(|scenario| scenario.runs().len()).sum(), "run");
            let benches = if scenarios.len() > 1 { format!(" on {} benches", scenarios.len()) } else { String::new() };
            let summary = format!("a scenario of {runs}{benches}, {length} s each; run it with `tactflow verify`");
            let report = scenarios.iter().find_map(|scenario| scenario.warnings()).cloned();
            let ok = report.is_none() || !args.deny_warnings;
            Checked { ok, summary, ..Checked::of(path, report) }
        }
        Err(report) => Checked::of(path, Some(report)),
    }
}

/// The result of one file, as JSON.
#[derive(Default, Serialize)]
struct Checked {
    graph: String,
    ok: bool,
    diagnostics: Vec<DiagnosticJson>,
    /// Figures of a graph that loads.
    figures: Option<PlanJson>,
    /// The warnings that a section [allow] silences.
    #[serde(serialize_with = "allowed_json")]
    allowed: Vec<AllowedWarning>,
    /// What each live device that moves does without commands.
    silences: Vec<String>,
    #[serde(skip)]
    report: Option<Report>,
    /// What is printed of a good file.
    #[serde(skip)]
    summary: String,
}

impl Checked {
    fn of(path: &Path, report: Option<Report>) -> Self {
        let diagnostics = report.as_ref().map(diagnosed).unwrap_or_default();
        Self { graph: path.display().to_string(), diagnostics, report, ..Self::default() }
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
