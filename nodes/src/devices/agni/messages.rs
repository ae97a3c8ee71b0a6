//! The messages of the AGNI serial protocol, without any I/O.
//!
//! A host sends `F0 C4 | to | command | XOR`, and for a period `F0 C4 | sensor | D0 | size u16 LE | period u16 LE | XOR`.
//! A device sends `F0 C4 | id | body | XOR`. The XOR covers every byte before it. The length of a message follows from
//! its id, and that of a frame from the configuration, so [`Messages`] needs the configuration before the frames.

use std::fmt;

use bytes::{Buf, BytesMut};

use crate::devices::link::Counts;

/// The beginning of each message.
const HEADER: [u8; 2] = [0xF0, 0xC4];

/// Asks the device to send no more frames.
pub(super) const STOP: [u8; 5] = [0xF0, 0xC4, 0x00, 0x00, 0x34];
/// Asks for the configuration.
pub(super) const ASK_CONFIG: [u8; 5] = [0xF0, 0xC4, 0x00, 0xC0, 0xF4];
/// Asks for the topology.
pub(super) const ASK_TOPOLOGY: [u8; 5] = [0xF0, 0xC4, 0x00, 0xC1, 0xF5];
/// Asks for the serial number.
pub(super) const ASK_SERIAL: [u8; 5] = [0xF0, 0xC4, 0x00, 0xC2, 0xF6];
/// Starts all sensors.
pub(super) const START: [u8; 5] = [0xF0, 0xC4, 0x00, 0xF1, 0xC5];

const ID_CONFIG: u8 = 0x00;
const ID_FIRST_SENSOR: u8 = 0x01;
const ID_LAST_SENSOR: u8 = 0xC9;
const ID_PING: u8 = 0xF0;
const ID_TOPOLOGY: u8 = 0xF1;
const ID_SERIAL: u8 = 0xF2;
const ID_ERROR: u8 = 0xFE;
/// The error whose checksum old firmware leaves off.
const UNKNOWN_COMMAND: u8 = 0xF1;
/// Types of a topology that is a matrix: from these on.
const FIRST_MATRIX: u8 = 0x11;
/// The version of the protocol that this is.
pub(super) const VERSION: u8 = 0x01;
/// Bytes of a frame without its payload: header, id, stamp and checksum.
const FRAME_BYTES: usize = 8;

/// Returns the message that sets the time between two frames of a sensor [0.1 ms].
pub(super) fn set_period(sensor: u8, tenths: u16) -> [u8; 9] {
    let [low, high] = tenths.to_le_bytes();
    let mut message = [HEADER[0], HEADER[1], sensor, 0xD0, 2, 0, low, high, 0];
    message[8] = xor(&message);
    message
}

fn xor(bytes: &[u8]) -> u8 {
    bytes.iter().fold(0, |sum, byte| sum ^ byte)
}

/// What a device has sent.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Message<'m> {
    Config(Config),
    /// The serial number.
    Serial(String),
    Frame(Frame<'m>),
    Fault(Fault),
    /// A topology or a ping, which nothing needs.
    Other,
}

/// A frame of one sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame<'m> {
    /// Its place in the configuration, from 1.
    pub(super) sensor: u8,
    /// Time of the device, in a unit that the protocol does not state. It wraps.
    pub(super) stamp: u32,
    pub(super) payload: &'m [u8],
}

/// The configuration of a device.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Config {
    pub(super) version: u8,
    /// The sensors, in the order of their ids from 1.
    pub(super) sensors: Vec<SensorType>,
}

/// What a device says of one of its sensors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct SensorType {
    /// Its type.
    pub(super) uid: u16,
    /// Bytes of its payload.
    pub(super) bytes: u16,
}

/// An error that a device reports.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Fault {
    Unknown,
    Checksum,
    Command,
    Sensor,
    Text(String),
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown => f.write_str("an unknown error"),
            Self::Checksum => f.write_str("a wrong checksum in a command"),
            Self::Command => f.write_str("an unknown command"),
            Self::Sensor => f.write_str("an unknown sensor"),
            Self::Text(text) => write!(f, "`{text}`"),
        }
    }
}

/// The bytes of a device, cut into messages.
///
/// After bytes that are no message, the next frame only shows that the cut is right, and is not returned: a checksum of
/// 8 bits alone takes one in 256 false beginnings for a frame.
#[derive(Debug, Default)]
pub(super) struct Messages {
    /// Bytes that have not been read.
    bytes: BytesMut,
    /// The message that was read last.
    last: BytesMut,
    /// Bytes of the payload of each sensor.
    payloads: Vec<usize>,
    /// Whether the last message ended where the next one begins.
    is_locked: bool,
    pub(super) counts: Counts,
}

/// What begins at the first byte that is not read.
enum Begin {
    /// A message of so many bytes.
    Message(usize),
    /// More bytes are needed.
    Incomplete,
    /// No message.
    Nothing,
}

