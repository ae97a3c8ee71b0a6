//! Files in a zip archive, as far as recordings need them: stored or deflated, without a password.
//!
//! `rawzip` walks the directory in place, so a directory of a million files takes no memory. A file is unpacked piece
//! by piece: memory grows with the bytes that come out, never with the size that a header promises.

use std::io::Read;

use flate2::read::DeflateDecoder;
use rawzip::{CompressionMethod, ZipArchive, ZipFileHeaderRecord, ZipSliceArchive};

use super::refusal::Refusal;

/// Maximum size of an unpacked file [bytes].
pub(crate) const MAX_UNPACKED_BYTES: u64 = 512 << 20;

/// First bytes of a zip archive.
pub(crate) const MAGIC: &[u8] = b"PK\x03\x04";

/// First bytes of a zip archive without a file.
pub(crate) const EMPTY: &[u8] = b"PK\x05\x06";

/// A zip archive in memory.
pub(crate) struct Archive<'z>(ZipSliceArchive<&'z [u8]>);

/// One file of an archive, as the directory describes it.
pub(crate) type ZipFile<'a> = ZipFileHeaderRecord<'a>;

impl<'z> Archive<'z> {
    /// Finds the directory at the end of the archive.
    ///
    /// # Errors
    /// If there is none.
    pub(crate) fn new(bytes: &'z [u8]) -> Result<Self, Refusal> {
        let archive = ZipArchive::from_slice(bytes);
        archive.map(Self).map_err(|_| damaged("it has no directory: its end may be missing"))
    }

    /// Returns the files in the order of the directory.
    pub(crate) fn files(&self) -> impl Iterator<Item = Result<ZipFile<'_>, Refusal>> {
        self.0.entries().map(|file| file.map_err(|_| damaged("its directory cannot be read")))
    }

    /// Returns a reader of the unpacked file, which checks size and checksum.
    ///
    /// # Errors
    /// If the file has a password, is packed in another way, or is not in the archive.
    pub(crate) fn open(&self, file: &ZipFile<'_>) -> Result<Box<dyn Read + '_>, Refusal> {
        let name = name(file);
        if file.flags().is_encrypted() {
            return Err(Refusal::broken(format!("`{name}` in the archive is protected by a password")));
        }
        let entry = self.0.get_entry(file.wayfinder());
        let entry = entry.map_err(|_| damaged(&format!("`{name}` is not where its directory says")))?;
        match file.compression_method() {
            CompressionMethod::STORE => Ok(Box::new(entry.verifying_reader(entry.data()))),
            CompressionMethod::DEFLATE => Ok(Box::new(entry.verifying_reader(DeflateDecoder::new(entry.data())))),
            other => {
                let method = other.as_u16();
                let message =
                    format!("`{name}` in the archive has compression method {method}, but only `deflate` is supported");
                Err(Refusal::broken(message))
            }
        }
    }
}

/// Returns the path of a file in its archive.
pub(crate) fn name(file: &ZipFile<'_>) -> String {
    String::from_utf8_lossy(file.file_path().as_bytes()).into_owned()
}

/// Whether a user has put the file there: not a folder, and not a file that an operating system adds.
pub(crate) fn is_of_user(file: &ZipFile<'_>) -> bool {
    let path = file.file_path().as_bytes();
    let last = path.rsplit(|byte| *byte == b'/').next().unwrap_or(b"");
    !(last.is_empty() || last.starts_with(b".") || path.starts_with(b"__MACOSX/") || last == b"Thumbs.db")
}

/// Returns the name of the first file from the first bytes of an archive, or `None` if they are not those of one.
pub(crate) fn first_name(head: &[u8]) -> Option<&[u8]> {
    let header = head.strip_prefix(MAGIC)?;
    let length = u16::from_le_bytes([*header.get(22)?, *header.get(23)?]);
    head.get(30..30 + usize::from(length))
}

/// Appends up to `limit` bytes of an unpacked file to `out`, and returns whether the file ends there.
///
/// # Errors
/// If the file is damaged.
pub(crate) fn read(source: &mut dyn Read, name: &str, limit: u64, out: &mut Vec<u8>) -> Result<bool, Refusal> {
    let count = source.take(limit).read_to_end(out).map_err(|error| {
        let error = error.to_string().to_lowercase();
        damaged(&format!("`{name}` cannot be unpacked: {error}"))
    })?;
    Ok((count as u64) < limit)
}

fn damaged(why: &str) -> Refusal {
    Refusal::broken(format!("the archive is damaged: {why}"))
}
