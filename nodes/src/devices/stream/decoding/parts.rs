//! Frames in parts: several packets that make one image.
//!
//! The parts of a frame come one after the other. Most protocols do not number their frames, so a part that is missing,
//! repeated or out of order spoils the frame: the parts of two frames must not be mixed.

use super::decoder::Place;

/// How a part of a frame is identified.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PartNumber {
    /// By a number, which begins at `first`.
    Index { place: Place, first: u64 },
    /// By the index of the first value.
    Start { place: Place },
}

/// The parts of a frame.
#[derive(Debug, Clone)]
pub(crate) struct Parts {
    pub(crate) number: PartNumber,
    /// Number of parts of a frame.
    pub(crate) count: usize,
    /// Number of values in a part.
    pub(crate) values: usize,
    /// The part that ends a frame, from 0.
    pub(crate) last: usize,
    /// Number of parts of this frame so far.
    gathered: usize,
    /// The counters of the first part of this frame and of the part before.
    counters: Option<(u64, u64)>,
}

/// What becomes of a part.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Gathered {
    /// Whether the frame is complete.
    pub(crate) is_complete: bool,
    /// Whether a frame is spoiled, this one or the one before.
    pub(crate) is_spoiled: bool,
}

impl Parts {
    pub(crate) const fn new(number: PartNumber, count: usize, values: usize, last: usize) -> Self {
        Self { number, count, values, last, gathered: 0, counters: None }
    }

    /// Where the number of a part stands.
    pub(crate) const fn place(&self) -> Place {
        match self.number {
            PartNumber::Index { place, .. } | PartNumber::Start { place } => place,
        }
    }

    /// Returns which part has this number, from 0, or `None` if there is none.
    pub(crate) fn part_of(&self, number: u64) -> Option<usize> {
        let part = match self.number {
            PartNumber::Index { first, .. } => number.checked_sub(first)?,
            PartNumber::Start { .. } => {
                let values = self.values as u64;
                number.is_multiple_of(values).then_some(number / values)?
            }
        };
        usize::try_from(part).ok().filter(|part| *part < self.count)
    }

    /// Adds a part, with its counter if there is one. `continues` says whether a counter follows another one.
    pub(crate) fn gather(
        &mut self,
        part: usize,
        counter: Option<u64>,
        continues: impl Fn(u64, u64) -> bool,
    ) -> Gathered {
        let first = (self.last + 1) % self.count;
        let place = (part + self.count - first) % self.count;
        let is_next = match (counter, self.counters) {
            (Some(new), Some((_, old))) if self.gathered > 0 => continues(new, old),
            _ => true,
        };
        let is_spoiled = place != self.gathered || !is_next;
        if is_spoiled {
            self.forget();
            if place != 0 {
                return Gathered { is_complete: false, is_spoiled };
            }
        }
        self.gathered += 1;
        self.counters = counter.map(|new| (self.counters.map_or(new, |(begin, _)| begin), new));
        let is_complete = self.gathered == self.count;
        if is_complete {
            self.gathered = 0;
        }
        Gathered { is_complete, is_spoiled }
    }

    /// Returns by how much the counters of two complete frames differ.
    pub(crate) fn take_step(&mut self) -> u64 {
        self.counters.take().map_or(1, |(begin, end)| end.wrapping_sub(begin).min(self.count as u64 - 1) + 1)
    }

    /// Drops the parts so far. Returns whether there were any.
    pub(crate) fn forget(&mut self) -> bool {
        self.counters = None;
        std::mem::take(&mut self.gathered) > 0
    }
}

#[cfg(test)]
mod tests {
    use super::super::cell::Field;
    use super::*;

    const PLACE: Place = Place { offset: 4, cell: Field::U8 };

    /// A frame in that many parts of two values; which parts complete a frame, and which spoil one.
    fn gather(parts: &mut Parts, sequence: &[usize]) -> (Vec<usize>, Vec<usize>) {
        let all: Vec<Gathered> = sequence.iter().map(|part| parts.gather(*part, None, |_, _| true)).collect();
        let which =
            |is_so: fn(&Gathered) -> bool| all.iter().enumerate().filter(move |(_, it)| is_so(it)).map(|(i, _)| i);
        (which(|it| it.is_complete).collect(), which(|it| it.is_spoiled).collect())
    }

    #[test]
    fn parts_are_gathered_in_order() {
        type Case = (&'static [usize], &'static [usize], &'static [usize]);
        let cases: [Case; 7] = [
            (&[0, 1, 2, 0, 1, 2], &[2, 5], &[]),
            // A part is missing: the first, a middle one, the last.
            (&[1, 2, 0, 1, 2], &[4], &[0, 1]),
            (&[0, 2, 0, 1, 2], &[4], &[1]),
            (&[0, 1, 0, 1, 2], &[4], &[2]),
            // A part is repeated.
            (&[0, 0, 1, 2], &[3], &[1]),
            (&[0, 1, 1, 2, 0, 1, 2], &[6], &[2, 3]),
            // Two parts are exchanged, across the border of a frame too.
            (&[0, 2, 1, 0, 1, 2], &[5], &[1, 2]),
        ];
        for (sequence, complete, spoiled) in cases {
            let mut parts = Parts::new(PartNumber::Index { place: PLACE, first: 1 }, 3, 2, 2);
            assert_eq!(gather(&mut parts, sequence), (complete.to_vec(), spoiled.to_vec()), "{sequence:?}");
        }
    }

    #[test]
    fn any_part_can_end_a_frame() {
        let mut parts = Parts::new(PartNumber::Index { place: PLACE, first: 0 }, 3, 2, 0);
        assert_eq!(gather(&mut parts, &[0, 1, 2, 0, 1, 2, 0]), (vec![3, 6], vec![0]));
    }

    #[test]
    fn a_part_is_known_by_its_number_or_by_its_first_value() {
        let by_index = Parts::new(PartNumber::Index { place: PLACE, first: 0x3C }, 64, 1, 63);
        assert_eq!([0x3B, 0x3C, 0x7B, 0x7C].map(|number| by_index.part_of(number)), [None, Some(0), Some(63), None]);
        let by_start = Parts::new(PartNumber::Start { place: PLACE }, 4, 16, 3);
        assert_eq!([0, 16, 48, 64, 8].map(|number| by_start.part_of(number)), [Some(0), Some(1), Some(3), None, None]);
    }

    #[test]
    fn a_gap_in_the_counter_spoils_a_frame() {
        let follows = |new: u64, old: u64| new == old || new == old + 1;
        let mut parts = Parts::new(PartNumber::Start { place: PLACE }, 2, 16, 1);
        assert!(!parts.gather(0, Some(7), follows).is_complete);
        assert!(parts.gather(1, Some(8), follows).is_complete);
        assert_eq!(parts.take_step(), 2, "the counter is of packets");
        parts.gather(0, Some(9), follows);
        let second = parts.gather(1, Some(12), follows);
        assert_eq!(second, Gathered { is_complete: false, is_spoiled: true });
        parts.gather(0, Some(13), follows);
        assert!(parts.gather(1, Some(13), follows).is_complete);
        assert_eq!(parts.take_step(), 1, "the counter is of frames");
    }
}
