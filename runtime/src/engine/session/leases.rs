//! The commands of a tick on their way to the live devices, and the leases under which these follow them.

use super::engine::Engine;
use super::trouble::{Origin, Trouble};
use crate::engine::core::DeviceLink;
use crate::fault::Fault;
use crate::graph::Policy;

impl Engine {
    /// Hands over the commands of this tick to the live devices, which follow them for a short time.
    pub(super) fn send_commands(&mut self) {
        let (now, lease) = (self.core.tick.now, self.schedule.lease());
        for device in &mut self.devices {
            if let DeviceLink::Live(linked) = &mut device.link {
                linked.send(&mut device.commands, now, lease);
            }
        }
    }

    /// Stops the tasks of every device that has stopped by itself, because the last tick was too long ago.
    pub(super) fn check_leases(&mut self, now: i64) -> Result<(), Fault> {
        let lease = self.schedule.lease();
        for i in 0..self.devices.len() {
            let device = &mut self.devices[i];
            let lost = match &mut device.link {
                DeviceLink::Live(linked) => linked.loses_lease(now, lease).then(|| linked.refusal()),
                _ => device.lease_lost.take(),
            };
            if let Some(refusal) = lost {
                // The device ramps by itself, so the graph starts again from rest.
                device.commands.rest();
                if let Some(log) = &mut self.inputs {
                    log.lost_lease(i, refusal.as_deref());
                }
                device.refusal = refusal;
                self.raise(Origin::Device(i), |_| Policy::Stop, Trouble::Lease(i))?;
            }
        }
        Ok(())
    }

    /// Lets the devices of a task move again that have stopped by themselves.
    pub(super) fn renew_leases(&mut self, task: usize) {
        for i in 0..self.devices.len() {
            let concerns = self.concerns(Origin::Device(i), task);
            let device = &mut self.devices[i];
            if let DeviceLink::Live(linked) = &mut device.link
                && concerns
                && device.failed.is_none()
            {
                linked.renew();
            }
        }
    }
}
