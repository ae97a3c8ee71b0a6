//! Compares two recordings.

use std::collections::BTreeSet;
use std::path::Path;

use super::compare::{Differences, PortMessage};
use super::reader::{RecordedTick, Recording};
use crate::engine::Engine;

/// The differences between two recordings.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingDiff {
    /// The ports that differ.
    pub differences: Differences,
    /// The ports that only one of them has: the first, and the second.
    pub only: [Vec<String>; 2],
    /// Number of ticks of each.
    pub ticks: [u64; 2],
    /// Number of ports that both have.
    pub ports: usize,
}

impl RecordingDiff {
    /// Whether both have the same ticks and the same ports with the same values.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.differences.ports.is_empty() && self.only.iter().all(Vec::is_empty) && self.ticks[0] == self.ticks[1]
    }
}

/// A recording that is read tick by tick.
struct Side {
    recording: Recording,
    next: Option<RecordedTick>,
    epoch: i64,
    ticks: u64,
}

impl Side {
    fn open(path: &Path) -> Result<Self, String> {
        let mut recording = Recording::open(path)?;
        let next = recording.next_tick()?;
        let now = next.as_ref().and_then(|tick| Some(tick.time as i64 - Engine::time_of_inputs(&tick.inputs)?));
        Ok(Self { recording, next, epoch: now.unwrap_or(0), ticks: 0 })
    }

    /// Takes the next tick if it has that number.
    fn take(&mut self, number: u32) -> Result<Option<RecordedTick>, String> {
        if self.next.as_ref().is_none_or(|tick| tick.number != number) {
            return Ok(None);
        }
        let tick = self.next.take();
        self.next = self.recording.next_tick()?;
        self.ticks += 1;
        Ok(tick)
    }

    fn ports(&self) -> BTreeSet<&str> {
        self.recording.channels().values().filter_map(|channel| channel.port.as_deref()).collect()
    }

    fn messages<'t>(&'t self, tick: Option<&'t RecordedTick>, shared: &BTreeSet<String>) -> Vec<PortMessage<'t>> {
        let messages = tick.into_iter().flat_map(|tick| &tick.messages);
        let message = |(channel, stamp, data): &'t (u16, u64, Vec<u8>)| {
            let port = self.recording.channels().get(channel)?.port.as_deref()?;
            shared.contains(port).then_some(PortMessage { port, stamp: *stamp as i64 - self.epoch, data })
        };
        messages.filter_map(message).collect()
    }
}

/// Compares the ports of two recordings, tick by tick.
///
/// # Errors
/// If one of them cannot be read.
pub fn diff(first: &Path, second: &Path) -> Result<RecordingDiff, String> {
    let mut sides = [Side::open(first)?, Side::open(second)?];
    let shared: BTreeSet<String> =
        sides[0].ports().intersection(&sides[1].ports()).map(|port| (*port).to_owned()).collect();
    let only = [0, 1].map(|i| {
        let ports = sides[i].ports();
        ports.into_iter().filter(|port| !shared.contains(*port)).map(str::to_owned).collect()
    });
    let mut differences = Differences::default();
    while let Some(number) = sides.iter().filter_map(|side| side.next.as_ref()).map(|tick| tick.number).min() {
        let [first, second] = &mut sides;
        let ticks = [first.take(number)?, second.take(number)?];
        // A tick that only one of them has says nothing of the ports.
        let [Some(one), Some(other)] = &ticks else { continue };
        if one.is_missing || other.is_missing {
            continue;
        }
        let time = one.time as i64 - sides[0].epoch;
        let messages = [0, 1].map(|i| sides[i].messages(ticks[i].as_ref(), &shared));
        differences.add((u64::from(number), time), [&messages[0], &messages[1]]);
    }
    Ok(RecordingDiff { differences, only, ticks: [sides[0].ticks, sides[1].ticks], ports: shared.len() })
}
