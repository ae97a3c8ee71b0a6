//! Tests of framing: any split of the bytes, garbage, lost and added bytes, marks in the data.

use proptest::prelude::*;

use super::check::{Check, Sum};
use super::lines::Lines;
use super::marked::Marked;
use super::messages::Messages;
use super::packets::{Coding, Packets};
use super::replies::Replies;
use super::rule::{Length, Rule};
use super::{Counts, Framer};

const MARK: [u8; 2] = [0xAA, 0x55];

fn rule(length: usize, mark: &[u8], mark_at: usize, check: Option<&str>) -> Rule {
    let check = check.map(|name| {
        let (sum, order) = Sum::of(name).flatten().unwrap();
        Check { sum, order, from: 0, after: 0 }
    });
    Rule { mark: mark.to_vec(), mark_at, length: Length::One(length), check }
}

fn sync(length: usize, check: Option<&str>) -> Framer {
    Framer::Marked(Marked::new(rule(length, &MARK, 0, check)))
}

/// Pushes pieces, each after a pause or not, and returns the frames.
fn frames(framer: &mut Framer, pieces: &[(&[u8], bool)]) -> Vec<Vec<u8>> {
    let mut found = Vec::new();
    for (piece, is_after_pause) in pieces {
        framer.push(piece, *is_after_pause);
        while let Some(frame) = framer.next(&mut |_| true) {
            found.push(frame.to_vec());
        }
    }
    found
}

/// A frame of 10 bytes with a mark, a number and a payload.
fn frame(number: u8) -> Vec<u8> {
    [&MARK[..], &[number, 1, 2, 3, 4, 5, 6, number]].concat()
}

fn stream(numbers: impl IntoIterator<Item = u8>) -> Vec<u8> {
    numbers.into_iter().flat_map(frame).collect()
}

#[test]
fn the_third_frame_in_a_row_is_the_first_that_is_believed() {
    let mut framer = sync(10, None);
    let bytes = stream(0..6);
    for (i, byte) in bytes.iter().enumerate() {
        let found = frames(&mut framer, &[(&[*byte], false)]);
        // As soon as it is complete, with its last byte.
        let expected = if i >= 29 && i % 10 == 9 { vec![frame((i / 10) as u8)] } else { vec![] };
        assert_eq!(found, expected, "byte {i}");
    }
    assert_eq!(framer.counts(), Counts::default());
}

/// A frame of 12 bytes with a CRC of 16 bits.
fn with_crc(number: u8) -> Vec<u8> {
    let mut bytes = frame(number);
    let crc = crc::Crc::<u16>::new(&crc::CRC_16_MODBUS).checksum(&bytes);
    bytes.extend(crc.to_le_bytes());
    bytes
}

/// A frame of 11 bytes with a checksum of 8 bits.
fn with_xor(number: u8) -> Vec<u8> {
    let mut bytes = frame(number);
    bytes.push(bytes.iter().fold(0, |xor, byte| xor ^ byte));
    bytes
}

#[test]
fn a_good_crc_is_believed_at_once() {
    let mut framer = sync(12, Some("crc-16/modbus"));
    assert_eq!(frames(&mut framer, &[(b"hello", false), (&with_crc(7), false)]), [with_crc(7)]);
    assert_eq!(framer.counts(), Counts { rejected: 0, resyncs: 0, skipped: 5 });
}

#[test]
fn a_checksum_of_8_bits_is_believed_in_the_third_frame_in_a_row() {
    let mut framer = sync(11, Some("xor8"));
    let bytes = [b"hello".to_vec(), with_xor(1), with_xor(2), with_xor(3), with_xor(4)].concat();
    assert_eq!(frames(&mut framer, &[(&bytes, false)]), [with_xor(3), with_xor(4)]);
}

