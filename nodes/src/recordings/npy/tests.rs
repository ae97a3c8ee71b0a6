//! Tests of arrays, byte by byte as numpy 2 writes them.

use proptest::prelude::*;
use tactflow_runtime::signal::{Base, Unit};

use super::super::testing::{complaints, count_refused, zipped};
use super::super::{Hints, Refusal, read};

/// Returns an `.npy` of version 1. As in numpy, the header ends at a multiple of 64 bytes.
pub(in super::super) fn npy(element: &str, is_fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let order = if is_fortran { "True" } else { "False" };
    let mut header = format!("{{'descr': '{element}', 'fortran_order': {order}, 'shape': {shape}, }}");
    let len = (10 + header.len() + 1).next_multiple_of(64) - 10;
    header.push_str(&" ".repeat(len - 1 - header.len()));
    header.push('\n');
    [b"\x93NUMPY\x01\x00", &(len as u16).to_le_bytes()[..], header.as_bytes(), data].concat()
}

fn floats(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn hints() -> Hints {
    Hints { unit: Some(Unit::NEWTON), pitch: Some([0.005; 2]), rate_hz: Some(100.0), ..Hints::default() }
}

/// `np.arange(12.0).reshape(2, 2, 3)`, saved.
fn arange() -> Vec<u8> {
    npy("<f8", false, "(2, 2, 3)", &floats(&(0..12).map(f64::from).collect::<Vec<_>>()))
}

/// `np.savez(f, images=…, time=[5.0, 5.5], force=[1.0, 2.0], pitch_mm=[4.0, 5.0], unit="N/cm^2")`.
fn archive(method: u16) -> Vec<u8> {
    let unit: Vec<u8> = "N/cm^2".chars().flat_map(|c| u32::from(c).to_le_bytes()).collect();
    zipped(
        method,
        &[
            ("images.npy", &arange()),
            ("time.npy", &npy("<f8", false, "(2,)", &floats(&[5.0, 5.5]))),
            ("force.npy", &npy("<f8", false, "(2,)", &floats(&[1.0, 2.0]))),
            ("pitch_mm.npy", &npy("<f8", false, "(2,)", &floats(&[4.0, 5.0]))),
            ("unit.npy", &npy("<U6", false, "()", &unit)),
            ("calibration.npy", &npy("<f8", false, "(1, 1)", &floats(&[1.0]))),
        ],
    )
}

#[test]
fn an_array_of_any_type_and_order_is_the_same_recording() {
    type Encode = fn(u8) -> Vec<u8>;
    let good = read(&arange(), "a.npy", &hints()).unwrap();
    assert_eq!((good.shape.rows, good.shape.cols, good.frames.len(), good.period), (2, 3, 2, 0.01));
    assert_eq!(good.cells, (0..12).map(|i| i as f32).collect::<Vec<_>>());
    assert_eq!(good.frames[1].time, 10_000_000);
    let each = |bytes: Encode| (0..12).flat_map(bytes).collect::<Vec<u8>>();
    // The first axis runs fastest: frame, row and column of position p are p % 2, p / 2 % 2 and p / 4.
    let fortran =
        |bytes: Encode| (0..12).flat_map(|p: u8| bytes(6 * (p % 2) + 3 * (p / 2 % 2) + p / 4)).collect::<Vec<u8>>();
    let cases: [(&str, Encode); 12] = [
        ("<f8", |v| f64::from(v).to_le_bytes().into()),
        (">f8", |v| f64::from(v).to_be_bytes().into()),
        ("<f4", |v| f32::from(v).to_le_bytes().into()),
        (">f4", |v| f32::from(v).to_be_bytes().into()),
        ("<i2", |v| i16::from(v).to_le_bytes().into()),
        (">i2", |v| i16::from(v).to_be_bytes().into()),
        ("<u2", |v| u16::from(v).to_le_bytes().into()),
        ("<i4", |v| i32::from(v).to_le_bytes().into()),
        (">u4", |v| u32::from(v).to_be_bytes().into()),
        ("<i8", |v| i64::from(v).to_le_bytes().into()),
        // Halves from 0 to 11: an exponent of 15 is a factor of 1.
        ("<f2", |v| match v {
            0 => vec![0, 0],
            _ => ((15 + v.ilog2() as u16) << 10 | (u16::from(v) << (10 - v.ilog2())) & 1023).to_le_bytes().into(),
        }),
        ("=u8", |v| u64::from(v).to_ne_bytes().into()),
    ];
    for (element, bytes) in cases {
        let file = npy(element, false, "(2, 2, 3)", &each(bytes));
        assert_eq!(read(&file, "", &hints()).as_ref(), Ok(&good), "{element}");
        let file = npy(element, true, "(2, 2, 3)", &fortran(bytes));
        assert_eq!(read(&file, "", &hints()).as_ref(), Ok(&good), "{element} of Fortran");
    }
    let flat = npy("<f8", false, "(2, 6)", &arange()[128..]);
    assert_eq!(read(&flat, "", &Hints { size: Some([2, 3]), ..hints() }), Ok(good));
}

#[test]
fn small_integers_keep_their_sign() {
    let bytes: Vec<u8> = (0..16).map(|i| (i as i8 - 8) as u8).collect();
    let recording = read(&npy("|i1", false, "(2, 2, 4)", &bytes), "", &hints()).unwrap();
    assert_eq!(recording.cells, (-8..8).map(|i| i as f32).collect::<Vec<_>>());
}

#[test]
fn an_archive_gives_unit_pitch_and_times() {
    for method in [0, 8] {
        let recording = read(&archive(method), "a.npz", &Hints::default()).unwrap();
        assert_eq!((recording.format, recording.shape.unit), ("npz", Unit::of(Base::Kilopascal)));
        assert!((recording.shape.pitch[0] - 0.004).abs() < 1e-12 && (recording.shape.pitch[1] - 0.005).abs() < 1e-12);
        assert_eq!(recording.cells, (0..12).map(|i| 10.0 * i as f32).collect::<Vec<_>>());
        assert_eq!((recording.frames[1].time, recording.period), (500_000_000, 0.5));
        assert_eq!(recording.force.as_deref(), Some(&[1.0, 2.0][..]));
    }
    let nameless = zipped(8, &[("arr_0.npy", &arange()), ("arr_1.npy", &npy("<f8", false, "(1,)", &floats(&[3.0])))]);
    assert_eq!(read(&nameless, "", &hints()).unwrap().cells.len(), 12);
}

#[test]
fn a_mistake_in_an_array_has_its_message() {
    let body = &arange()[128..].to_vec();
    let nan = |at: usize| {
        let mut values: Vec<f64> = (0..12).map(f64::from).collect();
        values[at] = f64::NAN;
        npy("<f8", false, "(2, 2, 3)", &floats(&values))
    };
    let cases: [(Vec<u8>, &str); 14] = [
        (arange()[..200].to_vec(), "its header has [2, 2, 3] elements of 8 bytes, but 72 bytes come after it"),
        ([arange(), vec![0]].concat(), "its header has [2, 2, 3] elements of 8 bytes, but 97 bytes come after it"),
        (arange()[..40].to_vec(), "the header of the array is cut off"),
        (
            npy("<f8", false, "(99999999999, 99999999999, 9)", body),
            "its header has [99999999999, 99999999999, 9] elements of 8 bytes, but 96 bytes come after it",
        ),
        (npy("<c16", false, "(2, 3, 1)", body), "elements of type `'<c16'` are not supported: save plain numbers"),
        (
            npy("<f8", false, "(12,)", body),
            "expected an array [frames, rows, columns], or [frames, rows, columns, 3], found [12]",
        ),
        (npy("<f8", false, "(2, 2, x)", body), "`shape` of the array is not a list of sizes"),
        (npy("<f8", false, "(0, 2, 3)", &[]), "the array has no frame"),
        (npy("<f8", false, "(2, 0, 3)", &[]), "an array needs at least one row and one column"),
        (npy("|u1", false, "(24, 2, 2)", body), "frames of 4 bytes are too small"),
        (npy("<f8", false, "(2, 6)", body), "the file does not give its number of rows and columns"),
        (nan(7), "frame 1, row 0, column 1: this cell is NaN, but it is a number in the first frame: `NaN`"),
        (
            npy("<f8", false, "(2, 2, 3)", &floats(&[1e300; 12])),
            "frame 0, row 0, column 0: this cell is too large: `1e300`",
        ),
        (npy("|S8", false, "(2, 2, 3)", body), "the elements of the array are not numbers"),
    ];
    for (bytes, message) in cases {
        let got = complaints(read(&bytes, "a.npy", &hints()));
        assert!(got[0].1.starts_with(message), "{got:?}, {message}");
    }
}

#[test]
fn a_mistake_in_an_archive_of_arrays_has_its_message() {
    let images = arange();
    let with = |name: &str, values: &[f64]| {
        let shape = format!("({},)", values.len());
        zipped(0, &[("images.npy", &*images), (name, &npy("<f8", false, &shape, &floats(values)))])
    };
    let cases = [
        (with("time.npy", &[1.0]), "`time` has 1 numbers, but there are 2 frames"),
        (with("time.npy", &[1.0, 0.5]), "`time`: frame 1 at 0.5 s is not from 0 to 1e9 s after the first"),
        (with("force.npy", &[1.0, f64::NAN]), "`force`: `NaN` is not finite"),
        (with("pitch_mm.npy", &[1.0, 0.0]), "`pitch_mm`: expected one or two numbers greater than 0"),
        (with("rate_hz.npy", &[0.0]), "`rate_hz`: expected a single number greater than 0"),
        (with("unit.npy", &[1.0]), "`unit`: expected a single text"),
        (with("rate_hz.npy", &[50.0]), "the file has another value: 50 frames a second"),
        (
            zipped(0, &[("a.npy", &*images), ("b.npy", &*images)]),
            "no array is called `images`, and more than one of the others has the axes of images",
        ),
        (zipped(0, &[("images.npy", &images[..100])]), "the header of the array is cut off"),
        (
            with("time.npy", &[0.0, 0.01])[..500].to_vec(),
            "the archive is damaged: it has no directory: its end may be missing",
        ),
    ];
    for (bytes, message) in cases {
        assert_eq!(complaints(read(&bytes, "a.npz", &hints())), [(0, message.into())]);
    }
}

#[test]
fn a_cell_that_is_always_nan_is_dead() {
    let values = [f64::NAN, 1.0, 2.0, f64::NAN, 4.0, 5.0];
    let recording = read(&npy("<f8", false, "(2, 1, 3)", &floats(&values)), "", &hints()).unwrap();
    assert_eq!((&*recording.dead, &*recording.cells), (&[0][..], &[0.0, 1.0, 2.0, 0.0, 4.0, 5.0][..]));
}

#[test]
fn a_damaged_file_is_refused_or_gives_a_sound_recording() {
    let (plain, packed) = (arange(), archive(8));
    let refused = count_refused(&[&plain, &packed], "", &hints(), 4000);
    assert!((1000..4000).contains(&refused), "{refused}");
    assert_eq!(read(b"\x93NUMPZ", "", &hints()), Err(Refusal::Stranger));
}

proptest! {
    /// Compares all halves with the definition of IEEE 754.
    #[test]
    fn a_half_has_its_ieee_value(bits: u16) {
        let value = super::array::half(bits);
        let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023) / 1024.0);
        let two = |power: i32| libm::pow(2.0, power.into());
        let expected = match exponent {
            31 if fraction == 0.0 => f64::INFINITY,
            31 => f64::NAN,
            0 => fraction * two(-14),
            _ => (1.0 + fraction) * two(exponent - 15),
        };
        let expected = if bits >> 15 == 0 { expected } else { -expected };
        prop_assert!(value == expected || value.is_nan() && expected.is_nan(), "{bits:x}: {value}, {expected}");
    }
}

