//! What a fault does to one image, to one command or to the world.

use super::table::{FaultKind, InjectTable};
use crate::device::Disturbance;
use crate::random::Random;

/// A fault of a run.
pub(super) struct Fault {
    kind: FaultKind,
    /// The cells or joints that it concerns.
    cells: Vec<usize>,
    /// Value of a cell, factor or speed, as the fault needs it.
    number: f64,
    /// Fraction of the frames that are hit, if they are hit at random.
    rate: Option<f64>,
    /// Number of frames that are still hit, if they are counted.
    left: u64,
    /// Force [N] or velocity [m/s] in the world.
    vector: [f64; 3],
    /// Time by which frames arrive later [ns].
    delay: i64,
    /// Times between which it is there [ns].
    from: i64,
    to: i64,
    random: Random,
}

/// Returns a time in nanoseconds.
fn nanos(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}

impl Fault {
    /// Creates the fault of an entry for `cells`.
    pub(super) fn new(table: &InjectTable, cells: Vec<usize>, random: Random) -> Self {
        let reading = table.reading.as_ref().map(|reading| reading.number);
        Self {
            kind: table.fault.value,
            cells,
            number: reading.or(table.factor).or(table.reading_per_s).unwrap_or(0.0),
            vector: table.push_n.or(table.velocity_m_per_s).unwrap_or_default(),
            rate: table.rate,
            left: table.frames.unwrap_or(0),
            delay: table.delay_ms.map_or(0, |ms| nanos(ms * 1e-3)),
            from: nanos(table.from_s),
            to: table.to_s.map_or(i64::MAX, nanos),
            random,
        }
    }

    /// Returns its kind if it hits the frame that was sampled at `stamp` [ns], or the command of that time. Call it once
    /// for each.
    pub(super) fn hits(&mut self, stamp: i64) -> Option<FaultKind> {
        if !(self.from..self.to).contains(&stamp) {
            return None;
        }
        let is_hit = match (self.kind, self.rate) {
            (kind, None) if kind.is_of_frames() => self.left > 0,
            (_, Some(rate)) => self.random.uniform(0.0, 1.0) < rate,
            (_, None) => true,
        };
        self.left = self.left.saturating_sub(u64::from(is_hit));
        is_hit.then_some(self.kind)
    }

    /// Spoils the tactels of a frame that was sampled at `stamp` [ns], if the fault concerns values: with so many `axes`,
    /// each of their values.
    pub(super) fn spoil(&mut self, kind: FaultKind, stamp: i64, axes: usize, image: &mut [f32]) {
        let number = self.number as f32;
        let mut each = |change: &dyn Fn(f32) -> f32| {
            if self.cells.is_empty() {
                image.iter_mut().for_each(|cell| *cell = change(*cell));
            }
            for cell in &self.cells {
                image[axes * cell..][..axes].iter_mut().for_each(|value| *value = change(*value));
            }
        };
        match kind {
            FaultKind::Dead => each(&|_| 0.0),
            FaultKind::Stuck | FaultKind::Spike => each(&|_| number),
            FaultKind::Nan => each(&|_| f32::NAN),
            FaultKind::Gain => each(&|cell| cell * number),
            FaultKind::Drift => {
                let by = (self.number * ((stamp - self.from) as f64 * 1e-9)) as f32;
                each(&|cell| cell + by);
            }
            FaultKind::Garbage => {
                // One draw for each tactel, so that a vector image takes as many as its image.
                for tactel in image.chunks_exact_mut(axes) {
                    tactel.fill(self.random.uniform(0.0, self.number) as f32);
                }
            }
            FaultKind::Swapped => {
                for pair in self.cells.windows(2) {
                    (0..axes).for_each(|axis| image.swap(axes * pair[0] + axis, axes * pair[1] + axis));
                }
            }
            _ => {}
        }
    }

    /// Returns by how much later a frame or a command arrives [ns].
    pub(super) fn delay(&mut self, kind: FaultKind) -> i64 {
        if kind == FaultKind::Jitter { self.random.uniform(0.0, self.delay as f64) as i64 } else { self.delay }
    }

    /// Stops its joints, if the fault concerns them.
    pub(super) fn stop(&self, kind: FaultKind, command: &mut [f64]) {
        if kind == FaultKind::JointStop {
            self.cells.iter().for_each(|joint| command[*joint] = 0.0);
        }
    }

    /// Adds what it does to the world at `now` [ns].
    pub(super) fn disturb(&self, now: i64, world: &mut Disturbance) {
        if !(self.from..self.to).contains(&now) {
            return;
        }
        let add = |sum: &mut [f64; 3]| sum.iter_mut().zip(self.vector).for_each(|(sum, value)| *sum += value);
        match self.kind {
            FaultKind::Push => add(&mut world.push),
            FaultKind::Moving => add(&mut world.velocity),
            FaultKind::Stiff => world.stiffness *= self.number,
            FaultKind::Gone => world.is_gone = true,
            _ => {}
        }
    }
}
