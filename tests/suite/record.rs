//! Recordings of whole runs: what is in them, what other readers see, and what is left of one that was cut.

use std::fs;
use std::io::Write;
use std::ops::Range;
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use tactflow_runtime::engine::{self, End, Engine, RunOptions};
use tactflow_runtime::graph::Request;
use tactflow_runtime::random::Random;
use tactflow_runtime::record::OutputFile;
use tactflow_runtime::recording::{RecordRequest, Recording, RunRecorder, recover};
use tactflow_tests::workspace;

use crate::course::loaded;
use crate::replay::{recorded, ticks_of_replay};
use crate::tool::{peer, said, say, tool};

/// Records a graph in this process, in virtual time.
fn record_here(request: &Request, path: &Path, most: usize) -> u64 {
    let mut engine = Engine::new(loaded(request));
    let record = RecordRequest { request, is_real: false, seed: None, path: None };
    let mut recorder = RunRecorder::start(OutputFile::create(path).unwrap(), &mut engine, &record).unwrap();
    while let Some(now) = engine.next().filter(|_| engine.ticks() < most as u64) {
        engine.tick(now).unwrap();
        recorder.record(&engine, || true);
    }
    recorder.end(&engine, &End::Duration);
    let recorded = recorder.finish(|_| true);
    assert!(recorded.error.is_none() && recorded.lost == 0 && recorded.lost_ports == 0, "{recorded:?}");
    recorded.ticks
}

#[test]
fn every_shipped_graph_is_recorded_and_replayed() {
    let folder = tempfile::tempdir().unwrap();
    for graph in tactflow_tests::shipped_graphs() {
        let path = folder.path().join("run.mcap");
        let ticks = record_here(&Request::file(&graph), &path, 400);
        assert_eq!(ticks_of_replay(&path), Ok(ticks), "{}", graph.display());
    }
}

#[test]
fn two_runs_in_virtual_time_have_the_same_ports() {
    let folder = tempfile::tempdir().unwrap();
    let [one, other] = ["one", "other"].map(|name| folder.path().join(name));
    [&one, &other].iter().for_each(|folder| fs::create_dir(folder).unwrap());
    let [one, other] = [one, other].map(|folder| recorded(&folder, &["graphs/finger_press.toml"]));
    let said = say(&["diff", one.to_str().unwrap(), other.to_str().unwrap()]);
    assert_eq!((said.code, said.err.as_str()), (0, ""), "{}", said.out);
    assert!(
        said.out.starts_with("309 ticks, ") && said.out.ends_with(" ports: the same to the last bit\n"),
        "{}",
        said.out
    );
}

#[test]
fn two_runs_that_differ_are_compared_port_by_port() {
    let folder = tempfile::tempdir().unwrap();
    let [one, other] = ["one", "other"].map(|name| folder.path().join(name));
    [&one, &other].iter().for_each(|folder| fs::create_dir(folder).unwrap());
    let one = recorded(&one, &["graphs/hybrid.toml", "--for", "2s"]);
    let other = recorded(&other, &["graphs/hybrid.toml", "--for", "3s", "--set", "nodes.pid.gains.x.kp=2"]);
    let said = say(&["diff", one.to_str().unwrap(), other.to_str().unwrap()]);
    assert_eq!((said.code, said.err.as_str()), (1, ""));
    let rows: Vec<&str> = said.out.lines().filter(|line| line.contains("pid.control ")).collect();
    assert!(said.out.contains("has 501 ticks") && said.out.contains("has 751") && rows.len() == 1, "{}", said.out);
    assert!(said.out.trim_end().ends_with(" ports differ"), "{}", said.out);
}

#[test]
fn an_export_has_the_rows_of_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let [csv, exported, arrays] = ["run.csv", "exported.csv", "arrays.npz"].map(|name| folder.path().join(name));
    let path = recorded(folder.path(), &["graphs/hybrid.toml", "--for", "2s", "--out", csv.to_str().unwrap()]);
    for out in [&exported, &arrays] {
        let said = say(&["export", path.to_str().unwrap(), out.to_str().unwrap()]);
        assert_eq!((said.code, said.err.as_str()), (0, ""));
    }
    let rows = |path: &Path| {
        let text = fs::read_to_string(path).unwrap();
        text.lines().filter(|line| !line.starts_with('#') || line.ends_with(']')).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(rows(&exported), rows(&csv));
    let text = fs::read_to_string(&exported).unwrap();
    assert!(text.contains("# tactflow ") && text.contains("# modes: 0 "), "the file says what it is of");
    if has_python_module("numpy") {
        let out = peer("npz.py", &[arrays.to_str().unwrap(), csv.to_str().unwrap()]);
        assert!(out.starts_with("501 ticks, "), "{out}");
    }
}

