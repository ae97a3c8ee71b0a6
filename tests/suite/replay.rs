//! A recorded run is repeated to the last bit, in another process and without its devices. A replay of another graph names
//! the first difference.

use std::fs;
use std::path::{Path, PathBuf};

use tactflow_runtime::recording::{Replay, ReplayChanges, ReplayedTick};
use tactflow_tests::{catalogue, workspace};

use crate::tool::{Said, say};

/// Records a run of the tool to a file.
pub(crate) fn recorded(folder: &Path, args: &[&str]) -> PathBuf {
    let path = folder.join("run.mcap");
    let run = say(&[&["run"], args, &["-q", "--record", path.to_str().unwrap()]].concat());
    assert_eq!(run.code, 0, "{args:?}: {}", run.err);
    path
}

/// Replays a recording by the tool.
fn replay(path: &Path, args: &[&str]) -> Said {
    say(&[&["replay", path.to_str().unwrap()], args].concat())
}

/// Replays a recording in this process. Returns the number of ticks, if all of them are the same.
pub(crate) fn ticks_of_replay(path: &Path) -> Result<u64, String> {
    let replay = Replay::open(&catalogue(), path, &ReplayChanges::default());
    let mut replay = replay.map_err(|_| "it does not load".to_owned())?;
    loop {
        match replay.step()? {
            ReplayedTick::Over | ReplayedTick::Fault(_) => return Ok(replay.ticks()),
            ReplayedTick::Ran(true) => {}
            ReplayedTick::Ran(false) => return Err(format!("{:?}", replay.differences().ports)),
        }
    }
}

#[test]
fn a_run_comes_again_to_the_last_bit_in_another_process() {
    let cases: [(&[&str], &str); 3] = [
        (&["graphs/finger_press.toml"], "309 ticks"),
        (&["graphs/hybrid.toml", "--for", "3s", "--set", "nodes.pid.gains.x.kp=3"], "751 ticks"),
        (&["graphs/hybrid.toml", "--for", "2s", "--send", "0.8s:stop", "--send", "1.2s:resume"], "501 ticks"),
    ];
    for (args, ticks) in cases {
        let folder = tempfile::tempdir().unwrap();
        let path = recorded(folder.path(), args);
        let said = replay(&path, &["-q"]);
        assert_eq!(said.code, 0, "{args:?}: {}", said.err);
        let promise = format!("run.mcap: {ticks}, ");
        assert!(
            said.out.contains(&promise) && said.out.ends_with(" ports: the same to the last bit\n"),
            "{}",
            said.out
        );
    }
}

#[test]
fn a_recording_needs_no_file_of_the_graph() {
    let folder = tempfile::tempdir().unwrap();
    let copy = folder.path().join("graphs");
    copy_folder(&workspace().join("graphs"), &copy);
    let path = recorded(folder.path(), &[copy.join("hybrid.toml").to_str().unwrap(), "--for", "1s"]);
    fs::remove_dir_all(&copy).unwrap();
    let said = replay(&path, &["-q"]);
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    assert!(said.out.contains("251 ticks"), "{}", said.out);
}

fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let path = entry.unwrap().path();
        let target = to.join(path.file_name().unwrap());
        if path.is_dir() {
            copy_folder(&path, &target);
        } else {
            fs::copy(&path, &target).unwrap();
        }
    }
}

/// The first tick in which a column of the CSV file of a run is a number and not zero.
fn first_number(csv: &Path, name: &str) -> usize {
    let is_zero = |cell: &String| ["", "0.0", "-0.0"].contains(&cell.as_str());
    column(csv, name).iter().position(|cell| !is_zero(cell)).unwrap() + 1
}

/// The cells of a column in the CSV file of a run.
fn column(csv: &Path, name: &str) -> Vec<String> {
    let text = fs::read_to_string(csv).unwrap();
    let mut lines = text.lines().skip_while(|line| line.starts_with('#'));
    let at = lines.next().unwrap().split(',').position(|column| column == name).unwrap();
    lines.map(|line| line.split(',').nth(at).unwrap().to_owned()).collect()
}

