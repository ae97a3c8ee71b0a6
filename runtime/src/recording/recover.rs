//! Writes a whole file with an index from a recording that was cut.

use std::fs::File;
use std::io::BufWriter;
use std::path::Path;

use mcap::records::Record;
use mcap::write::NoSeek;
use mcap::{Attachment, Writer};

use super::reader::Records;
use super::writer::{failed, options};

/// What was recovered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Recovered {
    /// Number of messages.
    pub messages: u64,
    /// Whether the file was whole already.
    pub was_complete: bool,
}

type Out = Writer<NoSeek<BufWriter<File>>>;

/// Copies a recording up to the place where it was cut, and adds the index.
///
/// # Errors
/// If the file cannot be read or written, or is no MCAP file.
pub fn recover(from: &Path, to: &Path) -> Result<Recovered, String> {
    let mut records = Records::open(from)?;
    let cannot = |error: &dyn std::fmt::Display| format!("cannot write `{}`: {error}", to.display());
    // What is no MCAP file is found before the other file is created.
    let mut recovered = Recovered { messages: 0, was_complete: false };
    if records.next(|_| ())?.is_none() {
        return Err(format!("`{}` was cut before its first record", from.display()));
    }
    let file = File::create_new(to).map_err(|error| cannot(&error))?;
    let mut writer = options().create(NoSeek::new(BufWriter::new(file))).map_err(|error| cannot(&error))?;
    let end = loop {
        match records.next(|record| copy(record, &mut writer)) {
            Ok(None) => break Ok(()),
            Ok(Some(copied)) => recovered.messages += copied.map_err(|error| cannot(&failed(error)))?,
            Err(message) => break Err(message),
        }
    };
    writer.finish().map_err(|error| cannot(&error))?;
    // What stands before a damaged place is kept.
    end?;
    recovered.was_complete = records.is_complete();
    Ok(recovered)
}

/// Writes a record. Returns the number of messages that it is.
fn copy(record: Record<'_>, writer: &mut Out) -> Result<u64, mcap::McapError> {
    match record {
        Record::Schema { header, data } => {
            writer.add_schema_with_id(header.id, &header.name, &header.encoding, &data)?;
        }
        Record::Channel(channel) => {
            let (id, schema, topic) = (channel.id, channel.schema_id, &channel.topic);
            writer.add_channel_with_id(id, schema, topic, &channel.message_encoding, &channel.metadata)?;
        }
        Record::Message { header, data } => {
            writer.write_to_known_channel(&header, &data)?;
            return Ok(1);
        }
        Record::Attachment { header, data, .. } => {
            let (log_time, create_time) = (header.log_time, header.create_time);
            let (name, media_type) = (header.name, header.media_type);
            writer.attach(&Attachment { log_time, create_time, name, media_type, data })?;
        }
        Record::Metadata(metadata) => writer.write_metadata(&metadata)?,
        _ => {}
    }
    Ok(0)
}
