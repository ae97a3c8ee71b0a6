//! Runs one node: decides when it steps, when its outputs are absent and when its state is reset.

use crate::node::{AnyNode, Bus, Components, Need, PortId, Tick, Wires};
use crate::signal::Stamp;

/// An input other than a required trigger, which the runner checks before each step.
#[derive(Debug, Clone, Copy)]
struct InputWatch {
    mark: u32,
    lag: u64,
    is_trigger: bool,
    is_required: bool,
}

impl InputWatch {
    /// Watches the port with that mark for an input declared with `need`.
    fn new(need: Need, mark: u32) -> Self {
        Self { mark, lag: u64::from(need.is_delayed), is_trigger: need.is_trigger, is_required: need.must_be_present }
    }
}

/// A wire with a maximum age: an older value is absent for its node.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AgedWire {
    /// Mark of the source port.
    pub(crate) from: u32,
    /// Mark that the node sees instead.
    pub(crate) to: u32,
    /// Maximum age [ns].
    pub(crate) max_age: i64,
}

impl AgedWire {
    /// Whether the value is present and too old at `now` [ns].
    pub(crate) fn is_stale(&self, bus: &Bus, now: i64) -> bool {
        let mark = &bus.marks[self.from as usize];
        mark.is_present() && mark.stamp().age(now) > self.max_age
    }

    /// Copies the source's mark, or makes the value absent for the node if it is too old.
    fn pass(&self, bus: &mut Bus, tick: &Tick) {
        let from = bus.marks[self.from as usize];
        if from.is_present() && !self.is_stale(bus, tick.now) {
            bus.marks[self.to as usize] = from;
        } else {
            bus.marks[self.to as usize].lose(tick.index);
        }
    }
}

/// A node with its wires and output ports.
pub(crate) struct NodeRunner {
    node: Box<dyn AnyNode>,
    wires: Wires,
    outputs: Box<[PortId]>,
    /// Marks of the required triggers. Most inputs are required triggers, so they have their own, faster loop.
    required: Box<[u32]>,
    others: Box<[InputWatch]>,
    aged: Box<[AgedWire]>,
    is_every_tick: bool,
    /// Whether the configuration has changed since the last step.
    is_switched: bool,
    /// See [`Tick::is_overruled`].
    pub(crate) is_overruled: bool,
    state: RunState,
}

/// Whether the node can step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum RunState {
    /// Every required input is present.
    Ready,
    /// A required input is absent since that time [ns].
    Starved(i64),
    /// A required input is absent, and the node has been reset.
    Reset,
    /// The node panicked at that time [ns]. It does not step before its reset.
    Panicked(i64),
}

impl NodeRunner {
    /// Creates a runner. `inputs` lists the need and the source ports of each input.
    pub(crate) fn new(
        node: Box<dyn AnyNode>,
        inputs: &[(Need, Vec<PortId>)],
        outputs: Vec<PortId>,
        is_every_tick: bool,
    ) -> Self {
        let all = || inputs.iter().flat_map(|(need, ports)| ports.iter().map(|port| (*need, port.mark)));
        // A delayed input closes a loop. As a trigger it would wake the node with the node's own output and pass on the
        // old stamp in every round. So it is a trigger only for a node that has no other.
        let is_woken = all().any(|(need, _)| need.is_trigger && !need.is_delayed);
        let is_required = |need: &Need| need.must_be_present && need.is_trigger;
        let (required, others) = (all().filter(|(need, _)| is_required(need)), all());
        let others = others.filter(|(need, _)| !(is_required(need) || is_woken && need.is_delayed));
        Self {
            node,
            wires: Wires::new(inputs),
            outputs: outputs.into(),
            required: required.map(|(_, mark)| mark).collect(),
            others: others.map(|(need, mark)| InputWatch::new(need, mark)).collect(),
            aged: Box::default(),
            is_every_tick,
            is_switched: false,
            is_overruled: false,
            state: RunState::Ready,
        }
    }

    /// Adds the wires that have a maximum age.
    pub(crate) fn with_aged(self, aged: Vec<AgedWire>) -> Self {
        Self { aged: aged.into(), ..self }
    }

    /// Sets the output components that any node reads; the node may skip the others.
    pub(crate) fn want(&mut self, used: &[Components]) {
        self.node.want(used);
    }

    /// Switches to another configuration of the node and keeps its state. The node steps in the next tick even without
    /// a new sample: with a slow sensor, the motion of the previous mode would go on otherwise.
    pub(crate) fn switch(&mut self, configuration: usize) {
        self.is_switched |= self.node.switch(configuration);
    }