#[test]
fn a_frame_that_was_damaged_on_the_way_is_the_only_one_that_is_dropped() {
    let mut framer = sync(11, Some("xor8"));
    let mut broken = with_xor(4);
    broken[5] ^= 1;
    let bytes = [with_xor(1), with_xor(2), with_xor(3), broken, with_xor(5), with_xor(6)].concat();
    for (i, byte) in bytes.iter().enumerate() {
        let found = frames(&mut framer, &[(&[*byte], false)]);
        let number = (i / 11 + 1) as u8;
        let is_sent = i % 11 == 10 && [3, 5, 6].contains(&number);
        assert_eq!(found, if is_sent { vec![with_xor(number)] } else { vec![] }, "byte {i}");
    }
    assert_eq!(framer.counts(), Counts { rejected: 1, resyncs: 0, skipped: 11 });
}

#[test]
fn a_frame_in_the_payload_with_its_own_checksum_is_no_frame() {
    // Each frame of 22 bytes holds a whole frame of the same form, but for its place.
    let inner = [&MARK[..], &[9, 9, 9]].concat();
    let outer = |number: u8| {
        let mut bytes = [&MARK[..], &[number], &inner, &[number; 13]].concat();
        bytes.push(bytes.iter().fold(0, |xor, byte| xor ^ byte));
        bytes
    };
    // What begins at the inner mark has a good checksum once.
    let mut second = outer(2);
    let from_inner = [&outer(1)[3..], &second[..3]].concat();
    second[2] ^= from_inner[..21].iter().fold(0, |xor, byte| xor ^ byte) ^ from_inner[21];
    second[21] = second[..21].iter().fold(0, |xor, byte| xor ^ byte);
    let bytes = [&outer(1)[1..], &second, &outer(3), &outer(4), &outer(5)].concat();
    let found = frames(&mut sync(22, Some("xor8")), &[(&bytes, false)]);
    assert!(found.iter().all(|frame| (3..=5).any(|number| *frame == outer(number))), "{found:?}");
    assert_eq!(found.last(), Some(&outer(5)));
}

#[test]
fn a_missing_mark_drops_the_lock_and_three_frames_bring_it_back() {
    let mut framer = sync(10, None);
    assert_eq!(frames(&mut framer, &[(&stream(0..4), false)]).len(), 2);
    // A byte is lost in frame 4: it ends with the first byte of frame 5, and the second one is not the mark.
    let mut broken = stream(4..5);
    broken.remove(5);
    let after = stream(5..10);
    let found = frames(&mut framer, &[(&[broken, after].concat(), false)]);
    assert_eq!(found, [frame(7), frame(8), frame(9)]);
    assert_eq!(framer.counts(), Counts { rejected: 1, resyncs: 1, skipped: 9 });
}

#[test]
fn a_mark_in_the_data_does_not_matter() {
    // The standard test: 514 bytes with the mark in the payload, at a place that moves.
    let frame = |number: usize| {
        let mut frame = vec![0_u8; 514];
        frame[..2].copy_from_slice(&MARK);
        frame[2] = number as u8;
        let place = 10 + 37 * (number % 9);
        frame[place..place + 2].copy_from_slice(&MARK);
        frame
    };
    let bytes: Vec<u8> = (0..20).flat_map(frame).collect();
    // Begin anywhere.
    for start in [0, 1, 10, 47, 300, 513] {
        let mut framer = sync(514, None);
        let found = frames(&mut framer, &[(&bytes[start..], false)]);
        assert!(found.len() >= 16, "{start}: {}", found.len());
        assert!(found.iter().all(|found| *found == frame(usize::from(found[2]))), "{start}");
    }
}

/// Frames with the mark at the same place of each one.
fn double(number: u8) -> Vec<u8> {
    [&MARK[..], &[number, 1], &MARK, &[number, 2, 3, 4]].concat()
}

#[test]
fn a_mark_at_the_same_place_of_every_frame_needs_a_pause() {
    let all: Vec<Vec<u8>> = (0..9).map(double).collect();
    // Nothing says which mark is the right one: no frame, rather than a wrong one.
    let mut framer = sync(10, None);
    assert_eq!(frames(&mut framer, &[(&all.concat()[4..], false)]), [[0; 0]; 0]);
    assert!(framer.is_ambiguous());
    // The pauses between the frames do, also if the first bytes are the end of a frame.
    for start in [0, 3, 4, 5] {
        let mut framer = sync(10, None);
        let mut pieces = vec![(&all[0][start..], true)];
        pieces.extend(all[1..].iter().map(|frame| (&frame[..], true)));
        let found = frames(&mut framer, &pieces);
        assert!(found.len() >= 5, "{start}: {found:?}");
        assert!(found.iter().all(|frame| *frame == double(frame[2])), "{start}: {found:?}");
    }
}

