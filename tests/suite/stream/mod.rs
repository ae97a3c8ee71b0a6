//! Pads that are described in TOML, against pads in another process.

mod clients;
pub(crate) mod fake;

use std::time::{Duration, Instant};

use tactflow_nodes::devices::stream::Stream;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::harness::LinkRig;
use tactflow_tests::{catalogue, workspace};

use crate::tool::{Said, say};
pub(crate) use fake::Fake;
use fake::{SOON, driver, expect_count, expect_images, shipped};

/// The pads that ship.
const PADS: [&str; 9] = [
    "flexitac_16x32",
    "flexitac_16x16",
    "flexitac_12x32",
    "aa550399_32x32",
    "aa550399_glove",
    "anyskin",
    "velostat_ascii",
    "velostat_binary",
    "myrmex_v2",
];

/// A pad that counts its datagrams.
const COUNTED: &str = "frame = 'datagram'\ncell = 'u8'\noffset = 2\nshape = [4, 4]\nrate_hz = 100\npitch = 0.005\n\
                       start = 'hello'\nclock = { counter = { offset = 0, cell = 'u16be' } }\n";

/// A timeout that no busy machine reaches.
const PATIENT: &str = "timeout_ms = 20000";

#[test]
fn every_shipped_description_reads_its_pad() {
    let files = tactflow_tests::toml_files(&workspace().join("graphs/pads"));
    assert_eq!(files.len(), PADS.len(), "each description has its fake");
    for pad in PADS {
        let mut fake = Fake::start(pad, "pty");
        fake.does("go");
        let mut rig = driver(&fake, &shipped(pad), PATIENT);
        expect_images(&mut rig, 5, pad);
        assert_eq!(rig.count("rejected frames"), 0, "{pad}");
        rig.stop().unwrap();
        if pad == "myrmex_v2" {
            let seen = fake.answer("seen");
            assert!(seen.starts_with("f0c400f1c5") && seen.ends_with("f0c4000034"), "{seen}");
        }
    }
}

#[test]
fn frames_that_arrive_byte_by_byte_with_marks_in_them_are_read() {
    let mut fake = Fake::start("flexitac_16x16", "pty");
    fake.does("split 1");
    fake.does("marks moving");
    fake.does("go");
    let mut rig = driver(&fake, &shipped("flexitac_16x16"), PATIENT);
    expect_images(&mut rig, 5, "byte by byte");
    fake.does("split 100");
    expect_images(&mut rig, 10, "in pieces");
    assert_eq!((rig.count("rejected frames"), rig.count("resyncs")), (0, 0));
    rig.stop().unwrap();
}

#[test]
fn a_mark_at_the_same_place_of_every_frame_does_not_fool_it() {
    for pad in ["flexitac_16x16", "anyskin"] {
        let mut fake = Fake::start(pad, "pty");
        fake.does("marks fixed");
        fake.does("go");
        let mut rig = driver(&fake, &shipped(pad), PATIENT);
        expect_images(&mut rig, 5, pad);
        rig.stop().unwrap();
    }
}

#[test]
fn damage_is_never_delivered_if_there_is_a_checksum() {
    let mut fake = Fake::start("myrmex_v2", "pty");
    fake.does("go");
    let mut rig = driver(&fake, &shipped("myrmex_v2"), PATIENT);
    expect_images(&mut rig, 3, "before");
    for (i, harm) in ["lose", "add", "flip", "lose", "flip"].into_iter().enumerate() {
        fake.does(harm);
        expect_count(&mut rig, "rejected frames", i as u64 + 1);
        expect_images(&mut rig, 3, harm);
    }
    // The help that the firmware prints, between two frames.
    fake.does(&format!("raw {}", "68656c700a".repeat(20)));
    expect_count(&mut rig, "skipped bytes", 100);
    expect_images(&mut rig, 3, "after the garbage");
    // A flipped bit leaves the next frame in its place.
    assert!(rig.count("resyncs") >= 4);
    rig.stop().unwrap();
}

