//! Live devices: an async driver on a thread of its own, preallocated slots with the newest values, and the tick on the
//! other side.

use std::borrow::Cow;
use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{JoinHandle, Thread};
use std::time::{Duration, Instant};

use async_trait::async_trait;
use tokio::sync::{Notify, watch};
use triple_buffer::TripleBuffer;

use super::clock::DeviceClock;
use super::exchange::Grant;
use super::lease::{Lease, LeaseState};
use super::{Commands, Description, DeviceError, Output, Samples};
use crate::signal::Signal;

/// A device that runs on its own, in real time.
#[async_trait]
pub trait Live: Send {
    /// Runs until [`Link::stopped`], [`Link::finish`] or a failure. It runs on a thread of its own, so it stops nothing else if it blocks.
    ///
    /// # Errors
    /// When the device fails. The run ends, unless the bench lets the device come back: then it is opened once more.
    async fn run(self: Box<Self>, link: Link) -> Result<(), DeviceError>;
}

/// A live device's end of the link to the graph.
pub struct Link {
    staging: Samples,
    samples: triple_buffer::Input<Samples>,
    commands: triple_buffer::Output<Commands>,
    lease: Lease,
    clock: DeviceClock,
    /// Number of writes in the samples that were published last.
    published: Arc<AtomicU64>,
    commanded: Arc<Notify>,
    /// Why the run has ended; empty while it runs.
    stop: watch::Receiver<String>,
    finished: Arc<AtomicBool>,
    /// Whether the device must not be opened once more.
    is_final: Arc<AtomicBool>,
    /// Whether it must send nothing.
    mute: Arc<AtomicBool>,
    /// The thread of the tick, which waits for samples.
    tick: Thread,
    epoch: Instant,
    /// Longest time between two commands.
    cycle: Duration,
    latency: i64,
    name: String,
}

impl Link {
    /// A moment in the graph's clock [ns].
    #[must_use]
    pub fn stamp(&self, at: Instant) -> i64 {
        at.saturating_duration_since(self.epoch).as_nanos() as i64
    }

    /// Returns the stamp of a sample that has just arrived from a device without a clock [ns]: now, less the latency
    /// that the device [states](Description::latency).
    #[must_use]
    pub fn arrival(&self) -> i64 {
        self.stamp(Instant::now()) - self.latency
    }

    /// Returns the stamp of a sample that has just arrived, and that the device measured at `time` in its own clock
    /// [ns]. The offset and the drift between the clocks are estimated from the samples.
    ///
    /// The age of a sample with this stamp is its true age, less the smallest delay of a sample and plus the latency
    /// that the device [states](Description::latency).
    pub fn stamp_of(&mut self, time: i64) -> i64 {
        let arrived = self.stamp(Instant::now());
        let steps = self.clock.steps;
        let stamp = self.clock.stamp(time, arrived);
        self.staging.clock = self.clock.reading();
        if self.clock.steps > steps {
            self.count("steps of its clock");
        }
        if let Some(rate) = self.clock.take_wrong_rate() {
            tracing::warn!("the clock of device `{}` runs at {rate:.2} times real time", self.name);
        }
        stamp - self.latency
    }

    /// Writes samples and publishes them; the graph sees the newest of each port.
    pub fn publish(&mut self, write: impl FnOnce(&mut Samples)) {
        self.hand_over(write);
        self.published.store(self.staging.writes, Ordering::Release);
        self.tick.unpark();
    }

    /// Makes a port absent until it is written again; see [`Samples::lost`]. The driver goes on, to reconnect for
    /// example.
    pub fn lost<T: Signal>(&mut self, port: Output<T>, why: impl Into<Cow<'static, str>>) {
        self.hand_over(|samples| samples.lost(port, why));
    }

    /// Counts something for the summary of the run, as a plural noun: `"bad frames"`.
    pub fn count(&mut self, what: &'static str) {
        self.hand_over(|samples| samples.count(what));
    }

