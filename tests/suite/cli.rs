//! The tool as a user meets it: commands, exit codes, messages, files and Ctrl-C.

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use tactflow_runtime::graph::{Request, compile};
use tempfile::TempDir;

use crate::tool::{Said, peer, said, say, tool};

const PRESS: &str = "graphs/finger_press.toml";
const HYBRID: &str = "graphs/hybrid.toml";
const MOCK: &str = "--bench=graphs/benches/mock.toml";
const BREAKS: &str = "tests/data/breaks.toml";
const PROBE: &str = "tests/data/probe.toml";

/// A name in a folder of its own, for a file that the tool will make.
pub(crate) fn in_new_folder(name: &str) -> (TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name).to_str().unwrap().to_owned();
    (folder, path)
}

#[test]
fn what_goes_well_ends_with_0_and_says_nothing_on_stderr() {
    let run = say(&["run", PRESS]);
    assert_eq!((run.code, run.err.as_str()), (0, ""));
    for text in
        ["24 nodes, one tick every 100 ms", "touch.image: 28x28 tactels", "no more samples after 31.1", "309 ticks"]
    {
        assert!(run.out.contains(text), "`{text}` is not in\n{}", run.out);
    }
    let check = say(&["check", PRESS, HYBRID]);
    let expected =
        format!("{PRESS}: ok, 24 nodes, one tick every 100 ms\n{HYBRID}: ok, 31 nodes, one tick every 4 ms\n");
    assert_eq!((check.code, check.err.as_str(), check.out), (0, "", expected));
}

#[test]
fn a_run_that_faults_ends_with_1_and_names_node_port_and_tick() {
    let glitch = "devices.pad.glitch=[{ at_s = 0.1, for_s = 1.0, kind = 'nan' }]";
    let cases: [(&[&str], &str); 3] = [
        (
            &["run", HYBRID, MOCK, "--set", glitch],
            "`pad.image` is not a finite number in tick 26 at 0.100 s (graphs/benches/mock.toml:6:10)",
        ),
        (&["run", BREAKS], "`bad.value` is not a finite number in tick 10 at 0.036 s (tests/data/breaks.toml:13:8)"),
        (
            &["run", BREAKS, "--set", "nodes.bad.how=panic"],
            "node `bad` panicked: as told in tick 10 at 0.036 s (tests/data/breaks.toml:13:8)",
        ),
    ];
    for (args, message) in cases {
        let Said { code, out, err } = say(args);
        assert_eq!((code, err), (1, format!("error: {message}; every command went to zero\n")), "{args:?}");
        assert!(out.contains("a fault after"), "there is a summary all the same: {out}");
    }
}

#[test]
fn what_is_recorded_of_a_run_that_faults_is_whole() {
    let (_folder, path) = in_new_folder("faulted.csv");
    assert_eq!(say(&["run", BREAKS, "--out", &path]).code, 1);
    assert!(peer("rows.py", &[&path]).starts_with("9 rows, "), "the tick of the fault is none");
}

#[test]
fn a_command_line_that_is_not_understood_ends_with_2() {
    let cases: [(&[&str], &str); 8] = [
        (&[], "Usage:"),
        (&["walk"], "unrecognized subcommand 'walk'"),
        (&["run"], "<GRAPH>"),
        (&["check"], "<GRAPHS>"),
        (&["run", HYBRID, MOCK, "--four", "1s"], "unexpected argument '--four'"),
        (&["run", HYBRID, MOCK, "--for", "1"], "give a time with its unit: 20s, 500ms, 2min, 1h"),
        (&["run", HYBRID, MOCK, "--for", "-1s"], "error:"),
        (&["check", HYBRID, "--color", "pink"], "[possible values: auto, always, never]"),
    ];
    for (args, message) in cases {
        let Said { code, out, err } = say(args);
        assert_eq!((code, out.as_str()), (2, ""), "{args:?}: {err}");
        assert!(err.contains(message), "{args:?}: {err}");
    }
}

