//! Reads a recording from its start, record by record. A file that was cut is read up to the cut.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufReader, Cursor, Read};
use std::path::{Path, PathBuf};

use mcap::records::{Channel, Record, op};

use super::about::{Contents, RunAbout};
use super::channels::{INPUTS, INPUTS_ENCODING, KIND_KEY, MISSING, PORT_KEY, UNITS_KEY};
use super::writer::{ABOUT, END, MODES_KEY, NEXT, NEXT_FILE};

/// The first bytes of a file.
const MAGIC: &[u8; 8] = b"\x89MCAP0\r\n";
/// Size of the buffer [bytes].
const BUFFER_BYTES: usize = 1 << 20;

/// The records of a file, in their order, and those of its chunks. The library parses them; it is not given a file, since
/// its reader trusts the lengths in it.
pub(super) struct Records {
    path: PathBuf,
    file: Box<dyn Read + Send>,
    has_begun: bool,
    record: Vec<u8>,
    chunk: Chunk,
    /// Whether the file has ended as a whole file does.
    is_complete: bool,
    /// Whether the file has ended in another place.
    is_cut: bool,
}

impl Records {
    /// Opens a file.
    ///
    /// # Errors
    /// If it cannot be opened.
    pub(super) fn open(path: &Path) -> Result<Self, String> {
        let file = File::open(path).map_err(|error| format!("cannot open `{}`: {error}", path.display()))?;
        Ok(Self::of(path, Box::new(BufReader::with_capacity(BUFFER_BYTES, file))))
    }

    fn of(path: &Path, file: Box<dyn Read + Send>) -> Self {
        let (path, chunk, record) = (path.to_owned(), Chunk::default(), Vec::new());
        Self { path, file, has_begun: false, record, chunk, is_complete: false, is_cut: false }
    }

    /// Passes the next record of the data to `take`, and returns what it makes of it. `None` at the end of the data or at
    /// the place where the file was cut.
    ///
    /// # Errors
    /// If the file is no MCAP file, or is damaged.
    pub(super) fn next<T>(&mut self, take: impl FnOnce(Record<'_>) -> T) -> Result<Option<T>, String> {
        loop {
            if let Some(record) = self.chunk.next_record() {
                return match record.and_then(|(opcode, data)| parsed(opcode, data)) {
                    Ok(record) => Ok(Some(take(record))),
                    Err(why) => Err(damaged(&self.path, &why)),
                };
            }
            if self.is_complete || self.is_cut {
                return Ok(None);
            }
            match self.read()? {
                None => self.is_cut = true,
                Some(op::DATA_END) => self.is_complete = true,
                Some(op::CHUNK) => {
                    self.chunk.refill(&self.record, false).map_err(|why| damaged(&self.path, &why))?;
                }
                Some(opcode) => {
                    return match parsed(opcode, &self.record) {
                        Ok(record) => Ok(Some(take(record))),
                        Err(why) => Err(damaged(&self.path, &why)),
                    };
                }
            }
        }
    }

    /// Reads the next record, and returns its sort; `None` where the file was cut. What is there of a chunk is kept.
    fn read(&mut self) -> Result<Option<u8>, String> {
        if !self.has_begun {
            self.has_begun = true;
            if self.take(MAGIC.len() as u64)? && self.record != MAGIC {
                return Err(format!("`{}` is no MCAP file", self.path.display()));
            }
        }
        if !self.take(1 + size_of::<u64>() as u64)? {
            return Ok(None);
        }
        let Some((opcode, length)) = self.record.split_first() else { return Ok(None) };
        let opcode = *opcode;
        let length = length.try_into().map_or(0, u64::from_le_bytes);
        let is_whole = self.take(length)?;
        if !is_whole && opcode == op::CHUNK {
            // One that was cut within its header has no record.
            let _ = self.chunk.refill(&self.record, true);
        }
        Ok(Some(opcode).filter(|_| is_whole))
    }

    /// Reads so many bytes. Returns whether the file has them. It takes no more memory than the file has bytes.
    fn take(&mut self, bytes: u64) -> Result<bool, String> {
        self.record.clear();
        let read = self.file.by_ref().take(bytes).read_to_end(&mut self.record);
        let read = read.map_err(|error| format!("cannot read `{}`: {error}", self.path.display()))?;
        Ok(read as u64 == bytes)
    }

    /// Whether the end of the data was found.
    pub(super) const fn is_complete(&self) -> bool {
        self.is_complete
    }
}

/// The records of a chunk.
#[derive(Default)]
struct Chunk {
    data: Vec<u8>,
    /// Where the next record begins.
    at: usize,
    /// Whether the file was cut in it.
    is_cut: bool,
}

impl Chunk {
    /// Takes the next chunk, which must not be compressed, or what is there of it.
    fn refill(&mut self, record: &[u8], is_cut: bool) -> Result<(), String> {
        (self.at, self.is_cut) = (0, is_cut);
        self.data.clear();
        let (crc, compression, data) = split(record).ok_or("a chunk ends within its header")?;
        if !compression.is_empty() {
            return Err(format!("its compression `{}` is unknown", String::from_utf8_lossy(compression)));
        }
        if !is_cut && crc != 0 && crc32fast::hash(data) != crc {
            return Err("the checksum of a chunk is wrong".to_owned());
        }
        self.data.extend_from_slice(data);
        Ok(())
    }

