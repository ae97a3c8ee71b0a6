//! From the tick to a file: raw rows go into a ring, another thread drains it.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::thread::JoinHandle;
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};

use super::{Column, Columns, Format};
use crate::engine::Engine;
use crate::signal::Unit;

/// Rows that fit in the ring at least.
const ROOM: usize = 4096;
/// How long the other side sleeps when there is nothing to do.
const NAP: Duration = Duration::from_millis(1);

/// Records every scalar of a graph, a row a tick.
pub struct Recorder {
    columns: Columns,
    row: Vec<f64>,
    /// Number of columns that come from no port.
    own: usize,
    ring: Producer<f64>,
    thread: JoinHandle<io::Result<()>>,
    /// Whether a full ring makes the tick wait; with a real clock a row is dropped instead.
    may_wait: bool,
    dropped: u64,
}

impl Recorder {
    /// Creates the file and starts to record. A recorder that may wait loses nothing; one that may not drops rows when
    /// the disk is too slow, and counts them.
    ///
    /// # Errors
    /// If the file cannot be created.
    pub fn create(path: &Path, format: Format, engine: &Engine, may_wait: bool) -> io::Result<Self> {
        let columns = Columns::new(engine.ports());
        let own = own_columns(engine);
        let list: Vec<Column> = own.iter().chain(&columns.list).cloned().collect();
        let mut out = BufWriter::new(File::create(path)?);
        format.header(&list, &mut out)?;
        let width = list.len() + 1;
        let (ring, drain) = RingBuffer::new(width * ROOM);
        let thread = std::thread::spawn(move || write_rows(drain, format, &list, out));
        Ok(Self { row: vec![0.0; width], own: own.len(), columns, ring, thread, may_wait, dropped: 0 })
    }

    /// Records the tick that the engine has just run.
    pub fn record(&mut self, engine: &Engine) {
        // A time in nanoseconds is exact in the bits of a float, if not in its value.
        self.row[0] = f64::from_bits(engine.now() as u64);
        let (own, ports) = self.row[1..].split_at_mut(self.own);
        if let [mode, halted] = own {
            *mode = engine.mode_number().map_or(f64::NAN, |mode| mode as f64);
            *halted = f64::from(u8::from(engine.is_halted()));
        }
        self.columns.read(engine.bus(), ports);
        while self.ring.slots() < self.row.len() {
            if !self.may_wait || self.ring.is_abandoned() {
                self.dropped += 1;
                return;
            }
            std::thread::sleep(NAP);
        }
        let mut chunk = self.ring.write_chunk(self.row.len()).expect("there is room for a row");
        let (first, second) = chunk.as_mut_slices();
        let (head, tail) = self.row.split_at(first.len());
        first.copy_from_slice(head);
        second.copy_from_slice(tail);
        chunk.commit_all();
    }

    /// Writes what is left and closes the file; the number of rows that were dropped.
    ///
    /// # Errors
    /// If anything could not be written.
    pub fn finish(self) -> io::Result<u64> {
        drop(self.ring);
        self.thread.join().map_err(|_| io::Error::other("the recorder's thread panicked"))??;
        Ok(self.dropped)
    }
}

/// Of a graph with modes: which one the next tick is in, counted from 0 in the order of the file, and whether the commands
/// are held.
fn own_columns(engine: &Engine) -> Vec<Column> {
    let names = if engine.mode().is_some() { &["mode", "halted"][..] } else { &[] };
    names.iter().map(|name| Column { name: (*name).to_owned(), unit: Unit::ONE }).collect()
}

fn write_rows(mut ring: Consumer<f64>, format: Format, columns: &[Column], mut out: impl Write) -> io::Result<()> {
    let mut row = vec![0.0; columns.len() + 1];
    loop {
        // Asked before the ring is found empty: what came before the end is still written.
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
        std::thread::sleep(NAP);
    }
}
