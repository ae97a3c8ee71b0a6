//! The commands of a device, spoilt on their way to it.

use std::collections::VecDeque;

use super::fault::Fault;
use super::table::FaultKind;

/// A command with faults.
pub(super) struct SpoiltCommand {
    /// Its index among the commands of the device.
    pub(super) port: usize,
    pub(super) faults: Vec<Fault>,
    /// Commands on their way: their time of arrival and their values.
    late: VecDeque<(i64, Box<[f64]>)>,
}

impl SpoiltCommand {
    pub(super) const fn new(port: usize) -> Self {
        Self { port, faults: Vec::new(), late: VecDeque::new() }
    }

    /// Writes to `values` the command that arrives at `now` [ns], if the graph sends `sent`. Without one, the values
    /// stay. Returns how many faults have hit it.
    pub(super) fn deliver(&mut self, now: i64, sent: &[f64], values: &mut [f64]) -> u64 {
        let (mut hits, mut delay, mut is_lost) = (0, 0, false);
        let mut command: Box<[f64]> = sent.into();
        for fault in &mut self.faults {
            let Some(kind) = fault.hits(now) else { continue };
            hits += 1;
            is_lost |= kind == FaultKind::Lost;
            delay += fault.delay(kind);
            fault.stop(kind, &mut command);
        }
        if !is_lost {
            self.late.push_back((now + delay, command));
        }
        // The newest that has arrived overtakes those before it.
        if let Some(newest) = self.late.iter().rposition(|(due, _)| *due <= now) {
            values.copy_from_slice(&self.late[newest].1);
            self.late.drain(..=newest);
        }
        hits
    }
}
