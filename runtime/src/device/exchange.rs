//! What a device and a graph exchange: samples one way, commands and reports the other.

use std::borrow::Cow;
use std::sync::Arc;

use super::{AnyReport, ClockReading, Command, Description, Output, Report};
use crate::signal::{Arenas, Kind, Shape, Signal};

/// The newest sample of each output of a device, and the counts of the device.
#[derive(Debug, Clone, Default)]
pub struct Samples {
    pub(crate) arenas: Arenas,
    pub(crate) ports: Vec<PortSample>,
    /// How often any port was written.
    pub(crate) writes: u64,
    /// The sequence number that was written last.
    pub(crate) newest: Option<u64>,
    pub(crate) counts: Vec<(&'static str, u64)>,
    /// The device's own clock, if stamps are made of it.
    pub(crate) clock: Option<ClockReading>,
}

#[derive(Debug, Clone)]
pub(crate) struct PortSample {
    pub(crate) kind: Kind,
    pub(crate) slot: u32,
    /// Time of the sample in the graph's clock [ns].
    pub(crate) stamp: i64,
    /// Sequence number; the same one twice is one sample.
    pub(crate) sequence: u64,
    /// How often the device has written the port.
    pub(crate) writes: u64,
    pub(crate) state: SampleState,
    /// How often the device has lost the port, and why it did so last.
    pub(crate) losses: u64,
    pub(crate) loss: Cow<'static, str>,
}

/// The state of a port after its last write.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum SampleState {
    Value,
    Absent,
    /// There is no value until the port is written again.
    Lost,
}

impl Samples {
    /// Allocates a sample of each output of a device.
    #[must_use]
    pub fn of(description: &Description) -> Self {
        let mut samples = Self::default();
        for port in &description.outputs {
            let (kind, slot) = (port.shape.kind(), samples.arenas.add(&port.shape));
            let (state, loss) = (SampleState::Absent, "".into());
            samples.ports.push(PortSample { kind, slot, stamp: 0, sequence: 0, writes: 0, state, losses: 0, loss });
        }
        samples
    }

    /// Returns the value of a port, to be written in full: a sample taken at `stamp` [ns], the `sequence`-th of its
    /// port.
    ///
    /// The graph counts gaps in the sequence, and a number that it has seen is a repeated sample.
    ///
    /// # Panics
    /// If the port belongs to another device.
    pub fn write<T: Signal>(&mut self, port: Output<T>, stamp: i64, sequence: u64) -> &mut T {
        let sample = self.renew(port.port, stamp, sequence, SampleState::Value);
        assert_eq!(sample.kind, T::KIND, "output {} of the device", port.port);
        let slot = sample.slot as usize;
        &mut T::arena_mut(&mut self.arenas)[slot]
    }

    /// Writes that a port has no value in the sample taken at `stamp` [ns]. It stays absent until it is written again.
    ///
    /// This is normal, as a position without contact; for a fault of the device, see [`lost`](Self::lost).
    pub fn clear<T: Signal>(&mut self, port: Output<T>, stamp: i64, sequence: u64) {
        self.renew(port.port, stamp, sequence, SampleState::Absent);
    }

    /// Makes a port absent until it is written again, because something is wrong: `why` completes "`pad.image` is
    /// lost:".
    ///
    /// As long as the port is lost, the graph's policy `device` applies: it holds the commands, stops them or ends the
    /// run.
    pub fn lost<T: Signal>(&mut self, port: Output<T>, why: impl Into<Cow<'static, str>>) {
        let sample = &mut self.ports[port.port];
        sample.losses += u64::from(sample.state != SampleState::Lost);
        (sample.state, sample.loss) = (SampleState::Lost, why.into());
    }

    /// Makes every port absent until it is written again, because the driver has ended.
    pub(crate) fn lose_all(&mut self, why: &str) {
        for sample in &mut self.ports {
            sample.losses += u64::from(sample.state != SampleState::Lost);
            (sample.state, sample.loss) = (SampleState::Lost, why.to_owned().into());
        }
    }

    /// Counts something for the summary of the run, as a plural noun: `"bad frames"`.
    pub fn count(&mut self, what: &'static str) {
        self.count_by(what, 1);
    }

