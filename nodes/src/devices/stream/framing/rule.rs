//! What makes some bytes a frame: its mark, its length, its checksum, and a content that makes sense.

use super::IsSound;
use super::check::Check;
use crate::devices::stream::decoding::decoder::Place;

/// The length of a frame.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Length {
    /// All frames have one length.
    One(usize),
    /// The number of a part, which begins at `first`, decides.
    ByPart { place: Place, first: u64, lengths: Vec<usize> },
}

/// What makes some bytes a frame.
#[derive(Clone)]
pub(crate) struct Rule {
    /// Bytes that every frame has.
    pub(crate) mark: Vec<u8>,
    /// Offset of the mark in the frame.
    pub(crate) mark_at: usize,
    pub(crate) length: Length,
    pub(crate) check: Option<Check>,
}

/// What the bytes from a place on are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Verdict {
    /// More bytes are needed.
    Wait,
    /// They do not have the mark, or no length.
    Stranger,
    /// They begin with a frame of this length that has the mark, and it is wrong.
    Bad(usize),
    /// They begin with a frame of this length.
    Good(usize),
}

impl Rule {
    /// Returns the length of the frame that begins here: `Ok(None)` if more bytes are needed.
    ///
    /// # Errors
    /// If no frame begins with these bytes.
    fn length_of(&self, bytes: &[u8]) -> Result<Option<usize>, ()> {
        match &self.length {
            Length::One(length) => Ok(Some(*length)),
            Length::ByPart { place, first, lengths } => {
                let Some(number) = bytes.get(place.offset..).and_then(|bytes| place.cell.read(bytes)) else {
                    return Ok(None);
                };
                let part = number.checked_sub(*first).and_then(|part| usize::try_from(part).ok());
                part.and_then(|part| lengths.get(part)).map(|length| Some(*length)).ok_or(())
            }
        }
    }

    /// Returns the length of the longest frame.
    pub(crate) fn longest(&self) -> usize {
        match &self.length {
            Length::One(length) => *length,
            Length::ByPart { lengths, .. } => lengths.iter().copied().max().unwrap_or(0),
        }
    }

    /// Whether the bytes have the mark of a frame that begins with them, as far as they go.
    pub(crate) fn fits_mark(&self, bytes: &[u8]) -> bool {
        let there = bytes.get(self.mark_at..).unwrap_or_default();
        there.iter().zip(&self.mark).all(|(byte, mark)| byte == mark)
    }

    /// Judges the bytes from the beginning of a frame on.
    pub(crate) fn judge(&self, bytes: &[u8], is_sound: IsSound<'_>) -> Verdict {
        if !self.fits_mark(bytes) {
            return Verdict::Stranger;
        }
        let length = match self.length_of(bytes) {
            Ok(Some(length)) => length,
            Ok(None) => return Verdict::Wait,
            Err(()) => return Verdict::Stranger,
        };
        match bytes.get(..length) {
            None => Verdict::Wait,
            Some(frame) if self.check.as_ref().is_none_or(|check| check.holds(frame)) && is_sound(frame) => {
                Verdict::Good(length)
            }
            Some(_) => Verdict::Bad(length),
        }
    }

    /// Judges a message, which holds one frame and nothing else.
    pub(crate) fn is_whole(&self, bytes: &[u8], is_sound: IsSound<'_>) -> bool {
        self.judge(bytes, is_sound) == Verdict::Good(bytes.len())
    }
}