#[test]
fn data_of_nothing_but_marks_does_not_matter() {
    let marks = |_: u8| MARK.repeat(5);
    let mut bytes: Vec<u8> = (0..6).flat_map(marks).collect();
    bytes.extend(stream(0..6));
    let mut framer = sync(10, None);
    let found = frames(&mut framer, &[(&bytes, false)]);
    assert!(found.iter().all(|found| *found == MARK.repeat(5) || *found == frame(found[2])), "{found:?}");
    assert!(found.ends_with(&[frame(3), frame(4), frame(5)]), "{found:?}");
}

#[test]
fn a_trailer_ends_the_frame() {
    let frame = |number: u8| [number, 1, 2, 3, 0x0D, 0x0A];
    let mut framer = Framer::Marked(Marked::new(rule(6, &[0x0D, 0x0A], 4, None)));
    let bytes: Vec<u8> = [3, 0x0D, 0x0A].into_iter().chain((0..5).flat_map(frame)).collect();
    let found = frames(&mut framer, &[(&bytes, false)]);
    assert_eq!(found, [frame(2), frame(3), frame(4)]);
    assert_eq!(framer.counts().skipped, 3);
}

#[test]
fn content_that_makes_no_sense_is_no_frame() {
    let mut framer = sync(10, None);
    framer.push(&stream(0..8), false);
    let mut found = Vec::new();
    while let Some(frame) = framer.next(&mut |frame| frame[2] != 4) {
        found.push(frame[2]);
    }
    assert_eq!(found, [2, 3, 7], "three good frames in a row after a bad one");
    assert_eq!(framer.counts(), Counts { rejected: 1, resyncs: 1, skipped: 10 });
}

fn texts(framer: &mut Framer, text: &str) -> Vec<String> {
    let mut found = Vec::new();
    framer.push(text.as_bytes(), false);
    // A frame has four numbers.
    let mut is_sound = |text: &[u8]| {
        let text = std::str::from_utf8(text).unwrap_or_default();
        let words = text.split(['\n', ',']);
        words.clone().count() == 4 && words.clone().all(|word| word.trim().parse::<f64>().is_ok())
    };
    while let Some(frame) = framer.next(&mut is_sound) {
        found.push(String::from_utf8(frame.to_vec()).unwrap());
    }
    found
}

#[test]
fn a_line_is_a_frame_but_for_the_first() {
    let mut framer = Framer::Lines(Lines::new(None, 64));
    assert_eq!(texts(&mut framer, "1,2,3,4\n5,6,7,8\r\n\nhello\n9,1"), ["5,6,7,8"]);
    assert_eq!(texts(&mut framer, ",2,3\n"), ["9,1,2,3"]);
    assert_eq!(texts(&mut framer, &format!("{}\n1,2,3,4\n", "9".repeat(500))), ["1,2,3,4"], "a line without an end");
    assert_eq!(texts(&mut framer, &"9".repeat(100)), [""; 0]);
    assert_eq!(framer.counts().rejected, 1);
}

#[test]
fn several_lines_are_a_frame_up_to_the_mark() {
    for (mark, line) in [("END", "END\n"), ("", "\n"), ("Frame", "Frame 12:\n")] {
        let mut framer = Framer::Lines(Lines::new(Some(mark.into()), 64));
        let frame = |n: u8| format!("{n},1\n2,3\n{line}");
        assert_eq!(texts(&mut framer, &format!("7\n2,3\n{line}{}{}", frame(1), frame(2))), [""; 0], "{mark}");
        assert_eq!(texts(&mut framer, &frame(3)), ["3,1\n2,3"], "{mark}");
        // With its last line, before the mark.
        assert_eq!(texts(&mut framer, "4,1\n2,3\n"), ["4,1\n2,3"], "{mark}");
        assert_eq!(texts(&mut framer, &format!("{line}{}", frame(5))), ["5,1\n2,3"], "{mark}");
        // A line is missing, so the frame is none, and three more are needed.
        assert_eq!(texts(&mut framer, &format!("2,3\n{line}{}{}", frame(6), frame(7))), [""; 0], "{mark}");
        assert_eq!(texts(&mut framer, &frame(8)), ["8,1\n2,3"], "{mark}");
        assert_eq!((framer.counts().rejected, framer.counts().resyncs), (1, 1), "{mark}");
    }
}

