//! Records rows to a file. The tick writes them to a ring buffer, and a second thread formats and writes them.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::thread::JoinHandle;
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};

use super::{PortColumn, PortColumns, RecordFormat};
use crate::engine::{Engine, TaskRun};
use crate::signal::Unit;

/// Capacity of the ring buffer [rows].
const RING_ROWS: usize = 4096;
/// Interval at which one side of the ring checks for work or for space.
const POLL_INTERVAL: Duration = Duration::from_millis(1);

/// Records every scalar of a graph, one row per tick.
pub struct Recorder {
    columns: PortColumns,
    row: Vec<f64>,
    /// Number of columns that belong to no port.
    own: usize,
    ring: Producer<f64>,
    thread: JoinHandle<io::Result<()>>,
    /// Whether the tick waits when the ring is full. Otherwise the row is dropped.
    may_wait: bool,
    dropped: u64,
}

impl Recorder {
    /// Creates the file and starts the writing thread.
    ///
    /// With `may_wait`, a tick waits when the disk is too slow, and no row is lost. Without it, for runs in real time,
    /// the row is dropped and counted.
    ///
    /// # Errors
    /// If the file cannot be created.
    pub fn create(path: &Path, format: RecordFormat, engine: &Engine, may_wait: bool) -> io::Result<Self> {
        let columns = PortColumns::new(engine.ports());
        let own = own_columns(engine);
        let list: Vec<PortColumn> = own.iter().chain(&columns.list).cloned().collect();
        let mut out = BufWriter::new(File::create(path)?);
        format.header(&list, &mut out)?;
        let width = list.len() + 1;
        let (ring, drain) = RingBuffer::new(width * RING_ROWS);
        let thread = std::thread::spawn(move || write_rows(drain, format, &list, out));
        Ok(Self { row: vec![0.0; width], own: own.len(), columns, ring, thread, may_wait, dropped: 0 })
    }

    /// Records the last tick.
    pub fn record(&mut self, engine: &Engine) {
        // The ring holds floats. Storing the bits keeps the time in nanoseconds exact; its value would be rounded.
        self.row[0] = f64::from_bits(engine.now() as u64);
        let (own, ports) = self.row[1..].split_at_mut(self.own);
        for (cells, task) in own.chunks_exact_mut(2).zip(with_modes(engine)) {
            cells[0] = task.mode_number().map_or(f64::NAN, |mode| mode as f64);
            // The graph itself ends with the run.
            let is_over = task.end().is_some() && !task.name().is_empty();
            cells[1] = f64::from(u8::from(task.is_halted() || is_over));
        }
        self.columns.read(engine.bus(), ports);
        while self.ring.slots() < self.row.len() {
            if !self.may_wait || self.ring.is_abandoned() {
                self.dropped += 1;
                return;
            }
            std::thread::sleep(POLL_INTERVAL);
        }
        let mut chunk = self.ring.write_chunk(self.row.len()).expect("the loop above waited for space");
        let (first, second) = chunk.as_mut_slices();
        let (head, tail) = self.row.split_at(first.len());
        first.copy_from_slice(head);
        second.copy_from_slice(tail);
        chunk.commit_all();
    }

    /// Writes the remaining rows, closes the file and returns the number of dropped rows.
    ///
    /// # Errors
    /// If the file could not be written.
    pub fn finish(self) -> io::Result<u64> {
        drop(self.ring);
        self.thread.join().map_err(|_| io::Error::other("the recorder's thread panicked"))??;
        Ok(self.dropped)
    }
}

/// Returns the columns that belong to no port. A task with modes has two: the number of the next tick's mode, from 0 in
/// the order of the file, and whether its commands are halted,
/// which they also are once it has ended. Those of a part have its name before theirs.
fn own_columns(engine: &Engine) -> Vec<PortColumn> {
    let column = |name: String| PortColumn { name, part: String::new(), unit: Unit::ONE };
    let names = |task: &TaskRun| match task.name() {
        "" => ["mode".to_owned(), "halted".to_owned()],
        name => [format!("{name}.mode"), format!("{name}.halted")],
    };
    with_modes(engine).flat_map(names).map(column).collect()
}

/// Returns the tasks that have modes.
fn with_modes(engine: &Engine) -> impl Iterator<Item = &TaskRun> {
    engine.tasks().iter().filter(|task| task.mode().is_some())
}

fn write_rows(
    mut ring: Consumer<f64>,
    format: RecordFormat,
    columns: &[PortColumn],
    mut out: impl Write,
) -> io::Result<()> {
    let mut row = vec![0.0; columns.len() + 1];
    loop {
        // Checked before the ring is drained, so rows written before the end are not lost.
        let is_over = ring.is_abandoned();
        while let Ok(chunk) = ring.read_chunk(row.len()) {
            for (cell, value) in row.iter_mut().zip(chunk) {
                *cell = value;
            }
            format.row(columns, row[0].to_bits() as i64, &row[1..], &mut out)?;
        }
        if is_over {
            return out.flush();
        }
        std::thread::sleep(POLL_INTERVAL);
    }
}
