//! One cycle of the engine: exchange with the devices, latch, step, commit, and the handling of each trouble.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::blame::owner;
use super::engine::Engine;
use super::trouble::{Trouble, panic_message};
use crate::device::DeviceError;
use crate::engine::core::{DeviceLink, ModeMachine, Transition};
use crate::fault::{Cause, Fault};
use crate::graph::Policy;
use crate::source::suggestion;

impl Engine {
    /// Runs the tick at `now` [ns]: exchange with the devices, then latch, step and commit.
    ///
    /// # Errors
    /// Returns the fault that ends the run. The commands of this tick are not committed.
    pub fn tick(&mut self, now: i64) -> Result<(), Fault> {
        self.exchange(now)?;
        self.step()
    }

    /// Runs the first half of the tick at `now` [ns]: sends the commands of the last tick to the devices and receives
    /// their new samples.
    ///
    /// # Errors
    /// Returns a fault if a device fails or sends a value that is not finite, and the policy for that is `fault`.
    pub fn exchange(&mut self, now: i64) -> Result<(), Fault> {
        let due = self.clock_sample().is_some_and(|sample| sample <= now);
        self.core.begin(now);
        if let Some(by) = self.lateness.take() {
            self.raise(self.policy.deadline, Trouble::Late(by))?;
        }
        let has_sampled = self.exchange_with_devices(now) || due;
        self.check_sizes();
        for i in 0..self.devices.len() {
            if self.devices[i].failed.is_some() {
                self.raise(self.policy.device.0, Trouble::Device(i))?;
            }
        }
        for i in 0..self.core.inlets.len() {
            let inlet = &self.core.inlets[i];
            let device = &self.devices[inlet.device];
            if device.failed.is_none() && inlet.lost(&device.samples).is_some() {
                self.raise(self.policy.device.0, Trouble::Lost(i))?;
            }
        }
        self.schedule.ticked(now, has_sampled);
        if self.schedule.is_on_timer() {
            self.raise(self.policy.clock, Trouble::Clock)?;
        }
        for i in 0..self.core.inlets.len() {
            let inlet = &mut self.core.inlets[i];
            let device = &self.devices[inlet.device];
            if device.failed.is_none() && !inlet.is_finite(&device.samples) {
                inlet.reject(&device.samples);
                self.raise(self.policy.not_finite.0, Trouble::NotFinite(i))?;
            }
        }
        Ok(())
    }

    /// Runs the second half of the tick: latch, step, commit. Without a trouble it neither allocates nor calls the
    /// operating system.
    ///
    /// # Errors
    /// Returns the fault that ends the run. The commands of this tick are not committed.
    pub fn step(&mut self) -> Result<(), Fault> {
        self.core.latch(&mut self.devices);
        self.core.tick.is_resumed = self.halts.resumes;
        if let Some((policy, inlet)) = self.core.stale() {
            self.raise(policy, Trouble::Stale(inlet))?;
        }
        match catch_unwind(AssertUnwindSafe(|| self.core.run(&mut self.timing))) {
            Ok(true) => {}
            Ok(false) => self.on_not_finite()?,
            Err(panic) => self.on_panic(panic_message(&*panic))?,
        }
        self.watch_budgets()?;
        for i in 0..self.watched.len() {
            let wire = &self.watched[i];
            if wire.aged.is_stale(&self.core.bus, self.core.tick.now) {
                self.raise(wire.stale, Trouble::StaleWire(i))?;
            }
        }
        if let Some(runner) = self.core.panicked() {
            self.raise(self.policy.panic.0, Trouble::Panicked(runner))?;
        }
        self.update_halt();
        self.core.tick.is_halted = self.halts.is_halted();
        self.core.commit(&mut self.devices, self.halts.is_halted());
        self.decide()
    }

    /// Raises a trouble of this tick. Of several, the one with the strictest policy is kept.
    fn raise(&mut self, policy: Policy, trouble: Trouble) -> Result<(), Fault> {
        match policy {
            Policy::Count => {}
            Policy::Fault => return Err(self.describe(trouble)),
            Policy::Hold | Policy::Stop => {
                let is_stricter = self.trouble.is_none_or(|(known, _)| policy > known);
                self.trouble = if is_stricter { Some((policy, trouble)) } else { self.trouble };
            }
        }
        Ok(())
    }

