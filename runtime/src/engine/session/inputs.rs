//! The log of the inputs of each tick: what a replay needs to compute the same tick without the devices.
//!
//! The inputs of one tick are a list of items. Each starts with its tag, one byte, and all numbers are little-endian. A
//! text is its length (u32) and UTF-8.
//!
//! | tag | item | bytes |
//! |---|---|---|
//! | `W` | an operator word before the tick | text |
//! | `T` | the tick begins | u64 number, i64 time \[ns\], i64 lateness \[ns\] if it is a trouble, or 0 |
//! | `B` | in real time: how late the tick began | i64 lateness \[ns\] |
//! | `V` | a parameter of `[live]` takes a value in the tick | f64 value, f64 value toward which it moves, text name |
//! | `X` | the devices were asked | u8: whether the clock device has sampled |
//! | `R` | the commands of a device were set to zero, because its driver has ended | u16 device |
//! | `F` | a device has failed | u16 device, text |
//! | `L` | a device has lost its lease | u16 device, u8: whether it refused the commands; text if so |
//! | `P` | a port of a device was written or lost | below |
//!
//! `P` continues with u16 device, u16 port, u8 state (0 value, 1 absent, 2 lost), u8: whether a value follows, i64 stamp
//! \[ns\], u64 sequence number, u64 number of writes, u64 number of losses, the text of the last loss, and the value. A
//! port that is not listed is as in the tick before.

use crate::device::{PortSample, SampleState, Samples};
use crate::engine::core::{DeviceLink, DeviceSlot};
use crate::node::Tick;
use crate::signal::put_text;

/// The tags of the items.
pub(super) const WORD: u8 = b'W';
pub(super) const TICK: u8 = b'T';
pub(super) const BEGAN: u8 = b'B';
pub(super) const VALUE: u8 = b'V';
pub(super) const EXCHANGE: u8 = b'X';
pub(super) const REST: u8 = b'R';
pub(super) const FAILURE: u8 = b'F';
pub(super) const LEASE: u8 = b'L';
pub(super) const PORT: u8 = b'P';

/// The states of a port.
pub(super) const STATES: [SampleState; 3] = [SampleState::Value, SampleState::Absent, SampleState::Lost];

/// Bytes of the longest item without its texts and its value.
const ITEM_BYTES: usize = 64;
/// Bytes that are kept for texts.
const TEXT_BYTES: usize = 4096;

/// The inputs of the last tick.
pub(crate) struct InputLog {
    bytes: Vec<u8>,
    /// Whether the bytes are those of a tick that has begun.
    has_begun: bool,
    /// Number and time of the last tick [ns].
    tick: (u64, i64),
    /// Bytes that a tick without a trouble takes at most.
    room: usize,
    seen: Vec<SeenDevice>,
}

/// What is logged of a device.
struct SeenDevice {
    has_failed: bool,
    ports: Vec<SeenPort>,
}

/// The state of a port as it is logged.
#[derive(Default)]
struct SeenPort {
    writes: u64,
    losses: u64,
    is_lost: bool,
    loss: String,
}

impl SeenPort {
    fn is_current(&self, sample: &PortSample) -> bool {
        let is_lost = sample.state == SampleState::Lost;
        (self.writes, self.losses, self.is_lost) == (sample.writes, sample.losses, is_lost)
            && (!is_lost || self.loss == sample.loss)
    }
}

impl InputLog {
    /// Creates the log of a run that has not begun. Its memory suffices for every tick without a trouble.
    pub(super) fn new(devices: &[DeviceSlot]) -> Self {
        let ports = |device: &DeviceSlot| device.samples.ports.iter().map(|_| SeenPort::default()).collect();
        let seen = devices.iter().map(|device| SeenDevice { has_failed: false, ports: ports(device) }).collect();
        let outputs = devices.iter().flat_map(|device| &device.description.outputs);
        let room = outputs.map(|port| port.shape.max_bytes() + ITEM_BYTES).sum::<usize>();
        Self {
            bytes: Vec::with_capacity(room + TEXT_BYTES),
            has_begun: false,
            tick: (0, 0),
            room: room + TEXT_BYTES,
            seen,
        }
    }

    /// Returns the number and the time of the last tick, and its inputs.
    pub(super) fn last(&self) -> (u64, i64, &[u8]) {
        (self.tick.0, self.tick.1, &self.bytes)
    }

    /// Returns the number of bytes that a tick without a trouble takes at most.
    pub(super) const fn max_bytes(&self) -> usize {
        self.room
    }

