//! What the tool answers when it is asked: `list`, `describe`, `show`, `completions`, and `check` for programs.

use std::fs;
use std::process::Stdio;

use tempfile::TempDir;

use crate::tool::{peer, said, say, tool};

const HYBRID: &str = "graphs/hybrid.toml";
const PRESS: &str = "graphs/finger_press.toml";

/// What a command prints as JSON, as a reader that is not ours reads it.
fn json(args: &[&str], code: i32) -> String {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("answer.json");
    let answer = say(&[args, &["--format", "json"]].concat());
    assert_eq!((answer.code, answer.err.as_str()), (code, ""), "{args:?}");
    fs::write(&path, answer.out).unwrap();
    peer("answers.py", &[args[0], path.to_str().unwrap()])
}

/// Every one of `lines` is one of the text, but for how far apart its words stand.
fn assert_lines(text: &str, lines: &[&str]) {
    let squeezed = |line: &str| line.split_whitespace().collect::<Vec<_>>().join(" ");
    for line in lines {
        let is_there = text.lines().any(|found| squeezed(found) == squeezed(line));
        assert!(is_there, "`{line}` is not in\n{text}");
    }
}

#[test]
fn a_list_finds_a_node_by_what_it_is_for() {
    let all = say(&["list"]);
    assert_eq!((all.code, all.err.as_str()), (0, ""));
    let lines = [
        "Nodes, servo: from features to a twist of the sensor",
        "  pid               a PID controller on every feature, for force and position control",
        "  tactile_pad   an array of tactels that outputs an image",
        "  pose      the position and orientation of one frame in another",
    ];
    assert_lines(&all.out, &lines);
    assert!(all.out.lines().all(|line| line.chars().count() <= 100), "{}", all.out);
    let cases: [(&[&str], &str, &str); 4] = [
        (&["list", "roles"], "role:velocity_arm", "node:pid"),
        (&["list", "nodes", "PID"], "node:pid", "node:label"),
        (&["list", "kinds", "joint", "each"], "kind:jacobian", "kind:image"),
        (&["list", "guidance"], "node:twist_source", "role:tactile_pad"),
    ];
    for (args, found, other) in cases {
        let list = json(args, 0);
        assert!(list.split_whitespace().any(|name| name == found), "{args:?}: {list}");
        assert!(!list.contains(other), "{args:?}: {list}");
    }
    assert_eq!(json(&["list", "nodes", "unicorn"], 2), "\n");
    let nothing = say(&["list", "nodes", "unicorn"]);
    let message = "error: nothing in the catalogue matches `nodes unicorn`\nhelp: `tactflow list` prints everything\n";
    assert_eq!((nothing.code, nothing.out.as_str(), nothing.err.as_str()), (2, "", message));
}

#[test]
fn a_description_says_everything_of_a_node() {
    let text = say(&["describe", "pid"]);
    assert_eq!((text.code, text.err.as_str()), (0, ""));
    let lines = [
        "pid (node)",
        "A PID controller on every feature, for force and position control.",
        "The node steps when an input that wakes the node has a new value or loses its value.",
        "  in.error  features, unit E, frame A; required, wakes the node",
        "  control  features, unit E/s, frame A",
        "  gains.NAME.kp      a number; default 0.0",
        "                     Proportional gain [1/s].",
    ];
    assert_lines(&text.out, &lines);
    assert!(text.out.contains("`feature_error.error`"), "{}", text.out);
    let lines = [
        "input error | features | E | A | required, wakes the node",
        "output control | features | E/s | A | None",
        "param gains | a table, for each name a table | None | required",
        "param gains.kp | a number | 1/s | 0.0",
    ];
    assert_lines(&json(&["describe", "pid"], 0), &lines);
    let markdown = say(&["describe", "pid", "--format", "markdown"]).out;
    assert!(markdown.contains("## Inputs\n\n- **`in.error`**: features, unit E, frame A; required"), "{markdown}");
}

#[test]
fn a_description_says_what_a_kind_a_role_and_a_device_are() {
    let cases: [(&str, &[&str]); 3] = [
        ("twist", &["twist (kind)", "Taken by", "projector.twist twist, frame A", "Produced by"]),
        ("velocity_arm", &["velocity_arm (role)", "Commands"]),
        ("mock_arm", &["mock_arm (device)", "Fills the roles: `velocity_arm`.", "Parameters"]),
    ];
    for (name, lines) in cases {
        let text = say(&["describe", name]);
        assert_eq!((text.code, text.err.as_str()), (0, ""), "{name}");
        assert_lines(&text.out, lines);
    }
    // More devices follow with more features.
    let arm = say(&["describe", "velocity_arm"]).out;
    assert!(arm.contains("\nFilled by the devices: `mock_arm`, `sim_bench`, `sim_pair`, `lockstep`, "), "{arm}");
    let twist = say(&["describe", "twist"]).out;
    assert!(twist.contains("Recorded with `--out`: the columns `vx` `vy` `vz` [m/s] and"), "{twist}");
    assert_lines(&json(&["describe", "twist"], 0), &["output projector.twist | twist | None | A | None"]);
}

