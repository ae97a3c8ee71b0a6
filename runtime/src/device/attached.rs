//! A live device that runs without a graph: for tests of drivers, and for commands that look at a bench.

use std::io;
use std::time::{Duration, Instant};

use super::exchange::SampleState;
use super::live::{LinkSetup, Linked, Live, start, wait};
use super::{ClockReading, Commands, Description, DeviceError, Output, Samples};
use crate::signal::Signal;

/// Time for which a command is valid, as under a graph of 125 Hz or more [ns].
const LEASE: i64 = 40_000_000;

/// A live device that runs on a thread of its own. Its owner takes the place of the graph: it receives the samples and
/// renews the commands. Ports are named without their role: `image`.
pub struct Attached {
    description: Description,
    linked: Linked,
    samples: Samples,
    commands: Commands,
    epoch: Instant,
}

impl Attached {
    /// Starts the driver of a device. The calling thread is woken when the device has sampled.
    ///
    /// # Errors
    /// If the operating system gives no thread.
    pub fn start(name: &str, description: Description, driver: Box<dyn Live>) -> io::Result<Self> {
        Self::begin(name, description, driver, false)
    }

    /// Starts the driver of a device that is only listened to: it never sends anything to the device.
    ///
    /// # Errors
    /// If the operating system gives no thread.
    pub fn listen(name: &str, description: Description, driver: Box<dyn Live>) -> io::Result<Self> {
        let mut attached = Self::begin(name, description, driver, true)?;
        attached.rest();
        Ok(attached)
    }

    fn begin(name: &str, description: Description, driver: Box<dyn Live>, is_mute: bool) -> io::Result<Self> {
        let (samples, commands) = (Samples::of(&description), Commands::of(&description));
        let epoch = Instant::now();
        let accelerations = commands.values.iter().map(|values| vec![f64::INFINITY; values.len()]).collect();
        let setup = LinkSetup {
            description: &description,
            samples: &samples,
            commands: &commands,
            accelerations,
            epoch,
            is_mute,
        };
        let linked = start(name, driver, setup)?;
        Ok(Self { description, linked, samples, commands, epoch })
    }

    /// What the device states of itself.
    #[must_use]
    pub const fn description(&self) -> &Description {
        &self.description
    }

    /// Receives the newest samples. Returns whether the device has sampled since the last call.
    pub fn receive(&mut self) -> bool {
        self.linked.receive(&mut self.samples)
    }

    /// Returns the newest value of a port, or `None` while it is absent or lost.
    ///
    /// # Panics
    /// If the device has no such output of that kind.
    #[must_use]
    pub fn get<T: Signal>(&self, port: &str) -> Option<&T> {
        self.samples.get(self.output::<T>(port))
    }

    /// Returns the newest value of an output of the description, or `None` while it is absent or lost.
    #[must_use]
    pub fn read<T: Signal>(&self, output: Output<T>) -> Option<&T> {
        self.samples.get(output)
    }

    /// Returns how often an output of the description was written.
    #[must_use]
    pub fn writes<T: Signal>(&self, output: Output<T>) -> u64 {
        self.samples.ports[output.port].writes
    }

    /// Returns the stamp of the newest sample of a port, in ns since the start, and how often the port was written.
    ///
    /// # Panics
    /// If the device has no such output.
    #[must_use]
    pub fn stamp(&self, port: &str) -> (i64, u64) {
        self.stamp_at(self.index(port))
    }

    /// Returns what [`stamp`](Self::stamp) returns, of the output at a place among [`Description::outputs`].
    ///
    /// # Panics
    /// If the device has fewer outputs.
    #[must_use]
    pub fn stamp_at(&self, place: usize) -> (i64, u64) {
        let sample = &self.samples.ports[place];
        (sample.stamp, sample.writes)
    }

    /// Returns the time since the start [ns].
    #[must_use]
    pub fn now(&self) -> i64 {
        self.epoch.elapsed().as_nanos() as i64
    }

    /// Returns why a port is lost, or `None` if it is not.
    ///
    /// # Panics
    /// If the device has no such output.
    #[must_use]
    pub fn lost(&self, port: &str) -> Option<&str> {
        self.lost_at(self.index(port))
    }

    /// Returns why the output at a place among [`Description::outputs`] is lost, or `None` if it is not.
    ///
    /// # Panics
    /// If the device has fewer outputs.
    #[must_use]
    pub fn lost_at(&self, place: usize) -> Option<&str> {
        let sample = &self.samples.ports[place];
        (sample.state == SampleState::Lost).then_some(&*sample.loss)
    }

    /// Returns what the device's own clock shows, if the stamps of its samples are made of it.
    #[must_use]
    pub const fn clock(&self) -> Option<ClockReading> {
        self.samples.clock
    }

    /// Returns what the device has counted, in the order in which it first did.
    #[must_use]
    pub fn counts(&self) -> &[(&'static str, u64)] {
        &self.samples.counts
    }

    /// Takes the place of a graph that commands nothing: it renews commands of zero. Without it, no commands hold, and a
    /// driver cannot refuse them.
    pub fn rest(&mut self) {
        self.commands.rest();
        self.send();
    }

    /// Returns why the driver refuses commands; `None` while it follows them, or if it gave no reason.
    #[must_use]
    pub fn refusal(&self) -> Option<String> {
        self.linked.refusal()
    }

    /// Returns the commands and reports, to be set before [`send`](Self::send).
    pub const fn commands(&mut self) -> &mut Commands {
        &mut self.commands
    }

    /// Sends the commands and reports. They are valid for 40 ms.
    pub fn send(&mut self) {
        let now = self.now();
        self.linked.send(&mut self.commands, now, LEASE);
    }

    /// Lets a device move again that has stopped by itself, as the operator's `resume` does.
    pub fn resume(&mut self) {
        self.linked.renew();
    }

    /// Keeps the driver from sending anything to the device, as if this process had died; the driver still receives.
    pub fn mute(&mut self, is_mute: bool) {
        self.linked.mute(is_mute);
    }

    /// Whether the driver has ended, with or without an error.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.linked.has_ended()
    }

    /// Stops the device and waits until it has ended, for a second at most.
    ///
    /// # Errors
    /// Why the device failed, panicked, or did not end.
    pub fn stop(mut self, reason: &str) -> Result<(), DeviceError> {
        const GRACE: Duration = Duration::from_secs(1);
        self.linked.stop(reason);
        wait(GRACE, || self.linked.has_ended());
        match self.linked.ended() {
            Some(Ok(ended)) => ended,
            Some(Err(_)) => Err("it panicked".into()),
            None => Err(DeviceError(format!("it is still running {GRACE:?} after it was stopped"))),
        }
    }

    fn index(&self, port: &str) -> usize {
        let index = self.description.outputs.iter().position(|output| output.name == port);
        index.unwrap_or_else(|| panic!("the device has no output `{port}`"))
    }

    fn output<T: Signal>(&self, port: &str) -> Output<T> {
        let output = self.description.output(port);
        output.unwrap_or_else(|| panic!("the device has no output `{port}` of the kind {}", T::KIND))
    }
}
