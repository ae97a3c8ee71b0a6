//! Warns of modes that end as soon as they begin: the condition that leads in is also that of an exit.

use crate::graph::net::Net;
use crate::graph::plan::{Condition, PlannedExit, PlannedMode, PortRef, Producer, Test};
use crate::graph::syntax::PortState;
use crate::source::{Code, Diagnostic, Diagnostics};

/// A mode that lasts for this long has a purpose, even if its end is certain [ns].
const SHORT: i64 = 100_000_000;

/// Warns of each exit that holds when its mode begins, and for no longer than it already held.
///
/// `period` is that of the graph [s].
pub(crate) fn check(net: &Net<'_>, modes: &[PlannedMode], period: f64, diagnostics: &mut Diagnostics) {
    let period = (period * 1e9) as i64;
    let ways = Ways::new(net, modes, period);
    for (to, mode) in modes.iter().enumerate() {
        for exit in &mode.exits {
            let Some((from, way)) = ways.immediate(to, exit) else { continue };
            diagnostics.push(report((&modes[from], way), (mode, exit), period));
        }
    }
}

/// The exits that lead to each mode.
pub(super) struct Ways<'a> {
    net: &'a Net<'a>,
    /// Period of the graph [ns].
    period: i64,
    /// For each mode, the exits that lead to it, each with its own mode.
    to: Vec<Vec<(usize, &'a PlannedExit)>>,
}

impl<'a> Ways<'a> {
    pub(super) fn new(net: &'a Net<'a>, modes: &'a [PlannedMode], period: i64) -> Self {
        let mut to = vec![Vec::new(); modes.len()];
        for (from, mode) in modes.iter().enumerate() {
            let ways = mode.exits.iter().filter_map(|way| Some((way.to?, way)));
            ways.for_each(|(mode, way)| to[mode].push((from, way)));
        }
        Self { net, period, to }
    }

    /// Returns an exit, and its mode, that leads to a mode where `exit` then holds at once.
    pub(super) fn immediate(&self, mode: usize, exit: &PlannedExit) -> Option<(usize, &'a PlannedExit)> {
        let is_immediate = |(from, way): &&(usize, &PlannedExit)| {
            let port = implied(&way.condition, &exit.condition).filter(|_| is_short(way, exit, self.period));
            port.is_some_and(|port| stays(self.net, *from, mode, port))
        };
        self.to[mode].iter().find(is_immediate).copied()
    }
}

/// Returns whether an exit waits for less than [`SHORT`], and for no longer than the way into its mode did or than one
/// period [ns].
///
/// `for_ms` counts from the start of the mode, whatever was before. A mode lasts at least as long as its exit waits.
const fn is_short(way: &PlannedExit, exit: &PlannedExit, period: i64) -> bool {
    exit.lasts < SHORT && (exit.lasts <= way.lasts || exit.lasts <= period)
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

/// Returns whether a switch from one mode to another does not change a port: nothing upstream has other parameters, or
/// reads which mode it is.
pub(super) fn stays(net: &Net<'_>, from: usize, to: usize, port: PortRef) -> bool {
    let setting =
        |mode: usize, node: usize| net.setting(mode, node).and_then(|value| toml::Value::try_from(value).ok());
    let own = Producer::Task(net.flat.modes[from].task);
    let reads_mode = |node: usize| net.wires[node].iter().any(|wire| wire.source.producer == own);
    let upstream = net.upstream(port.producer.node());
    let mut nodes = (0..upstream.len()).filter(|node| upstream[*node]);
    nodes.all(|node| !reads_mode(node) && setting(from, node) == setting(to, node))
}

fn report(
    (from, way): (&PlannedMode, &PlannedExit),
    (mode, exit): (&PlannedMode, &PlannedExit),
    period: i64,
) -> Diagnostic {
    let (name, key) = (&mode.name, exit.kind.key());
    let after = match exit.lasts {
        lasts if lasts <= period => "right".to_owned(),
        lasts => format!("about {} ms", lasts as f64 / 1e6),
    };
    let message = format!(
        "mode `{name}` ends {after} after it begins: it begins when {}, and `{key}` ends it when {}",
        way.text, exit.text
    );
    let note = format!("leads from `{}` to `{name}`", from.name);
    let time = if exit.lasts == 0 { "add a time to" } else { "write a longer time in" };
    let help = format!("{time} `{key}`, for example `for_ms = 1000`, or let it test something else");
    Diagnostic::new(Code::ImmediateExit, exit.span.clone(), message).note(way.span.clone(), note).help(help)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::plan::WatchedPort;
    use crate::graph::syntax::ExitKind;

    #[test]
    fn an_exit_that_waits_anew_for_long_is_not_immediate() {
        const PORT: WatchedPort =
            WatchedPort { source: PortRef { producer: Producer::Node(0), port: 0 }, feature: None };
        let exit = |lasts_ms: i64| PlannedExit {
            kind: ExitKind::Go,
            to: None,
            condition: Condition::Port(PORT, Test::Is(PortState::True)),
            lasts: lasts_ms * 1_000_000,
            priority: 0,
            text: String::new(),
            span: 0..0,
        };
        // How long the way in and the exit wait, and the period [ms].
        let cases = [
            (40, 40, 4, true),
            (40, 44, 4, false),
            (0, 4, 4, true),
            (0, 8, 4, false),
            (100, 96, 4, true),
            (100, 100, 4, false),
            (500, 200, 4, false),
            (0, 50, 100, true),
        ];
        for (way, waits, period, expected) in cases {
            let found = is_short(&exit(way), &exit(waits), period * 1_000_000);
            assert_eq!(found, expected, "{way} {waits} {period}");
        }
    }
}
