//! Recordings in a zip archive or behind gzip: the file inside is unpacked and read as if it stood alone.
//!
//! A file is looked at after its first 64 KiB: if no format knows it, the rest stays packed, and so do most bombs. What
//! is more than 512 MiB when unpacked is refused. An `.npz` is a zip archive too, but one with a format of its own.

use std::io::Read;

use flate2::bufread::MultiGzDecoder;

use super::text::shortened;
use super::zip::{self, LARGEST, Member};
use super::{HEAD, Head, Hints, Refusal, list, npy, recognise};

const GZIP: &[u8] = b"\x1f\x8b\x08";

/// How many members a message lists.
const LISTED: usize = 8;

/// Unpacks the file in an archive, with its name; nothing if the bytes are no archive.
///
/// # Errors
/// When the archive is damaged, or does not hold one recording.
pub(super) fn unpack(bytes: &[u8], name: &str, hints: &Hints) -> Result<Option<(Vec<u8>, String)>, Refusal> {
    if bytes.starts_with(GZIP) {
        let name = name.strip_suffix(".gz").unwrap_or(name).to_owned();
        return gunzip(bytes, &name, hints).map(|unpacked| Some((unpacked, name)));
    }
    if !bytes.starts_with(zip::MAGIC) && !bytes.starts_with(zip::EMPTY) || npy::is_npz(bytes) {
        return Ok(None);
    }
    let member = only_member(bytes)?;
    let name = member.name();
    let mut unpacked = Vec::new();
    let mut source = member.open(bytes).map_err(Refusal::broken)?;
    fill(&mut unpacked, &name, hints, |limit, out| source.read(limit, out))?;
    source.verify(unpacked.len() as u64).map_err(Refusal::broken)?;
    Ok(Some((unpacked, name)))
}

fn only_member(bytes: &[u8]) -> Result<Member<'_>, Refusal> {
    let mut files = Vec::new();
    let mut count = 0;
    for member in zip::members(bytes).map_err(Refusal::broken)? {
        let member = member.map_err(Refusal::broken)?;
        if member.is_file() {
            count += 1;
            if files.len() < LISTED {
                files.push(member);
            }
        }
    }
    if let (1, [member]) = (count, &*files) {
        return Ok(*member);
    }
    let names: Vec<String> = files.iter().map(|member| format!("`{}`", shortened(&member.name()))).collect();
    let more = if count > names.len() { format!(" and {} more", count - names.len()) } else { String::new() };
    let message = match count {
        0 => "the archive holds no file".to_owned(),
        _ => format!("the archive holds {count} files: {}{more}", names.join(", ")),
    };
    Err(Refusal::Broken { message, help: Some("pack the recording alone, or name a file that is not packed".into()) })
}

fn gunzip(bytes: &[u8], name: &str, hints: &Hints) -> Result<Vec<u8>, Refusal> {
    let mut unpacked = Vec::new();
    let mut source = MultiGzDecoder::new(bytes);
    fill(&mut unpacked, name, hints, |limit, out| {
        let before = out.len();
        let read = source.by_ref().take(limit).read_to_end(out);
        read.map_err(|error| format!("the archive is damaged: it cannot be unpacked: {error}"))?;
        Ok(((out.len() - before) as u64) < limit)
    })?;
    Ok(unpacked)
}