    /// Counts several things at once, each as often as its number says; see [`count`](Self::count).
    pub fn count_each(&mut self, counts: &[(&'static str, u64)]) {
        let mut counts = counts.iter().filter(|(_, times)| *times > 0).peekable();
        if counts.peek().is_some() {
            self.hand_over(|samples| counts.for_each(|(what, times)| samples.count_by(what, *times)));
        }
    }

    fn hand_over(&mut self, write: impl FnOnce(&mut Samples)) {
        write(&mut self.staging);
        self.samples.input_buffer_mut().copy_from(&self.staging);
        self.samples.publish();
    }

    /// Returns the commands as they hold at this moment.
    ///
    /// They are valid for a short time only. If the graph does not renew them, each call returns the next step of a ramp
    /// to zero. So call this again for every command that is sent to the device.
    pub fn commands(&mut self) -> &Commands {
        let now = self.epoch.elapsed().as_nanos() as i64;
        self.lease.hold(self.commands.read(), now)
    }

    /// Refuses the commands of the graph until the operator resumes: [`commands`](Self::commands) ramps to zero, and the
    /// run stops. `why` completes "device `arm` does not follow commands:".
    ///
    /// For a robot whose controller stops by itself, and for a driver that fails and can still bring the device to rest.
    /// Call it in every cycle in which the robot must not move; the first reason is kept until the operator resumes.
    pub fn refuse(&mut self, why: impl Into<String>) {
        let epoch = self.epoch();
        let shared = self.lease.shared();
        if !shared.refuses(epoch) {
            shared.refuse_because(epoch, why.into());
        }
    }

    /// Whether commands are refused, by the driver or by the graph, until the operator resumes.
    pub fn refuses(&mut self) -> bool {
        let epoch = self.epoch();
        self.lease.shared().refuses(epoch)
    }

    /// Returns the epoch of the newest commands. Each `resume` of the operator after a refusal begins another one.
    ///
    /// A driver that checks its device before it moves again compares the epoch that it has checked with that of the
    /// commands: ask after [`commands`](Self::commands). [`refuses`](Self::refuses) alone shows no resume that came between
    /// two calls.
    pub fn epoch(&mut self) -> u64 {
        self.commands.read().grant.epoch
    }

    /// Whether the driver must send nothing to the device, as if this process had died. A driver of a device that moves
    /// asks before each message: the command that commissions a bench measures how the device stops by itself.
    #[must_use]
    pub fn is_mute(&self) -> bool {
        self.mute.load(Ordering::Acquire)
    }

    /// Waits for the next commands, for a period of the device and a quarter of its
    /// [`on_silence`](Description::on_silence) at most: then those that hold may have changed by themselves. The future
    /// does not borrow the link.
    pub fn commanded(&self) -> impl Future<Output = ()> + Send + use<> {
        let (commanded, cycle) = (Arc::clone(&self.commanded), self.cycle);
        async move { drop(tokio::time::timeout(cycle, commanded.notified()).await) }
    }

    /// Waits for the end of the run. The future does not borrow the link.
    pub fn stopped(&self) -> impl Future<Output = ()> + Send + use<> {
        let mut stop = self.stop.clone();
        async move {
            // An error means that the graph's end is gone, which is an end too.
            let _ = stop.wait_for(|reason| !reason.is_empty()).await;
        }
    }

    /// Returns why the run has ended, for a device that reports it; empty while the run goes on.
    #[must_use]
    pub fn reason(&self) -> String {
        self.stop.borrow().clone()
    }

    /// Keeps the device from being opened once more after this driver has ended with an error, where the bench says
    /// `reconnect`: another attempt cannot help, or is not safe.
    pub fn forbid_return(&self) {
        self.is_final.store(true, Ordering::Release);
    }

    /// Ends the run, because the device has no more samples. The driver can return after this.
    pub fn finish(&mut self) {
        self.finished.store(true, Ordering::Release);
        self.tick.unpark();
    }
}

/// The graph's end of the link to a live device.
pub(crate) struct Linked {
    samples: triple_buffer::Output<Samples>,
    commands: triple_buffer::Input<Commands>,
    published: Arc<AtomicU64>,
    commanded: Arc<Notify>,
    stop: watch::Sender<String>,
    finished: Arc<AtomicBool>,
    /// Whether the device must not be opened once more.
    is_final: Arc<AtomicBool>,
    /// Whether the driver must send nothing.
    mute: Arc<AtomicBool>,
    lease: Arc<LeaseState>,
    /// The epoch of the commands.
    epoch: u64,
    /// The last epoch in which the lease was lost, as far as the graph knows.
    lost: u64,
    /// The time until which the commands are valid, if they move the device [ns].
    moves_until: Option<i64>,
    /// Time of the last tick that sent commands [ns].
    sent: Option<i64>,
    /// The sequence number that was written last among the samples that were received.
    seen: Option<u64>,
    driver: Option<JoinHandle<Result<(), DeviceError>>>,
}

/// What a link needs to know of the graph.
pub(crate) struct LinkSetup<'a> {
    pub(crate) description: &'a Description,
    pub(crate) samples: &'a Samples,
    pub(crate) commands: &'a Commands,
    /// Maximum acceleration of each joint of each command [rad/s²].
    pub(crate) accelerations: Vec<Vec<f64>>,
    /// Time zero of the graph's clock.
    pub(crate) epoch: Instant,
    /// Whether the driver must not send anything, from the beginning.
    pub(crate) is_mute: bool,
}

/// Starts a driver on a thread of its own, and returns the graph's end of the link to it. The calling thread is woken
/// when the device has sampled.
///
/// # Errors
/// If the operating system gives no thread.
pub(crate) fn start(name: &str, driver: Box<dyn Live>, setup: LinkSetup<'_>) -> io::Result<Linked> {
    let LinkSetup { description, samples, commands, accelerations, epoch, is_mute } = setup;
    // A driver that is started again answers no sample of the one before it.
    let samples = Samples { newest: None, ..samples.clone() };
    let mut commands = commands.clone();
    commands.grant.seen = None;
    let (samples_in, samples_out) = TripleBuffer::new(&samples).split();
    let (commands_in, commands_out) = TripleBuffer::new(&commands).split();
    let (stop, stopping) = watch::channel(String::new());
    let period = Duration::from_secs_f64(description.period);
    // A device must not take the time between two samples for silence.
    let silence = Duration::from_secs_f64(description.silence());
    let cycle = period.min(silence / 4);
    let lease = Lease::new(commands.clone(), accelerations, cycle.as_nanos() as i64, silence.as_nanos() as i64);
    let shared = lease.shared();
    let (published, commanded) = (Arc::new(AtomicU64::new(samples.writes)), Arc::new(Notify::new()));
    let [finished, is_final, mute] = [false, false, is_mute].map(|is_so| Arc::new(AtomicBool::new(is_so)));
    let link = Link {
        staging: samples,
        samples: samples_in,
        commands: commands_out,
        lease,
        clock: DeviceClock::new(period.as_nanos() as i64),
        name: name.to_owned(),
        published: Arc::clone(&published),
        commanded: Arc::clone(&commanded),
        stop: stopping,
        finished: Arc::clone(&finished),
        is_final: Arc::clone(&is_final),
        mute: Arc::clone(&mute),
        tick: std::thread::current(),
        epoch,
        cycle,
        latency: (description.latency * 1e9) as i64,
    };
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let thread = std::thread::Builder::new().name(format!("device {name}"));
    let driver = Some(thread.spawn(move || runtime.block_on(driver.run(link)))?);
    Ok(Linked {
        samples: samples_out,
        commands: commands_in,
        published,
        commanded,
        stop,
        finished,
        is_final,
        mute,
        lease: shared,
        epoch: 1,
        lost: 0,
        moves_until: None,
        sent: None,
        seen: None,
        driver,
    })
}

impl Linked {
    /// Hands over the commands of the tick at `now` [ns], which are valid for `lease` [ns].
    pub(crate) fn send(&mut self, commands: &mut Commands, now: i64, lease: i64) {
        let until = now + lease;
        commands.grant = Grant { epoch: self.epoch, until, seen: self.seen };
        self.moves_until = (!commands.are_zero()).then_some(until);
        self.sent = Some(now);
        self.commands.input_buffer_mut().copy_from(commands);
        self.commands.publish();
        self.commanded.notify_one();
    }

