//! The channels of a recording: one for the inputs, a few for what happened, and one for each recorded port.

use std::collections::BTreeMap;
use std::fmt::Write;

use super::json::{PortText, put_timestamp, quoted_json, scalar_key};
use super::schema::{Schema, number, present_number};
use super::snapshot::{EVENT, PORT, TASK};
use crate::engine::Engine;
use crate::graph::PlannedPort;
use crate::record::seconds_text;
use crate::signal::{Arenas, ByteReader, Kind, Shape, Stamp};

/// Topic of the inputs of each tick.
pub(crate) const INPUTS: &str = "/tactflow/inputs";
/// Topic of the ticks whose ports are missing, because the writer was too slow.
pub(crate) const MISSING: &str = "/tactflow/missing";
/// Topic of the modes, halts and ends of tasks.
pub(crate) const MODES: &str = "/tactflow/modes";
/// Topic of the ports that became absent and whose schema cannot say so.
pub(crate) const LOST: &str = "/tactflow/lost";
/// Topic of the frames that poses move.
pub(crate) const TRANSFORMS: &str = "/tf";
/// Topic of the events of a run.
pub(crate) const LOG: &str = "/log";
/// Encoding of the inputs. Its number changes with the bytes.
pub(crate) const INPUTS_ENCODING: &str = "tactflow-inputs-1";

/// Key of a channel's metadata with the name of its port.
pub(crate) const PORT_KEY: &str = "port";
/// Key of a channel's metadata with the kind of its port.
pub(crate) const KIND_KEY: &str = "kind";
/// Key of a channel's metadata with the unit of each scalar of its port, as a JSON list of pairs.
pub(crate) const UNITS_KEY: &str = "units";

/// A channel that is not in a file yet.
pub(crate) struct Channel {
    pub(crate) topic: String,
    pub(crate) schema: Option<Schema>,
    pub(crate) encoding: &'static str,
    pub(crate) metadata: BTreeMap<String, String>,
}

impl Channel {
    fn json(topic: &str, schema: Schema) -> Self {
        Self { topic: topic.into(), schema: Some(schema), encoding: "json", metadata: BTreeMap::new() }
    }
}

/// The channels of a graph. Turns snapshots into messages.
pub(crate) struct Channels {
    pub(crate) list: Vec<Channel>,
    /// The channel of each port of the engine.
    ports: Vec<Option<PortChannel>>,
    tasks: Vec<String>,
    /// The names of the modes of each task that has modes, as a JSON list.
    pub(crate) modes: String,
    arenas: Arenas,
    text: String,
}

struct PortChannel {
    channel: usize,
    name: String,
    kind: Kind,
    slot: u32,
    text: PortText,
    /// The frame that the port moves, as JSON, if it is the first pose of that frame in another one.
    moves: Option<String>,
}

/// Index of each channel that is not that of a port.
pub(crate) const MISSING_CHANNEL: usize = 1;
const MODES_CHANNEL: usize = 2;
const LOST_CHANNEL: usize = 3;
const LOG_CHANNEL: usize = 4;
const TRANSFORMS_CHANNEL: usize = 5;

/// A message: its channel, the time of its sample in the graph's clock \[ns\], and its JSON.
pub(crate) struct ChannelMessage<'m> {
    pub(crate) channel: usize,
    pub(crate) stamp: i64,
    pub(crate) data: &'m [u8],
}

impl Channels {
    /// Describes the channels of the ports that `is_recorded` selects.
    pub(crate) fn new(engine: &Engine, is_recorded: impl Fn(&PlannedPort) -> bool) -> Self {
        let with_modes = engine.tasks().iter().filter(|task| task.mode().is_some());
        let modes: Vec<(&str, Vec<&str>)> = with_modes.map(|task| (task.name(), task.mode_names().collect())).collect();
        let mut channels = Self {
            modes: serde_json::to_string(&modes).expect("names are texts"),
            list: own_channels(),
            ports: Vec::new(),
            tasks: engine.tasks().iter().map(|task| task.name().to_owned()).collect(),
            arenas: Arenas::default(),
            text: String::new(),
        };
        for (port, _) in engine.ports() {
            let recorded = is_recorded(port).then(|| channels.add(port));
            channels.ports.push(recorded);
        }
        channels
    }

