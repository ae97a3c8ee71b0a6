//! The course of a tick from the outside in: exchange with the devices, latch, step, commit, and what each trouble on the
//! way does.

use std::panic::{AssertUnwindSafe, catch_unwind};

use super::blame::owner;
use super::engine::Engine;
use super::trouble::{Trouble, panic_message};
use crate::device::DeviceError;
use crate::engine::core::{Link, Modes, Verdict};
use crate::fault::{Cause, Fault};
use crate::graph::Policy;
use crate::source::suggestion;

impl Engine {
    /// Runs the tick at `now` [ns]: exchange with the devices, then latch, step and commit.
    ///
    /// # Errors
    /// The reason of a fault; nothing was commanded in this tick.
    pub fn tick(&mut self, now: i64) -> Result<(), Fault> {
        self.exchange(now)?;
        self.step()
    }

    /// The first half of a tick at `now` [ns]: hands the commands of the last tick to the devices and takes what they
    /// have sampled since.
    ///
    /// # Errors
    /// If a device fails or gives what is not finite, and the policy of that is a fault.
    pub fn exchange(&mut self, now: i64) -> Result<(), Fault> {
        let due = self.clock_sample().is_some_and(|sample| sample <= now);
        self.core.begin(now);
        if let Some(by) = self.lateness.take() {
            self.raise(self.policy.deadline, Trouble::Late(by))?;
        }
        let has_sampled = self.exchange_with_devices(now) || due;
        for i in 0..self.devices.len() {
            if self.devices[i].failed.is_some() {
                self.raise(self.policy.device.0, Trouble::Device(i))?;
            }
        }
        self.timeline.ticked(now, has_sampled);
        if self.timeline.is_on_timer() {
            self.raise(self.policy.clock, Trouble::Clock)?;
        }
        for i in 0..self.core.inlets.len() {
            let (inlet, devices) = (&mut self.core.inlets[i], &self.devices);
            let samples = &devices[inlet.device].samples;
            if !inlet.is_finite(samples) {
                inlet.reject(samples);
                self.raise(self.policy.not_finite.0, Trouble::NotFinite(i))?;
            }
        }
        Ok(())
    }

    /// The second half of a tick: latch, step, commit. It neither allocates nor calls the operating system, but when
    /// something goes wrong.
    ///
    /// # Errors
    /// The reason of a fault; nothing was commanded in this tick.
    pub fn step(&mut self) -> Result<(), Fault> {
        self.core.latch(&mut self.devices);
        if let Some((policy, inlet)) = self.core.stale() {
            self.raise(policy, Trouble::Stale(inlet))?;
        }
        match catch_unwind(AssertUnwindSafe(|| self.core.run(&mut self.timing))) {
            Ok(true) => {}
            Ok(false) => self.not_finite()?,
            Err(panic) => self.panicked(panic_message(&*panic))?,
        }
        for i in 0..self.watched.len() {
            let wire = &self.watched[i];
            if wire.aged.is_stale(&self.core.bus, self.core.tick.now) {
                self.raise(wire.stale, Trouble::StaleWire(i))?;
            }
        }
        if let Some(runner) = self.core.broken() {
            self.raise(self.policy.panic.0, Trouble::Panicked(runner))?;
        }
        self.settle();
        self.core.tick.is_halted = self.halts.is_halted();
        self.core.commit(&mut self.devices, self.halts.is_halted());
        self.decide()
    }

    /// Notes a trouble of this tick; the strictest is what counts.
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

    /// Halts because of the trouble of this tick, or goes on if there is none.
    fn settle(&mut self) {
        let trouble = self.trouble.take();
        if let Some((policy, trouble)) = trouble
            && self.halts.is_news(policy)
        {
            let fault = self.describe(trouble);
            self.halts.trouble(policy, fault);
        }
        let resumes = self.halts.settle(trouble.is_some(), self.core.tick.now);
        if let Some(modes) = self.modes.as_mut().filter(|_| resumes) {
            modes.restart(&self.core.tick);
            self.core.switch(modes.configurations());
        }
    }

    /// A word from outside: `stop` and `resume`, in any case, halt the commands and let them go on; others are for the
    /// modes. One that no mode waits for changes nothing, and while the operator is waited for modes hear none.
    ///
    /// # Errors
    /// Why nobody hears it.
    pub fn send(&mut self, word: &str) -> Result<(), String> {
        if word.eq_ignore_ascii_case("stop") {
            self.halts.stop();
            self.trouble = Some((Policy::Stop, Trouble::Operator));
        } else if word.eq_ignore_ascii_case("resume") {
            self.halts.resume();
        } else if !self.words().any(|known| known == word) {
            let known = self.words().collect::<std::collections::BTreeSet<_>>();
            return Err(format!("nothing waits for `{word}`: {}", suggestion(word, known.into_iter(), "words")));
        } else if self.halts.is_stopped() {
            return Err(format!("`{word}` is not heard while the commands wait for `resume`"));
        } else {
            self.sent = Some(word.to_owned());
        }
        Ok(())
    }

    /// The words that something waits for.
    pub fn words(&self) -> impl Iterator<Item = &str> {
        ["stop", "resume"].into_iter().chain(self.modes.iter().flat_map(Modes::words))
    }

    /// The next tick begins `by` [ns] too late, by a real clock.
    pub fn begin_late(&mut self, by: i64) {
        self.late += 1;
        self.lateness = Some(by);
    }

