//! A live driver in a test, without a graph.

use std::time::{Duration, Instant};

use super::params::with_params;
use crate::device::{
    Commands, Description, Device, DeviceError, Driver, LinkSetup, Linked, Opened, Output, SampleState, Samples,
    device_type, start,
};
use crate::node::{Mistakes, Reader};
use crate::signal::Signal;
use crate::source::Value;

/// A live device that runs on a thread of its own, in real time. The test takes the place of the graph: it waits
/// for samples, sends commands and stops the device. Ports are named without their role: `value`.
pub struct LinkRig {
    description: Description,
    linked: Linked,
    samples: Samples,
    commands: Commands,
    epoch: Instant,
    /// For each output, how many of its samples [`next`](Self::next) has returned.
    seen: Vec<u64>,
}

impl LinkRig {
    /// Opens a device with the parameters of a TOML text and starts it.
    ///
    /// # Errors
    /// The mistakes in the parameters.
    ///
    /// # Panics
    /// If the text is not TOML, or if the device is not live.
    pub fn start<D: Device>(params: &str) -> Result<Self, Mistakes> {
        let open = |table: &Value, reader: &mut Reader<'_>| device_type::<D>().open(table, reader);
        let Opened { description, driver } = with_params(params, open)?;
        let Driver::Live(driver) = driver else { panic!("`{}` is a stepped device", D::NAME) };
        let (samples, commands) = (Samples::of(&description), Commands::of(&description));
        let epoch = Instant::now();
        let accelerations = commands.values.iter().map(|values| vec![f64::INFINITY; values.len()]).collect();
        let setup =
            LinkSetup { description: &description, samples: &samples, commands: &commands, accelerations, epoch };
        let linked = start(D::NAME, driver, setup).expect("the operating system gives a thread");
        let seen = vec![0; samples.ports.len()];
        Ok(Self { description, linked, samples, commands, epoch, seen })
    }

    /// Waits for the next sample of a port. Returns `None` if none comes within `timeout`.
    ///
    /// # Panics
    /// If the device has no such output of that kind.
    pub fn next<T: Signal>(&mut self, port: &str, timeout: Duration) -> Option<&T> {
        let output = self.output::<T>(port);
        let seen = self.seen[output.port];
        let is_there = self.wait_until(timeout, |rig| rig.samples.ports[output.port].writes > seen);
        self.seen[output.port] = self.samples.ports[output.port].writes;
        if is_there { self.samples.get(output) } else { None }
    }

    /// Waits until `is_so`, for `timeout` at most. Returns whether it is.
    pub fn wait_until(&mut self, timeout: Duration, is_so: impl Fn(&Self) -> bool) -> bool {
        let end = Instant::now() + timeout;
        loop {
            self.linked.receive(&mut self.samples);
            if is_so(self) {
                return true;
            }
            if Instant::now() >= end {
                return false;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }

    /// Returns the newest value of a port, or `None` while it is absent or lost.
    ///
    /// # Panics
    /// If the device has no such output of that kind.
    #[must_use]
    pub fn get<T: Signal>(&self, port: &str) -> Option<&T> {
        self.samples.get(self.output::<T>(port))
    }

    /// Returns why a port is lost, or `None` if it is not.
    ///
    /// # Panics
    /// If the device has no such output.
    #[must_use]
    pub fn lost(&self, port: &str) -> Option<&str> {
        let index = self.description.outputs.iter().position(|output| output.name == port);
        let index = index.unwrap_or_else(|| panic!("the device has no output `{port}`"));
        match &self.samples.ports[index].state {
            SampleState::Lost => Some(&self.samples.ports[index].loss),
            SampleState::Value | SampleState::Absent => None,
        }
    }

    /// Returns how often the device has counted something; see [`Samples::count`].
    #[must_use]
    pub fn count(&self, what: &str) -> u64 {
        self.samples.counts.iter().find(|(known, _)| *known == what).map_or(0, |(_, count)| *count)
    }

    /// Sends a command, one value per joint. It is valid for 40 ms.
    ///
    /// # Panics
    /// If the device has no such command, or another number of joints.
    pub fn command(&mut self, port: &str, values: &[f64]) {
        let command = self.description.command(port).unwrap_or_else(|| panic!("the device has no command `{port}`"));
        self.commands.command(command, values);
        self.send();
    }

    /// Reports a value to the device.
    ///
    /// # Panics
    /// If the device reads no such report of that kind.
    pub fn report<T: Signal>(&mut self, port: &str, value: &T) {
        let report = self.description.report::<T>(port);
        let report = report.unwrap_or_else(|| panic!("the device reads no report `{port}` of that kind"));
        self.commands.set_report(report, value);
        self.send();
    }

    fn send(&mut self) {
        const LEASE: i64 = 40_000_000;
        let now = self.epoch.elapsed().as_nanos() as i64;
        self.linked.send(&mut self.commands, now, LEASE);
    }

    /// Lets a device move again that has stopped by itself, as the operator's `resume` does.
    pub fn resume(&mut self) {
        self.linked.renew();
    }

    /// Stops the device and waits until it has ended, for a second at most.
    ///
    /// # Errors
    /// Why the device failed, panicked, or did not end.
    pub fn stop(mut self) -> Result<(), DeviceError> {
        const GRACE: Duration = Duration::from_secs(1);
        self.linked.stop("the test is over");
        let end = Instant::now() + GRACE;
        while !self.linked.has_ended() && Instant::now() < end {
            std::thread::sleep(Duration::from_millis(1));
        }
        match self.linked.ended() {
            Some(Ok(ended)) => ended,
            Some(Err(_)) => Err("it panicked".into()),
            None => Err(DeviceError(format!("it is still running {GRACE:?} after it was stopped"))),
        }
    }

    fn output<T: Signal>(&self, port: &str) -> Output<T> {
        let output = self.description.output(port);
        output.unwrap_or_else(|| panic!("the device has no output `{port}` of the kind {}", T::KIND))
    }
}
