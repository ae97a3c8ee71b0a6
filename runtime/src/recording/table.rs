//! The rows of a recording: one per tick, with the last value of every scalar, as `run --out` writes them.

use std::collections::BTreeMap;
#[cfg(feature = "cli")]
use std::path::Path;

use serde_json::Value;

use super::channels::{LOST, MODES};
use super::json::scalar_key;
use super::reader::{RecordedTick, Recording};
use super::schema::{ORIENTATION, POSITION};
use crate::engine::Engine;
use crate::record::PortColumn;
#[cfg(feature = "cli")]
use crate::record::{RunColumn, RunRows, file_seconds};
use crate::signal::Unit;

/// The columns of a recording, and the values after the last tick that was added.
pub(super) struct Table {
    pub(super) columns: Vec<PortColumn>,
    /// The last value of each column; NaN while it is absent.
    pub(super) row: Vec<f64>,
    /// First column and number of columns of each channel with a port.
    places: BTreeMap<u16, (usize, usize)>,
    /// First column of each task with modes, and its name.
    tasks: Vec<(usize, String)>,
    /// Channels of ports, by name.
    ports: BTreeMap<String, u16>,
    epoch: Option<i64>,
}

impl Table {
    /// Creates the columns of a recording: those of its tasks, then those of its ports.
    pub(super) fn new(recording: &Recording) -> Self {
        let (mut columns, mut places, mut tasks) = (Vec::new(), BTreeMap::new(), Vec::new());
        for (task, _) in recording.modes() {
            tasks.push((columns.len(), task.clone()));
            let prefix = if task.is_empty() { task } else { format!("{task}.") };
            let own = ["mode", "halted"].map(|name| (format!("{prefix}{name}"), String::new(), Unit::ONE));
            columns.extend(own.map(|(name, part, unit)| PortColumn { name, part, unit }));
        }
        let mut ports = BTreeMap::new();
        for (number, channel) in recording.channels() {
            let Some(port) = &channel.port else { continue };
            ports.insert(port.clone(), *number);
            if channel.is_image() {
                continue;
            }
            let has_columns = !matches!(channel.kind.as_str(), "regions" | "jacobian");
            let units = channel.units.iter().filter(|_| has_columns);
            let first = columns.len();
            columns.extend(units.map(|(scalar, unit)| {
                let part = if scalar.is_empty() { String::new() } else { format!(".{scalar}") };
                PortColumn { name: format!("{port}{part}"), part, unit: unit.parse().unwrap_or_default() }
            }));
            places.insert(*number, (first, columns.len() - first));
        }
        let row = vec![f64::NAN; columns.len()];
        Self { columns, row, places, tasks, ports, epoch: None }
    }

    /// Takes over the values of a tick. Returns its time in the graph's clock \[ns\].
    pub(super) fn add(&mut self, recording: &Recording, tick: &RecordedTick) -> i64 {
        let time = tick.time as i64;
        let epoch = *self.epoch.get_or_insert_with(|| Engine::time_of_inputs(&tick.inputs).map_or(0, |now| time - now));
        for (channel, _, data) in &tick.messages {
            let Some(known) = recording.channels().get(channel) else { continue };
            match known.topic.as_str() {
                MODES => self.task(data),
                LOST => self.lose(data),
                _ => {
                    if let Some((first, count)) = self.places.get(channel).filter(|(_, count)| *count > 0) {
                        let cells = &mut self.row[*first..first + count];
                        read(data, &known.kind, known.units.iter().map(|(name, _)| name.as_str()), cells);
                    }
                }
            }
        }
        time - epoch
    }

    fn task(&mut self, data: &[u8]) {
        let Ok(message) = serde_json::from_slice::<Value>(data) else { return };
        let name = message["task"].as_str().unwrap_or_default();
        let Some((first, _)) = self.tasks.iter().find(|(_, task)| task == name) else { return };
        let is_over = !name.is_empty() && !message["end"].is_null();
        self.row[*first] = message["number"].as_f64().unwrap_or(f64::NAN);
        self.row[first + 1] = f64::from(u8::from(message["halted"] == Value::Bool(true) || is_over));
    }

    /// Makes the values of a port absent.
    fn lose(&mut self, data: &[u8]) {
        if let Some(channel) = lost_port(data).and_then(|port| self.ports.get(&port))
            && let Some((first, count)) = self.places.get(channel)
        {
            self.row[*first..first + count].fill(f64::NAN);
        }
    }
}

/// Reads all columns of a recording.
///
/// # Errors
/// If it cannot be read.
#[cfg(feature = "cli")]
pub(crate) fn rows(path: &Path) -> Result<RunRows, String> {
    let mut recording = Recording::open(path)?;
    let mut table = Table::new(&recording);
    let column = |column: &PortColumn| RunColumn {
        name: column.name.clone(),
        unit: column.unit.to_string(),
        values: Vec::new(),
    };
    let mut rows =
        RunRows { times: Vec::new(), columns: table.columns.iter().map(column).collect(), modes: recording.modes() };
    while let Some(tick) = recording.next_tick()? {
        rows.times.push(file_seconds(table.add(&recording, &tick)));
        rows.columns.iter_mut().zip(&table.row).for_each(|(column, value)| column.values.push(*value));
    }
    Ok(rows)
}

/// Returns the port that a message on the topic of lost ports names.
pub(super) fn lost_port(data: &[u8]) -> Option<String> {
    Some(serde_json::from_slice::<Value>(data).ok()?["port"].as_str()?.to_owned())
}

/// Reads the scalars of a message.
fn read<'n>(data: &[u8], kind: &str, names: impl Iterator<Item = &'n str>, cells: &mut [f64]) {
    let message: Value = serde_json::from_slice(data).unwrap_or_default();
    if kind == "pose" {
        let parts = [(POSITION, "x"), (POSITION, "y"), (POSITION, "z")];
        let turns = [(ORIENTATION, "x"), (ORIENTATION, "y"), (ORIENTATION, "z"), (ORIENTATION, "w")];
        for (cell, (part, axis)) in cells.iter_mut().zip(parts.into_iter().chain(turns)) {
            *cell = message["pose"][part][axis].as_f64().unwrap_or(f64::NAN);
        }
        return;
    }
    for (cell, name) in cells.iter_mut().zip(names) {
        *cell = match &message[scalar_key(name)] {
            Value::Bool(flag) => f64::from(u8::from(*flag)),
            value => value.as_f64().unwrap_or(f64::NAN),
        };
    }
}
