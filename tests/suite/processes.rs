//! Programs in other languages, as nodes beside the tick and as pads: docs/processes.md.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use tactflow_runtime::engine::{Engine, RunOptions, run};
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::signal::{Freshness, Image, VectorImage};
use tactflow_tests::{catalogue, workspace};

use crate::cli::in_new_folder;
use crate::control_law::rows;
use crate::record::has_python_module;
use crate::tool::{Said, said, tool};

const GRAPH: &str = "tests/data/process.toml";
const HYBRID: &str = "nodes/python/examples/hybrid.toml";

/// The setting that makes the program do one thing wrong at its third question.
fn program(wrong: &str) -> String {
    format!(r#"nodes.program.command=["python3", "../peers/broken_program.py", "{wrong}", "3"]"#)
}

/// The setting with which a Python example finds the package without an installation.
fn python(block: &str, script: &str) -> String {
    let package = workspace().join("nodes/python");
    format!(r#"{block}.command=["env", "PYTHONPATH={}", "python3", "{script}"]"#, package.display())
}

fn run_with(settings: &[&str], more: &[&str]) -> Said {
    let mut args = vec!["run", GRAPH];
    args.extend(settings.iter().flat_map(|setting| ["--set", setting]));
    args.extend(more);
    said(&mut tool(&args))
}

/// Runs a graph in the engine.
fn observe(request: &Request, options: &RunOptions, see: &mut dyn FnMut(&Engine)) {
    let compiled = compile(&catalogue(), request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(compiled);
    run(&mut engine, options, see).expect("the drivers start");
}

#[test]
fn an_answer_is_there_one_tick_later_and_has_the_stamp_of_its_question() {
    let mut before = None;
    let mut answers = 0;
    observe(&Request::file(workspace().join(GRAPH)), &RunOptions::default(), &mut |engine| {
        if let (Some((sum, stamp)), Some(answer)) = (before, engine.get::<f64>("program.sum")) {
            let expected: f64 = sum;
            assert!((answer - expected).abs() < 1e-6, "{answer} for {expected}");
            assert_eq!(engine.mark("program.sum").stamp().nanos, stamp);
            answers += 1;
        }
        let stamp = engine.mark("source.sum").stamp().nanos;
        before = engine.get::<f64>("source.sum").map(|sum| (*sum, stamp));
    });
    assert_eq!(answers, 149);
}

#[test]
fn a_recording_replays_without_the_program() {
    let (folder, graph) = in_new_folder("process.toml");
    let copy = |from: &str, to: &str| fs::copy(workspace().join(from), folder.path().join(to)).unwrap();
    copy(GRAPH, "process.toml");
    copy("tests/data/broken.node.toml", "broken.node.toml");
    copy("tests/peers/broken_program.py", "program.py");
    let command = r#"nodes.program.command=["python3", "program.py", "right", "3"]"#;
    let recordings = ["a.mcap", "b.mcap"].map(|name| folder.path().join(name).display().to_string());
    for recording in &recordings {
        let recorded = said(&mut tool(&["run", &graph, "--set", command, "--record", recording]));
        assert_eq!((recorded.code, recorded.err.as_str()), (0, ""), "{}", recorded.out);
    }
    let [first, second] = &recordings;
    // Where a file has the borders of its chunks depends on the time of the machine: its messages do not.
    let compared = said(&mut tool(&["diff", first, second]));
    assert_eq!((compared.code, compared.err.as_str()), (0, ""), "two runs are the same: {}", compared.out);
    for name in ["program.py", "broken.node.toml"] {
        fs::remove_file(folder.path().join(name)).unwrap();
    }
    let replayed = said(&mut tool(&["replay", first]));
    assert_eq!(replayed.code, 0, "{}{}", replayed.out, replayed.err);
    assert!(replayed.out.contains("the same to the last bit"), "{}", replayed.out);
}

/// What each program does wrong, and what is said of it.
const BROKEN: [(&str, &str); 18] = [
    ("crash", "device `program` failed: it ended: exit status: 1; it said `ZeroDivisionError: the mean of nothing`"),
    ("killed", "it ended: signal: 9 (SIGKILL)"),
    ("hang", "no answer within 400 ms (`timeout_ms`): it hangs"),
    ("deaf", "no answer within 400 ms (`timeout_ms`): it hangs"),
    ("flood", "it answers question 3, and 4 was asked"),
    ("size", "output `sum`: the frame is too short for it"),
    ("huge", "it sends a frame of 2147483648 bytes, and a frame of its outputs has at most 9"),
    ("nan", "`program.sum` is not a finite number"),
    ("garbage", "it sends bytes that are no frame: 80 81 82 83"),
    ("print", "it writes text instead of a frame: `x is 0.123456789"),
    ("number", "it answers question 10, and 3 was asked"),
    ("stamp", "its answer 3 has the stamp 8000001, and the question had 8000000"),
    ("half", "it ended in the middle of a frame"),
    ("version", "it speaks version 2 of the protocol, and this tool speaks version 1"),
    (
        "port",
        "the program has no output `sum`, and the file has one: write the file once more with `tactflow signature",
    ),
    ("unit", "the output `sum` is scalar in kPa in the program, and scalar in N in the file"),
    ("no_module", "it said `ModuleNotFoundError: No module named 'no_such_module'`"),
    ("chatty", "its first line is no signature"),
];

#[test]
fn whatever_a_program_does_wrong_is_named() {
    for (wrong, why) in BROKEN {
        let failed = run_with(&[&program(wrong)], &[]);
        assert_eq!(failed.code, 1, "{wrong}: {}", failed.out);
        assert!(failed.err.contains(why), "{wrong}: {}", failed.err);
    }
    let silent = run_with(&[&program("silent"), "nodes.program.start_s=0.5"], &[]);
    assert!(silent.err.contains("it has not stated its signature within 0.5 s"), "{}", silent.err);
    let missing = run_with(&[r#"nodes.program.command=["no_such_program"]"#], &[]);
    assert!(missing.err.contains("cannot start `no_such_program` in `tests/data`: No such file"), "{}", missing.err);
}

#[test]
fn in_real_time_the_policy_decides_and_a_program_is_started_once_more() {
    let real = ["--realtime", "--for", "1.5s"];
    let long = "devices.pad.for_s=5.0";
    for wrong in ["crash", "flood", "print"] {
        let failed = run_with(&[&program(wrong), long], &real);
        assert_eq!(failed.code, 1, "{wrong}: {}", failed.out);
        assert!(failed.err.contains("device `program` failed: it "), "{wrong}: {}", failed.err);
        let again = run_with(&[&program(wrong), long, "nodes.program.restart=true"], &real);
        assert_eq!(again.code, 0, "{wrong}: {}", again.err);
        assert!(again.out.contains(" restarts"), "{wrong}: {}", again.out);
    }
    let held = run_with(&[&program("crash"), long, "policy.device=hold"], &real);
    assert_eq!(held.code, 0, "{}", held.err);
}

#[cfg(target_os = "linux")]
#[test]
fn no_process_stays_behind_however_the_run_ends() {
    for is_killed in [false, true] {
        let (folder, file) = in_new_folder("pids");
        let command =
            format!(r#"nodes.program.command=["python3", "../peers/broken_program.py", "grandchild", "3", "{file}"]"#);
        let setting = ["devices.pad.for_s=60.0", &command];
        let mut args = vec!["run", GRAPH, "--realtime", "--for", if is_killed { "60s" } else { "1s" }];
        args.extend(setting.iter().flat_map(|setting| ["--set", setting]));
        let mut run = tool(&args).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap();
        let pids: Vec<String> = wait_for(|| {
            let text = fs::read_to_string(&file).ok()?;
            let pids: Vec<String> = text.split_whitespace().map(str::to_owned).collect();
            (pids.len() == 2).then_some(pids)
        });
        let is_there = |pid: &str| {
            let stat = fs::read_to_string(format!("/proc/{pid}/stat")).unwrap_or_default();
            // One that has ended and waits for its parent is not there.
            stat.rsplit(')').next().is_some_and(|rest| !rest.trim().is_empty() && !rest.trim().starts_with('Z'))
        };
        assert!(pids.iter().all(|pid| is_there(pid)), "both run: {pids:?}");
        if is_killed {
            run.kill().unwrap();
        }
        run.wait().unwrap();
        wait_for(|| pids.iter().all(|pid| !is_there(pid)).then_some(()));
        drop(folder);
    }
}

#[test]
fn an_answer_that_takes_too_long_is_counted_and_names_its_period() {
    let slow = run_with(&[&program("slow")], &["--realtime"]);
    let wanted = "so its values are older than 5 times `period_ms` (20 ms) before the next ones come";
    assert_eq!(slow.err.matches(wanted).count(), 1, "{}", slow.err);
    assert!(slow.out.contains("slow answers"), "{}", slow.out);
    let known = run_with(&[&program("slow"), "nodes.program.period_ms=160"], &["--realtime"]);
    assert!(!known.err.contains(wanted) && !known.out.contains("slow answers"), "{}{}", known.out, known.err);
}

/// Waits until something is there.
fn wait_for<T>(mut get: impl FnMut() -> Option<T>) -> T {
    let end = Instant::now() + Duration::from_secs(10);
    loop {
        match get() {
            Some(got) => return got,
            None => assert!(Instant::now() < end, "it does not come"),
        }
        sleep(Duration::from_millis(10));
    }
}

#[test]
fn a_check_runs_nothing_and_reports_what_does_not_fit() {
    let (folder, marker) = in_new_folder("marker");
    let check = |settings: &[&str]| {
        let mut args = vec!["check", GRAPH];
        args.extend(settings.iter().flat_map(|setting| ["--set", setting]));
        said(&mut tool(&args))
    };
    let harmless = check(&[&format!(r#"nodes.program.command=["touch", "{marker}"]"#)]);
    assert_eq!((harmless.code, harmless.err.as_str()), (0, ""));
    assert!(!folder.path().join("marker").exists(), "a check must run nothing from a graph");
    for (setting, why) in [
        ("nodes.program.signature=no.node.toml", "write it with `tactflow signature -- PROGRAM`"),
        ("nodes.program.params.gian=2.0", "`broken` has no parameter `gian`"),
        ("nodes.program.in.imag=source.image", "`program` has no input `imag`"),
        ("nodes.program.in.image=source.sum", "`source.sum` is a scalar, but `program.image` takes an image"),
        ("nodes.program.command=[]", "there is no program to run"),
        ("nodes.program.signature=tests/data/process.toml", "`process.toml` is no signature of a program"),
        ("graph.clock=program", "`program` computes beside the tick, so it cannot trigger the ticks"),
        ("nodes.program.threshold=0.1", "`threshold` is for a pad, and `broken` has inputs"),
        ("nodes.pad.type=process", "the bench has a device or a binding with the name `pad`"),
    ] {
        let refused = check(&[setting]);
        assert_eq!(refused.code, 2, "{setting}: {}", refused.out);
        assert!(refused.err.contains(why), "{setting}: {}", refused.err);
    }
}

#[test]
fn a_program_is_no_arm() {
    let (folder, file) = in_new_folder("arm.node.toml");
    let text = "tactflow = 1\nname = \"arm\"\n[[outputs]]\nname = \"velocity\"\nkind = \"joints\"\n";
    fs::write(&file, text).unwrap();
    let bench = folder.path().join("bench.toml");
    let text =
        "[bind]\npad = \"p\"\n[devices.p]\ntype = \"process\"\ncommand = [\"true\"]\nsignature = \"arm.node.toml\"\n";
    fs::write(&bench, text).unwrap();
    let refused = said(&mut tool(&["check", "graphs/look.toml", "--bench", bench.to_str().unwrap()]));
    assert_eq!(refused.code, 2, "{}", refused.out);
    assert!(refused.err.contains("no motion of an arm, because nothing outside of it would stop"), "{}", refused.err);
}

#[test]
fn the_hybrid_task_is_as_good_with_its_features_in_python() {
    if !has_python_module("numpy") {
        return;
    }
    let (folder, scenario) = in_new_folder("table3.toml");
    let text = fs::read_to_string(workspace().join("graphs/scenarios/table3_ball.toml")).unwrap();
    let root = workspace().display();
    let text = text.replace("../hybrid.toml", &format!("{root}/{HYBRID}"));
    let text = text.replace("../benches/", &format!("{root}/graphs/benches/")).replace("seeds = 10", "seeds = 2");
    fs::write(&scenario, text).unwrap();
    let package = workspace().join("nodes/python");
    let verified = said(tool(&["verify", &scenario]).env("PYTHONPATH", package));
    drop(folder);
    assert_eq!(verified.code, 0, "{}{}", verified.out, verified.err);
}

#[test]
fn in_real_time_a_tick_waits_for_no_program_and_its_answers_are_young() {
    if !has_python_module("numpy") {
        return;
    }
    let request = Request::file(workspace().join(HYBRID)).set(python("nodes.contact", "contact.py"));
    let options = RunOptions { duration: Some(3.0), is_realtime: true, ..RunOptions::default() };
    let mut ages = Vec::new();
    observe(&request, &options, &mut |engine| {
        let mark = engine.mark("contact.x");
        if mark.freshness(engine.ticks() - 1) == Freshness::New || mark.freshness(engine.ticks()) == Freshness::New {
            ages.push(mark.stamp().age(engine.now()) as f64 * 1e-6);
        }
    });
    ages.sort_by(f64::total_cmp);
    let at = |part: f64| ages[(part * (ages.len() - 1) as f64) as usize];
    let found = format!("{:.1} ms at the median, {:.1} ms at 99 %, of {} answers", at(0.5), at(0.99), ages.len());
    assert!(ages.len() > 100 && at(0.5) < 50.0, "{found}");
}

#[test]
fn what_signature_says_can_be_pasted() {
    let (folder, out) = in_new_folder("stated.node.toml");
    // Arguments with a space, with quotes and with a line break.
    let line = r#"{"tactflow": 1, "name": "odd", "inputs": [{"name": "image", "kind": "image"}], "outputs": [{"name": "is_there", "kind": "flag"}]}"#;
    let command = ["sh", "-c", "printf '%s\n' \"$1\"; read line", "it's \"here\"\nand there", line];
    let stated = said(tool(&["signature", "--out", &out, "--"]).args(command));
    assert_eq!((stated.code, stated.err.as_str()), (0, ""), "{}", stated.out);
    let (_, block) = stated.out.split_once("use it with\n\n").unwrap();
    let block: toml::Table = block.parse().unwrap();
    let pasted = &block["nodes"]["odd"];
    assert_eq!(pasted["command"], toml::Value::from(command.map(str::to_owned).to_vec()));
    assert_eq!(pasted["signature"].as_str(), Some("stated.node.toml"));
    let written = fs::read_to_string(&out).unwrap();
    assert!(written.parse::<toml::Table>().is_ok(), "{written}");
    drop(folder);
}

#[test]
fn the_python_package_states_runs_and_reads() {
    if !has_python_module("numpy") {
        return;
    }
    let examples = workspace().join("nodes/python/examples");
    let package = workspace().join("nodes/python");
    for path in ["contact", "wave_pad", "slip/slip"] {
        let name = Path::new(path).file_name().unwrap().display();
        let (folder, out) = in_new_folder("stated.node.toml");
        // It runs in the folder of its signature.
        fs::copy(examples.join(format!("{path}.py")), folder.path().join("program.py")).unwrap();
        let mut stated = tool(&["signature", "--out", &out, "--", "python3", "program.py"]);
        let stated = said(stated.env("PYTHONPATH", &package));
        assert_eq!((stated.code, stated.err.as_str()), (0, ""), "{}", stated.out);
        let body = |text: String| text.lines().skip(1).map(str::to_owned).collect::<Vec<_>>();
        let written = body(fs::read_to_string(&out).unwrap());
        let shipped = body(fs::read_to_string(examples.join(format!("{path}.node.toml"))).unwrap());
        assert_eq!(written, shipped, "{name}.node.toml is not what the example states");
    }
    let look = ["run", "nodes/python/examples/look.toml", "--for", "1s"];
    let look = said(tool(&look).env("PYTHONPATH", &package));
    assert_eq!(look.code, 0, "{}{}", look.out, look.err);
    assert!(look.out.contains("touch.image: 8x8 tactels"), "{}", look.out);
    if !has_python_module("mcap") {
        return;
    }
    let (folder, recording) = in_new_folder("run.mcap");
    let recorded = ["run", HYBRID, "--for", "2s", "--record", &recording];
    let recorded = said(tool(&recorded).env("PYTHONPATH", &package));
    assert_eq!(recorded.code, 0, "{}", recorded.err);
    let mut read = Command::new("python3");
    read.arg(workspace().join("tests/peers/read_recording.py")).arg(&recording).env("PYTHONPATH", &package);
    let read = said(&mut read);
    assert_eq!((read.code, read.err.as_str()), (0, ""), "{}", read.out);
    let try_alone = |wires: &[&str]| {
        let mut alone = Command::new("python3");
        alone.arg(examples.join("contact.py")).args(["--test", &recording]).args(wires);
        said(alone.env("PYTHONPATH", &package))
    };
    let tried = try_alone(&["--wire", "image=touch.calibrate.image", "--wire", "region=touch.label.region"]);
    assert!(tried.code == 0 && tried.err.is_empty(), "{}{}", tried.out, tried.err);
    assert!(tried.out.lines().last().unwrap().contains(" frames; "), "{}", tried.out);
    let pressures = tried.out.lines().filter_map(|line| line.split_whitespace().last()?.parse::<f64>().ok());
    let pressures: Vec<f64> = pressures.collect();
    // The last answer of the run was that to one of the last frames.
    let script = "import sys, tactflow; print(tactflow.open(sys.argv[1])['contact.pressure'].values[-1])";
    let mut in_run = Command::new("python3");
    let in_run = said(in_run.args(["-c", script, &recording]).env("PYTHONPATH", &package));
    let in_run: f64 = in_run.out.trim().parse().unwrap();
    let is_there = |pressure: &f64| (pressure - in_run).abs() < 1e-5 * in_run;
    assert!(pressures.iter().rev().take(3).any(is_there), "{in_run} N/tactel, and {pressures:?}");
    drop(folder);
}

/// A pad with three axes, and a node that turns its drag around.
const THREE_AXES: &str = r#"
import time
import numpy as np
import tactflow
from tactflow import VectorImage, node


@node
def turn(vectors: VectorImage["N"]) -> {"turned": VectorImage("N", 2, 3, (0.004, 0.004))}:
    """The drag the other way around."""
    return vectors.cells * np.array([-1, -1, 1])


def frames():
    while True:
        cells = np.arange(18, dtype=np.float32).reshape(2, 3, 3)
        yield time.monotonic_ns(), cells
        time.sleep(0.005)


import sys
if "pad" in sys.argv:
    tactflow.pad(frames(), "skin", unit="N", rows=2, cols=3, pitch=(0.004, 0.004), axes=3)
else:
    tactflow.main(turn, [])
"#;

#[test]
fn a_program_is_a_pad_with_three_axes_and_another_gives_a_vector_image() {
    if !has_python_module("numpy") {
        return;
    }
    let package = workspace().join("nodes/python");
    let (folder, graph) = in_new_folder("graph.toml");
    fs::write(folder.path().join("program.py"), THREE_AXES).unwrap();
    for name in ["pad", "turn"] {
        let out = folder.path().join(format!("{name}.node.toml"));
        let mut stated = tool(&["signature", "--out", out.to_str().unwrap(), "--", "python3", "program.py", name]);
        let stated = said(stated.env("PYTHONPATH", &package));
        assert_eq!((stated.code, stated.err.as_str()), (0, ""), "{}", stated.out);
    }
    let command = |name: &str| {
        let path = format!("PYTHONPATH={}", package.display());
        format!("command = {:?}\nsignature = \"{name}.node.toml\"\n", ["env", &path, "python3", "program.py", name])
    };
    let text = format!(
        "graph.clock = 'pad'\nroles.pad = 'three_axis_pad'\nbind.pad = 'skin'\n\
         [devices.skin]\ntype = 'process'\nperiod_ms = 5.0\n{}\
         [nodes.program]\ntype = 'process'\nin.vectors = 'pad.vectors'\n{}\
         [nodes.normal]\ntype = 'normal_image'\nin.vectors = 'program.turned'\n",
        command("pad"),
        command("turn")
    );
    fs::write(&graph, text).unwrap();
    let expected: Vec<f32> = (0..18u8).map(f32::from).collect();
    let turned: Vec<[f32; 3]> = expected.chunks(3).map(|cell| [-cell[0], -cell[1], cell[2]]).collect();
    let normal: Vec<f32> = turned.iter().map(|cell| cell[2]).collect();
    let mut answers = 0;
    let options = RunOptions { duration: Some(3.0), ..RunOptions::default() };
    observe(&Request::file(graph), &options, &mut |engine| {
        let Some(there) = engine.get::<VectorImage>("program.turned") else { return };
        assert_eq!(there.cells(), turned);
        assert_eq!(engine.get::<VectorImage>("pad.vectors").unwrap().cells().as_flattened(), expected);
        assert_eq!(engine.get::<Image>("pad.image").unwrap().cells(), normal);
        assert_eq!(engine.get::<Image>("normal.image").unwrap().cells(), normal);
        answers += 1;
    });
    assert!(answers > 10, "{answers} ticks with an answer");
    drop(folder);
}

#[test]
fn a_network_in_python_sees_the_object_slip() {
    if !has_python_module("numpy") {
        return;
    }
    let (_folder, csv) = in_new_folder("run.csv");
    let graph = "nodes/python/examples/slip/slip.toml";
    let ran = ["run", graph, "--quiet", "--set", "devices.bench.seed=77", "--out", &csv];
    let ran = said(tool(&ran).env("PYTHONPATH", workspace().join("nodes/python")));
    assert_eq!(ran.code, 0, "{}", ran.err);
    let rows = rows(&csv);
    // How often it says so from a time of the graph to another one [s].
    let share = |from: f64, to: f64| {
        let during = rows.iter().filter(|row| row["time"] >= from && row["time"] < to);
        let said: Vec<f64> = during.map(|row| row["slip.slips"]).collect();
        said.iter().sum::<f64>() / said.len() as f64
    };
    // The ball is drawn along the pad, slowly and fast.
    assert!(share(4.4, 5.6) > 0.9 && share(7.1, 7.9) > 0.9, "{} and {}", share(4.4, 5.6), share(7.1, 7.9));
    // It rests, and it is pushed against the pad.
    for (from, to) in [(2.0, 4.0), (6.3, 7.0), (8.2, 9.0), (9.0, 12.0)] {
        assert!(share(from, to) < 0.05, "{} from {from} s to {to} s", share(from, to));
    }
}
