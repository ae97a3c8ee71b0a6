//! Guesses the frames in bytes: the period by a mark that comes again and again, its place by the pauses, and the
//! checksum by trying those that are known.

use std::cmp::Reverse;
use std::collections::BTreeMap;

use super::heard::{Guess, Heard, is_usual, rows_and_cols};
use super::parts::numbering;
use super::text::rate;
use crate::devices::stream::{checksum_size, checksums, has_checksum};

/// Number of frames from which a guess is made.
const MIN_FRAMES: usize = 4;
/// Shortest frame [bytes].
const MIN_LENGTH: usize = 4;
/// Share of the frames that have the mark at its place, in percent.
const MIN_REGULAR_PERCENT: usize = 70;
/// Difference between two shares that are equally good, in percent.
const REGULAR_MARGIN_PERCENT: usize = 5;
/// Longest mark that is looked for.
const MAX_MARK: usize = 4;
/// The usual marks.
pub(super) const KNOWN: [&[u8]; 8] = [
    &[0xAA, 0x55, 0x03, 0x99],
    &[0xF0, 0xC4, 0x01],
    &[0xFF, 0xFE, 0xFE, 0xFF],
    &[0xAA, 0x55],
    &[0x55, 0xAA],
    &[0xA5, 0x5A],
    &[0x5A, 0xA5],
    &[0x0D, 0x0A],
];

/// Frames of one length, one behind the other.
struct Row<'b> {
    bytes: &'b [u8],
    length: usize,
    /// Place of its first byte in all bytes.
    start: usize,
}

/// Guesses the frames, if something comes again and again.
pub(super) fn guess(heard: &Heard) -> Option<Guess> {
    let row = row(&heard.bytes)?;
    let (begin, has_pause) = beginning(&row, &heard.pauses);
    let bursts: Vec<&[u8]> = row.bytes.get(begin..)?.chunks_exact(row.length).collect();
    let frames = packets_of(&bursts).unwrap_or(bursts);
    let length = frames.first()?.len();
    let constant: Vec<bool> = (0..length).map(|i| frames.iter().all(|frame| frame[i] == frames[0][i])).collect();
    let (frame, mark) = mark(frames[0], &constant)?;
    let is_trailer = frame == "trailer";
    let trailer = if is_trailer { mark.len() } else { 0 };
    let check = checksum(&frames, trailer);
    let digits: String = mark.iter().map(|byte| format!("{byte:02X}")).collect();
    let mut findings = vec![format!("{} frames of {length} bytes", frames.len())];
    findings.push(format!("each has {digits} at its {}", if is_trailer { "end" } else { "beginning" }));
    findings.push(match has_pause {
        true => "a pause is before each frame".to_owned(),
        false => "there is no pause between the frames: the mark may be at another place".to_owned(),
    });
    findings.extend(check.as_ref().map(|check| format!("the checksum is {check}")));
    let end = length - trailer - check.as_deref().map_or(0, checksum_size);
    let header = if is_trailer { 0 } else { mark.len() };
    let parts = numbering(&frames, header, end);
    let (offset, cell, count) = cells(&frames, parts.as_ref().map_or(header, |parts| parts.offset + 1), end);
    let packets = parts.as_ref().map_or(1, |parts| parts.count);
    let (rows, cols) = rows_and_cols(packets * count);
    let mut keys = vec![("frame", format!("{frame:?}"), ""), ("mark", format!("\"hex:{digits}\""), "")];
    keys.extend(check.as_ref().map(|check| ("check", format!("{check:?}"), "")));
    keys.push(("length", length.to_string(), ""));
    keys.push(("cell", format!("{cell:?}"), "check it"));
    keys.push(("offset", offset.to_string(), ""));
    keys.push(("shape", format!("[{rows}, {cols}]"), "rows and columns; check them"));
    if let Some(parts) = parts {
        findings.push(format!("a byte counts them from {}: {packets} of them are an image", parts.first));
        keys.push(("parts", parts.key(count), ""));
    }
    keys.push(("rate_hz", rate(heard.bytes.len() / length / packets, heard.seconds), "as it was heard"));
    Some(Guess { findings, keys })
}

