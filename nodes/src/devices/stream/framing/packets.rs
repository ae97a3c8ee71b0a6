//! Packets of COBS or SLIP: a byte that cannot occur in a packet ends it.

use bytes::BytesMut;

use super::rule::Rule;
use super::{Counts, IsSound, take_until};

/// How packets are encoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Coding {
    /// Consistent overhead byte stuffing (Cheshire and Baker 1999): the byte 0 ends a packet.
    Cobs,
    /// SLIP (RFC 1055): the byte C0 ends a packet.
    Slip,
}

impl Coding {
    const fn end(self) -> u8 {
        match self {
            Self::Cobs => 0,
            Self::Slip => 0xC0,
        }
    }

    /// Returns the maximum number of bytes of a packet of that length.
    const fn longest(self, length: usize) -> usize {
        match self {
            Self::Cobs => length + length / 254 + 1,
            Self::Slip => 2 * length,
        }
    }

    /// Decodes a packet without its end. Returns whether it is one.
    fn decode(self, packet: &[u8], frame: &mut Vec<u8>) -> bool {
        frame.clear();
        match self {
            Self::Cobs => decode_cobs(packet, frame),
            Self::Slip => decode_slip(packet, frame),
        }
    }
}

fn decode_cobs(mut packet: &[u8], frame: &mut Vec<u8>) -> bool {
    while let Some((code, rest)) = packet.split_first() {
        let Some((block, rest)) = usize::from(*code).checked_sub(1).and_then(|size| rest.split_at_checked(size)) else {
            return false;
        };
        frame.extend_from_slice(block);
        // A full block has no zero behind it, and the last block has none either.
        if *code < 0xFF && !rest.is_empty() {
            frame.push(0);
        }
        packet = rest;
    }
    true
}

fn decode_slip(packet: &[u8], frame: &mut Vec<u8>) -> bool {
    const ESCAPE: u8 = 0xDB;
    let mut bytes = packet.iter();
    while let Some(byte) = bytes.next() {
        frame.push(match *byte {
            ESCAPE => match bytes.next() {
                Some(0xDC) => 0xC0,
                Some(0xDD) => ESCAPE,
                _ => return false,
            },
            byte => byte,
        });
    }
    true
}

/// Finds frames in packets.
#[derive(Clone)]
pub(crate) struct Packets {
    coding: Coding,
    rule: Rule,
    pending: BytesMut,
    frame: Vec<u8>,
    /// Whether the beginning of the next packet is known.
    is_aligned: bool,
    /// Whether the beginning of the next packet was dropped, because it was too long.
    is_cut: bool,
    pub(super) counts: Counts,
}

impl Packets {
    pub(crate) fn new(coding: Coding, rule: Rule) -> Self {
        let frame = Vec::with_capacity(coding.longest(rule.longest()));
        let (pending, counts) = (BytesMut::new(), Counts::default());
        Self { coding, rule, pending, frame, is_aligned: false, is_cut: false, counts }
    }

    pub(super) fn push(&mut self, bytes: &[u8]) {
        self.pending.extend_from_slice(bytes);
    }

    pub(super) fn forget(&mut self) {
        self.counts.skipped += self.pending.len() as u64;
        self.pending.clear();
        (self.is_aligned, self.is_cut) = (false, false);
    }

    pub(super) fn next(&mut self, is_sound: IsSound<'_>) -> Option<&[u8]> {
        let longest = self.coding.longest(self.rule.longest());
        while let Some(packet) = take_until(&mut self.pending, self.coding.end()) {
            let was_aligned = std::mem::replace(&mut self.is_aligned, true);
            let was_cut = std::mem::take(&mut self.is_cut);
            if packet.is_empty() {
                continue;
            }
            // The rest of a packet can be a packet too, with the values of other tactels.
            let is_decoded = !was_cut && packet.len() <= longest && self.coding.decode(&packet, &mut self.frame);
            if is_decoded && self.rule.is_whole(&self.frame, is_sound) {
                return Some(&self.frame);
            }
            self.counts.skipped += packet.len() as u64 + 1;
            // The first packet may have lost its beginning.
            self.counts.rejected += u64::from(was_aligned);
        }
        // A packet without an end must not grow for ever.
        if self.pending.len() > longest {
            self.counts.skipped += self.pending.len() as u64;
            self.counts.resyncs += u64::from(self.is_aligned);
            self.pending.clear();
            (self.is_aligned, self.is_cut) = (false, true);
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cobs_decodes_the_examples_of_its_paper() {
        let run: Vec<u8> = (1..=0xFE).collect();
        let long: Vec<u8> = [0xFF].into_iter().chain(run.clone()).collect();
        let longer: Vec<u8> = [0xFF].into_iter().chain(run.clone()).chain([2, 0xFF]).collect();
        let with_end: Vec<u8> = run.iter().copied().chain([0xFF]).collect();
        let cases: [(&[u8], &[u8]); 7] = [
            (&[1, 1], &[0]),
            (&[1, 1, 1], &[0, 0]),
            (&[3, 0x11, 0x22, 2, 0x33], &[0x11, 0x22, 0, 0x33]),
            (&[5, 0x11, 0x22, 0x33, 0x44], &[0x11, 0x22, 0x33, 0x44]),
            (&[2, 0x11, 1, 1, 1], &[0x11, 0, 0, 0]),
            (&long, &run),
            (&longer, &with_end),
        ];
        let mut frame = Vec::new();
        for (packet, expected) in cases {
            assert!(Coding::Cobs.decode(packet, &mut frame), "{packet:02X?}");
            assert_eq!(frame, expected, "{packet:02X?}");
        }
        assert!(!Coding::Cobs.decode(&[5, 1, 2], &mut frame), "the block is cut off");
    }

    #[test]
    fn slip_decodes_its_two_escapes() {
        let mut frame = Vec::new();
        assert!(Coding::Slip.decode(&[1, 0xDB, 0xDC, 2, 0xDB, 0xDD], &mut frame));
        assert_eq!(frame, [1, 0xC0, 2, 0xDB]);
        for wrong in [&[0xDB, 0x01][..], &[0xDB]] {
            assert!(!Coding::Slip.decode(wrong, &mut frame), "{wrong:02X?}");
        }
    }
}
