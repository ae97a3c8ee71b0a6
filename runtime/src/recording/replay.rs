//! Replays a recording: runs its graph, or another one, on its inputs, and compares every recorded port.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::channels::{ChannelMessage, Channels, LOG, LOST, MODES, TRANSFORMS};
use super::compare::{Differences, PortMessage};
use super::reader::{RecordedTick, Recording};
use super::snapshot::Snapshot;
use crate::catalogue::Catalogue;
use crate::engine::Engine;
use crate::fault::Fault;
use crate::graph::{Outline, PlannedPort, RecordedGraph, Request, compile};
use crate::source::Report;

/// What a replay changes.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct ReplayChanges {
    /// Another graph, instead of the recorded one.
    pub graph: Option<PathBuf>,
    /// Another bench for the other graph; its devices are those of the recording.
    pub bench: Option<PathBuf>,
    /// Assignments `key=value` that override values of the graph.
    pub set: Vec<String>,
}

impl ReplayChanges {
    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }
}

/// Why a recording cannot be replayed.
pub enum ReplayError {
    /// The file or the changes are wrong.
    Message(String),
    /// The graph does not load.
    Graph(Report),
}

impl From<String> for ReplayError {
    fn from(message: String) -> Self {
        Self::Message(message)
    }
}

/// A replay of a recording.
pub struct Replay {
    recording: Recording,
    outline: Outline,
    engine: Engine,
    snapshot: Snapshot,
    channels: Channels,
    /// Time of the file at time zero of the graph \[ns\].
    epoch: i64,
    /// The next tick, read ahead.
    next: Option<RecordedTick>,
    /// Ports that only the recording has, if another graph runs.
    missing: BTreeSet<String>,
    ports: usize,
    ticks: u64,
    /// Ticks whose ports the recording lacks.
    uncompared: u64,
    differences: Differences,
}

/// What came of a tick.
pub enum ReplayedTick {
    /// The recording has no more ticks.
    Over,
    /// The tick was run. Whether the ports are those of the recording.
    Ran(bool),
    /// The tick ended the run with a fault.
    Fault(Box<Fault>),
}

impl Replay {
    /// Opens a recording, and loads its graph or another one.
    ///
    /// # Errors
    /// If the recording cannot be read or the graph does not load.
    pub fn open(catalogue: &Catalogue, path: &Path, changes: &ReplayChanges) -> Result<Self, ReplayError> {
        let mut recording = Recording::open(path)?;
        let request = request(&recording, changes)?;
        let compiled = compile(catalogue, &request).map_err(ReplayError::Graph)?;
        let outline = compiled.outline().clone();
        let engine = Engine::new(compiled);
        let expected: Vec<&str> = recording.contents().devices.iter().map(|device| device.name.as_str()).collect();
        let found = engine.recorded_devices();
        if !found.iter().map(|device| device.name.as_str()).eq(expected.iter().copied()) {
            let message =
                "the graph uses the devices of the recording in another order, or not all of them: use the same bench";
            return Err(message.to_owned().into());
        }
        let next = recording.next_tick()?;
        let recorded: BTreeSet<&str> =
            recording.channels().values().filter_map(|channel| channel.port.as_deref()).collect();
        let is_recorded = |port: &PlannedPort| recorded.contains(port.name.as_str());
        let (snapshot, channels) = (Snapshot::new(&engine, is_recorded), Channels::new(&engine, is_recorded));
        let own: BTreeSet<&str> = engine.ports().iter().map(|(port, _)| port.name.as_str()).collect();
        let missing = recorded.difference(&own).map(|port| (*port).to_owned()).collect();
        let ports = snapshot.ports();
        let (epoch, ticks, uncompared, differences) = (0, 0, 0, Differences::default());
        let mut replay = Self {
            recording,
            outline,
            engine,
            snapshot,
            channels,
            epoch,
            next,
            missing,
            ports,
            ticks,
            uncompared,
            differences,
        };
        replay.epoch = replay.epoch_of_file();
        Ok(replay)
    }

    /// Returns the time of the file at time zero of the graph, from the first tick \[ns\].
    fn epoch_of_file(&self) -> i64 {
        let Some(tick) = &self.next else { return 0 };
        Engine::time_of_inputs(&tick.inputs).map_or(0, |now| tick.time as i64 - now)
    }

    /// Runs the next tick and compares its ports.
    ///
    /// # Errors
    /// If the recording is damaged or its inputs are not complete.
    pub fn step(&mut self) -> Result<ReplayedTick, String> {
        let Some(tick) = self.next.take() else { return Ok(ReplayedTick::Over) };
        self.next = self.recording.next_tick()?;
        if tick.number != (self.engine.ticks() + 1) as u32 {
            return Err(format!(
                "`{}` cannot be replayed from tick {} on: its inputs are missing",
                self.recording.path().display(),
                self.engine.ticks() + 1
            ));
        }
        self.ticks += 1;
        let ran = self.engine.replay(&tick.inputs).map_err(|why| format!("tick {}: {why}", tick.number))?;
        if let Err(fault) = ran {
            return Ok(ReplayedTick::Fault(fault.into()));
        }
        // The last tick of a file that was cut may lack some of its ports.
        self.uncompared += u64::from(tick.is_missing);
        if tick.is_missing || (self.next.is_none() && !self.recording.is_complete()) {
            return Ok(ReplayedTick::Ran(true));
        }
        Ok(ReplayedTick::Ran(self.compare(&tick)))
    }

