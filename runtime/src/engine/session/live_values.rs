//! The values of the parameters that may change while the graph runs: the side of a change that runs in the tick.
//!
//! A change walks to its target in steps. Each step is a node that was built again off the tick. The tick exchanges its
//! configurations with those of the running node, and sends the old ones back, so that it neither allocates nor frees.

use std::collections::BTreeSet;
use std::sync::Arc;

use rtrb::{Consumer, Producer};

use super::inputs::InputLog;
use crate::engine::core::Core;
use crate::graph::{LiveParam, LivePlan};
use crate::node::AnyNode;

/// Number of changes that are kept for the summary and the recording.
const MAX_CHANGES: usize = 10_000;

/// A change of a parameter that has begun.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ValueChange {
    /// Time of the tick [ns].
    pub time: i64,
    /// Number of that tick.
    pub tick: u64,
    /// Number of the parameter, in the order of `[live]`.
    pub param: usize,
    /// The value before that tick.
    pub from: f64,
    /// The value at the end of the change.
    pub to: f64,
}

/// A parameter that may change while the graph runs, and its value.
#[derive(Debug, Clone, Copy)]
pub struct LiveValue<'e> {
    /// Its name, unit, range and rate.
    pub param: &'e LiveParam,
    /// The value in the last tick.
    pub value: f64,
    /// The value toward which it moves.
    pub target: f64,
}

/// Nodes, each with its place in step order.
type PlacedNodes = Vec<(usize, Box<dyn AnyNode>)>;

/// What changes in one tick.
pub(super) struct Step {
    /// The nodes as they were built again; their old configurations afterwards.
    pub(super) nodes: PlacedNodes,
    /// Numbers of parameters, each with its value and the value toward which it moves.
    pub(super) values: Vec<(usize, [f64; 2])>,
}

/// The ends of the two rings in the tick.
struct Rings {
    steps: Consumer<Step>,
    back: Producer<Step>,
    /// Shortest tick that takes a step [s].
    spacing: f64,
}

/// The values of the parameters that may change.
pub(crate) struct LiveValues {
    pub(super) plan: Arc<LivePlan>,
    /// The value in the last tick of each parameter, and the value toward which it moves.
    values: Vec<[f64; 2]>,
    rings: Option<Rings>,
    /// The step of a tick that is replayed.
    replayed: Option<Step>,
    changes: Vec<ValueChange>,
}

impl LiveValues {
    pub(super) fn new(plan: LivePlan) -> Self {
        let changes = Vec::with_capacity(if plan.params.is_empty() { 0 } else { MAX_CHANGES });
        let values = plan.params.iter().map(|param| [param.value; 2]).collect();
        Self { plan: Arc::new(plan), values, rings: None, replayed: None, changes }
    }

    /// Takes steps from a ring from now on, at most one in each tick that is not shorter than `spacing` [s].
    pub(super) fn connect(&mut self, steps: Consumer<Step>, back: Producer<Step>, spacing: f64) {
        self.rings = Some(Rings { steps, back, spacing });
    }

    /// Builds the step of a tick that is replayed.
    ///
    /// # Errors
    /// Returns a message if the graph does not list a parameter, or the node refuses the value.
    pub(super) fn replay(&mut self, recorded: &[(String, [f64; 2])]) -> Result<(), String> {
        if recorded.is_empty() {
            return Ok(());
        }
        let mut numbers: Vec<f64> = self.values.iter().map(|[value, _]| *value).collect();
        let mut values = Vec::new();
        for (name, value) in recorded {
            let Some(at) = self.plan.params.iter().position(|param| param.name == *name) else {
                return Err(format!("the run changes `{name}`, which the graph does not list in [live]"));
            };
            values.push((at, *value));
            numbers[at] = value[0];
        }
        self.replayed = Some(self.plan.step(values, &numbers)?);
        Ok(())
    }

    /// Returns the parameters and their values, in the order of `[live]`.
    pub(super) fn iter(&self) -> impl Iterator<Item = LiveValue<'_>> {
        let values = self.plan.params.iter().zip(&self.values);
        values.map(|(param, [value, target])| LiveValue { param, value: *value, target: *target })
    }

    /// Returns the changes so far.
    pub(super) fn changes(&self) -> &[ValueChange] {
        &self.changes
    }

    /// Takes the step of this tick, if there is one.
    pub(super) fn take(&mut self, core: &mut Core, log: Option<&mut InputLog>) {
        if let Some(mut step) = self.replayed.take() {
            self.carry_out(&mut step, core, log);
            return;
        }
        let Some(mut rings) = self.rings.take() else { return };
        // Without room for the old configurations, the change waits.
        if core.tick.dt >= rings.spacing
            && rings.back.slots() > 0
            && let Ok(mut step) = rings.steps.pop()
        {
            self.carry_out(&mut step, core, log);
            // There is room.
            let _ = rings.back.push(step);
        }
        self.rings = Some(rings);
    }

    fn carry_out(&mut self, step: &mut Step, core: &mut Core, mut log: Option<&mut InputLog>) {
        for (place, node) in &mut step.nodes {
            core.exchange(*place, &mut **node);
        }
        for (param, value) in &step.values {
            let old = std::mem::replace(&mut self.values[*param], *value);
            if old[1].to_bits() != value[1].to_bits() && self.changes.len() < MAX_CHANGES {
                let (time, tick) = (core.tick.now, core.tick.index);
                self.changes.push(ValueChange { time, tick, param: *param, from: old[0], to: value[1] });
            }
            if let Some(log) = &mut log {
                log.value(&self.plan.params[*param].name, *value);
            }
        }
    }
}

impl LivePlan {
    /// Builds a step: the nodes of the parameters that it changes, with a value of each parameter.
    ///
    /// # Errors
    /// The mistakes of a node.
    pub(super) fn step(&self, changed: Vec<(usize, [f64; 2])>, values: &[f64]) -> Result<Step, String> {
        let recipes: BTreeSet<usize> = changed.iter().map(|(param, _)| self.params[*param].recipe).collect();
        let node = |recipe: usize| Ok((self.recipes[recipe].place, self.build(recipe, values)?));
        let nodes = recipes.into_iter().map(node).collect::<Result<PlacedNodes, String>>()?;
        Ok(Step { nodes, values: changed })
    }
}
