//! What a run shows in the terminal: the page at its end, and what is drawn while it goes on.

use std::fs;
use std::process::{Command, Stdio};

use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::Request;

use crate::course::{loaded, shipped};
use crate::tool::{Said, said, say, tool};

const VIEW: &str = "tests/data/view.toml";
const HYBRID: &str = "graphs/hybrid.toml";
const ESCAPE: char = '\u{1b}';

/// What a run prints, but for its last line: that tells how long it took.
fn page(args: &[&str]) -> String {
    let Said { code, out, err } = say(&[&["run"], args].concat());
    assert_eq!((code, err.as_str()), (0, ""), "{args:?}: {out}");
    without_the_end(&out)
}

fn without_the_end(out: &str) -> String {
    let lines: Vec<&str> = out.lines().collect();
    lines[..lines.len() - 1].join("\n") + "\n"
}

/// The same on a terminal of that width.
fn on_a_terminal(cols: usize, args: &[&str]) -> String {
    let said = said_to_a_terminal(cols, args);
    assert_eq!(said.code, 0, "{}", said.err);
    said.out.replace('\r', "")
}

fn said_to_a_terminal(cols: usize, args: &[&str]) -> Said {
    let inner = tool(args);
    let script = tactflow_tests::workspace().join("tests/peers/terminal.py");
    let mut command = Command::new("python3");
    command.arg(script).args(["sh", "-c", "stty rows 60 cols $0; exec \"$@\"", &cols.to_string()]);
    command.arg(inner.get_program()).args(inner.get_args()).current_dir(tactflow_tests::workspace());
    said(command.stdin(Stdio::null()).env_remove("NO_COLOR").env_remove("RUST_LOG"))
}

/// The text without what colours it.
fn plain(text: &str) -> String {
    let mut parts = text.split("\u{1b}[");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |all, part| all + part.split_once('m').expect("a colour ends").1)
}

#[test]
fn the_page_of_a_small_run_is_as_kept() {
    let path = tactflow_tests::workspace().join("tests/data/view.txt");
    let printed = page(&[VIEW]);
    if std::env::var_os("TACTFLOW_BLESS").is_some() {
        fs::write(&path, &printed).unwrap();
    }
    assert_eq!(printed, fs::read_to_string(path).unwrap());
}

#[test]
fn colours_change_no_character_but_those_of_the_shades() {
    let never = page(&[VIEW, "--color=never"]);
    let always = page(&[VIEW, "--color=always"]);
    assert_eq!((never.contains(ESCAPE), always.contains(ESCAPE)), (false, true));
    let always = plain(&always);
    let is_picture = |line: &str| line.starts_with(". ") || line.starts_with("0 .");
    for (never, always) in never.lines().zip(always.lines()).filter(|(never, _)| !is_picture(never)) {
        assert_eq!(never, always);
    }
    assert_eq!(never.lines().count(), always.lines().count());
    assert!(always.matches("><").count() == never.matches("><").count(), "the centre is marked in both");
}

#[test]
fn no_page_is_wider_than_its_terminal_nor_than_100() {
    for (cols, side_by_side) in [(40, 1), (80, 2), (200, 3)] {
        let printed = on_a_terminal(cols, &["run", VIEW, "--color=never"]);
        let lines: Vec<&str> =
            printed.lines().skip(1).filter(|line| !line.starts_with("a device") && !line.contains("--ports")).collect();
        let widest = lines.iter().map(|line| line.chars().count()).max().unwrap();
        assert!(widest > 30 && widest <= cols.min(100) && !printed.contains(ESCAPE), "{cols}: {widest}\n{printed}");
        let captions = lines.iter().find(|line| line.contains(": strongest")).unwrap();
        assert_eq!(captions.matches(" s: ").count(), side_by_side, "{cols}\n{printed}");
    }
}

#[test]
fn an_image_that_is_too_large_is_scaled_down_and_says_so() {
    let large = page(&[VIEW, "--set=devices.pad.rows=56", "--set=devices.pad.cols=128", "--for=0.3s"]);
    assert!(large.contains("56x128 tactels, 5 mm apart; a cell is the mean of 4x4 tactels; "), "{large}");
    assert!(large.lines().all(|line| line.chars().count() <= 100), "{large}");
    assert_eq!(large.lines().filter(|line| line.starts_with(". ")).count(), 14, "56 rows, four in one");
}