#[test]
fn a_pad_without_a_checksum_is_found_again_after_damage() {
    let mut fake = Fake::start("flexitac_16x32", "pty");
    // Text before the first header.
    fake.does("raw 52656164790d0aaa");
    fake.does("go");
    let mut rig = driver(&fake, &shipped("flexitac_16x32"), PATIENT);
    expect_images(&mut rig, 3, "after the text");
    fake.does("lose");
    expect_count(&mut rig, "resyncs", 1);
    expect_images(&mut rig, 5, "after a lost byte");
    fake.does("raw 00");
    expect_count(&mut rig, "resyncs", 2);
    expect_images(&mut rig, 5, "after an added byte");
    rig.stop().unwrap();
}

#[test]
fn a_pad_that_is_unplugged_in_the_middle_of_a_frame_is_lost_until_it_is_back() {
    let mut fake = Fake::start("myrmex_v2", "pty");
    fake.does("go");
    let mut rig = driver(&fake, &shipped("myrmex_v2"), PATIENT);
    expect_images(&mut rig, 3, "before");
    fake.does("half");
    assert!(rig.wait_until(SOON, |rig| rig.lost("image").is_some()), "the port is lost");
    let why = rig.lost("image").unwrap().to_owned();
    assert!(why.contains("the port is gone") || why.contains("there is no such port"), "{why}");
    // The symlink names a new port, as `/dev/serial/by-id` does.
    fake.does("open");
    expect_images(&mut rig, 3, "after it was plugged in again");
    assert_eq!(rig.count("reconnects"), 1);
    rig.stop().unwrap();
}

#[test]
fn a_silent_pad_is_lost_until_it_sends_again_on_the_same_link() {
    let mut fake = Fake::start("flexitac_16x16", "pty");
    fake.does("go");
    let mut rig = driver(&fake, &shipped("flexitac_16x16"), "timeout_ms = 300");
    expect_images(&mut rig, 3, "before");
    fake.does("pause");
    assert!(rig.wait_until(SOON, |rig| rig.lost("image").is_some()), "the port is lost");
    assert!(rig.lost("image").unwrap().contains("the pad sends nothing"), "{:?}", rig.lost("image"));
    fake.does("go");
    assert!(rig.wait_until(SOON, |rig| rig.lost("image").is_none()), "it is back");
    assert_eq!(rig.count("reconnects"), 0, "a board would start anew");
    rig.stop().unwrap();
}

#[test]
fn a_wrong_description_says_that_bytes_come_and_no_frame() {
    let mut fake = Fake::start("flexitac_16x16", "pty");
    fake.does("go");
    let mut rig = driver(&fake, &shipped("flexitac_16x32"), "timeout_ms = 100");
    assert!(rig.wait_until(SOON, |rig| rig.lost("image").is_some()));
    assert!(rig.lost("image").unwrap().contains("bytes came, and none of them is a frame"), "{:?}", rig.lost("image"));
    assert_eq!(rig.count("frames"), 0);
    rig.stop().unwrap();
}

#[test]
fn a_flood_costs_nothing_and_the_driver_can_be_stopped_in_it() {
    let mut fake = Fake::start("myrmex_v2", "tcp");
    fake.does("go");
    let mut rig = driver(&fake, &shipped("myrmex_v2"), PATIENT);
    expect_images(&mut rig, 2, "before");
    let begin = memory();
    for _ in 0..20 {
        fake.does("flood 1000000");
    }
    expect_count(&mut rig, "skipped bytes", 19_000_000);
    expect_images(&mut rig, 2, "after the flood");
    let growth = memory().saturating_sub(begin);
    assert!(growth < 16 << 20, "{growth} bytes");
    rig.stop().unwrap();
}

/// The resident memory of this process.
fn memory() -> usize {
    let text = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let pages = text.split(' ').nth(1).and_then(|pages| pages.parse::<usize>().ok());
    pages.unwrap_or(0) * 4096
}

#[test]
fn equal_frames_are_counted() {
    let mut fake = Fake::start("flexitac_16x16", "pty");
    fake.does("go");
    let mut rig = driver(&fake, &shipped("flexitac_16x16"), PATIENT);
    expect_images(&mut rig, 2, "before");
    fake.does("repeat 4");
    expect_count(&mut rig, "repeated frames", 3);
    rig.stop().unwrap();
}

