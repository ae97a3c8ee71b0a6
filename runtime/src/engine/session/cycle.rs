//! One cycle of the engine: exchange with the devices, latch, step, commit, and the handling of each trouble.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

use super::engine::Engine;
use super::task_run::TaskEnd;
use super::trouble::{Origin, Trouble, panic_message};
use crate::device::{DeviceError, Linked};
use crate::engine::core::{DeviceLink, Transition};
use crate::fault::{Cause, Fault};
use crate::graph::{Policy, PolicyTable};

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
        let late = self.lateness.take();
        if let Some(log) = &mut self.inputs {
            log.begin(&self.core.tick, late, self.punctuality.last.map(|began| began.by));
        }
        self.live.take(&mut self.core, self.inputs.as_deref_mut());
        if let Some(by) = late {
            self.raise(Origin::Run, |policy| policy.deadline, Trouble::Late(by))?;
        }
        let has_sampled = match self.replayed.take() {
            Some(has_sampled) => has_sampled,
            None => self.exchange_with_devices(now) || due,
        };
        if let Some(log) = &mut self.inputs {
            log.exchanged(&mut self.devices, has_sampled);
        }
        self.check_sizes();
        for i in 0..self.devices.len() {
            if self.devices[i].failed.is_some() {
                self.raise(Origin::Device(i), |policy| policy.device.0, Trouble::Device(i))?;
            }
        }
        self.check_leases(now)?;
        for i in 0..self.core.inlets.len() {
            let inlet = &self.core.inlets[i];
            let device = &self.devices[inlet.device];
            if device.failed.is_none() && inlet.lost(&device.samples).is_some() {
                let may_return = device.description.may_return;
                let policy = |policy: &PolicyTable| match policy.device.0 {
                    Policy::Fault if may_return => Policy::Hold,
                    policy => policy,
                };
                self.raise(Origin::Role(inlet.role), policy, Trouble::Lost(i))?;
            }
        }
        self.schedule.ticked(now, has_sampled);
        if self.schedule.is_silent() {
            self.raise(Origin::Run, |policy| policy.clock, Trouble::Clock)?;
        }
        for i in 0..self.core.inlets.len() {
            let inlet = &mut self.core.inlets[i];
            let device = &self.devices[inlet.device];
            if device.failed.is_none() && !inlet.is_finite(&device.samples) {
                inlet.reject(&device.samples);
                let role = inlet.role;
                self.raise(Origin::Role(role), |policy| policy.not_finite.0, Trouble::NotFinite(i))?;
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
        for (task, context) in self.tasks.iter().zip(&mut self.core.tasks) {
            task.show_mode(&mut self.core.bus, &self.core.tick);
            context.is_resumed = task.halts.resumes;
        }
        self.raise_stale()?;
        self.run_nodes()?;
        self.watch_budgets()?;
        self.watch_failures()?;
        for i in 0..self.watched.len() {
            let wire = &self.watched[i];
            if wire.aged.is_stale(&self.core.bus, self.core.tick.now) {
                let (origin, stale) = (wire.origin, wire.stale);
                self.raise(origin, |_| stale, Trouble::StaleWire(i))?;
            }
        }
        let mut first = 0;
        while let Some(runner) = self.core.panicked(first) {
            self.raise(Origin::Runner(runner), |policy| policy.panic.0, Trouble::Panicked(runner))?;
            first = runner + 1;
        }
        for task in 0..self.tasks.len() {
            self.update_halt(task);
            self.core.tasks[task].is_halted = self.tasks[task].is_resting();
        }
        self.core.commit(&mut self.devices);
        self.send_commands();
        self.decide()
    }

    /// Raises a trouble for each role whose newest sample is too old. Of several with the same policy, the last role is
    /// named.
    fn raise_stale(&mut self) -> Result<(), Fault> {
        for i in (0..self.core.inlets.len()).rev() {
            let inlet = &self.core.inlets[i];
            if inlet.is_stale(self.core.tick.now) {
                let (role, stale) = (inlet.role, inlet.stale);
                self.raise(Origin::Role(role), |_| stale, Trouble::Stale(i))?;
            }
        }
        Ok(())
    }

    /// Steps the nodes. After a panic, the nodes behind the one that panicked still step.
    fn run_nodes(&mut self) -> Result<(), Fault> {
        let mut first = 0;
        loop {
            match catch_unwind(AssertUnwindSafe(|| self.core.run(first, &mut self.timing))) {
                Ok(true) => return Ok(()),
                Ok(false) => return self.on_not_finite(),
                Err(panic) => self.on_panic(panic_message(&*panic))?,
            }
            first = self.core.current() + 1;
        }
    }

    /// Returns whether a trouble from there concerns a task.
    pub(super) fn concerns(&self, origin: Origin, task: usize) -> bool {
        let is_in = |tasks: Option<&Vec<usize>>| tasks.is_none_or(|tasks| tasks.contains(&task));
        match origin {
            _ if self.tasks.len() == 1 => true,
            Origin::Run => true,
            Origin::Task(of) => task == of,
            Origin::Role(role) => is_in(self.reach.roles.get(role)),
            Origin::Runner(runner) => is_in(self.reach.nodes.get(runner)),
            Origin::Device(device) => self.device_roles[device].iter().any(|role| is_in(self.reach.roles.get(*role))),
        }
    }

    /// Raises a trouble of this tick for each task that it concerns, under the policy of that task. Of several, a task
    /// keeps the one with the strictest policy.
    pub(super) fn raise(
        &mut self,
        origin: Origin,
        policy: impl Fn(&PolicyTable) -> Policy,
        trouble: Trouble,
    ) -> Result<(), Fault> {
        for task in 0..self.tasks.len() {
            if self.tasks[task].end.is_some() || !self.concerns(origin, task) {
                continue;
            }
            match policy(&self.tasks[task].policy) {
                Policy::Count => {}
                Policy::Fault => self.fail(task, self.describe(trouble))?,
                Policy::Hold if self.needs_resume(trouble) => self.tasks[task].keep(Policy::Stop, trouble),
                policy @ (Policy::Hold | Policy::Stop) => self.tasks[task].keep(policy, trouble),
            }
        }
        Ok(())
    }

    /// Whether the commands wait for `resume` after a trouble, even under the policy `hold`. A sensor that was lost may
    /// come back as it was. A device that moves something may have been moved, stopped or started anew meanwhile.
    fn needs_resume(&self, trouble: Trouble) -> bool {
        match trouble {
            Trouble::Device(device) => self.is_mover(device),
            Trouble::Lost(inlet) => {
                let device = self.core.inlets[inlet].device;
                self.is_mover(device) && self.has_sampled(device)
            }
            Trouble::Operator | Trouble::Lease(_) => true,
            Trouble::Found(_)
            | Trouble::Stale(_)
            | Trouble::StaleWire(_)
            | Trouble::NotFinite(_)
            | Trouble::Panicked(_)
            | Trouble::Clock
            | Trouble::Late(_) => false,
        }
    }

    /// Whether a device has commands.
    fn is_mover(&self, device: usize) -> bool {
        !self.devices[device].commands.values.is_empty()
    }

    /// Whether any sample of a device was taken over so far.
    fn has_sampled(&self, device: usize) -> bool {
        self.core.inlets.iter().any(|inlet| inlet.device == device && inlet.counters.new > 0)
    }

    /// Whether a task wires or drives a command. Without one, a hold keeps nothing back.
    fn commands_something(&self, task: usize) -> bool {
        self.drivers.iter().any(|(owner, drivers)| *owner == task || drivers.contains(&task))
    }

    /// Whether a trouble means that a device has not begun yet: nothing has been lost.
    fn is_before_start(&self, trouble: Trouble) -> bool {
        match trouble {
            Trouble::Clock => self.schedule.clock_device().is_some_and(|device| !self.has_sampled(device)),
            Trouble::Lost(inlet) => !self.has_sampled(self.core.inlets[inlet].device),
            _ => false,
        }
    }

    /// Ends a task and those in it with a fault. Returns the fault if it ends the run.
    pub(super) fn fail(&mut self, task: usize, fault: Fault) -> Result<(), Fault> {
        if self.tasks[task].end.is_some() {
            return Ok(());
        }
        if self.tasks[task].ends_run {
            return Err(fault);
        }
        tracing::warn!("{fault}: the commands of `{}` ramp to zero", self.tasks[task].name);
        self.end_task(task, &TaskEnd::Failed(fault.into()));
        Ok(())
    }

    /// Ends a task and those in it.
    fn end_task(&mut self, task: usize, end: &TaskEnd) {
        for i in task..self.tasks.len() {
            let is_in_it = std::iter::successors(Some(i), |i| self.tasks[*i].parent).any(|around| around == task);
            if is_in_it && self.tasks[i].end.is_none() {
                self.tasks[i].end = Some(end.clone());
            }
        }
    }

    /// Starts a halt of a task if it had a trouble in this tick, or ends it if the trouble is over.
    fn update_halt(&mut self, number: usize) {
        let trouble = self.tasks[number].trouble.take();
        if let Some((policy, trouble)) = trouble
            && (self.tasks[number].halts.is_escalated_by(policy) || self.explains_halt(number, trouble))
        {
            let fault = self.describe(trouble);
            let task = &mut self.tasks[number];
            task.halts.halt(&task.name, policy, fault);
        }
        let trouble = trouble.map(|(_, trouble)| trouble);
        if trouble.is_some_and(|trouble| self.is_before_start(trouble)) || !self.commands_something(number) {
            self.tasks[number].halts.wait(self.core.tick.now);
        }
        let is_refused = self.tasks[number].halts.resumes && trouble.is_some() && self.tasks[number].is_stopped();
        if let Some(refusal) = trouble.filter(|_| is_refused).and_then(|trouble| self.refusal(trouble)) {
            tracing::warn!("`resume` {refusal}");
        }
        let task = &mut self.tasks[number];
        task.lasting = trouble;
        let resumes = task.halts.update(&task.name, trouble.is_some(), self.core.tick.now);
        if resumes {
            self.renew_leases(number);
        }
        let task = &mut self.tasks[number];
        if let Some(modes) = task.modes.as_mut().filter(|_| resumes) {
            modes.restart(&self.core.tick);
            self.core.switch(modes.configurations());
        }
    }

    /// Whether a device has reported why its samples are missing, while the commands are held only for missing samples.
    fn explains_halt(&self, task: usize, trouble: Trouble) -> bool {
        let last = self.tasks[task].halts.list.last().filter(|halt| halt.until.is_none());
        let is_silence = last.is_some_and(|halt| {
            halt.policy == Policy::Hold
                && matches!(halt.fault.cause, Cause::SilentClock | Cause::NeverSampled | Cause::Stale { .. })
        });
        is_silence && matches!(trouble, Trouble::Device(_) | Trouble::Lost(_))
    }

    /// Notes that the next tick begins `by` [ns] too late in real time.
    pub fn begin_late(&mut self, by: i64) {
        self.late += 1;
        self.lateness = Some(by);
    }

    /// Evaluates the conditions of the current mode of each task after a tick. While the commands of a task wait for
    /// `resume`, its mode stays. All tasks decide on the values of this tick, and on the modes at its start.
    fn decide(&mut self) -> Result<(), Fault> {
        for number in 0..self.tasks.len() {
            let task = &mut self.tasks[number];
            let sent = task.sent.take();
            if task.end.is_some() || task.halts.is_stopped() {
                continue;
            }
            let Some(modes) = task.modes.as_mut() else { continue };
            match modes.decide(&self.core.bus, &self.core.tick, sent.as_deref()) {
                Transition::Stay => {}
                Transition::Switched => self.core.switch(modes.configurations()),
                Transition::Done => self.end_task(number, &TaskEnd::Done),
                Transition::Failed => {
                    let ((why, place), name) = (modes.taken(), modes.full_name());
                    let (why, place) = (Cause::Mode(why.to_owned()), self.sources.locate(place));
                    self.fail(number, self.fault(&name, None, why, place))?;
                }
            }
        }
        Ok(())
    }

    /// Ramps the commands toward zero for one period and sends them to the devices. Returns whether they are zero.
    ///
    /// A run ends by calling this until it returns `true`, and once more so that the devices receive the zero.
    pub fn wind_down(&mut self) -> bool {
        self.wind_down_at(self.core.tick.now + self.schedule.period())
    }

    /// Ramps the commands toward zero up to the time `now` [ns], as [`wind_down`](Self::wind_down) does for one period.
    pub(crate) fn wind_down_at(&mut self, now: i64) -> bool {
        let dt = now - self.core.tick.now;
        self.core.begin(now);
        let is_still = self.core.ramp(&mut self.devices, dt as f64 * 1e-9);
        self.send_commands();
        // A device that fails now does not change why the run ended: it stops by its own timeout.
        self.exchange_with_devices(now);
        is_still
    }

    /// Sets every command to zero at once, because the ramp of an arm takes too long. A live device that lags behind the
    /// commands, or ramps by itself, gets zero too.
    pub(crate) fn cut_ramp(&mut self) {
        for device in self.devices.iter_mut().filter(|device| !device.rests()) {
            let is_new = device.link.live().is_none_or(Linked::cut);
            device.commands.rest();
            if is_new {
                tracing::warn!(
                    "`{}` still moves: its ramp takes too long, so its command is zero at once",
                    device.name
                );
            }
        }
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
        self.clock()?.link.stepped()?.next()
    }

    /// Exchanges commands and samples with every stepped device, and receives the samples of the live ones. A device that
    /// fails does not keep the others from their commands. Returns whether a live clock device has sampled.
    fn exchange_with_devices(&mut self, now: i64) -> bool {
        let mut has_sampled = false;
        for i in 0..self.devices.len() {
            let device = &mut self.devices[i];
            match &mut device.link {
                DeviceLink::Stepped(driver) => {
                    let before = self.timing.is_always_on.then(Instant::now);
                    let exchange = || driver.exchange(now, &device.commands, &mut device.samples);
                    let result = catch_unwind(AssertUnwindSafe(exchange));
                    let result = result
                        .unwrap_or_else(|panic| Err(DeviceError(format!("it panicked: {}", panic_message(&*panic)))));
                    if let Err(DeviceError(why)) = result {
                        self.lose_device(i, why);
                    }
                    if let Some(before) = before {
                        self.punctuality.device_took(i, before.elapsed());
                    }
                }
                DeviceLink::Live(linked) if device.failed.is_none() => {
                    let is_newer = linked.receive(&mut device.samples);
                    has_sampled |= is_newer && self.schedule.is_clock(i);
                }
                DeviceLink::Idle(_)
                | DeviceLink::Live(_)
                | DeviceLink::Down(_)
                | DeviceLink::Gone
                | DeviceLink::Recorded { .. } => {}
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
        device.failed.get_or_insert(why);
        match &mut device.link {
            // Its driver still runs, and brings it to rest.
            DeviceLink::Live(linked) if !linked.has_ended() => linked.refuse(),
            link => *link = DeviceLink::Gone,
        }
    }

    /// Handles the values that are not finite. In a task the first is the cause of the others, because ports are in the
    /// order in which nodes write them. Another task may have one of its own.
    #[cold]
    fn on_not_finite(&mut self) -> Result<(), Fault> {
        for port in 0..self.ports.len() {
            let (planned, id) = &self.ports[port];
            if !self.core.bus.arenas.is_finite(planned.shape.kind(), id.slot) {
                self.drop_not_finite(port)?;
            }
        }
        Ok(())
    }

    /// Handles the value of a port that is not finite. Under every policy but `fault`, the outputs of its node and of
    /// all nodes after it become absent, and those nodes are reset: in the tasks that read the value.
    fn drop_not_finite(&mut self, port: usize) -> Result<(), Fault> {
        let runner = self.writers[port].unwrap_or(0);
        self.raise(Origin::Runner(runner), |policy| policy.not_finite.0, Trouble::NotFinite(port))?;
        let is_behind =
            |behind: usize| behind >= runner && self.concerns(Origin::Runner(runner), self.core.task_of(behind));
        let behind: Vec<bool> = (0..self.names.len()).map(is_behind).collect();
        self.invalidate(&behind);
        (0..behind.len()).filter(|runner| behind[*runner]).for_each(|runner| self.core.reset(runner));
        Ok(())
    }

    /// Handles the panic of a node. Under every policy but `fault`, the node waits for its reset, and its outputs
    /// are absent.
    #[cold]
    fn on_panic(&mut self, message: String) -> Result<(), Fault> {
        self.panic = message;
        let runner = self.core.current();
        self.raise(Origin::Runner(runner), |policy| policy.panic.0, Trouble::Panicked(runner))?;
        self.core.set_panicked();
        let own: Vec<bool> = (0..self.names.len()).map(|other| other == runner).collect();
        self.invalidate(&own);
        Ok(())
    }

    /// Makes the outputs of some runners absent. Allocates their buffers again, because a node that panics may lose its
    /// buffers.
    fn invalidate(&mut self, runners: &[bool]) {
        for ((port, id), writer) in self.ports.iter().zip(&self.writers) {
            if writer.is_some_and(|writer| runners[writer]) {
                self.core.bus.mark_mut(*id).lose(self.core.tick.index);
                self.core.bus.arenas.renew(id.slot, &port.shape);
            }
        }
    }
}