    fn compare(&mut self, tick: &RecordedTick) -> bool {
        let Self { engine, snapshot, channels, epoch, recording, missing, differences, .. } = self;
        let mut own: Vec<(usize, i64, Vec<u8>)> = Vec::new();
        let mut emit = |message: ChannelMessage<'_>| {
            own.push((message.channel, message.stamp, message.data.to_vec()));
            Ok::<(), std::convert::Infallible>(())
        };
        let decoded = channels.decode(snapshot.take(engine), *epoch, &mut emit);
        decoded.expect("the snapshot is one of this graph").expect("a list takes everything");
        let list = &channels.list;
        let own: Vec<PortMessage<'_>> = own
            .iter()
            .map(|(channel, stamp, data)| {
                // The file has no time before its zero.
                let stamp = (*epoch + stamp).max(0) - *epoch;
                PortMessage { port: name_of(&list[*channel].topic, &list[*channel].metadata), stamp, data }
            })
            .collect();
        let recorded = recording.channels();
        let recorded = tick.messages.iter().filter_map(|(channel, stamp, data)| {
            let port = recorded.get(channel)?.name();
            Some(PortMessage { port, stamp: *stamp as i64 - *epoch, data }).filter(|_| !missing.contains(port))
        });
        let recorded: Vec<PortMessage<'_>> = recorded.collect();
        differences.add((engine.ticks(), engine.now()), [&recorded, &own])
    }

    /// Returns the engine after the last tick.
    #[must_use]
    pub const fn engine(&self) -> &Engine {
        &self.engine
    }

    /// Returns the outline of the graph that runs.
    #[must_use]
    pub const fn outline(&self) -> &Outline {
        &self.outline
    }

    /// Returns the recording.
    #[must_use]
    pub const fn recording(&self) -> &Recording {
        &self.recording
    }

    /// Returns the number of ticks that were run.
    #[must_use]
    pub const fn ticks(&self) -> u64 {
        self.ticks
    }

    /// Returns the number of ticks whose ports the recording lacks.
    #[must_use]
    pub const fn uncompared(&self) -> u64 {
        self.uncompared
    }

    /// Returns the number of ports that are compared.
    #[must_use]
    pub const fn ports(&self) -> usize {
        self.ports
    }

    /// Returns the ports that only the recording has.
    pub fn missing(&self) -> impl Iterator<Item = &str> {
        self.missing.iter().map(String::as_str)
    }

    /// Returns the differences so far.
    #[must_use]
    pub const fn differences(&self) -> &Differences {
        &self.differences
    }

    /// Forgets the differences so far.
    pub fn forget(&mut self) {
        self.differences.ports.clear();
    }

    /// Returns the time of the next tick in the graph's clock [ns], or `None` after the last one.
    #[must_use]
    pub fn next_time(&self) -> Option<i64> {
        self.next.as_ref().map(|tick| tick.time as i64 - self.epoch)
    }

    /// Whether the last tick was run.
    #[must_use]
    pub const fn is_over(&self) -> bool {
        self.next.is_none()
    }
}

/// Returns the name of a channel in messages: that of its port, or its topic.
fn name_of<'c>(topic: &'c str, metadata: &'c BTreeMap<String, String>) -> &'c str {
    metadata.get(super::channels::PORT_KEY).map_or(topic, String::as_str)
}

/// Whether a name is that of a channel without a port.
#[must_use]
pub fn is_own_channel(name: &str) -> bool {
    [MODES, LOST, LOG, TRANSFORMS].contains(&name)
}

/// Returns the request of a replay.
fn request(recording: &Recording, changes: &ReplayChanges) -> Result<Request, String> {
    let recorded = recording.contents().request();
    let is_of_device =
        |set: &&String| ["devices.", "bind.", "facts."].iter().any(|section| set.trim_start().starts_with(section));
    if let Some(set) = changes.set.iter().find(is_of_device) {
        return Err(format!("`--set {set}` has no effect: a replay uses the recorded inputs instead of the devices"));
    }
    let Some(graph) = &changes.graph else {
        let set = recorded.set.iter().chain(&changes.set).cloned().collect();
        return Ok(Request { set, ..recorded });
    };
    let devices = recording.contents().devices.clone();
    let own = Some(Arc::new(RecordedGraph { devices, files: None }));
    let (graph, bench, set) = (graph.clone(), changes.bench.clone(), changes.set.clone());
    Ok(Request { graph, bench, set, slow: recorded.slow, recorded: own, ..Request::default() })
}
