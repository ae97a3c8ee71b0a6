//! A whole graph in a test, which feeds its roles.

use std::sync::{Arc, PoisonError};

use super::fed::{Event, FedDevice, FedRole, Queue};
use crate::catalogue::Catalogue;
use crate::device::{DeviceError, Output, Samples};
use crate::engine::Engine;
use crate::fault::Fault;
use crate::graph::{Request, compile};
use crate::signal::{Freshness, Signal};
use crate::source::{Report, suggestion};

/// A graph in virtual time. The test feeds some or all of its roles. Ports have the names of the graph: `pad.image`.
///
/// The graph reads a fed sample in the first tick at its time or later.
pub struct GraphRig {
    /// The engine, for everything that the rig has no method for.
    pub engine: Engine,
    fed: Vec<RoleFeed>,
}

/// A fed role: its name, its outputs with the sequence number of the last sample of each, and the actions to come.
struct RoleFeed {
    role: String,
    outputs: Vec<(String, u64)>,
    queue: Queue,
}

impl GraphRig {
    /// Builds the graph of a TOML text, with roles that the test feeds.
    ///
    /// # Errors
    /// All diagnostics of the graph.
    pub fn new(catalogue: Catalogue, graph: &str, fed: impl IntoIterator<Item = FedRole>) -> Result<Self, Report> {
        Self::open(catalogue, Request::text(graph), fed)
    }

    /// Builds a graph on its bench, such as `Request::file("graphs/hybrid.toml")`. The roles in `fed` replace those
    /// of the bench. The other roles keep their devices.
    ///
    /// # Errors
    /// All diagnostics of the graph.
    pub fn open(
        catalogue: Catalogue,
        request: Request,
        fed: impl IntoIterator<Item = FedRole>,
    ) -> Result<Self, Report> {
        let (mut catalogue, mut request, mut rigged) = (catalogue, request, Vec::new());
        for mut role in fed {
            role.complete(&catalogue);
            let (name, queue) = (role.name.clone(), Queue::default());
            request = request
                .set(format!("devices.{name}.type = \"{}\"", role.device_type()))
                .set(format!("bind.{name} = \"{name}\""));
            let outputs = role.outputs.iter().map(|(output, _)| (output.clone(), 0)).collect();
            rigged.push(RoleFeed { role: name, outputs, queue: Arc::clone(&queue) });
            catalogue = catalogue.device_type(Box::new(FedDevice { role, queue }));
        }
        Ok(Self { engine: Engine::new(compile(&catalogue, &request)?), fed: rigged })
    }

    /// Feeds the next sample of a port, taken at `ms`.
    ///
    /// # Panics
    /// If no fed role has that port.
    pub fn feed<T: Signal + Sync>(&mut self, port: &str, ms: f64, value: T) {
        let sequence = self.next_of(port);
        self.feed_as(port, ms, ms, sequence, value);
    }

    /// Feeds a sample at `at_ms` with the stamp `stamp_ms` and a sequence number.
    ///
    /// # Panics
    /// If no fed role has that port.
    pub fn feed_as<T: Signal + Sync>(&mut self, port: &str, at_ms: f64, stamp_ms: f64, sequence: u64, value: T) {
        self.queue(port, at_ms, sequence, move |samples, port| {
            *samples.write(Output::at(port), nanos(stamp_ms), sequence) = value;
        });
    }

    /// Feeds a sample without a value, taken at `ms`.
    ///
    /// # Panics
    /// If no fed role has that port.
    pub fn feed_absent(&mut self, port: &str, ms: f64) {
        let sequence = self.next_of(port);
        self.queue(port, ms, sequence, move |samples, port| {
            samples.clear(Output::<f64>::at(port), nanos(ms), sequence);
        });
    }

    /// Makes a port lost at `ms`, until it is fed again; see [`Samples::lost`].
    ///
    /// # Panics
    /// If no fed role has that port.
    pub fn lose(&mut self, port: &str, ms: f64, why: &'static str) {
        let sequence = self.next_of(port) - 1;
        self.queue(port, ms, sequence, move |samples, port| samples.lost(Output::<f64>::at(port), why));
    }