    /// The boundary between two ticks: another mode, if the conditions of the present one say so. While the operator is
    /// waited for, modes wait too.
    fn decide(&mut self) -> Result<(), Fault> {
        let sent = self.sent.take();
        let Some(modes) = self.modes.as_mut().filter(|_| !self.halts.is_stopped()) else { return Ok(()) };
        match modes.decide(&self.core.bus, &self.core.tick, sent.as_deref()) {
            Verdict::Stay => {}
            Verdict::Switched => self.core.switch(modes.configurations()),
            Verdict::Done => self.is_done = true,
            Verdict::Failed => {
                let ((why, place), name) = (modes.taken(), modes.name().to_owned());
                let (why, place) = (Cause::Mode(why.to_owned()), self.sources.locate(place));
                return Err(self.fault(&name, None, why, place));
            }
        }
        Ok(())
    }

    /// One period of the end of a run: the commands go one step further down to zero, and the devices are told.
    /// Whether they are zero.
    pub fn wind_down(&mut self) -> bool {
        let now = self.core.tick.now + self.timeline.period();
        self.core.begin(now);
        let is_still = self.core.ramp(&mut self.devices, self.timeline.period() as f64 * 1e-9);
        // A device that fails now has had its zero or will time out by itself; the reason of the stop stays the first.
        self.exchange_with_devices(now);
        is_still
    }

    /// Tells the devices that the run is over, and why.
    pub(crate) fn finish(&mut self, reason: &str) {
        for device in &mut self.devices {
            if let Link::Stepped(driver) = &mut device.link {
                // A device that panics at its end has had its zero; the reason of the end stays the first.
                let _ = catch_unwind(AssertUnwindSafe(|| driver.finish(reason)));
            }
        }
    }

    /// Time of a stepped clock device's next sample.
    fn clock_sample(&self) -> Option<i64> {
        self.devices.iter().enumerate().find_map(|(i, device)| match &device.link {
            Link::Stepped(driver) if self.timeline.is_clock(i) => driver.next(),
            _ => None,
        })
    }

    /// Hands every device its commands and takes its samples: one that fails keeps no other from its command. Whether a
    /// live clock device has sampled.
    fn exchange_with_devices(&mut self, now: i64) -> bool {
        let mut has_sampled = false;
        for i in 0..self.devices.len() {
            let device = &mut self.devices[i];
            match &mut device.link {
                Link::Stepped(driver) => {
                    let exchange = || driver.exchange(now, &device.commands, &mut device.samples);
                    let result = catch_unwind(AssertUnwindSafe(exchange));
                    let result = result
                        .unwrap_or_else(|panic| Err(DeviceError(format!("it panicked: {}", panic_message(&*panic)))));
                    if let Err(DeviceError(why)) = result {
                        self.lose_device(i, why);
                    }
                }
                Link::Live(linked) => {
                    let is_newer = linked.exchange(&device.commands, &mut device.samples);
                    has_sampled |= is_newer && self.timeline.is_clock(i);
                }
                Link::Idle(_) | Link::Gone => {}
            }
        }
        has_sampled
    }

    /// A device has failed: it is not touched again.
    pub(crate) fn lose_device(&mut self, device: usize, why: String) {
        let device = &mut self.devices[device];
        (device.link, device.failed) = (Link::Gone, Some(why));
    }

    /// A value is not finite: if the run goes on, what the node gave is taken back, and with it all that may follow.
    #[cold]
    fn not_finite(&mut self) -> Result<(), Fault> {
        // Ports stand in the order in which they are written, so the first that is not finite made the others so.
        let bus = &self.core.bus;
        let is_bad = |port: &usize| {
            let (planned, id) = &self.ports[*port];
            !bus.arenas.is_finite(planned.shape.kind(), id.slot)
        };
        let port = (0..self.ports.len()).find(is_bad).expect("one of them is not finite");
        self.raise(self.policy.not_finite.0, Trouble::NotFiniteAt(port))?;
        let runner = self.station_of(port);
        self.invalidate_from(runner);
        self.core.reset_from(runner);
        Ok(())
    }

    /// A node has panicked: if the run goes on, it waits for its reset, and what was not stepped in this tick is absent.
    #[cold]
    fn panicked(&mut self, why: String) -> Result<(), Fault> {
        self.panic = why;
        self.raise(self.policy.panic.0, Trouble::Panicked(self.core.current()))?;
        self.core.break_down();
        self.invalidate_from(self.core.current());
        Ok(())
    }

    /// Makes the outputs of a runner and of all that come after it absent. A node that panicked may have lost its
    /// buffers, so they are made anew.
    fn invalidate_from(&mut self, runner: usize) {
        // The first that has any: a node may be without outputs, and those after it were not stepped all the same.
        let first = |name: &String| self.ports.iter().position(|(port, _)| owner(&port.name) == name);
        let from = self.names[runner..].iter().find_map(|(name, _)| first(name));
        for (port, id) in &self.ports[from.unwrap_or(self.ports.len())..] {
            self.core.bus.marks[id.mark as usize].lose(self.core.tick.index);
            self.core.bus.arenas.renew(id.slot, &port.shape);
        }
    }

    fn station_of(&self, port: usize) -> usize {
        let name = owner(&self.ports[port].0.name);
        self.names.iter().position(|(known, _)| known == name).unwrap_or(0)
    }
}