#[test]
fn datagrams_that_come_twice_late_or_from_elsewhere_are_no_new_frames() {
    let mut fake = Fake::start("counted", "udp");
    fake.does("go");
    let mut rig = driver(&fake, COUNTED, PATIENT);
    expect_images(&mut rig, 3, "before");
    fake.does("repeat 3");
    expect_count(&mut rig, "repeated frames", 2);
    fake.does("late");
    expect_count(&mut rig, "late frames", 1);
    fake.does("foreign");
    expect_count(&mut rig, "foreign datagrams", 1);
    fake.does("lose");
    expect_count(&mut rig, "rejected frames", 1);
    // The datagram of the wrong length, and the one that came late.
    expect_count(&mut rig, "lost frames", 2);
    expect_images(&mut rig, 3, "after");
    rig.stop().unwrap();
}

#[test]
fn a_port_that_listens_reads_one_sender_only() {
    let free = std::net::UdpSocket::bind("0.0.0.0:0").unwrap();
    let port = free.local_addr().unwrap().port();
    drop(free);
    let keys = COUNTED.replace("start = 'hello'\n", "");
    let text = format!("link = 'udp:{port}'\n{PATIENT}\n{keys}");
    let mut rig = LinkRig::start::<Stream>(&text).unwrap_or_else(|mistakes| panic!("{mistakes:#?}"));
    let [pad, other] = [(); 2].map(|()| std::net::UdpSocket::bind("127.0.0.1:0").unwrap());
    let frame = |number: u16| {
        let cells = (0..16).map(|k: u32| ((7 * u32::from(number) + 3 * k) % 251) as u8);
        number.to_be_bytes().into_iter().chain(cells).collect::<Vec<u8>>()
    };
    let mut number = 0;
    let mut send = |socket: &std::net::UdpSocket| {
        number += 1;
        socket.send_to(&frame(number), ("127.0.0.1", port)).unwrap();
    };
    let end = Instant::now() + SOON;
    while rig.count("frames") == 0 {
        assert!(Instant::now() < end);
        send(&pad);
        rig.wait_until(Duration::from_millis(20), |rig| rig.count("frames") > 0);
    }
    send(&other);
    send(&pad);
    expect_count(&mut rig, "foreign datagrams", 1);
    rig.stop().unwrap();
}

#[test]
fn a_connection_that_closes_in_the_middle_of_a_frame_is_made_again() {
    for (link, keys) in [("tcp", shipped("aa550399_32x32")), ("ws", shipped("flexitac_16x16"))] {
        let pad = if link == "tcp" { "aa550399_32x32" } else { "flexitac_16x16" };
        let mut fake = Fake::start(pad, link);
        fake.does("go");
        let mut rig = driver(&fake, &keys, PATIENT);
        expect_images(&mut rig, 3, link);
        fake.does("half");
        assert!(rig.wait_until(SOON, |rig| rig.lost("image").is_some()), "{link}");
        fake.does("open");
        expect_images(&mut rig, 3, link);
        assert!(rig.count("reconnects") >= 1, "{link}");
        rig.stop().unwrap();
    }
}

#[test]
fn a_message_of_a_web_socket_is_a_frame() {
    let mut fake = Fake::start("counted", "ws");
    fake.does("go");
    let mut rig = driver(&fake, COUNTED, PATIENT);
    expect_images(&mut rig, 5, "messages");
    assert_eq!(rig.count("rejected frames"), 0);
    rig.stop().unwrap();
    let seen = fake.answer("seen");
    assert_ne!(seen, "-", "the driver has said hello");
}

/// A graph that shows a pad, and its bench.
fn graph(bench: &str) -> String {
    format!(
        "[graph]\nclock = \"pad\"\nshow = [\"pad.image\"]\n[roles]\npad = \"tactile_pad\"\n[nodes.source]\n\
         type = \"tactile_source\"\nin.image = \"pad.image\"\n[bind]\npad = \"skin\"\n[devices.skin]\n\
         type = \"stream\"\n{bench}"
    )
}