/// Splits frames that are the packets of one image, one behind the other: each begins with the same byte and has its
/// number behind that.
fn packets_of<'b>(bursts: &[&'b [u8]]) -> Option<Vec<&'b [u8]>> {
    let length = bursts.first()?.len();
    let counts = (2..=length / MIN_LENGTH).filter(|count| length.is_multiple_of(*count));
    counts.rev().find_map(|count| {
        let packets: Vec<&[u8]> = bursts.iter().flat_map(|burst| burst.chunks_exact(length / count)).collect();
        let has_mark = packets.iter().all(|packet| packet[0] == packets[0][0]);
        let numbers = if has_mark { numbering(&packets, 1, length / count) } else { None };
        (numbers?.count == count).then_some(packets)
    })
}

/// Returns the name of the checksum that all frames have, if they differ. `trailer` bytes are behind it.
pub(super) fn checksum(frames: &[&[u8]], trailer: usize) -> Option<String> {
    let is_different = frames.iter().any(|frame| *frame != frames[0]);
    let holds = |name: &String| is_different && frames.iter().all(|frame| has_checksum(name, frame, trailer));
    checksums().iter().find(|name| holds(name)).cloned()
}

/// Finds the longest row of frames: two bytes that come again after one length.
fn row(bytes: &[u8]) -> Option<Row<'_>> {
    let mut places = BTreeMap::<[u8; 2], Vec<usize>>::new();
    for (i, pair) in bytes.array_windows().enumerate() {
        places.entry(*pair).or_default().push(i);
    }
    let mut found = Vec::new();
    for places in places.values().filter(|places| places.len() >= MIN_FRAMES) {
        let Some(Run { length, start, steps, all }) = longest_run(places) else { continue };
        // Of all bytes, and not of the longest run: a gap in what was heard cuts a run, and shortens a long one by less.
        let regular = 100 * all * length / bytes.len();
        if length >= MIN_LENGTH && steps + 1 >= MIN_FRAMES && regular >= MIN_REGULAR_PERCENT {
            found.push((regular, Row { bytes: &bytes[start..start + steps * length], length, start }));
        }
    }
    // What comes in every second frame is as regular as what comes in each.
    let (most, Reverse(whole)) = found.iter().map(|(regular, row)| (*regular, Reverse(row.length))).max()?;
    let is_regular =
        |regular: usize, length: usize| regular + REGULAR_MARGIN_PERCENT >= most && whole.is_multiple_of(length);
    let regular = found.into_iter().filter(|(regular, row)| is_regular(*regular, row.length));
    regular.map(|(_, row)| row).min_by_key(|row| row.length)
}

/// Places that are one length apart.
struct Run {
    length: usize,
    /// The first place of the longest run, and its number of steps.
    start: usize,
    steps: usize,
    /// Number of all steps of this length from a place to the next one.
    all: usize,
}

/// Finds the most usual step from a place to the next one, and the longest run of it.
fn longest_run(places: &[usize]) -> Option<Run> {
    let mut counts = BTreeMap::<usize, usize>::new();
    places.windows(2).for_each(|pair| *counts.entry(pair[1] - pair[0]).or_default() += 1);
    let (step, all) = counts.into_iter().max_by_key(|(step, count)| count * step)?;
    // The pair may stand in the data too: only the places that are one step apart count.
    let is_there = |place: usize| places.binary_search(&place).is_ok();
    let starts = places.iter().filter(|place| place.checked_sub(step).is_none_or(|before| !is_there(before)));
    let length = |start: usize| (1..).take_while(|i| is_there(start + i * step)).count();
    let runs = starts.map(|start| Run { length: step, start: *start, steps: length(*start), all });
    runs.max_by_key(|run| run.steps)
}

/// Returns where the first frame of a row begins, and whether a pause says so.
fn beginning(row: &Row<'_>, pauses: &[usize]) -> (usize, bool) {
    let inside = pauses.iter().filter(|pause| (row.start..row.start + row.bytes.len()).contains(*pause));
    let mut counts = BTreeMap::<usize, usize>::new();
    inside.for_each(|pause| *counts.entry((pause - row.start) % row.length).or_default() += 1);
    let frames = row.bytes.len() / row.length;
    match counts.into_iter().max_by_key(|(_, count)| *count) {
        Some((place, count)) if count * 2 >= frames => (place, true),
        _ => (known_place(row).unwrap_or(0), false),
    }
}

