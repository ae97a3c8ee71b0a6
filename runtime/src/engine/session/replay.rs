//! Replays the inputs of a recording: writes the samples of the devices, sends the words and runs the tick.

use super::engine::Engine;
use super::inputs::{BEGAN, EXCHANGE, FAILURE, InputLog, LEASE, PORT, REST, STATES, TICK, VALUE, WORD};
use super::punctuality::Beginning;
use crate::device::{RecordedDevice, SampleState};
use crate::engine::core::{DeviceLink, DeviceSlot};
use crate::fault::Fault;
use crate::signal::ByteReader;

impl Engine {
    /// Logs the inputs of every tick from now on; see [`inputs`](Self::inputs).
    pub fn log_inputs(&mut self) {
        self.inputs = Some(Box::new(InputLog::new(&self.devices)));
    }

    /// Returns the number and the time [ns] of the last tick, and all its inputs as bytes: the samples as they reached the
    /// engine, and the words before it. `None` unless they are logged.
    #[must_use]
    pub fn inputs(&self) -> Option<(u64, i64, &[u8])> {
        self.inputs.as_ref().map(|log| log.last())
    }

    /// Returns the number of bytes of the longest inputs without words and troubles; 0 unless they are logged.
    #[must_use]
    pub fn max_input_bytes(&self) -> usize {
        self.inputs.as_ref().map_or(0, |log| log.max_bytes())
    }

    /// Returns the time of the tick that has these inputs [ns]; `None` if they contain no tick.
    #[must_use]
    pub fn time_of_inputs(inputs: &[u8]) -> Option<i64> {
        let mut reader = ByteReader(inputs);
        loop {
            match reader.u8()? {
                WORD => reader.text()?,
                TICK => return reader.u64().and_then(|_| reader.i64()),
                _ => return None,
            };
        }
    }

    /// Describes the devices, so that a replay needs none of them.
    #[must_use]
    pub fn recorded_devices(&self) -> Vec<RecordedDevice> {
        let is_live = |device: &DeviceSlot| match device.link {
            DeviceLink::Idle(_) | DeviceLink::Live(_) | DeviceLink::Down(_) => true,
            DeviceLink::Stepped(_) | DeviceLink::Gone => device.is_beside,
            DeviceLink::Recorded { is_live } => is_live,
        };
        let device = |device: &DeviceSlot| RecordedDevice::of(&device.name, &device.description, is_live(device));
        self.devices.iter().map(device).collect()
    }

    /// Runs a tick with the inputs of a recording. The devices of the graph must be those of the recording.
    ///
    /// # Errors
    /// Returns a message if the bytes are no inputs of these devices.
    pub fn replay(&mut self, inputs: &[u8]) -> Result<Result<(), Fault>, String> {
        let mut reader = ByteReader(inputs);
        let (mut now, mut began, mut has_sampled, mut values) = (None, None, false, Vec::new());
        while !reader.0.is_empty() {
            match self.apply(&mut reader) {
                Some(Item::Tick(time)) => now = Some(time),
                Some(Item::Began(by)) => began = Some(by),
                Some(Item::Exchange(has)) => has_sampled = has,
                Some(Item::Value(name, value)) => values.push((name, value)),
                Some(Item::Device) => {}
                None => return Err("the inputs do not fit the devices of the graph".into()),
            }
        }
        let Some(now) = now else { return Err("the inputs contain no tick".into()) };
        self.live.replay(&values)?;
        if let Some(by) = began {
            self.punctuality.count(Beginning { time: now.saturating_add(by), wall: 0, by }, None);
        }
        self.replayed = Some(has_sampled);
        Ok(self.tick(now))
    }

    /// Carries out the first item.
    fn apply(&mut self, reader: &mut ByteReader<'_>) -> Option<Item> {
        match reader.u8()? {
            WORD => {
                // A word without an effect had none in the recording either.
                let _ = self.send(reader.text()?);
                Some(Item::Device)
            }
            TICK => {
                let (_, now, late) = (reader.u64()?, reader.i64()?, reader.i64()?);
                let is_next = self.ticks() == 0 || now > self.now();
                if !is_next || !is_time(now) || !is_time(late) {
                    return None;
                }
                if late > 0 {
                    self.begin_late(late);
                }
                Some(Item::Tick(now))
            }
            BEGAN => reader.i64().filter(|by| is_time(*by) && *by >= 0).map(Item::Began),
            VALUE => {
                let value = [reader.u64()?, reader.u64()?].map(f64::from_bits);
                let is_finite = value.iter().all(|number| number.is_finite());
                let name = reader.text()?.to_owned();
                is_finite.then_some(Item::Value(name, value))
            }
            EXCHANGE => Some(Item::Exchange(reader.u8()? != 0)),
            REST => {
                self.recorded(reader)?.commands.rest();
                Some(Item::Device)
            }
            FAILURE => {
                let device = self.recorded(reader)?;
                device.failed.get_or_insert(reader.text()?.to_owned());
                Some(Item::Device)
            }
            LEASE => {
                let device = self.recorded(reader)?;
                let refusal = if reader.u8()? != 0 { Some(reader.text()?.to_owned()) } else { None };
                device.lease_lost = Some(refusal);
                Some(Item::Device)
            }
            PORT => {
                apply_port(self.recorded(reader)?, reader)?;
                Some(Item::Device)
            }
            _ => None,
        }
    }

    /// Returns the device whose number comes next.
    fn recorded(&mut self, reader: &mut ByteReader<'_>) -> Option<&mut DeviceSlot> {
        self.devices.get_mut(usize::from(reader.u16()?))
    }
}

/// Largest time of an input [ns], and largest sequence number: others are damaged, and sums of them would overflow.
const MAX_TIME: u64 = 1 << 60;
const MAX_SEQUENCE: u64 = 1 << 48;

/// Whether a number can be a time [ns].
const fn is_time(nanos: i64) -> bool {
    nanos.unsigned_abs() < MAX_TIME
}

/// An item that was carried out.
enum Item {
    /// The time of the tick [ns].
    Tick(i64),
    /// How late it began in real time [ns].
    Began(i64),
    /// Whether the clock device has sampled.
    Exchange(bool),
    /// A parameter, its value and the value toward which it moves.
    Value(String, [f64; 2]),
    Device,
}

/// Writes a port of a device.
fn apply_port(device: &mut DeviceSlot, reader: &mut ByteReader<'_>) -> Option<()> {
    let samples = &mut device.samples;
    let sample = samples.ports.get_mut(usize::from(reader.u16()?))?;
    sample.state = STATES.get(usize::from(reader.u8()?))?.clone();
    let has_value = reader.u8()? != 0;
    sample.stamp = reader.i64()?;
    (sample.sequence, sample.writes, sample.losses) = (reader.u64()?, reader.u64()?, reader.u64()?);
    if !is_time(sample.stamp) || sample.sequence > MAX_SEQUENCE {
        return None;
    }
    let loss = reader.text()?;
    if !loss.is_empty() || sample.state == SampleState::Lost {
        sample.loss = loss.to_owned().into();
    }
    if has_value {
        samples.arenas.read_bytes(sample.kind, sample.slot, reader)?;
    }
    Some(())
}