#[test]
fn a_run_counts_its_frames_in_the_summary() {
    let mut fake = Fake::start("flexitac_12x32", "pty");
    fake.does("go");
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("show.toml");
    let sensor = workspace().join("graphs/pads/flexitac_12x32.toml");
    // A bench replaces what the description states.
    let bench = format!("sensor = {sensor:?}\nlink = {:?}\ntimeout_ms = 20000\nrate_hz = 90\n", fake.link);
    std::fs::write(&file, graph(&bench) + "\n[policy]\nroles.pad = { max_age_ms = 20000 }\n").unwrap();
    let Said { code, out, err } = say(&["run", file.to_str().unwrap(), "--for", "1s"]);
    assert_eq!(code, 0, "{err}{out}");
    assert!(out.contains("device `skin`: ") && out.contains(" frames"), "{out}");
}

/// The messages of a graph with this bench.
fn report(bench: &str) -> String {
    let folder = workspace().join("graphs/benches");
    let request = Request { text: Some(graph(bench)), ..Request::file(folder.join("unwritten.toml")) };
    match compile(&catalogue(), &request) {
        Ok(_) => String::new(),
        Err(report) => report.render(false),
    }
}

#[test]
fn a_bench_names_the_file_of_a_sensor() {
    let link = "link = \"serial:/dev/null\"\n";
    assert_eq!(report(&format!("sensor = \"../pads/anyskin.toml\"\n{link}")), "");
    assert_eq!(report(&format!("sensor = \"builtin:pads/anyskin.toml\"\n{link}")), "");
    let cases = [
        ("sensor = \"../robots/lwr4p.toml\"", "this is a robot, not a sensor"),
        ("sensor = \"../pads/anyskn.toml\"", "did you mean `../pads/anyskin.toml`?"),
        ("robot = \"../pads/anyskin.toml\"", "this is a sensor, not a robot"),
        ("sensr = \"../pads/anyskin.toml\"", "did you mean `sensor`?"),
        ("sensor = \"../pads/anyskin.toml\"\nframe = \"synk\"", "did you mean `sync`?"),
        ("sensor = \"../pads/anyskin.toml\"\nlenght = 82", "did you mean `length`?"),
    ];
    for (keys, expected) in cases {
        let report = report(&format!("{keys}\n{link}"));
        assert!(report.contains(expected), "{keys}\n{report}");
    }
}

#[test]
fn a_mistake_in_the_file_of_a_sensor_is_shown_there() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("pad.toml");
    let text = std::fs::read_to_string(workspace().join("graphs/pads/anyskin.toml")).unwrap();
    let cases = [
        (text.replace("shape =", "shpae ="), "no device has a parameter `shpae`", "shpae = [5, 1, 4]"),
        (text.replace("[sensor]", "[sensr]"), "did you mean `sensor`?", "[sensr]"),
        (text.replace("axis = \"z\"", "axis = \"w\""), "no axis is called `w`", "axis = \"w\""),
        (format!("{text}length = 80\n"), "the last value ends after 80 bytes, and 2 more follow it", "length = 80"),
    ];
    for (text, message, line) in cases {
        std::fs::write(&file, text).unwrap();
        let report = report(&format!("sensor = {file:?}\nlink = \"serial:/dev/null\"\n"));
        assert!(report.contains(message) && report.contains(line) && report.contains("pad.toml"), "{report}");
    }
}

#[test]
fn the_pads_that_ship_are_listed() {
    let all = say(&["pads"]);
    assert_eq!((all.code, all.err.as_str()), (0, ""));
    assert!(PADS.iter().all(|pad| all.out.contains(pad)), "{}", all.out);
    let one = say(&["pads", "anyskin"]);
    assert!(one.out.contains("5x1x4  100 Hz  serial, 115200 baud  AnySkin"), "{}", one.out);
    let json = say(&["pads", "myrmex", "--format", "json"]);
    let json: serde_json::Value = serde_json::from_str(&json.out).unwrap();
    assert_eq!(json[0]["sensor"], "builtin:pads/myrmex_v2.toml");
    assert_eq!(say(&["pads", "nothing"]).code, 2);
}

/// The parts of a mat whose images come in eight packets.
const MAT_PARTS: &str = "parts = { index = { offset = 4, cell = \"u8\" }, first = 0, values = 128 }";

