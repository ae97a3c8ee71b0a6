//! A good recording of each format, as long as one likes.

use std::fmt::Write as _;
use std::io::{Read as _, Write as _};
use std::sync::atomic::{AtomicUsize, Ordering};

use flate2::read::{DeflateDecoder, MultiGzDecoder};
use tactflow_nodes::recordings::Hints;
use tactflow_runtime::engine::{End, Engine};
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::record::OutputFile;
use tactflow_runtime::recording::{RecordRequest, RunRecorder};
use tactflow_runtime::signal::Unit;

use crate::workspace;

/// A good file.
pub struct Sample {
    /// The format that it is to be recognised as.
    pub format: &'static str,
    /// Name of the file.
    pub name: &'static str,
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// Size of what is in it when that is packed.
    pub unpacked: usize,
    /// What the bench has to say.
    pub hints: Hints,
}

/// One or more samples of each format, with that many frames or so.
///
/// # Panics
/// If the recording of the insoles is not there.
#[must_use]
pub fn samples(frames: usize) -> Vec<Sample> {
    let silent = Hints { unit: Some(Unit::RAW), pitch: Some([0.004, 0.005]), ..Hints::default() };
    let timed = Hints { rate_hz: Some(50.0), ..silent.clone() };
    let left = Hints { pad: Some("HX210.11.31.M11-DFM-LF S0073".into()), ..Hints::default() };
    let sample =
        |format, name, bytes: Vec<u8>, hints: &Hints| Sample { format, name, bytes, unpacked: 0, hints: hints.clone() };
    let packed = |format, name, bytes, unpacked| Sample { format, name, bytes, unpacked, hints: timed.clone() };
    let none = Hints::default();
    let plate = footscan(frames);
    vec![
        sample("tekscan", "movie.csv", tekscan(frames), &none),
        sample("novel-lst", "emed.lst", novel_lst(frames), &none),
        sample("novel-asc", "mat.asc", novel_asc(frames), &none),
        sample("zebris", "RawDataGaitAnalysis.txt", zebris(frames), &none),
        sample("xsensor", "insoles.csv", xsensor(frames), &left),
        sample("footscan", "Entire Plate Roll Off", plate.clone(), &none),
        sample("csv", "rows.csv", csv_rows(frames), &silent),
        sample("csv", "blocks.csv", csv_blocks(frames), &timed),
        sample("npy", "images.npy", npy("|u1", &[frames, 2, 4], &vec![7; frames * 8]), &timed),
        packed("npz", "press.npz", npz(frames, 0), 0),
        packed("npz", "packed.npz", npz(frames, 8), npz(frames, 0).len()),
        sample("mcap", "run.mcap", mcap(frames), &none),
        Sample { unpacked: plate.len(), ..sample("footscan", "plate.zip", zipped(8, &[("plate", &plate)]), &none) },
        Sample { unpacked: plate.len(), ..sample("footscan", "plate.gz", gzipped(&plate), &none) },
    ]
}

