//! `tactflow explain`: what moves the arm in each mode, in numbers.

mod approaches;
mod latency;
mod page;
mod stability;

use std::path::PathBuf;

use serde::Serialize;
use tactflow_runtime::cli::clap::{self, ValueEnum};
use tactflow_runtime::cli::{GraphArgs, Shell};
use tactflow_runtime::graph::{Compiled, compile};

use super::control::chain::{Chain, Limiter, chain};
use super::control::collect::law_behind;
use super::control::contacts::contacts;
use super::control::law::Law;
use super::control::nodes::{Command, Ends, Index, Nodes, commands, ends};
use approaches::{Approach, approaches};
use latency::{Latency, latencies};
use stability::{Stability, stability};

/// Print what moves the arm in each mode: gains, limits and delays
#[derive(clap::Parser)]
#[command(
    name = "explain",
    after_help = "It multiplies gains, columns and projectors, so each number of a table is the speed of a twist component for one unit of
an error. For each contact that the bench declares, it computes the margins of the loops. It runs nothing.

Examples:
  tactflow explain graphs/hybrid.toml
  tactflow explain graphs/rolling.toml --set nodes.pid.gains.x.kp=3
  tactflow explain graphs/hybrid.toml move.bumpless.twist      what this port carries
  tactflow explain graphs/edge.toml --format markdown > edge.md

Exit codes: 0 success; 2 the graph does not load, or has no such port."
)]
pub(super) struct ExplainArgs {
    /// The graph file
    graph: PathBuf,
    /// A port that carries a twist or joint velocities; all commands of arms if not given
    port: Option<String>,
    #[command(flatten)]
    graph_args: GraphArgs,
    /// Output format
    #[arg(long, value_enum, default_value_t = Format::Text, value_name = "FORMAT")]
    format: Format,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Format {
    /// For a terminal.
    Text,
    /// For a page.
    Markdown,
    /// For a program.
    Json,
}

/// The control law of a graph.
#[derive(Debug, Serialize)]
struct Explained {
    /// Nominal time between two ticks [s].
    period_s: f64,
    motions: Vec<Motion>,
}

/// What moves one arm, or what one port carries.
#[derive(Debug, Serialize)]
struct Motion {
    /// The command, `arm.velocity`, or the port.
    of: String,
    /// The limiters and conversions from the task's twist to the command, in this order.
    limits: Vec<Limiter>,
    modes: Vec<ModeSummary>,
}

/// What moves an arm in one mode.
#[derive(Debug, Serialize)]
struct ModeSummary {
    /// Name of the mode; `None` in a graph without modes.
    mode: Option<String>,
    #[serde(flatten)]
    law: Law,
    /// How late the features move the arm.
    latencies: Vec<Latency>,
    /// The loops of the features that are controlled, over each contact that the bench declares.
    loops: Vec<Stability>,
    /// The motions that meet an object.
    approaches: Vec<Approach>,
    /// How the mode ends.
    ends: Ends,
}

pub(super) fn run(args: ExplainArgs, shell: &Shell) -> Result<u8, u8> {
    let request = args.graph_args.request(args.graph.clone());
    let compiled = compile(shell.catalogue(), &request).map_err(|report| shell.reject(&report))?;
    compiled.warnings().iter().for_each(|report| shell.show(report));
    let explained = explain(&compiled, args.port.as_deref()).map_err(|message| shell.refuse(message))?;
    match args.format {
        Format::Json => shell.say_json(&explained),
        Format::Text => shell.say(page::text(&args.graph, &explained).trim_end()),
        Format::Markdown => shell.say(page::markdown(&args.graph, &explained).trim_end()),
    }
    Ok(0)
}

fn explain(compiled: &Compiled, port: Option<&str>) -> Result<Explained, String> {
    let outline = compiled.outline();
    let index = Index::new(outline);
    let port = port.map(|port| motion_port(&index, port)).transpose()?;
    let motions: Vec<Result<Motion, String>> = match port {
        Some(port) => vec![motion(compiled, &index, port.to_owned(), Command { arm: arm_behind(&index, port), port })],
        None => commands(outline).map(|one| motion(compiled, &index, format!("{}.velocity", one.arm), one)).collect(),
    };
    if motions.is_empty() {
        return Err("no role is an arm, so nothing moves: name a port that carries a twist".into());
    }
    Ok(Explained { period_s: outline.period_s, motions: motions.into_iter().collect::<Result<_, _>>()? })
}

/// Returns the port with this name, or the one that a command with this name reads.
///
/// # Errors
/// If there is none, or if it carries no motion.
fn motion_port<'a>(index: &Index<'a>, port: &'a str) -> Result<&'a str, String> {
    if let Some(command) = commands(index.outline()).find(|one| format!("{}.velocity", one.arm) == port) {
        return Ok(command.port);
    }
    let outputs = index.outline().nodes.iter().flat_map(|node| &node.outputs);
    match outputs.clone().find(|output| output.name == port) {
        Some(output) if ["twist", "joints"].contains(&output.kind) => Ok(port),
        Some(output) => {
            Err(format!("`{port}` carries {}: name a port that carries a twist or joint velocities", output.kind))
        }
        None => {
            // A part exports the port of a node in it, often under its name.
            let (first, last) = port.split_once('.').unwrap_or((port, port));
            let is_inside = |name: &str| name.starts_with(&format!("{first}.")) && name.ends_with(&format!(".{last}"));
            let mut moves = outputs.filter(|output| ["twist", "joints"].contains(&output.kind));
            let inside = moves.rfind(|output| is_inside(&output.name));
            let help = inside.map(|output| format!(": did you mean `{}`?", output.name)).unwrap_or_default();
            Err(format!("no node writes `{port}`{help}"))
        }
    }
}

/// Returns the role of the arm that a port moves; "" if it moves none.
fn arm_behind<'a>(index: &Index<'a>, port: &str) -> &'a str {
    let nodes = Nodes::new(index, None);
    let writer = nodes.writer(port).map(|node| &*node.name);
    let moves = |one: &Command<'_>| nodes.upstream(one.port).iter().any(|node| Some(&*node.name) == writer);
    commands(index.outline()).find(moves).map_or("", |one| one.arm)
}

/// Returns what a port carries to an arm, with the contacts that the bench declares for it. A port that moves no arm, "",
/// has no contacts.
fn motion(compiled: &Compiled, index: &Index<'_>, of: String, command: Command<'_>) -> Result<Motion, String> {
    let Command { arm, port } = command;
    let Chain { limits, twist, mounts } = chain(&Nodes::new(index, None), port)?;
    let declared = contacts(compiled.facts(), arm)?;
    let modes = index.modes(index.task_of(&twist)).into_iter().map(|mode| {
        let nodes = Nodes::new(index, mode);
        let law = law_behind(&nodes, &twist, &mounts);
        Ok(ModeSummary {
            mode: mode.map(|mode| mode.name.clone()),
            latencies: latencies(&declared, &law),
            loops: stability(&declared, &law),
            approaches: approaches(&nodes, &limits, &law, &declared),
            law,
            ends: mode.map(ends).unwrap_or_default(),
        })
    });
    let modes = modes.collect::<Result<_, String>>()?;
    Ok(Motion { of, limits, modes })
}