#[test]
fn a_file_that_does_not_load_or_cannot_be_made_ends_with_2() {
    let missing = "No such file or directory (os error 2)";
    let cases: [(&[&str], String); 9] = [
        (&["run", "tests/errors/loop.toml"], "error[loop]".into()),
        (&["check", "nowhere.toml"], format!("error[unreadable]: cannot read `nowhere.toml`: {missing}")),
        (&["check", "graphs"], "error[unreadable]: cannot read `graphs`: Is a directory (os error 21)".into()),
        (&["run", HYBRID, "--bench", "nowhere.toml"], format!("cannot read `nowhere.toml`: {missing}")),
        (
            &["run", HYBRID, MOCK, "--out", "rows.xlsx"],
            "error: `rows.xlsx` does not end in .csv or .ndjson: write for example `--out run.csv`\n".into(),
        ),
        (
            &["run", HYBRID, MOCK, "--out", "nowhere/rows.csv"],
            format!("error: cannot create `nowhere/rows.csv`: {missing}\n"),
        ),
        (
            &["run", HYBRID, MOCK, "--svg", "run.png"],
            "error: `run.png` does not end in .svg: write for example `--svg run.svg`\n".into(),
        ),
        (
            &["run", HYBRID, MOCK, "--svg", "nowhere/run.svg"],
            format!("error: cannot create `nowhere/run.svg`: {missing}\n"),
        ),
        (
            &["run", HYBRID, MOCK, "--svg", "run.svg", "--set=graph.show=[]"],
            "error: `--svg` draws the ports that the graph shows: add `show = [\"node.port\"]` under [graph]\n".into(),
        ),
    ];
    for (args, message) in cases {
        let Said { code, out, err } = say(args);
        assert_eq!((code, out.as_str()), (2, ""), "{args:?}: {err}");
        assert!(err.contains(&message), "{args:?}: {err}");
    }
}

#[test]
fn one_broken_graph_among_several_is_shown_and_the_others_are_checked() {
    let check = say(&["check", HYBRID, "tests/errors/loop.toml", PRESS]);
    assert_eq!(check.code, 2);
    let graphs: Vec<&str> = check.out.lines().map(|line| line.split(':').next().unwrap()).collect();
    assert_eq!(graphs, [HYBRID, PRESS]);
    assert!(check.err.contains("--> tests/errors/loop.toml:10:12") && check.err.ends_with("2 mistakes\n"));
}

#[test]
fn for_ends_a_run_in_the_graphs_time() {
    for (time, ticks) in [("100ms", 26), ("1s", 251), ("0.05min", 751)] {
        let run = say(&["run", HYBRID, MOCK, "--for", time]);
        let ending = run.out.lines().last().unwrap();
        assert_eq!(run.code, 0);
        assert!(
            ending.starts_with("the time limit ended the run") && ending.contains(&format!(" {ticks} ticks;")),
            "{ending}"
        );
    }
}

#[test]
fn a_probe_is_heard_without_a_switch_and_can_be_silenced() {
    let run = say(&["run", PROBE]);
    let lines: Vec<&str> = run.err.lines().filter_map(|line| Some(line.split_once("INFO log: ")?.1)).collect();
    assert_eq!((run.code, lines.len(), run.err.lines().count()), (0, 10, 10), "{}", run.err);
    let nothing = "moments.x is absent, moments.force is absent, label.present = 0";
    assert_eq!(lines[0], format!("at 0.000 s: watch: {nothing}"));
    assert!(
        lines[4].starts_with("at 0.400 s: watch: moments.x = 0.01000 m, moments.force = 2.995 N, label.present = 1")
    );
    assert_eq!(lines[9], format!("at 0.900 s: watch: {nothing}"));
    assert!(!run.out.contains("watch: "), "the summary is as it was");
    let silenced = said(tool(&["run", PROBE]).env("RUST_LOG", "warn"));
    assert_eq!((silenced.code, silenced.err.as_str()), (0, ""));
    let often = say(&["run", PROBE, "--set", "nodes.watch.every_ms=0"]);
    assert_eq!(often.err.lines().count(), 250, "one for each image");
}

