//! Frames with a mark at a fixed place: a header (`sync`) or a trailer.
//!
//! The mark can occur in the data, and a checksum of 8 bits holds by chance once in 256 times. So a frame is only
//! believed if it has a CRC of 16 bits or more, or if it is the third in a row. From then on each frame is delivered as
//! soon as it is complete, until one is not where it should be. A frame with a wrong checksum, and a good one in its
//! place behind it, was damaged on the way: it is dropped, and nothing else.
//!
//! If the data has the mark at the same place in several frames, there are several rows of frames. Then only a pause
//! can say which is the right one: most pads send a frame and rest. A row whose frames begin after a pause is right
//! if no other row has such a beginning. Without this, nothing is delivered: a frame that is cut at the wrong place
//! would look valid.

use std::collections::VecDeque;

use super::check::Check;
use super::rule::{Length, Rule, Verdict};
use super::{Counts, IsSound};

/// Number of frames in a row after which frames without a CRC of 16 bits or more are believed.
const ROW: usize = 3;
/// Number of pauses that are remembered.
const PAUSES: usize = 8;
/// Number of beginnings after a pause that decide between rows.
const DECIDING_PAUSES: usize = 2;
/// Number of rows above which none is believed, whatever the pauses.
const MAX_RIVALS: usize = 64;

/// Finds frames by their mark.
#[derive(Clone)]
pub(crate) struct Marked {
    rule: Rule,
    buffer: Vec<u8>,
    /// Where the next frame begins, or where one is looked for.
    start: usize,
    /// Position of the buffer in the stream.
    base: u64,
    is_locked: bool,
    /// Positions in the stream of the first bytes after a pause.
    pauses: VecDeque<u64>,
    /// Whether there are several rows of frames, and no pause decides between them.
    pub(super) is_ambiguous: bool,
    pub(super) counts: Counts,
}

/// Frames one behind the other.
struct Row {
    /// Where each begins, and where the last one ends.
    places: [usize; ROW + 1],
    /// Number of frames that are complete.
    complete: usize,
    /// Whether a frame is wrong, and if so whether it has the mark.
    broken: Option<Verdict>,
}

impl Marked {
    pub(crate) fn new(rule: Rule) -> Self {
        let buffer = Vec::with_capacity((ROW + 1) * rule.longest());
        Self {
            rule,
            buffer,
            start: 0,
            base: 0,
            is_locked: false,
            pauses: VecDeque::with_capacity(PAUSES),
            is_ambiguous: false,
            counts: Counts::default(),
        }
    }

    pub(super) fn push(&mut self, bytes: &[u8], is_after_pause: bool) {
        self.buffer.drain(..self.start);
        self.base += self.start as u64;
        self.start = 0;
        if is_after_pause {
            if self.pauses.len() == PAUSES {
                self.pauses.pop_front();
            }
            self.pauses.push_back(self.base + self.buffer.len() as u64);
        }
        self.buffer.extend_from_slice(bytes);
    }

    pub(super) fn forget(&mut self) {
        self.counts.skipped += (self.buffer.len() - self.start) as u64;
        self.buffer.clear();
        self.pauses.clear();
        (self.start, self.is_locked, self.is_ambiguous) = (0, false, false);
    }

    pub(super) fn next(&mut self, is_sound: IsSound<'_>) -> Option<&[u8]> {
        loop {
            let frame = if self.is_locked { self.follow(is_sound) } else { self.search(is_sound) };
            match frame {
                Step::Frame(start, end) => {
                    self.start = end;
                    return Some(&self.buffer[start..end]);
                }
                Step::Wait => return None,
                Step::Again => {}
            }
        }
    }

    /// Judges the frame that should begin at the place of the last one's end.
    fn follow(&mut self, is_sound: IsSound<'_>) -> Step {
        match self.rule.judge(&self.buffer[self.start..], is_sound) {
            Verdict::Wait => return Step::Wait,
            Verdict::Good(length) if self.is_followed(self.start + length) => {
                return Step::Frame(self.start, self.start + length);
            }
            Verdict::Bad(length) if self.rule.check.is_some() => match self.next_verdict(length, is_sound) {
                Verdict::Wait => return Step::Wait,
                Verdict::Good(_) => {
                    self.counts.rejected += 1;
                    self.skip_to(self.start + length);
                    return Step::Again;
                }
                _ => {}
            },
            _ => {}
        }
        self.counts.rejected += 1;
        self.counts.resyncs += 1;
        self.is_locked = false;
        self.skip_to(self.start + 1);
        Step::Again
    }

    /// Judges the frame behind one of this length.
    fn next_verdict(&self, length: usize, is_sound: IsSound<'_>) -> Verdict {
        self.rule.judge(&self.buffer[self.start + length..], is_sound)
    }

    /// Whether the bytes behind a frame, as far as they have arrived, can be the next one. A frame that has lost a
    /// byte ends with a byte of the next one.
    fn is_followed(&self, end: usize) -> bool {
        self.rule.check.is_some() || self.rule.fits_mark(&self.buffer[end..])
    }

