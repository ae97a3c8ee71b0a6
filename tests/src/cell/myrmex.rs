//! Myrmex v2 with the AGNI serial protocol, from the side of the device.
//!
//! A frame is `F0 C4 | 01 | stamp u32 LE | 256 words u16 LE | XOR`. A word has the channel of the converter in its high
//! nibble and 12 bits of the reading below, and the reading falls with the force. The device sends frames between the
//! commands start and stop, and answers what it is asked.

use std::io;
use std::path::Path;

use serde_json::{Value, json};

use super::PadWire;
use super::pty::Pty;

const HEADER: [u8; 2] = [0xF0, 0xC4];
const SIDE: usize = 16;
/// The blocks of four by four tactels: the word of the first tactel of each row and column in a block.
const BLOCK: [[u8; 4]; 4] = [[208, 224, 32, 0], [192, 48, 16, 64], [176, 144, 112, 80], [160, 240, 128, 96]];
/// Bytes that are kept of what a host writes.
const MAX_INBOX: usize = 4096;
/// Time between two frames after a start without a period [s].
const DEFAULT_PERIOD: f64 = 0.001;

/// What the sensor says of itself.
pub(super) struct Identity {
    /// Type in its configuration.
    pub(super) uid: u16,
    /// Serial number; none is answered without it.
    pub(super) serial: Option<String>,
    /// Unit of its stamps [µs].
    pub(super) stamp_unit_us: f64,
    /// Reading of the simulated pad that 4095 stands for [counts].
    pub(super) full_scale: f64,
}

/// The sensor.
pub(super) struct Myrmex {
    pty: Pty,
    identity: Identity,
    inbox: Vec<u8>,
    is_started: bool,
    /// Shortest time between two frames [s].
    period: f64,
    sent: f64,
    counts: Counts,
}

#[derive(Default)]
struct Counts {
    starts: u64,
    stops: u64,
    rejected: u64,
}

impl Myrmex {
    /// Opens its terminal.
    ///
    /// # Errors
    /// If there is no terminal.
    pub(super) fn open(link: Option<&Path>, identity: Identity) -> io::Result<Self> {
        Ok(Self {
            pty: Pty::open(link)?,
            identity,
            inbox: Vec::new(),
            is_started: false,
            period: DEFAULT_PERIOD,
            sent: f64::NEG_INFINITY,
            counts: Counts::default(),
        })
    }

    /// Obeys the commands in the inbox.
    fn obey(&mut self) -> io::Result<()> {
        loop {
            let Some(start) = self.inbox.windows(2).position(|pair| pair == HEADER) else {
                let keep = self.inbox.len().min(1);
                self.inbox.drain(..self.inbox.len() - keep);
                return Ok(());
            };
            self.inbox.drain(..start);
            let Some(length) = length(&self.inbox) else { return Ok(()) };
            let message: Vec<u8> = self.inbox.drain(..length).collect();
            if xor(&message) != 0 {
                self.counts.rejected += 1;
                self.answer(&[0xFE, 0xF0])?;
                continue;
            }
            self.obey_one(message[2], message[3], &message[4..length - 1])?;
        }
    }

    fn obey_one(&mut self, to: u8, command: u8, rest: &[u8]) -> io::Result<()> {
        match (to, command) {
            (0, 0x00) => {
                self.is_started = false;
                self.counts.stops += 1;
            }
            (0, 0xC0) => {
                let [uid, bytes] = [self.identity.uid, 512].map(u16::to_le_bytes);
                self.answer(&[0x00, 0x01, 0x02, 0x01, uid[0], uid[1], bytes[0], bytes[1]])?;
            }
            (0, 0xC1) => self.answer(&[0xF1, 0x11, 0x01, 0x01])?,
            (0, 0xC2) => {
                if let Some(serial) = self.identity.serial.clone() {
                    let text = &serial.as_bytes()[..serial.len().min(200)];
                    self.answer(&[&[0xF2, text.len() as u8], text].concat())?;
                }
            }
            (_, 0xD0) => {
                let tenths = rest.last_chunk::<2>().map_or(0, |bytes| u16::from_le_bytes(*bytes));
                if tenths > 0 && to <= 1 {
                    self.period = f64::from(tenths) * 1e-4;
                } else {
                    self.answer(&[0xFE, 0xF2])?;
                }
            }
            (0, 0xF1) => {
                self.is_started = true;
                self.counts.starts += 1;
            }
            (0, 0xF0) => self.answer(&[0xF0])?,
            _ => self.answer(&[0xFE, 0xF1])?,
        }
        Ok(())
    }

    fn answer(&mut self, body: &[u8]) -> io::Result<()> {
        let message = sealed(body);
        self.pty.send(&message).map(drop)
    }
}

/// Returns a message with its header and its checksum.
fn sealed(body: &[u8]) -> Vec<u8> {
    let mut message = [&HEADER, body].concat();
    message.push(xor(&message));
    message
}

fn xor(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum ^ byte)
}

