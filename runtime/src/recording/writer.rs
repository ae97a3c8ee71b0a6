//! Writes a recording: takes frames from the ring, turns them into messages, and closes a chunk every half second.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Attachment, WriteOptions, Writer};
use rtrb::Consumer;

use super::about::Contents;
use super::channels::{ChannelMessage, Channels, MISSING_CHANNEL};
use super::ring::{INPUTS_FRAME, INPUTS_HEAD, Losses, next_frame};
use crate::record::{OutputFile, seconds_text};
use crate::signal::ByteReader;

/// Time for which a tick may stay in memory; `kill -9` loses the ticks of this time.
const FLUSH_INTERVAL: Duration = Duration::from_millis(500);
/// Interval at which the ring is checked for frames.
const POLL_INTERVAL: Duration = Duration::from_millis(1);
/// Size at which a chunk is closed earlier [bytes].
const CHUNK_BYTES: u64 = 1 << 20;

/// The first bytes of a file.
pub(super) const FILE_START: &[u8] = mcap::MAGIC;

/// Name of the metadata with what the recording is of.
pub(crate) const ABOUT: &str = "tactflow";
/// Key of that metadata with the names of the modes of each task, as a JSON list.
pub(crate) const MODES_KEY: &str = "modes";
/// Name of the metadata with the end of the run.
pub(crate) const END: &str = "tactflow.end";

/// Name of the metadata with the file in which the recording goes on.
pub(crate) const NEXT: &str = "tactflow.next";
/// Key of that metadata with the name of the file.
pub(crate) const NEXT_FILE: &str = "file";

/// Writes to a file.
struct Sink<'f>(&'f mut OutputFile);

impl Write for Sink<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.write(bytes).map(|()| bytes.len()).map_err(|(_, error)| error)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The files of a recording.
pub(super) struct Files {
    /// The path of the first; the others stand beside it. `None` if there is only one.
    pub(super) path: Option<PathBuf>,
    /// Size at which another one is begun.
    pub(super) max_bytes: u64,
    pub(super) contents: Contents,
}

impl Files {
    /// Returns the path of the file with that number: `run.mcap`, `run.1.mcap`, `run.2.mcap`.
    fn path(&self, number: usize) -> Option<PathBuf> {
        let path = self.path.as_ref()?;
        let stem = path.file_stem()?.to_string_lossy();
        Some(path.with_file_name(format!("{stem}.{number}.mcap")))
    }
}

/// Writes frames until the other end of the ring is gone. Returns the number of ticks.
pub(super) fn write_files(
    file: &mut OutputFile,
    mut channels: Channels,
    files: &Files,
    mut ring: Consumer<u8>,
    (losses, reason): (&Losses, &OnceLock<String>),
) -> io::Result<u64> {
    let (mut ticks, mut next) = (0, None::<OutputFile>);
    for number in 1.. {
        let file = next.as_mut().unwrap_or(&mut *file);
        let mut writer = FileWriter::create(file, &mut channels, &files.contents, ticks)?;
        let path = files.path(number);
        let max_bytes = if path.is_some() { files.max_bytes } else { u64::MAX };
        let is_over = writer.run(&mut ring, max_bytes)?;
        ticks = writer.ticks;
        match path.filter(|_| !is_over) {
            None => return writer.finish(losses, reason).map(|()| ticks),
            Some(path) => {
                writer.finish_part(&path)?;
                next = Some(file.beside(&path, FILE_START)?);
            }
        }
    }
    Ok(ticks)
}

/// A recording that is being written.
struct FileWriter<'f> {
    file: Writer<NoSeek<Sink<'f>>>,
    channels: &'f mut Channels,
    /// Number of each channel in the file.
    ids: Vec<u16>,
    tick: Tick,
    /// Number of ticks so far, in all files.
    ticks: u64,
    /// Size of the messages so far, in this file.
    bytes: u64,
}

