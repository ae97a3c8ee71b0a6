//! Compiles a request into a plan, or into all its diagnostics.

use std::cell::RefCell;

use crate::catalogue::Catalogue;
use crate::device::{RecordedDevice, RoleType};
use crate::graph::bench::{self, OpenedBench};
use crate::graph::build::{Builder, BuiltModes, build_modes, find_reach, max_gaps, plan_live, plan_tasks};
use crate::graph::check;
use crate::graph::check::contact::ContactPorts;
use crate::graph::check::generators::Generators;
use crate::graph::compiled::Compiled;
use crate::graph::load::{FlatGraph, Loader, Request};
use crate::graph::net::{Net, role_types, slow_down};
use crate::graph::outline::OutlineBuilder;
use crate::graph::plan::{AllowedWarning, Plan, PlannedCommand, PlannedMode, PlannedNode, PortRef, RecordedPorts};
use crate::graph::syntax::RecordTable;
use crate::source::{Code, Diagnostic, Diagnostics, Report, Severity, SourceMap};

/// Checks and builds a graph.
///
/// # Errors
/// All diagnostics of its files.
pub fn compile(catalogue: &Catalogue, request: &Request) -> Result<Compiled, Report> {
    let mut loader = Loader::new(catalogue.builtin_files());
    if let Some(files) = request.recorded.as_ref().and_then(|recorded| recorded.files.clone()) {
        loader.sources = loader.sources.with_attached(files);
    }
    compile_in(loader, catalogue, request)
}

/// Returns the roles that a bench adds to every task, each with its type.
fn joined_roles(catalogue: &Catalogue) -> Vec<(String, String)> {
    let joined = |role: &RoleType| Some((role.joined_as.as_ref()?.to_string(), role.name.to_string()));
    catalogue.roles().iter().filter_map(joined).collect()
}

/// Returns the types of nodes that compute beside the tick.
fn types_beside(catalogue: &Catalogue) -> Vec<String> {
    let nodes = catalogue.devices().iter().filter(|device| device.is_node());
    nodes.map(|device| device.name().into_owned()).collect()
}

/// Compiles a graph with a loader that may have read other files before.
pub(crate) fn compile_in(mut loader: Loader, catalogue: &Catalogue, request: &Request) -> Result<Compiled, Report> {
    (loader.joined, loader.beside) = (joined_roles(catalogue), types_beside(catalogue));
    let mut flat = loader.load(request);
    let Loader { mut sources, mut diagnostics, mut measured, has_wrong_roles, .. } = loader;
    set_live(&mut flat, request, &mut sources, &mut diagnostics);
    if has_wrong_roles || has_unreadable(&diagnostics) {
        // The checks would report everything that a missing file declares, or a missing role provides, as missing.
        return Err(Report::new(sources, split(diagnostics).0));
    }
    flat.bench.iter_mut().for_each(|bench| bench::add_models(bench, catalogue, &mut diagnostics));
    let slow = request.slow.unwrap_or(1.0);
    slow_down(&mut flat.limits, slow);
    let beside = role_types(&flat, catalogue, &mut sources);
    let net = Net::new(&flat, catalogue, &beside, &mut diagnostics);
    let opened = bench::open(&net, (slow, recorded_devices(request)), &mut sources, &mut diagnostics);
    check_wires(&net, &opened, &mut diagnostics);
    let view = check::view::check(&net, &mut diagnostics);
    let mut frames = check::frames::check(&net, &mut diagnostics);
    check::quantities::check(&net, &mut diagnostics);
    check::facts::check(&net, &sources, &mut diagnostics);
    check::limits::check(&net, &mut frames, &mut diagnostics);
    let misspelt = check::limit_values::check(&net, &opened, &sources, &mut diagnostics);
    check::limit_sections::check(&net, &mut diagnostics);
    let clock = check::clock::check(&net, &opened, &mut diagnostics);
    let period = clock.map_or(1.0, |(_, period)| period);
    let mut builder = Builder::new(&net, &opened, frames, (diagnostics, sources), period);
    let mut nodes: Vec<PlannedNode> = net.order.iter().filter_map(|node| builder.node(*node)).collect();
    check::limit_values::tell_once(&misspelt, &mut builder.diagnostics);
    builder.check_delayed_units();
    check::calibration::check(&net, &nodes, &mut builder.diagnostics);
    view.check_units(&builder.ports, &mut builder.diagnostics);
    check::times::check(&net, &opened, period, &mut builder.diagnostics);
    let modes = build_modes(&mut builder, &mut nodes);
    let (modes, starts) = check_modes(&net, modes, period, &mut builder.diagnostics);
    let live = plan_live(&mut builder, &nodes);
    let mut commands: Vec<PlannedCommand> = net.commands.iter().filter_map(|wire| builder.command(wire)).collect();
    commands.sort_by_key(|command| command.is_report);
    let roles = builder.plan_roles();
    let ports = std::mem::take(&mut builder.ports);
    let (diagnostics, sources, of_nodes) = builder.finish();
    measured.extend(of_nodes);
    let (mistakes, mut warnings) = split(check::parts::move_out(&flat, &sources, diagnostics));
    let Some((clock, _)) = clock.filter(|_| mistakes.is_empty()) else { return Err(Report::new(sources, mistakes)) };
    assert_eq!(nodes.len(), flat.nodes.len(), "a graph without a mistake has all its nodes");
    log_plan(&nodes, &opened, &sources);
    let gaps = max_gaps(&net, &opened, period);
    let outline = OutlineBuilder {
        net: &net,
        opened: &opened,
        sources: &sources,
        nodes: &nodes,
        measured: &measured,
        period,
        max_gap: gaps[0],
        defaults: RefCell::default(),
    };
    let outline = outline.build();
    check::unused::check(&net, &modes, view.sources(), &mut warnings);
    let facts = opened.facts(&net);
    warnings.extend(catalogue.lints().iter().flat_map(|lint| lint(&outline, &facts)));
    let (warnings, allowed) = settle(&flat, &sources, warnings);
    let view = view.plan(&net, &nodes, &ports);
    let shown: Vec<PortRef> = view.ports.iter().map(|port| port.source).collect();
    let reach = find_reach(&net, &nodes, &modes);
    let tasks = plan_tasks(&net, &ports, modes, (&starts, &shown), &gaps);
    let period = ((period * 1e9).round() as i64).max(1);
    let (exports, silences) = (net.exports_by_name(), check::silence::describe(&net, &opened));
    let to_commission = bench::to_commission(&net, &opened, &sources);
    let plan = Plan { roles, devices: opened.devices, nodes, commands, clock, period, tasks, reach, live, allowed };
    let recorded = RecordedPorts::default();
    let all = Compiled { plan, view, sources, warnings, outline, exports, facts, silences, to_commission, recorded };
    with_recorded(all, flat.record.as_ref())
}