/// A recorded run of a pad with that many frames.
fn mcap(frames: usize) -> Vec<u8> {
    let text = "[graph]\nclock = \"pad\"\n[roles]\npad = \"tactile_pad\"\n[bind]\npad = \"pad\"\n[devices.pad]\n\
                type = \"mock_pad\"\nrate_hz = 250\n[nodes.source]\ntype = \"tactile_source\"\nin.image = \"pad.image\"\n";
    let request = Request::text(text);
    let plan = compile(&crate::catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(plan);
    // Tests run side by side in one process.
    static NUMBER: AtomicUsize = AtomicUsize::new(0);
    let number = NUMBER.fetch_add(1, Ordering::Relaxed);
    let path = std::env::temp_dir().join(format!("tactflow-sample-{}-{number}.mcap", std::process::id()));
    let record = RecordRequest { request: &request, is_real: false, seed: None, path: None };
    let file = OutputFile::create(&path).expect("a file");
    let mut recorder = RunRecorder::start(file, &mut engine, &record).expect("it can be recorded");
    while let Some(now) = engine.next().filter(|_| engine.ticks() < frames as u64) {
        engine.tick(now).expect("no fault");
        recorder.record(&engine, || true);
    }
    recorder.end(&engine, &End::Duration);
    assert!(recorder.finish(|_| true).error.is_none());
    let bytes = std::fs::read(&path).expect("it was written");
    std::fs::remove_file(path).expect("it is there");
    bytes
}

fn tekscan(frames: usize) -> Vec<u8> {
    let mut text = format!(
        "DATA_TYPE MOVIE\nROWS 3\nCOLS 4\nROW_SPACING 0.127 centimeters\nCOL_SPACING 0.127 centimeters\n\
         NOISE_THRESHOLD 3\nSECONDS_PER_FRAME 0.1\nSTART_FRAME 1\nEND_FRAME {frames}\nUNITS raw\nASCII_DATA @@\n\n"
    );
    for i in 0..frames {
        let (a, b) = (i % 10, i % 7);
        let sum = 5 + a + b + 9 + 8 + 15 + 10;
        let _ = writeln!(text, "Frame {}, {:.1},, 12/2/2019 6:21:52PM,,,Raw Sum=,,{sum}", i + 1, i as f64 / 10.0);
        let _ = write!(text, "B,0,0,5\n0,{a},{b},9\n0,8,15,10\n\n");
    }
    text.push_str("@@\n");
    text.into_bytes()
}

fn novel_lst(frames: usize) -> Vec<u8> {
    let mut text = String::new();
    for i in 1..=frames {
        let _ = write!(
            text,
            "\n\t\t\t\tPage {i}\n\n\tFile: C:\\novel\\2.dat \tMatrix: 64x95 \n\tSensor area: 0.25 cm²\tTime/picture:10.0 ms\n\
             \tMV over frames\n\tSensor size: 0.500x0.500 cm\n\tnovel munich/st.paul/london\n\
             \tPict-No.: {i}  Force[N]=sum*sensor_area in row/column\n\n\t26\t27\t28\tForce\n"
        );
        let cells = [[0.0, (i % 8) as f64 * 10.0, 5.0], [2.5, 0.0, 15.0]];
        let newton = |cells: &[f64]| 0.025 * cells.iter().sum::<f64>();
        for (row, cells) in cells.iter().enumerate() {
            let [a, b, c] = cells;
            let _ = writeln!(text, "{}\t{a:.2}\t{b:.2}\t{c:.2}\t{:.2}", 30 + row, newton(cells));
        }
        let column = |col: usize| newton(&[cells[0][col], cells[1][col]]);
        let total = newton(&cells.concat());
        let _ = write!(text, "Force\t{:.2}\t{:.2}\t{:.2}\t{total:.2}\n\u{c}", column(0), column(1), column(2));
    }
    text.chars().map(|c| c as u32 as u8).collect()
}

/// A mat of two by three sensors of 0.5 cm², of which one is missing and one is pressed.
fn novel_asc(frames: usize) -> Vec<u8> {
    let mut text = "file name: small.mat date/time 17.06.23 15.21\nmat type s2160_001\n\
         total times [secs]: 44.458 time per frame [secs]: 0.04000 scanning rate [Hz]: 25\n\
         pressure values in kPa\n\n\nelectrical:\ntime[secs] 1 2 3 4 5\n"
        .to_owned();
    let moments = || (0..frames).map(|i| (i as f64 * 0.04, (i % 9) as f64 * 10.0));
    for (time, pressure) in moments() {
        let _ = writeln!(text, "{time:.5} 0.000 {pressure:.3} 0.000 0.000 0.000");
    }
    text.push_str("\n\n time[secs] force[N]   x[cm]   y[cm]\n\n");
    for (time, pressure) in moments() {
        let _ = writeln!(text, "{time:.5} {:.3} 0.250 0.500", 0.05 * pressure);
    }
    text.push_str("\n\nsensor 1 2 3 4 5\ncorner[cm]\n");
    for (name, corners) in [
        ("x[0]", "0.0000 0.0000 0.5000 0.5000 1.0000"),
        ("y[0]", "2.0000 1.0000 2.0000 1.0000 2.0000"),
        ("x[1]", "0.0000 0.0000 0.5000 0.5000 1.0000"),
        ("y[1]", "1.0000 0.0000 1.0000 0.0000 1.0000"),
        ("x[2]", "0.5000 0.5000 1.0000 1.0000 1.5000"),
        ("y[2]", "1.0000 0.0000 1.0000 0.0000 1.0000"),
        ("x[3]", "0.5000 0.5000 1.0000 1.0000 1.5000"),
        ("y[3]", "2.0000 1.0000 2.0000 1.0000 2.0000"),
    ] {
        let _ = writeln!(text, "{name} {corners}");
    }
    text.into_bytes()
}

fn zebris(frames: usize) -> Vec<u8> {
    let mut text = format!(
        "Person\tnor, mal\nRecord\tbarfuß\nExercises\t{{\n}}\n\nFrequency,Hz\t100.000\nCount\t{frames}\n\n\
         Platform {{\nColumns\t4\nLines\t2\nCell width,mm\t8.47\nCell height,mm\t8.46\nUnits\tN/cm^2\n\
         Frame count\t{frames}\nFrequency\t100.00\n\n"
    );
    for i in 0..frames {
        let _ = write!(text, "Frame {} {{\nExercise1\nTime, ms\t{}.00\nCenter of force\t(x2,y2)\n\n", i + 1, 10 * i);
        let _ = write!(text, "\tx1\tx2\tx3\tx4\ny1\t0.00\t0.50\t0.00\t0\ny2\t0.25\t{}.50\t0.00\t0\n}}\n", i % 30);
    }
    text.chars().map(|c| c as u32 as u8).collect()
}

/// The real insoles for a few frames, and as many again and again for more.
fn xsensor(frames: usize) -> Vec<u8> {
    let text =
        std::fs::read_to_string(workspace().join("tests/data/recordings/xsensor_insoles.csv")).expect("it ships");
    if frames < 10 {
        return text.into_bytes();
    }
    let (head, frame) = text.split_once("FRAME,1464").expect("its first frame");
    let (frame, _) = frame.split_once("FRAME,1465").expect("its second frame");
    let mut long = head.to_owned();
    for i in 0..frames / 10 {
        let frame = frame.replacen("08:21:17.982", &format!("08:{:02}:{:02}.5", i / 60, i % 60), 1);
        let _ = write!(long, "FRAME,{i}{frame}");
    }
    long.into_bytes()
}

fn footscan(frames: usize) -> Vec<u8> {
    let mut text = String::new();
    for i in 0..frames {
        let _ = write!(text, "Frame {i} ({}.00 ms)\r\n", 8 * i);
        for row in 0..4 {
            let _ = write!(text, "0.0\t{}.4\t0\t{}\r\n", i % 12, row);
        }
        text.push_str("\r\n");
    }
    text.into_bytes()
}

fn csv_rows(frames: usize) -> Vec<u8> {
    let mut text = "# a press\ntime_ms,force,r0c0,r0c1,r1c0,r1c1\n".to_owned();
    for i in 0..frames {
        let _ = writeln!(text, "{},{}.5,1,2,3,{}", 40 * i, i % 9, i % 8);
    }
    text.into_bytes()
}

fn csv_blocks(frames: usize) -> Vec<u8> {
    let mut text = String::new();
    for i in 0..8 * frames {
        let _ = write!(text, "1,{}\n0,7\n\n", i % 10);
    }
    text.into_bytes()
}

fn npy(element: &str, shape: &[usize], data: &[u8]) -> Vec<u8> {
    let shape: Vec<String> = shape.iter().map(|axis| format!("{axis}, ")).collect();
    let mut header = format!("{{'descr': '{element}', 'fortran_order': False, 'shape': ({}), }}", shape.concat());
    while (10 + header.len() + 1) % 64 != 0 {
        header.push(' ');
    }
    header.push('\n');
    [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), data].concat()
}