#[test]
fn packets_end_with_a_byte_that_is_not_in_them() {
    let rule = || rule(3, &[], 0, None);
    let mut cobs = Framer::Packets(Packets::new(Coding::Cobs, rule()));
    let bytes = [9, 9, 0, 2, 7, 2, 8, 0, 0, 4, 1, 2, 3, 0, 3, 1, 2, 0];
    assert_eq!(frames(&mut cobs, &[(&bytes, false)]), [vec![7, 0, 8], vec![1, 2, 3]]);
    assert_eq!(cobs.counts().rejected, 1, "the last one is too short");
    let mut slip = Framer::Packets(Packets::new(Coding::Slip, rule()));
    let bytes = [1, 0xC0, 1, 0xDB, 0xDC, 2, 0xC0, 0xC0, 5, 6, 7, 0xC0];
    assert_eq!(frames(&mut slip, &[(&bytes, false)]), [vec![1, 0xC0, 2], vec![5, 6, 7]]);
    assert_eq!(frames(&mut slip, &[(&[1; 10_000], false), (&[0xC0, 5, 6, 7, 0xC0], false)]), [[5, 6, 7]]);
    // The rest of a packet that was dropped is no packet, even if it reads like one.
    let long = [&[4, 1, 2, 3, 0x3D][..], &[1; 20]].concat();
    assert_eq!(frames(&mut cobs, &[(&long, false), (&[4, 5, 6, 7, 0, 4, 1, 2, 3, 0], false)]), [[1, 2, 3]]);
    let rest = [(&[1; 10_000][..], false), (&[5, 6, 7, 0xC0, 1, 2, 3, 0xC0], false)];
    assert_eq!(frames(&mut slip, &rest), [[1, 2, 3]]);
}

#[test]
fn a_message_is_a_frame_or_none() {
    let mut framer = Framer::Messages(Messages::new(Some(rule(4, &MARK, 0, None))));
    let messages: [(&[u8], bool); 4] = [
        (&[0xAA, 0x55, 1, 2], false),
        (&[0xAA, 0x55, 1], false),
        (&[0xAA, 0x55, 1, 2, 3], false),
        (&[1, 2, 3, 4], false),
    ];
    assert_eq!(frames(&mut framer, &messages), [[0xAA, 0x55, 1, 2]]);
    assert_eq!(framer.counts().rejected, 3);
}

#[test]
fn a_reply_is_believed_if_it_is_the_third_without_a_byte_too_many() {
    let mut framer = Framer::Replies(Replies::new(rule(3, &[], 0, None)));
    let mut ask = |reply: &[u8]| {
        framer.ask();
        frames(&mut framer, &[(reply, false)])
    };
    let nothing = Vec::<Vec<u8>>::new();
    // The board prints `ready` when it starts, and answers the first question behind it.
    assert_eq!(ask(b"ready\n\x01\x02\x03"), nothing);
    assert_eq!(ask(&[1, 2, 3]), nothing);
    assert_eq!(ask(&[1, 2, 3]), nothing);
    assert_eq!(ask(&[1, 2, 3]), [[1, 2, 3]]);
    assert_eq!(ask(&[4, 5]), nothing);
    // The rest of it comes too late, behind the next question.
    assert_eq!(ask(&[6, 1, 2, 3]), nothing);
    assert_eq!([ask(&[1, 2, 3]), ask(&[1, 2, 3])], [nothing.clone(), nothing]);
    assert_eq!(ask(&[1, 2, 3]), [[1, 2, 3]]);
}

/// A frame of 64 bytes with a mark and a CRC, and marks in its payload.
fn checked(number: u8, payload: &[u8]) -> Vec<u8> {
    let mut frame = [&MARK[..], &[number], payload].concat();
    let crc = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(&frame);
    frame.extend(crc.to_le_bytes());
    frame
}

