//! Records rows to a file. The tick writes them to a ring buffer, and a second thread formats and writes them.

use std::io::{self, ErrorKind};
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use rtrb::{Consumer, Producer, RingBuffer};

use super::output::{OutputFile, Writing, not_read};
use super::{PortColumn, PortColumns, RowFormat};
use crate::engine::{Beginning, Engine, TaskRun};
use crate::signal::Unit;

/// Capacity of the ring buffer [rows].
const RING_ROWS: usize = 4096;
/// Interval at which one side of the ring checks for work or for space.
const POLL_INTERVAL: Duration = Duration::from_millis(1);
/// Time for which a row may stay in memory; `kill -9` loses the rows of this time.
const FLUSH_INTERVAL: Duration = Duration::from_millis(250);
/// Size of the text that is written at once [bytes].
const CHUNK_BYTES: usize = 1 << 16;

/// Records every scalar of a graph, one row per tick.
pub struct Recorder {
    columns: PortColumns,
    row: Vec<f64>,
    /// Number of columns for the time, and of those for the tasks.
    own: [usize; 2],
    ring: Producer<f64>,
    writing: Writing<io::Result<()>>,
    /// Number of rows that were recorded, whether they are written or not.
    recorded: u64,
    /// Number of rows in the file.
    written: Arc<AtomicU64>,
}

/// What became of a recording.
#[derive(Debug)]
pub struct Recorded {
    /// Number of rows in the file.
    pub rows: u64,
    /// Number of rows that are not in the file.
    pub lost: u64,
    /// The error that ended the recording.
    pub error: Option<io::Error>,
}

impl Recorder {
    /// Creates the file and starts the writing thread.
    ///
    /// # Errors
    /// If the file cannot be created.
    pub fn create(path: &Path, format: RowFormat, engine: &Engine) -> io::Result<Self> {
        Self::start(OutputFile::create(path)?, format, engine, &[])
    }

    /// Starts the thread that writes to an open file. The file states the version of tactflow, the names of the modes, and
    /// the lines `about` the run.
    ///
    /// # Errors
    /// If the thread cannot be started.
    pub fn start(file: OutputFile, format: RowFormat, engine: &Engine, about: &[String]) -> io::Result<Self> {
        let columns = PortColumns::new(engine.ports());
        let tasks = task_columns(engine);
        let list: Vec<PortColumn> = tasks.iter().chain(&columns.list).cloned().collect();
        let own = [format.times(), tasks.len()];
        let row = vec![0.0; own[0] + list.len()];
        let (ring, drain) = RingBuffer::new(row.len() * RING_ROWS);
        let written = Arc::new(AtomicU64::new(0));
        let rows = written.clone();
        let version = format!("tactflow {}", env!("CARGO_PKG_VERSION"));
        let modes = engine.tasks().iter().map(|task| mode_line(task.name(), task.mode_names()));
        let about: Vec<String> = [version].into_iter().chain(modes.flatten()).chain(about.iter().cloned()).collect();
        let writing = Writing::start(file, move |file| {
            RowWriter { file, format, columns: &list, about: &about, rows: &rows }.run(drain)
        })?;
        Ok(Self { columns, row, own, ring, writing, recorded: 0, written })
    }

