//! The edge to real time: pacing, live devices, the operator's Ctrl-C; and the end of every run, which is a ramp to zero.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::time::{Duration, Instant};
use std::{fmt, io};

use tokio::runtime::{Builder, Runtime};
use tokio::sync::watch;
use tokio::task::JoinSet;

use super::drive::{Pace, drive, hopeless};
use super::words::Words;
use super::{Edge, Engine};
use crate::device::{DeviceError, link};
use crate::fault::Fault;

/// How to run.
#[derive(Debug, Clone, Default)]
pub struct RunOptions {
    /// How long at most, in the graph's clock [s].
    pub duration: Option<f64>,
    /// Whether virtual time is paced by the wall clock; live devices always are.
    pub is_realtime: bool,
    /// Words that are sent from outside: when, in the graph's time [s], and which. `stop` halts all commands, `resume`
    /// lets them go on, others are for the modes.
    pub sends: Vec<(f64, String)>,
    /// Whether words come in over the standard input, one a line.
    pub listens: bool,
}

/// Why a run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum End {
    /// A device has no more samples.
    Finished,
    /// The time is over.
    Duration,
    /// A mode says that the task is done.
    Done,
    /// The operator wanted it.
    Interrupted,
    /// Something went wrong.
    Fault(Box<Fault>),
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Finished => f.write_str("a device has no more samples"),
            Self::Duration => f.write_str("the time is over"),
            Self::Done => f.write_str("the task is done"),
            Self::Interrupted => f.write_str("the operator ended it"),
            Self::Fault(fault) => fault.fmt(f),
        }
    }
}

/// How a run went.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// Why it ended.
    pub end: End,
    /// Time of the last tick in the graph's clock, the ramp to zero aside [ns].
    pub time: i64,
    /// Number of ticks, the ramp to zero aside.
    pub ticks: u64,
    /// Time it took.
    pub wall: Duration,
    /// Ticks that began more than a period late; counted with a real clock only.
    pub late: u64,
}

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
        for (i, deck) in engine.decks.iter_mut().enumerate() {
            let edge = std::mem::replace(&mut deck.edge, Edge::Gone);
            deck.edge = match edge {
                Edge::Idle(driver) => {
                    tracing::info!("device `{}` starts", deck.name);
                    let (theirs, ours) = link(&deck.samples, &deck.commands, epoch);
                    let task = drivers.spawn_on(driver.run(theirs), runtime.handle());
                    tasks.push((task.id(), i));
                    Edge::Live(ours)
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
        let sampled = engine.decks.iter().enumerate().find_map(|(i, deck)| match &deck.edge {
            Edge::Live(linked) if engine.timeline.is_clock(i) => Some(linked.sampled.clone()),
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
        for deck in &engine.decks {
            if let Edge::Live(linked) = &deck.edge {
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
        Ok(panic) => format!("it panicked: {}", super::trouble::said(&*panic)),
        Err(error) => error.to_string(),
    }
}

/// Timers are good to a millisecond; the rest of the way is slept by the thread itself.
async fn sleep_until(due: Instant) {
    const COARSE: Duration = Duration::from_millis(2);
    tokio::time::sleep_until((due - COARSE.min(due.saturating_duration_since(Instant::now()))).into()).await;
    std::thread::sleep(due.saturating_duration_since(Instant::now()));
}

/// The operator's wish to end what runs, for those who run without [`run`]: from here on Ctrl-C and SIGTERM are caught. A
/// second one ends the process at once.
pub struct Interrupt {
    /// What listens for them lives in it.
    _runtime: Runtime,
    interrupted: watch::Receiver<bool>,
}

impl Interrupt {
    /// Catches them.
    ///
    /// # Errors
    /// If the operating system gives no runtime for signals.
    pub fn catch() -> io::Result<Self> {
        let runtime = Builder::new_multi_thread().worker_threads(1).enable_all().build()?;
        let interrupted = runtime.block_on(async { interrupts() })?;
        Ok(Self { _runtime: runtime, interrupted })
    }

    /// Whether the operator wants the end.
    #[must_use]
    pub fn is_requested(&self) -> bool {
        *self.interrupted.borrow()
    }
}

/// Becomes true at the first Ctrl-C or SIGTERM; a second one ends the process at once.
///
/// They are caught from here on, and not only once the task has begun: on a busy machine that may take a while.
fn interrupts() -> io::Result<watch::Receiver<bool>> {
    const INTERRUPTED: i32 = 130;
    let (sender, receiver) = watch::channel(false);
    let mut signals = Signals::catch()?;
    tokio::spawn(async move {
        while signals.next().await.is_ok() {
            if sender.send_replace(true) {
                std::process::exit(INTERRUPTED);
            }
        }
    });
    Ok(receiver)
}

#[cfg(unix)]
struct Signals {
    interrupt: tokio::signal::unix::Signal,
    terminate: tokio::signal::unix::Signal,
    /// The terminal is gone.
    hangup: tokio::signal::unix::Signal,
}

#[cfg(unix)]
impl Signals {
    fn catch() -> io::Result<Self> {
        use tokio::signal::unix::{SignalKind, signal};
        Ok(Self {
            interrupt: signal(SignalKind::interrupt())?,
            terminate: signal(SignalKind::terminate())?,
            hangup: signal(SignalKind::hangup())?,
        })
    }

    async fn next(&mut self) -> io::Result<()> {
        tokio::select! {
            _ = self.interrupt.recv() => {}
            _ = self.terminate.recv() => {}
            _ = self.hangup.recv() => {}
        }
        Ok(())
    }
}

#[cfg(not(unix))]
struct Signals;

#[cfg(not(unix))]
#[expect(clippy::unnecessary_wraps, reason = "the same form as on unix")]
impl Signals {
    fn catch() -> io::Result<Self> {
        Ok(Self)
    }

    async fn next(&mut self) -> io::Result<()> {
        tokio::signal::ctrl_c().await
    }
}