#[test]
fn another_gain_is_told_apart_at_the_first_tick_with_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let csv = folder.path().join("run.csv");
    let path = recorded(folder.path(), &["graphs/hybrid.toml", "--for", "3s", "--out", csv.to_str().unwrap()]);
    // The gain multiplies the error of the pressure: the control differs from the first tick on in which it is not zero.
    let first = first_number(&csv, "pid.control.pressure");
    let said = replay(&path, &["-q", "--set", "nodes.pid.gains.pressure.kp=0.4"]);
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    assert!(said.out.starts_with("open loop: "), "{}", said.out);
    let row = said.out.lines().find(|line| line.trim_start().starts_with("pid.control ")).unwrap();
    assert_eq!(row.split_whitespace().nth(1), Some(first.to_string().as_str()), "{row}");
    assert!(row.contains("`pressure`: "), "{row}");
    let untouched = ["error.error ", "touch.", "pad.image "];
    assert!(untouched.iter().all(|port| !said.out.lines().any(|line| line.starts_with(port))), "{}", said.out);
}

/// Writes a recording again, with a text of its attachments replaced.
fn edited(path: &Path, from: &str, to: &str) -> PathBuf {
    let bytes = fs::read(path).unwrap();
    let edited = path.with_file_name("edited.mcap");
    let mut writer = mcap::Writer::new(fs::File::create(&edited).unwrap()).unwrap();
    let mut changed = 0;
    for record in mcap::read::ChunkFlattener::new(&bytes).unwrap() {
        match record.unwrap() {
            mcap::records::Record::Attachment { header, data, .. } => {
                let text = String::from_utf8_lossy(&data);
                changed += text.matches(from).count();
                let data = text.replace(from, to).into_bytes().into();
                let (name, media_type) = (header.name, header.media_type);
                writer.attach(&mcap::Attachment { log_time: 0, create_time: 0, name, media_type, data }).unwrap();
            }
            mcap::records::Record::Schema { header, data } => {
                writer.add_schema_with_id(header.id, &header.name, &header.encoding, &data).unwrap();
            }
            mcap::records::Record::Channel(channel) => {
                let mcap::records::Channel { id, schema_id, topic, message_encoding, metadata } = channel;
                writer.add_channel_with_id(id, schema_id, &topic, &message_encoding, &metadata).unwrap();
            }
            mcap::records::Record::Message { header, data } => writer.write_to_known_channel(&header, &data).unwrap(),
            mcap::records::Record::Metadata(metadata) => writer.write_metadata(&metadata).unwrap(),
            mcap::records::Record::DataEnd(_) => break,
            _ => {}
        }
    }
    writer.finish().unwrap();
    assert_eq!(changed, 1, "`{from}` stands in one attachment");
    edited
}

#[test]
fn a_replay_that_differs_names_the_tick_the_port_and_the_component_and_ends_with_1() {
    let folder = tempfile::tempdir().unwrap();
    let csv = folder.path().join("run.csv");
    let path = recorded(folder.path(), &["graphs/hybrid.toml", "--for", "3s", "--out", csv.to_str().unwrap()]);
    let first = first_number(&csv, "pid.control.pressure");
    let said = replay(&edited(&path, "gains.pressure = { kp = 0.5", "gains.pressure = { kp = 0.6"), &["-q"]);
    assert_eq!((said.code, said.out.as_str()), (1, ""));
    let place = format!(" from tick {first} at ");
    assert!(said.err.contains(&place) && said.err.contains("`pid.control` differs"), "{}", said.err);
    assert!(said.err.contains("`pressure`: "), "{}", said.err);
}

#[test]
fn a_part_of_a_replay_is_that_part_of_the_run() {
    let folder = tempfile::tempdir().unwrap();
    let (whole, part) = (folder.path().join("whole.csv"), folder.path().join("part.csv"));
    let path = recorded(folder.path(), &["graphs/hybrid.toml", "--for", "3s", "--out", whole.to_str().unwrap()]);
    let said = replay(&path, &["--from", "1s", "--for", "500ms", "--out", part.to_str().unwrap()]);
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    assert!(said.out.contains(" 126 ticks, "), "{}", said.out);
    let rows = |path: &Path| fs::read_to_string(path).unwrap().lines().map(str::to_owned).collect::<Vec<_>>();
    let (whole, part) = (rows(&whole), rows(&part));
    let is_in = |row: &&String| row.split(',').next().unwrap().parse::<f64>().is_ok_and(|t| (1.0..=1.5).contains(&t));
    assert!(
        whole.iter().filter(is_in).eq(part.iter().filter(|row| row.starts_with("1."))),
        "the rows are those of the run"
    );
    assert_eq!(part.iter().filter(is_in).count(), 126);
}