#[test]
fn a_run_of_no_ticks_and_one_without_an_image_have_a_page_too() {
    let glitch = "devices.pad.glitch=[{ at_s = 0.0, for_s = 1.0, kind = 'nan' }]";
    let none = say(&["run", VIEW, "--set", glitch]);
    assert_eq!(none.code, 1, "the first image is spoilt");
    assert!(none.out.contains("\nsource.image: absent\n") && !none.out.contains("over time"), "{}", none.out);
    let numbers = page(&[VIEW, "--set=graph.show=['error.error', 'label.present']"]);
    assert!(!numbers.contains("tactels") && numbers.contains("error.error, label.present over time"), "{numbers}");
    assert!(numbers.contains("\nerror.error.x [m]") && numbers.contains("\nlabel.present [1]"), "{numbers}");
    let nothing = page(&[VIEW, "--set=graph.show=[]"]);
    assert_eq!(nothing.lines().count(), 3, "{nothing}");
}

#[test]
fn of_a_pad_that_falls_silent_the_last_image_is_shown() {
    let silent = "devices.pad.glitch=[{ at_s = 0.5, for_s = 1.0, kind = 'silence' }]";
    let printed = page(&[VIEW, "--set", silent]);
    assert!(printed.contains(" 0.496 s: end\n") && printed.contains("\n  last -0.00500 "), "{printed}");
}

#[test]
fn what_is_usual_is_shown_of_a_graph_that_does_not_say() {
    let shown = |request: &Request| -> Vec<String> {
        Engine::new(loaded(request)).display().iter().map(|shown| shown.name.clone()).collect()
    };
    let text = fs::read_to_string(tactflow_tests::workspace().join(VIEW)).unwrap();
    let silent = text.replace("show = [\"source.image\", \"error.error\"]\n", "");
    assert_ne!(text, silent);
    assert_eq!(shown(&Request::text(silent.clone())), ["pad.image", "error.error"]);
    let (numbers, _) = silent.split_once("[nodes.error]").unwrap();
    assert_eq!(shown(&Request::text(numbers))[..3], ["pad.image", "source.sum", "source.peak"]);
    assert_eq!(shown(&shipped("hybrid.toml")), ["touch.image", "error.error"]);
}

#[test]
fn what_only_the_page_shows_is_not_lost() {
    let extra = ["--set=nodes.extra.type=moving_average", "--set=nodes.extra.in.value=touch.x", "--deny-warnings"];
    let check = |more: &[&str]| say(&[&["check", HYBRID], &extra[..], more].concat());
    let lost = check(&[]);
    assert!(lost.code == 2 && lost.err.contains("no output of `extra` is used"), "{}", lost.err);
    assert_eq!(check(&["--set=graph.show=['extra.value']"]).err, "");
}

#[test]
fn every_task_says_what_it_shows_and_its_page_fits_on_a_screen() {
    for path in tactflow_tests::single_tasks() {
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains("\nshow = [") && text.contains("\nmark = ["), "{}", path.display());
        let page = page(&[path.to_str().unwrap(), "--for=6s"]);
        assert!(page.lines().count() <= 60, "{}: {}\n{page}", path.display(), page.lines().count());
    }
}

#[test]
fn every_port_is_behind_a_switch_and_quiet_says_nothing() {
    let ports = page(&[VIEW, "--ports"]);
    for line in ["port ", "moments.area ", "node ", "  .x "] {
        assert!(ports.lines().any(|found| found.starts_with(line)), "{line}\n{ports}");
    }
    assert!(!ports.contains("tactels") && !ports.contains("over time; "), "{ports}");
    let quiet = say(&["run", VIEW, "--quiet"]);
    assert_eq!((quiet.code, quiet.out.as_str(), quiet.err.as_str()), (0, "", ""));
    let fault = say(&["run", "tests/data/breaks.toml", "--quiet"]);
    assert!(fault.code == 1 && fault.out.is_empty() && fault.err.starts_with("error: "), "{}", fault.err);
}

