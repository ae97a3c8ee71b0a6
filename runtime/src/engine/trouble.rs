//! What can go wrong in a tick, and how it is told: node, port, tick, cause and place.

use std::ops::Range;

use super::Engine;
use super::cycle::owner;
use super::station::Aged;
use crate::fault::{Cause, Fault, StaleWire};
use crate::graph::Policy;

/// A wire whose age does more than that its node goes without.
pub(super) struct WatchedWire {
    pub(super) aged: Aged,
    pub(super) stale: Policy,
    /// The node it comes to; or the role, with the command.
    pub(super) node: String,
    pub(super) port: Option<String>,
    /// Where it is written.
    pub(super) span: Range<usize>,
}

/// A trouble of a tick, in numbers: it is put into words only when it has to be told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Trouble {
    /// The newest sample of an inlet is too old.
    Stale(usize),
    /// What came over a watched wire is too old.
    StaleWire(usize),
    /// A sample of an inlet is not finite.
    NotFinite(usize),
    /// A port is not finite.
    NotFiniteAt(usize),
    /// A station panicked, or waits for its reset.
    Panicked(usize),
    /// A device has failed.
    Device(usize),
    /// The clock device is silent.
    Clock,
    /// The tick began so late [ns].
    Late(i64),
    /// The operator wanted it.
    Operator,
}

impl Engine {
    /// A trouble in words.
    #[cold]
    pub(super) fn tell(&self, trouble: Trouble) -> Fault {
        match trouble {
            Trouble::Stale(inlet) => {
                let (age, max_age) = self.core.inlets[inlet].ages(self.core.tick.now);
                self.of_port(inlet, Cause::Stale { age, max_age })
            }
            Trouble::StaleWire(wire) => {
                let WatchedWire { aged, node, port, span, .. } = &self.watched[wire];
                let age = self.core.bus.marks[aged.from as usize].stamp().age(self.core.tick.now);
                let from = self.ports.iter().find(|(_, id)| id.mark == aged.from).map_or("", |(port, _)| &port.name);
                let wire = StaleWire { from: from.to_owned(), age, max_age: aged.max_age };
                self.fault(node, port.clone(), Cause::StaleWire(wire.into()), self.sources.locate(span.start))
            }
            // The ports of the roles come first, an inlet each.
            Trouble::NotFinite(port) | Trouble::NotFiniteAt(port) => self.of_port(port, Cause::NotFinite),
            Trouble::Panicked(station) => {
                let (node, place) = &self.names[station];
                self.fault(node, None, Cause::Panicked(self.panic.clone()), place.clone())
            }
            Trouble::Device(device) => {
                let deck = &self.decks[device];
                let why = deck.failed.clone().unwrap_or_default();
                self.fault(&deck.name, None, Cause::Device(why), deck.place.clone())
            }
            Trouble::Clock => {
                let clock = (0..self.decks.len()).find(|device| self.timeline.is_clock(*device));
                let (name, place) = clock.map_or(("", ""), |i| (&self.decks[i].name, &self.decks[i].place));
                self.fault(name, None, Cause::SilentClock, place.to_owned())
            }
            Trouble::Late(by) => self.fault("", None, Cause::Late { by }, String::new()),
            Trouble::Operator => self.fault("", None, Cause::Operator, String::new()),
        }
    }

    fn of_port(&self, port: usize, cause: Cause) -> Fault {
        let name = &self.ports[port].0.name;
        let node = owner(name);
        let mut owners = self.names.iter().chain(&self.roles);
        let place = owners.find(|(known, _)| known == node).map(|(_, place)| place.clone()).unwrap_or_default();
        self.fault(node, Some(name[node.len() + 1..].to_owned()), cause, place)
    }

    pub(super) fn fault(&self, node: &str, port: Option<String>, cause: Cause, place: String) -> Fault {
        Fault { node: node.into(), port, tick: self.core.tick.index, time: self.core.tick.now, cause, place }
    }
}

/// What a panic had to say.
pub(super) fn said(panic: &(dyn std::any::Any + Send)) -> String {
    let text = panic.downcast_ref::<&str>().map(|text| (*text).to_owned());
    text.or_else(|| panic.downcast_ref::<String>().cloned()).unwrap_or_else(|| "no message".into())
}
