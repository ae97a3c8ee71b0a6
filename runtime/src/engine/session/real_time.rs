//! Runs a graph in real time: pacing, live devices, operator input, signals, and the ramp to zero at the end.

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicI64, Ordering};
use std::time::{Duration, Instant};

use super::drive::{Pacer, drive, permanent_halt};
use super::engine::Engine;
use super::operator::OperatorInput;
use super::outcome::{End, Outcome, RunOptions};
use super::scheduled_changes::ScheduledChanges;
use super::signals::Interrupt;
use crate::engine::core::DeviceLink;
use crate::fault::Fault;

/// Runs until a device ends, the time is over, the task is done, the operator interrupts or a fault occurs; then the
/// commands ramp to zero. Calls `observe` after every tick.
///
/// # Errors
/// If the signal handlers or the threads of the drivers cannot be set up.
pub fn run(engine: &mut Engine, options: &RunOptions, observe: &mut dyn FnMut(&Engine)) -> io::Result<Outcome> {
    let pacer = RealTimePacer::start(engine, options, Interrupt::of_run()?)?;
    drive_to_rest(engine, pacer, observe)
}

/// Runs as [`run`] does, while parameters change as scheduled.
///
/// # Errors
/// As [`run`], or if the thread that prepares the changes cannot be set up.
pub fn run_changing(
    engine: &mut Engine,
    options: &RunOptions,
    changes: &mut ScheduledChanges<'_>,
    observe: &mut dyn FnMut(&Engine),
) -> io::Result<Outcome> {
    let mut pacer = RealTimePacer::start(engine, options, Interrupt::of_run()?)?;
    if !pacer.is_real {
        pacer.changes = Some(changes);
        return drive_to_rest(engine, pacer, observe);
    }
    let (now, is_over) = (AtomicI64::new(0), AtomicBool::new(false));
    std::thread::scope(|scope| {
        let work = || changes.work(&now, &is_over);
        let thread = std::thread::Builder::new().name("changes".into()).spawn_scoped(scope, work);
        let over = OverAtDrop(&is_over);
        pacer.time = Some(&now);
        let outcome = drive_to_rest(engine, pacer, observe);
        drop(over);
        thread.and(outcome)
    })
}

/// Notes that a run is over, also when it unwinds.
struct OverAtDrop<'a>(&'a AtomicBool);

impl Drop for OverAtDrop<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Relaxed);
    }
}

/// Runs ticks until something ends the run; then the commands ramp to zero.
fn drive_to_rest(
    engine: &mut Engine,
    mut pacer: RealTimePacer<'_, '_>,
    observe: &mut dyn FnMut(&Engine),
) -> io::Result<Outcome> {
    // After a panic, for example in `observe`, the arm must come to rest before the unwinding goes on.
    let end = catch_unwind(AssertUnwindSafe(|| drive(engine, pacer.until, &mut pacer, observe)));
    let (time, ticks) = (engine.now(), engine.ticks());
    let reason = end.as_ref().map_or_else(|_| "a panic".to_owned(), ToString::to_string);
    pacer.stop(engine, &reason);
    let wall = pacer.epoch.elapsed();
    engine.finish(&reason);
    let end = end.unwrap_or_else(|panic| resume_unwind(panic));
    let signal = pacer.interrupt.signal().filter(|_| end == End::Interrupted);
    Ok(Outcome { end, signal, time, ticks, wall, late: engine.late() })
}

struct RealTimePacer<'a, 'c> {
    epoch: Instant,
    is_real: bool,
    /// Whether any device is live.
    is_live: bool,
    /// Latest time of a tick [ns].
    until: i64,
    interrupt: Interrupt,
    cancel: Option<Arc<AtomicBool>>,
    /// Whether the operator knows that a run cannot be suspended.
    has_refused: bool,
    input: OperatorInput,
    is_silent: bool,
    /// The changes of parameters, in virtual time.
    changes: Option<&'a mut ScheduledChanges<'c>>,
    /// Where the time of the graph is published [ns], in real time.
    time: Option<&'a AtomicI64>,
}

impl RealTimePacer<'_, '_> {
    fn start(engine: &mut Engine, options: &RunOptions, interrupt: Interrupt) -> io::Result<Self> {
        let is_live = engine.is_live();
        let is_real = options.is_realtime || is_live;
        let until = options.duration.map_or(i64::MAX, |seconds| (seconds * 1e9) as i64);
        let input = OperatorInput::new(options, engine)?;
        for device in &mut engine.devices {
            if let DeviceLink::Stepped(driver) = &mut device.link {
                driver.watch(interrupt.flag());
            }
        }
        if is_real {
            engine.leave_lockstep();
        }
        let epoch = Instant::now();
        engine.start_drivers(epoch)?;
        let (has_refused, is_silent) = (false, false);
        let cancel = options.cancel.clone();
        Ok(Self {
            epoch,
            is_real,
            is_live,
            until,
            interrupt,
            cancel,
            has_refused,
            input,
            is_silent,
            changes: None,
            time: None,
        })
    }
}

