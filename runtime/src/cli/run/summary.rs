//! What a run prints at its end: modes and halts, the ports that the graph shows or all ports, and limits.

use std::fmt::Write;

use super::events::events;
use super::held::{LimitWatch, chatter};
use super::lateness::lateness;
use super::ports::{PortTable, node_times};
use super::status::status;
use crate::cli::text::prose::PageStyle;
use crate::cli::view::RunView;
use crate::engine::{Counters, End, Engine, Outcome, TaskEnd, TaskRun};
use crate::source::quoted;

/// Maximum number of bins of a curve on the terminal: two for each character of the widest page.
const MAX_BINS: usize = 256;

/// Collects the summary tick by tick.
pub(crate) struct Summary {
    limits: LimitWatch,
    body: Body,
    /// Whether it ends with the option that shows more.
    has_hint: bool,
}

/// The main part of a summary.
enum Body {
    /// The ports that the graph shows.
    View(Box<RunView>),
    /// All ports.
    Ports(PortTable),
}

impl Summary {
    /// Creates a summary of all ports, or of those that the graph shows. `start` is the warning about where the arm starts.
    pub(crate) fn new(engine: &Engine, has_all_ports: bool, start: Option<String>) -> Self {
        let body = match has_all_ports {
            true => Body::Ports(PortTable::new(engine)),
            false => Body::View(Box::new(RunView::new(engine, MAX_BINS))),
        };
        Self { limits: LimitWatch::new(engine, start), body, has_hint: true }
    }

    /// Leaves out the option that shows more, for a page on which nobody types it.
    pub(crate) fn without_hint(self) -> Self {
        Self { has_hint: false, ..self }
    }

    /// Adds the last tick of the engine.
    pub(crate) fn add(&mut self, engine: &Engine) {
        self.limits.add(engine);
        match &mut self.body {
            Body::View(view) => view.add(engine),
            Body::Ports(ports) => ports.add(engine),
        }
    }

    /// Returns the parts of the view that is drawn during the run, the most important one first.
    pub(crate) fn live(&self, engine: &Engine, style: PageStyle) -> Vec<String> {
        let view = match &self.body {
            Body::View(view) => view.live(style),
            Body::Ports(_) => Vec::new(),
        };
        status(engine, &self.limits).into_iter().chain(view).collect()
    }

    /// Writes the summary.
    pub(crate) fn render(&self, engine: &Engine, outcome: &Outcome, style: PageStyle) -> String {
        let (events, limits) = (events(engine, outcome.time), self.limits.table(outcome.time));
        let parts = match &self.body {
            Body::View(view) => [events, view.page(style), limits],
            Body::Ports(ports) => [ports.render(engine), node_times(engine, outcome), events + &limits],
        };
        let parts = parts.iter().map(|part| part.trim_end()).filter(|part| !part.is_empty());
        let mut text = parts.collect::<Vec<_>>().join("\n\n");
        if !text.is_empty() {
            text.push('\n');
        }
        // Writing to a string cannot fail.
        let has_failed = matches!(outcome.end, End::Fault(_)) || !engine.rests().is_empty();
        for line in self.limits.cause(engine).into_iter().filter(|_| has_failed) {
            let _ = writeln!(text, "{line}");
        }
        let chatters = engine.tasks().iter().filter_map(|task| chatter(&task.changes()));
        for warning in self.limits.warnings(outcome.time).into_iter().chain(chatters) {
            let _ = writeln!(text, "{warning}");
        }
        for ((port, _), counters) in engine.ports().iter().zip(engine.counters()) {
            let irregular = irregular_samples(counters);
            if !irregular.is_empty() {
                let _ = writeln!(text, "samples of `{}`: {irregular}", port.name);
            }
        }
        for (node, found) in engine.findings().filter(|(node, _)| !is_fault(engine, outcome, node)) {
            let _ = writeln!(text, "`{node}`: {found}");
        }
        for (device, counts) in engine.counts().filter(|(_, counts)| !counts.is_empty()) {
            let counts: Vec<String> = counts.iter().map(|(what, count)| format!("{count} {what}")).collect();
            let _ = writeln!(text, "device `{device}`: {}", counts.join(", "));
        }
        if engine.commanded().len() > 1 {
            let _ = writeln!(text, "collisions between {} are not checked", quoted(engine.commanded()));
        }
        if !engine.uncalibrated().is_empty() {
            let names = engine.uncalibrated().join("`, `");
            let _ = writeln!(text, "nothing was limited in newtons: the limits of `{names}` are raw readings");
        }
        for warning in engine.allowed() {
            let _ = writeln!(text, "{warning}");
        }
        let lateness = lateness(engine);
        if !lateness.is_empty() && !text.is_empty() {
            text.push('\n');
        }
        text += &lateness;
        if outcome.late > 0 {
            let _ = writeln!(text, "{} ticks started more than one period late", outcome.late);
        }
        if let Body::View(_) = self.body
            && self.has_hint
        {
            let _ = writeln!(text, "`--ports` prints all ports and the time of each node");
        }
        text
    }
}

/// Whether a fault of a node has ended the run or a task: then it is printed with that end.
fn is_fault(engine: &Engine, outcome: &Outcome, node: &str) -> bool {
    let of_run = matches!(&outcome.end, End::Fault(fault) if fault.node == node);
    let mut tasks = engine.tasks().iter().map(TaskRun::end);
    of_run || tasks.any(|end| matches!(end, Some(TaskEnd::Failed(fault)) if fault.node == node))
}

/// Describes the irregular samples of a port.
fn irregular_samples(counters: &Counters) -> String {
    let counts = [
        (counters.repeated, "repeated"),
        (counters.gaps, "missing in the sequence"),
        (counters.late, "more than one period late"),
        (counters.went_back, "dropped because their stamp is older than the last"),
        (counters.ahead, "dropped because their stamp is in the future"),
        (counters.not_finite, "dropped because they are not finite"),
    ];
    let counts = counts.into_iter().filter(|(count, _)| *count > 0);
    counts.map(|(count, what)| format!("{count} {what}")).collect::<Vec<_>>().join(", ")
}