    /// Counts something several times; see [`count`](Self::count).
    pub fn count_by(&mut self, what: &'static str, times: u64) {
        match self.counts.iter_mut().find(|(known, _)| *known == what) {
            Some((_, count)) => *count += times,
            None => self.counts.push((what, times)),
        }
    }

    /// Returns the value of a port that is there, for tests of a device.
    #[must_use]
    pub fn get<T: Signal>(&self, port: Output<T>) -> Option<&T> {
        let sample = &self.ports[port.port];
        (sample.state == SampleState::Value).then(|| &T::arena(&self.arenas)[sample.slot as usize])
    }

    fn renew(&mut self, port: usize, stamp: i64, sequence: u64, state: SampleState) -> &mut PortSample {
        let sample = &mut self.ports[port];
        (sample.stamp, sample.sequence, sample.state) = (stamp, sequence, state);
        sample.writes += 1;
        self.writes += 1;
        self.newest = Some(sequence);
        sample
    }

    /// Passes on the newest sample of a port of the same device.
    pub(crate) fn pass_on(&mut self, other: &Self, port: usize) {
        let PortSample { kind, slot, stamp, sequence, state, losses, loss, .. } = &other.ports[port];
        other.arenas.copy(*kind, *slot, &mut self.arenas, *slot);
        let sample = self.renew(port, *stamp, *sequence, state.clone());
        (sample.losses, sample.loss) = (*losses, loss.clone());
    }

    /// Takes over the counts and the clock of the same device, with one more count.
    pub(crate) fn take_counts(&mut self, other: &Self, more: (&'static str, u64)) {
        self.counts.clone_from(&other.counts);
        self.counts.push(more);
        self.clock = other.clock;
    }

    /// Copies the samples of the same device, in place.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        for PortSample { kind, slot, .. } in &other.ports {
            other.arenas.copy(*kind, *slot, &mut self.arenas, *slot);
        }
        self.ports.clone_from(&other.ports);
        self.counts.clone_from(&other.counts);
        (self.writes, self.newest, self.clock) = (other.writes, other.newest, other.clock);
    }
}

/// For how long commands are valid, and which sample they answer.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Grant {
    /// It grows when the operator resumes after a lost lease.
    pub(crate) epoch: u64,
    /// Time until which the commands are valid [ns].
    pub(crate) until: i64,
    /// The sequence number that was written last among the samples that they were computed from.
    pub(crate) seen: Option<u64>,
}

/// The commands of a device, and the reports to it.
#[derive(Debug, Clone, Default)]
pub struct Commands {
    pub(crate) values: Vec<Box<[f64]>>,
    /// For how long a live device may follow them, and which of its samples they answer.
    pub(crate) grant: Grant,
    arenas: Arenas,
    reports: Vec<ReportValue>,
    /// The shape of each report, or that of the value that is wired to it.
    shapes: Arc<[Shape]>,
}

/// A value that is reported to a device.
#[derive(Debug, Clone, Copy)]
struct ReportValue {
    kind: Kind,
    slot: u32,
    age: ReportAge,
}

/// Whether a report is there, of which time it is, and how often it was new.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct ReportAge {
    /// Whether it has a value.
    pub is_present: bool,
    /// Time of the sample that it was computed from [ns]; `i64::MAX` if it was computed from none.
    pub stamp: i64,
    /// How often it was new.
    pub count: u64,
}

impl Commands {
    /// Allocates the commands of a device, all zero, and its reports, all absent.
    #[must_use]
    pub fn of(description: &Description) -> Self {
        Self::with_reports(description, |_| None)
    }

