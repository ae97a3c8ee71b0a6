//! Framing: from bytes as they arrive to whole frames. It is pure: it reads and writes nothing else.
//!
//! Bytes are pushed in pieces of any size, and frames come out as soon as they are complete. The bytes that wait are
//! bounded by four frames and one piece.

pub(crate) mod check;
pub(crate) mod lines;
pub(crate) mod marked;
pub(crate) mod messages;
pub(crate) mod packets;
pub(crate) mod replies;
pub(crate) mod rule;

pub(crate) use crate::devices::link::Counts;

use bytes::{Buf, BytesMut};
use lines::Lines;
use marked::Marked;
use messages::Messages;
use packets::Packets;
use replies::Replies;

/// Finds the frames in a stream of bytes.
#[derive(Clone)]
pub(crate) enum Framer {
    Marked(Marked),
    Lines(Lines),
    Packets(Packets),
    Messages(Messages),
    Replies(Replies),
}

/// Whether the content of a frame makes sense.
pub(crate) type IsSound<'a> = &'a mut dyn FnMut(&[u8]) -> bool;

impl Framer {
    /// Adds bytes that have arrived. `is_after_pause` says that nothing had arrived for a while before.
    pub(crate) fn push(&mut self, bytes: &[u8], is_after_pause: bool) {
        match self {
            Self::Marked(framer) => framer.push(bytes, is_after_pause),
            Self::Lines(framer) => framer.push(bytes),
            Self::Packets(framer) => framer.push(bytes),
            Self::Messages(framer) => framer.push(bytes),
            Self::Replies(framer) => framer.push(bytes),
        }
    }

    /// Returns the next frame, or `None` if more bytes are needed. Call it again until then.
    pub(crate) fn next(&mut self, is_sound: IsSound<'_>) -> Option<&[u8]> {
        match self {
            Self::Marked(framer) => framer.next(is_sound),
            Self::Lines(framer) => framer.next(is_sound),
            Self::Packets(framer) => framer.next(is_sound),
            Self::Messages(framer) => framer.next(is_sound),
            Self::Replies(framer) => framer.next(is_sound),
        }
    }

    /// States that a frame is asked for now.
    pub(crate) fn ask(&mut self) {
        if let Self::Replies(framer) = self {
            framer.ask();
        }
    }

    /// Whether a frame was asked for and has not come.
    pub(crate) const fn is_waiting(&self) -> bool {
        matches!(self, Self::Replies(framer) if framer.is_asked)
    }

    /// Forgets the bytes so far, as after a new connection.
    pub(crate) fn forget(&mut self) {
        match self {
            Self::Marked(framer) => framer.forget(),
            Self::Lines(framer) => framer.forget(),
            Self::Packets(framer) => framer.forget(),
            Self::Messages(framer) => framer.forget(),
            Self::Replies(framer) => framer.forget(),
        }
    }

    /// Returns what was counted so far.
    pub(crate) fn counts(&self) -> Counts {
        match self {
            Self::Marked(framer) => framer.counts,
            Self::Lines(framer) => framer.counts,
            Self::Packets(framer) => framer.counts,
            Self::Messages(framer) => framer.counts,
            Self::Replies(framer) => framer.counts,
        }
    }

    /// Whether the mark stands at several places of every frame, so that the right one is not known.
    pub(crate) const fn is_ambiguous(&self) -> bool {
        matches!(self, Self::Marked(framer) if framer.is_ambiguous)
    }
}

/// Takes the bytes up to the next `end`, without it.
fn take_until(pending: &mut BytesMut, end: u8) -> Option<BytesMut> {
    let length = pending.iter().position(|byte| *byte == end)?;
    let taken = pending.split_to(length);
    pending.advance(1);
    Some(taken)
}

#[cfg(test)]
mod tests;