#[test]
fn a_name_that_is_misspelt_is_guessed() {
    let cases = [
        (["describe", "moment"], "help: did you mean `moments`?"),
        (["describe", "twst"], "help: did you mean `twist`?"),
        (
            ["describe", "zzzzzz"],
            "help: `tactflow list` prints all names, and `tactflow list zzzzzz` those whose documentation has that word",
        ),
    ];
    for (args, help) in cases {
        let said = say(&args);
        assert_eq!((said.code, said.out.as_str()), (2, ""), "{args:?}");
        let first = format!("error: unknown node, device, role, kind or file `{}`", args[1]);
        assert_eq!(said.err, format!("{first}\n{help}\n"));
    }
}

/// The example of `unit_delay` needs `plus`, which needs a role, which a device fills.
#[test]
fn an_example_is_a_whole_graph_and_loads_in_any_folder() {
    let expected = "\
[graph]
clock = \"length\"

[roles]
length = \"length\"

[nodes.plus]
type = \"plus\"
in.value = \"length.value\"
by = 0.5                            # [m]

# ==== unit_delay ====
# What was added a tick ago.
[nodes.unit_delay]
type = \"unit_delay\"
in.value = \"plus.value\"

[bind]
length = \"ruler\"

[devices.ruler]
type = \"line_length\"
address = \"127.0.0.1:4000\"
";
    let graph = say(&["describe", "unit_delay", "--example"]);
    assert_eq!((graph.code, graph.out.as_str(), graph.err.as_str()), (0, expected, ""));
    let page = say(&["describe", "unit_delay"]).out;
    assert!(page.ends_with("`tactflow describe unit_delay --example` prints a whole graph with it.\n"), "{page}");
    assert!(!page.contains("[devices."), "the page shows only the node: {page}");
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("try.toml"), graph.out).unwrap();
    let checked = said(tool(&["check", "try.toml"]).current_dir(folder.path()));
    assert_eq!((checked.code, checked.out.as_str()), (0, "try.toml: ok, 2 nodes, one tick every 10 ms\n"));
    // A device comes with what reads it, and a role with the first device that fills it.
    let of_device = say(&["describe", "line_length", "--example"]).out;
    assert!(
        of_device.contains("[nodes.plus]") && of_device.contains("# ==== line_length ====\n[devices.ruler]"),
        "{of_device}"
    );
    assert_eq!(say(&["describe", "length", "--example"]).out, of_device);
    let none = say(&["describe", "count", "--example"]);
    assert_eq!((none.code, none.err.as_str()), (2, "error: `count` has no example\n"));
}

#[test]
fn a_graph_is_shown_with_where_everything_comes_from() {
    const TASK: [&str; 4] = ["show", "tests/data/shown/task.toml", "--set", "nodes.pid.gains.force.ki=0.5"];
    let text = say(&TASK);
    assert_eq!((text.code, text.err.as_str()), (0, ""));
    let lines = [
        "# tests/data/shown/task.toml as it runs: 7 nodes, one tick every 4 ms",
        "max_gap_ms = 30        # tests/data/shown/task.toml:5",
        "reset_after_ms = 20.0  # default",
        "[nodes.outer.inner.binarize]",
        "type = \"binarize\"       # tests/data/shown/inner.toml:8",
        "in.image = \"pad.image\"  # tests/data/shown/task.toml:12",
        "threshold = 0.03        # fact pad.threshold (tests/data/shown/bench.toml:4)",
        "in.mask = \"outer.inner.binarize.mask\"  # tests/data/shown/inner.toml:15",
        "# output mask: mask, 16 x 16, in pad",
        "min_area = 6                           # tests/data/shown/task.toml:13",
        "setpoint.force = 1.0                    # tests/data/shown/task.toml:26",
        "gains.force.kp = 2.0      # tests/data/shown/task.toml:31",
        "gains.force.ki = 0.5      # command line",
        "gains.force.kd = 0.0      # default",
        "# output control: features force [N/s], in pad",
        "pad = \"skin\"  # tests/data/shown/bench.toml:2",
        "[devices.skin]",
        "rate_hz = 250.0    # default",
    ];
    assert_lines(&text.out, &lines);
    let toml: toml::Table = text.out.parse().expect("what is shown is TOML");
    assert_eq!(toml["nodes"]["pid"]["gains"]["force"]["ki"].as_float(), Some(0.5));
    assert_eq!(toml["nodes"]["outer"]["inner"]["label"]["min_area"].as_integer(), Some(6));
    // A list of tables has the defaults of each.
    let press: Vec<&str> = text.out.lines().filter(|line| line.contains("from_s = ")).collect();
    assert!(press[0].contains("radius = 0.008") && press[1].contains("radius = 0.01"), "{press:?}");
    let is_default = |line: &str| line.rsplit("# default: ").next().is_some_and(|names| names.contains("radius"));
    assert!(is_default(press[0]) && !is_default(press[1]), "{press:?}");
    let lines = [
        "[outer.inner.binarize] binarize",
        "in.image = pad.image tests/data/shown/task.toml:12:12+11",
        "threshold = 0.03 fact pad.threshold tests/data/shown/bench.toml:4:10+4",
        "gains.force.kp = 2.0 written tests/data/shown/task.toml:31:22+3",
        "gains.force.ki = 0.5 written command line:1:26+3",
        "gains.force.kd = 0.0 default",
        "gives outer.inner.moments.force | scalar | N | ['pad']",
    ];
    assert_lines(&json(&TASK, 0), &lines);
}