    /// Allocates the commands and the reports of a device. `wired` returns the shape of the value that is wired to a
    /// report.
    pub(crate) fn with_reports<'s>(description: &Description, wired: impl Fn(usize) -> Option<&'s Shape>) -> Self {
        let zeros = |shape: &Shape| match shape {
            Shape::Joints(shape) => vec![0.0; shape.joints.len()].into(),
            other => unreachable!("a command is a joint vector, and not {}", other.kind().with_article()),
        };
        let mut arenas = Arenas::default();
        let stated = description.reports.iter().enumerate();
        let shapes: Arc<[Shape]> = stated.map(|(i, port)| wired(i).unwrap_or(&port.shape).clone()).collect();
        let room =
            |shape: &Shape| ReportValue { kind: shape.kind(), slot: arenas.add(shape), age: ReportAge::default() };
        let reports = shapes.iter().map(room).collect();
        let values = description.commands.iter().map(|port| zeros(&port.shape)).collect();
        Self { values, grant: Grant::default(), reports, arenas, shapes }
    }

    /// Returns the command of a port, one value per joint.
    #[must_use]
    pub fn joints(&self, port: Command) -> &[f64] {
        &self.values[port.0]
    }

    /// Returns which sample of the device these commands answer: the sequence number that was
    /// [written](Samples::write) last among the samples that they were computed from. `None` if there was none.
    ///
    /// It names one sample only if all ports of the device share one sequence.
    #[must_use]
    pub const fn answers(&self) -> Option<u64> {
        self.grant.seen
    }

    /// Sets the command of a port, as a graph does.
    ///
    /// # Panics
    /// If the number of values is not the number of joints.
    pub fn command(&mut self, port: Command, values: &[f64]) {
        self.values[port.0].copy_from_slice(values);
    }

    /// Returns the report to a port, or `None` while it is absent or not wired.
    #[must_use]
    pub fn report<T: Signal>(&self, port: Report<T>) -> Option<&T> {
        let report = self.reports[port.port];
        report.age.is_present.then(|| &T::arena(&self.arenas)[report.slot as usize])
    }

    /// Returns the shape of a report of any kind: that of the value that is wired to it.
    #[must_use]
    pub fn report_shape(&self, port: AnyReport) -> &Shape {
        &self.shapes[port.0]
    }

    /// Returns whether a report of any kind is there, of which time, and how often it was new.
    #[must_use]
    pub fn report_age(&self, port: AnyReport) -> ReportAge {
        self.reports[port.0].age
    }

    /// Appends the bytes of a report of any kind, as in a recording.
    pub fn report_bytes(&self, port: AnyReport, out: &mut Vec<u8>) {
        let report = self.reports[port.0];
        self.arenas.write_bytes(report.kind, report.slot, out);
    }

    /// Sets the report to a port, as a graph does.
    pub fn set_report<T: Signal>(&mut self, port: Report<T>, value: &T) {
        let report = &mut self.reports[port.port];
        report.age = ReportAge { is_present: true, stamp: i64::MAX, count: report.age.count + 1 };
        value.copy_to(&mut T::arena_mut(&mut self.arenas)[report.slot as usize]);
    }

    /// Copies the report to `port` from a slot of `arenas`, or makes it absent. `is_new`: whether its value has changed.
    pub(crate) fn take_report(
        &mut self,
        port: usize,
        arenas: &Arenas,
        slot: Option<u32>,
        (stamp, is_new): (i64, bool),
    ) {
        let report = &mut self.reports[port];
        let count = report.age.count + u64::from(is_new);
        report.age = ReportAge { is_present: slot.is_some(), stamp, count };
        if let Some(slot) = slot {
            arenas.copy(report.kind, slot, &mut self.arenas, report.slot);
        }
    }

    /// Sets every command to zero.
    pub(crate) fn rest(&mut self) {
        self.values.iter_mut().for_each(|values| values.fill(0.0));
    }

    /// Makes every report absent.
    pub(crate) fn clear_reports(&mut self) {
        self.reports.iter_mut().for_each(|report| report.age.is_present = false);
    }

    /// Copies commands and reports of the same device, in place.
    pub(crate) fn copy_from(&mut self, other: &Self) {
        for (slot, values) in self.values.iter_mut().zip(&other.values) {
            slot.copy_from_slice(values);
        }
        self.grant = other.grant;
        self.copy_reports(other);
    }

    /// Copies the reports to the same device, in place.
    pub(crate) fn copy_reports(&mut self, other: &Self) {
        for (port, report) in other.reports.iter().enumerate() {
            let ReportAge { is_present, stamp, .. } = report.age;
            self.take_report(port, &other.arenas, is_present.then_some(report.slot), (stamp, false));
            self.reports[port].age.count = report.age.count;
        }
    }

    /// Whether every command is zero.
    pub(crate) fn are_zero(&self) -> bool {
        self.values.iter().flatten().all(|value| *value == 0.0)
    }
}