/// Whether Python has a module. Prints loudly if not.
pub(crate) fn has_python_module(name: &str) -> bool {
    let found = std::process::Command::new("python3").args(["-c", &format!("import {name}")]).output();
    let is_there = found.is_ok_and(|output| output.status.success());
    if !is_there {
        // The part of the test that needs the module is skipped.
        let _ = writeln!(std::io::stderr(), "SKIPPED: python3 has no module `{name}`: pip install {name}");
    }
    is_there
}

#[test]
fn the_reader_of_foxglove_decodes_every_channel_and_finds_the_numbers_of_the_csv() {
    if !has_python_module("mcap") {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let csv = folder.path().join("run.csv");
    let path = recorded(folder.path(), &["graphs/hybrid.toml", "--for", "2s", "--out", csv.to_str().unwrap()]);
    let out = peer("mcap_reader.py", &[path.to_str().unwrap(), csv.to_str().unwrap()]);
    assert!(out.starts_with("501 ticks, "), "{out}");
}

/// A chunk of a file: its place [bytes], and how many ticks are in it. How many chunks there are depends on how fast the
/// machine is.
struct Chunk {
    place: Range<u64>,
    ticks: usize,
}

impl Chunk {
    /// Returns how many ticks stand in the first bytes of the file, if a chunk has as many bytes for each.
    fn ticks_before(&self, length: usize) -> f64 {
        let there = (length as u64).clamp(self.place.start, self.place.end) - self.place.start;
        there as f64 / (self.place.end - self.place.start) as f64 * self.ticks as f64
    }
}

/// Reads the chunks of a file with another library.
fn chunks(bytes: &[u8]) -> Vec<Chunk> {
    let summary = mcap::Summary::read(bytes).unwrap().expect("it has an index");
    let chunk = |index: &mcap::records::ChunkIndex| {
        let messages = summary.stream_chunk(bytes, index).unwrap().map(Result::unwrap);
        let place = index.chunk_start_offset..index.chunk_start_offset + index.chunk_length;
        Chunk { place, ticks: messages.filter(|message| message.channel.topic == "/tactflow/inputs").count() }
    };
    summary.chunk_indexes.iter().map(chunk).collect()
}

#[test]
fn a_file_that_is_cut_anywhere_opens_and_is_recovered() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let all = record_here(&Request::file(workspace().join("graphs/hybrid.toml")), &path, 300);
    let bytes = fs::read(&path).unwrap();
    let mut recording = Recording::open(&path).unwrap();
    assert!(recording.next_tick().unwrap().is_some());
    // The first tick stands behind the attachments and the channels.
    let data = bytes.windows(16).position(|window| window == b"/tactflow/inputs").unwrap();
    let chunks = chunks(&bytes);
    assert_eq!(chunks.iter().map(|chunk| chunk.ticks).sum::<usize>() as u64, all);
    let mut random = Random::new(18, 0);
    let mut replayed = 0;
    for cut in 0..100 {
        let length = data + random.below(bytes.len() - data);
        let (short, whole) = (folder.path().join("short.mcap"), folder.path().join(format!("whole{cut}.mcap")));
        fs::write(&short, &bytes[..length]).unwrap();
        // What is written before the cut is read: in a chunk, the data are spread evenly over the ticks.
        let expected: f64 = chunks.iter().map(|chunk| chunk.ticks_before(length)).sum();
        let mut recording = match Recording::open(&short) {
            Ok(recording) => recording,
            // The channels stand before the first tick.
            Err(why) if expected < 40.0 && why.contains("was cut before its first tick") => continue,
            Err(why) => panic!("{length} of {} bytes: {why}", bytes.len()),
        };
        let mut ticks = 0;
        while recording.next_tick().unwrap().is_some() {
            ticks += 1;
        }
        assert!((ticks as f64 - expected).abs() < 40.0, "{ticks} ticks in {length} bytes, of {expected}");
        recover(&short, &whole).unwrap();
        let mut recovered = Recording::open(&whole).unwrap();
        let mut again = 0;
        while recovered.next_tick().unwrap().is_some() {
            again += 1;
        }
        assert!(recovered.is_complete() && again == ticks);
        assert!(mcap::Summary::read(&fs::read(&whole).unwrap()).unwrap().is_some(), "it has an index");
        if cut % 20 == 0 {
            assert_eq!(ticks_of_replay(&short), Ok(ticks));
            replayed += ticks;
        }
    }
    assert!(replayed > 100);
}