impl Pacer for RealTimePacer<'_, '_> {
    fn is_interrupted(&self) -> bool {
        let is_cancelled = || self.cancel.as_ref().is_some_and(|cancel| cancel.load(Ordering::Relaxed));
        self.interrupt.is_requested() || is_cancelled()
    }

    fn tick(&mut self, engine: &mut Engine, next: i64) -> Result<bool, Fault> {
        let (now, late) = if self.is_real { self.wait(engine, next) } else { (next, 0) };
        if self.is_interrupted() {
            return Ok(false);
        }
        engine.collect_ended_drivers();
        engine.restart_drivers(self.epoch);
        self.input.carry_out(engine, now);
        self.changes.iter_mut().for_each(|changes| changes.prepare(now));
        self.time.iter().for_each(|time| time.store(now, Ordering::Relaxed));
        if self.is_real {
            engine.begin_measured(next + late, next);
        }
        if late > engine.period() {
            engine.begin_late(late);
        }
        match engine.tick(now) {
            // A device that waited for another program has given up.
            Err(_) if self.is_interrupted() => Ok(false),
            ticked => ticked.map(|()| true),
        }
    }

    fn after(&mut self, engine: &Engine) -> Option<Fault> {
        self.log_clock(engine);
        if self.interrupt.take_refused() > 0 && !std::mem::replace(&mut self.has_refused, true) {
            tracing::warn!("a run cannot be suspended, because it would not stop the arm: Ctrl-C ends it");
        }
        permanent_halt(engine, self.input.is_open(), !self.is_real && self.until == i64::MAX)
    }
}

impl RealTimePacer<'_, '_> {
    /// Logs when a timer replaces the clock device, and when the device is back.
    fn log_clock(&mut self, engine: &Engine) {
        let seconds = engine.now() as f64 * 1e-9;
        match (self.is_silent, engine.schedule.is_silent()) {
            (false, true) => {
                tracing::warn!("at {seconds:.3} s: the clock device sends no samples; a timer starts the ticks instead")
            }
            (true, false) => tracing::info!("at {seconds:.3} s: the clock device is back"),
            _ => {}
        }
        self.is_silent = engine.schedule.is_silent();
    }

    /// Waits for the next sample of a live clock device, or until `next` [ns]. Returns the time of the tick and its
    /// delay after `next` [ns].
    fn wait(&self, engine: &Engine, next: i64) -> (i64, i64) {
        /// Longest time between two looks at the signals.
        const LOOK: Duration = Duration::from_millis(20);
        let clock = engine.clock().and_then(|device| Some((device.link.live()?, &device.samples)));
        let due = self.epoch + Duration::from_nanos(next.max(0) as u64);
        let has_sampled = || clock.is_some_and(|(linked, samples)| linked.has_sampled(samples));
        loop {
            let left = due.saturating_duration_since(Instant::now());
            if left.is_zero() || has_sampled() || self.is_interrupted() {
                break;
            }
            // A live device wakes the thread when it has sampled.
            std::thread::park_timeout(left.min(LOOK));
        }
        let now = self.epoch.elapsed().as_nanos() as i64;
        // With stepped devices alone, a late tick keeps its nominal time. With live devices it takes the current time;
        // otherwise every missed tick would follow at once.
        (if self.is_live { now } else { next.max(engine.now()) }, now - next)
    }

    /// Ramps the commands toward zero. Live devices follow them at the current time, and not one period after another.
    fn wind_down(&self, engine: &mut Engine) -> bool {
        if !self.is_live {
            return engine.wind_down();
        }
        engine.wind_down_at((self.epoch.elapsed().as_nanos() as i64).max(engine.now() + 1))
    }

    /// Ramps every command to zero, in real time if the run was, and stops the drivers.
    fn stop(&mut self, engine: &mut Engine, reason: &str) {
        /// Longest time of the ramp. With the time that the drivers have, it stays within the 5 s in which a signal ends
        /// a run.
        const MAX_RAMP: Duration = Duration::from_secs(3);
        let begin = Instant::now();
        while !self.wind_down(engine) {
            let left = MAX_RAMP.saturating_sub(begin.elapsed());
            if left.is_zero() {
                engine.cut_ramp();
            } else if self.is_real {
                std::thread::sleep(left.min(Duration::from_nanos(engine.period() as u64)));
            }
        }
        self.wind_down(engine);
        engine.stop_drivers(reason, MAX_RAMP.saturating_sub(begin.elapsed()));
        self.input.finish();
    }
}
