//! What a device and a graph hand each other.

use crate::signal::{Arenas, Kind, Shape, Signal};

/// The newest sample of each port of a device.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    pub(crate) arenas: Arenas,
    pub(crate) ports: Vec<Sample>,
}

#[derive(Debug, Clone, Copy)]
pub(crate) struct Sample {
    pub(crate) kind: Kind,
    pub(crate) slot: u32,
    /// Time of the sample in the graph's clock [ns].
    pub(crate) stamp: i64,
    /// Sequence number; the same one twice is one sample.
    pub(crate) sequence: u64,
    /// How often the device has written the port.
    pub(crate) writes: u64,
    /// Whether the last write says that there is no value.
    pub(crate) is_absent: bool,
}

impl Samples {
    /// Room for a value of each shape.
    #[must_use]
    pub fn with_shapes<'s>(shapes: impl Iterator<Item = &'s Shape>) -> Self {
        let mut samples = Self::default();
        for shape in shapes {
            let slot = samples.arenas.add(shape);
            samples.ports.push(Sample { kind: shape.kind(), slot, stamp: 0, sequence: 0, writes: 0, is_absent: false });
        }
        samples
    }

    /// The value of port `port`, to be written whole: a sample taken at `stamp` [ns], the `sequence`-th of its device.
    ///
    /// # Panics
    /// If the port is not of that kind.
    pub fn write<T: Signal>(&mut self, port: usize, stamp: i64, sequence: u64) -> &mut T {
        let sample = &mut self.ports[port];
        assert_eq!(sample.kind, T::KIND, "port {port} of the device");
        (sample.stamp, sample.sequence, sample.is_absent) = (stamp, sequence, false);
        sample.writes += 1;
        &mut T::arena_mut(&mut self.arenas)[sample.slot as usize]
    }

    /// Says that port `port` has no value in the sample taken at `stamp` [ns], the `sequence`-th of its device: what the
    /// port gave before is absent from then on, until it is written again.
    pub fn clear(&mut self, port: usize, stamp: i64, sequence: u64) {
        let sample = &mut self.ports[port];
        (sample.stamp, sample.sequence, sample.is_absent) = (stamp, sequence, true);
        sample.writes += 1;
    }
}

/// The command of each command port of a device, and what the task reports to it.
#[derive(Debug, Clone, Default)]
pub struct Commands {
    pub(crate) values: Vec<Box<[f64]>>,
    arenas: Arenas,
    reports: Vec<Option<Report>>,
}

/// What a wire reports; none where there is no wire.
#[derive(Debug, Clone, Copy)]
struct Report {
    kind: Kind,
    slot: u32,
    is_present: bool,
}

impl Commands {
    /// Room for a command of each shape, all zero.
    ///
    /// # Panics
    /// If one is not a joint vector.
    #[must_use]
    pub fn with_shapes<'s>(shapes: impl Iterator<Item = &'s Shape>) -> Self {
        let zeros = |shape: &Shape| match shape {
            Shape::Joints(shape) => vec![0.0; shape.joints.len()].into(),
            other => panic!("a command cannot be {}", other.kind().with_article()),
        };
        Self { values: shapes.map(zeros).collect(), ..Self::default() }
    }

    /// With room for one more report, of a shape that a wire gives; without one it stays absent.
    #[must_use]
    pub fn with_report(mut self, shape: Option<&Shape>) -> Self {
        let room = |shape: &Shape| Report { kind: shape.kind(), slot: self.arenas.add(shape), is_present: false };
        let report = shape.map(room);
        self.reports.push(report);
        self
    }

    /// What is reported to report port `port`: none while it is absent, or if nothing is wired to it. The reports of a
    /// device are numbered through all the roles that it fills.
    #[must_use]
    pub fn report<T: Signal>(&self, port: usize) -> Option<&T> {
        let report = (*self.reports.get(port)?)?;
        let is_there = report.is_present && report.kind == T::KIND;
        is_there.then(|| &T::arena(&self.arenas)[report.slot as usize])
    }

    /// Reports a value to port `port`, as a graph does.
    ///
    /// # Panics
    /// If nothing of that kind is reported there.
    pub fn tell<T: Signal>(&mut self, port: usize, value: &T) {
        let report = self.reports[port].as_mut().expect("a report that is told has room");
        assert_eq!(report.kind, T::KIND, "report {port} of the device");
        report.is_present = true;
        value.copy_to(&mut T::arena_mut(&mut self.arenas)[report.slot as usize]);
    }

    /// Takes over what is reported to port `port` from a slot of `arenas`, or that it is absent.
    pub(crate) fn take_report(&mut self, port: usize, arenas: &Arenas, slot: Option<u32>) {
        let Some(report) = &mut self.reports[port] else { return };
        report.is_present = slot.is_some();
        if let Some(slot) = slot {
            arenas.copy(report.kind, slot, &mut self.arenas, report.slot);
        }
    }

    /// Reports nothing any more.
    pub(crate) fn fall_silent(&mut self) {
        self.reports.iter_mut().flatten().for_each(|report| report.is_present = false);
    }

    /// Takes over commands and reports of the same shapes, in place.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        for (slot, values) in self.values.iter_mut().zip(&other.values) {
            slot.copy_from_slice(values);
        }
        for (port, report) in other.reports.iter().enumerate() {
            let there = report.filter(|report| report.is_present);
            self.take_report(port, &other.arenas, there.map(|report| report.slot));
        }
    }

    /// Whether nothing is commanded.
    pub(crate) fn are_zero(&self) -> bool {
        self.values.iter().flatten().all(|value| *value == 0.0)
    }

    /// The command of port `port`, one value a joint.
    #[must_use]
    pub fn joints(&self, port: usize) -> &[f64] {
        &self.values[port]
    }
}
