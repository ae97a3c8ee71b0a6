//! Helpers of the format tests.

use std::io::Write;

use super::{Hints, Recording, Refusal, read};
use tactflow_runtime::random::Random;

/// Cuts, swaps, flips, inserts or repeats a few bytes.
fn damage(random: &mut Random, bytes: &mut Vec<u8>) {
    for _ in 0..=random.below(3) {
        if bytes.is_empty() {
            return;
        }
        let (a, b) = (random.below(bytes.len()), random.below(bytes.len()));
        let (from, to) = (a.min(b), a.max(b).min(a.min(b) + 40));
        match random.below(8) {
            0 => bytes.truncate(a),
            1 => bytes.swap(a, b),
            2 => bytes[a] ^= 1 << random.below(8),
            3 => bytes[a] = random.below(256) as u8,
            4 => drop(bytes.drain(from..to)),
            5 => drop(bytes.splice(a..a, b"99999999999".iter().copied())),
            6 => drop(bytes.splice(b..b, bytes[from..to].to_vec())),
            _ => bytes.insert(a, b"9-.,;B\n\r\t@e \""[random.below(13)]),
        }
    }
}

/// Returns each complaint with its line; 0 for a complaint without a place.
pub(super) fn complaints(read: Result<Recording, Refusal>) -> Vec<(usize, String)> {
    match read {
        Ok(recording) => {
            assert!(recording.is_sound(), "{:?} {:?}", recording.shape, recording.frames);
            vec![]
        }
        Err(Refusal::Stranger) => vec![(0, "stranger".into())],
        Err(Refusal::Damaged { text, flaws }) => {
            assert!(!flaws.is_empty(), "a refusal says why");
            let line = |at: usize| text[..at].matches('\n').count() + 1;
            let check = |span: &std::ops::Range<usize>| assert!(text.get(span.clone()).is_some(), "{span:?}");
            flaws
                .into_iter()
                .inspect(|flaw| check(&flaw.span))
                .map(|flaw| (line(flaw.span.start), flaw.message))
                .collect()
        }
        Err(
            Refusal::Broken { message, .. } | Refusal::Silent { message, .. } | Refusal::Contradicted { message, .. },
        ) => {
            vec![(0, message)]
        }
    }
}

/// Checks a table of damages: each replaces `from` by `to` once in `good`, and has one complaint at a line.
pub(super) fn check_damages(good: &str, name: &str, hints: &Hints, cases: &[(&str, &str, usize, &str)]) {
    assert_eq!(complaints(read(good.as_bytes(), name, hints)), [], "it is good");
    for (from, to, line, message) in cases {
        assert!(good.contains(from), "{from}");
        let got = complaints(read(good.replacen(from, to, 1).as_bytes(), name, hints));
        assert_eq!(got, [(*line, (*message).to_owned())], "{from} -> {to}");
    }
}

/// Damages good files at random and returns how many are refused. Each other one must give a sound recording.
pub(super) fn count_refused(good: &[&[u8]], name: &str, hints: &Hints, rounds: usize) -> usize {
    let mut random = Random::new(2013, 0);
    let mut refused = 0;
    for round in 0..rounds {
        let mut bytes = good[round % good.len()].to_vec();
        damage(&mut random, &mut bytes);
        refused += usize::from(!complaints(read(&bytes, name, hints)).is_empty());
    }
    refused
}

/// Returns a zip archive of the members, stored (0) or deflated (8).
pub(super) fn zipped(method: u16, members: &[(&str, &[u8])]) -> Vec<u8> {
    let (mut archive, mut directory) = (Vec::new(), Vec::new());
    for (name, bytes) in members {
        let mut packed = bytes.to_vec();
        if method == 8 {
            let mut deflated = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::default());
            deflated.write_all(bytes).unwrap();
            packed = deflated.finish().unwrap();
        }
        let mut crc = flate2::Crc::new();
        crc.update(bytes);
        let mut common = Vec::new();
        common.extend([20, 0, 0, 0]);
        common.extend(method.to_le_bytes());
        common.extend([0; 4]);
        for number in [crc.sum(), packed.len() as u32, bytes.len() as u32] {
            common.extend(number.to_le_bytes());
        }
        common.extend((name.len() as u16).to_le_bytes());
        common.extend([0; 2]);
        let at = archive.len() as u32;
        archive.extend([b"PK\x03\x04", &*common, name.as_bytes(), &packed].concat());
        directory.extend([b"PK\x01\x02\x14\x00", &*common, &[0; 10], &at.to_le_bytes(), name.as_bytes()].concat());
    }
    let (at, count) = (archive.len() as u32, members.len() as u16);
    let size = directory.len() as u32;
    archive.extend(directory);
    archive.extend([b"PK\x05\x06\0\0\0\0", &count.to_le_bytes()[..], &count.to_le_bytes()].concat());
    archive.extend([&size.to_le_bytes()[..], &at.to_le_bytes(), &[0; 2]].concat());
    archive
}
