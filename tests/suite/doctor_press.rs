//! `tactflow doctor --press`: the dialogue about the corners of a pad in another process.

use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::process::Stdio;

use nix::sys::signal::{Signal, kill};
use nix::unistd::Pid;
use tactflow_nodes::arm::model::load;
use tactflow_nodes::arm::mount::Mount;
use tactflow_runtime::node::FilePath;
use tactflow_runtime::signal::Twist;
use tactflow_tests::workspace;
use tempfile::tempdir;

use crate::doctor::{Controller, bench};
use crate::peer::free_udp_port;
use crate::stream::fake::Fake;
use crate::tool::{Said, tool};

/// How far the finger is from the middle toward a corner, as a part of half the pad.
const OUT: f64 = 0.8;

/// A bench with a pad, whose keys come before those of the description.
fn pad_bench(fake: &Fake, sensor: &str, keys: &str) -> String {
    format!(
        "[bind]\npad = \"skin\"\n[devices.skin]\ntype = \"stream\"\nsensor = \"builtin:pads/{sensor}.toml\"\n\
         link = {:?}\ntimeout_ms = 20000\n{keys}\n",
        fake.link
    )
}

/// Goes through the dialogue: for each line that asks for a corner, `finger` returns where the true pad is pressed.
/// Without a place, the tool is interrupted.
fn dialogue(bench: &str, more: &[&str], fake: &mut Fake, finger: impl Fn(&str) -> Option<[f64; 2]>) -> Said {
    let folder = tempdir().unwrap();
    let path = folder.path().join("cell.toml");
    fs::write(&path, bench).unwrap();
    fake.does("release");
    fake.does("go");
    let args = [&["doctor", path.to_str().unwrap(), "--for", "1s", "--press"], more].concat();
    let mut child = tool(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut out = String::new();
    for line in BufReader::new(child.stdout.take().unwrap()).lines().map(Result::unwrap) {
        if line.starts_with("press ") {
            match finger(&line) {
                Some([x, y]) => fake.does(&format!("press {x} {y}")),
                None => kill(Pid::from_raw(child.id() as i32), Signal::SIGINT).unwrap(),
            }
        } else if line.contains("  felt at ") {
            fake.does("release");
        }
        out += &(line + "\n");
    }
    let mut err = String::new();
    child.stderr.take().unwrap().read_to_string(&mut err).unwrap();
    Said { code: child.wait().unwrap().code().unwrap(), out, err }
}

/// Presses the corner that a line names in the frame of the pad.
fn as_asked(line: &str) -> Option<[f64; 2]> {
    let side = |axis: char| if line.contains(&format!("+{axis}")) { OUT } else { -OUT };
    Some([side('x'), side('y')])
}

#[test]
fn a_wrong_axis_is_named_with_the_line_that_corrects_it() {
    // What the bench says of a pad of 16 rows of 32, the exit code, and what is found.
    let cases: [(&str, i32, &[&str]); 5] = [
        ("", 0, &["all four corners are where they should be", "as asked"]),
        ("order = [\"flip_x\"]", 1, &["problem: x is flipped", "`order = []`", "into `[devices.skin]`"]),
        ("order = [\"flip_y\", \"rot90\"]", 1, &["problem: x and y are swapped", "`order = []`"]),
        ("shape = [32, 16]", 1, &["`shape` is wrong", "`shape = [16, 32]`, `order = []`"]),
        ("order = [\"flip_x\", \"flip_y\"]", 0, &["warning: the image is turned by 180°", "`order = []`"]),
    ];
    std::thread::scope(|scope| {
        for (keys, code, expected) in cases {
            scope.spawn(move || {
                let mut fake = Fake::start("flexitac_16x32", "pty");
                let said = dialogue(&pad_bench(&fake, "flexitac_16x32", keys), &[], &mut fake, as_asked);
                assert_eq!(said.code, code, "{keys}: {}{}", said.out, said.err);
                assert_eq!(said.out.matches("felt at").count(), 4, "{keys}: {}", said.out);
                for text in expected {
                    assert!(said.out.contains(text), "{keys}: {text}: {}", said.out);
                }
            });
        }
    });
}

#[test]
fn the_same_place_four_times_nobody_and_ctrl_c_end_cleanly() {
    let told = |args: &[&str], finger: fn(&str) -> Option<[f64; 2]>| {
        let mut fake = Fake::start("flexitac_16x16", "pty");
        dialogue(&pad_bench(&fake, "flexitac_16x16", ""), args, &mut fake, finger)
    };
    let said = told(&[], |_| Some([0.7, 0.6]));
    assert_eq!(said.code, 1, "{}{}", said.out, said.err);
    assert!(said.out.contains("problem: no flip and no turn explains the touches"), "{}", said.out);
    assert!(said.out.contains("that is the upper right corner (+x, +y)"), "{}", said.out);
    // A touch in the noise is none.
    let mut fake = Fake::start("flexitac_16x16", "pty");
    let silent = |line: &str| line.contains("lower left").then_some([9.0, 9.0]);
    let said = dialogue(&pad_bench(&fake, "flexitac_16x16", ""), &["--patience", "1s"], &mut fake, silent);
    assert_eq!(said.code, 1, "{}{}", said.out, said.err);
    assert!(said.out.contains("problem: no touch above ") && said.out.contains("was felt within 1 s"), "{}", said.out);
    let said = told(&[], |_| None);
    assert_eq!((said.code, said.out.lines().last()), (130, Some("interrupted")), "{}{}", said.out, said.err);
}

/// The posture of the controller in `tests/peers/lwr.py`, with the sag of each joint [rad].
const POSTURE: [f64; 7] = [0.003, 0.503, 0.003, -1.297, 0.003, 1.303, 0.003];

/// Where the corners of a pad of 16 by 16 tactels are in the base [m], and in halves of the pad.
fn corners(mount: &Mount) -> [([f64; 3], [f64; 2]); 4] {
    let path = workspace().join("graphs/robots/lwr4p.urdf");
    let chain = load(&FilePath { path, span: 0..0, builtin: None }, "lwr_7_link", mount).unwrap();
    let pose = chain.forward(&POSTURE, &mut [Twist::default(); 7]).0;
    [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]: [f64; 2]| {
        // 16 tactels, 2 mm apart.
        let point = nalgebra::Point3::new(0.015 * x, 0.015 * y, 0.0);
        ((pose * point).coords.into(), [OUT * x, OUT * y])
    })
}