#[test]
fn a_damaged_recording_never_panics() {
    let folder = tempfile::tempdir().unwrap();
    let [path, damaged] = ["run.mcap", "damaged.mcap"].map(|name| folder.path().join(name));
    record_here(&Request::file(workspace().join("graphs/finger_press.toml")), &path, 40);
    let bytes = fs::read(&path).unwrap();
    // Most of the damage is in the ticks, because the files before them have checksums.
    let data = bytes.windows(16).position(|window| window == b"/tactflow/inputs").unwrap();
    let (mut random, mut refused) = (Random::new(7, 0), 0);
    for round in 0..120 {
        let mut spoilt = bytes.clone();
        let from = if round % 4 == 0 { 0 } else { data };
        for _ in 0..1 + round % 5 {
            let at = from + random.below(bytes.len() - from);
            spoilt[at] ^= 1 << random.below(8);
        }
        fs::write(&damaged, &spoilt).unwrap();
        let replayed = std::panic::catch_unwind(|| ticks_of_replay(&damaged));
        refused += usize::from(replayed.unwrap_or_else(|_| panic!("round {round}")).is_err());
    }
    assert!(refused > 60, "{refused} of 120 are refused or differ");
}

#[cfg(unix)]
#[test]
fn a_run_that_is_killed_loses_at_most_a_second() {
    let folder = tempfile::tempdir().unwrap();
    for (i, after) in [900_u64, 1450, 2210].into_iter().enumerate() {
        let path = folder.path().join(format!("{i}.mcap"));
        let mut command = tool(&["run", "graphs/hybrid.toml", "--realtime", "-q", "--record", path.to_str().unwrap()]);
        let mut child = command.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        // The run has begun once the recording has more than its head.
        let begin = Instant::now();
        let has_begun =
            || Recording::open(&path).is_ok_and(|mut file| file.next_tick().is_ok_and(|tick| tick.is_some()));
        while !has_begun() {
            assert!(begin.elapsed() < Duration::from_secs(30), "the run does not begin");
            std::thread::sleep(Duration::from_millis(10));
        }
        let seen = Instant::now();
        std::thread::sleep(Duration::from_millis(after));
        child.kill().unwrap();
        child.wait().unwrap();
        let lasted = seen.elapsed().as_secs_f64();
        let ticks = ticks_of_replay(&path).unwrap_or_else(|why| panic!("after {after} ms: {why}"));
        assert!(ticks as f64 * 0.004 > lasted - 1.0, "{ticks} ticks in {lasted} s");
    }
}

#[cfg(unix)]
#[test]
fn what_is_written_too_slowly_is_counted_and_the_file_says_from_where() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let request = Request::file(workspace().join("graphs/hybrid.toml"));
    let mut engine = Engine::new(loaded(&request));
    // Nobody reads the pipe until the ring is full.
    let (reader, writer) = std::io::pipe().unwrap();
    let file = fs::File::from(std::os::fd::OwnedFd::from(writer));
    let record = RecordRequest { request: &request, is_real: true, seed: None, path: None };
    let mut recorder = RunRecorder::start(file.into(), &mut engine, &record).unwrap();
    let mut first = None;
    while let Some(now) = engine.next().filter(|_| engine.ticks() < 5000) {
        engine.tick(now).unwrap();
        recorder.record(&engine, || false);
        if recorder.lost() > 0 {
            first = Some(engine.ticks());
            break;
        }
    }
    let first = first.expect("the ring is not endless");
    let copy = path.clone();
    let copying = std::thread::spawn(move || {
        let mut reader = reader;
        std::io::copy(&mut reader, &mut fs::File::create(copy).unwrap()).unwrap()
    });
    std::thread::sleep(Duration::from_millis(500));
    for _ in 0..10 {
        let now = engine.next().unwrap();
        engine.tick(now).unwrap();
        recorder.record(&engine, || false);
    }
    recorder.end(&engine, &End::Duration);
    let recorded = recorder.finish(|_| true);
    copying.join().unwrap();
    assert_eq!((recorded.first_lost, recorded.lost), (Some(first), 1), "{recorded:?}");
    let replayed = ticks_of_replay(&path).unwrap_err();
    assert!(replayed.contains(&format!("cannot be replayed from tick {first} on")), "{replayed}");
    let said = say(&["replay", path.to_str().unwrap(), "-q"]);
    let before =
        format!("the first {} ticks are the same to the last bit; the recording lacks the ports of ", first - 1);
    assert!(said.code == 2 && said.out.contains(&before), "{}{}", said.out, said.err);
    let text = String::from_utf8_lossy(&fs::read(&path).unwrap()).into_owned();
    assert!(text.contains("not_replayable_from_tick"));
}

#[test]
fn a_run_in_real_time_is_replayed_in_virtual_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = recorded(folder.path(), &["graphs/hybrid.toml", "--for", "1s", "--realtime"]);
    let begin = Instant::now();
    let said = say(&["replay", path.to_str().unwrap(), "-q"]);
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    assert!(said.out.ends_with("the same to the last bit\n"), "{}", said.out);
    assert!(begin.elapsed() < Duration::from_secs(20));
    // The file has the time of the wall clock.
    let mut recording = Recording::open(&path).unwrap();
    assert!(recording.next_tick().unwrap().unwrap().time > 1_700_000_000_000_000_000);
}