impl Messages {
    /// Appends bytes. A message has at most 64 KiB, so no more than that and these bytes are kept.
    pub(super) fn push(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// Sets which frames come: one length of a payload for each sensor.
    pub(super) fn configure(&mut self, config: &Config) {
        self.payloads = config.sensors.iter().map(|sensor| usize::from(sensor.bytes)).collect();
    }

    /// Forgets the bytes, as after a break of the connection.
    pub(super) fn clear(&mut self) {
        self.bytes.clear();
        self.is_locked = false;
    }

    /// Returns the next message, or `None` if more bytes are needed.
    pub(super) fn next(&mut self) -> Option<Message<'_>> {
        loop {
            match self.begin() {
                Begin::Incomplete => return None,
                Begin::Nothing => self.skip(),
                Begin::Message(length) => {
                    self.last = self.bytes.split_to(length);
                    let was_locked = std::mem::replace(&mut self.is_locked, true);
                    if was_locked || !(ID_FIRST_SENSOR..=ID_LAST_SENSOR).contains(&self.last[2]) {
                        return Some(message(&self.last));
                    }
                }
            }
        }
    }

    /// Goes one byte on, because no message begins here.
    fn skip(&mut self) {
        self.bytes.advance(1);
        self.counts.skipped += 1;
        self.counts.resyncs += u64::from(self.is_locked);
        self.is_locked = false;
    }

    fn begin(&mut self) -> Begin {
        let bytes = &*self.bytes;
        if !bytes.iter().zip(&HEADER).all(|(byte, expected)| byte == expected) {
            return Begin::Nothing;
        }
        let length = match self.length(bytes) {
            Begin::Message(length) => length,
            other => return other,
        };
        if bytes.len() < length {
            return Begin::Incomplete;
        }
        // The only message that may end without a checksum.
        let is_bare = bytes[2] == ID_ERROR && length == 4;
        if is_bare || xor(&bytes[..length]) == 0 {
            return Begin::Message(length);
        }
        self.counts.rejected += u64::from((ID_FIRST_SENSOR..=ID_LAST_SENSOR).contains(&bytes[2]));
        Begin::Nothing
    }

    /// Returns the length of the message that begins here, by its id.
    fn length(&self, bytes: &[u8]) -> Begin {
        let at = |i: usize| bytes.get(i).map(|byte| usize::from(*byte));
        let Some(id) = bytes.get(2) else { return Begin::Incomplete };
        let length = match *id {
            ID_CONFIG => at(5).map(|count| 6 + 4 * count + 1),
            ID_PING => Some(4),
            ID_SERIAL => at(3).map(|length| 4 + length + 1),
            ID_TOPOLOGY => match at(3) {
                Some(kind) if kind >= usize::from(FIRST_MATRIX) => topology_length(bytes, kind),
                Some(_) => return Begin::Nothing,
                None => None,
            },
            ID_ERROR => match bytes.get(3) {
                Some(&UNKNOWN_COMMAND) => Some(if at(4) == Some(usize::from(xor(&bytes[..4]))) { 5 } else { 4 }),
                Some(&code @ 0x01..=0xEE) => Some(4 + usize::from(code) + 1),
                Some(_) => Some(5),
                None => None,
            },
            id => match self.payloads.get(usize::from(id) - 1) {
                Some(payload) => Some(FRAME_BYTES + payload),
                None => return Begin::Nothing,
            },
        };
        length.map_or(Begin::Incomplete, Begin::Message)
    }
}

/// Returns the length of a topology, or `None` while its cells are not all there.
fn topology_length(bytes: &[u8], kind: usize) -> Option<usize> {
    let cells = (kind >> 4) * (kind & 0xF);
    let mut at = 4;
    for _ in 0..cells {
        at += 1 + usize::from(*bytes.get(at)?);
    }
    Some(at + 1)
}

/// Reads a message that is complete.
fn message(bytes: &[u8]) -> Message<'_> {
    match bytes[2] {
        ID_CONFIG => {
            let (sensors, _) = bytes[6..bytes.len() - 1].as_chunks::<4>();
            let sensor = |[a, b, c, d]: &[u8; 4]| SensorType {
                uid: u16::from_le_bytes([*a, *b]),
                bytes: u16::from_le_bytes([*c, *d]),
            };
            Message::Config(Config { version: bytes[3], sensors: sensors.iter().map(sensor).collect() })
        }
        ID_SERIAL => Message::Serial(String::from_utf8_lossy(&bytes[4..bytes.len() - 1]).into_owned()),
        ID_ERROR => Message::Fault(match bytes[3] {
            0xF0 => Fault::Checksum,
            UNKNOWN_COMMAND => Fault::Command,
            0xF2 => Fault::Sensor,
            0x01..=0xEE => Fault::Text(String::from_utf8_lossy(&bytes[4..bytes.len() - 1]).into_owned()),
            _ => Fault::Unknown,
        }),
        sensor @ ID_FIRST_SENSOR..=ID_LAST_SENSOR => Message::Frame(Frame {
            sensor,
            stamp: u32::from_le_bytes([bytes[3], bytes[4], bytes[5], bytes[6]]),
            payload: &bytes[7..bytes.len() - 1],
        }),
        _ => Message::Other,
    }
}

#[cfg(test)]
mod tests;