#[test]
fn another_bench_is_another_pad() {
    let (_folder, bench) = in_new_folder("bench.toml");
    let text = fs::read_to_string(tactflow_tests::workspace().join("graphs/benches/mock.toml")).unwrap();
    let text = text.replace("rate_hz = 250", "rate_hz = 500").replace("../robots/", "builtin:");
    fs::write(&bench, text).unwrap();
    let run = say(&["run", HYBRID, "--bench", &bench, "--for", "1s"]);
    assert!(run.out.starts_with(&format!("{HYBRID}: 31 nodes, one tick every 2 ms\n")), "{}", run.out);
}

/// The line of a port or of a part of one in the table of what came out.
fn line<'t>(text: &'t str, port: &str) -> &'t str {
    let found = text.lines().find(|line| line.trim_start().starts_with(&format!("{port} ")));
    found.unwrap_or_else(|| panic!("no line is of `{port}`:\n{text}"))
}

#[test]
fn set_reaches_graph_part_and_bench_and_needs_no_quotes() {
    let run = say(&[
        "run",
        PRESS,
        "--ports",
        "--for=1s",
        "--set=nodes.guide.twist=[0, 0.25, 0, 0, 0, 0]",
        "--set=parts.touch.set.label.min_area=500",
        "--set=devices.arm.start=[0.0, 0.5, 0.0, -1.25, 0.0, 1.3, 0.0]",
        "--set=nodes.guide.in.gate=touch.present",
    ]);
    assert_eq!((run.code, run.err.as_str()), (0, ""));
    assert!(line(&run.out, "touch.moments.area").contains(" 0     0      10 "), "no contact has 500 tactels");
    assert!(line(&run.out, ".lwr_a3_joint").contains(" -1.250 "), "{}", run.out);
    let open = say(&["run", PRESS, "--ports", "--for=1s", "--set=nodes.guide.twist=[0, 0.25, 0, 0, 0, 0]"]);
    let moves =
        |text: &str| text.lines().skip_while(|line| !line.starts_with("guide.twist")).nth(2).unwrap().to_owned();
    assert!(moves(&open.out).contains(" 0.25000"), "{}", open.out);
}

#[test]
fn a_mistake_in_set_points_into_set() {
    let cases = [
        ("nodes.pid.gains.x.kp", "syntax", "1:1", "this is not `key=value`"),
        ("nodes.pid.gains.x.kp=abc", "bad-value", "1:22", "expected a number [1/s], found the string \"abc\""),
        ("nodes.pid.gainss.x.kp=3", "unknown-key", "1:11", "`gainss` is not a parameter here"),
        ("nodes.pidd.gains.x.kp=3", "missing-key", "1:7", "`pidd` has no `type`"),
        ("node.pid.gains.x.kp=3", "unknown-key", "1:1", "unknown key `node`"),
        ("parts.touch.set.labl.min_area=3", "unknown-key", "1:17", "the part has no node or part `labl`"),
        (
            "nodes.touch.label.min_area=3",
            "unknown-key",
            "1:7",
            "`touch` is a part: set its nodes through `parts.touch.set`",
        ),
        ("devices.pad.rows=-1", "bad-value", "1:18", "expected a whole number from 1 to 1000000, found -1"),
        ("devices.pad.row=4", "unknown-key", "1:13", "`row` is not a parameter here"),
        ("bind.pad=padd", "unknown-device", "1:10", "the bench has no device `padd`"),
        ("nodes.pid.in.error=error.eror", "unknown-port", "1:27", "`error` has no output `eror`"),
        ("graph.clock=pda", "bad-clock", "1:13", "the clock `pda` is not a role"),
    ];
    for (assignment, code, place, message) in cases {
        let Said { code: exit, err, .. } = say(&["check", HYBRID, MOCK, "--set", assignment]);
        assert_eq!(exit, 2, "{assignment}");
        let title = format!("error[{code}]: {message}\n");
        let at = err.find(&title).unwrap_or_else(|| panic!("{assignment}: `{title}` is not in\n{err}"));
        let next = err[at + title.len()..].lines().next().unwrap().trim_start();
        assert_eq!(next, format!("--> command line:{place}"), "{assignment}: {err}");
        assert!(err.ends_with("\n1 mistake\n"), "{assignment}: {err}");
    }
}

