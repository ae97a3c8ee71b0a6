//! The edge to real time: pacing, live devices, the operator's Ctrl-C; and the end of every run, which is a ramp to zero.

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::time::{Duration, Instant};

use tokio::runtime::{Builder, Runtime};
use tokio::sync::watch;
use tokio::task::JoinSet;

use super::drive::{Pace, drive, hopeless};
use super::engine::Engine;
use super::operator::Words;
use super::outcome::{Outcome, RunOptions};
use super::signals::interrupts;
use super::trouble::panic_message;
use crate::device::{DeviceError, link};
use crate::engine::core::Link;
use crate::fault::Fault;

/// Runs until a device ends, the time is over, the operator interrupts or something goes wrong; then the commands ramp
/// to zero. `observe` is called after every tick.
///
/// # Errors
/// If the operating system gives no runtime for live devices and signals.
pub fn run(engine: &mut Engine, options: &RunOptions, observe: &mut dyn FnMut(&Engine)) -> io::Result<Outcome> {
    let runtime = Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
    let mut shell = Shell::start(engine, options, &runtime)?;
    // Whatever unwinds through here, the arm is brought to rest first.
    let end = catch_unwind(AssertUnwindSafe(|| drive(engine, shell.until, &mut shell, observe)));
    let (time, ticks) = (engine.now(), engine.ticks());
    shell.stop(engine);
    engine.finish(&end.as_ref().map_or_else(|_| "a panic".to_owned(), ToString::to_string));
    let end = end.unwrap_or_else(|panic| resume_unwind(panic));
    Ok(Outcome { end, time, ticks, wall: shell.epoch.elapsed(), late: engine.late() })
}

struct Shell<'a> {
    runtime: &'a Runtime,
    epoch: Instant,
    is_real: bool,
    /// Whether any device runs on its own.
    is_live: bool,
    /// Last time of a tick [ns].
    until: i64,
    interrupted: watch::Receiver<bool>,
    drivers: JoinSet<Result<(), DeviceError>>,
    /// Which device each driver is of.
    tasks: Vec<(tokio::task::Id, usize)>,
    words: Words,
    is_on_timer: bool,
}

impl<'a> Shell<'a> {
    fn start(engine: &mut Engine, options: &RunOptions, runtime: &'a Runtime) -> io::Result<Self> {
        let epoch = Instant::now();
        let (mut drivers, mut tasks) = (JoinSet::new(), Vec::new());
        for (i, device) in engine.devices.iter_mut().enumerate() {
            let edge = std::mem::replace(&mut device.link, Link::Gone);
            device.link = match edge {
                Link::Idle(driver) => {
                    tracing::info!("device `{}` starts", device.name);
                    let (theirs, ours) = link(&device.samples, &device.commands, epoch);
                    let task = drivers.spawn_on(driver.run(theirs), runtime.handle());
                    tasks.push((task.id(), i));
                    Link::Live(ours)
                }
                other => other,
            };
        }
        let is_live = !drivers.is_empty();
        let is_real = options.is_realtime || is_live;
        let until = options.duration.map_or(i64::MAX, |seconds| (seconds * 1e9) as i64);
        let interrupted = runtime.block_on(async { interrupts() })?;
        let words = Words::new(&options.sends, options.listens);
        Ok(Self { runtime, epoch, is_real, is_live, until, interrupted, drivers, tasks, words, is_on_timer: false })
    }
}

impl Pace for Shell<'_> {
    fn is_interrupted(&self) -> bool {
        *self.interrupted.borrow()
    }

    fn tick(&mut self, engine: &mut Engine, next: i64) -> Result<bool, Fault> {
        let (now, late) = if self.is_real { self.wait(engine, next) } else { (next, 0) };
        if *self.interrupted.borrow() {
            return Ok(false);
        }
        self.failed_driver(engine);
        while let Some(word) = self.words.next(now) {
            if let Err(why) = engine.send(&word) {
                tracing::warn!("{why}");
            }
        }
        if late > engine.period() {
            engine.begin_late(late);
        }
        engine.tick(now).map(|()| true)
    }

    fn after(&mut self, engine: &Engine) -> Option<Fault> {
        self.watch_clock(engine);
        hopeless(engine, self.words.may_come(), !self.is_real && self.until == i64::MAX)
    }
}