/// The tick that is being written.
#[derive(Default)]
struct Tick {
    epoch: i64,
    number: u64,
    now: i64,
    /// Whether its ports have not been written yet.
    is_open: bool,
}

impl Tick {
    /// Returns a time of the graph as a time of the file [ns].
    fn time(&self, nanos: i64) -> u64 {
        self.epoch.saturating_add(nanos).max(0) as u64
    }
}

/// Converts an error of the file format.
pub(super) fn failed(error: mcap::McapError) -> io::Error {
    match error {
        mcap::McapError::Io(error) => error,
        other => io::Error::other(other.to_string()),
    }
}

/// Returns the options of all files: no compression, and no seeking, so that what is written is never changed.
pub(super) fn options() -> WriteOptions {
    let library = concat!("tactflow ", env!("CARGO_PKG_VERSION"));
    WriteOptions::new().compression(None).disable_seeking(true).chunk_size(Some(CHUNK_BYTES)).library(library)
}

impl<'f> FileWriter<'f> {
    /// Writes everything before the first tick.
    fn create(
        file: &'f mut OutputFile,
        channels: &'f mut Channels,
        contents: &Contents,
        ticks: u64,
    ) -> io::Result<Self> {
        let mut writer = options().create(NoSeek::new(Sink(file))).map_err(failed)?;
        let about = &contents.about;
        let graph = about.graph.display().to_string();
        let seed = about.seed.map_or_else(String::new, |seed| seed.to_string());
        let facts = [
            ("version", about.tactflow.clone()),
            ("graph", graph),
            ("hash", about.hash.clone()),
            ("seed", seed),
            (MODES_KEY, channels.modes.clone()),
        ];
        write_metadata(&mut writer, ABOUT, facts)?;
        for (name, text) in contents.documents() {
            attach(&mut writer, name, "application/toml", text.as_bytes())?;
        }
        for (path, bytes) in &contents.files {
            attach(&mut writer, &path.display().to_string(), "application/octet-stream", bytes)?;
        }
        let ids = channels.list.iter().map(|channel| {
            let schema = match &channel.schema {
                Some(schema) => writer.add_schema(&schema.name, "jsonschema", schema.text.as_bytes())?,
                None => 0,
            };
            writer.add_channel(schema, &channel.topic, channel.encoding, &channel.metadata)
        });
        let ids = ids.collect::<Result<_, _>>().map_err(failed)?;
        writer.flush().map_err(failed)?;
        Ok(Self { file: writer, channels, ids, tick: Tick::default(), ticks, bytes: 0 })
    }

    /// Writes frames until the other end of the ring is gone, or until the file has that size at the end of a tick. Returns
    /// whether the other end is gone.
    fn run(&mut self, ring: &mut Consumer<u8>, max_bytes: u64) -> io::Result<bool> {
        let (mut frame, mut head, mut flushed) = (Vec::new(), None, Instant::now());
        loop {
            // Checked before the ring is drained, so frames added before the end are not lost.
            let is_over = ring.is_abandoned();
            while next_frame(ring, &mut head, &mut frame) {
                let kind = head.take().map_or(0, |(_, kind)| kind);
                self.frame(kind, &frame)?;
                if self.bytes >= max_bytes && !self.tick.is_open {
                    return Ok(false);
                }
                if flushed.elapsed() >= FLUSH_INTERVAL {
                    break;
                }
            }
            if flushed.elapsed() >= FLUSH_INTERVAL {
                self.file.flush().map_err(failed)?;
                flushed = Instant::now();
                continue;
            }
            if is_over {
                self.close_tick()?;
                return Ok(true);
            }
            std::thread::sleep(POLL_INTERVAL);
        }
    }

