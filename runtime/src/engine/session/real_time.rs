//! Runs a graph in real time: pacing, live devices, operator input, Ctrl-C, and the ramp to zero at the end.

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::time::{Duration, Instant};

use tokio::runtime::{Builder, Runtime};
use tokio::sync::watch;
use tokio::task::JoinSet;

use super::drive::{Pacer, drive, permanent_halt};
use super::engine::Engine;
use super::operator::OperatorInput;
use super::outcome::{Outcome, RunOptions};
use super::signals::interrupts;
use super::trouble::panic_message;
use crate::device::{DeviceError, link};
use crate::engine::core::DeviceLink;
use crate::fault::Fault;

/// Runs until a device ends, the time is over, the task is done, the operator interrupts or a fault occurs; then the
/// commands ramp to zero. Calls `observe` after every tick.
///
/// # Errors
/// If the tokio runtime or the signal handlers cannot be set up.
pub fn run(engine: &mut Engine, options: &RunOptions, observe: &mut dyn FnMut(&Engine)) -> io::Result<Outcome> {
    // A driver that blocks its thread stops neither the ticks nor Ctrl-C.
    let worker = || Builder::new_multi_thread().worker_threads(1).enable_all().build();
    let (session, drivers) = (worker()?, worker()?);
    let mut pacer = RealTimePacer::start(engine, options, &session, &drivers)?;
    // After a panic, for example in `observe`, the arm must come to rest before the unwinding goes on.
    let end = catch_unwind(AssertUnwindSafe(|| drive(engine, pacer.until, &mut pacer, observe)));
    let (time, ticks) = (engine.now(), engine.ticks());
    pacer.stop(engine);
    let wall = pacer.epoch.elapsed();
    // It ends the drivers that are still running, and does not wait for one that blocks.
    drivers.shutdown_background();
    engine.finish(&end.as_ref().map_or_else(|_| "a panic".to_owned(), ToString::to_string));
    let end = end.unwrap_or_else(|panic| resume_unwind(panic));
    Ok(Outcome { end, time, ticks, wall, late: engine.late() })
}

struct RealTimePacer<'a> {
    session: &'a Runtime,
    epoch: Instant,
    is_real: bool,
    /// Whether any device is live.
    is_live: bool,
    /// Latest time of a tick [ns].
    until: i64,
    interrupted: watch::Receiver<bool>,
    drivers: JoinSet<Result<(), DeviceError>>,
    /// Index of the device that each driver task belongs to.
    tasks: Vec<(tokio::task::Id, usize)>,
    input: OperatorInput,
    is_on_timer: bool,
}

impl<'a> RealTimePacer<'a> {
    fn start(engine: &mut Engine, options: &RunOptions, session: &'a Runtime, live: &Runtime) -> io::Result<Self> {
        let epoch = Instant::now();
        let (mut drivers, mut tasks) = (JoinSet::new(), Vec::new());
        for (i, device) in engine.devices.iter_mut().enumerate() {
            device.link = match std::mem::replace(&mut device.link, DeviceLink::Gone) {
                DeviceLink::Idle(driver) => {
                    tracing::info!("device `{}` starts", device.name);
                    let (theirs, ours) = link(&device.samples, &device.commands, epoch);
                    let task = drivers.spawn_on(driver.run(theirs), live.handle());
                    tasks.push((task.id(), i));
                    DeviceLink::Live(ours)
                }
                other => other,
            };
        }
        let is_live = !drivers.is_empty();
        let is_real = options.is_realtime || is_live;
        let until = options.duration.map_or(i64::MAX, |seconds| (seconds * 1e9) as i64);
        let interrupted = session.block_on(async { interrupts() })?;
        let input = OperatorInput::new(&options.sends, options.listens);
        Ok(Self { session, epoch, is_real, is_live, until, interrupted, drivers, tasks, input, is_on_timer: false })
    }
}

impl Pacer for RealTimePacer<'_> {
    fn is_interrupted(&self) -> bool {
        *self.interrupted.borrow()
    }

    fn tick(&mut self, engine: &mut Engine, next: i64) -> Result<bool, Fault> {
        let (now, late) = if self.is_real { self.wait(engine, next) } else { (next, 0) };
        if *self.interrupted.borrow() {
            return Ok(false);
        }
        self.collect_ended_drivers(engine);
        while let Some(word) = self.input.next(now) {
            if let Err(message) = engine.send(&word) {
                tracing::warn!("{message}");
            }
        }
        if self.is_real {
            engine.begin_measured(next + late, next);
        }
        if late > engine.period() {
            engine.begin_late(late);
        }
        engine.tick(now).map(|()| true)
    }

    fn after(&mut self, engine: &Engine) -> Option<Fault> {
        self.log_clock(engine);
        permanent_halt(engine, self.input.is_open(), !self.is_real && self.until == i64::MAX)
    }
}

