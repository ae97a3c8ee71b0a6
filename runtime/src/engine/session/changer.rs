//! Changes parameters while the graph runs: the side of a change that runs off the tick.
//!
//! The whole graph is checked with the new value, from the files as they were when the run began. Then the node is built
//! again once for each step of the way from the old value to the new one, and the steps wait in a ring for the tick.

use std::sync::Arc;

use rtrb::{Consumer, Producer, RingBuffer};

use super::engine::Engine;
use super::live_values::Step;
use crate::graph::{LivePlan, RecordedGraph, Request};
use crate::source::{Report, suggestion};

/// Smallest and largest number of steps that wait for the tick.
const MIN_STEPS: usize = 4;
const MAX_STEPS: usize = 128;
/// Time for which steps are built ahead [s]: a second change of a parameter waits for them.
const LEAD_S: f64 = 0.04;
/// Length of the shortest tick that takes a step, in periods: the clock of a live device is not exact.
const SPACING: f64 = 0.8;

/// A check of a whole graph, which is called while it runs.
type GraphCheck<'c> = dyn Fn(&Request) -> Result<(), Report> + Send + 'c;

/// The way of a parameter from its value to another one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Walk {
    /// The value at its start.
    pub from: f64,
    /// The value at its end.
    pub to: f64,
    /// Its time, with a clock whose ticks are not shorter than its period [s].
    pub seconds: f64,
}

/// Changes the parameters that a graph lists in `[live]` while it runs.
pub struct Changer<'c> {
    /// Checks a whole graph.
    check: Box<GraphCheck<'c>>,
    request: Request,
    plan: Arc<LivePlan>,
    /// The value of each parameter in the last step that was built, and the value toward which it moves.
    fronts: Vec<[f64; 2]>,
    steps: Producer<Step>,
    back: Consumer<Step>,
    /// Nominal time between two ticks [s].
    period: f64,
    /// Shortest tick that takes a step [s].
    spacing: f64,
    /// Number of steps that wait for the tick at most.
    lead: usize,
}

impl<'c> Changer<'c> {
    /// Connects to an engine that was made from a request. `check` checks a whole graph, as
    /// [`compile`](crate::graph::compile) does. An engine follows the changer that was connected last.
    ///
    /// # Errors
    /// If a file of the graph cannot be read again.
    pub fn new(
        engine: &mut Engine,
        request: &Request,
        check: impl Fn(&Request) -> Result<(), Report> + Send + 'c,
    ) -> Result<Self, String> {
        let files = Some(Arc::new(engine.sources().attach()?));
        let recorded = RecordedGraph { devices: engine.recorded_devices(), files };
        let request = Request { recorded: Some(Arc::new(recorded)), ..request.clone() };
        let (steps, of_engine) = RingBuffer::new(MAX_STEPS);
        let (to_free, back) = RingBuffer::new(MAX_STEPS);
        let period = engine.period() as f64 * 1e-9;
        let spacing = SPACING * period;
        let lead = (LEAD_S / period) as usize;
        let lead = lead.clamp(MIN_STEPS, MAX_STEPS);
        let fronts = engine.live_values().map(|live| [live.value; 2]).collect();
        engine.live.connect(of_engine, to_free, spacing);
        Ok(Self {
            check: Box::new(check),
            request,
            plan: Arc::clone(&engine.live.plan),
            fronts,
            steps,
            back,
            period,
            spacing,
            lead,
        })
    }

    /// Checks the name and the range of a change, without the rest of the graph. Returns the number of the parameter.
    ///
    /// # Errors
    /// Returns why the change is refused.
    pub fn find(&self, name: &str, value: f64) -> Result<usize, String> {
        let params = &self.plan.params;
        if params.is_empty() {
            return Err(format!(
                "`{name}` cannot change while the graph runs: the graph lists no parameter in [live]; \
                 `--set nodes.{name}={value}` starts a run with the value"
            ));
        }
        let Some(at) = params.iter().position(|param| param.name == name) else {
            let known = suggestion(name, params.iter().map(|param| param.name.as_str()), "parameters in [live]");
            return Err(format!("`{name}` cannot change while the graph runs: [live] does not list it; {known}"));
        };
        let (min, max) = (params[at].min, params[at].max);
        if (min..=max).contains(&value) {
            Ok(at)
        } else {
            Err(format!("`{name}` cannot be {value}: [live] allows {min} to {max}"))
        }
    }