/// Returns the place of a usual mark.
fn known_place(row: &Row<'_>) -> Option<usize> {
    let first = row.bytes.get(..2 * row.length)?;
    KNOWN.iter().find_map(|mark| {
        let place = first.windows(mark.len()).position(|bytes| bytes == *mark)?;
        let is_end = *mark == [0x0D, 0x0A];
        Some(if is_end { place + mark.len() } else { place } % row.length)
    })
}

/// Returns the framing and the mark: the constant bytes at the beginning, or else at the end.
fn mark<'f>(frame: &'f [u8], constant: &[bool]) -> Option<(&'static str, &'f [u8])> {
    let known = |bytes: &[u8]| KNOWN.iter().find(|mark| bytes.starts_with(mark)).map(|mark| mark.len());
    let ends = frame.ends_with(&[0x0D, 0x0A]) && constant.iter().rev().take(2).all(|is_constant| *is_constant);
    let begins = constant.iter().take(MAX_MARK).take_while(|is_constant| **is_constant).count();
    if let Some(length) = known(frame).filter(|length| *length <= begins) {
        return Some(("sync", &frame[..length]));
    }
    if ends {
        return Some(("trailer", &frame[frame.len() - 2..]));
    }
    if begins > 0 {
        return Some(("sync", &frame[..begins.min(2)]));
    }
    let end = constant.iter().rev().take(MAX_MARK).take_while(|is_constant| **is_constant).count();
    (end > 0).then(|| ("trailer", &frame[frame.len() - end..]))
}