    /// Returns the next record with its sort, or `None` after the last one.
    fn next_record(&mut self) -> Option<Result<(u8, &[u8]), String>> {
        let (opcode, rest) = self.data.get(self.at..)?.split_first()?;
        let length = rest.split_first_chunk().map(|(length, rest)| (u64::from_le_bytes(*length), rest));
        let Some((length, rest)) = length.filter(|(length, rest)| *length <= rest.len() as u64) else {
            let outside = Err("a record ends outside of its chunk".to_owned());
            return Some(outside).filter(|_| !self.is_cut);
        };
        self.at += 1 + size_of::<u64>() + length as usize;
        Some(Ok((*opcode, &rest[..length as usize])))
    }
}

/// Splits a chunk into its checksum, the name of its compression, and its data.
fn split(record: &[u8]) -> Option<(u32, &[u8], &[u8])> {
    // The times of its first and its last message, and its size without compression.
    let rest = record.get(3 * size_of::<u64>()..)?;
    let (crc, rest) = rest.split_first_chunk()?;
    let (length, rest) = rest.split_first_chunk()?;
    let (compression, rest) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
    let (size, rest) = rest.split_first_chunk()?;
    let size = usize::try_from(u64::from_le_bytes(*size)).ok()?.min(rest.len());
    Some((u32::from_le_bytes(*crc), compression, &rest[..size]))
}

/// A field of a record.
#[derive(Debug, Clone, Copy)]
enum Field {
    /// A number of so many bytes.
    Number(usize),
    /// A text behind its length.
    Text,
    /// Pairs of texts behind the length of all of them.
    Map,
    /// Bytes behind their length, a number of 64 bits.
    Data,
}

/// Whether every field of a record is within it. The library takes memory for a text before it reads it, whatever its
/// length.
fn is_within(opcode: u8, mut data: &[u8]) -> bool {
    use Field::{Data, Map, Number, Text};
    let fields: &[Field] = match opcode {
        op::HEADER => &[Text, Text],
        op::SCHEMA => &[Number(2), Text, Text],
        op::CHANNEL => &[Number(2), Number(2), Text, Text, Map],
        op::ATTACHMENT => &[Number(8), Number(8), Text, Text, Data, Number(4)],
        op::METADATA => &[Text, Map],
        // Before the end of the data there is no index, and no chunk is in a chunk.
        op::CHUNK | op::CHUNK_INDEX | op::ATTACHMENT_INDEX | op::METADATA_INDEX => return false,
        _ => &[],
    };
    fields.iter().all(|field| {
        cut(&mut data, *field).is_some_and(|content| match field {
            Map => {
                let mut pairs = content;
                while !pairs.is_empty() {
                    if cut(&mut pairs, Text).is_none() {
                        return false;
                    }
                }
                true
            }
            Number(_) | Text | Data => true,
        })
    })
}

/// Cuts a field off the front, and returns its content, or `None` if it ends outside.
fn cut<'d>(data: &mut &'d [u8], field: Field) -> Option<&'d [u8]> {
    let (length, rest) = match field {
        Field::Number(bytes) => (bytes, *data),
        Field::Text | Field::Map => {
            let (length, rest) = data.split_first_chunk()?;
            (usize::try_from(u32::from_le_bytes(*length)).ok()?, rest)
        }
        Field::Data => {
            let (length, rest) = data.split_first_chunk()?;
            (usize::try_from(u64::from_le_bytes(*length)).ok()?, rest)
        }
    };
    let (content, rest) = rest.split_at_checked(length)?;
    *data = rest;
    Some(content)
}

