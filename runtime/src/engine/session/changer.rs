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
        let spacing = SPACING * engine.period() as f64 * 1e-9;
        let lead = (LEAD_S / (engine.period() as f64 * 1e-9)) as usize;
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
        let at = self.find(name, value)?;
        let targets = self.fronts.iter().enumerate().map(|(i, [_, target])| if i == at { value } else { *target });
        let live = self.plan.params.iter().map(|param| param.name.clone()).zip(targets).collect();
        let request = Request { live, ..self.request.clone() };
        if let Err(report) = (self.check)(&request) {
            return Err(format!("`{name}` cannot be {value}: {}", report.render(false)));
        }
        self.fronts[at][1] = value;
        Ok(())
    }

    /// Frees old configurations, and builds steps until enough of them wait or every parameter has its value.
    ///
    /// # Errors
    /// Returns why a node refuses a value. Its parameters then stay where they are.
    pub fn prepare(&mut self) -> Result<(), String> {
        while self.back.pop().is_ok() {}
        while MAX_STEPS - self.steps.slots() < self.lead {
            let Some(step) = self.next_step()? else { break };
            // There is room, and without an engine nobody misses the step.
            let _ = self.steps.push(step);
        }
        Ok(())
    }

    /// Builds the next step, or returns `None` if every parameter has its value.
    fn next_step(&mut self) -> Result<Option<Step>, String> {
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
                Err(why)
            }
        }
    }
}