    /// Makes the device behind a fed role fail at `ms`.
    ///
    /// # Panics
    /// If no such role is fed.
    pub fn fail_device(&mut self, role: &str, ms: f64, why: &str) {
        let why = why.to_owned();
        push(self.role(role), ms, Box::new(move |_| Err(DeviceError(why))));
    }

    fn queue(&mut self, port: &str, ms: f64, sequence: u64, write: impl FnOnce(&mut Samples, usize) + Send + 'static) {
        let (fed, output) = self.output(port);
        fed.outputs[output].1 = sequence;
        let event = move |samples: &mut Samples| {
            write(samples, output);
            Ok(())
        };
        push(fed, ms, Box::new(event));
    }

    fn next_of(&mut self, port: &str) -> u64 {
        let (fed, output) = self.output(port);
        fed.outputs[output].1 + 1
    }

    fn role(&mut self, role: &str) -> &mut RoleFeed {
        let roles: Vec<String> = self.fed.iter().map(|fed| fed.role.clone()).collect();
        self.fed.iter_mut().find(|fed| fed.role == role).unwrap_or_else(|| {
            panic!("no role `{role}` is fed: {}", suggestion(role, roles.iter().map(String::as_str), "fed roles"))
        })
    }

    fn output(&mut self, port: &str) -> (&mut RoleFeed, usize) {
        let (role, name) = port.split_once('.').unwrap_or((port, ""));
        let fed = self.role(role);
        let found = fed.outputs.iter().position(|(output, _)| output == name);
        let output = found.unwrap_or_else(|| {
            let names = fed.outputs.iter().map(|(output, _)| output.as_str());
            panic!("role `{role}` has no output `{name}`: {}", suggestion(name, names, "outputs"))
        });
        (fed, output)
    }

    /// Runs the tick at `ms`.
    ///
    /// # Errors
    /// The reason of a fault.
    pub fn tick(&mut self, ms: f64) -> Result<(), Fault> {
        self.engine.tick(nanos(ms))
    }

    /// Runs all ticks of the next `ms` milliseconds, at the times of the graph's clock.
    ///
    /// # Errors
    /// The reason of a fault.
    pub fn run_for(&mut self, ms: f64) -> Result<(), Fault> {
        let end = self.engine.now() + nanos(ms);
        while let Some(next) = self.engine.next().filter(|next| *next <= end) {
            self.engine.tick(next)?;
        }
        Ok(())
    }

    /// Sends an operator word. It takes effect in the next tick.
    ///
    /// # Panics
    /// If no condition waits for the word.
    pub fn send(&mut self, word: &str) {
        self.engine.send(word).unwrap_or_else(|why| panic!("{why}"));
    }

    /// Returns the engine that runs the graph.
    pub const fn engine_mut(&mut self) -> &mut Engine {
        &mut self.engine
    }

    /// Returns the freshness of a port in the last tick.
    ///
    /// # Panics
    /// If there is no such port.
    pub fn freshness(&self, port: &str) -> Freshness {
        self.engine.mark(port).freshness(self.engine.ticks())
    }

    /// Returns the value of a port, or `None` while it is absent.
    ///
    /// # Panics
    /// If there is no port of that name and kind.
    #[must_use]
    pub fn get<T: Signal>(&self, port: &str) -> Option<&T> {
        self.engine.get(port)
    }

    /// Returns the age of the value of a port [ms]; zero for generated motion.
    ///
    /// # Panics
    /// If there is no such port.
    #[must_use]
    pub fn age_ms(&self, port: &str) -> f64 {
        self.engine.mark(port).stamp().age(self.engine.now()) as f64 * 1e-6
    }
}

fn push(fed: &RoleFeed, ms: f64, event: Event) {
    fed.queue.lock().unwrap_or_else(PoisonError::into_inner).push_back((nanos(ms), event));
}

fn nanos(ms: f64) -> i64 {
    (ms * 1e6).round() as i64
}