fn parsed(opcode: u8, data: &[u8]) -> Result<Record<'_>, String> {
    if !is_within(opcode, data) {
        return Err("a record is in the wrong place, or a text in it ends outside of it".to_owned());
    }
    mcap::parse_record(opcode, data).map_err(|error| error.to_string())
}

fn damaged(path: &Path, why: &dyn std::fmt::Display) -> String {
    format!("`{}` is damaged: {why}", path.display())
}

/// A channel of a recording.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct RecordedChannel {
    /// Its topic.
    pub topic: String,
    /// Name of its port, if it is that of a port.
    pub port: Option<String>,
    /// Name of the kind of its port.
    pub kind: String,
    /// Name and unit of each scalar of its port, in the order of its columns; an image has one without a name.
    pub units: Vec<(String, String)>,
}

impl RecordedChannel {
    fn of(channel: Channel) -> Self {
        let Channel { topic, mut metadata, .. } = channel;
        let units = metadata.get(UNITS_KEY).and_then(|units| serde_json::from_str(units).ok()).unwrap_or_default();
        let kind = metadata.remove(KIND_KEY).unwrap_or_default();
        Self { topic, port: metadata.remove(PORT_KEY), kind, units }
    }

    /// Whether it is that of an image or a mask.
    #[must_use]
    pub fn is_image(&self) -> bool {
        matches!(self.kind.as_str(), "image" | "vector_image" | "mask")
    }

    /// Returns the name of its port, or its topic.
    #[must_use]
    pub fn name(&self) -> &str {
        self.port.as_deref().unwrap_or(&self.topic)
    }
}

/// A tick of a recording.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct RecordedTick {
    /// Its number, as far as 32 bits hold it.
    pub number: u32,
    /// Its time in the file [ns].
    pub time: u64,
    /// Its inputs.
    pub inputs: Vec<u8>,
    /// Whether its ports are missing.
    pub is_missing: bool,
    /// The other messages: the number of the channel, the time of the sample in the file [ns], and the JSON.
    pub messages: Vec<(u16, u64, Vec<u8>)>,
}

/// A recording that is being read.
pub struct Recording {
    path: PathBuf,
    records: Records,
    contents: Contents,
    channels: BTreeMap<u16, RecordedChannel>,
    /// The tick whose messages are read.
    tick: Option<RecordedTick>,
    /// The metadata of the file, by its name.
    metadata: BTreeMap<String, BTreeMap<String, String>>,
}

impl Recording {
    /// Opens a recording, and reads everything before its first tick.
    ///
    /// # Errors
    /// If it cannot be read, or was cut before the first tick.
    pub fn open(path: &Path) -> Result<Self, String> {
        Self::begin(path, Records::open(path)?)
    }

    /// Opens a recording that is in memory. One that goes on in another file is refused at its end.
    ///
    /// # Errors
    /// If it cannot be read, or was cut before the first tick.
    pub fn of_bytes(bytes: Vec<u8>) -> Result<Self, String> {
        let path = Path::new("the recording");
        Self::begin(path, Records::of(path, Box::new(Cursor::new(bytes))))
    }

    fn begin(path: &Path, records: Records) -> Result<Self, String> {
        let (contents, channels, metadata) = (Contents::default(), BTreeMap::new(), BTreeMap::new());
        let mut recording = Self { path: path.to_owned(), records, contents, channels, tick: None, metadata };
        recording.read()?;
        if recording.contents.about == RunAbout::default() {
            return Err(format!("`{}` is no recording of tactflow, or was cut at its start", path.display()));
        }
        if recording.tick.is_none() && !recording.records.is_complete() {
            let name = path.display();
            return Err(format!(
                "`{name}` was cut before its first tick: it has files of the graph, but nothing of the run"
            ));
        }
        Ok(recording)
    }