    /// Whether the device has sampled since `samples` were received.
    pub(crate) fn has_sampled(&self, samples: &Samples) -> bool {
        self.published.load(Ordering::Acquire) != samples.writes
    }

    /// Takes the newest samples. Buffers rotate; nothing is copied. Returns whether the device has sampled.
    pub(crate) fn receive(&mut self, samples: &mut Samples) -> bool {
        let before = samples.writes;
        if self.samples.update() {
            std::mem::swap(samples, self.samples.output_buffer_mut());
            self.seen = samples.newest;
        }
        samples.writes != before
    }

    /// Whether the device has stopped, or stops, because its commands were not renewed up to `now` [ns], or because the
    /// process was suspended. Commands are valid for `lease` [ns]. Returns `true` once in an epoch. The device then rests until [`renew`](Self::renew).
    pub(crate) fn loses_lease(&mut self, now: i64, lease: i64) -> bool {
        /// Time between two ticks that only a suspended process explains [ns].
        const SUSPENDED: i64 = 500_000_000;
        let has_expired = self.moves_until.is_some_and(|until| until < now);
        let was_suspended = self.sent.is_some_and(|sent| now - sent > SUSPENDED.max(2 * lease));
        let is_lost = self.lost < self.epoch && (self.lease.refuses(self.epoch) || has_expired || was_suspended);
        if is_lost {
            self.refuse();
            self.lost = self.epoch;
        }
        is_lost
    }

