//! The members of a zip archive, as far as recordings need it: stored or deflated, in one file, without a password.
//!
//! The directory at the archive's end says where the members are. It is walked in place, so that a directory of a
//! million members costs nothing, and a member is unpacked piece by piece: what its header promises is never
//! allocated, only what has come out.

use std::io::Read;

use flate2::Crc;
use flate2::read::DeflateDecoder;

/// Greatest size of an unpacked file [bytes].
pub(super) const LARGEST: u64 = 512 << 20;

const END: &[u8] = b"PK\x05\x06";
const END_64: &[u8] = b"PK\x06\x06";
const LOCATOR_64: &[u8] = b"PK\x06\x07";
const CENTRAL: &[u8] = b"PK\x01\x02";
const LOCAL: &[u8] = b"PK\x03\x04";

/// How a zip archive begins.
pub(super) const MAGIC: &[u8] = LOCAL;

/// How one without a member begins.
pub(super) const EMPTY: &[u8] = END;

/// One file in the archive.
#[derive(Debug, Clone, Copy)]
pub(super) struct Member<'z> {
    name: &'z [u8],
    flags: u16,
    method: u16,
    crc: u32,
    packed: u64,
    /// Size when unpacked [bytes], as the directory says.
    pub(super) size: u64,
    at: u64,
}

impl<'z> Member<'z> {
    /// Its path in the archive.
    pub(super) fn name(&self) -> String {
        String::from_utf8_lossy(self.name).into_owned()
    }

    /// Whether it is a file that a user has put there: no folder, and nothing that an operating system leaves.
    pub(super) fn is_file(&self) -> bool {
        let last = self.name.rsplit(|byte| *byte == b'/').next().unwrap_or(b"");
        !(last.is_empty() || last.starts_with(b".") || self.name.starts_with(b"__MACOSX/") || last == b"Thumbs.db")
    }

    /// What comes out of it, piece by piece.
    pub(super) fn open(&self, archive: &'z [u8]) -> Result<Unpacked<'z>, String> {
        let name = self.name();
        if self.flags & 1 != 0 {
            return Err(format!("`{name}` in the archive is protected by a password"));
        }
        let header = slice(archive, self.at, 30).filter(|header| header.starts_with(LOCAL));
        let start = header.map(|header| self.at + 30 + u64::from(u16_at(header, 26)) + u64::from(u16_at(header, 28)));
        let Some(packed) = start.and_then(|start| slice(archive, start, self.packed)) else {
            return Err(format!("the archive is damaged: `{name}` is not where its directory says"));
        };
        let source = match self.method {
            0 => Source::Stored(packed),
            8 => Source::Deflated(DeflateDecoder::new(packed)),
            other => {
                return Err(format!("`{name}` in the archive is packed by method {other}: only `deflate` is read"));
            }
        };
        Ok(Unpacked { source, name, size: self.size, crc: self.crc, sum: Crc::new() })
    }
}

enum Source<'z> {
    Stored(&'z [u8]),
    Deflated(DeflateDecoder<&'z [u8]>),
}

/// A member that is being unpacked.
pub(super) struct Unpacked<'z> {
    source: Source<'z>,
    name: String,
    size: u64,
    crc: u32,
    sum: Crc,
}

impl Unpacked<'_> {
    /// Appends up to `limit` bytes more to what has come out so far; whether that was all.
    pub(super) fn read(&mut self, limit: u64, out: &mut Vec<u8>) -> Result<bool, String> {
        let before = out.len();
        let read = match &mut self.source {
            Source::Stored(bytes) => bytes.take(limit).read_to_end(out),
            Source::Deflated(bytes) => bytes.take(limit).read_to_end(out),
        };
        let count =
            read.map_err(|error| format!("the archive is damaged: `{}` cannot be unpacked: {error}", self.name))?;
        self.sum.update(&out[before..]);
        Ok((count as u64) < limit)
    }

    /// Whether what has come out, `size` bytes in all, is what went in.
    pub(super) fn verify(&self, size: u64) -> Result<(), String> {
        if (size, self.sum.sum()) == (self.size, self.crc) {
            return Ok(());
        }
        Err(format!("the archive is damaged: `{}` does not unpack to what was packed", self.name))
    }
}

