//! Records a run whole. The tick copies its inputs and what it has changed to a ring buffer, and a second thread encodes
//! and writes them.

use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::Ordering;

use rtrb::Producer;

use super::about::Contents;
use super::channels::Channels;
use super::ring::{FRAME_HEAD, INPUTS_FRAME, INPUTS_HEAD, Losses, PORTS_FRAME, push};
use super::snapshot::Snapshot;
use super::writer::{FILE_START, Files, write_files};
use crate::engine::{End, Engine};
use crate::graph::Request;
use crate::record::{OutputFile, Writing, not_read, touched_ring};

/// Time of ticks for which the ring has room [ns].
const RING_TIME: i64 = 2_000_000_000;
/// Smallest and largest ring [bytes].
const RING_BYTES: std::ops::RangeInclusive<usize> = 1 << 20..=1 << 28;
/// Part of the ring that is kept for inputs: ports are lost first [1/ring].
const INPUTS_PART: usize = 4;

/// What a recording is made of.
pub struct RecordRequest<'r> {
    /// The graph that runs.
    pub request: &'r Request,
    /// Whether it runs in real time.
    pub is_real: bool,
    /// Seed of the run of a scenario.
    pub seed: Option<u64>,
    /// The path of the file, beside which others are begun when it is full; `None` for a pipe.
    pub path: Option<&'r Path>,
}

/// Records a run to an MCAP file.
pub struct RunRecorder {
    snapshot: Snapshot,
    ring: Producer<u8>,
    capacity: usize,
    losses: Arc<Losses>,
    /// Time of the wall clock at time zero of the graph, or 0 in virtual time [ns]; `None` before the first tick.
    epoch: Option<i64>,
    /// Number of the last tick whose inputs were passed on.
    last: u64,
    end: Arc<std::sync::OnceLock<String>>,
    writing: Writing<io::Result<u64>>,
}

/// What became of a recording.
#[derive(Debug)]
pub struct RunRecorded {
    /// Number of ticks in the file.
    pub ticks: u64,
    /// Number of ticks whose inputs are lost.
    pub lost: u64,
    /// Number of the first tick whose inputs are lost.
    pub first_lost: Option<u64>,
    /// Number of ticks whose ports are lost.
    pub lost_ports: u64,
    /// The error that ended the recording.
    pub error: Option<io::Error>,
}

impl RunRecorder {
    /// The first bytes of a file.
    pub const FILE_START: &'static [u8] = FILE_START;

    /// Starts the thread that writes to an open file, and lets the engine log its inputs.
    ///
    /// # Errors
    /// If a file of the graph cannot be attached, or the thread cannot be started.
    pub fn start(file: OutputFile, engine: &mut Engine, request: &RecordRequest<'_>) -> Result<Self, String> {
        let contents = Contents::of(engine, request.request, (request.is_real, request.seed))?;
        engine.log_inputs();
        let recorded = engine.recorded_ports().clone();
        let is_recorded = |port: &_| recorded.has(port);
        let snapshot = Snapshot::new(engine, is_recorded);
        let channels = Channels::new(engine, is_recorded);
        let tick = snapshot.max_bytes() + engine.max_input_bytes() + 2 * FRAME_HEAD + INPUTS_HEAD;
        let ticks = (RING_TIME / engine.period().max(1)) as usize;
        let capacity =
            tick.saturating_mul(ticks.max(16)).clamp(*RING_BYTES.start(), (*RING_BYTES.end()).max(16 * tick));
        let (ring, drain) = touched_ring(capacity);
        let (losses, end) = (Arc::<Losses>::default(), Arc::default());
        let (shared, reason) = (Arc::clone(&losses), Arc::clone(&end));
        let files = Files {
            path: request.path.filter(|path| path.is_file()).map(Path::to_owned),
            max_bytes: recorded.max_bytes.unwrap_or(u64::MAX),
            contents,
        };
        let work = move |file: &mut OutputFile| write_files(file, channels, &files, drain, (&shared, &reason));
        let writing = Writing::start(file, work).map_err(|error| format!("cannot record: {error}"))?;
        Ok(Self { snapshot, ring, capacity, losses, epoch: None, last: 0, end, writing })
    }

    /// Records the last tick. While the ring is full, waits as long as `may_wait` returns true; then the tick is lost.
    /// Without a trouble, it neither allocates nor calls the operating system, unless it waits.
    pub fn record(&mut self, engine: &Engine, may_wait: impl Fn() -> bool) {
        self.record_inputs(engine, &may_wait);
        let spare = if may_wait() { 0 } else { self.capacity / INPUTS_PART };
        let snapshot = self.snapshot.take(engine);
        if !push(&mut self.ring, (PORTS_FRAME, &[]), snapshot, (spare, &may_wait)) {
            self.losses.ports.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn record_inputs(&mut self, engine: &Engine, may_wait: &dyn Fn() -> bool) {
        let Some((tick, now, inputs)) = engine.inputs() else { return };
        let epoch = *self.epoch.get_or_insert_with(|| engine.began().map_or(0, |began| began.wall - began.time));
        let mut head = [0; INPUTS_HEAD];
        head[..8].copy_from_slice(&epoch.to_le_bytes());
        head[8..16].copy_from_slice(&tick.to_le_bytes());
        head[16..].copy_from_slice(&now.to_le_bytes());
        self.last = tick;
        if !push(&mut self.ring, (INPUTS_FRAME, &head), inputs, (0, may_wait))
            && self.losses.inputs.fetch_add(1, Ordering::Relaxed) == 0
        {
            self.losses.first.store(tick, Ordering::Relaxed);
        }
    }

    /// Whether an error has ended the recording.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.ring.is_abandoned()
    }

    /// Returns the number of recorded ports.
    #[must_use]
    pub fn ports(&self) -> usize {
        self.snapshot.ports()
    }

    /// Returns the number of ticks so far whose inputs are lost.
    #[must_use]
    pub fn lost(&self) -> u64 {
        self.losses.inputs.load(Ordering::Relaxed)
    }

    /// Notes how the run has ended, and adds the tick that a fault has ended.
    pub fn end(&mut self, engine: &Engine, end: &End) {
        let is_fault = matches!(end, End::Fault(_));
        if is_fault && engine.inputs().is_some_and(|(tick, ..)| tick > self.last) {
            self.record_inputs(engine, &|| true);
        }
        // A run ends once.
        let _ = self.end.set(end.to_string());
        self.losses.has_end.store(true, Ordering::Relaxed);
    }

    /// Writes the rest and closes the file. Waits while `goes_on` returns true for the number of bytes that have been
    /// written.
    #[must_use]
    pub fn finish(self, goes_on: impl FnMut(u64) -> bool) -> RunRecorded {
        drop(self.ring);
        let result = self.writing.finish(goes_on).unwrap_or_else(|| Err(not_read()));
        let lost = self.losses.inputs.load(Ordering::Relaxed);
        let first_lost = Some(self.losses.first.load(Ordering::Relaxed)).filter(|_| lost > 0);
        let lost_ports = self.losses.ports.load(Ordering::Relaxed);
        let (ticks, error) = match result {
            Ok(ticks) => (ticks, None),
            Err(error) => (0, Some(error)),
        };
        RunRecorded { ticks, lost, first_lost, lost_ports, error }
    }
}
