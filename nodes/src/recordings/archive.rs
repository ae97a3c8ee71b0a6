//! Recordings in a zip archive or behind gzip: the file inside is unpacked and read as if it stood alone.
//!
//! The first 64 KiB are unpacked first. If no format recognises them, the rest stays packed, and so do most zip bombs.
//! A file of more than 512 MiB when unpacked is refused. An `.npz` is a zip archive too, but a format of its own.

use std::io::Read;

use flate2::bufread::MultiGzDecoder;

use super::common::text::shortened;
use super::common::zip::{self, Archive, MAX_UNPACKED_BYTES, ZipFile};
use super::common::{FileHead, HEAD_BYTES, Hints, Refusal};
use super::formats::{list, recognise};
use super::npy;

const GZIP: &[u8] = b"\x1f\x8b\x08";

/// Maximum number of files that a message lists.
const MAX_LISTED: usize = 8;

/// Unpacks the file in an archive and returns it with its name, or `None` if the bytes are not an archive.
///
/// # Errors
/// If the archive is damaged, or does not hold exactly one recording.
pub(super) fn unpack(bytes: &[u8], name: &str, hints: &Hints) -> Result<Option<(Vec<u8>, String)>, Refusal> {
    if bytes.starts_with(GZIP) {
        let name = name.strip_suffix(".gz").unwrap_or(name).to_owned();
        let unpacked = unpack_recognised(&mut MultiGzDecoder::new(bytes), &name, hints)?;
        return Ok(Some((unpacked, name)));
    }
    if !bytes.starts_with(zip::MAGIC) && !bytes.starts_with(zip::EMPTY) || npy::is_npz(bytes) {
        return Ok(None);
    }
    let archive = Archive::new(bytes)?;
    let file = only_file(&archive)?;
    let name = zip::name(&file);
    let unpacked = unpack_recognised(&mut *archive.open(&file)?, &name, hints)?;
    Ok(Some((unpacked, name)))
}

fn only_file<'a>(archive: &'a Archive<'_>) -> Result<ZipFile<'a>, Refusal> {
    let mut files = Vec::new();
    let mut count = 0;
    for file in archive.files() {
        let file = file?;
        if zip::is_of_user(&file) {
            count += 1;
            if files.len() < MAX_LISTED {
                files.push(file);
            }
        }
    }
    if count == 1 {
        return Ok(files.swap_remove(0));
    }
    let names: Vec<String> = files.iter().map(|file| format!("`{}`", shortened(&zip::name(file)))).collect();
    let more = if count > names.len() { format!(" and {} more", count - names.len()) } else { String::new() };
    let message = match count {
        0 => "the archive has no file in it".to_owned(),
        _ => format!("the archive has {count} files in it: {}{more}", names.join(", ")),
    };
    Err(Refusal::Broken {
        message,
        help: Some("put only the recording into the archive, or use the unpacked file".into()),
    })
}

/// Unpacks the first bytes, and the rest if a format recognises them.
fn unpack_recognised(source: &mut dyn Read, name: &str, hints: &Hints) -> Result<Vec<u8>, Refusal> {
    let mut out = Vec::new();
    let shown = shortened(name);
    let is_all = zip::read(source, &shown, HEAD_BYTES as u64, &mut out)?;
    if [GZIP, zip::MAGIC].iter().any(|magic| out.starts_with(magic)) && !npy::is_npz(&out) {
        return Err(Refusal::broken(format!("`{shown}` is an archive inside an archive: unpack it first")));
    }
    let head = FileHead::new(&out, name);
    if hints.format.is_none() && recognise(&head).is_none() {
        let first = shortened(head.text.trim().lines().next().unwrap_or(""));
        let message = format!("`{shown}` in the archive has an unknown format: it begins with `{first}`");
        return Err(Refusal::Broken { message, help: Some(list()) });
    }
    if !is_all && !zip::read(source, &shown, MAX_UNPACKED_BYTES - HEAD_BYTES as u64, &mut out)? {
        let message = format!("`{shown}` is more than {} MiB when unpacked", MAX_UNPACKED_BYTES >> 20);
        return Err(Refusal::Broken { message, help: Some("unpack it, and name the unpacked file".into()) });
    }
    Ok(out)
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
    fn a_packed_file_reads_like_the_unpacked_one() {
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
    fn a_message_says_what_is_wrong() {
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
            (zipped(8, &many[..2]), "the archive has 2 files in it: `0.txt`, `1.txt`"),
            (
                zipped(8, &many),
                "the archive has 10 files in it: `0.txt`, `1.txt`, `2.txt`, `3.txt`, `4.txt`, `5.txt`, `6.txt`, `7.txt` and 2 more",
            ),
            (zipped(8, &[]), "the archive has no file in it"),
            (zipped(8, &[("folder/", b"")]), "the archive has no file in it"),
            (zipped(8, &[("plate.zip", &good)]), "`plate.zip` is an archive inside an archive: unpack it first"),
            (
                zipped(8, &[("README", b"hello\nworld")]),
                "`README` in the archive has an unknown format: it begins with `hello`",
            ),
            (good[..good.len() - 30].to_vec(), "the archive is damaged: it has no directory: its end may be missing"),
            (edited(directory + 8, 1), "`plate` in the archive is protected by a password"),
            (
                edited(directory + 10, 12),
                "`plate` in the archive has compression method 12, but only `deflate` is supported",
            ),
            (
                edited(directory + 16, 0),
                "the archive is damaged: `plate` cannot be unpacked: invalid checksum: expected 0x76f7c500, got 0x76f7c5d1",
            ),
            (
                edited(directory + 24, 3),
                "the archive is damaged: `plate` cannot be unpacked: invalid size: expected 3, got 32",
            ),
            (edited(directory + 42, 9), "the archive is damaged: `plate` is not where its directory says"),
            (edited(directory, 9), "the archive is damaged: its directory cannot be read"),
        ];
        for (bytes, message) in cases {
            assert_eq!(complaints(read(&bytes, "", &Hints::default())), [(0, message.into())]);
        }
        let cut = gzipped(PLATE);
        let got = complaints(read(&cut[..cut.len() - 9], "", &Hints::default()));
        assert!(got[0].1.starts_with("the archive is damaged: `` cannot be unpacked"), "{got:?}");
    }

    #[test]
    fn a_damaged_archive_is_refused_or_read_soundly() {
        let good = [zipped(0, &[("plate", PLATE)]), zipped(8, &[("plate", PLATE)]), gzipped(PLATE)];
        let refused = count_refused(&[&good[0], &good[1], &good[2]], "", &Hints::default(), 3000);
        assert!((1000..3000).contains(&refused), "{refused}");
    }
}