#[test]
fn rows_are_read_by_a_reader_that_is_not_ours_and_say_the_same_in_both_formats() {
    for (graph, rows) in [(PRESS, "309 rows, 172 columns, "), (HYBRID, "1000 rows, 197 columns, ")] {
        let [csv, ndjson] = ["rows.csv", "rows.ndjson"].map(|name| {
            let (_folder, path) = in_new_folder(name);
            let bench = if graph == HYBRID { &[MOCK][..] } else { &[] };
            let run = say(&[&["run", graph, "--out", &path], bench].concat());
            assert_eq!((run.code, run.err.as_str()), (0, ""));
            assert_eq!(run.out.lines().last().unwrap(), format!("wrote {path}"));
            peer("rows.py", &[&path])
        });
        assert!(csv.starts_with(rows) && !csv.contains(", 0 empty cells"), "{csv}");
        assert_eq!(csv, ndjson);
    }
}

#[test]
fn the_header_tells_the_unit_of_every_column() {
    let (_folder, path) = in_new_folder("rows.csv");
    say(&["run", PRESS, "--for=100ms", "--out", &path]);
    let text = fs::read_to_string(path).unwrap();
    for line in [
        "# time [s]",
        "# touch.source.sum [raw]",
        "# touch.moments.x [m]",
        "# pid.control.pressure [raw/tactel/s]",
        "# jacobian.twist.wz [rad/s]",
        "# move.state.sensor_pose.qw [1]",
        "# move.ik.velocity.lwr_a1_joint [rad/s]",
    ] {
        assert!(text.lines().any(|found| found == line), "`{line}` is not in the header");
    }
    assert!(text.lines().any(|line| line.starts_with("time,") && line.contains(",jacobian.twist.wz,")));
}

#[test]
fn colours_are_for_terminals_and_for_those_who_ask() {
    const ESCAPE: char = '\u{1b}';
    let broken = ["check", "tests/errors/loop.toml"];
    let on_a_terminal = |more: &[&str], no_color: Option<&str>| {
        let script = tactflow_tests::workspace().join("tests/peers/terminal.py");
        let inner = tool(&[&broken[..], more].concat());
        let mut command = Command::new("python3");
        command.arg(script).arg(inner.get_program()).args(inner.get_args()).current_dir(tactflow_tests::workspace());
        command.stdin(Stdio::null()).env_remove("NO_COLOR").envs(no_color.map(|value| ("NO_COLOR", value)));
        let said = said(&mut command);
        assert!(said.code == 2 && said.out.contains("tests/errors/loop.toml"), "{}", said.err);
        said.out.contains(ESCAPE)
    };
    assert!(on_a_terminal(&[], None), "on a terminal");
    assert!(on_a_terminal(&[], Some("")), "an empty NO_COLOR is none");
    assert!(!on_a_terminal(&[], Some("1")), "with NO_COLOR");
    assert!(!on_a_terminal(&["--color=never"], None), "with --color never");
    assert!(!say(&broken).err.contains(ESCAPE), "to a file");
    let asked = said(tool(&broken).arg("--color=always").env("NO_COLOR", "1"));
    assert!(asked.err.contains(ESCAPE), "with --color always");
}

/// A run that ends with the test at the latest.
pub(crate) struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // A child that has ended by itself cannot be killed, and need not.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

