//! One node in its place: when it steps, what its absence does, and when its state is reset.

use crate::node::{AnyNode, Bus, Components, Need, PortId, Tick, Wires};
use crate::signal::Stamp;

/// What a runner looks at before it steps its node, beside the required triggers.
#[derive(Debug, Clone, Copy)]
struct Watch {
    mark: u32,
    lag: u64,
    is_trigger: bool,
    is_required: bool,
}

impl Watch {
    /// How an input declared with `need` watches the port with that mark.
    fn new(need: Need, mark: u32) -> Self {
        Self { mark, lag: u64::from(need.is_delayed), is_trigger: need.is_trigger, is_required: need.must_be_present }
    }
}

/// A wire that may grow only so old: past that, its node does without.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Aged {
    /// Mark of the port that it comes from.
    pub(crate) from: u32,
    /// Mark that its node sees instead.
    pub(crate) to: u32,
    /// How old it may be [ns].
    pub(crate) max_age: i64,
}

impl Aged {
    /// Whether what is there is too old at `now` [ns].
    pub(crate) fn is_stale(&self, bus: &Bus, now: i64) -> bool {
        let mark = &bus.marks[self.from as usize];
        mark.is_present() && mark.stamp().age(now) > self.max_age
    }

    /// Passes the mark on, or lets the value go.
    fn pass(&self, bus: &mut Bus, tick: &Tick) {
        let from = bus.marks[self.from as usize];
        if from.is_present() && !self.is_stale(bus, tick.now) {
            bus.marks[self.to as usize] = from;
        } else {
            bus.marks[self.to as usize].lose(tick.index);
        }
    }
}

/// A node with its wires, its ports and what it watches.
pub(crate) struct NodeRunner {
    node: Box<dyn AnyNode>,
    wires: Wires,
    outputs: Box<[PortId]>,
    /// Marks of the required triggers: what most inputs are, so they have a loop of their own.
    required: Box<[u32]>,
    others: Box<[Watch]>,
    aged: Box<[Aged]>,
    is_every_tick: bool,
    /// Whether the node has another configuration, and has not stepped with it yet.
    is_switched: bool,
    absence: Absence,
}

/// Whether something required is absent, and since when.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Absence {
    Nothing,
    Since(i64),
    Reset,
    /// The node panicked at that time: it is not stepped before it is reset.
    Broken(i64),
}

impl NodeRunner {
    /// A node whose inputs are wired to ports that exist: for each input its need and its ports.
    pub(crate) fn new(
        node: Box<dyn AnyNode>,
        inputs: &[(Need, Vec<PortId>)],
        outputs: Vec<PortId>,
        is_every_tick: bool,
    ) -> Self {
        let all = || inputs.iter().flat_map(|(need, ports)| ports.iter().map(|port| (*need, port.mark)));
        // A delayed input closes a loop: there it would wake the node with what the node itself has made, and hold its
        // stamp back for ever. So it wakes only a node that nothing else wakes.
        let is_woken = all().any(|(need, _)| need.is_trigger && !need.is_delayed);
        let is_required = |need: &Need| need.must_be_present && need.is_trigger;
        let (required, others) = (all().filter(|(need, _)| is_required(need)), all());
        let others = others.filter(|(need, _)| !(is_required(need) || is_woken && need.is_delayed));
        Self {
            node,
            wires: Wires::new(inputs),
            outputs: outputs.into(),
            required: required.map(|(_, mark)| mark).collect(),
            others: others.map(|(need, mark)| Watch::new(need, mark)).collect(),
            aged: Box::default(),
            is_every_tick,
            is_switched: false,
            absence: Absence::Nothing,
        }
    }

    /// The same with wires that may grow only so old.
    pub(crate) fn with_aged(self, aged: Vec<Aged>) -> Self {
        Self { aged: aged.into(), ..self }
    }

    /// Tells the node which components of its outputs anything reads.
    pub(crate) fn want(&mut self, wanted: &[Components]) {
        self.node.want(wanted);
    }

    /// Goes on with another configuration of the node; its state stays. It steps with what it has, and does not wait for
    /// the next sample: a slow sensor must not keep the motion of the mode before.
    pub(crate) fn switch(&mut self, configuration: usize) {
        self.is_switched |= self.node.switch(configuration);
    }

    /// Steps the node if a trigger is new or lost, and makes its outputs absent if something required is. The tick's
    /// stamp becomes the oldest of the triggers'.
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
            self.starve(tick, bus);
        } else {
            if self.absence != Absence::Nothing && !self.come_back(tick) {
                return;
            }
            if is_woken {
                tick.stamp = stamp;
                self.node.step(tick, bus, &self.wires, &self.outputs);
            }
        }
    }

    /// Ends an absence, if it may end. A slow graph may not have ticked while it lasted, so whether it was long is asked
    /// here too.
    #[cold]
    fn come_back(&mut self, tick: &Tick) -> bool {
        match self.absence {
            Absence::Since(since) | Absence::Broken(since) if tick.now - since >= tick.reset_after => self.node.reset(),
            Absence::Broken(_) => return false,
            Absence::Nothing | Absence::Since(_) | Absence::Reset => {}
        }
        self.absence = Absence::Nothing;
        true
    }

    /// The node panicked: from now on it is not stepped until it is reset.
    pub(crate) const fn break_down(&mut self, now: i64) {
        self.absence = Absence::Broken(now);
    }

    /// Whether the node waits for its reset after a panic.
    pub(crate) fn is_broken(&self) -> bool {
        matches!(self.absence, Absence::Broken(_))
    }

    /// Makes the state fresh.
    pub(crate) fn reset(&mut self) {
        self.node.reset();
    }

    /// Makes the outputs absent; resets the state once, when that has lasted.
    #[cold]
    fn starve(&mut self, tick: &Tick, bus: &mut Bus) {
        match self.absence {
            Absence::Nothing => {
                self.node.lose(tick.index, bus, &self.outputs);
                self.absence = Absence::Since(tick.now);
            }
            Absence::Since(since) | Absence::Broken(since) if tick.now - since >= tick.reset_after => {
                self.node.reset();
                self.absence = Absence::Reset;
            }
            Absence::Since(_) | Absence::Reset | Absence::Broken(_) => {}
        }
    }
}