/// Unpacks the beginning, and the rest if a format knows that.
fn fill(
    out: &mut Vec<u8>,
    name: &str,
    hints: &Hints,
    mut read: impl FnMut(u64, &mut Vec<u8>) -> Result<bool, String>,
) -> Result<(), Refusal> {
    let is_all = read(HEAD as u64, out).map_err(Refusal::broken)?;
    if [GZIP, zip::MAGIC].iter().any(|magic| out.starts_with(magic)) && !npy::is_npz(out) {
        return Err(Refusal::broken(format!("`{}` is an archive in an archive", shortened(name))));
    }
    let head = Head::new(out, name);
    if hints.format.is_none() && recognise(&head).is_none() {
        let begin = shortened(head.text.trim().lines().next().unwrap_or(""));
        let name = shortened(name);
        let message = format!("`{name}` in the archive is no recording of a known format: it begins with `{begin}`");
        return Err(Refusal::Broken { message, help: Some(format!("formats are {}", list())) });
    }
    if !is_all && !read(LARGEST - HEAD as u64, out).map_err(Refusal::broken)? {
        let message = format!("`{}` is more than {} MiB when unpacked", shortened(name), LARGEST >> 20);
        return Err(Refusal::Broken { message, help: Some("unpack it, and name the file itself".into()) });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::super::testing::{complaints, count_refused, zipped};
    use super::super::{Recording, read};
    use super::*;

    const PLATE: &[u8] =
        b"Frame 0 (0.00 ms)\r\n0.0\t0.4\r\n0.0\t1.1\r\n\r\nFrame 1 (7.94 ms)\r\n0.0\t0.7\r\n0.4\t1.4\r\n\r\n";

    fn gzipped(bytes: &[u8]) -> Vec<u8> {
        let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
        packed.write_all(bytes).unwrap();
        packed.finish().unwrap()
    }

    fn plain() -> Recording {
        read(PLATE, "", &Hints::default()).unwrap()
    }

    #[test]
    fn what_is_packed_reads_as_if_it_were_not() {
        let litter: &[(&str, &[u8])] =
            &[("__MACOSX/._plate", b"x"), ("folder/", b""), ("folder/plate", PLATE), ("folder/.DS_Store", b"y")];
        let hints = Hints { format: Some("footscan".into()), ..Hints::default() };
        for bytes in [zipped(0, &[("plate", PLATE)]), zipped(8, &[("plate", PLATE)]), zipped(8, litter), gzipped(PLATE)]
        {
            assert_eq!(read(&bytes, "plate.zip", &Hints::default()), Ok(plain()));
            assert_eq!(read(&bytes, "plate.zip", &hints), Ok(plain()));
        }
        let commented = [zipped(8, &[("plate", PLATE)]), b"a comment".to_vec()].concat();
        assert_eq!(read(&commented, "", &Hints::default()), Ok(plain()));
    }

    #[test]
    fn what_is_wrong_is_said() {
        let good = zipped(8, &[("plate", PLATE)]);
        let edited = |at: usize, byte: u8| {
            let mut bytes = good.clone();
            bytes[at] = byte;
            bytes
        };
        let directory = good.windows(4).position(|four| four == b"PK\x01\x02").unwrap();
        let many: Vec<(String, Vec<u8>)> = (0..10).map(|i| (format!("{i}.txt"), PLATE.to_vec())).collect();
        let many: Vec<(&str, &[u8])> = many.iter().map(|(name, bytes)| (&**name, &**bytes)).collect();
        let cases = [
            (zipped(8, &many[..2]), "the archive holds 2 files: `0.txt`, `1.txt`"),
            (
                zipped(8, &many),
                "the archive holds 10 files: `0.txt`, `1.txt`, `2.txt`, `3.txt`, `4.txt`, `5.txt`, `6.txt`, `7.txt` and 2 more",
            ),
            (zipped(8, &[]), "the archive holds no file"),
            (zipped(8, &[("folder/", b"")]), "the archive holds no file"),
            (zipped(8, &[("plate.zip", &good)]), "`plate.zip` is an archive in an archive"),
            (
                zipped(8, &[("README", b"hello\nworld")]),
                "`README` in the archive is no recording of a known format: it begins with `hello`",
            ),
            (
                good[..good.len() - 30].to_vec(),
                "the archive is damaged: it has no directory, as if its end were missing",
            ),
            (edited(directory + 8, 1), "`plate` in the archive is protected by a password"),
            (edited(directory + 10, 12), "`plate` in the archive is packed by method 12: only `deflate` is read"),
            (edited(directory + 16, 0), "the archive is damaged: `plate` does not unpack to what was packed"),
            (edited(directory + 24, 3), "the archive is damaged: `plate` does not unpack to what was packed"),
            (edited(directory + 42, 9), "the archive is damaged: `plate` is not where its directory says"),
            (edited(directory, 9), "the archive is damaged: its directory is cut off"),
        ];
        for (bytes, message) in cases {
            assert_eq!(complaints(read(&bytes, "", &Hints::default())), [(0, message.into())]);
        }
        let cut = gzipped(PLATE);
        let got = complaints(read(&cut[..cut.len() - 9], "", &Hints::default()));
        assert!(got[0].1.starts_with("the archive is damaged: it cannot be unpacked"), "{got:?}");
    }

    #[test]
    fn damage_is_refused_or_read_soundly() {
        let good = [zipped(0, &[("plate", PLATE)]), zipped(8, &[("plate", PLATE)]), gzipped(PLATE)];
        let refused = count_refused(&[&good[0], &good[1], &good[2]], "", &Hints::default(), 3000);
        assert!((1000..3000).contains(&refused), "{refused}");
    }
}