impl Running {
    /// Starts a run and waits until its first rows are in the file.
    pub(crate) fn start(args: &[&str], file: &Path) -> Self {
        Self::started(&mut tool(args), file, 10_000)
    }

    /// Starts a run and waits until the file has that many bytes.
    pub(crate) fn started(command: &mut Command, file: &Path, bytes: u64) -> Self {
        const PATIENCE: Duration = Duration::from_secs(20);
        let running = Self::of(command.stdout(Stdio::piped()));
        let start = Instant::now();
        while fs::metadata(file).map_or(0, |file| file.len()) < bytes {
            assert!(start.elapsed() < PATIENCE, "no rows after {PATIENCE:?}");
            std::thread::sleep(Duration::from_millis(5));
        }
        running
    }

    /// A run of a command, which need not write a file.
    pub(crate) fn of(command: &mut Command) -> Self {
        Self(command.stderr(Stdio::piped()).spawn().unwrap())
    }

    pub(crate) fn signal(&self, name: &str) {
        let status = Command::new("kill").args([name, &self.0.id().to_string()]).status().unwrap();
        assert!(status.success());
    }

    /// How long it took to end.
    pub(crate) fn gone(mut self) -> Duration {
        let start = Instant::now();
        self.0.wait().unwrap();
        start.elapsed()
    }

    /// How long it took to end, and what it said.
    pub(crate) fn end(mut self) -> (Duration, Said) {
        let start = Instant::now();
        let read = |pipe: &mut dyn std::io::Read| std::io::read_to_string(pipe).unwrap();
        let out = read(self.0.stdout.as_mut().unwrap());
        let err = read(self.0.stderr.as_mut().unwrap());
        let code = self.0.wait().unwrap().code().expect("it ends by itself");
        (start.elapsed(), Said { code, out, err })
    }
}

#[test]
fn ctrl_c_ends_an_endless_run_cleanly_and_soon() {
    for (pace, signal) in [(None, "-INT"), (Some("--realtime"), "-INT"), (Some("--realtime"), "-TERM")] {
        let (_folder, path) = in_new_folder("rows.csv");
        // In contact for ever, so that nothing but the signal ends it.
        let press = "--set=devices.pad.press=[{ from_s = 0.3, force = 3.0, at = [0.008, -0.004] }]";
        let mut args = vec!["run", HYBRID, MOCK, "--set=devices.pad.for_s=1e9", press, "--out", &path];
        args.extend(pace);
        let running = Running::start(&args, Path::new(&path));
        running.signal(signal);
        let (took, said) = running.end();
        assert_eq!((said.code, said.err.as_str()), (0, ""), "{pace:?} {signal}");
        // Far longer than it takes, and far shorter than the run.
        assert!(took < Duration::from_secs(10), "{pace:?} {signal}: it took {took:?}");
        let by = format!("interrupted by SIG{} after", &signal[1..]);
        let ending = said.out.lines().find(|line| line.starts_with(&by)).expect("a summary");
        let ticks = ending.split(" and ").nth(1).unwrap().split(' ').next().unwrap();
        let rows = peer("rows.py", &[&path]);
        assert!(rows.starts_with(&format!("{ticks} rows, ")), "{ending}: {rows}");
    }
}

#[test]
fn help_names_every_option() {
    let shared = ["--bench <FILE>", "--set <KEY=VALUE>", "--color <WHEN>", "--verbose", "--help"];
    let run =
        ["<GRAPH>", "--for <TIME>", "--realtime", "--out <FILE>", "--svg <FILE>", "--ports", "--quiet", "Examples:"];
    let texts: [(&[&str], &[&str]); 3] = [
        (&["--help"], &["run ", "check ", "--color <WHEN>", "--version", "Exit codes: 0 success; 1 a run"]),
        (&["run", "--help"], &run),
        (&["check", "--help"], &["[GRAPHS]...", "--explain [<CODE>]"]),
    ];
    for (args, words) in texts {
        let help = say(args);
        assert_eq!((help.code, help.err.as_str()), (0, ""));
        let of_command = shared.iter().filter(|_| args.len() > 1);
        for word in of_command.chain(words) {
            assert!(help.out.contains(word), "{args:?} lacks `{word}`:\n{}", help.out);
        }
    }
}

