//! The loop of a run: tick after tick, until something ends it.

use std::time::Instant;

use super::engine::Engine;
use super::outcome::{End, Outcome};
use super::task_run::TaskRun;
use crate::engine::core::DeviceSlot;
use crate::fault::Fault;

/// Paces a run and passes operator input to the engine between two ticks.
pub(crate) trait Pacer {
    /// Whether the operator has asked to end the run.
    fn is_interrupted(&self) -> bool;

    /// Runs the tick that is due at `next` [ns], with the operator input since the last one. Returns `false` without a
    /// tick if the operator has asked to end the run.
    fn tick(&mut self, engine: &mut Engine, next: i64) -> Result<bool, Fault>;

    /// Called after each tick. Returns the fault of a halt that nothing can end.
    fn after(&mut self, engine: &Engine) -> Option<Fault>;
}

/// Runs ticks up to the time `until` [ns], or until something ends the run before. Calls `observe` after every tick.
pub(crate) fn drive(engine: &mut Engine, until: i64, pacer: &mut impl Pacer, observe: &mut dyn FnMut(&Engine)) -> End {
    loop {
        if pacer.is_interrupted() {
            return End::Interrupted;
        }
        let Some(next) = engine.next() else { return End::Finished };
        if next > until {
            return End::Duration;
        }
        match pacer.tick(engine, next) {
            Ok(true) => engine.observe_measured(observe),
            Ok(false) => return End::Interrupted,
            Err(fault) => return End::Fault(fault.into()),
        }
        let fault = pacer.after(engine);
        if engine.is_over() {
            let failed = engine.failures().next().map(|(_, fault)| End::Fault(fault.clone().into()));
            return failed.unwrap_or(End::Done);
        }
        if let Some(fault) = fault {
            return End::Fault(fault.into());
        }
    }
}

/// Returns the fault of a halt that nothing can end, once the commands are zero. Such a run would never return: it is
/// stopped and no operator word can arrive (`can_resume`), or it has no end (`is_endless`) and has lost a device.
pub(crate) fn permanent_halt(engine: &Engine, can_resume: bool, is_endless: bool) -> Option<Fault> {
    let is_stopped = engine.is_stopped() && !can_resume;
    let has_failed_device = || engine.devices.iter().any(|device| device.failed.is_some());
    // A device that only one task needs does not end the others.
    let all_rest = || engine.tasks().iter().filter(|task| task.is_awaited()).all(TaskRun::is_halted);
    let is_lost = is_endless && has_failed_device() && !engine.has_end() && all_rest();
    let is_still = || engine.devices.iter().all(DeviceSlot::rests);
    let halts = engine.tasks().iter().filter(|task| task.end().is_none()).filter_map(|task| task.halts().last());
    let last = halts.max_by_key(|halt| halt.fault.tick).filter(|_| (is_stopped || is_lost) && is_still())?;
    Some(last.fault.clone())
}

/// Runs for `duration` [s] of virtual time, as fast as possible; then the commands ramp to zero. It catches no signal,
/// reads no operator word and starts no thread, so many runs can work in parallel.
///
/// # Panics
/// If a device runs in real time; check with [`Compiled::is_live`](crate::graph::Compiled::is_live).
pub fn run_virtual(
    engine: &mut Engine,
    duration: f64,
    is_interrupted: &dyn Fn() -> bool,
    observe: &mut dyn FnMut(&Engine),
) -> Outcome {
    assert!(!engine.is_live(), "a live device cannot run in virtual time");
    let epoch = Instant::now();
    let end = drive(engine, (duration * 1e9) as i64, &mut Virtual { is_interrupted }, observe);
    let (time, ticks) = (engine.now(), engine.ticks());
    while !engine.wind_down() {}
    engine.wind_down();
    engine.finish(&end.to_string());
    Outcome { end, signal: None, time, ticks, wall: epoch.elapsed(), late: 0 }
}

struct Virtual<'a> {
    is_interrupted: &'a dyn Fn() -> bool,
}

impl Pacer for Virtual<'_> {
    fn is_interrupted(&self) -> bool {
        (self.is_interrupted)()
    }

    fn tick(&mut self, engine: &mut Engine, next: i64) -> Result<bool, Fault> {
        engine.tick(next).map(|()| true)
    }

    fn after(&mut self, engine: &Engine) -> Option<Fault> {
        permanent_halt(engine, false, false)
    }
}
