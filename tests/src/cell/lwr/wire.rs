//! The datagrams of FRI 1.0, little-endian: MSR of the controller, and CMD of the driver.

use super::JOINTS;

pub(super) const MSR_BYTES: usize = 916;
pub(super) const CMD_BYTES: usize = 376;
pub(super) const MSR_ID: u16 = 0x2006;
const CMD_ID: u16 = 0x1005;

/// An answer of the driver.
pub(super) struct Cmd {
    pub(super) sequence: u16,
    pub(super) reflected: u16,
    pub(super) flags: u32,
    pub(super) position: Vec<f64>,
}

impl Cmd {
    /// Reads a datagram, or returns `None` if it is no CMD.
    pub(super) fn read(bytes: &[u8]) -> Option<Self> {
        let word = |at: usize| u16::from_le_bytes([bytes[at], bytes[at + 1]]);
        let long = |at: usize| [bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]];
        if bytes.len() != CMD_BYTES || usize::from(word(4)) != CMD_BYTES || word(6) != CMD_ID {
            return None;
        }
        let position: Vec<f64> = (0..JOINTS).map(|i| f64::from(f32::from_le_bytes(long(144 + 4 * i)))).collect();
        let is_finite = position.iter().all(|q| q.is_finite());
        let cmd = Self { sequence: word(0), reflected: word(2), flags: u32::from_le_bytes(long(140)), position };
        is_finite.then_some(cmd)
    }
}

/// A message that is being written.
pub(super) struct Msr(pub(super) [u8; MSR_BYTES]);

impl Msr {
    pub(super) fn u16s(&mut self, at: usize, values: &[u16]) {
        for (i, value) in values.iter().enumerate() {
            self.0[at + 2 * i..at + 2 * i + 2].copy_from_slice(&value.to_le_bytes());
        }
    }

    pub(super) fn u32(&mut self, at: usize, value: u32) {
        self.0[at..at + 4].copy_from_slice(&value.to_le_bytes());
    }

    pub(super) fn f32s(&mut self, at: usize, values: &[f64]) {
        for (i, value) in values.iter().enumerate() {
            self.0[at + 4 * i..at + 4 * i + 4].copy_from_slice(&(*value as f32).to_le_bytes());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    proptest::proptest! {
        #[test]
        fn any_datagram_is_an_answer_or_rejected(mut bytes in proptest::collection::vec(0u8.., CMD_BYTES - 1..CMD_BYTES + 2)) {
            bytes[4..8].copy_from_slice(&[0x78, 0x01, 0x05, 0x10]);
            let cmd = Cmd::read(&bytes);
            proptest::prop_assert!(cmd.is_none_or(|cmd| bytes.len() == CMD_BYTES && cmd.position.iter().all(|q| q.is_finite())));
        }
    }
}
