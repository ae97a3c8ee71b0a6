//! Describes a trouble as a fault with its node, port, tick, cause and source location.

use super::engine::Engine;
use super::trouble::{Trouble, WatchedWire};
use crate::fault::{Cause, Fault, StaleWire};

impl Engine {
    /// Returns the fault that a trouble of this tick causes.
    #[cold]
    pub(crate) fn describe(&self, trouble: Trouble) -> Fault {
        match trouble {
            Trouble::Stale(inlet) => {
                let (age, max_age) = self.core.inlets[inlet].ages(self.core.tick.now);
                let cause = age.map_or(Cause::NeverSampled, |age| Cause::Stale { age, max_age });
                self.port_fault(inlet, cause)
            }
            Trouble::StaleWire(wire) => {
                let WatchedWire { aged, node, port, span, .. } = &self.watched[wire];
                let age = self.core.bus.marks[aged.from as usize].stamp().age(self.core.tick.now);
                let from = self.ports.iter().find(|(_, id)| id.mark == aged.from).map_or("", |(port, _)| &port.name);
                let wire = StaleWire { from: from.to_owned(), age, max_age: aged.max_age };
                self.fault(node, port.clone(), Cause::StaleWire(wire.into()), self.sources.locate(span.start))
            }
            // The role ports come first in `ports`, one per inlet, so the index of an inlet is that of its port.
            Trouble::NotFinite(port) => self.port_fault(port, Cause::NotFinite),
            Trouble::Panicked(runner) => {
                let (node, place) = &self.names[runner];
                self.fault(node, None, Cause::Panicked(self.panic.clone()), place.clone())
            }
            Trouble::Device(device) => {
                let device = &self.devices[device];
                let why = device.failed.clone().unwrap_or_default();
                self.fault(&device.name, None, Cause::Device(why), device.place.clone())
            }
            Trouble::Lease(device) => {
                let device = &self.devices[device];
                let cause = device.refusal.clone().map_or(Cause::LostLease, Cause::Refused);
                self.fault(&device.name, None, cause, device.place.clone())
            }
            Trouble::Lost(inlet) => {
                let samples = &self.devices[self.core.inlets[inlet].device].samples;
                let why = self.core.inlets[inlet].lost(samples).unwrap_or_default();
                self.port_fault(inlet, Cause::Lost(why.to_owned()))
            }
            Trouble::Clock => {
                let (name, place) = self.clock().map_or(("", ""), |device| (&device.name, &device.place));
                self.fault(name, None, Cause::SilentClock, place.to_owned())
            }
            Trouble::Late(by) => self.fault("", None, Cause::Late { by }, String::new()),
            Trouble::Found(runner) => {
                let (node, place) = &self.names[runner];
                let why = self.core.found().nth(runner).flatten().unwrap_or_else(|| "it has failed".into());
                self.fault(node, None, Cause::Found(why), place.clone())
            }
            Trouble::Operator => self.fault("", None, Cause::Operator, String::new()),
        }
    }

    fn port_fault(&self, port: usize, cause: Cause) -> Fault {
        let name = &self.ports[port].0.name;
        let node = owner(name);
        let mut owners = self.names.iter().chain(&self.roles);
        let place = owners.find(|(known, _)| known == node).map(|(_, place)| place.clone()).unwrap_or_default();
        self.fault(node, Some(name[node.len() + 1..].to_owned()), cause, place)
    }

    pub(crate) fn fault(&self, node: &str, port: Option<String>, cause: Cause, place: String) -> Fault {
        Fault { node: node.into(), port, tick: self.core.tick.index, time: self.core.tick.now, cause, place }
    }
}

/// Returns the name of the node or role that a port belongs to.
pub(crate) fn owner(port: &str) -> &str {
    port.rsplit_once('.').expect("a port's name contains its owner's").0
}
