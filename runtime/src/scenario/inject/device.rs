//! A device whose images are spoilt before the graph sees them.

use std::collections::VecDeque;
use std::sync::atomic::AtomicBool;

use super::cells::draw;
use super::fault::Fault;
use super::resolve::Injection;
use super::table::{Cells, FaultKind};
use crate::device::{Commands, DeviceError, Driver, Output, SampleState, Samples, Stepped};
use crate::graph::Compiled;
use crate::random::Random;
use crate::signal::{Image, Signal};

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
            // A scenario refuses a bench with such a device.
            live @ Driver::Live(_) => live,
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
    /// For each output, how often it was written and lost when it was last passed on.
    seen: Vec<[u64; 2]>,
    images: Vec<SpoiltImage>,
    /// Number of frames that a fault has hit.
    hits: u64,
}

/// An image with faults.
struct SpoiltImage {
    port: usize,
    faults: Vec<Fault>,
    /// The values that were passed on last, if there are any.
    last: Vec<f32>,
    has_last: bool,
    /// Frames that arrive later: their time of arrival, stamp, number and values.
    late: VecDeque<Late>,
    /// Buffers of frames that have arrived.
    spare: Vec<Vec<f32>>,
}

/// A frame on its way.
struct Late {
    due: i64,
    stamp: i64,
    sequence: u64,
    cells: Vec<f32>,
}

impl Spoilt {
    pub(super) fn new(inner: Box<dyn Stepped>, own: Samples, injections: &[(usize, &Injection)], seed: u64) -> Self {
        let mut images: Vec<SpoiltImage> = Vec::new();
        let mut taken: Vec<Vec<usize>> = Vec::new();
        let listed = |one: &Injection| match one.table.cells.as_ref().map(|cells| &cells.value) {
            Some(Cells::List(list)) => list.iter().map(|[i, j]| i * one.shape.cols + j).collect(),
            _ => Vec::new(),
        };
        for (_, one) in injections {
            let image = images.iter().position(|image| image.port == one.port).unwrap_or_else(|| {
                images.push(SpoiltImage::new(one.port, one.shape.tactels()));
                taken.push(Vec::new());
                images.len() - 1
            });
            taken[image].extend::<Vec<usize>>(listed(one));
        }
        for (number, one) in injections {
            let image = images.iter().position(|image| image.port == one.port).expect("it was added above");
            let mut random = Random::new(seed, *number as u64);
            let cells = match one.table.cells.as_ref().map(|cells| &cells.value) {
                Some(Cells::Count(count)) => {
                    draw(*count, [one.shape.rows, one.shape.cols], &mut taken[image], &mut random)
                }
                _ => listed(one),
            };
            images[image].faults.push(Fault::new(&one.table, cells, random));
        }
        let seen = vec![[0; 2]; own.ports.len()];
        Self { inner, own, seen, images, hits: 0 }
    }
}

impl SpoiltImage {
    fn new(port: usize, tactels: usize) -> Self {
        let (late, spare) = (VecDeque::new(), Vec::new());
        Self { port, faults: Vec::new(), last: vec![0.0; tactels], has_last: false, late, spare }
    }

    /// Takes a new frame of the device. Returns how many faults have hit it.
    fn take(&mut self, now: i64, own: &Samples, samples: &mut Samples) -> u64 {
        let sample = &own.ports[self.port];
        let (stamp, sequence) = (sample.stamp, sample.sequence);
        let mut cells = self.spare.pop().unwrap_or_default();
        cells.clear();
        cells.extend_from_slice(Image::arena(&own.arenas)[sample.slot as usize].cells());
        let (mut hits, mut delay, mut is_missing, mut is_repeated) = (0, 0, false, false);
        for fault in &mut self.faults {
            let Some(kind) = fault.hits(stamp) else { continue };
            hits += 1;
            is_missing |= kind == FaultKind::Missing;
            is_repeated |= kind == FaultKind::Repeat;
            delay += fault.delay;
            fault.spoil(kind, stamp, &mut cells);
        }
        if is_repeated && self.has_last {
            cells.copy_from_slice(&self.last);
        }
        if is_missing {
            self.spare.push(cells);
            return hits;
        }
        self.last.copy_from_slice(&cells);
        self.has_last = true;
        if delay == 0 && self.late.is_empty() {
            samples.write(Output::<Image>::at(self.port), stamp, sequence).cells_mut().copy_from_slice(&cells);
            self.spare.push(cells);
        } else {
            self.late.push_back(Late { due: now + delay, stamp, sequence, cells });
        }
        hits
    }

    /// Passes on the newest of the frames that have arrived by now. It overtakes the frames before it.
    fn deliver(&mut self, now: i64, samples: &mut Samples) {
        let Some(newest) = self.late.iter().rposition(|frame| frame.due <= now) else { return };
        for _ in 0..newest {
            self.spare.extend(self.late.pop_front().map(|frame| frame.cells));
        }
        let Some(Late { stamp, sequence, cells, .. }) = self.late.pop_front() else { return };
        samples.write(Output::<Image>::at(self.port), stamp, sequence).cells_mut().copy_from_slice(&cells);
        self.spare.push(cells);
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
        let result = self.inner.exchange(now, commands, &mut self.own);
        for port in 0..self.own.ports.len() {
            let sample = &self.own.ports[port];
            let written = [sample.writes, sample.losses];
            let is_value = sample.state == SampleState::Value;
            let is_new = std::mem::replace(&mut self.seen[port], written) != written;
            match self.images.iter_mut().find(|image| image.port == port) {
                Some(image) if is_new && is_value => self.hits += image.take(now, &self.own, samples),
                None | Some(_) if is_new => samples.pass_on(&self.own, port),
                _ => {}
            }
        }
        self.images.iter_mut().for_each(|image| image.deliver(now, samples));
        samples.take_counts(&self.own, ("injected faults", self.hits));
        result
    }

    fn watch(&mut self, is_ending: &'static AtomicBool) {
        self.inner.watch(is_ending);
    }

    fn finish(&mut self, reason: &str) {
        self.inner.finish(reason);
    }
}