    fn add(&mut self, port: &PlannedPort) -> PortChannel {
        let kind = port.shape.kind();
        let units: Vec<(String, String)> =
            port.shape.scalars().into_iter().map(|(name, unit)| (name, unit.to_string())).collect();
        let units = if units.is_empty() {
            port.shape.unit().map(|unit| (String::new(), unit.to_string())).into_iter().collect()
        } else {
            units
        };
        let units = serde_json::to_string(&units).expect("every key is a string");
        let metadata = [(PORT_KEY, port.name.clone()), (KIND_KEY, kind.name().to_owned()), (UNITS_KEY, units)];
        let metadata = metadata.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
        let topic = format!("/{}", port.name.replace('.', "/"));
        self.list.push(Channel { topic, schema: Some(schema(port)), encoding: "json", metadata });
        let moves = match (kind, port.frames.as_slice()) {
            (Kind::Pose, [Some(frame), Some(parent)]) if frame != parent => Some(quoted_json(frame)),
            _ => None,
        };
        let is_moved = |frame: &String| self.ports.iter().flatten().any(|port| port.moves.as_ref() == Some(frame));
        PortChannel {
            moves: moves.filter(|frame| !is_moved(frame)),
            channel: self.list.len() - 1,
            name: quoted_json(&port.name),
            kind,
            slot: self.arenas.add(&port.shape),
            text: PortText::new(&port.shape, &port.frames),
        }
    }

