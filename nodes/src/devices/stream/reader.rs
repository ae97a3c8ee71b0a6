//! From bytes as they arrive to images: framing, decoding, parts and the clock of the pad, without I/O.

use super::decoding::clock::{Counter, Sequence};
use super::decoding::decoder::Decoder;
use super::decoding::parts::Parts;
use super::framing::Counts;
use super::plan::Plan;

/// Reads images from bytes.
pub(super) struct Reader {
    pub(super) plan: Plan,
    /// The values of the frame, those of all parts.
    values: Vec<f64>,
    /// The vector image of the last frame; empty for a pad with one axis.
    pub(super) vectors: Vec<[f32; 3]>,
    /// The values of one part, for a look at frames that may be none.
    part: Vec<f64>,
    /// The bytes of the last frame, and whether there is one: a frame without a counter is compared with them.
    last: Vec<u8>,
    has_last: bool,
    /// The bytes of this frame so far.
    current: Vec<u8>,
    /// Number of the last frame.
    number: u64,
    counts: Counts,
    pub(super) tally: Tally,
}

/// What was counted since the counts were taken.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Tally {
    pub(super) frames: u64,
    pub(super) rejected: u64,
    pub(super) resyncs: u64,
    pub(super) skipped: u64,
    pub(super) repeated: u64,
    pub(super) lost: u64,
    pub(super) late: u64,
}

/// An image that was read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Read {
    /// Number of the frame. The same one twice is one sample.
    pub(super) number: u64,
    /// Time of the measurement in the clock of the pad [ns].
    pub(super) time: Option<i64>,
}

impl Reader {
    pub(super) fn new(plan: Plan) -> Self {
        let (values, part) = (vec![0.0; plan.values], vec![0.0; plan.decoder.layout.count]);
        let (last, current, counts) = (Vec::new(), Vec::new(), Counts::default());
        let vectors = vec![[0.0; 3]; if plan.vectors.is_some() { plan.image.places.len() } else { 0 }];
        Self { plan, values, vectors, part, last, has_last: false, current, number: 0, counts, tally: Tally::default() }
    }

    /// Returns a buffer for an image.
    pub(super) fn cells(&self) -> Vec<f32> {
        vec![0.0; self.plan.size[0] * self.plan.size[1]]
    }

    /// Adds bytes that have arrived; `is_after_pause` says that nothing had arrived for a while before.
    pub(super) fn push(&mut self, bytes: &[u8], is_after_pause: bool) {
        self.plan.framer.push(bytes, is_after_pause);
    }

    /// States that a frame is asked for now.
    pub(super) fn ask(&mut self) {
        self.plan.framer.ask();
    }

    /// Whether a frame was asked for and has not come.
    pub(super) const fn is_waiting(&self) -> bool {
        self.plan.framer.is_waiting()
    }

    /// Whether the mark stands at several places of every frame.
    pub(super) const fn is_ambiguous(&self) -> bool {
        self.plan.framer.is_ambiguous()
    }

    /// Forgets what has arrived, as after a new connection.
    pub(super) fn forget(&mut self) {
        self.plan.framer.forget();
        if let Some(parts) = &mut self.plan.parts {
            parts.forget();
        }
        self.plan.counter.iter_mut().for_each(Counter::forget);
        self.has_last = false;
        self.current.clear();
    }

    /// Writes the next image into `cells`. Returns `None` if more bytes are needed.
    pub(super) fn next(&mut self, cells: &mut [f32]) -> Option<Read> {
        loop {
            let Plan { framer, decoder, parts, stamps, counter, .. } = &mut self.plan;
            let mut is_sound = |frame: &[u8]| is_sound(frame, decoder, parts.as_ref(), &mut self.part);
            let frame = framer.next(&mut is_sound);
            // The values of `part` become those of the frame.
            if let Some(frame) = frame {
                is_sound(frame);
            }
            let Some(frame) = frame else {
                self.count_framing();
                return None;
            };
            self.current.extend_from_slice(frame);
            let stamp = stamps.as_ref().and_then(|stamps| decoder.beside(frame, stamps.place()));
            let counter = counter.as_ref().and_then(|counter| decoder.beside(frame, counter.place()));
            let number = parts.as_ref().and_then(|parts| decoder.beside(frame, parts.place()));
            let is_broken = self.count_framing();
            if self.gather(number.map(|number| number.whole()), counter.map(|counter| counter.whole()), is_broken) {
                let time = self.plan.stamps.as_mut().and_then(|stamps| Some(stamps.time(stamp?)));
                if let Some(read) = self.judge(counter.map(|counter| counter.whole()), time, cells) {
                    return Some(read);
                }
            }
        }
    }

