//! The items of the inputs of a tick, read from their bytes; the log of the inputs documents them.

use super::inputs::{BEGAN, EXCHANGE, FAILURE, LEASE, PORT, REST, STATES, TICK, VALUE, WORD};
use crate::device::{SampleState, Samples};
use crate::signal::ByteReader;

/// Largest time of an input [ns], and largest sequence number: others are damaged, and sums of them would overflow.
const MAX_TIME: u64 = 1 << 60;
const MAX_SEQUENCE: u64 = 1 << 48;

/// Whether a number can be a time [ns].
const fn is_time(nanos: i64) -> bool {
    nanos.unsigned_abs() < MAX_TIME
}

/// An item. Devices are named by their numbers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum InputItem<'b> {
    /// An operator word before the tick.
    Word(&'b str),
    /// The time of the tick, and its lateness if that is a trouble, or 0 \[ns\].
    Tick { now: i64, late: i64 },
    /// How late the tick began in real time \[ns\].
    Began(i64),
    /// A parameter, its value and the value toward which it moves.
    Value(&'b str, [f64; 2]),
    /// Whether the clock device has sampled.
    Exchange(bool),
    /// The commands of a device were set to zero.
    Rest(usize),
    /// A device has failed.
    Failure(usize, &'b str),
    /// A device has lost its lease, and why it refused the commands.
    Lease(usize, Option<&'b str>),
    /// A port of a device was written or lost. [`read_port`] reads the rest.
    Port(usize),
}

impl<'b> InputItem<'b> {
    /// Reads the first item. `None` if it is damaged.
    pub(crate) fn read(reader: &mut ByteReader<'b>) -> Option<Self> {
        Some(match reader.u8()? {
            WORD => Self::Word(reader.text()?),
            TICK => {
                let (_, now, late) = (reader.u64()?, reader.i64()?, reader.i64()?);
                Some(Self::Tick { now, late }).filter(|_| is_time(now) && is_time(late))?
            }
            BEGAN => Self::Began(reader.i64().filter(|by| is_time(*by) && *by >= 0)?),
            VALUE => {
                let value = [reader.u64()?, reader.u64()?].map(f64::from_bits);
                let name = reader.text()?;
                Some(Self::Value(name, value)).filter(|_| value.iter().all(|number| number.is_finite()))?
            }
            EXCHANGE => Self::Exchange(reader.u8()? != 0),
            REST => Self::Rest(reader.u16()?.into()),
            FAILURE => Self::Failure(reader.u16()?.into(), reader.text()?),
            LEASE => {
                let (device, has_refused) = (reader.u16()?.into(), reader.u8()? != 0);
                Self::Lease(device, if has_refused { Some(reader.text()?) } else { None })
            }
            PORT => Self::Port(reader.u16()?.into()),
            _ => return None,
        })
    }
}

/// Reads what a port of a device has written, or that it was lost.
pub(crate) fn read_port(samples: &mut Samples, reader: &mut ByteReader<'_>) -> Option<()> {
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
