//! What a tick has changed, as bytes: the side of a recording that runs between two ticks of the engine.
//!
//! A snapshot starts with u64 number and i64 time \[ns\] of the tick. Items follow, each with a tag: `M` a task whose mode,
//! halt or end has changed (u16 task, u16 number of the mode, text mode, u8 halted, u8 end: 0 none, 1 done, 2 failed), `E` an event (u8 level,
//! text), `P` a port that was written or lost (u16 port, u8 present, i64 stamp \[ns\], the value if it is present). All
//! numbers are little-endian, and a text is its length (u32) and UTF-8.

use std::io::Write;

use crate::engine::{Engine, TaskEnd, TaskRun, ValueChange};
use crate::graph::{PlannedPort, Policy};
use crate::node::PortId;
use crate::signal::{Kind, put_text};

pub(super) const TASK: u8 = b'M';
pub(super) const EVENT: u8 = b'E';
pub(super) const PORT: u8 = b'P';

/// Levels of events, as in `foxglove.Log`.
pub(super) const INFO: u8 = 2;
pub(super) const WARNING: u8 = 3;
pub(super) const ERROR: u8 = 4;

/// Bytes of an item without its texts and its value.
const ITEM_BYTES: usize = 32;
/// Bytes that are kept for the names of modes.
const TEXT_BYTES: usize = 4096;

/// Takes snapshots of an engine, each of what has changed since the last one.
pub(crate) struct Snapshot {
    /// Index of each recorded port in the list of the engine, with its place and its kind.
    ports: Vec<(u16, PortId, Kind)>,
    tasks: Vec<SeenTask>,
    /// Number of changes of parameters in the snapshots so far.
    changes: usize,
    bytes: Vec<u8>,
}

/// The state of a task in the last snapshot.
#[derive(Clone, Copy, PartialEq, Eq, Default)]
struct TaskState {
    mode: Option<usize>,
    is_halted: bool,
    end: u8,
}

struct SeenTask {
    state: Option<TaskState>,
    halts: usize,
    is_last_over: bool,
}

impl Snapshot {
    /// Allocates the snapshots of the ports that `is_recorded` selects.
    pub(crate) fn new(engine: &Engine, is_recorded: impl Fn(&PlannedPort) -> bool) -> Self {
        let ports = || engine.ports().iter().enumerate().filter(|(_, (port, _))| is_recorded(port));
        let room: usize = ports().map(|(_, (port, _))| port.shape.max_bytes() + ITEM_BYTES).sum();
        Self {
            ports: ports().map(|(i, (port, id))| (i as u16, *id, port.shape.kind())).collect(),
            tasks: engine.tasks().iter().map(|_| SeenTask { state: None, halts: 0, is_last_over: true }).collect(),
            changes: 0,
            bytes: Vec::with_capacity(room + TEXT_BYTES),
        }
    }

    /// Returns the number of bytes of the longest snapshot without events.
    pub(crate) fn max_bytes(&self) -> usize {
        self.bytes.capacity()
    }

    /// Returns the number of recorded ports.
    pub(crate) fn ports(&self) -> usize {
        self.ports.len()
    }

    /// Takes a snapshot after a tick. Allocates nothing unless a halt has begun.
    pub(crate) fn take(&mut self, engine: &Engine) -> &[u8] {
        let bytes = &mut self.bytes;
        bytes.clear();
        bytes.extend_from_slice(&engine.ticks().to_le_bytes());
        bytes.extend_from_slice(&engine.now().to_le_bytes());
        for (i, (task, seen)) in engine.tasks().iter().zip(&mut self.tasks).enumerate() {
            seen.add(i, task, bytes);
        }
        for change in engine.value_changes().iter().skip(self.changes) {
            add_change(bytes, engine, change);
        }
        self.changes = engine.value_changes().len();
        let (bus, tick) = (engine.bus(), engine.ticks());
        for (number, id, kind) in &self.ports {
            let mark = bus.mark(*id);
            if !mark.changed_in(tick) {
                continue;
            }
            let mut head = [0; 12];
            head[0] = PORT;
            head[1..3].copy_from_slice(&number.to_le_bytes());
            head[3] = u8::from(mark.is_present());
            head[4..].copy_from_slice(&mark.stamp().nanos.to_le_bytes());
            bytes.extend_from_slice(&head);
            if mark.is_present() {
                bus.arenas.write_bytes(*kind, id.slot, bytes);
            }
        }
        bytes
    }
}

impl SeenTask {
    fn add(&mut self, number: usize, task: &TaskRun, bytes: &mut Vec<u8>) {
        let end = match task.end() {
            None => 0,
            Some(TaskEnd::Done) => 1,
            Some(TaskEnd::Failed(_)) => 2,
        };
        let state = TaskState { mode: task.mode_number(), is_halted: task.is_halted(), end };
        if self.state != Some(state) {
            bytes.push(TASK);
            bytes.extend_from_slice(&(number as u16).to_le_bytes());
            bytes.extend_from_slice(&state.mode.map_or(u16::MAX, |mode| mode as u16).to_le_bytes());
            put_text(bytes, task.mode().unwrap_or(""));
            bytes.extend_from_slice(&[u8::from(state.is_halted), end]);
            if let Some(TaskEnd::Failed(fault)) = task.end() {
                add_event(bytes, ERROR, &format!("{}failed: {fault}", of(task)));
            }
            self.state = Some(state);
        }
        let is_last_over = task.halts().last().is_none_or(|halt| halt.until.is_some());
        for halt in task.halts().iter().skip(self.halts) {
            let what = if halt.policy == Policy::Stop { "stopped" } else { "held" };
            add_event(bytes, WARNING, &format!("{}commands {what}: {}", of(task), halt.fault));
        }
        if is_last_over && !self.is_last_over {
            add_event(bytes, INFO, &format!("{}commands follow the graph again", of(task)));
        }
        (self.halts, self.is_last_over) = (task.halts().len(), is_last_over);
    }
}

/// Returns the name of a task that is a part, for the beginning of an event.
fn of(task: &TaskRun) -> String {
    if task.name().is_empty() { String::new() } else { format!("task `{}`: ", task.name()) }
}

fn add_event(bytes: &mut Vec<u8>, level: u8, text: &str) {
    bytes.extend_from_slice(&[EVENT, level]);
    put_text(bytes, text);
}

/// Adds the event that a parameter begins to change. It is written in place, because a tick must not allocate.
fn add_change(bytes: &mut Vec<u8>, engine: &Engine, change: &ValueChange) {
    let Some(param) = engine.live_values().nth(change.param) else { return };
    bytes.extend_from_slice(&[EVENT, INFO]);
    let start = bytes.len();
    put_text(bytes, "");
    // Writing to a list cannot fail.
    let _ = write!(bytes, "`{}` changes from {} to {}", param.param.name, change.from, change.to);
    let length = (bytes.len() - start - size_of::<u32>()) as u32;
    bytes[start..start + size_of::<u32>()].copy_from_slice(&length.to_le_bytes());
}