#[test]
fn what_a_trouble_does_is_shown_with_its_defaults_and_so_is_the_age_of_a_wire() {
    let args = [
        "show",
        PRESS,
        "--set=policy.device=hold",
        "--set=policy.roles.pad.max_age_ms=300",
        "--set=nodes.guide.in.gate={ from = 'touch.present', max_age_ms = 400 }",
    ];
    let text = say(&args);
    assert_eq!((text.code, text.err.as_str()), (0, ""));
    let lines = [
        "[policy]",
        "stale = \"hold\" # default",
        "not_finite = \"fault\" # default",
        "deadline = \"count\" # default",
        "device = \"hold\" # command line",
        "roles.pad.max_age_ms = 300 # command line",
        "in.gate = { from = \"touch.label.present\", max_age_ms = 400, stale = \"hold\" } # command line",
    ];
    assert_lines(&text.out, &lines);
    let shown: toml::Table = text.out.parse().expect("what is shown is TOML");
    assert_eq!(shown["policy"]["roles"]["pad"]["max_age_ms"].as_integer(), Some(300));
    let lines = [
        "stale = \"hold\" default",
        "device = \"hold\" written command line:1:15+6",
        "roles.pad.max_age_ms = 300 written command line:1:29+3",
        "in.gate = touch.label.present 400.0 ms hold command line:1:30+15",
    ];
    assert_lines(&json(&args, 0), &lines);
}

#[test]
fn a_broken_graph_is_not_shown() {
    let graph = "tests/errors/kind_mismatch.toml";
    let (shown, checked) = (say(&["show", graph]), say(&["check", graph]));
    assert_eq!((shown.code, shown.out.as_str(), shown.err), (2, "", checked.err));
}

#[test]
fn diagnostics_are_there_for_programs() {
    let said = json(&["check", HYBRID, "tests/errors/frame_mismatch.toml", "tests/errors/unused_node.toml"], 2);
    let lines = [
        "graphs/hybrid.toml: ok True, 31 nodes, 0.004 s",
        "tests/errors/frame_mismatch.toml: ok False",
        "tests/errors/unused_node.toml: ok True, 28 nodes, 0.004 s",
    ];
    assert_lines(&said, &lines);
    assert!(said.contains("error[frame-mismatch] tests/errors/frame_mismatch.toml:"), "{said}");
    assert!(said.contains("warning[unused-node] tests/errors/unused_node.toml:"), "{said}");
    let part = json(&["check", "tests/errors/loop.toml"], 2);
    assert!(part.contains("error[loop] "), "{part}");
    let missing = json(&["check", "no/such.toml"], 2);
    assert!(
        missing.starts_with("no/such.toml: ok False\nerror[unreadable] command line:1:1+12 cannot read"),
        "{missing}"
    );
}