    /// Passes the messages of a snapshot to `emit`. `epoch` is the time of the file at time zero of the graph \[ns\].
    /// Returns `None` if the bytes are no snapshot of this graph.
    pub(crate) fn decode<E>(
        &mut self,
        snapshot: &[u8],
        epoch: i64,
        emit: &mut impl FnMut(ChannelMessage<'_>) -> Result<(), E>,
    ) -> Option<Result<(), E>> {
        let mut reader = ByteReader(snapshot);
        let (_, now) = (reader.u64()?, reader.i64()?);
        let mut text = std::mem::take(&mut self.text);
        while !reader.0.is_empty() {
            text.clear();
            let mut moving = None;
            let (channel, stamp) = match reader.u8()? {
                TASK => {
                    write_task(&self.tasks, &mut reader, now, &mut text)?;
                    (MODES_CHANNEL, now)
                }
                EVENT => {
                    write_event(&mut reader, epoch + now, &mut text)?;
                    (LOG_CHANNEL, now)
                }
                PORT => {
                    let port = usize::from(ByteReader(reader.0).u16()?);
                    let written = self.port(&mut reader, [now, epoch], &mut text)?;
                    moving = self.ports.get(port)?.as_ref().filter(|port| port.channel == written.0);
                    written
                }
                _ => return None,
            };
            if let Err(error) = emit(ChannelMessage { channel, stamp, data: text.as_bytes() }) {
                return Some(Err(error));
            }
            if let Some((port, frame)) = moving.and_then(|port| Some((port, port.moves.as_ref()?))) {
                text.clear();
                port.text.write_transform(frame, epoch + now, &mut text);
                let transform = ChannelMessage { channel: TRANSFORMS_CHANNEL, stamp, data: text.as_bytes() };
                if let Err(error) = emit(transform) {
                    return Some(Err(error));
                }
            }
        }
        self.text = text;
        Some(Ok(()))
    }

    /// Writes the message of a port. Returns its channel and its stamp.
    fn port(&mut self, reader: &mut ByteReader<'_>, [now, epoch]: [i64; 2], text: &mut String) -> Option<(usize, i64)> {
        let port = self.ports.get_mut(usize::from(reader.u16()?))?.as_mut()?;
        let (is_present, stamp) = (reader.u8()? != 0, reader.i64()?);
        // A value without a sample has no stamp of its own.
        let stamp = if stamp == Stamp::TIMELESS.nanos { now } else { stamp };
        if is_present {
            self.arenas.read_bytes(port.kind, port.slot, reader)?;
        } else if !PortText::has_null(port.kind) {
            let _ = write!(text, "{{\"t\":{},\"port\":{}}}", seconds_text(now), port.name);
            return Some((LOST_CHANNEL, now));
        }
        port.text.write(&self.arenas, is_present.then_some(port.slot), [now, epoch + now], text);
        Some((port.channel, stamp))
    }
}

/// Writes the mode, the halt and the end of a task.
fn write_task(tasks: &[String], reader: &mut ByteReader<'_>, now: i64, text: &mut String) -> Option<()> {
    let task = quoted_json(tasks.get(usize::from(reader.u16()?))?);
    let (number, mode) = (reader.u16()?, reader.text()?);
    let (mode, number) = match mode {
        "" => ("null".to_owned(), "null".to_owned()),
        mode => (quoted_json(mode), number.to_string()),
    };
    let (is_halted, end) = (reader.u8()? != 0, reader.u8()?);
    let end = ["null", "\"done\"", "\"failed\""].get(usize::from(end))?;
    // Writing to a string cannot fail.
    let _ = write!(text, "{{\"t\":{},\"task\":{task},\"mode\":{mode},\"number\":{number},", seconds_text(now));
    let _ = write!(text, "\"halted\":{is_halted},\"end\":{end}}}");
    Some(())
}

/// Writes an event at a time of the file \[ns\].
fn write_event(reader: &mut ByteReader<'_>, time: i64, text: &mut String) -> Option<()> {
    let (level, message) = (reader.u8()?, quoted_json(reader.text()?));
    text.push('{');
    put_timestamp(text, time);
    let rest = "\"name\":\"tactflow\",\"file\":\"\",\"line\":0";
    let _ = write!(text, ",\"level\":{level},\"message\":{message},{rest}}}");
    Some(())
}

/// The channels before those of the ports.
fn own_channels() -> Vec<Channel> {
    let time = || ("t", present_number("Time of the tick in the graph's clock [s]"));
    let text = |what: &str| serde_json::json!({"type": ["string", "null"], "description": what});
    let tick = ("tick", serde_json::json!({"type": "integer", "description": "Number of the tick"}));
    let halted = serde_json::json!({"type": "boolean", "description": "Whether the commands are held at zero"});
    let modes = [
        time(),
        ("task", text("Name of the task; empty for the graph itself")),
        ("mode", text("Mode of the next tick; null for a task without modes")),
        ("number", number("Number of that mode, from 0 in the order of the file")),
        ("halted", halted),
        ("end", text("`done` or `failed` once the task has ended")),
    ];
    let inputs = BTreeMap::from([("doc".to_owned(), "docs/recording.md: what a replay needs".to_owned())]);
    vec![
        Channel { topic: INPUTS.into(), schema: None, encoding: INPUTS_ENCODING, metadata: inputs },
        Channel::json(
            MISSING,
            Schema::object("tactflow.Missing", "A tick whose ports were not written", &[time(), tick]),
        ),
        Channel::json(MODES, Schema::object("tactflow.Modes", "The mode, the halt and the end of a task", &modes)),
        Channel::json(
            LOST,
            Schema::object("tactflow.Lost", "A port that became absent", &[time(), ("port", text("Its name"))]),
        ),
        Channel::json(LOG, Schema::log()),
        Channel::json(TRANSFORMS, Schema::frame_transform()),
    ]
}

/// Returns the schema of a port. The units stand in the descriptions.
fn schema(port: &PlannedPort) -> Schema {
    let time = ("t", present_number("Time of the tick in the graph's clock [s]"));
    let name = format!("tactflow.{}", port.name);
    let describe = |unit: String| format!("{} of `{}` [{unit}]", port.shape.kind(), port.name);
    match &port.shape {
        Shape::Image(_) | Shape::VectorImage(_) | Shape::Mask(_) => Schema::grid(),
        Shape::Pose(_) => Schema::pose_in_frame(),
        Shape::Flag(_) => {
            let value = serde_json::json!({"type": ["boolean", "null"], "description": "null while it is absent"});
            Schema::object(&name, "A flag", &[time, ("value", value)])
        }
        Shape::Regions(shape) => {
            let regions = format!("Area [tactel] and force [{}] of each region", shape.unit);
            let list = |what: &str| serde_json::json!({"type": ["array", "null"], "description": what});
            let runs = list("Row, first column, column after the last, and region of each run");
            Schema::object(&name, "Connected regions", &[time, ("regions", list(&regions)), ("runs", runs)])
        }
        Shape::Jacobian(_) => {
            let what = "For each joint vx, vy, vz [m/s], wx, wy, wz [rad/s] at 1 rad/s; null while it is absent";
            let columns = serde_json::json!({"type": ["array", "null"], "description": what});
            Schema::object(&name, "A Jacobian", &[time, ("columns", columns)])
        }
        shape => {
            let scalars = shape.scalars();
            let property = |(name, unit): &(String, crate::signal::Unit)| {
                (scalar_key(name).to_owned(), number(&format!("[{unit}]; null while it is absent")))
            };
            let properties: Vec<(String, serde_json::Value)> = scalars.iter().map(property).collect();
            let properties = properties.iter().map(|(name, value)| (name.as_str(), value.clone()));
            let all: Vec<_> = std::iter::once(time).chain(properties).collect();
            let unit = shape.unit().map_or_else(|| "units as described".into(), |unit| unit.to_string());
            Schema::object(&name, &describe(unit), &all)
        }
    }
}