    /// Begins a change: the parameter moves to the value, not faster than its rate.
    ///
    /// # Errors
    /// Returns why the change is refused; nothing changes then.
    pub fn set(&mut self, name: &str, value: f64) -> Result<(), String> {
        self.set_all(&[(name.to_owned(), value)]).map(drop)
    }

    /// Begins several changes at once, which are checked together. Returns the way of each.
    ///
    /// # Errors
    /// Returns why one of them is refused; nothing changes then.
    pub fn set_all(&mut self, values: &[(String, f64)]) -> Result<Vec<Walk>, String> {
        let mut targets: Vec<f64> = self.fronts.iter().map(|[_, target]| *target).collect();
        let found: Result<Vec<usize>, String> = values.iter().map(|(name, value)| self.find(name, *value)).collect();
        let found = found?;
        found.iter().zip(values).for_each(|(at, (_, value))| targets[*at] = *value);
        let names = self.plan.params.iter().map(|param| param.name.clone());
        let request = Request { live: names.zip(targets.iter().copied()).collect(), ..self.request.clone() };
        if let Err(report) = (self.check)(&request) {
            let all: Vec<String> = values.iter().map(|(name, value)| format!("`{name}` cannot be {value}")).collect();
            return Err(format!("{}: {}", all.join(", "), report.render(false)));
        }
        self.fronts.iter_mut().zip(targets).for_each(|(front, target)| front[1] = target);
        Ok(found.into_iter().map(|at| self.walk(at)).collect())
    }

    /// Returns the way of a parameter to its target.
    fn walk(&self, at: usize) -> Walk {
        let [from, to] = self.fronts[at];
        let waiting = (MAX_STEPS - self.steps.slots()) as f64;
        let steps = ((to - from).abs() / (self.plan.params[at].rate * self.spacing)).ceil();
        Walk { from, to, seconds: if from == to { 0.0 } else { (waiting + steps) * self.period } }
    }

    /// Returns the value toward which each parameter moves, in the order of `[live]`.
    pub(super) fn targets(&self) -> impl Iterator<Item = f64> {
        self.fronts.iter().map(|[_, target]| *target)
    }

    /// Whether a parameter is on its way to its target.
    pub(super) fn is_moving(&self) -> bool {
        self.fronts.iter().any(|[value, target]| value.to_bits() != target.to_bits())
    }

    /// Frees old configurations, and builds steps until enough of them wait or every parameter has its value.
    ///
    /// # Errors
    /// Returns why a node refuses a value. Its parameters then stay where they are.
    pub fn prepare(&mut self) -> Result<(), String> {
        while self.back.pop().is_ok() {}
        while MAX_STEPS - self.steps.slots() < self.lead {
            let (step, refused) = match self.next_step() {
                Ok(None) => break,
                Ok(Some(step)) => (step, Ok(())),
                Err((stays, why)) => (stays, Err(why)),
            };
            // There is room, and without an engine nobody misses the step.
            let _ = self.steps.push(step);
            refused?;
        }
        Ok(())
    }

    /// Builds the next step, or returns `None` if every parameter has its value.
    ///
    /// # Errors
    /// Returns why a node refuses a value, and a step that changes no node: its parameters stay where they are.
    fn next_step(&mut self) -> Result<Option<Step>, (Step, String)> {
        let mut values = Vec::new();
        for (at, (param, [value, target])) in self.plan.params.iter().zip(&self.fronts).enumerate() {
            if value.to_bits() != target.to_bits() {
                let longest = param.rate * self.spacing;
                let next =
                    if (target - value).abs() <= longest { *target } else { value + longest.copysign(target - value) };
                // A step that is too small for the number's precision would never end.
                values.push((at, [if next.to_bits() == value.to_bits() { *target } else { next }, *target]));
            }
        }
        if values.is_empty() {
            return Ok(None);
        }
        let mut numbers: Vec<f64> = self.fronts.iter().map(|[value, _]| *value).collect();
        values.iter().for_each(|(at, [value, _])| numbers[*at] = *value);
        let changed: Vec<usize> = values.iter().map(|(at, _)| *at).collect();
        match self.plan.step(values, &numbers) {
            Ok(step) => {
                step.values.iter().for_each(|(at, value)| self.fronts[*at] = *value);
                Ok(Some(step))
            }
            Err(why) => {
                changed.iter().for_each(|at| self.fronts[*at][1] = self.fronts[*at][0]);
                let values = changed.into_iter().map(|at| (at, self.fronts[at])).collect();
                Err((Step { nodes: Vec::new(), values }, why))
            }
        }
    }
}
