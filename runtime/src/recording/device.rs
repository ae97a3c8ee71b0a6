//! Plays the samples of a device of a recording, so that any graph runs on them.

use std::path::Path;

use super::reader::Recording;
use crate::device::{Commands, Description, DeviceError, Driver, Opened, RecordedDevice, Samples, Stepped};
use crate::engine::{InputItem, read_port};
use crate::signal::ByteReader;
use crate::source::{quoted, suggestion};

/// The way out of a recording that does not name the roles of its devices.
const AGAIN: &str = "an earlier version of tactflow has recorded it: record it again";

/// Why a device of a recording cannot be played.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PlayError {
    /// The file cannot be read, or its inputs are not complete.
    Broken(String),
    /// It has several devices, and no role was named: each device with its roles.
    Unnamed(Vec<(String, Vec<String>)>),
    /// No device has filled a role of that name: the name, and the roles.
    Unknown(String, Vec<String>),
}

impl From<String> for PlayError {
    fn from(message: String) -> Self {
        Self::Broken(message)
    }
}

/// Opens the device that has filled the role `role` in a recording, or the only one. It samples what the recorded one has
/// sampled, and follows no command. `contents` are those of the file, if they are in memory.
///
/// # Errors
/// If the recording cannot be read, its inputs are not complete, or it has no such device.
pub fn play_device(path: &Path, contents: Option<&[u8]>, role: Option<&str>) -> Result<Opened, PlayError> {
    let mut recording = match contents {
        Some(bytes) => Recording::of_bytes(bytes.to_vec())?,
        None => Recording::open(path)?,
    };
    let damaged = || format!("`{}` is damaged: it describes a device wrongly", path.display());
    let devices = recording.contents().devices.clone();
    let opened: Option<Vec<Opened>> = devices.iter().map(RecordedDevice::open).collect();
    let opened = opened.ok_or_else(damaged)?;
    let number = select(&devices, role)?;
    let mut samples: Vec<Samples> = opened.iter().map(|device| Samples::of(&device.description)).collect();
    let mut driver = Player::default();
    let mut count = 0_u32;
    while let Some(tick) = recording.next_tick()? {
        count = count.wrapping_add(1);
        if tick.number != count {
            return Err(format!("`{}` lacks the inputs of tick {count}", path.display()).into());
        }
        let added = driver.add(&tick.inputs, number, &mut samples);
        added.ok_or_else(|| format!("`{}` is damaged: the inputs of tick {count} are wrong", path.display()))?;
    }
    if count == 0 {
        return Err(format!("`{}` has no tick", path.display()).into());
    }
    let Opened { mut description, .. } = opened.into_iter().nth(number).ok_or_else(damaged)?;
    let fraction = recording.about().slow;
    fraction.iter().for_each(|fraction| description.undo_slow_down(*fraction));
    note(&mut description, path, fraction);
    Ok(Opened { description, driver: Driver::Stepped(Box::new(driver)) })
}

/// Says what is different from the recorded device.
fn note(description: &mut Description, path: &Path, slow: Option<f64>) {
    let path = path.display();
    description.is_open_loop = true;
    description.note(format!("follows no command: its samples are those of `{path}` (open loop)"));
    if let Some(fraction) = slow {
        description.note(format!("was recorded with `--slow {fraction}`: add it for the same limits of speed"));
    }
}

/// Returns the number of the device that has filled a role, or of the only one. Nodes that computed beside the tick are
/// none: the graph has them itself.
fn select(devices: &[RecordedDevice], role: Option<&str>) -> Result<usize, PlayError> {
    let edge: Vec<(usize, &RecordedDevice)> =
        devices.iter().enumerate().filter(|(_, device)| !device.is_node()).collect();
    let has = |role: &str| edge.iter().find(|(_, device)| device.roles.iter().any(|own| own == role));
    let names = |device: &RecordedDevice| (device.name.clone(), device.roles.clone());
    match (role, &edge[..]) {
        (Some(role), _) => has(role).map(|(i, _)| *i).ok_or_else(|| {
            let roles = edge.iter().flat_map(|(_, device)| device.roles.iter().cloned());
            PlayError::Unknown(role.to_owned(), roles.collect())
        }),
        (None, [(only, _)]) => Ok(*only),
        (None, _) => Err(PlayError::Unnamed(edge.iter().map(|(_, device)| names(device)).collect())),
    }
}