#[test]
fn a_reader_that_has_seen_enough_is_no_mistake() {
    let mut child = tool(&["run", HYBRID, MOCK]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    drop(child.stdout.take());
    let said = child.wait_with_output().unwrap();
    assert_eq!((said.status.code(), String::from_utf8_lossy(&said.stderr).as_ref()), (Some(0), ""));
}

#[test]
#[cfg(target_os = "linux")]
fn what_cannot_be_printed_is_told_and_ends_with_1() {
    for args in [["describe", "pid"], ["show", HYBRID], ["run", PRESS]] {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let Said { code, err, .. } = crate::tool::said_into(&mut tool(&args), full);
        assert_eq!(code, 1, "{args:?}");
        assert_eq!(err.lines().count(), 1, "{err}");
        assert!(err.starts_with("error: cannot write to standard output: No space left"), "{err}");
    }
}

#[test]
fn a_file_that_no_run_has_recorded_is_not_overwritten() {
    let (_folder, path) = in_new_folder("precious.csv");
    fs::write(&path, "DATA_TYPE MOVIE\n").unwrap();
    let said = say(&["run", HYBRID, MOCK, "--out", &path]);
    assert_eq!(
        (said.code, said.err.contains("is not a recording of a run, so it is not overwritten")),
        (2, true),
        "{}",
        said.err
    );
    assert_eq!(fs::read_to_string(&path).unwrap(), "DATA_TYPE MOVIE\n");
    let (_folder, path) = in_new_folder("again.csv");
    for _ in 0..2 {
        assert_eq!(say(&["run", HYBRID, MOCK, "--for", "1s", "--out", &path]).code, 0, "a record may be made anew");
    }
}

#[test]
fn the_readme_shows_a_graph_that_loads_and_what_the_tool_prints() {
    let readme = fs::read_to_string(tactflow_tests::workspace().join("README.md")).unwrap();
    assert!(readme.lines().count() <= 150, "the README is a shop window");
    let block = |fence: &str| {
        let (_, rest) = readme.split_once(&format!("```{fence}\n")).unwrap();
        rest.split("```").next().unwrap().to_owned()
    };
    let err = say(&["check", "tests/errors/frame_mismatch.toml"]).err;
    assert!(err.starts_with(block("text").trim_end()), "{err}");
    let graph = tactflow_tests::workspace().join("graphs/readme.toml");
    let request = Request { text: Some(block("toml")), ..Request::file(graph) };
    let compiled = compile(&tactflow_nodes::catalogue(), &request);
    let compiled = compiled.unwrap_or_else(|report| panic!("{}", report.render(false)));
    assert!(compiled.warnings().is_none());
}

#[test]
fn a_record_tells_the_mode_and_when_commands_are_held() {
    let (_folder, path) = in_new_folder("modes.csv");
    say(&["run", HYBRID, MOCK, "--for", "1s", "--send", "0.8s:stop", "--send", "0.9s:resume", "--out", &path]);
    let text = fs::read_to_string(path).unwrap();
    let rows: Vec<Vec<&str>> =
        text.lines().filter(|line| !line.starts_with('#')).map(|line| line.split(',').take(3).collect()).collect();
    assert_eq!(rows[0], ["time", "mode", "halted"]);
    // A row each 4 ms; after `resume` the modes begin again, and the contact is still there.
    for (row, mode, halted) in [(100, "0.0", "0.0"), (150, "1.0", "0.0"), (213, "1.0", "1.0"), (240, "1.0", "0.0")] {
        assert_eq!(rows[1 + row][1..], [mode, halted], "row {row}");
    }
}