/// Returns the length of the command that begins here, or `None` while it is not complete.
fn length(inbox: &[u8]) -> Option<usize> {
    let (to, command) = (*inbox.get(2)?, *inbox.get(3)?);
    let data = match (to, command) {
        // To the master, the size is the number of entries of an id and a period.
        (0, 0xD0) => 2 + 3 * usize::from(u16::from_le_bytes([*inbox.get(4)?, *inbox.get(5)?])).min(256),
        (_, 0xD0) => 4,
        _ => 0,
    };
    let length = 4 + data + 1;
    (inbox.len() >= length).then_some(length)
}

/// Returns the word that holds a tactel.
fn word(row: usize, col: usize) -> usize {
    usize::from(BLOCK[row % 4][col % 4]) + 4 * (row / 4) + col / 4
}

impl PadWire for Myrmex {
    fn serve(&mut self) -> io::Result<()> {
        self.pty.receive(&mut self.inbox, MAX_INBOX)?;
        self.obey()?;
        self.pty.flush()
    }

    fn send(&mut self, counts: &[f32], time: f64) -> io::Result<bool> {
        // Half a millisecond of patience, as the images have a period of their own.
        if !self.is_started || time - self.sent < self.period - 5e-4 {
            return Ok(false);
        }
        self.sent = time;
        let mut words = [0_u16; SIDE * SIDE];
        for (i, count) in counts.iter().enumerate().take(SIDE * SIDE) {
            let reading = (f64::from(*count) / self.identity.full_scale * 4095.0).round().clamp(0.0, 4095.0);
            let at = word(i / SIDE, i % SIDE);
            words[at] = ((at as u16 / 16) << 12) | (4095 - reading as u16);
        }
        let stamp = (time * 1e6 / self.identity.stamp_unit_us) as u64 as u32;
        let mut body = vec![0x01];
        body.extend_from_slice(&stamp.to_le_bytes());
        body.extend(words.iter().flat_map(|word| word.to_le_bytes()));
        self.pty.send(&sealed(&body))
    }

    fn place(&self) -> Value {
        json!({ "wire": "myrmex", "path": self.pty.path() })
    }

    fn counts(&self) -> Value {
        json!({
            "starts": self.counts.starts, "stops": self.counts.stops, "rejected": self.counts.rejected,
            "is_started": self.is_started,
        })
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::{Read, Write};

    use super::*;

    fn pad() -> (Myrmex, File) {
        let identity = Identity { uid: 0x1234, serial: None, stamp_unit_us: 100.0, full_scale: 4095.0 };
        let pad = Myrmex::open(None, identity).unwrap();
        let host = File::options().read(true).write(true).open(pad.pty.path()).unwrap();
        (pad, host)
    }

    fn hex(text: &str) -> Vec<u8> {
        (0..text.len() / 2).map(|i| u8::from_str_radix(&text[2 * i..2 * i + 2], 16).unwrap()).collect()
    }

    #[test]
    fn the_literal_bytes_of_the_protocol_are_answered_and_obeyed() {
        let (mut pad, mut host) = pad();
        host.write_all(&hex("F0C400C0F4")).unwrap();
        while pad.inbox.is_empty() && pad.counts.rejected == 0 {
            pad.pty.receive(&mut pad.inbox, MAX_INBOX).unwrap();
        }
        pad.serve().unwrap();
        let mut config = [0; 11];
        host.read_exact(&mut config).unwrap();
        assert_eq!(config[..], hex("F0C4000102013412000212"));
    }

    #[test]
    fn a_started_sensor_sends_520_bytes_whose_words_are_where_the_table_says() {
        let (mut pad, mut host) = pad();
        let mut counts = [0.0; 256];
        counts[0] = 4095.0;
        counts[16 * 5 + 2] = 1000.0;
        assert!(!pad.send(&counts, 0.5).unwrap(), "it has not started");
        pad.inbox = hex("F0C400F1C5");
        pad.obey().unwrap();
        assert!(pad.send(&counts, 0.5).unwrap());
        let mut frame = [0; 520];
        host.read_exact(&mut frame).unwrap();
        assert_eq!(xor(&frame), 0);
        assert_eq!(frame[..7], hex("F0C40188130000"));
        let word = |at: usize| u16::from_le_bytes([frame[7 + 2 * at], frame[8 + 2 * at]]) & 0x0FFF;
        // By the closed form: B[0][0] = 208 and B[1][2] + 4 = 20.
        assert_eq!((word(208), word(20), word(0)), (0, 3095, 4095));
        pad.inbox = hex("F0C4000034");
        pad.obey().unwrap();
        assert!(!pad.send(&counts, 1.5).unwrap(), "it has stopped");
    }

    #[test]
    fn every_tactel_has_a_word_of_its_own() {
        let mut words: Vec<usize> = (0..256).map(|i| word(i / 16, i % 16)).collect();
        words.sort_unstable();
        assert_eq!(words, (0..256).collect::<Vec<_>>());
    }

    proptest::proptest! {
        #[test]
        fn any_bytes_of_a_host_are_obeyed_or_skipped(bodies: Vec<(bool, Vec<u8>)>) {
            let (mut pad, _host) = pad();
            for (has_header, body) in bodies {
                pad.inbox.extend(HEADER.iter().take(if has_header { 2 } else { 0 }).chain(&body));
                pad.inbox.truncate(MAX_INBOX);
                pad.obey().unwrap();
            }
        }
    }
}