impl Shell<'_> {
    /// Tells when a timer takes the clock device's place, and when the device is back.
    fn watch_clock(&mut self, engine: &Engine) {
        let seconds = engine.now() as f64 * 1e-9;
        match (self.is_on_timer, engine.timeline.is_on_timer()) {
            (false, true) => tracing::warn!("at {seconds:.3} s: the clock device is silent, a timer takes its place"),
            (true, false) => tracing::info!("at {seconds:.3} s: the clock device is back"),
            _ => {}
        }
        self.is_on_timer = engine.timeline.is_on_timer();
    }

    /// Waits for the next sample of a live clock, or until `next` [ns]; the time of the tick, and how late it is [ns].
    fn wait(&self, engine: &Engine, next: i64) -> (i64, i64) {
        let due = self.epoch + Duration::from_nanos(next.max(0) as u64);
        let sampled = engine.devices.iter().enumerate().find_map(|(i, device)| match &device.link {
            Link::Live(linked) if engine.timeline.is_clock(i) => Some(linked.sampled.clone()),
            _ => None,
        });
        let has_live_clock = sampled.is_some();
        let mut interrupted = self.interrupted.clone();
        self.runtime.block_on(async {
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
        // Stepped devices live in virtual time: a late tick is still the tick of its time. A live one would get all ticks
        // that were missed at once.
        (if has_live_clock || self.is_live { now } else { next.max(engine.now()) }, now - next)
    }

    /// Live devices that have ended with an error, or that have ended at all, are lost.
    fn failed_driver(&mut self, engine: &mut Engine) {
        while let Some(ended) = self.drivers.try_join_next_with_id() {
            let (task, message) = match ended {
                Ok((task, Ok(()))) => (task, "it ended before the run did".to_owned()),
                Ok((task, Err(error))) => (task, error.0),
                Err(error) => (error.id(), panic_of(error)),
            };
            let (_, device) = self.tasks.iter().find(|(id, _)| *id == task).expect("every driver is of a device");
            engine.lose_device(*device, message);
        }
    }

    /// Ramps every command to zero, in real time where the run was, and lets the drivers end.
    fn stop(&mut self, engine: &mut Engine) {
        /// How long a driver may take to end.
        const GRACE: Duration = Duration::from_secs(1);
        /// How long a driver has for its last command.
        const LAST_WORD: Duration = Duration::from_millis(50);
        while !engine.wind_down() {
            if self.is_real {
                std::thread::sleep(Duration::from_nanos(engine.period() as u64));
            }
        }
        engine.wind_down();
        if self.is_live {
            // A driver reads the zero before it hears that it may end.
            std::thread::sleep(LAST_WORD);
        }
        for device in &engine.devices {
            if let Link::Live(linked) = &device.link {
                linked.stop.send_replace(true);
            }
        }
        let drivers = std::mem::take(&mut self.drivers);
        // What has not ended by then ends with the runtime.
        let _ = self.runtime.block_on(async { tokio::time::timeout(GRACE, drivers.join_all()).await });
    }
}

fn panic_of(error: tokio::task::JoinError) -> String {
    match error.try_into_panic() {
        Ok(panic) => format!("it panicked: {}", panic_message(&*panic)),
        Err(error) => error.to_string(),
    }
}

/// Timers are good to a millisecond; the rest of the way is slept by the thread itself.
async fn sleep_until(due: Instant) {
    const COARSE: Duration = Duration::from_millis(2);
    tokio::time::sleep_until((due - COARSE.min(due.saturating_duration_since(Instant::now()))).into()).await;
    std::thread::sleep(due.saturating_duration_since(Instant::now()));
}