    /// Starts a halt if this tick had a trouble, or ends it if the trouble is over.
    fn update_halt(&mut self) {
        let trouble = self.trouble.take();
        if let Some((policy, trouble)) = trouble
            && (self.halts.is_escalated_by(policy) || self.explains_halt(trouble))
        {
            let fault = self.describe(trouble);
            self.halts.halt(policy, fault);
        }
        let resumes = self.halts.update(trouble.is_some(), self.core.tick.now);
        if let Some(modes) = self.modes.as_mut().filter(|_| resumes) {
            modes.restart(&self.core.tick);
            self.core.switch(modes.configurations());
        }
    }

    /// Whether a device has reported why its samples are missing, while the commands are held only for missing samples.
    fn explains_halt(&self, trouble: Trouble) -> bool {
        let last = self.halts.list.last().filter(|halt| halt.until.is_none());
        let is_silence = last.is_some_and(|halt| {
            halt.policy == Policy::Hold && matches!(halt.fault.cause, Cause::SilentClock | Cause::Stale { .. })
        });
        is_silence && matches!(trouble, Trouble::Device(_) | Trouble::Lost(_))
    }

    /// Sends an operator word. `stop` halts the commands and `resume` ends the halt, in upper or lower case; other
    /// words go to the modes.
    ///
    /// # Errors
    /// Returns a message if no mode has a condition on the word, or if the commands wait for `resume`.
    pub fn send(&mut self, word: &str) -> Result<(), String> {
        if word.eq_ignore_ascii_case("stop") {
            self.halts.resumes = false;
            self.trouble = Some((Policy::Stop, Trouble::Operator));
        } else if word.eq_ignore_ascii_case("resume") {
            self.halts.resumes = true;
        } else if !self.words().any(|known| known == word) {
            let known = self.words().collect::<std::collections::BTreeSet<_>>();
            return Err(format!(
                "no mode has a condition on `{word}`: {}",
                suggestion(word, known.into_iter(), "words")
            ));
        } else if self.halts.is_stopped() {
            return Err(format!("`{word}` has no effect while the commands are stopped: send `resume` first"));
        } else {
            self.sent = Some(word.to_owned());
        }
        Ok(())
    }

    /// Returns the operator words that the graph accepts.
    pub fn words(&self) -> impl Iterator<Item = &str> {
        ["stop", "resume"].into_iter().chain(self.modes.iter().flat_map(ModeMachine::words))
    }

    /// Notes that the next tick begins `by` [ns] too late in real time.
    pub fn begin_late(&mut self, by: i64) {
        self.late += 1;
        self.lateness = Some(by);
    }

    /// Evaluates the conditions of the current mode after a tick. While the commands wait for `resume`, the mode stays.
    fn decide(&mut self) -> Result<(), Fault> {
        let sent = self.sent.take();
        let Some(modes) = self.modes.as_mut().filter(|_| !self.halts.is_stopped()) else { return Ok(()) };
        match modes.decide(&self.core.bus, &self.core.tick, sent.as_deref()) {
            Transition::Stay => {}
            Transition::Switched => self.core.switch(modes.configurations()),
            Transition::Done => self.is_done = true,
            Transition::Failed => {
                let ((why, place), name) = (modes.taken(), modes.name().to_owned());
                let (why, place) = (Cause::Mode(why.to_owned()), self.sources.locate(place));
                return Err(self.fault(&name, None, why, place));
            }
        }
        Ok(())
    }

    /// Ramps the commands toward zero for one period and sends them to the devices. Returns whether they are zero.
    ///
    /// A run ends by calling this until it returns `true`, and once more so that the devices receive the zero.
    pub fn wind_down(&mut self) -> bool {
        let now = self.core.tick.now + self.schedule.period();
        self.core.begin(now);
        let is_still = self.core.ramp(&mut self.devices, self.schedule.period() as f64 * 1e-9);
        // A device that fails now does not change why the run ended: it stops by its own timeout.
        self.exchange_with_devices(now);
        is_still
    }

    /// Notifies the stepped devices that the run is over, and why.
    pub(crate) fn finish(&mut self, reason: &str) {
        for device in &mut self.devices {
            if let DeviceLink::Stepped(driver) = &mut device.link {
                // A panic here does not change why the run ended: the device has received its zero command.
                let _ = catch_unwind(AssertUnwindSafe(|| driver.finish(reason)));
            }
        }
    }