/// Records a run in real time in this process; how it ended.
pub(crate) fn record_live(engine: &mut Engine, request: &Request, path: &Path, options: &RunOptions) -> End {
    let record = RecordRequest { request, is_real: true, seed: None, path: None };
    let mut recorder = RunRecorder::start(OutputFile::create(path).unwrap(), engine, &record).unwrap();
    let outcome = engine::run(engine, options, &mut |engine| recorder.record(engine, || false)).unwrap();
    recorder.end(engine, &outcome.end);
    let recorded = recorder.finish(|_| true);
    assert!(recorded.error.is_none() && recorded.lost == 0 && recorded.lost_ports == 0, "{recorded:?}");
    outcome.end
}

#[test]
fn an_existing_file_of_another_sort_is_not_overwritten() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("notes.mcap");
    fs::write(&path, "notes of yesterday").unwrap();
    let run = said(&mut tool(&["run", "graphs/finger_press.toml", "-q", "--record", path.to_str().unwrap()]));
    assert!(run.code == 2 && run.err.contains("is not a recording of a whole run"), "{}", run.err);
    assert_eq!(fs::read_to_string(&path).unwrap(), "notes of yesterday");
    let cut = folder.path().join("cut.mcap");
    let run = say(&["recover", path.to_str().unwrap(), cut.to_str().unwrap()]);
    assert!(run.code == 2 && run.err.contains("is no MCAP file") && !cut.exists(), "{}", run.err);
}

/// A graph with a section [record].
fn with_section(section: &str) -> Request {
    let graph = workspace().join("graphs/hybrid.toml");
    let text = fs::read_to_string(&graph).unwrap() + section;
    Request { graph, text: Some(text), ..Request::default() }
}

#[test]
fn the_section_record_selects_ports_and_a_replay_compares_those() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let names = |path: &Path| {
        let recording = Recording::open(path).unwrap();
        recording.channels().values().filter_map(|channel| channel.port.clone()).collect::<Vec<_>>()
    };
    record_here(&with_section("\n[record]\nports = [\"touch.moments.*\", \"pad.image\", \"*.present\"]\n"), &path, 50);
    let ports = names(&path);
    assert!(ports.iter().all(
        |port| port.starts_with("touch.moments.") || ["pad.image", "touch.label.present"].contains(&port.as_str())
    ));
    assert!(ports.len() > 5 && ports.contains(&"pad.image".to_owned()), "{ports:?}");
    assert_eq!(ticks_of_replay(&path), Ok(50));
    let large = fs::metadata(&path).unwrap().len();
    record_here(&with_section("").set("record.images=false"), &path, 50);
    let ports = names(&path);
    assert!(ports.len() > 60 && !ports.contains(&"pad.image".to_owned()), "{ports:?}");
    assert_eq!(ticks_of_replay(&path), Ok(50), "the image is an input, whatever `[record]` says");
    assert!(fs::metadata(&path).unwrap().len() > large / 10);
}

#[test]
fn a_recording_that_is_too_large_goes_on_in_another_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let request = Request::file(workspace().join("graphs/hybrid.toml")).set("record.max_size=1e6");
    let mut engine = Engine::new(loaded(&request));
    let record = RecordRequest { request: &request, is_real: false, seed: None, path: Some(&path) };
    let mut recorder = RunRecorder::start(OutputFile::create(&path).unwrap(), &mut engine, &record).unwrap();
    while let Some(now) = engine.next().filter(|_| engine.ticks() < 200) {
        engine.tick(now).unwrap();
        recorder.record(&engine, || true);
    }
    recorder.end(&engine, &End::Duration);
    let recorded = recorder.finish(|_| true);
    assert!(recorded.error.is_none() && recorded.ticks == 200, "{recorded:?}");
    let sizes: Vec<u64> =
        fs::read_dir(folder.path()).unwrap().map(|file| file.unwrap().metadata().unwrap().len()).collect();
    assert!(sizes.len() >= 3 && sizes.iter().all(|size| *size < 2_000_000), "{sizes:?}");
    assert!(folder.path().join("run.1.mcap").exists());
    assert_eq!(ticks_of_replay(&path), Ok(200), "a replay goes on in the other files");
    fs::remove_file(folder.path().join("run.2.mcap")).unwrap();
    let missing = ticks_of_replay(&path).unwrap_err();
    assert!(missing.contains("the recording goes on in another file") && missing.contains("run.2.mcap"), "{missing}");
}
