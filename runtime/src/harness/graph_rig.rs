//! A whole graph on a table, fed by hand.

use std::borrow::Cow;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, PoisonError};

use crate::catalogue::Catalogue;
use crate::device::{Commands, Description, DeviceError, DeviceType, Driver, Filled, Opened, Samples, Stepped};
use crate::engine::Engine;
use crate::fault::Fault;
use crate::graph::{Request, compile};
use crate::node::{ParamSpec, PortId, Reader};
use crate::signal::{Freshness, Shape, Signal};
use crate::source::Report;
use crate::source::Value;

type Write = Box<dyn FnOnce(&mut Samples) + Send>;

/// What a test has fed and a device has not given yet: the time, and how to write it.
type Queue = Arc<Mutex<VecDeque<(i64, Write)>>>;

/// A role filled by hand.
pub struct Source {
    /// Name of the role in the graph.
    pub role: &'static str,
    /// Type of the role.
    pub kind: &'static str,
    /// Nominal time between two samples [s].
    pub period: f64,
    /// Shapes of the role's outputs.
    pub outputs: Vec<Shape>,
    /// Shapes of the role's commands.
    pub commands: Vec<Shape>,
}

/// A graph whose roles are fed by the test, in virtual time.
///
/// A sample that is fed is latched in the first tick at its time or later.
pub struct GraphRig {
    /// The engine, for everything the rig has no word for.
    pub engine: Engine,
    queues: Vec<(&'static str, Queue, u64)>,
}

impl GraphRig {
    /// The graph of a TOML text, with its roles filled by hand.
    ///
    /// # Errors
    /// Everything that is wrong with the graph.
    pub fn new(catalogue: Catalogue, graph: &str, sources: Vec<Source>) -> Result<Self, Report> {
        let (mut catalogue, mut bench, mut queues) = (catalogue, String::new(), Vec::new());
        for source in sources {
            let queue = Queue::default();
            let role = source.role;
            bench.push_str(&format!("devices.{role}.type = \"by_hand_{role}\"\nbind.{role} = \"{role}\"\n"));
            queues.push((role, Arc::clone(&queue), 0));
            catalogue = catalogue.device_type(Box::new(ByHand { source, queue }));
        }
        let request = Request { bench_text: Some(bench), ..Request::text(graph) };
        Ok(Self { engine: Engine::new(compile(&catalogue, &request)?), queues })
    }

    /// Feeds the next sample of a role's `port`-th output, taken at `ms`.
    ///
    /// # Panics
    /// If there is no such role.
    pub fn feed<T: Signal + Sync>(&mut self, role: &str, port: usize, ms: f64, value: T) {
        let (_, _, sequence) = self.queue(role);
        let next = *sequence + 1;
        self.feed_as(role, port, ms, ms, next, value);
    }

    /// Feeds a sample at `at_ms` that says it was taken at `stamp_ms`, as the `sequence`-th.
    ///
    /// # Panics
    /// If there is no such role.
    pub fn feed_as<T: Signal + Sync>(
        &mut self,
        role: &str,
        port: usize,
        at_ms: f64,
        stamp_ms: f64,
        sequence: u64,
        value: T,
    ) {
        let (_, queue, last) = self.queue(role);
        *last = sequence;
        let write: Write = Box::new(move |samples| *samples.write(port, nanos(stamp_ms), sequence) = value);
        queue.lock().unwrap_or_else(PoisonError::into_inner).push_back((nanos(at_ms), write));
    }

    fn queue(&mut self, role: &str) -> &mut (&'static str, Queue, u64) {
        self.queues.iter_mut().find(|(name, ..)| *name == role).unwrap_or_else(|| panic!("no role is called `{role}`"))
    }

    /// Runs the tick at `ms`.
    ///
    /// # Errors
    /// The reason of a fault.
    pub fn tick(&mut self, ms: f64) -> Result<(), Fault> {
        self.engine.tick(nanos(ms))
    }

    /// Sends a word from outside; it is there in the next tick.
    pub fn send(&mut self, word: &str) {
        self.engine.send(word).unwrap_or_else(|why| panic!("{why}"));
    }

    fn port(&self, name: &str) -> PortId {
        let found = self.engine.ports().iter().find(|(port, _)| port.name == name);
        found.unwrap_or_else(|| panic!("there is no port `{name}`")).1
    }

    /// Freshness of a port in the last tick.
    ///
    /// # Panics
    /// If there is no such port.
    #[must_use]
    pub fn freshness(&self, port: &str) -> Freshness {
        self.engine.bus().marks[self.port(port).mark as usize].freshness(self.engine.ticks())
    }

    /// What is on a port; `None` if it is absent.
    ///
    /// # Panics
    /// If there is no such port of that kind.
    #[must_use]
    pub fn get<T: Signal>(&self, port: &str) -> Option<&T> {
        let (planned, id) = self.engine.ports().iter().find(|(planned, _)| planned.name == port)?;
        assert_eq!(planned.shape.kind(), T::KIND, "port `{port}`");
        let bus = self.engine.bus();
        bus.marks[id.mark as usize].is_present().then(|| &T::arena(&bus.arenas)[id.slot as usize])
    }

    /// Age of what is on a port [ms]; zero for generated motion.
    ///
    /// # Panics
    /// If there is no such port.
    #[must_use]
    pub fn age_ms(&self, port: &str) -> f64 {
        let mark = &self.engine.bus().marks[self.port(port).mark as usize];
        mark.stamp().age(self.engine.now()) as f64 * 1e-6
    }
}

fn nanos(ms: f64) -> i64 {
    (ms * 1e6).round() as i64
}

struct ByHand {
    source: Source,
    queue: Queue,
}

impl DeviceType for ByHand {
    fn name(&self) -> Cow<'static, str> {
        format!("by_hand_{}", self.source.role).into()
    }

    fn summary(&self) -> Cow<'static, str> {
        "a role fed by a test".into()
    }

    fn params(&self) -> Vec<ParamSpec> {
        Vec::new()
    }

    fn open(&self, _: &Value, _: &mut Reader<'_>) -> Option<Opened> {
        let filled = Filled {
            role: self.source.kind.into(),
            outputs: self.source.outputs.clone(),
            commands: self.source.commands.clone(),
            facts: Vec::new(),
        };
        Some(Opened {
            description: Description { fills: vec![filled], period: self.source.period },
            driver: Driver::Stepped(Box::new(Hand(Arc::clone(&self.queue)))),
        })
    }
}

struct Hand(Queue);

impl Stepped for Hand {
    /// What was fed next; a test that feeds nothing is a device that is silent, not one that has ended.
    fn next(&self) -> Option<i64> {
        let queue = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        Some(queue.front().map_or(i64::MAX, |(at, _)| *at))
    }

    fn exchange(&mut self, now: i64, _: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        let mut queue = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        while let Some((_, write)) = queue.pop_front_if(|(at, _)| *at <= now) {
            write(samples);
        }
        Ok(())
    }
}