    /// Returns the time of the next sample of a stepped clock device [ns].
    fn clock_sample(&self) -> Option<i64> {
        match &self.clock()?.link {
            DeviceLink::Stepped(driver) => driver.next(),
            _ => None,
        }
    }

    /// Sends every device its commands and receives its samples. A device that fails does not keep the others from
    /// their commands. Returns whether a live clock device has sampled.
    fn exchange_with_devices(&mut self, now: i64) -> bool {
        let mut has_sampled = false;
        for i in 0..self.devices.len() {
            let device = &mut self.devices[i];
            match &mut device.link {
                DeviceLink::Stepped(driver) => {
                    let exchange = || driver.exchange(now, &device.commands, &mut device.samples);
                    let result = catch_unwind(AssertUnwindSafe(exchange));
                    let result = result
                        .unwrap_or_else(|panic| Err(DeviceError(format!("it panicked: {}", panic_message(&*panic)))));
                    if let Err(DeviceError(why)) = result {
                        self.lose_device(i, why);
                    }
                }
                DeviceLink::Live(linked) => {
                    linked.send(&device.commands);
                    let is_newer = linked.receive(&mut device.samples);
                    has_sampled |= is_newer && self.schedule.is_clock(i);
                }
                DeviceLink::Idle(_) | DeviceLink::Gone => {}
            }
        }
        has_sampled
    }

    /// Marks every device as failed that sends a value of another size than it has stated.
    fn check_sizes(&mut self) {
        for i in 0..self.core.inlets.len() {
            let inlet = &self.core.inlets[i];
            let device = &self.devices[inlet.device];
            if let Some(sizes) = inlet.misfit(&device.samples).filter(|_| device.failed.is_none()) {
                let port = &self.ports[i].0;
                let [size, stated] = sizes.map(|size| port.shape.kind().size_in_words(size));
                let why = format!("`{}` has {size}, but the device stated {stated}", port.name);
                self.lose_device(inlet.device, why);
            }
        }
    }

    /// Marks a device as failed. The engine does not call it again.
    pub(crate) fn lose_device(&mut self, device: usize, why: String) {
        let device = &mut self.devices[device];
        (device.link, device.failed) = (DeviceLink::Gone, Some(why));
    }

    /// Handles a value that is not finite. Under every policy but `fault`, the outputs of the node and of all nodes
    /// after it become absent, and those nodes are reset.
    #[cold]
    fn on_not_finite(&mut self) -> Result<(), Fault> {
        // Ports are in the order in which nodes write them, so the first that is not finite is the cause of the others.
        let bus = &self.core.bus;
        let is_bad = |port: &usize| {
            let (planned, id) = &self.ports[*port];
            !bus.arenas.is_finite(planned.shape.kind(), id.slot)
        };
        let port = (0..self.ports.len()).find(is_bad).expect("the finite check failed on some port");
        self.raise(self.policy.not_finite.0, Trouble::NotFinite(port))?;
        let runner = self.runner_of(port);
        self.invalidate_from(runner);
        self.core.reset_from(runner);
        Ok(())
    }

    /// Handles the panic of a node. Under every policy but `fault`, the node waits for its reset, and its outputs and
    /// those of all nodes after it become absent.
    #[cold]
    fn on_panic(&mut self, message: String) -> Result<(), Fault> {
        self.panic = message;
        self.raise(self.policy.panic.0, Trouble::Panicked(self.core.current()))?;
        self.core.set_panicked();
        self.invalidate_from(self.core.current());
        Ok(())
    }

    /// Makes the outputs of a runner and of all that step after it absent. Allocates their buffers again, because a
    /// node that panics may lose its buffers.
    fn invalidate_from(&mut self, runner: usize) {
        // A node may have no outputs; then the ports of the next node that has some come first.
        let first = |name: &String| self.ports.iter().position(|(port, _)| owner(&port.name) == name);
        let from = self.names[runner..].iter().find_map(|(name, _)| first(name));
        for (port, id) in &self.ports[from.unwrap_or(self.ports.len())..] {
            self.core.bus.mark_mut(*id).lose(self.core.tick.index);
            self.core.bus.arenas.renew(id.slot, &port.shape);
        }
    }

    /// Returns the index of the runner that writes a port.
    fn runner_of(&self, port: usize) -> usize {
        let name = owner(&self.ports[port].0.name);
        self.names.iter().position(|(known, _)| known == name).unwrap_or(0)
    }
}
