//! The clock of a pad: the stamp and the counter of a frame, which begin again at 0 when their bits are used up.

use tactflow_runtime::node::Param;

use super::decoder::{Place, Reading};

/// Unit of a stamp.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
pub(crate) enum StampUnit {
    /// Seconds.
    S,
    /// Milliseconds.
    Ms,
    /// Microseconds.
    Us,
    /// Nanoseconds.
    Ns,
}

impl StampUnit {
    const fn nanos(self) -> i64 {
        match self {
            Self::S => 1_000_000_000,
            Self::Ms => 1_000_000,
            Self::Us => 1_000,
            Self::Ns => 1,
        }
    }
}

/// Returns how far `new` is ahead of `old` in a number of that many bits: by at most half of its range in either
/// direction.
fn ahead(new: u64, old: u64, bits: Option<u32>) -> i64 {
    let difference = new.wrapping_sub(old);
    match bits {
        Some(bits) if bits < 64 => {
            let unused = 64 - bits;
            ((difference << unused) as i64) >> unused
        }
        _ => difference as i64,
    }
}

/// Makes the stamps of a pad a time that does not begin again.
#[derive(Debug, Clone)]
pub(crate) struct Stamps {
    place: Place,
    unit: StampUnit,
    /// The last stamp, and the time that it means [ns].
    last: Option<(u64, i64)>,
}

impl Stamps {
    pub(crate) const fn new(place: Place, unit: StampUnit) -> Self {
        Self { place, unit, last: None }
    }

    pub(crate) const fn place(&self) -> Place {
        self.place
    }

    /// Returns the time of a stamp in the clock of the pad [ns].
    pub(crate) fn time(&mut self, stamp: Reading) -> i64 {
        let nanos = self.unit.nanos();
        match stamp {
            Reading::Decimal(number) => (number * nanos as f64) as i64,
            Reading::Whole(number) => {
                let time = match self.last {
                    Some((old, time)) => {
                        time.saturating_add(ahead(number, old, self.place.cell.bits()).saturating_mul(nanos))
                    }
                    None => i64::try_from(number).unwrap_or(i64::MAX).saturating_mul(nanos),
                };
                self.last = Some((number, time));
                time
            }
        }
    }
}

/// What a counter says of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Sequence {
    /// It is new. Its number, and how many frames are missing before it.
    New { number: u64, lost: u64 },
    /// It is the last one again.
    Repeated,
    /// It is older than the last one.
    Late,
}

/// Counts the frames of a pad by its own counter.
#[derive(Debug, Clone)]
pub(crate) struct Counter {
    place: Place,
    /// The last number of the pad, and the number that does not begin again.
    last: Option<(u64, u64)>,
    /// Number of frames in a row that were older than the last one.
    late: u32,
}

/// Number of old frames in a row after which the pad has begun to count anew.
const RESTART_FRAMES: u32 = 3;
/// Number of missing frames above which the pad has begun to count anew.
const MAX_LOST: i64 = 100_000;

impl Counter {
    pub(crate) const fn new(place: Place) -> Self {
        Self { place, last: None, late: 0 }
    }

    pub(crate) const fn place(&self) -> Place {
        self.place
    }

    /// Whether `new` is `old` or the number after it.
    pub(crate) fn continues(&self, new: u64, old: u64) -> bool {
        matches!(ahead(new, old, self.place.cell.bits()), 0 | 1)
    }

    /// Judges the counter of a frame. Two frames in a row differ by `step`.
    pub(crate) fn judge(&mut self, counter: u64, step: u64) -> Sequence {
        let Some((old, number)) = self.last else {
            self.last = Some((counter, counter));
            return Sequence::New { number: counter, lost: 0 };
        };
        let ahead = ahead(counter, old, self.place.cell.bits());
        match ahead {
            0 => return Sequence::Repeated,
            i64::MIN..0 => {
                self.late += 1;
                if self.late < RESTART_FRAMES {
                    return Sequence::Late;
                }
            }
            _ => {}
        }
        self.late = 0;
        let lost = if (0..=MAX_LOST).contains(&ahead) { (ahead as u64 / step.max(1)).max(1) - 1 } else { 0 };
        let number = number.wrapping_add(1 + lost);
        self.last = Some((counter, number));
        Sequence::New { number, lost }
    }

    /// Forgets the last frame, as after a new connection.
    pub(crate) fn forget(&mut self) {
        (self.last, self.late) = (None, 0);
    }
}

#[cfg(test)]
mod tests {
    use super::super::cell::Field;
    use super::*;

    const fn place(cell: Field) -> Place {
        Place { offset: 0, cell }
    }

    #[test]
    fn a_stamp_goes_on_when_its_bits_are_used_up() {
        let mut stamps = Stamps::new(place(Field::U16le), StampUnit::Ms);
        let times: Vec<i64> = [65530, 65535, 4, 9].map(|stamp| stamps.time(Reading::Whole(stamp))).into();
        assert_eq!(times, [65_530, 65_535, 65_540, 65_545].map(|ms| ms * 1_000_000));
        // A stamp that goes back a little, as of a datagram that came late.
        assert_eq!(stamps.time(Reading::Whole(7)), 65_543_000_000);
        let mut wide = Stamps::new(place(Field::U64le), StampUnit::Us);
        assert_eq!(wide.time(Reading::Whole(u64::MAX)), i64::MAX, "no number overflows");
        assert_eq!(wide.time(Reading::Whole(5)), i64::MAX, "no number overflows");
        let mut text = Stamps::new(place(Field::Dec), StampUnit::S);
        assert_eq!(text.time(Reading::Decimal(1.5)), 1_500_000_000);
    }

    #[test]
    fn a_counter_counts_what_is_lost_repeated_and_late() {
        let mut counter = Counter::new(place(Field::U8));
        let new = |number, lost| Sequence::New { number, lost };
        let cases = [
            (250, new(250, 0)),
            (251, new(251, 0)),
            (251, Sequence::Repeated),
            (254, new(254, 2)),
            (1, new(257, 2)),
            (0, Sequence::Late),
            (2, new(258, 0)),
        ];
        for (number, expected) in cases {
            assert_eq!(counter.judge(number, 1), expected, "{number}");
        }
    }

    #[test]
    fn a_pad_that_begins_to_count_anew_is_followed_after_three_frames() {
        let mut counter = Counter::new(place(Field::U32le));
        counter.judge(5000, 1);
        assert_eq!([0, 1].map(|number| counter.judge(number, 1)), [Sequence::Late; 2]);
        assert_eq!(counter.judge(2, 1), Sequence::New { number: 5001, lost: 0 });
        assert_eq!(counter.judge(3, 1), Sequence::New { number: 5002, lost: 0 });
        assert_eq!(counter.judge(2_000_000_000, 1), Sequence::New { number: 5003, lost: 0 }, "that many are not lost");
        counter.forget();
        assert_eq!(counter.judge(1, 1), Sequence::New { number: 1, lost: 0 });
    }

    #[test]
    fn a_counter_of_packets_counts_frames() {
        let mut counter = Counter::new(place(Field::U32le));
        assert_eq!(counter.judge(2, 2), Sequence::New { number: 2, lost: 0 });
        assert_eq!(counter.judge(4, 2), Sequence::New { number: 3, lost: 0 });
        assert_eq!(counter.judge(8, 2), Sequence::New { number: 5, lost: 1 });
    }
}