impl RealTimePacer<'_> {
    /// Logs when a timer replaces the clock device, and when the device is back.
    fn log_clock(&mut self, engine: &Engine) {
        let seconds = engine.now() as f64 * 1e-9;
        match (self.is_on_timer, engine.schedule.is_on_timer()) {
            (false, true) => {
                tracing::warn!("at {seconds:.3} s: the clock device sends no samples; a timer starts the ticks instead")
            }
            (true, false) => tracing::info!("at {seconds:.3} s: the clock device is back"),
            _ => {}
        }
        self.is_on_timer = engine.schedule.is_on_timer();
    }

    /// Waits for the next sample of a live clock device, or until `next` [ns]. Returns the time of the tick and its
    /// delay after `next` [ns].
    fn wait(&self, engine: &Engine, next: i64) -> (i64, i64) {
        let due = self.epoch + Duration::from_nanos(next.max(0) as u64);
        let sampled = engine.clock().and_then(|device| match &device.link {
            DeviceLink::Live(linked) => Some(linked.sampled.clone()),
            _ => None,
        });
        let has_live_clock = sampled.is_some();
        let mut interrupted = self.interrupted.clone();
        self.session.block_on(async {
            let sample = async {
                match &sampled {
                    Some(sampled) => sampled.notified().await,
                    None => std::future::pending().await,
                }
            };
            tokio::select! {
                () = sample => {}
                () = sleep_until(due) => {}
                _ = interrupted.wait_for(|is| *is) => {}
            }
        });
        let now = self.epoch.elapsed().as_nanos() as i64;
        // With stepped devices alone, a late tick keeps its nominal time. With live devices it takes the current time;
        // otherwise every missed tick would follow at once.
        (if has_live_clock || self.is_live { now } else { next.max(engine.now()) }, now - next)
    }

    /// Marks every live device as failed whose driver has ended, with or without an error.
    fn collect_ended_drivers(&mut self, engine: &mut Engine) {
        while let Some(ended) = self.drivers.try_join_next_with_id() {
            let (task, message) = match ended {
                Ok((task, Ok(()))) => (task, "it ended before the run did".to_owned()),
                Ok((task, Err(error))) => (task, error.0),
                Err(error) => (error.id(), describe_join_error(error)),
            };
            let (_, device) =
                self.tasks.iter().find(|(id, _)| *id == task).expect("every task was started for a device");
            engine.lose_device(*device, message);
        }
    }

    /// Ramps every command to zero, in real time if the run was, and stops the drivers.
    fn stop(&mut self, engine: &mut Engine) {
        /// Time that the drivers have to end.
        const STOP_TIMEOUT: Duration = Duration::from_secs(1);
        /// Time that a driver has to read its last command.
        const LAST_COMMAND_DELAY: Duration = Duration::from_millis(50);
        while !engine.wind_down() {
            if self.is_real {
                std::thread::sleep(Duration::from_nanos(engine.period() as u64));
            }
        }
        engine.wind_down();
        if self.is_live {
            // A driver must read the zero command before it is asked to end.
            std::thread::sleep(LAST_COMMAND_DELAY);
        }
        for device in &engine.devices {
            if let DeviceLink::Live(linked) = &device.link {
                linked.stop.send_replace(true);
            }
        }
        let drivers = std::mem::take(&mut self.drivers);
        let _ = self.session.block_on(async { tokio::time::timeout(STOP_TIMEOUT, drivers.join_all()).await });
    }
}

fn describe_join_error(error: tokio::task::JoinError) -> String {
    match error.try_into_panic() {
        Ok(panic) => format!("it panicked: {}", panic_message(&*panic)),
        Err(error) => error.to_string(),
    }
}

/// Sleeps until `due`. A tokio timer is accurate to about a millisecond, so the thread sleeps for the last two.
async fn sleep_until(due: Instant) {
    const COARSE: Duration = Duration::from_millis(2);
    tokio::time::sleep_until((due - COARSE.min(due.saturating_duration_since(Instant::now()))).into()).await;
    std::thread::sleep(due.saturating_duration_since(Instant::now()));
}