/// Returns the devices of a recording, if the request names one.
fn recorded_devices(request: &Request) -> Option<&[RecordedDevice]> {
    request.recorded.as_ref().map(|recorded| recorded.devices.as_slice())
}

/// Sets the values of a request that changed while the graph ran.
fn set_live(flat: &mut FlatGraph, request: &Request, sources: &mut SourceMap, diagnostics: &mut Diagnostics) {
    let Err(name) = flat.set_live(&request.live) else { return };
    let span = sources.add(SourceMap::COMMAND_LINE, name.clone(), "").span();
    let message = format!("the graph writes no value of `{name}`, so it cannot change");
    diagnostics.push(Diagnostic::new(Code::UnknownKey, span, message));
}

/// Whether a file is not TOML, cannot be read or is of the wrong sort.
fn has_unreadable(diagnostics: &Diagnostics) -> bool {
    let is_unreadable =
        |code: Code| matches!(code, Code::Syntax | Code::Unreadable | Code::EndlessPart | Code::WrongFile);
    diagnostics.iter().any(|found| is_unreadable(found.code))
}

/// Selects the ports of a recording, or reports patterns that match no port.
fn with_recorded(mut compiled: Compiled, table: Option<&RecordTable>) -> Result<Compiled, Report> {
    let mut unmatched = Diagnostics::new();
    let ports: Vec<&str> = compiled.ports().map(|port| port.name.as_str()).collect();
    compiled.recorded = check::record::check(table, &ports, &mut unmatched);
    if unmatched.is_empty() { Ok(compiled) } else { Err(Report::new(compiled.sources, unmatched)) }
}

/// Checks what needs neither frames nor limits.
fn check_wires(net: &Net<'_>, opened: &OpenedBench, diagnostics: &mut Diagnostics) {
    check::silence::check(opened, diagnostics);
    check::inputs::check(net, diagnostics);
    check::beside::check(net, diagnostics);
    check::commands::check(net, diagnostics);
    check::exports::check(net, diagnostics);
    check::delays::check(net, diagnostics);
    check::policy::check(net, diagnostics);
}

/// Returns the warnings that are left, and those that the graph or its bench allows.
fn settle(flat: &FlatGraph, sources: &SourceMap, warnings: Diagnostics) -> (Diagnostics, Vec<AllowedWarning>) {
    let mut warnings = sorted(check::parts::move_out(flat, sources, warnings));
    let allowed = check::allow::silence(flat, &mut warnings);
    (warnings, allowed)
}

/// Sorts warnings by their place. Several nodes may read the same number of [limits].
fn sorted(mut warnings: Diagnostics) -> Diagnostics {
    warnings.sort_by_key(|warning| (warning.span.start, warning.code));
    warnings.dedup();
    warnings
}

/// Separates the mistakes from the warnings.
fn split(diagnostics: Diagnostics) -> (Diagnostics, Diagnostics) {
    diagnostics.into_iter().partition(|diagnostic| diagnostic.code.severity() == Severity::Error)
}

/// Checks the modes together, and returns them with the start mode of each task that has modes.
fn check_modes(
    net: &Net<'_>,
    built: BuiltModes,
    period: f64,
    diagnostics: &mut Diagnostics,
) -> (Vec<PlannedMode>, Vec<usize>) {
    let BuiltModes { modes, motions, readings, demand, demand_changes, freezes } = built;
    let reads = |mode: usize, node: usize, port: usize| demand.of(node, &demand_changes[mode])[port];
    let contact = ContactPorts::new(net);
    let generators = Generators::new(net, &contact, &motions);
    check::absent::check(&modes, &reads, &freezes, diagnostics);
    check::overlap::check(net, &readings, &modes, diagnostics);
    check::motion::check(net, &contact, &modes, &generators, diagnostics);
    check::late::check(&modes, period, diagnostics);
    check::immediate::check(net, &modes, period, diagnostics);
    check::chatter::check((net, &readings), &contact, &modes, period, diagnostics);
    let starts = check::reachability::check(net, diagnostics);
    check::approach::check(net, &contact, &modes, &starts, (&motions, &generators), diagnostics);
    (modes, starts)
}

/// Logs the order of the nodes and the opened devices, for `-v`.
fn log_plan(nodes: &[PlannedNode], opened: &OpenedBench, sources: &SourceMap) {
    for node in nodes {
        tracing::debug!("next in the order: `{}` ({})", node.name, sources.locate(node.span.start));
    }
    for device in &opened.devices {
        tracing::info!("opened device `{}` ({})", device.name, sources.locate(device.span.start));
    }
}