#[test]
fn a_warning_fails_nothing_unless_it_is_asked_to() {
    let graph = "tests/errors/unused_node.toml";
    let told = say(&["check", graph]);
    assert_eq!(
        (told.code, told.out.as_str()),
        (0, "tests/errors/unused_node.toml: ok, 28 nodes, one tick every 4 ms\n")
    );
    assert!(told.err.starts_with("warning[unused-node]: no output of `label` is used\n"), "{}", told.err);
    assert!(told.err.ends_with("\n5 warnings\n"), "{}", told.err);
    let denied = say(&["check", "--deny-warnings", graph]);
    assert_eq!((denied.code, denied.out.as_str(), denied.err), (2, "", told.err.clone()));
    let run = say(&["run", graph, "--for", "10ms"]);
    assert_eq!((run.code, run.err), (0, told.err));
    assert_eq!(say(&["check", "--deny-warnings", HYBRID, PRESS]).code, 0);
}

#[test]
fn a_deleted_wire_leaves_a_node_that_nobody_reads() {
    let text = fs::read_to_string(tactflow_tests::workspace().join(PRESS)).unwrap();
    let folder = TempDir::new_in(tactflow_tests::workspace().join("graphs")).unwrap();
    let path = folder.path().join("cut.toml");
    let text = text.replace("in.guide = \"guide.twist\"\n", "").replace("\"parts/", "\"../parts/");
    fs::write(&path, text.replace("\"benches/", "\"../benches/")).unwrap();
    let said = say(&["check", path.to_str().unwrap()]);
    assert_eq!(said.code, 0, "{}", said.err);
    assert!(said.err.contains("no output of `guide` is used"), "{}", said.err);
    assert!(said.err.contains("help: write `in.guide = \"guide.twist\"` in `sum`, or remove `guide`"), "{}", said.err);
}

#[test]
fn completions_are_what_each_shell_reads() {
    for (shell, word) in [
        ("bash", "complete -F"),
        ("zsh", "#compdef tactflow"),
        ("fish", "complete -c tactflow"),
        ("elvish", "edit:completion"),
        ("powershell", "Register-ArgumentCompleter"),
    ] {
        let said = say(&["completions", shell]);
        assert_eq!((said.code, said.err.as_str()), (0, ""), "{shell}");
        assert!(said.out.contains(word) && said.out.contains("describe"), "{shell}");
        assert_eq!(
            said.out.contains("edge_guard"),
            matches!(shell, "bash" | "zsh"),
            "{shell}: what there is to describe"
        );
    }
    assert_eq!(say(&["completions", "cmd"]).code, 2);
}

#[test]
fn a_part_that_comes_along_shows_what_goes_in_and_out() {
    let said = say(&["describe", "builtin:parts/touch.toml"]);
    assert_eq!((said.code, said.err.as_str()), (0, ""));
    for text in ["The file\n", "[inputs]\nimage = ", "[exports]\nx = \"moments.x\""] {
        assert!(said.out.contains(text), "{text}: {}", said.out);
    }
}

#[test]
fn the_words_of_other_books_find_the_filters() {
    for (word, node) in [("mean", "moving_average"), ("smooth", "moving_average"), ("one-pole", "low_pass")] {
        let said = say(&["list", word]);
        assert!(said.out.contains(&format!("\n  {node} ")), "{word}: {}{}", said.out, said.err);
    }
}

#[test]
fn without_arguments_the_tool_says_what_it_can_do() {
    let nothing = say(&[]);
    assert_eq!((nothing.code, nothing.out.as_str()), (2, ""));
    for command in ["run", "check", "list", "describe", "show", "completions"] {
        assert!(nothing.err.contains(&format!("\n  {command} ")), "{command}: {}", nothing.err);
        let help = say(&[command, "--help"]);
        assert_eq!((help.code, help.err.as_str()), (0, ""), "{command}");
        assert!(help.out.lines().all(|line| line.chars().count() <= 100), "{}", help.out);
    }
}

#[test]
fn a_reader_of_answers_that_has_seen_enough_is_no_mistake() {
    for args in [&["list"][..], &["describe", "pid"], &["show", HYBRID], &["completions", "bash"]] {
        let mut child = tool(args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let said = child.wait_with_output().unwrap();
        assert_eq!((said.status.code(), String::from_utf8_lossy(&said.stderr).as_ref()), (Some(0), ""), "{args:?}");
    }
}

#[test]
fn answers_have_colours_for_those_who_ask() {
    for args in [&["list"][..], &["describe", "pid"], &["show", HYBRID]] {
        let (plain, asked) = (say(args), said(tool(args).arg("--color=always")));
        assert!(!plain.out.contains('\u{1b}') && asked.out.contains("\u{1b}[1m"), "{args:?}");
        let mut stripped = asked.out;
        for code in ["\u{1b}[0m", "\u{1b}[1m", "\u{1b}[2m", "\u{1b}[36m"] {
            stripped = stripped.replace(code, "");
        }
        assert_eq!(stripped, plain.out, "{args:?}");
    }
}
