//! A live driver in a test, without a graph.

use std::time::{Duration, Instant};

use super::params::with_params;
use crate::device::{Attached, Device, DeviceError, Driver, Opened, device_type};
use crate::node::{Mistakes, Reader};
use crate::signal::Signal;
use crate::source::Value;

/// A live device that runs on a thread of its own, in real time. The test takes the place of the graph: it waits
/// for samples, sends commands and stops the device. Ports are named without their role: `value`.
pub struct LinkRig {
    attached: Attached,
    /// For each output that [`next`](Self::next) has read, how many of its samples it has returned.
    seen: Vec<(String, u64)>,
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
        let attached = Attached::start(D::NAME, description, driver).expect("the operating system gives a thread");
        Ok(Self { attached, seen: Vec::new() })
    }

    /// Waits for the next sample of a port, and skips samples after which the port was lost. Returns `None` if none comes
    /// within `timeout`, or if it has no value.
    ///
    /// # Panics
    /// If the device has no such output of that kind.
    pub fn next<T: Signal>(&mut self, port: &str, timeout: Duration) -> Option<&T> {
        let seen = self.seen.iter().find(|(name, _)| name == port).map_or(0, |(_, seen)| *seen);
        let is_there = self.wait_until(timeout, |rig| rig.attached.stamp(port).1 > seen && rig.lost(port).is_none());
        let written = self.attached.stamp(port).1;
        self.seen.retain(|(name, _)| name != port);
        self.seen.push((port.to_owned(), written));
        if is_there { self.attached.get(port) } else { None }
    }

    /// Waits until `is_so`, for `timeout` at most. Returns whether it is.
    pub fn wait_until(&mut self, timeout: Duration, is_so: impl Fn(&Self) -> bool) -> bool {
        let end = Instant::now() + timeout;
        loop {
            self.attached.receive();
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
        self.attached.get(port)
    }

    /// Returns why a port is lost, or `None` if it is not.
    ///
    /// # Panics
    /// If the device has no such output.
    #[must_use]
    pub fn lost(&self, port: &str) -> Option<&str> {
        self.attached.lost(port)
    }

    /// Returns how often the device has counted something; see [`Samples::count`](crate::device::Samples::count).
    #[must_use]
    pub fn count(&self, what: &str) -> u64 {
        self.attached.counts().iter().find(|(known, _)| *known == what).map_or(0, |(_, count)| *count)
    }

    /// Returns why the driver refuses commands; `None` while it follows them, or if it gave no reason.
    #[must_use]
    pub fn refusal(&self) -> Option<String> {
        self.attached.refusal()
    }

    /// Sends a command, one value per joint. It is valid for 40 ms.
    ///
    /// # Panics
    /// If the device has no such command, or another number of joints.
    pub fn command(&mut self, port: &str, values: &[f64]) {
        let command = self.attached.description().command(port);
        let command = command.unwrap_or_else(|| panic!("the device has no command `{port}`"));
        self.attached.commands().command(command, values);
        self.attached.send();
    }

    /// Reports a value to the device.
    ///
    /// # Panics
    /// If the device reads no such report of that kind.
    pub fn report<T: Signal>(&mut self, port: &str, value: &T) {
        let report = self.attached.description().report::<T>(port);
        let report = report.unwrap_or_else(|| panic!("the device reads no report `{port}` of that kind"));
        self.attached.commands().set_report(report, value);
        self.attached.send();
    }

    /// Lets a device move again that has stopped by itself, as the operator's `resume` does.
    pub fn resume(&mut self) {
        self.attached.resume();
    }

    /// Keeps the driver from sending anything to the device, as if the process had died; the driver still receives.
    pub fn mute(&mut self, is_mute: bool) {
        self.attached.mute(is_mute);
    }

    /// Stops the device and waits until it has ended, for a second at most.
    ///
    /// # Errors
    /// Why the device failed, panicked, or did not end.
    pub fn stop(self) -> Result<(), DeviceError> {
        self.attached.stop("the test is over")
    }
}