fn payloads() -> impl Strategy<Value = Vec<Vec<u8>>> {
    let byte = prop_oneof![Just(0xAA_u8), Just(0x55), any::<u8>()];
    prop::collection::vec(prop::collection::vec(byte, 57), 4..12)
}

/// Splits bytes at places.
fn split<'b>(bytes: &'b [u8], places: &[usize]) -> Vec<(&'b [u8], bool)> {
    let mut places: Vec<usize> = places.iter().map(|place| place % bytes.len().max(1)).collect();
    places.extend([0, bytes.len()]);
    places.sort_unstable();
    places.windows(2).map(|pair| (&bytes[pair[0]..pair[1]], pair[0] % 2 == 0)).collect()
}

proptest! {
    #[test]
    fn with_a_checksum_no_damage_makes_a_wrong_frame_and_the_next_frames_are_found(
        payloads in payloads(),
        garbage in prop::collection::vec(prop_oneof![Just(0xAA_u8), Just(0x55), any::<u8>()], 0..200),
        places in prop::collection::vec(any::<usize>(), 0..40),
        damage in (0_usize..4, any::<usize>(), any::<u8>()),
    ) {
        let sent: Vec<Vec<u8>> = payloads.iter().enumerate().map(|(i, payload)| checked(i as u8, payload)).collect();
        let mut bytes = garbage.clone();
        bytes.extend(sent.concat());
        // Damage in the first frames only.
        let (kind, place, byte) = damage;
        let place = garbage.len() + place % (2 * 64);
        match kind {
            1 => { bytes.remove(place); }
            2 => bytes.insert(place, byte),
            3 => bytes[place] ^= byte,
            _ => {}
        }
        let mut framer = sync(64, Some("crc-32/iso-hdlc"));
        let found = frames(&mut framer, &split(&bytes, &places));
        for frame in &found {
            prop_assert!(sent.contains(frame), "a wrong frame");
        }
        // The damage is in one of the first two frames. A false mark before the third one costs at most that one.
        prop_assert!(found.len() + 3 >= sent.len(), "{} of {}", found.len(), sent.len());
        prop_assert!(found.ends_with(&sent[3..]), "all frames behind the damage");
        if kind == 0 {
            prop_assert!(found.len() == sent.len(), "{} of {}", found.len(), sent.len());
        }
    }

    #[test]
    fn any_split_gives_the_same_frames(
        numbers in prop::collection::vec(any::<u8>(), 3..20),
        places in prop::collection::vec(any::<usize>(), 0..60),
        start in 0_usize..10,
    ) {
        let bytes = stream(numbers.iter().copied());
        let mut whole = sync(10, None);
        let expected = frames(&mut whole, &[(&bytes[start..], false)]);
        let mut pieces = sync(10, None);
        prop_assert_eq!(frames(&mut pieces, &split(&bytes[start..], &places)), expected);
        prop_assert_eq!(pieces.counts(), whole.counts());
    }

    #[test]
    fn any_bytes_are_bounded_and_never_panic(
        bytes in prop::collection::vec(any::<u8>(), 0..3000),
        places in prop::collection::vec(any::<usize>(), 0..20),
    ) {
        let framers = [
            sync(10, None),
            sync(10, Some("crc-16/modbus")),
            Framer::Marked(Marked::new(rule(6, &[0x0D, 0x0A], 4, None))),
            Framer::Lines(Lines::new(None, 64)),
            Framer::Lines(Lines::new(Some(b"END".to_vec()), 64)),
            Framer::Packets(Packets::new(Coding::Cobs, rule(8, &[], 0, None))),
            Framer::Packets(Packets::new(Coding::Slip, rule(8, &[], 0, None))),
            Framer::Messages(Messages::new(Some(rule(8, &[], 0, None)))),
            Framer::Replies(Replies::new(rule(8, &[], 0, None))),
        ];
        for mut framer in framers {
            framer.ask();
            frames(&mut framer, &split(&bytes, &places));
            framer.forget();
            prop_assert!(framer.counts().skipped <= bytes.len() as u64 + 64);
        }
    }
}