#[test]
fn while_it_runs_a_terminal_sees_the_image_and_a_pipe_nothing() {
    let args = ["run", HYBRID, "--realtime", "--for=1s", "--color=never"];
    let seen = on_a_terminal(100, &args);
    assert!(seen.matches(" s: now").count() >= 2 && seen.contains("% ") && seen.contains("\u{1b}[?7h"), "{seen}");
    let last = seen.rfind("\u{1b}[J").expect("it is taken away");
    assert!(seen[last..].contains("touch.image: 16x16 tactels") && !seen[last..].contains(": now"), "{seen}");
    let quiet = on_a_terminal(100, &[&args[..], &["--quiet"]].concat());
    assert_eq!(quiet, "");
    let narrow = on_a_terminal(30, &args);
    assert!(!narrow.contains(": now") && narrow.contains('%'), "{narrow}");
    assert_eq!(say(&args).err, "");
}

#[test]
fn while_it_runs_a_terminal_sees_the_mode_the_limits_and_what_holds_the_commands() {
    // So fast that the pad has to slow the approach down.
    let fast = "modes.approach.set.reach.twist=[0, 0, 0.015, 0, 0, 0]";
    let seen = on_a_terminal(100, &["run", HYBRID, "--realtime", "--for", "2s", "--set", fast]);
    for text in ["mode approach for 0.", "mode servo for 0.", "limited by move.contact.force to "] {
        assert!(seen.contains(text), "{text}: {seen}");
    }
    assert!(!seen.contains("commands held"), "{seen}");
    let halted = said_to_a_terminal(
        100,
        &["run", HYBRID, "--realtime", "--send", "1.3s:stop", "--send", "2.1s:resume", "--for", "2.4s"],
    )
    .out;
    assert!(halted.contains("commands stopped until `resume`: "), "{halted}");
}

#[test]
fn while_it_runs_the_curves_are_those_of_the_last_ten_seconds() {
    let seen = on_a_terminal(100, &["run", HYBRID, "--color=never"]);
    // A control of the cursor ends with a letter.
    let controls = seen.split(ESCAPE).map(|part| part.split_once(char::is_alphabetic).map_or(part, |(_, rest)| rest));
    let seen: String = controls.collect();
    // The first and the last time of each axis.
    let span = |line: &str| -> Option<[f64; 2]> {
        let times: Vec<f64> = line
            .trim()
            .split(" s")
            .filter(|text| !text.is_empty())
            .map(|text| text.trim().parse().ok())
            .collect::<Option<_>>()?;
        (times.len() == 3).then(|| [times[0], times[2]])
    };
    let spans: Vec<[f64; 2]> = seen.lines().filter_map(span).collect();
    let (whole, live) = spans.split_last().expect("the page has an axis");
    assert!(whole[0] == 0.0 && whole[1] > 20.0, "{whole:?}");
    assert!(live.iter().all(|[first, last]| last - first < 10.5), "{live:?}");
    assert!(live.iter().any(|[first, _]| *first > 0.0), "{live:?}");
}

#[test]
fn a_run_in_virtual_time_pauses_and_goes_on_at_a_word() {
    use std::io::Write;
    let args = ["run", "graphs/hybrid.toml", "--step=500ms", "--for", "4s"];
    let mut command = crate::tool::tool(&args);
    command.stdin(std::process::Stdio::piped()).stdout(std::process::Stdio::piped());
    let mut run = command.spawn().unwrap();
    run.stdin.take().unwrap().write_all(b"\n\n400ms\nwhat\nq\n").unwrap();
    let out = String::from_utf8(run.wait_with_output().unwrap().stdout).unwrap();
    let pauses: Vec<&str> = out.lines().filter(|line| line.contains(" s, tick ")).collect();
    let times: Vec<&str> = pauses.iter().map(|line| line.split(' ').next().unwrap()).collect();
    assert_eq!(times, ["0.000", "0.500", "1.000", "1.400", "1.400"], "{out}");
    assert!(
        pauses[0].contains("Enter or n: on to the next pause") && pauses[4].contains("`what` is no word here"),
        "{out}"
    );
    assert!(out.contains("mode servo for 0.3 s") && out.contains("limited by"), "{out}");
    assert!(out.contains("interrupted after 1.400 s and 351 ticks"), "{out}");
    let refused = crate::tool::say(&["run", "graphs/hybrid.toml", "--step", "--realtime"]);
    assert!(refused.code == 2 && refused.err.contains("`--step` requires virtual time"), "{}", refused.err);
}