    /// Records the last tick. While the ring is full, waits as long as `may_wait` returns true; then the row is lost.
    pub fn record(&mut self, engine: &Engine, may_wait: impl Fn() -> bool) {
        self.recorded += 1;
        let began = engine.began().unwrap_or(Beginning { time: engine.now(), wall: 0, by: 0 });
        let (times, row) = self.row.split_at_mut(self.own[0]);
        for (cell, time) in times.iter_mut().zip([began.time, began.wall]) {
            // The ring holds floats. Storing the bits keeps the time in nanoseconds exact; its value would be rounded.
            *cell = f64::from_bits(time as u64);
        }
        let (tasks, ports) = row.split_at_mut(self.own[1]);
        for (cells, task) in tasks.chunks_exact_mut(2).zip(with_modes(engine)) {
            cells[0] = task.mode_number().map_or(f64::NAN, |mode| mode as f64);
            // The graph itself ends with the run.
            let is_over = task.end().is_some() && !task.name().is_empty();
            cells[1] = f64::from(u8::from(task.is_halted() || is_over));
        }
        self.columns.read(engine.bus(), ports);
        while self.ring.slots() < self.row.len() {
            if self.has_ended() || !may_wait() {
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

    /// Whether an error has ended the recording.
    #[must_use]
    pub fn has_ended(&self) -> bool {
        self.ring.is_abandoned()
    }

    /// Returns the number of rows in the file.
    #[must_use]
    pub fn rows(&self) -> u64 {
        self.written.load(Ordering::Relaxed)
    }

    /// Writes the remaining rows and closes the file. Waits while `goes_on` returns true for the number of bytes that
    /// have been written.
    #[must_use]
    pub fn finish(self, goes_on: impl FnMut(u64) -> bool) -> Recorded {
        drop(self.ring);
        let error = self.writing.finish(goes_on).unwrap_or_else(|| Err(not_read())).err();
        let rows = self.written.load(Ordering::Relaxed);
        Recorded { rows, lost: self.recorded - rows, error }
    }
}

impl Recorded {
    /// Whether the reader of a pipe closed it, as `head` does.
    #[must_use]
    pub fn is_closed_by_reader(&self) -> bool {
        self.error.as_ref().is_some_and(|error| error.kind() == ErrorKind::BrokenPipe)
    }
}

/// Returns the columns of the tasks. A task with modes has two: the number of the next tick's mode, from 0 in
/// the order of the file, and whether its commands are halted,
/// which they also are once it has ended. Those of a part have its name before theirs.
fn task_columns(engine: &Engine) -> Vec<PortColumn> {
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

/// Returns the line with the numbers and the names of the modes of a task, or `None` for a task without modes.
pub(crate) fn mode_line<'m>(task: &str, modes: impl Iterator<Item = &'m str>) -> Option<String> {
    let of = if task.is_empty() { String::new() } else { format!(" of {task}") };
    let modes: String = modes.enumerate().map(|(number, mode)| format!(" {number} {mode}")).collect();
    (!modes.is_empty()).then(|| format!("modes{of}:{modes}"))
}

/// Formats and writes the rows, on a thread of its own.
struct RowWriter<'w> {
    file: &'w mut OutputFile,
    format: RowFormat,
    columns: &'w [PortColumn],
    /// Lines about the run.
    about: &'w [String],
    /// Number of rows in the file.
    rows: &'w AtomicU64,
}

impl RowWriter<'_> {
    /// Writes rows until the other end of the ring is gone.
    fn run(mut self, mut ring: Consumer<f64>) -> io::Result<()> {
        let (mut text, mut row) = (Vec::new(), vec![0.0; self.format.times() + self.columns.len()]);
        self.format.header(self.columns, self.about, &mut text)?;
        let mut has_row = false;
        self.file.write_head(&text)?;
        text.clear();
        let mut flushed = Instant::now();
        loop {
            // Checked before the ring is drained, so rows written before the end are not lost.
            let is_over = ring.is_abandoned();
            while let Ok(chunk) = ring.read_chunk(row.len()) {
                for (cell, value) in row.iter_mut().zip(chunk) {
                    *cell = value;
                }
                match std::mem::replace(&mut has_row, true) {
                    true => self.format.row(self.columns, &row, &mut text)?,
                    false => self.format.first_row(self.columns, &row, &mut text)?,
                }
                if text.len() >= CHUNK_BYTES {
                    self.flush(&mut text)?;
                }
            }
            if is_over && !has_row {
                self.format.end_of_header(&mut text)?;
                return self.file.write_head(&text);
            }
            if is_over || flushed.elapsed() >= FLUSH_INTERVAL {
                self.flush(&mut text)?;
                flushed = Instant::now();
            }
            if is_over {
                return Ok(());
            }
            std::thread::sleep(POLL_INTERVAL);
        }
    }

    /// Writes a text of rows.
    fn flush(&mut self, text: &mut Vec<u8>) -> io::Result<()> {
        let result = self.file.write_lines(text, self.rows);
        text.clear();
        result
    }
}