#[test]
fn what_a_pad_sends_is_guessed_and_the_description_loads() {
    // What the data sheets say: the length and the mark of a frame, its checksum, and the number of its cells.
    let cases = [
        ("flexitac_16x32", &["mark = \"hex:AA55\"", "length = 514", "cell = \"u8\"", "shape = [16, 32]"][..]),
        ("aa550399_32x32", &["mark = \"hex:AA550399\"", "length = 1028", "shape = [32, 32]"]),
        ("anyskin", &["frame = \"trailer\"", "mark = \"hex:0D0A\"", "length = 82"]),
        ("velostat_ascii", &["frame = \"lines\"", "cell = \"dec\"", "shape = [16, 16]"]),
        ("velostat_binary", &["frame = \"reply\"", "poll = \"A\"", "cell = \"u8\"", "shape = [16, 16]"]),
        ("mat_in_parts", &["mark = \"hex:AA550399\"", "length = 133", "offset = 5", "shape = [32, 32]", MAT_PARTS]),
        ("myrmex_v2", &["mark = \"hex:F0C401\"", "length = 520", "check = \"xor8\"", "cell = \"u16le\"", "offset = 7"]),
    ];
    let folder = tempfile::tempdir().unwrap();
    std::thread::scope(|scope| {
        for (pad, keys) in cases {
            let file = folder.path().join(pad).display().to_string();
            scope.spawn(move || {
                let mut fake = Fake::start(pad, "pty");
                fake.does("go");
                // The pauses between the frames are a part of the guess, and a busy machine makes others.
                let mut wrong = String::new();
                let right = (0..3).find_map(|_| {
                    let text = guessed(pad, &fake.link, &file);
                    let has = |key: &&str| text.contains(&format!("{key}\n")) || text.contains(&format!("{key}  #"));
                    let is_right = keys.iter().all(has);
                    if !is_right {
                        wrong += &text;
                    }
                    is_right.then_some(text)
                });
                let text = right.unwrap_or_else(|| panic!("{pad}: {keys:?} is not in\n{wrong}"));
                std::fs::write(&file, text).unwrap();
                assert_eq!(report(&format!("sensor = {file:?}\nlink = \"serial:/dev/null\"\n")), "", "{pad}");
            });
        }
    });
}

/// Returns the description that `sniff` writes of a pad.
fn guessed(pad: &str, link: &str, file: &str) -> String {
    let mut args = vec!["sniff", link, "--baud", "115200", "--for", "1s", "-o", file];
    args.extend((pad == "myrmex_v2").then_some("--send=hex:F0C400F1C5"));
    args.extend((pad == "velostat_binary").then_some("--poll=A"));
    let output = crate::tool::tool(&args).output().unwrap();
    assert!(output.status.success(), "{pad}: {}", String::from_utf8_lossy(&output.stdout));
    let text = std::fs::read_to_string(file).unwrap();
    std::fs::remove_file(file).unwrap();
    text
}

#[test]
fn a_link_without_frames_is_no_guess() {
    let mut fake = Fake::start("flexitac_16x16", "tcp");
    let child =
        crate::tool::tool(&["sniff", &fake.link, "--for", "300ms"]).stderr(std::process::Stdio::piped()).spawn();
    fake.does("flood 2000");
    let output = child.unwrap().wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).contains("no frames were found"));
    let said = say(&["sniff", "/dev/ttyUSB0"]);
    assert_eq!(said.code, 2);
    assert!(said.err.contains("does not begin with a kind of link"), "{}", said.err);
}

#[test]
fn the_example_of_the_page_is_a_description() {
    let page = std::fs::read_to_string(workspace().join("docs/pads.md")).unwrap();
    let (_, block) = page.split_once("```toml sensor\n").unwrap();
    let (block, _) = block.split_once("```").unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("my_pad.toml");
    // The length that the page computes, and one that is too short.
    for (length, is_right) in [(198, true), (197, false)] {
        std::fs::write(&file, format!("{block}length = {length}\n")).unwrap();
        let report = report(&format!("sensor = {file:?}\nlink = \"serial:/dev/null\"\n"));
        assert_eq!(report.is_empty(), is_right, "{report}");
    }
}
