//! Packets of RTDE: `size u16 | command u8 | payload`, big-endian. The size counts the whole packet.

use bytes::BytesMut;

/// Bytes before the payload.
const HEADER: usize = 3;
/// Largest packet that its size can state [bytes].
const MAX_PACKET: usize = u16::MAX as usize;

/// Asks for, or answers, a protocol version.
pub(super) const VERSION: u8 = b'V';
/// Asks for, or states, the version of the controller's software.
pub(super) const CONTROLLER: u8 = b'v';
/// A text of the controller.
pub(super) const TEXT: u8 = b'M';
/// Asks for, or answers, a recipe of outputs.
pub(super) const OUTPUTS: u8 = b'O';
/// Asks for the start of the stream, or answers it.
pub(super) const START: u8 = b'S';
/// One sample of the outputs.
pub(super) const SAMPLE: u8 = b'U';

/// Returns a packet.
///
/// # Panics
/// If the payload does not fit a packet.
pub(super) fn packet(command: u8, payload: &[u8]) -> Vec<u8> {
    let size = u16::try_from(HEADER + payload.len()).expect("no payload of this driver is that long");
    [&size.to_be_bytes(), &[command][..], payload].concat()
}

/// Returns the packet that asks for outputs at a rate [Hz].
pub(super) fn outputs_request(rate_hz: f64, names: &[&str]) -> Vec<u8> {
    packet(OUTPUTS, &[&rate_hz.to_be_bytes(), names.join(",").as_bytes()].concat())
}

/// Splits a stream of bytes into packets, wherever it is cut.
#[derive(Debug)]
pub(super) struct Splitter {
    /// Bytes that are not taken yet. At most a part of one packet is left between two calls of `feed`.
    bytes: BytesMut,
    /// The packet that was taken last.
    packet: BytesMut,
}

impl Splitter {
    /// A splitter that is fed at most `most` bytes at once.
    pub(super) fn new(most: usize) -> Self {
        Self { bytes: BytesMut::with_capacity(MAX_PACKET + most), packet: BytesMut::new() }
    }

    /// Adds bytes that have arrived. All whole packets must have been taken before.
    pub(super) fn feed(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// Whether a part of a packet has arrived.
    pub(super) fn is_in_a_packet(&self) -> bool {
        !self.bytes.is_empty()
    }

    /// Takes the next whole packet: its command and its payload.
    ///
    /// # Errors
    /// If a packet states a size that is smaller than its header. What follows cannot be read.
    pub(super) fn take(&mut self) -> Result<Option<(u8, &[u8])>, String> {
        let Some(size) = self.bytes.first_chunk::<2>() else { return Ok(None) };
        let size = usize::from(u16::from_be_bytes(*size));
        if size < HEADER {
            return Err(format!("a packet states a size of {size} bytes, but its header has {HEADER}"));
        }
        if self.bytes.len() < size {
            return Ok(None);
        }
        self.packet = self.bytes.split_to(size);
        Ok(Some((self.packet[2], &self.packet[HEADER..])))
    }
}

/// A text of the controller.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Text {
    pub(super) text: String,
    pub(super) source: String,
    /// 0 exception, 1 error, 2 warning, 3 information.
    pub(super) level: u8,
}

/// Reads the payload of a text: `length u8 | text | length u8 | source | level u8`. Returns `None` if it is not one.
pub(super) fn text(payload: &[u8]) -> Option<Text> {
    let (text, rest) = counted(payload)?;
    let (source, rest) = counted(rest)?;
    let [level] = *rest else { return None };
    Some(Text { text, source, level })
}

fn counted(bytes: &[u8]) -> Option<(String, &[u8])> {
    let (length, rest) = bytes.split_first()?;
    let (text, rest) = rest.split_at_checked(usize::from(*length))?;
    Some((String::from_utf8_lossy(text).into_owned(), rest))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Reads hexadecimal digits.
    pub(in super::super) fn hex(digits: &str) -> Vec<u8> {
        let digits: Vec<u8> = digits.bytes().filter(|digit| !digit.is_ascii_whitespace()).collect();
        digits.chunks(2).map(|pair| u8::from_str_radix(str::from_utf8(pair).unwrap(), 16).unwrap()).collect()
    }

    /// Literal vectors of the protocol.
    #[test]
    fn requests_have_the_bytes_of_the_protocol() {
        assert_eq!(packet(VERSION, &2u16.to_be_bytes()), hex("0005560002"));
        assert_eq!(packet(START, &[]), hex("000353"));
        let request = outputs_request(500.0, &["timestamp", "actual_q", "actual_qd", "safety_mode"]);
        assert_eq!(request[..11], hex("00334F407F400000000000"));
        assert_eq!(request[11..], *b"timestamp,actual_q,actual_qd,safety_mode");
        assert_eq!(request.len(), 0x33);
    }

    #[test]
    fn replies_are_split_from_the_stream() {
        let mut splitter = Splitter::new(64);
        splitter.feed(&hex("00045601 00045301 000355"));
        assert_eq!(splitter.take(), Ok(Some((VERSION, &[1][..]))));
        assert_eq!(splitter.take(), Ok(Some((START, &[1][..]))));
        assert_eq!(splitter.take(), Ok(Some((SAMPLE, &[][..]))));
        assert_eq!(splitter.take(), Ok(None));
        assert!(!splitter.is_in_a_packet());
        splitter.feed(&[0]);
        assert!(splitter.is_in_a_packet());
        assert_eq!(splitter.take(), Ok(None));
        splitter.feed(&[2, 7]);
        assert_eq!(splitter.take(), Err("a packet states a size of 2 bytes, but its header has 3".into()));
    }

    #[test]
    fn texts_are_read() {
        let found = text(b"\x05hello\x04RTDE\x02").unwrap();
        assert_eq!((found.text.as_str(), found.source.as_str(), found.level), ("hello", "RTDE", 2));
        for bad in [&b""[..], b"\x05hell", b"\x05hello", b"\x05hello\x04RTDE", b"\x05hello\x04RTDE\x02\x00"] {
            assert_eq!(text(bad), None, "{bad:?}");
        }
    }

    proptest! {
        #[test]
        fn packets_come_whole_wherever_the_stream_is_cut(
            payloads in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..40), 0..12),
            cuts in prop::collection::vec(1..30usize, 1..60),
        ) {
            let stream: Vec<u8> = payloads.iter().flat_map(|payload| packet(SAMPLE, payload)).collect();
            let (mut splitter, mut found, mut rest) = (Splitter::new(64), Vec::new(), &stream[..]);
            for cut in cuts.iter().cycle() {
                let (now, later) = rest.split_at((*cut).min(rest.len()));
                splitter.feed(now);
                while let Some((command, payload)) = splitter.take().unwrap() {
                    prop_assert_eq!(command, SAMPLE);
                    found.push(payload.to_vec());
                }
                rest = later;
                if rest.is_empty() {
                    break;
                }
            }
            prop_assert_eq!(found, payloads);
            prop_assert!(!splitter.is_in_a_packet());
        }

        #[test]
        fn any_bytes_are_split_or_refused(pieces in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..300), 0..30)) {
            let mut splitter = Splitter::new(300);
            'pieces: for piece in pieces {
                splitter.feed(&piece);
                loop {
                    match splitter.take() {
                        Ok(Some((_, payload))) => drop(text(payload)),
                        Ok(None) => break,
                        Err(_) => break 'pieces,
                    }
                }
                prop_assert!(splitter.bytes.len() <= MAX_PACKET + 300);
            }
        }
    }
}
