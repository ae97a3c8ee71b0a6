//! The images of a device, spoilt and delivered.

use std::collections::VecDeque;

use super::fault::Fault;
use super::table::FaultKind;
use crate::device::{Output, Samples};
use crate::signal::{Image, Signal, VectorImage};

/// An image, or a vector image, with faults.
pub(super) struct SpoiltImage {
    pub(super) port: usize,
    /// Number of values of a tactel.
    axes: usize,
    pub(super) faults: Vec<Fault>,
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

impl SpoiltImage {
    pub(super) fn new(port: usize, axes: usize, tactels: usize) -> Self {
        let (late, spare) = (VecDeque::new(), Vec::new());
        Self { port, axes, faults: Vec::new(), last: vec![0.0; axes * tactels], has_last: false, late, spare }
    }

    /// Takes a new frame of the device. Returns how many faults have hit it; those of a vector image are those of its image.
    pub(super) fn take(&mut self, now: i64, own: &Samples, samples: &mut Samples) -> u64 {
        let sample = &own.ports[self.port];
        let (stamp, sequence) = (sample.stamp, sample.sequence);
        let mut cells = self.spare.pop().unwrap_or_default();
        cells.clear();
        let slot = sample.slot as usize;
        cells.extend_from_slice(match self.axes {
            1 => Image::arena(&own.arenas)[slot].cells(),
            _ => VectorImage::arena(&own.arenas)[slot].cells().as_flattened(),
        });
        let (mut hits, mut delay, mut is_missing, mut is_repeated) = (0, 0, false, false);
        for fault in &mut self.faults {
            let Some(kind) = fault.hits(stamp) else { continue };
            hits += u64::from(self.axes == 1);
            is_missing |= kind == FaultKind::Missing;
            is_repeated |= kind == FaultKind::Repeat;
            delay += fault.delay(kind);
            fault.spoil(kind, stamp, self.axes, &mut cells);
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
            self.write(stamp, sequence, &cells, samples);
            self.spare.push(cells);
        } else {
            self.late.push_back(Late { due: now + delay, stamp, sequence, cells });
        }
        hits
    }

    /// Passes on the newest of the frames that have arrived by now. It overtakes the frames before it.
    pub(super) fn deliver(&mut self, now: i64, samples: &mut Samples) {
        let Some(newest) = self.late.iter().rposition(|frame| frame.due <= now) else { return };
        for _ in 0..newest {
            self.spare.extend(self.late.pop_front().map(|frame| frame.cells));
        }
        let Some(Late { stamp, sequence, cells, .. }) = self.late.pop_front() else { return };
        self.write(stamp, sequence, &cells, samples);
        self.spare.push(cells);
    }

    /// Writes a frame.
    fn write(&self, stamp: i64, sequence: u64, cells: &[f32], samples: &mut Samples) {
        let written = match self.axes {
            1 => samples.write(Output::<Image>::at(self.port), stamp, sequence).cells_mut(),
            _ => samples.write(Output::<VectorImage>::at(self.port), stamp, sequence).cells_mut().as_flattened_mut(),
        };
        written.copy_from_slice(cells);
    }
}
