//! Words on the standard input of a run: whatever else comes there, `stop` gets through and the ticks go on.

use std::io::Write;
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

use crate::task_folder::Folder;
use crate::tool::tool;

/// Hybrid on the mock bench, in contact from 0.3 s on, by the wall clock.
const TASK: [&str; 6] = [
    "run",
    "graphs/hybrid.toml",
    "--bench=graphs/benches/mock.toml",
    "--set=devices.pad.press=[{ from_s = 0.3, force = 3.0, at = [0.008, -0.004] }]",
    "--realtime",
    "--listen",
];

/// How a run that listens ended.
struct Heard {
    code: i32,
    out: String,
    err: String,
    took: Duration,
    /// The most memory that it had while words came [kB].
    memory: u64,
}

/// What a run reads, and the pause after it [ms].
type Part = (Vec<u8>, u64);

fn listen(args: &[&str], parts: impl IntoIterator<Item = Part>) -> Heard {
    let begin = Instant::now();
    let mut child = tool(args).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    let mut memory = 0;
    for (bytes, pause) in parts {
        // A run that has ended reads no more.
        if input.write_all(&bytes).is_err() {
            break;
        }
        memory = memory.max(peak_memory(&child));
        std::thread::sleep(Duration::from_millis(pause));
    }
    drop(input);
    let output = child.wait_with_output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    let code = output.status.code().expect("it ends by itself");
    Heard { code, out: text(&output.stdout), err: text(&output.stderr), took: begin.elapsed(), memory }
}

/// The most memory that a process has had [kB]; 0 where the system does not say.
fn peak_memory(child: &Child) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or("0");
    line.trim().trim_end_matches(" kB").parse().unwrap()
}

fn hear(time: &str, parts: impl IntoIterator<Item = Part>) -> Heard {
    listen(&[&TASK[..], &["--for", time]].concat(), parts)
}

/// Whether the run ended because of a `stop` that nothing can end any more.
fn is_stopped(heard: &Heard) -> bool {
    heard.code == 1 && heard.err.contains("error: the operator sent `stop`") && heard.took < Duration::from_secs(15)
}

#[test]
fn a_stop_after_which_the_standard_input_ends_ends_the_run() {
    let heard = hear("60s", vec![(b"stop\n".to_vec(), 0)]);
    assert!(is_stopped(&heard), "{}: {}", heard.code, heard.err);
    let heard = hear("60s", vec![(b"stop".to_vec(), 0)]);
    assert!(is_stopped(&heard), "without the end of its line: {}", heard.err);
}

#[test]
fn a_run_goes_on_after_the_end_of_its_standard_input() {
    let heard = hear("1s", vec![(b"resume\n".to_vec(), 0)]);
    assert_eq!((heard.code, heard.err.as_str()), (0, ""));
    assert!(heard.took >= Duration::from_secs(1));
}

#[test]
fn a_resume_counts_only_after_its_stop_was_carried_out() {
    let at_once = hear("60s", vec![(b"stop\nresume\n".to_vec(), 0)]);
    assert!(is_stopped(&at_once), "{}: {}", at_once.code, at_once.err);
    assert!(at_once.err.contains("`resume` has no effect: it came before `stop` was carried out"), "{}", at_once.err);
    let before = hear("60s", vec![(b"resume\n".repeat(1000), 0), (b"resume\nstop\n".to_vec(), 0)]);
    assert!(is_stopped(&before), "{}: {}", before.code, before.err);
    let later = hear("2s", vec![(b"stop\n".to_vec(), 600), (b"resume\n".to_vec(), 0)]);
    assert_eq!(later.code, 0, "{}", later.err);
    assert!(later.out.contains("stopped for") && later.out.contains("the operator sent `stop`"), "{}", later.out);
}

#[test]
fn a_stop_gets_through_whatever_else_is_read() {
    let cases: [(&str, Vec<u8>, &str); 5] = [
        ("bytes that are not UTF-8", b"\xff\xfe\n".to_vec(), "a line is not UTF-8: `\u{fffd}\u{fffd}`"),
        ("an endless line", [vec![b'a'; 10_000_000], b"\n".to_vec()].concat(), "a line of more than 256 bytes"),
        ("an endless line of zeros", [vec![0; 10_000_000], b"\n".to_vec()].concat(), "a line of more than 256 bytes"),
        ("ten million words", b"y\n".repeat(10_000_000), "dropped, because too many came at once"),
        ("a million of a known word", b"resume\n".repeat(1_000_000), ""),
    ];
    let check = |(what, before, says): (&str, Vec<u8>, &str)| {
        let heard = hear("60s", vec![(before, 0), (b"stop\n".to_vec(), 100)]);
        assert!(is_stopped(&heard), "{what}: {} after {:?}: {}", heard.code, heard.took, heard.err);
        assert!(heard.err.contains(says), "{what}: {}", heard.err);
        assert!(heard.err.lines().count() < 40, "{what}: {} lines of warnings", heard.err.lines().count());
        assert!(heard.memory < 100_000, "{what}: {} kB", heard.memory);
    };
    std::thread::scope(|scope| cases.into_iter().for_each(|case| drop(scope.spawn(move || check(case)))));
}

#[test]
fn an_endless_flood_starves_neither_the_ticks_nor_the_memory() {
    let heard = hear("3s", std::iter::repeat_with(|| (b"y\n".repeat(50_000), 0)));
    assert_eq!(heard.code, 0, "{}", heard.err);
    assert!(heard.took < Duration::from_secs(8), "{:?}", heard.took);
    assert!(heard.out.contains("after 3.000 s and 751 ticks"), "{}", heard.out);
    assert!(heard.memory < 100_000, "{} kB", heard.memory);
    assert!(heard.err.lines().count() < 40, "{}", heard.err);
}

#[test]
fn a_stop_for_one_task_gets_through_a_flood_too() {
    let folder = Folder::new(&[]);
    let graph = folder.path("two.toml").display().to_string();
    let args = ["run", &graph, "--realtime", "--listen", "--for", "3s"];
    let heard = listen(&args, vec![(b"y\n".repeat(1_000_000), 0), (b"left.Stop\n".to_vec(), 200)]);
    assert_eq!(heard.code, 0, "{}", heard.err);
    assert!(heard.err.contains("the operator sent `stop`") && heard.err.contains("of `left` ramp"), "{}", heard.err);
    assert!(!heard.err.contains("of `right` ramp"), "{}", heard.err);
}