/// The name of the first member, as it stands at the beginning.
pub(super) fn first_name(head: &[u8]) -> Option<&[u8]> {
    let header = head.get(..30).filter(|header| header.starts_with(LOCAL))?;
    head.get(30..30 + usize::from(u16_at(header, 26)))
}

/// The members, in the order of the directory.
pub(super) fn members(archive: &[u8]) -> Result<Members<'_>, String> {
    let damaged = || "the archive is damaged: it has no directory, as if its end were missing".to_owned();
    // The end record is 22 bytes long, and a comment of up to 65535 comes after it.
    let from = archive.len().saturating_sub(22 + 65535);
    let found = archive[from..].windows(4).rposition(|window| window == END).ok_or_else(damaged)?;
    let end = slice(archive, (from + found) as u64, 22).ok_or_else(damaged)?;
    let (mut count, mut at) = (u64::from(u16_at(end, 10)), u64::from(u32_at(end, 16)));
    if count == 0xffff || at == 0xffff_ffff {
        let locator = (from + found).checked_sub(20).and_then(|at| slice(archive, at as u64, 20));
        if let Some(locator) = locator.filter(|locator| locator.starts_with(LOCATOR_64)) {
            let end =
                slice(archive, u64_at(locator, 8), 56).filter(|end| end.starts_with(END_64)).ok_or_else(damaged)?;
            (count, at) = (u64_at(end, 32), u64_at(end, 48));
        }
    }
    Ok(Members { archive, at, left: count })
}

/// A walk through the directory.
#[derive(Clone)]
pub(super) struct Members<'z> {
    archive: &'z [u8],
    at: u64,
    left: u64,
}

impl<'z> Iterator for Members<'z> {
    type Item = Result<Member<'z>, String>;

    fn next(&mut self) -> Option<Self::Item> {
        self.left = self.left.checked_sub(1)?;
        let member = self.member();
        if member.is_none() {
            self.left = 0;
        }
        Some(member.ok_or_else(|| "the archive is damaged: its directory is cut off".to_owned()))
    }
}

impl<'z> Members<'z> {
    fn member(&mut self) -> Option<Member<'z>> {
        let header = slice(self.archive, self.at, 46).filter(|header| header.starts_with(CENTRAL))?;
        let [name, extra, comment] = [28, 30, 32].map(|at| u64::from(u16_at(header, at)));
        let mut member = Member {
            name: slice(self.archive, self.at + 46, name)?,
            flags: u16_at(header, 8),
            method: u16_at(header, 10),
            crc: u32_at(header, 16),
            packed: u32_at(header, 20).into(),
            size: u32_at(header, 24).into(),
            at: u32_at(header, 42).into(),
        };
        widen(&mut member, slice(self.archive, self.at + 46 + name, extra)?);
        self.at += 46 + name + extra + comment;
        Some(member)
    }
}

/// Takes the numbers that are too large for a plain directory from the extra field number 1.
fn widen(member: &mut Member<'_>, mut extra: &[u8]) {
    while extra.len() >= 4 {
        let (id, size) = (u16_at(extra, 0), usize::from(u16_at(extra, 2)));
        let Some(mut body) = extra.get(4..4 + size) else { return };
        if id == 1 {
            for number in [&mut member.size, &mut member.packed, &mut member.at] {
                if *number == 0xffff_ffff && body.len() >= 8 {
                    *number = u64_at(body, 0);
                    body = &body[8..];
                }
            }
        }
        extra = &extra[4 + size..];
    }
}

fn slice(bytes: &[u8], start: u64, len: u64) -> Option<&[u8]> {
    let (start, end) = (usize::try_from(start).ok()?, usize::try_from(start.checked_add(len)?).ok()?);
    bytes.get(start..end)
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes([bytes[at], bytes[at + 1]])
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from(u16_at(bytes, at)) | u32::from(u16_at(bytes, at + 2)) << 16
}

fn u64_at(bytes: &[u8], at: usize) -> u64 {
    u64::from(u32_at(bytes, at)) | u64::from(u32_at(bytes, at + 4)) << 32
}