/// Guesses the offset, the type and the number of the cells.
pub(super) fn cells(frames: &[&[u8]], header: usize, end: usize) -> (usize, &'static str, usize) {
    const MAX_HEADER: usize = 16;
    let is_wide = |offset: usize| {
        let spread = |first: usize| {
            let high = frames.iter().flat_map(|frame| frame[first..end].iter().step_by(2));
            high.collect::<std::collections::BTreeSet<_>>().len()
        };
        let (even, odd) = (spread(offset), spread(offset + 1));
        if 3 * odd < even {
            Some("u16le")
        } else if 3 * even < odd {
            Some("u16be")
        } else {
            None
        }
    };
    for offset in header..(header + MAX_HEADER).min(end) {
        let bytes = end - offset;
        if bytes.is_multiple_of(2)
            && is_usual(bytes / 2)
            && let Some(cell) = is_wide(offset)
        {
            return (offset, cell, bytes / 2);
        }
        if is_usual(bytes) {
            return (offset, "u8", bytes);
        }
    }
    (header, "u8", end - header)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is heard of frames, each after a pause or not, from the middle of a frame on.
    fn heard(frames: &[Vec<u8>], has_pauses: bool) -> Heard {
        let cut = frames[0].len() / 3;
        let mut heard = Heard { bytes: frames[0][cut..].to_vec(), pauses: vec![0], seconds: 1.0, asks: Vec::new() };
        for frame in &frames[1..] {
            if has_pauses {
                heard.pauses.push(heard.bytes.len());
            }
            heard.bytes.extend(frame);
        }
        heard
    }

    fn keys(heard: &Heard) -> Vec<String> {
        let guess = guess(heard).expect("there are frames");
        guess.keys.iter().map(|(key, value, _)| format!("{key} = {value}")).collect()
    }

    fn assert_has(keys: &[String], expected: &[&str]) {
        for key in expected {
            assert!(keys.iter().any(|found| found == key), "{key}: {keys:?}");
        }
    }

    #[test]
    fn a_header_a_length_and_cells_of_bytes() {
        let frame = |n: usize| {
            let cells = (0..512).map(|k| ((7 * n + 3 * k) % 251) as u8);
            [0xAA, 0x55].into_iter().chain(cells).collect::<Vec<u8>>()
        };
        let frames: Vec<Vec<u8>> = (0..20).map(frame).collect();
        let expected = ["frame = \"sync\"", "mark = \"hex:AA55\"", "length = 514", "shape = [16, 32]", "offset = 2"];
        assert_has(&keys(&heard(&frames, true)), &expected);
        assert_has(&keys(&heard(&frames, false)), &expected);
    }

    #[test]
    fn packets_of_an_image_without_a_pause_between_them_are_found() {
        let packet = |n: usize, number: u8| {
            let mut packet = vec![0xAB, number];
            packet.extend((0..64).map(|k| ((7 * n + 3 * k + 11 * usize::from(number)) % 251) as u8));
            packet.push(packet.iter().fold(0, |xor, byte| xor ^ byte));
            packet
        };
        let frames: Vec<Vec<u8>> = (0..20).map(|n| (0..4).flat_map(|number| packet(n, number)).collect()).collect();
        let expected = ["mark = \"hex:AB\"", "length = 67", "check = \"xor8\"", "shape = [16, 16]"];
        let found = keys(&heard(&frames, true));
        assert_has(&found, &expected);
        assert!(found.iter().any(|key| key.starts_with("parts = { index = { offset = 1, ")), "{found:?}");
    }

    #[test]
    fn a_checksum_a_stamp_and_cells_of_12_bits() {
        let frame = |n: u32| {
            let mut frame = vec![0xF0, 0xC4, 0x01];
            frame.extend((n * 4000).to_le_bytes());
            frame.extend(
                (0..256_u32).flat_map(|k| ((k % 16) as u16 * 4096 + ((7 * n + 37 * k) % 4096) as u16).to_le_bytes()),
            );
            frame.push(frame.iter().fold(0, |xor, byte| xor ^ byte));
            frame
        };
        let frames: Vec<Vec<u8>> = (0..20).map(frame).collect();
        let expected = ["mark = \"hex:F0C401\"", "check = \"xor8\"", "length = 520", "offset = 7"];
        assert_has(&keys(&heard(&frames, true)), &expected);
    }

    #[test]
    fn a_trailer_of_floats() {
        let frame = |n: usize| {
            let chips = (0..5).flat_map(|k| [24.5, 1.0, -2.0, ((7 * n + 3 * k) % 251) as f32]);
            chips.flat_map(f32::to_le_bytes).chain([0x0D, 0x0A]).collect::<Vec<u8>>()
        };
        let frames: Vec<Vec<u8>> = (0..40).map(frame).collect();
        assert_has(&keys(&heard(&frames, true)), &["frame = \"trailer\"", "mark = \"hex:0D0A\"", "length = 82"]);
    }

    #[test]
    fn old_bytes_before_a_gap_and_few_frames_do_not_make_it_longer() {
        let frame = |n: usize| -> Vec<u8> {
            [0xAA, 0x55].into_iter().chain((0..512).map(|k| ((7 * n + 3 * k) % 251) as u8)).collect()
        };
        // What the system has kept from before, and then the frames of another time.
        let old: Vec<u8> = (0..8).flat_map(frame).take(4095).collect();
        for count in 4..40 {
            let bytes = old.iter().copied().chain((50..50 + count).flat_map(frame)).collect();
            let keys = keys(&Heard { bytes, seconds: 1.0, ..Heard::default() });
            assert_has(&keys, &["length = 514", "mark = \"hex:AA55\""]);
        }
    }

    #[test]
    fn packets_with_an_index_make_one_image() {
        let packet = |n: usize| {
            let cells = (0..128).map(|k| ((7 * n + 3 * k) % 251) as u8);
            [0xAA, 0x55, 0x03, 0x99, 1 + (n % 8) as u8].into_iter().chain(cells).collect::<Vec<u8>>()
        };
        let packets: Vec<Vec<u8>> = (0..60).map(packet).collect();
        let parts = "parts = { index = { offset = 4, cell = \"u8\" }, first = 1, values = 128 }";
        assert_has(&keys(&heard(&packets, true)), &["length = 133", "shape = [32, 32]", "offset = 5", parts]);
    }

    #[test]
    fn bytes_without_a_pattern_are_no_frames() {
        let mut random = 1_u32;
        let bytes = (0..5000).map(|_| {
            random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (random >> 24) as u8
        });
        assert_eq!(guess(&Heard { bytes: bytes.collect(), ..Heard::default() }), None);
        assert_eq!(guess(&Heard::default()), None);
        assert_eq!(guess(&Heard { bytes: vec![0; 5000], ..Heard::default() }), None);
    }
}