    /// Forgets the last tick, once.
    fn renew(&mut self) {
        if std::mem::take(&mut self.has_begun) {
            self.bytes.clear();
        }
    }

    /// Logs a word that is sent before the next tick.
    pub(super) fn word(&mut self, word: &str) {
        self.renew();
        self.bytes.push(WORD);
        put_text(&mut self.bytes, word);
    }

    /// Logs the beginning of a tick: how late it is if that is a trouble, and how late it is in real time [ns].
    pub(super) fn begin(&mut self, tick: &Tick, late: Option<i64>, by: Option<i64>) {
        self.renew();
        (self.has_begun, self.tick) = (true, (tick.index, tick.now));
        self.bytes.push(TICK);
        self.bytes.extend_from_slice(&tick.index.to_le_bytes());
        self.bytes.extend_from_slice(&tick.now.to_le_bytes());
        self.bytes.extend_from_slice(&late.unwrap_or(0).to_le_bytes());
        if let Some(by) = by {
            self.bytes.push(BEGAN);
            self.bytes.extend_from_slice(&by.to_le_bytes());
        }
    }

    /// Logs that a parameter takes a value, on its way to another one.
    pub(super) fn value(&mut self, name: &str, [value, target]: [f64; 2]) {
        self.bytes.push(VALUE);
        self.bytes.extend_from_slice(&value.to_le_bytes());
        self.bytes.extend_from_slice(&target.to_le_bytes());
        put_text(&mut self.bytes, name);
    }

    /// Logs what the devices have sampled, and which have ended or failed.
    pub(super) fn exchanged(&mut self, devices: &mut [DeviceSlot], has_sampled: bool) {
        self.bytes.extend_from_slice(&[EXCHANGE, u8::from(has_sampled)]);
        for (i, (device, seen)) in devices.iter_mut().zip(&mut self.seen).enumerate() {
            let number = (i as u16).to_le_bytes();
            if std::mem::take(&mut device.has_rested) {
                self.bytes.push(REST);
                self.bytes.extend_from_slice(&number);
            }
            if let Some(why) = device.failed.as_ref().filter(|_| !seen.has_failed) {
                seen.has_failed = true;
                self.bytes.push(FAILURE);
                self.bytes.extend_from_slice(&number);
                put_text(&mut self.bytes, why);
            }
            // A device that has failed is not read any more.
            if !matches!(device.link, DeviceLink::Gone) {
                log_ports(&mut self.bytes, i, &device.samples, &mut seen.ports);
            }
        }
    }

    /// Logs that a device has lost its lease, and why it refused the commands.
    pub(super) fn lost_lease(&mut self, device: usize, refusal: Option<&str>) {
        self.bytes.push(LEASE);
        self.bytes.extend_from_slice(&(device as u16).to_le_bytes());
        self.bytes.push(u8::from(refusal.is_some()));
        refusal.iter().for_each(|why| put_text(&mut self.bytes, why));
    }
}

fn log_ports(bytes: &mut Vec<u8>, device: usize, samples: &Samples, seen: &mut [SeenPort]) {
    for (port, (sample, seen)) in samples.ports.iter().zip(seen).enumerate() {
        if seen.is_current(sample) {
            continue;
        }
        let has_value = sample.state == SampleState::Value && seen.writes != sample.writes;
        let state = STATES.iter().position(|state| *state == sample.state).unwrap_or(0);
        bytes.push(PORT);
        bytes.extend_from_slice(&(device as u16).to_le_bytes());
        bytes.extend_from_slice(&(port as u16).to_le_bytes());
        bytes.extend_from_slice(&[state as u8, u8::from(has_value)]);
        bytes.extend_from_slice(&sample.stamp.to_le_bytes());
        [sample.sequence, sample.writes, sample.losses].iter().for_each(|n| bytes.extend_from_slice(&n.to_le_bytes()));
        // The text matters while the port is lost, and once more if it was lost and is back.
        let is_told = sample.state == SampleState::Lost || seen.losses != sample.losses;
        put_text(bytes, if is_told { &sample.loss } else { "" });
        if has_value {
            samples.arenas.write_bytes(sample.kind, sample.slot, bytes);
        }
        (seen.writes, seen.losses, seen.is_lost) = (sample.writes, sample.losses, sample.state == SampleState::Lost);
        if is_told {
            seen.loss.clear();
            seen.loss.push_str(&sample.loss);
        }
    }
}