    /// Adds the part that was read to the frame. Returns whether the frame is complete. `is_broken` says that bytes
    /// before this part are missing.
    fn gather(&mut self, number: Option<u64>, counter: Option<u64>, is_broken: bool) -> bool {
        let Some(parts) = &mut self.plan.parts else {
            self.values.copy_from_slice(&self.part);
            return true;
        };
        let Some(part) = number.and_then(|number| parts.part_of(number)) else { return false };
        if is_broken && parts.forget() {
            self.tally.rejected += 1;
        }
        let follows = |new, old| self.plan.counter.as_ref().is_none_or(|counter| counter.continues(new, old));
        let gathered = parts.gather(part, counter, follows);
        if gathered.is_spoiled {
            self.tally.rejected += 1;
            self.current.clear();
        }
        let start = part * parts.values;
        self.values[start..start + parts.values].copy_from_slice(&self.part);
        gathered.is_complete
    }

    /// Decides whether a complete frame is new, and writes its image.
    fn judge(&mut self, counter: Option<u64>, time: Option<i64>, cells: &mut [f32]) -> Option<Read> {
        let step = self.plan.parts.as_mut().map_or(1, Parts::take_step);
        let is_same = std::mem::replace(&mut self.has_last, true) && self.last == self.current;
        std::mem::swap(&mut self.last, &mut self.current);
        self.current.clear();
        if !(self.plan.image.write(&self.values, cells) && self.write_vectors()) {
            self.tally.rejected += 1;
            return None;
        }
        match (&mut self.plan.counter, counter) {
            (Some(known), Some(counter)) => match known.judge(counter, step) {
                Sequence::New { number, lost } => {
                    self.tally.lost += lost;
                    self.number = number;
                }
                Sequence::Repeated => self.tally.repeated += 1,
                Sequence::Late => {
                    self.tally.late += 1;
                    return None;
                }
            },
            _ => {
                self.tally.repeated += u64::from(is_same);
                self.number += u64::from(!is_same || self.plan.repeats_are_new);
            }
        }
        self.tally.frames += 1;
        Some(Read { number: self.number, time })
    }

    /// Writes the vector image, if the pad has one. Returns whether all values are finite.
    fn write_vectors(&mut self) -> bool {
        let axes = self.plan.vectors.iter().flatten().enumerate();
        axes.fold(true, |is_finite, (axis, image)| {
            let cells = self.vectors.iter_mut().map(|cell| &mut cell[axis]);
            image.write(&self.values, cells) & is_finite
        })
    }

    /// Adds what framing has counted. Returns whether bytes or frames were dropped.
    fn count_framing(&mut self) -> bool {
        let new = self.plan.framer.counts();
        let old = std::mem::replace(&mut self.counts, new);
        self.tally.rejected += new.rejected - old.rejected;
        self.tally.resyncs += new.resyncs - old.resyncs;
        self.tally.skipped += new.skipped - old.skipped;
        new != old
    }
}

/// Whether the content of a frame makes sense. Its values are then in `values`.
fn is_sound(frame: &[u8], decoder: &mut Decoder, parts: Option<&Parts>, values: &mut [f64]) -> bool {
    decoder.read(frame, values)
        && parts.is_none_or(|parts| {
            let number = decoder.beside(frame, parts.place());
            number.is_some_and(|number| parts.part_of(number.whole()).is_some())
        })
}
