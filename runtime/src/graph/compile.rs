//! From a request to a plan, or to everything that is wrong.

use crate::catalogue::Catalogue;
use crate::graph::bench::Opened;
use crate::graph::build::{self, Builder};
use crate::graph::check::frames::Frames;
use crate::graph::check::limits;
use crate::graph::check::policy::unknown_roles;
use crate::graph::check::shown::Shown;
use crate::graph::check::unused::unused;
use crate::graph::compiled::Compiled;
use crate::graph::load::FlatGraph;
use crate::graph::load::{Loader, Request};
use crate::graph::net::{CommandWire, Net};
use crate::graph::plan::{Clock, Plan, PlannedCommand, PlannedNode, PlannedReport};
use crate::graph::syntax::GraphTable;
use crate::graph::{bench, outline};
use crate::source::{Code, Diagnostic, Report, SourceMap};

/// Checks a graph and builds it.
///
/// # Errors
/// Every mistake of its files at once.
pub fn compile(catalogue: &Catalogue, request: &Request) -> Result<Compiled, Report> {
    compile_in(Loader::new(catalogue.builtin_files()), catalogue, request)
}

/// The same, with what is read put behind what the loader has read already.
pub(crate) fn compile_in(mut loader: Loader, catalogue: &Catalogue, request: &Request) -> Result<Compiled, Report> {
    let flat = loader.load(request);
    let Loader { mut sources, diagnostics: mut found, .. } = loader;
    let has_unread =
        found.iter().any(|d| matches!(d.code, Code::Syntax | Code::Unreadable | Code::EndlessPart | Code::WrongFile));
    if has_unread {
        // What a file that was not read would have declared would be missed everywhere.
        return Err(Report::new(sources, found));
    }
    let net = Net::new(&flat, catalogue, &mut found);
    let opened = bench::open(&net, &mut sources, &mut found);
    let shown = Shown::new(&net, &mut found);
    let mut frames = Frames::unify(&net, &mut found);
    let is_limited = limits::prove(&net, &mut frames, &mut found);
    limits::compare(&net, is_limited, &mut found);
    let names = flat.roles.iter().map(|(key, _)| key.name.as_str());
    flat.policy.iter().for_each(|(section, _)| unknown_roles(section, names.clone(), &mut found));
    let clock = clock(&flat, &opened, &mut found);
    let period = clock.map_or(1.0, |(_, period)| period);
    let mut builder = Builder::new(&net, &opened, frames, (found, sources), period);
    let mut nodes: Vec<PlannedNode> = net.order.iter().filter_map(|node| builder.node(*node)).collect();
    builder.found.extend(short_gap(&flat, period));
    builder.delayed();
    shown.check_units(&builder.ports, &mut builder.found);
    let modes = build::modes(&mut builder, &mut nodes);
    let (planned, reports) = ends(&mut builder);
    let policy = flat.policy.as_ref().and_then(|(_, policy)| policy.clone()).unwrap_or_default();
    let roles = builder.planned_roles(&policy);
    let ports = std::mem::take(&mut builder.ports);
    let (found, sources) = builder.finish();
    let Some((clock, _)) = clock.filter(|_| found.is_empty()) else { return Err(Report::new(sources, found)) };
    say_what_is_there(&nodes, &opened, &sources);
    let max_gap = max_gap(flat.table.as_ref(), period);
    let parts = outline::Parts { net: &net, opened: &opened, sources: &sources, nodes: &nodes, period, max_gap };
    let outline = parts.outline();
    let warnings = unused(&net, shown.sources());
    let view = shown.view(&net, &nodes, &ports);
    let reset_after = flat.table.as_ref().map_or(0, |table| (*table.reset_after_ms * 1e6) as i64);
    let period = ((period * 1e9).round() as i64).max(1);
    let (exports, facts) = (net.exports_by_name(), opened.facts(&net));
    let (devices, commands) = (opened.devices, planned);
    let plan = Plan { roles, devices, nodes, commands, reports, clock, period, max_gap, reset_after, modes, policy };
    Ok(Compiled { plan, view, sources, warnings, outline, exports, facts })
}

/// What the devices are told: commands, and reports.
fn ends(builder: &mut Builder<'_>) -> (Vec<PlannedCommand>, Vec<PlannedReport>) {
    let (reports, commands): (Vec<&CommandWire>, Vec<&CommandWire>) =
        builder.net.commands.iter().partition(|wire| wire.is_report);
    let commands = commands.into_iter().filter_map(|wire| builder.command(wire)).collect();
    (commands, reports.into_iter().filter_map(|wire| builder.report(wire)).collect())
}

/// For those who run the tool with `-v`.
fn say_what_is_there(nodes: &[PlannedNode], opened: &Opened, sources: &SourceMap) {
    for node in nodes {
        tracing::debug!("next in the order: `{}` ({})", node.name, sources.locate(node.span.start));
    }
    for device in &opened.devices {
        tracing::info!("opened device `{}` ({})", device.name, sources.locate(device.span.start));
    }
}

/// Greatest time between two samples that counts as one step [s].
fn max_gap(table: Option<&GraphTable>, period: f64) -> f64 {
    /// As many periods are one step at most.
    const GREATEST_GAP: f64 = 5.0;
    table.and_then(|table| table.max_gap_ms).map_or(GREATEST_GAP * period, |ms| *ms * 1e-3)
}

/// A greatest gap that is shorter than a period: every step would count as less than it is.
fn short_gap(flat: &FlatGraph, period: f64) -> Option<Diagnostic> {
    let gap = *flat.table.as_ref()?.max_gap_ms?;
    let span = flat.settings.as_ref()?.as_table()?.get("max_gap_ms")?.span.clone();
    // A period is a whole number of nanoseconds, so the same number may be a little more.
    let message = format!("`max_gap_ms` of {gap} is less than a period, {:.3} ms", period * 1e3);
    let is_short = gap * 1e-3 < period * (1.0 - 1e-6);
    is_short.then(|| Diagnostic::new(Code::BadValue, span, message).help("a period is the least that makes sense"))
}

/// What makes the graph tick, and how often [s].
fn clock(flat: &FlatGraph, opened: &Opened, found: &mut Vec<Diagnostic>) -> Option<(Clock, f64)> {
    // A graph whose own section could not be read has been told so.
    let table = flat.table.as_ref()?;
    let (word, rate) = (table.clock.as_ref(), table.rate_hz);
    let mut wrong = |span: std::ops::Range<usize>, message: String, help: &str| {
        found.push(Diagnostic::new(Code::BadClock, span, message).help(help));
    };
    match (word, rate) {
        (Some(word), None) => {
            let Some(role) = flat.roles.iter().position(|(key, _)| key.name == word.text) else {
                let roles = flat.roles.iter().map(|(key, _)| key.name.as_str());
                let help = crate::source::closest(&word.text, roles, "roles");
                wrong(word.span.clone(), format!("the clock `{}` is not a role", word.text), &help);
                return None;
            };
            let bound = opened.roles.get(role)?.as_ref()?;
            Some((Clock::Device(bound.device), opened.periods[bound.device]))
        }
        (None, Some(rate)) => Some((Clock::Rate, 1.0 / *rate)),
        (Some(word), Some(_)) => {
            wrong(word.span.clone(), "the graph has two clocks".into(), "keep `clock` or `rate_hz`");
            None
        }
        (None, None) => {
            let help = "add `clock = \"role\"` or `rate_hz = 250` under [graph]";
            wrong(flat.place.clone(), "the graph has no clock".into(), help);
            None
        }
    }
}