#[test]
fn three_values_for_each_tactel_are_a_vector_image() {
    let values: Vec<f64> = (0..36).map(f64::from).collect();
    let recording = read(&npy("<f8", false, "(2, 2, 3, 3)", &floats(&values)), "a.npy", &hints()).unwrap();
    assert!(recording.is_sound() && (recording.shape.rows, recording.shape.cols) == (2, 3));
    let mut vectors = [[0.0; 3]; 6];
    recording.show_vectors(1, &mut vectors);
    assert_eq!(vectors.as_flattened(), (18..36).map(|i| i as f32).collect::<Vec<_>>());
    let mut image = [0.0; 6];
    recording.show(1, &mut image);
    assert_eq!(image, [20.0, 23.0, 26.0, 29.0, 32.0, 35.0], "the image is z");
    let mut broken = values.clone();
    broken[19] = f64::NAN;
    let refusal = complaints(read(&npy("<f8", false, "(2, 2, 3, 3)", &floats(&broken)), "a.npy", &hints()));
    assert!(refusal[0].1.contains("frame 1, row 0, column 0: its x or y is not finite: `NaN`"), "{refusal:?}");
    // A tactel that does not exist is NaN in z.
    let mut dead = values;
    [2, 20].iter().for_each(|i| dead[*i] = f64::NAN);
    let recording = read(&npy("<f8", false, "(2, 2, 3, 3)", &floats(&dead)), "a.npy", &hints()).unwrap();
    assert_eq!((recording.dead, recording.drag[0]), (vec![0], [0.0, 0.0]));
}