    /// Refuses the commands of this epoch, so that the device comes to rest.
    pub(crate) fn refuse(&mut self) {
        self.lease.refuse(self.epoch);
        self.moves_until = None;
    }

    /// Makes every further command of the driver zero, without a ramp. Returns whether none was cut before.
    pub(crate) fn cut(&self) -> bool {
        self.lease.cut()
    }

    /// Returns why the driver refuses the commands; `None` if it gave no reason.
    pub(crate) fn refusal(&self) -> Option<String> {
        self.lease.reason(self.epoch)
    }

    /// Whether the last commands that the device got are zero, or its driver has ended.
    pub(crate) fn rests(&self) -> bool {
        self.lease.rests() || self.has_ended()
    }

    /// Begins a new epoch, if the last one is refused.
    pub(crate) fn renew(&mut self) {
        if self.lease.refuses(self.epoch) {
            self.epoch += 1;
        }
    }

    /// Keeps the driver from sending anything to the device, or lets it send again.
    pub(crate) fn mute(&self, is_mute: bool) {
        self.mute.store(is_mute, Ordering::Release);
    }

    /// Asks the driver to end, for a reason.
    pub(crate) fn stop(&self, reason: &str) {
        self.stop.send_replace(reason.to_owned());
    }

    /// Whether the device has no more samples.
    pub(crate) fn is_finished(&self) -> bool {
        self.finished.load(Ordering::Acquire)
    }

    /// Whether the driver has forbidden to open the device once more.
    pub(crate) fn is_final(&self) -> bool {
        self.is_final.load(Ordering::Acquire)
    }

    /// Whether the driver runs no more.
    pub(crate) fn has_ended(&self) -> bool {
        self.driver.as_ref().is_none_or(JoinHandle::is_finished)
    }

    /// Returns how the driver has ended: `None` while it runs, or if this has been returned before. A panic is an error
    /// with its message.
    pub(crate) fn ended(&mut self) -> Option<std::thread::Result<Result<(), DeviceError>>> {
        self.driver.take_if(|driver| driver.is_finished()).map(JoinHandle::join)
    }
}

/// Waits until something is so, for a time at most.
pub(crate) fn wait(patience: Duration, is_so: impl Fn() -> bool) {
    let end = Instant::now() + patience;
    while !is_so() && Instant::now() < end {
        std::thread::sleep(Duration::from_millis(1));
    }
}