impl PlayError {
    /// Returns the message and the way out.
    #[must_use]
    pub fn describe(&self) -> (String, Option<String>) {
        match self {
            Self::Broken(message) => (message.clone(), None),
            Self::Unnamed(devices) if devices.is_empty() => ("the recording has no device".into(), None),
            Self::Unnamed(devices) => {
                let list = devices.iter().map(|(device, roles)| match roles.as_slice() {
                    [] => format!("`{device}`"),
                    roles => format!("`{device}` as {}", quoted(roles)),
                });
                let list: Vec<String> = list.collect();
                let message = format!("the recording has {} devices: {}", devices.len(), list.join(", "));
                let first = devices.iter().find_map(|(_, roles)| roles.first());
                let by_role = |role: &String| format!("select one by a role: `role = \"{role}\"`");
                (message, Some(first.map_or_else(|| AGAIN.into(), by_role)))
            }
            Self::Unknown(_, roles) if roles.is_empty() => {
                ("the recording does not name the roles of its devices".into(), Some(AGAIN.into()))
            }
            Self::Unknown(role, roles) => {
                let help = suggestion(role, roles.iter().map(String::as_str), "roles");
                (format!("no device of the recording was the role `{role}`"), Some(help))
            }
        }
    }
}

/// Plays the samples of a device.
#[derive(Default)]
struct Player {
    /// The items of the device, of all ticks.
    bytes: Vec<u8>,
    /// The time of each tick that has an item of the device [ns], and where its items end.
    ticks: Vec<(i64, usize)>,
    /// The next tick, and where its items begin.
    next: usize,
    at: usize,
    /// Time of the last tick [ns].
    end: i64,
    is_over: bool,
}

impl Player {
    /// Adds the items of a tick that are those of the device `number`. `None` if they do not fit the devices.
    fn add(&mut self, inputs: &[u8], number: usize, samples: &mut [Samples]) -> Option<()> {
        let (mut reader, mut now, begin) = (ByteReader(inputs), None, self.bytes.len());
        while !reader.0.is_empty() {
            let rest = reader.0;
            let of = match InputItem::read(&mut reader)? {
                InputItem::Tick { now: time, .. } => {
                    now = Some(time);
                    None
                }
                InputItem::Port(device) => {
                    read_port(samples.get_mut(device)?, &mut reader)?;
                    Some(device)
                }
                InputItem::Failure(device, _) => Some(device),
                _ => None,
            };
            if of == Some(number) {
                self.bytes.extend_from_slice(&rest[..rest.len() - reader.0.len()]);
            }
        }
        let now = now.filter(|now| self.ticks.is_empty() || *now > self.end)?;
        self.end = now;
        if self.bytes.len() > begin {
            self.ticks.push((now, self.bytes.len()));
        }
        Some(())
    }
}

impl Stepped for Player {
    fn next(&self) -> Option<i64> {
        let next = self.ticks.get(self.next).map_or(self.end, |(time, _)| *time);
        Some(next).filter(|_| !self.is_over)
    }

    fn end(&self) -> Option<i64> {
        Some(self.end)
    }

    fn exchange(&mut self, now: i64, _: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        self.is_over |= now >= self.end;
        while let Some((_, end)) = self.ticks.get(self.next).filter(|(time, _)| *time <= now) {
            let mut reader = ByteReader(&self.bytes[self.at..*end]);
            (self.next, self.at) = (self.next + 1, *end);
            while !reader.0.is_empty() {
                match InputItem::read(&mut reader) {
                    Some(InputItem::Failure(_, why)) => return Err(why.into()),
                    Some(InputItem::Port(_)) if read_port(samples, &mut reader).is_some() => {}
                    _ => unreachable!("the items were read before"),
                }
            }
        }
        Ok(())
    }
}