    fn frame(&mut self, kind: u8, frame: &[u8]) -> io::Result<()> {
        if kind == INPUTS_FRAME {
            self.close_tick()?;
            let mut reader = ByteReader(frame);
            let head = [reader.i64(), reader.i64(), reader.i64()].map(Option::unwrap_or_default);
            self.tick = Tick { epoch: head[0], number: head[1] as u64, now: head[2], is_open: true };
            self.ticks += 1;
            let now = self.tick.now;
            return self.message(0, now, &frame[INPUTS_HEAD..]);
        }
        // A tick whose inputs are lost has no number in the file, so its ports are left out.
        let number = ByteReader(frame).u64();
        if !self.tick.is_open || number != Some(self.tick.number) {
            return Ok(());
        }
        self.tick.is_open = false;
        let Self { file, channels, ids, tick, bytes, .. } = self;
        let mut emit = |message: ChannelMessage<'_>| {
            *bytes += message.data.len() as u64;
            write_message(file, (ids, tick), &message)
        };
        channels.decode(frame, tick.epoch, &mut emit).expect("the frame is a snapshot of this graph")
    }

    /// Notes that the ports of a tick are missing, if they are.
    fn close_tick(&mut self) -> io::Result<()> {
        if !std::mem::take(&mut self.tick.is_open) {
            return Ok(());
        }
        let (now, number) = (self.tick.now, self.tick.number);
        let text = format!("{{\"t\":{},\"tick\":{number}}}", seconds_text(now));
        self.message(MISSING_CHANNEL, now, text.as_bytes())
    }

    fn message(&mut self, channel: usize, stamp: i64, data: &[u8]) -> io::Result<()> {
        self.bytes += data.len() as u64;
        write_message(&mut self.file, (&self.ids, &self.tick), &ChannelMessage { channel, stamp, data })
    }

    /// Writes where the recording goes on, and the index.
    fn finish_part(mut self, next: &Path) -> io::Result<()> {
        let name = next.file_name().unwrap_or_default().to_string_lossy().into_owned();
        write_metadata(&mut self.file, NEXT, [(NEXT_FILE, name)])?;
        self.file.finish().map(drop).map_err(failed)
    }

    /// Writes how the run ended, and the index.
    fn finish(mut self, losses: &Losses, reason: &OnceLock<String>) -> io::Result<()> {
        if let Some(reason) = reason.get().filter(|_| losses.has_end.load(Ordering::Relaxed)) {
            let (lost, first) = (losses.inputs.load(Ordering::Relaxed), losses.first.load(Ordering::Relaxed));
            let from = if lost > 0 { first.to_string() } else { String::new() };
            let facts = [
                ("reason", reason.clone()),
                ("ticks", self.ticks.to_string()),
                ("replayable", (lost == 0).to_string()),
                ("not_replayable_from_tick", from),
                ("lost_ticks", lost.to_string()),
                ("lost_ports", losses.ports.load(Ordering::Relaxed).to_string()),
            ];
            write_metadata(&mut self.file, END, facts)?;
        }
        self.file.finish().map_err(failed)?;
        Ok(())
    }
}

fn write_message<W: Write + io::Seek>(
    file: &mut Writer<W>,
    (ids, tick): (&[u16], &Tick),
    message: &ChannelMessage<'_>,
) -> io::Result<()> {
    let header = MessageHeader {
        channel_id: ids[message.channel],
        sequence: tick.number as u32,
        log_time: tick.time(tick.now),
        publish_time: tick.time(message.stamp),
    };
    file.write_to_known_channel(&header, message.data).map_err(failed)
}

fn write_metadata<W: Write + io::Seek>(
    file: &mut Writer<W>,
    name: &str,
    facts: impl IntoIterator<Item = (&'static str, String)>,
) -> io::Result<()> {
    let metadata: BTreeMap<String, String> = facts.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
    file.write_metadata(&Metadata { name: name.to_owned(), metadata }).map_err(failed)
}

fn attach<W: Write + io::Seek>(file: &mut Writer<W>, name: &str, media_type: &str, data: &[u8]) -> io::Result<()> {
    let (name, media_type) = (name.to_owned(), media_type.to_owned());
    let attachment = Attachment { log_time: 0, create_time: 0, name, media_type, data: Cow::Borrowed(data) };
    file.attach(&attachment).map_err(failed)
}