fn npz(frames: usize, method: u16) -> Vec<u8> {
    let images: Vec<u8> = (0..6 * frames).flat_map(|i| (i as u16 % 999).to_be_bytes()).collect();
    let time: Vec<u8> = (0..frames).flat_map(|i| (i as f64 * 0.02).to_le_bytes()).collect();
    let arrays = [
        ("images.npy", npy(">u2", &[frames, 2, 3], &images)),
        ("time.npy", npy("<f8", &[frames], &time)),
        ("force.npy", npy("<f8", &[frames], &time)),
        ("extra.npy", npy("<f8", &[1], &[0; 8])),
    ];
    let arrays: Vec<(&str, &[u8])> = arrays.iter().map(|(name, bytes)| (*name, &**bytes)).collect();
    zipped(method, &arrays)
}

fn gzipped(bytes: &[u8]) -> Vec<u8> {
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    packed.write_all(bytes).expect("memory can be written");
    packed.finish().expect("memory can be written")
}

/// Returns a zip archive of the members, stored (0) or deflated (8).
///
/// # Panics
/// Never: memory can be written.
#[must_use]
pub fn zipped(method: u16, members: &[(&str, &[u8])]) -> Vec<u8> {
    let (mut archive, mut directory) = (Vec::new(), Vec::new());
    for (name, bytes) in members {
        let mut packed = bytes.to_vec();
        if method == 8 {
            let mut deflated = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::default());
            deflated.write_all(bytes).expect("memory can be written");
            packed = deflated.finish().expect("memory can be written");
        }
        let mut crc = flate2::Crc::new();
        crc.update(bytes);
        let numbers = [crc.sum(), packed.len() as u32, bytes.len() as u32].map(u32::to_le_bytes).concat();
        let name_len = (name.len() as u16).to_le_bytes();
        let common = [&[20, 0, 0, 0], &method.to_le_bytes()[..], &[0; 4], &numbers, &name_len, &[0; 2]].concat();
        let at = (archive.len() as u32).to_le_bytes();
        archive.extend([b"PK\x03\x04", &*common, name.as_bytes(), &packed].concat());
        directory.extend([b"PK\x01\x02\x14\x00", &*common, &[0; 10], &at, name.as_bytes()].concat());
    }
    let (at, size, count) = (archive.len() as u32, directory.len() as u32, members.len() as u16);
    archive.extend(directory);
    archive.extend([b"PK\x05\x06\0\0\0\0", &count.to_le_bytes()[..], &count.to_le_bytes()].concat());
    archive.extend([&size.to_le_bytes()[..], &at.to_le_bytes(), &[0; 2]].concat());
    archive
}

/// How much comes out of what is packed, up to where it is damaged.
#[must_use]
pub fn inflated(bytes: &[u8]) -> usize {
    let mut packed: Box<dyn std::io::Read> = match bytes {
        [0x1f, 0x8b, ..] => Box::new(MultiGzDecoder::new(bytes)),
        [b'P', b'K', 3, 4, ..] if bytes.len() > 30 => {
            let [name, extra] = [26, 28].map(|at| usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]])));
            Box::new(DeflateDecoder::new(bytes.get(30 + name + extra..).unwrap_or(&[])))
        }
        _ => return 0,
    };
    let (mut size, mut out) = (0, [0; 4096]);
    while let Ok(count @ 1..) = packed.read(&mut out) {
        size += count;
    }
    size
}