/// Presses the true corner that is nearest to the place in the base that a line names.
fn nearest(line: &str, truth: &[([f64; 3], [f64; 2])]) -> Option<[f64; 2]> {
    let (_, place) = line.split_once("at [").unwrap();
    let place: Vec<f64> = place.split(']').next().unwrap().split(", ").map(|number| number.parse().unwrap()).collect();
    let away = |corner: &[f64; 3]| corner.iter().zip(&place).map(|(a, b)| (a - b).powi(2)).sum::<f64>();
    truth.iter().min_by(|(a, _), (b, _)| away(a).total_cmp(&away(b))).map(|(_, touch)| *touch)
}

#[test]
fn corners_in_the_base_show_a_wrong_mount() {
    let quarter = std::f64::consts::FRAC_PI_2;
    // The yaw of the pad on the arm, and that of the bench.
    let cases = [(0.0, "0.0", "all four corners are where"), (quarter, "0.0", "rpy = [0.0, 0.0, 1.5708] }`")];
    for (yaw, stated, expected) in cases {
        let truth = corners(&Mount { xyz: [0.0, 0.0, 0.03], rpy: [0.0, 0.0, yaw] });
        let (mut fake, port) = (Fake::start("flexitac_16x16", "pty"), free_udp_port());
        let _controller = Controller::start(port, &[]);
        let mount = format!("mount = {{ xyz = [0.0, 0.0, 0.03], rpy = [0.0, 0.0, {stated}] }}");
        let pad = pad_bench(&fake, "flexitac_16x16", &mount).replace("[bind]\n", "");
        let bench = bench(port).replace("[bind]\n", "[bind]\npad = \"skin\"\n") + &pad.replace("pad = \"skin\"\n", "");
        let said = dialogue(&bench, &[], &mut fake, |line| nearest(line, &truth));
        assert!(said.out.contains("of the base of `arm`, at ["), "{}", said.out);
        assert!(said.out.contains("if the pad faces "), "{}", said.out);
        assert!(said.out.contains(expected), "{expected}: {}{}", said.out, said.err);
        assert_eq!(said.code, i32::from(yaw > 0.0), "{}", said.out);
    }
}

/// An arm without a position names no place in the base, so its `mount` does not judge the touches.
#[test]
fn a_silent_arm_leaves_the_corners_in_the_frame_of_the_pad() {
    let (mut fake, port) = (Fake::start("flexitac_16x16", "pty"), free_udp_port());
    let mount = "order = [\"flip_x\", \"flip_y\"]\nmount = { xyz = [0.0, 0.0, 0.03], rpy = [0.0, 0.0, 0.0] }";
    let pad = pad_bench(&fake, "flexitac_16x16", mount).replace("[bind]\npad = \"skin\"\n", "");
    let bench = bench(port).replace("[bind]\n", "[bind]\npad = \"skin\"\n") + &pad;
    let said = dialogue(&bench, &[], &mut fake, as_asked);
    assert!(said.out.contains("`arm` sends no position, so they are named in the frame of the pad"), "{}", said.out);
    assert!(said.out.contains("warning: the image is turned by 180°, against how you held the pad"), "{}", said.out);
    assert!(!said.out.contains("If the pad is turned on the arm"), "{}", said.out);
}