    /// Looks for a frame that can be believed.
    fn search(&mut self, is_sound: IsSound<'_>) -> Step {
        let Some(candidate) = self.candidate() else { return Step::Wait };
        if self.rule.check.as_ref().is_some_and(Check::is_proof) {
            return match self.rule.judge(&self.buffer[candidate..], is_sound) {
                Verdict::Wait => Step::Wait,
                Verdict::Good(length) => self.lock(candidate, candidate + length),
                verdict => self.refuse(verdict),
            };
        }
        let row = self.row(candidate, is_sound);
        match row.broken {
            Some(verdict) => self.refuse(if row.complete == 0 { verdict } else { Verdict::Stranger }),
            None if row.complete < ROW => Step::Wait,
            None if !self.is_followed(row.places[ROW]) => self.refuse(Verdict::Stranger),
            None => self.choose(&row, is_sound),
        }
    }

    /// Gives up the candidate at the start.
    fn refuse(&mut self, verdict: Verdict) -> Step {
        self.counts.rejected += u64::from(matches!(verdict, Verdict::Bad(_)));
        self.skip_to(self.start + 1);
        Step::Again
    }

    fn lock(&mut self, start: usize, end: usize) -> Step {
        (self.is_locked, self.is_ambiguous) = (true, false);
        Step::Frame(start, end)
    }

    /// Chooses between a complete row and those that run beside it.
    fn choose(&mut self, row: &Row, is_sound: IsSound<'_>) -> Step {
        let own = self.pauses_at(row);
        let (mut rivals, mut best) = (0, None);
        for place in row.places[0] + 1..row.places[1] {
            if rivals == MAX_RIVALS {
                break;
            }
            if !self.has_marks(place) {
                continue;
            }
            let rival = self.row(place, is_sound);
            let merges = rival.places[1..=rival.complete].iter().any(|place| row.places.contains(place));
            if rival.broken.is_none() && !merges {
                rivals += 1;
                let pauses = self.pauses_at(&rival);
                if pauses > 0 && best.is_none_or(|(most, _)| pauses > most) {
                    best = Some((pauses, place));
                }
            }
        }
        match best {
            _ if rivals == 0 => self.lock(row.places[ROW - 1], row.places[ROW]),
            None if own >= DECIDING_PAUSES && rivals < MAX_RIVALS => self.lock(row.places[ROW - 1], row.places[ROW]),
            Some((pauses, place)) if own == 0 && pauses >= DECIDING_PAUSES => {
                // Its row is judged next; it may not be complete yet.
                self.skip_to(place);
                Step::Again
            }
            _ => {
                self.is_ambiguous = true;
                self.skip_to(row.places[1]);
                Step::Again
            }
        }
    }

    /// Whether the marks of a row from a place on are there, as far as they have arrived.
    fn has_marks(&self, place: usize) -> bool {
        let step = if let Length::One(length) = self.rule.length { length } else { self.buffer.len() };
        let places = (0..ROW).map(|i| place + i * step);
        places.into_iter().all(|place| self.rule.fits_mark(self.buffer.get(place..).unwrap_or_default()))
    }

    /// Follows the frames from a place on.
    fn row(&self, place: usize, is_sound: IsSound<'_>) -> Row {
        let mut row = Row { places: [place; ROW + 1], complete: 0, broken: None };
        for i in 0..ROW {
            match self.rule.judge(&self.buffer[row.places[i]..], is_sound) {
                Verdict::Good(length) => {
                    let end = row.places[i] + length;
                    row.places[i + 1..].fill(end);
                    row.complete = i + 1;
                }
                Verdict::Wait => return row,
                verdict => {
                    row.broken = Some(verdict);
                    return row;
                }
            }
        }
        row
    }

    /// Returns how many frames of a row begin after a pause.
    fn pauses_at(&self, row: &Row) -> usize {
        let places = &row.places[..=row.complete];
        let is_at = |pause: &&u64| places.iter().any(|place| self.base + *place as u64 == **pause);
        self.pauses.iter().filter(is_at).count()
    }

    /// Returns the next place where a frame can begin, by the mark as far as it has arrived. The bytes before it are no
    /// frame.
    fn candidate(&mut self) -> Option<usize> {
        let last = self.buffer.len().saturating_sub(self.rule.mark_at).max(self.start);
        let found = (self.start..last).find(|place| self.rule.fits_mark(&self.buffer[*place..]));
        self.skip_to(found.unwrap_or(last));
        found
    }

    fn skip_to(&mut self, place: usize) {
        self.counts.skipped += (place - self.start) as u64;
        self.start = place;
    }
}

/// What was found.
enum Step {
    /// A frame, from its first byte to the place behind its last one.
    Frame(usize, usize),
    /// More bytes are needed.
    Wait,
    /// The bytes from the new start on are to be judged.
    Again,
}
