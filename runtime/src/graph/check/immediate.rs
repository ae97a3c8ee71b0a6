//! Warns of modes that end as soon as they begin: the condition that leads in is also that of an exit.

use crate::graph::net::Net;
use crate::graph::plan::{Condition, PlannedExit, PlannedMode, PortRef, Test};
use crate::graph::syntax::PortState;
use crate::source::{Code, Diagnostic, Diagnostics};

/// Warns of each exit that holds when its mode begins, and for no longer than it already held.
///
/// `period` is that of the graph [s].
pub(crate) fn check(net: &Net<'_>, modes: &[PlannedMode], period: f64, diagnostics: &mut Diagnostics) {
    let period = (period * 1e9) as i64;
    let mut ways_to: Vec<Vec<(usize, &PlannedExit)>> = vec![Vec::new(); modes.len()];
    for (from, mode) in modes.iter().enumerate() {
        let ways = mode.exits.iter().filter_map(|way| Some((way.to?, way)));
        ways.for_each(|(to, way)| ways_to[to].push((from, way)));
    }
    for (to, (mode, ways)) in modes.iter().zip(&ways_to).enumerate() {
        for exit in &mode.exits {
            let is_immediate = |(from, way): &&(usize, &PlannedExit)| {
                immediate(way, exit, period).is_some_and(|port| stays(net, *from, to, port))
            };
            let Some((from, way)) = ways.iter().find(is_immediate) else { continue };
            diagnostics.push(report((&modes[*from], way), (mode, exit)));
        }
    }
}

/// Returns the port that two exits test, if the second one holds as soon as the first one has led into its mode. The
/// period is in [ns].
pub(super) fn immediate(way: &PlannedExit, exit: &PlannedExit, period: i64) -> Option<PortRef> {
    implied(&way.condition, &exit.condition).filter(|_| exit.lasts <= way.lasts.max(period))
}

/// Returns the port that both conditions test, if the second one always holds when the first one does.
fn implied(first: &Condition, second: &Condition) -> Option<PortRef> {
    use PortState::{Absent, False, Present, True};
    let (Condition::Port(port, first), Condition::Port(other, second)) = (first, second) else { return None };
    let is_implied = match (*first, *second) {
        (Test::Is(True | False | Present) | Test::Between { .. }, Test::Is(Present)) => true,
        (Test::Is(a), Test::Is(b)) => a == b && matches!(a, True | False | Absent),
        (Test::Between { min, max, .. }, Test::Between { min: low, max: high, .. }) => min >= low && max <= high,
        _ => false,
    };
    (port == other && is_implied).then_some(port.source)
}

/// Returns whether two modes have the same parameters at and upstream of a port, so that a switch does not change it.
pub(super) fn stays(net: &Net<'_>, from: usize, to: usize, port: PortRef) -> bool {
    let setting =
        |mode: usize, node: usize| net.setting(mode, node).and_then(|value| toml::Value::try_from(value).ok());
    let upstream = net.upstream(port.producer.node());
    (0..upstream.len()).filter(|node| upstream[*node]).all(|node| setting(from, node) == setting(to, node))
}

fn report((from, way): (&PlannedMode, &PlannedExit), (mode, exit): (&PlannedMode, &PlannedExit)) -> Diagnostic {
    let (name, key) = (&mode.name, exit.kind.key());
    let message = format!(
        "mode `{name}` ends right after it begins: it begins when {}, and `{key}` ends it when {}",
        way.text, exit.text
    );
    let note = format!("leads from `{}` to `{name}`", from.name);
    let help = format!("add a time to `{key}`, for example `for_ms = 1000`, or let it test something else");
    Diagnostic::new(Code::ImmediateExit, exit.span.clone(), message).note(way.span.clone(), note).help(help)
}