    /// Exchanges all configurations with those of another node of the same type. It keeps its state, and uses the new
    /// configuration in its next step.
    pub(crate) fn exchange(&mut self, other: &mut dyn AnyNode) {
        // Both were built from the same block, so they have as many configurations.
        let is_same = self.node.exchange(other);
        debug_assert!(is_same, "another node than that of this place");
    }

    /// Steps the node if a trigger is new or lost, or makes its outputs absent if a required input is. Sets the tick's
    /// stamp to the oldest stamp of the triggers.
    // A call for each node, and for its inputs and outputs, costs 700 instructions of a tick: see `.ci/instructions`.
    #[inline(always)]
    pub(crate) fn visit(&mut self, tick: &mut Tick, bus: &mut Bus) {
        for aged in &self.aged {
            aged.pass(bus, tick);
        }
        let is_switched = std::mem::take(&mut self.is_switched);
        let (mut is_woken, mut is_missing, mut stamp) = (self.is_every_tick | is_switched, false, Stamp::TIMELESS);
        for mark in self.required.iter().map(|mark| &bus.marks[*mark as usize]) {
            is_woken |= mark.changed_in(tick.index);
            is_missing |= !mark.is_present();
            stamp = stamp.oldest(mark.stamp());
        }
        for watch in &self.others {
            let mark = &bus.marks[watch.mark as usize];
            let is_present = mark.is_present();
            is_woken |= mark.changed_in(tick.index.wrapping_sub(watch.lag)) & (watch.is_trigger | !is_present);
            is_missing |= watch.is_required & !is_present;
            if watch.is_trigger & is_present {
                stamp = stamp.oldest(mark.stamp());
            }
        }
        if is_missing {
            self.lose_outputs(tick, bus);
        } else {
            if self.state != RunState::Ready && !self.recover(tick) {
                return;
            }
            if is_woken {
                (tick.stamp, tick.is_overruled) = (stamp, self.is_overruled);
                self.node.step(tick, bus, &self.wires, &self.outputs);
            }
        }
    }

    /// Makes the node ready again; returns `false` if it still waits for its reset after a panic.
    ///
    /// Resets a node whose input was absent for at least `reset_after`. This is checked here too because a slow graph
    /// may not have ticked during the absence.
    #[cold]
    fn recover(&mut self, tick: &Tick) -> bool {
        match self.state {
            RunState::Starved(since) | RunState::Panicked(since) if tick.now - since >= tick.reset_after => {
                self.node.reset();
            }
            RunState::Panicked(_) => return false,
            RunState::Ready | RunState::Starved(_) | RunState::Reset => {}
        }
        self.state = RunState::Ready;
        true
    }

    /// Whether the node writes this port.
    pub(crate) fn writes(&self, port: PortId) -> bool {
        self.outputs.iter().any(|output| output.mark == port.mark)
    }

    /// Returns what the node has found out so far.
    pub(crate) fn found(&self) -> Option<String> {
        self.node.found()
    }

    /// Notes that a device behind the node was lost and may be opened again.
    pub(crate) fn returned(&mut self) {
        self.node.returned();
    }

    /// Notes that the node panicked at `now` [ns]. It does not step before its reset.
    pub(crate) const fn set_panicked(&mut self, now: i64) {
        self.state = RunState::Panicked(now);
    }

    /// Whether the node waits for its reset after a panic.
    pub(crate) fn has_panicked(&self) -> bool {
        matches!(self.state, RunState::Panicked(_))
    }

    /// Whether the node can take its zero anew, by its inputs as of the last tick; `None` if it keeps none.
    pub(crate) fn can_tare(&self, tick: &Tick, bus: &Bus) -> Option<Result<(), String>> {
        self.node.can_tare(tick, bus, &self.wires)
    }

    /// Makes the node take its zero anew.
    pub(crate) fn tare(&mut self) {
        self.node.tare();
    }

    /// Resets the state of the node.
    pub(crate) fn reset(&mut self) {
        self.node.reset();
    }

    /// Makes the outputs absent. Resets the node once, when a required input has been absent for `reset_after`.
    #[cold]
    fn lose_outputs(&mut self, tick: &Tick, bus: &mut Bus) {
        match self.state {
            RunState::Ready => {
                self.node.lose(tick.index, bus, &self.outputs);
                self.state = RunState::Starved(tick.now);
            }
            RunState::Starved(since) | RunState::Panicked(since) if tick.now - since >= tick.reset_after => {
                self.node.reset();
                self.state = RunState::Reset;
            }
            RunState::Starved(_) | RunState::Reset | RunState::Panicked(_) => {}
        }
    }
}