    /// Reads up to the next message of inputs. Returns the tick before it.
    fn read(&mut self) -> Result<Option<RecordedTick>, String> {
        loop {
            let Self { records, contents, channels, tick, metadata, .. } = self;
            let read = records.next(|record| take(record, contents, channels, tick, metadata))?;
            match read {
                None if self.records.is_complete() && self.metadata.contains_key(NEXT) => self.open_next()?,
                None => return Ok(self.tick.take()),
                Some(Err(message)) => return Err(format!("`{}`: {message}", self.path.display())),
                Some(Ok(None)) => {}
                Some(Ok(Some(next))) => {
                    let last = self.tick.replace(next);
                    return Ok(last);
                }
            }
        }
    }

    /// Goes on with the file that the last one names.
    fn open_next(&mut self) -> Result<(), String> {
        let next = self.metadata.remove(NEXT).unwrap_or_default();
        let path = self.path.with_file_name(next.get(NEXT_FILE).map_or("", String::as_str));
        self.records = Records::open(&path).map_err(|why| format!("the recording goes on in another file: {why}"))?;
        Ok(())
    }

    /// Returns the next tick with all its messages, or `None` after the last one.
    ///
    /// # Errors
    /// If the file is damaged.
    pub fn next_tick(&mut self) -> Result<Option<RecordedTick>, String> {
        self.read()
    }

    /// Which graph ran, and with which options.
    #[must_use]
    pub const fn about(&self) -> &RunAbout {
        &self.contents.about
    }

    pub(super) const fn contents(&self) -> &Contents {
        &self.contents
    }

    /// Returns the channels by their numbers.
    #[must_use]
    pub const fn channels(&self) -> &BTreeMap<u16, RecordedChannel> {
        &self.channels
    }

    /// Whether the file ends as a whole file does. Known after the last tick.
    #[must_use]
    pub const fn is_complete(&self) -> bool {
        self.records.is_complete()
    }

    /// Returns why the run ended. Known after the last tick; `None` if the file was cut.
    #[must_use]
    pub fn reason(&self) -> Option<&str> {
        self.metadata.get(END)?.get("reason").map(String::as_str)
    }

    /// Returns the names of the modes of each task that has modes, in the order of its file.
    #[must_use]
    pub fn modes(&self) -> Vec<(String, Vec<String>)> {
        let modes = self.metadata.get(ABOUT).and_then(|about| about.get(MODES_KEY));
        modes.and_then(|modes| serde_json::from_str(modes).ok()).unwrap_or_default()
    }

    /// Returns the path of the file.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Takes a record. Returns the tick that it begins, if it does.
fn take(
    record: Record<'_>,
    contents: &mut Contents,
    channels: &mut BTreeMap<u16, RecordedChannel>,
    tick: &mut Option<RecordedTick>,
    metadata: &mut BTreeMap<String, BTreeMap<String, String>>,
) -> Result<Option<RecordedTick>, String> {
    match record {
        Record::Attachment { header, data, .. } => contents.add(&header.name, data.into_owned())?,
        Record::Channel(channel) => {
            if channel.topic == INPUTS && channel.message_encoding != INPUTS_ENCODING {
                let encoding = channel.message_encoding;
                return Err(format!("it has inputs of another version of tactflow, encoded as `{encoding}`"));
            }
            channels.insert(channel.id, RecordedChannel::of(channel));
        }
        Record::Metadata(read) => drop(metadata.insert(read.name, read.metadata)),
        Record::Message { header, data } => {
            let topic = channels.get(&header.channel_id).map_or("", |channel| &channel.topic);
            match (topic, tick) {
                (INPUTS, _) => {
                    let (number, time, inputs) = (header.sequence, header.log_time, data.into_owned());
                    return Ok(Some(RecordedTick { number, time, inputs, ..RecordedTick::default() }));
                }
                (MISSING, Some(tick)) => tick.is_missing = true,
                (_, Some(tick)) => tick.messages.push((header.channel_id, header.publish_time, data.into_owned())),
                (_, None) => {}
            }
        }
        _ => {}
    }
    Ok(None)
}
