//! Files of recordings that nobody meant to be read: whatever is in them, reading ends with a recording or with a
//! reason, and takes no more memory than ten times the file.

mod hostile;

use std::hint::black_box;

use tactflow_nodes::recordings::{FORMATS, Hints, read};
use tactflow_runtime::random::Random;
use tactflow_tests::fuzz::reason;
use tactflow_tests::samples::{self, Sample, samples};
use tactflow_tests::workspace;

use hostile::Hostile;

/// What reading may take beside ten times the file: what is looked at first, decoded.
const BESIDE: i64 = 1 << 19;

/// Reads a file, and checks the outcome and the memory that it took. What the outcome is, if it is a refusal.
fn check(bytes: &[u8], unpacked: usize, name: &str, hints: &Hints) -> Option<String> {
    let mut outcome = None;
    let counted = allocation_counter::measure(|| outcome = Some(black_box(read(bytes, name, hints))));
    let (most, size) = (counted.bytes_max as i64, bytes.len().max(unpacked).max(samples::inflated(bytes)) as i64);
    let reason = reason(outcome.unwrap(), name);
    assert!(most <= 10 * size + BESIDE, "{name}: {most} bytes for a file of {size}: {reason:?}");
    reason
}

#[test]
fn every_format_has_a_sample_and_reads_it() {
    let samples = samples(3);
    for format in FORMATS {
        assert!(samples.iter().any(|sample| sample.format == format.name), "no sample of `{}`", format.name);
    }
    for Sample { format, name, bytes, hints, .. } in &samples {
        let recording = read(bytes, name, hints).unwrap_or_else(|refusal| panic!("{name}: {refusal:?}"));
        assert!(recording.is_sound() && recording.frames.len() > 1, "{name}");
        assert_eq!(recording.format, *format, "{name}");
    }
}

#[test]
fn a_thousand_hostile_files_of_each_format_are_sound_or_refused_for_a_reason() {
    for Sample { name, bytes, unpacked, hints, .. } in samples(3) {
        let mut hostile = Hostile(Random::new(2026, 0));
        let mut refused = 0;
        for _ in 0..1000 {
            let bytes = hostile.make(&bytes);
            refused += usize::from(check(&bytes, unpacked, name, &hints).is_some());
        }
        assert!((300..=1000).contains(&refused), "{name}: {refused} of 1000 were refused");
    }
}

#[test]
fn large_files_take_no_more_than_ten_times_as_much_memory() {
    for Sample { name, bytes, unpacked, hints, .. } in samples(20_000) {
        assert!(bytes.len().max(unpacked) > 150_000, "{name} is not large: {}", bytes.len());
        assert_eq!(check(&bytes, unpacked, name, &hints), None, "{name}");
    }
    for name in [
        "pressuRe/emed_test.zip",
        "pressuRe/iscan_test.csv",
        "pawlabeling/dog1_sel_1.zip",
        "pawlabeling/zebris_gait.zip",
    ] {
        let bytes = std::fs::read(workspace().join("graphs/recordings").join(name)).unwrap();
        assert_eq!(check(&bytes, 0, name, &Hints::default()), None, "{name}");
    }
}

#[test]
fn a_million_columns_take_no_more_either() {
    for Sample { name, bytes, unpacked, hints, .. } in samples(3) {
        let Ok(text) = str::from_utf8(&bytes) else { continue };
        let lines: Vec<&str> = text.lines().collect();
        for (at, row) in lines.iter().enumerate() {
            for separator in ["\t", ",", ";", " "] {
                if at % 5 != 0 && at + 5 < lines.len() || !row.contains(separator) {
                    continue;
                }
                for cell in ["0", "x", "1.5", ""] {
                    let wide = format!("{row}{}", format!("{separator}{cell}").repeat(200_000));
                    let mut lines = lines.clone();
                    lines[at] = &wide;
                    check(lines.join("\n").as_bytes(), unpacked, name, &hints);
                }
            }
        }
    }
}

#[test]
fn what_a_header_promises_is_not_allocated() {
    let mut found = 0;
    for Sample { name, bytes, unpacked, hints, .. } in samples(3) {
        // Every number of the header, one after the other, is made enormous.
        for at in (0..bytes.len().min(2000)).filter(|at| bytes[*at].is_ascii_digit()) {
            for huge in [&b"4294967295"[..], b"262144", b"9999999999999999999999", b"1e308", b"-1", b"0"] {
                let end =
                    bytes[at..].iter().position(|byte| !byte.is_ascii_digit()).map_or(bytes.len(), |end| at + end);
                let hostile = [&bytes[..at], huge, &bytes[end..]].concat();
                check(&hostile, unpacked, name, &hints);
                found += 1;
            }
        }
    }
    assert!(found > 1000, "{found}");
}

#[test]
fn what_unpacks_to_far_too_much_stays_packed() {
    // A zip whose only member is a million times a zero, and one that begins as a plate does.
    let plate = b"Frame 0 (0.00 ms)\n0.0\t0.4\n".to_vec();
    for (begin, is_known) in [(vec![], false), (plate, true)] {
        let member = [begin, vec![b'0'; 30_000_000]].concat();
        let bytes = samples::zipped(8, &[("plate", &member)]);
        assert!(bytes.len() < 100_000);
        let size = if is_known { member.len() } else { 0 };
        let said = check(&bytes, size, "bomb.zip", &Hints::default()).unwrap();
        assert_eq!(said.contains("has an unknown format"), !is_known, "{said}");
        // The directory promises less than comes out.
        let mut liar = bytes.clone();
        let directory = liar.windows(4).rposition(|four| four == b"PK\x01\x02").unwrap();
        liar[directory + 24..directory + 28].copy_from_slice(&100_u32.to_le_bytes());
        let said = check(&liar, size, "liar.zip", &Hints::default()).unwrap();
        assert!(!is_known || said.contains("invalid size: expected 100"), "{said}");
    }
}

#[test]
fn the_vendors_load_of_each_insole_is_the_sum_of_its_cells() {
    let bytes = std::fs::read(workspace().join("tests/data/recordings/xsensor_insoles.csv")).unwrap();
    for (pad, loads) in
        [("HX210.11.31.M11-DFM-LF S0073", [411.67, 384.1]), ("HX210.11.31.M11-DFM-RF S0073", [54.97, 66.8])]
    {
        let hints = Hints { pad: Some(pad.into()), ..Hints::default() };
        let recording = read(&bytes, "insoles.csv", &hints).unwrap();
        let area = recording.shape.pitch[0] * recording.shape.pitch[1];
        assert_eq!((recording.shape.rows, recording.shape.cols, recording.frames[1].time), (31, 11, 13_000_000));
        for (cells, load) in recording.cells.chunks(31 * 11).zip(loads) {
            let sum: f64 = cells.iter().map(|kpa| f64::from(*kpa) * 1e3 * area).sum();
            // The sides of a sensel are rounded to 0.86 cm.
            assert!((sum / load - 1.0).abs() < 2.0 * 0.005 / 0.86, "{pad}: {sum} N, not {load} N");
        }
    }
}
