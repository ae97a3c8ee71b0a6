//! Replays the inputs of a recording: writes the samples of the devices, sends the words and runs the tick.

use super::engine::Engine;
use super::input_items::{InputItem, read_port};
use super::inputs::{InputLog, TICK, WORD};
use super::punctuality::Beginning;
use crate::device::RecordedDevice;
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
        let devices = self.devices.iter().zip(&self.device_roles);
        let device = |(device, roles): (&DeviceSlot, &Vec<usize>)| {
            let roles = roles.iter().map(|role| self.roles[*role].0.clone()).collect();
            RecordedDevice::of(&device.name, &device.description, is_live(device)).with_roles(roles)
        };
        devices.map(device).collect()
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
                Some(InputItem::Tick { now: time, .. }) => now = Some(time),
                Some(InputItem::Began(by)) => began = Some(by),
                Some(InputItem::Exchange(has)) => has_sampled = has,
                Some(InputItem::Value(name, value)) => values.push((name.to_owned(), value)),
                Some(_) => {}
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

    /// Carries out the first item. Returns it, or `None` if it does not fit.
    fn apply<'b>(&mut self, reader: &mut ByteReader<'b>) -> Option<InputItem<'b>> {
        let item = InputItem::read(reader)?;
        match item {
            InputItem::Word(word) => {
                // A word without an effect had none in the recording either.
                let _ = self.send(word);
            }
            InputItem::Tick { now, late } => {
                let is_next = self.ticks() == 0 || now > self.now();
                if !is_next {
                    return None;
                }
                if late > 0 {
                    self.begin_late(late);
                }
            }
            InputItem::Rest(device) => self.devices.get_mut(device)?.commands.rest(),
            InputItem::Failure(device, why) => {
                self.devices.get_mut(device)?.failed.get_or_insert(why.to_owned());
            }
            InputItem::Lease(device, refusal) => {
                self.devices.get_mut(device)?.lease_lost = Some(refusal.map(str::to_owned));
            }
            InputItem::Port(device) => read_port(&mut self.devices.get_mut(device)?.samples, reader)?,
            InputItem::Began(_) | InputItem::Value(..) | InputItem::Exchange(_) => {}
        }
        Some(item)
    }
}
