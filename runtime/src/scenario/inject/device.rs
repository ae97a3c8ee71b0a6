//! A device with faults.

use std::sync::atomic::AtomicBool;

use super::cells::draw;
use super::commands::SpoiltCommand;
use super::fault::Fault;
use super::images::SpoiltImage;
use super::resolve::{Injection, Target};
use super::table::{Cells, InjectTable};
use crate::device::{Commands, DeviceError, Disturbance, Driver, SampleState, Samples, Stepped};
use crate::graph::Compiled;
use crate::random::Random;
use crate::signal::ImageShape;

/// Wraps the devices of a compiled graph that the faults of a scenario spoil. The seed decides everything random.
pub(crate) fn inject(compiled: &mut Compiled, injections: &[Injection], seed: u64) {
    for (i, device) in compiled.plan.devices.iter_mut().enumerate() {
        let own: Vec<(usize, &Injection)> = injections.iter().enumerate().filter(|(_, one)| one.device == i).collect();
        if own.is_empty() {
            continue;
        }
        let wrap = |inner| Box::new(Spoilt::new(inner, Samples::of(&device.description), &own, seed));
        device.driver = match std::mem::replace(&mut device.driver, Driver::Stepped(Box::new(Nothing))) {
            Driver::Stepped(inner) => Driver::Stepped(wrap(inner)),
            Driver::Lockstep(inner) => Driver::Lockstep(wrap(inner)),
            Driver::Beside { stepped, live } => Driver::Beside { stepped: wrap(stepped), live },
            // A scenario refuses a bench with such a device.
            other @ (Driver::Live(_) | Driver::Recorded { .. }) => other,
        };
    }
}

/// Stands in for a device while it is wrapped.
struct Nothing;

impl Stepped for Nothing {
    fn next(&self) -> Option<i64> {
        None
    }

    fn exchange(&mut self, _: i64, _: &Commands, _: &mut Samples) -> Result<(), DeviceError> {
        Ok(())
    }
}

/// A device with faults.
pub(super) struct Spoilt {
    inner: Box<dyn Stepped>,
    /// The samples of the device, as it has written them.
    own: Samples,
    /// The commands, as the device got them last.
    sent: Option<Commands>,
    /// For each output, how often it was written and lost when it was last passed on.
    seen: Vec<[u64; 2]>,
    images: Vec<SpoiltImage>,
    commands: Vec<SpoiltCommand>,
    /// The faults of its world, and what they did last.
    world: (Vec<Fault>, Disturbance),
    /// Number of frames and commands that a fault has hit.
    hits: u64,
}

/// Returns the cells that an entry lists, as indices.
fn listed(table: &InjectTable, shape: &ImageShape) -> Vec<usize> {
    match table.cells.as_ref().map(|cells| &cells.value) {
        Some(Cells::List(list)) => list.iter().map(|[i, j]| i * shape.cols + j).collect(),
        _ => Vec::new(),
    }
}

/// Returns the entry of a list that has a port, which is added if there is none.
fn of_port<T>(list: &mut Vec<T>, is_it: impl Fn(&T) -> bool, new: impl FnOnce() -> T) -> &mut T {
    let at = list.iter().position(is_it).unwrap_or_else(|| {
        list.push(new());
        list.len() - 1
    });
    &mut list[at]
}

impl Spoilt {
    pub(super) fn new(inner: Box<dyn Stepped>, own: Samples, injections: &[(usize, &Injection)], seed: u64) -> Self {
        let (mut images, mut commands, mut world) = (Vec::new(), Vec::new(), Vec::new());
        let mut taken: Vec<(usize, Vec<usize>)> = Vec::new();
        for (_, one) in injections {
            if let Target::Image(port, _, shape) = &one.target {
                let taken = of_port(&mut taken, |(known, _)| known == port, || (*port, Vec::new()));
                taken.1.extend(listed(&one.table, shape));
            }
        }
        for (number, one) in injections {
            let (table, mut random) = (&one.table, Random::new(seed, *number as u64));
            match &one.target {
                Target::Image(port, vectors, shape) => {
                    let taken = of_port(&mut taken, |(known, _)| known == port, || (*port, Vec::new()));
                    let cells = match table.cells.as_ref().map(|cells| &cells.value) {
                        Some(Cells::Count(count)) => draw(*count, [shape.rows, shape.cols], &mut taken.1, &mut random),
                        _ => listed(table, shape),
                    };
                    // The same random numbers: what hits a frame hits both of its images.
                    for (port, axes) in std::iter::once((*port, 1)).chain(vectors.map(|port| (port, 3))) {
                        let new = || SpoiltImage::new(port, axes, shape.tactels());
                        let image = of_port(&mut images, |known: &SpoiltImage| known.port == port, new);
                        image.faults.push(Fault::new(table, cells.clone(), random.clone()));
                    }
                }
                Target::Command(port, joints) => {
                    let new = || SpoiltCommand::new(*port);
                    let command = of_port(&mut commands, |known: &SpoiltCommand| known.port == *port, new);
                    command.faults.push(Fault::new(table, joints.clone(), random));
                }
                Target::World => world.push(Fault::new(table, Vec::new(), random)),
            }
        }
        let seen = vec![[0; 2]; own.ports.len()];
        Self { inner, own, sent: None, seen, images, commands, world: (world, Disturbance::default()), hits: 0 }
    }

    /// Disturbs the world and spoils the commands, so that the device sees what is left of them.
    fn send(&mut self, now: i64, commands: &Commands) {
        let (faults, last) = &mut self.world;
        let mut disturbance = Disturbance::default();
        faults.iter().for_each(|fault| fault.disturb(now, &mut disturbance));
        if std::mem::replace(last, disturbance) != disturbance {
            self.inner.disturb(&disturbance);
        }
        let own = self.sent.get_or_insert_with(|| {
            let mut first = commands.clone();
            first.rest();
            first
        });
        own.grant = commands.grant;
        own.copy_reports(commands);
        for (port, (values, sent)) in own.values.iter_mut().zip(&commands.values).enumerate() {
            match self.commands.iter_mut().find(|command| command.port == port) {
                Some(command) => self.hits += command.deliver(now, sent, values),
                None => values.copy_from_slice(sent),
            }
        }
    }
}

impl Stepped for Spoilt {
    fn next(&self) -> Option<i64> {
        self.inner.next()
    }

    fn end(&self) -> Option<i64> {
        self.inner.end()
    }

    fn exchange(&mut self, now: i64, commands: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        self.send(now, commands);
        let sent = self.sent.as_ref().unwrap_or(commands);
        let result = self.inner.exchange(now, sent, &mut self.own);
        let own = &self.own;
        for port in 0..own.ports.len() {
            let sample = &own.ports[port];
            let written = [sample.writes, sample.losses];
            let is_value = sample.state == SampleState::Value;
            let is_new = std::mem::replace(&mut self.seen[port], written) != written;
            match self.images.iter_mut().find(|image| image.port == port) {
                Some(image) if is_new && is_value => self.hits += image.take(now, own, samples),
                None | Some(_) if is_new => samples.pass_on(own, port),
                _ => {}
            }
        }
        self.images.iter_mut().for_each(|image| image.deliver(now, samples));
        samples.take_counts(own, ("injected faults", self.hits));
        result
    }

    fn watch(&mut self, is_ending: &'static AtomicBool) {
        self.inner.watch(is_ending);
    }

    fn finish(&mut self, reason: &str) {
        self.inner.finish(reason);
    }
}
