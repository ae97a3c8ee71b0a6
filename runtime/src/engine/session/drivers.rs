//! Starts and ends the drivers of live devices, each on a thread of its own.

use std::io;
use std::time::{Duration, Instant};

use super::engine::Engine;
use super::trouble::panic_message;
use crate::device::{Again, LinkSetup, Linked, Live, start, wait};
use crate::engine::core::{CommandSlot, DeviceLink, DeviceSlot};

impl Engine {
    /// Starts the driver of each live device. `epoch` is time zero of the graph's clock.
    pub(super) fn start_drivers(&mut self, epoch: Instant) -> io::Result<()> {
        for (i, device) in self.devices.iter_mut().enumerate() {
            if !matches!(device.link, DeviceLink::Idle(_)) {
                continue;
            }
            if let DeviceLink::Idle(driver) = std::mem::replace(&mut device.link, DeviceLink::Gone) {
                let slots = self.core.commands.iter().filter(|slot| slot.device == i);
                launch(device, driver, slots, epoch)?;
            }
        }
        Ok(())
    }

    /// Lets the devices that compute beside the tick run by themselves: in real time, no tick waits for them.
    pub(super) fn leave_lockstep(&mut self) {
        for device in &mut self.devices {
            if let Some(driver) = device.in_real_time.take() {
                device.link = DeviceLink::Idle(driver);
            }
        }
    }

    /// Opens each device once more whose pause after an error is over. It is as at the start of the run, and its commands
    /// wait for `resume` if it moves something.
    pub(super) fn restart_drivers(&mut self, epoch: Instant) {
        for i in 0..self.devices.len() {
            let device = &mut self.devices[i];
            let DeviceLink::Down(at) = device.link else { continue };
            if Instant::now() < at {
                continue;
            }
            let Some(driver) = device.description.again.as_ref().and_then(Again::open) else {
                self.lose_device(i, "it cannot be opened once more".to_owned());
                continue;
            };
            device.samples.count("restarts");
            let slots = self.core.commands.iter().filter(|slot| slot.device == i);
            if let Err(error) = launch(device, driver, slots, epoch) {
                self.lose_device(i, error.to_string());
            }
        }
    }

    /// Marks every live device as failed whose driver has ended, with or without an error. One that the bench lets come
    /// back pauses after an error instead; a panic is a mistake of the driver, and is not repeated.
    pub(super) fn collect_ended_drivers(&mut self) {
        for i in 0..self.devices.len() {
            let device = &mut self.devices[i];
            let DeviceLink::Live(linked) = &mut device.link else { continue };
            let may_return = device.description.may_return && !linked.is_final();
            let message = match linked.ended() {
                None => continue,
                Some(Ok(Ok(()))) if linked.is_finished() => continue,
                Some(Ok(Ok(()))) => "it ended before the run did".to_owned(),
                Some(Ok(Err(error))) if may_return && device.failed.is_none() => {
                    device.goes_down(&error.0);
                    continue;
                }
                Some(Ok(Err(error))) => error.0,
                Some(Err(panic)) => format!("it panicked: {}", panic_message(&*panic)),
            };
            self.lose_device(i, message);
        }
    }

    /// Stops the drivers for a reason, once each device has got commands of zero, or when `patience` is over. Does not wait
    /// for a driver that blocks.
    pub(super) fn stop_drivers(&mut self, reason: &str, patience: Duration) {
        /// Time that a driver has to send its last command, beside two of its periods.
        const LAST_COMMAND: Duration = Duration::from_millis(50);
        const MAX_LAST_COMMAND: Duration = Duration::from_millis(500);
        /// Time that the drivers have to end.
        const GRACE: Duration = Duration::from_secs(1);
        if self.running().next().is_none() {
            return;
        }
        wait(patience, || self.running().all(Linked::rests));
        self.cut_ramp();
        let periods = self.devices.iter().filter(|device| matches!(device.link, DeviceLink::Live(_)));
        let longest = periods.map(|device| device.description.period).fold(0.0, f64::max);
        std::thread::sleep(Duration::from_secs_f64(2.0 * longest).clamp(LAST_COMMAND, MAX_LAST_COMMAND));
        self.running().for_each(|linked| linked.stop(reason));
        wait(GRACE, || self.running().next().is_none());
    }

    /// Returns the links whose drivers have not ended.
    fn running(&self) -> impl Iterator<Item = &Linked> {
        self.devices.iter().filter_map(|device| device.link.live()).filter(|linked| !linked.has_ended())
    }
}

/// Starts the driver of a device. `slots` are its commands.
fn launch<'c>(
    device: &mut DeviceSlot,
    driver: Box<dyn Live>,
    slots: impl Iterator<Item = &'c CommandSlot>,
    epoch: Instant,
) -> io::Result<()> {
    tracing::info!("device `{}` starts", device.name);
    let setup = LinkSetup {
        description: &device.description,
        samples: &device.samples,
        commands: &device.commands,
        accelerations: accelerations(&device.commands.values, slots),
        epoch,
        is_mute: false,
    };
    device.writes_at_start = device.samples.writes;
    device.link = DeviceLink::Live(start(&device.name, driver, setup)?);
    Ok(())
}

/// Returns the accelerations of the joints of each command of a device, from the commands that the graph wires.
fn accelerations<'c>(commands: &[Box<[f64]>], slots: impl Iterator<Item = &'c CommandSlot>) -> Vec<Vec<f64>> {
    let mut accelerations: Vec<Vec<f64>> = commands.iter().map(|values| vec![f64::INFINITY; values.len()]).collect();
    slots.for_each(|slot| accelerations[slot.command].copy_from_slice(&slot.accelerations));
    accelerations
}