#[test]
fn another_graph_runs_on_the_recorded_inputs() {
    let folder = tempfile::tempdir().unwrap();
    let path = recorded(folder.path(), &["graphs/hybrid.toml", "--for", "1.3s"]);
    let same = replay(&path, &["-q", "--graph", "graphs/hybrid.toml"]);
    assert_eq!((same.code, same.err.as_str()), (0, ""));
    assert!(same.out.contains("326 ticks") && same.out.ends_with("the same to the last bit\n"), "{}", same.out);
    let other = replay(&path, &["-q", "--graph", "graphs/position.toml"]);
    assert_eq!((other.code, other.err.as_str()), (0, ""), "{}", other.out);
    assert!(
        other.out.contains("only in the recording: ") && other.out.contains("differ from the recording"),
        "{}",
        other.out
    );
}

#[test]
fn what_is_no_recording_and_what_has_no_effect_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = recorded(folder.path(), &["graphs/finger_press.toml"]);
    let text = folder.path().join("text.mcap");
    fs::write(&text, "no recording at all").unwrap();
    let head = folder.path().join("head.mcap");
    fs::write(&head, &fs::read(&path).unwrap()[..60]).unwrap();
    let notes = folder.path().join("notes.csv");
    fs::write(&notes, "notes of yesterday").unwrap();
    let (run, notes) = (path.to_str().unwrap(), notes.to_str().unwrap());
    let cases: [(&[&str], &str); 9] = [
        (&["replay", run, "--out", notes], "is not a recording of a run, so it is not overwritten"),
        (&["export", run, notes], "is not an export, so it is not overwritten"),
        (&["export", run, "run.txt"], "does not end in .csv or .npz: write for example `run.npz`"),
        (&["diff", run, "/nowhere.mcap"], "cannot open `/nowhere.mcap`"),
        (&["replay", "/nowhere.mcap"], "cannot open `/nowhere.mcap`"),
        (&["replay", text.to_str().unwrap()], "is no MCAP file"),
        (&["replay", head.to_str().unwrap()], "is no recording of tactflow, or was cut at its start"),
        (
            &["replay", path.to_str().unwrap(), "--set", "devices.pad.noise=1"],
            "has no effect: a replay uses the recorded inputs",
        ),
        (
            &["run", "graphs/finger_press.toml", "--record", "run.csv"],
            "does not end in .mcap: write for example `--record run.mcap`",
        ),
    ];
    for (args, message) in cases {
        let said = say(args);
        assert_eq!((said.code, said.out.as_str()), (2, ""), "{args:?}");
        assert!(said.err.contains(message), "{args:?}: {}", said.err);
    }
    let wrong = replay(&path, &["--set", "nodes.nothing.gain=1"]);
    assert!(wrong.code == 2 && wrong.err.contains("`nothing`"), "{}", wrong.err);
}

#[test]
fn the_runs_of_scenarios_come_again() {
    // With files of three folders, with parameters that vary, on the scripted bench, and with a fault as the end.
    let shipped = ["graphs/scenarios/noise.toml", "graphs/scenarios/edge_turns.toml"];
    let own = ["tests/scenarios/slide.toml", "tests/scenarios/mock.toml", "tests/scenarios/fault.toml"];
    for scenario in shipped.into_iter().chain(own) {
        let folder = tempfile::tempdir().unwrap();
        let run = say(&["verify", scenario, "--seeds", "1", "--record", folder.path().to_str().unwrap()]);
        assert_ne!(run.code, 2, "{scenario}: {}", run.err);
        let files: Vec<PathBuf> = fs::read_dir(folder.path()).unwrap().map(|file| file.unwrap().path()).collect();
        assert_eq!(files.len(), 1, "{scenario}");
        let said = replay(&files[0], &["-q"]);
        assert_eq!(said.code, 0, "{scenario}: {}", said.err);
        assert!(said.out.ends_with(" ports: the same to the last bit\n"), "{scenario}: {}", said.out);
    }
}
