//! `tactflow calibrate tool` and `calibrate mount` as dialogues, with an arm and a pad in other processes.
//!
//! The arm is moved by commands to its process, as a hand would do it. Its kinematics and the weight of its tool are those
//! of `tests/peers/lwr.py`. Where the pad is touched follows from the table of Denavit and Hartenberg below.

use std::f64::consts::FRAC_PI_2;
use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::net::UdpSocket;
use std::path::PathBuf;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use nalgebra::{DMatrix, DVector, Matrix4, Rotation3, Vector3, Vector4};
use serde_json::Value;
use tactflow_tests::workspace;
use tempfile::TempDir;

use crate::stream::Fake;
use crate::tool::{say, tool};

/// Time within which anything happens on a busy machine.
const SOON: Duration = Duration::from_secs(30);
const HOME: [f64; 7] = [0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0];

/// A process that is written to and that prints lines.
struct Talker {
    child: Child,
    input: Option<ChildStdin>,
    lines: Receiver<String>,
    said: String,
}

impl Talker {
    fn start(command: &mut Command) -> Self {
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().expect("it starts");
        let out = BufReader::new(child.stdout.take().unwrap());
        let (sender, lines) = channel();
        thread::spawn(move || out.lines().map_while(Result::ok).all(|line| sender.send(line).is_ok()));
        Self { input: child.stdin.take(), child, lines, said: String::new() }
    }

    fn write(&mut self, line: &str) {
        writeln!(self.input.as_mut().expect("it has not ended"), "{line}").unwrap();
    }

    /// Waits for a line that holds one of some texts.
    fn hears(&mut self, texts: &[&str]) -> String {
        let end = Instant::now() + SOON;
        loop {
            let line = self.lines.recv_timeout(end.saturating_duration_since(Instant::now()));
            let line = line.unwrap_or_else(|_| panic!("{texts:?} is not in\n{}", self.said));
            self.said += &line;
            self.said.push('\n');
            if texts.iter().any(|text| line.contains(text)) {
                return line;
            }
        }
    }

    /// Waits for its end. Returns the exit code.
    fn end(&mut self) -> i32 {
        drop(self.input.take());
        while let Ok(line) = self.lines.recv_timeout(SOON) {
            self.said += &line;
            self.said.push('\n');
        }
        self.child.wait().unwrap().code().unwrap_or(-1)
    }
}

impl Drop for Talker {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// An arm that a hand moves.
struct Arm(Talker);

impl Arm {
    fn start(port: u16, args: &[&str]) -> Self {
        let mut command = Command::new("python3");
        command.arg(workspace().join("tests/peers/lwr.py")).args(["--port", &port.to_string(), "--seconds", "120"]);
        Self(Talker::start(command.args(["--guided", "--sag", "0"]).args(args)))
    }

    fn goes_to(&mut self, joints: &[f64; 7]) {
        let list: Vec<String> = joints.iter().map(f64::to_string).collect();
        self.0.write(&format!("move {}", list.join(" ")));
        self.0.hears(&["\"told\""]);
    }

    /// Ends the controller. It must have got no answer: nothing was sent to the arm.
    fn end(&mut self) {
        drop(self.0.input.take());
        let end: Value = serde_json::from_str(&self.0.hears(&["\"end\""])).unwrap();
        assert!(end["sent"].as_u64().unwrap() > 100 && end["answers"] == 0, "{end}");
    }
}

/// A bench in a folder, and what it said before.
struct Cell {
    _folder: TempDir,
    path: PathBuf,
    text: String,
    port: u16,
}

impl Cell {
    fn new(devices: &str) -> Self {
        let port = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        let text = devices.replace("PORT", &port.to_string());
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cell.toml");
        fs::write(&path, &text).unwrap();
        Self { _folder: folder, path, text, port }
    }

    fn calibrate(&self, what: &str) -> Talker {
        Talker::start(&mut tool(&["calibrate", what, self.path.to_str().unwrap()]))
    }

    fn now(&self) -> String {
        fs::read_to_string(&self.path).unwrap()
    }

    /// Returns a value of a device in the bench.
    fn value(&self, device: &str, key: &str) -> toml::Value {
        let bench: toml::Table = self.now().parse().unwrap();
        bench["devices"][device][key].clone()
    }
}

#[test]
fn calibrate_has_three_uses() {
    let help = say(&["calibrate", "--help"]);
    assert_eq!(help.code, 0, "{}", help.err);
    for text in
        ["calibrate [OPTIONS] <LOG>...", "calibrate <tool|mount>", "tool   Weigh the tool", "mount  Measure where"]
    {
        assert!(help.out.contains(text), "{text}: {}", help.out);
    }
    let none = say(&["calibrate"]);
    assert!(none.code == 2 && none.err.contains("<LOG>..."), "{}", none.err);
    for what in ["tool", "mount"] {
        let stepped = say(&["calibrate", what, "graphs/benches/mock.toml"]);
        assert!(stepped.code == 2 && stepped.err.contains("so nobody can guide it"), "{}", stepped.err);
    }
}

/// Measures a posture. The first samples may be those of the last posture, which is refused as a motion.
fn measure(dialogue: &mut Talker, measured: &str) {
    for _ in 0..5 {
        dialogue.hears(&["Posture "]);
        dialogue.write("");
        if dialogue.hears(&[measured, "not measured"]).contains(measured) {
            return;
        }
    }
    panic!("{}", dialogue.said);
}

fn floats(value: &toml::Value) -> [f64; 3] {
    let list: Vec<f64> = value.as_array().unwrap().iter().map(|item| item.as_float().unwrap()).collect();
    list.try_into().unwrap()
}

const WEIGHED: &str = "# My cell.
[bind]
arm = \"arm\"
wrist = \"arm\"

[devices.arm]
type = \"lwr_fri\"                    # FRI
robot = \"builtin:lwr4p.toml\"
port = PORT
tool_mass = 0.3                     # guessed
tool_com = [0.0, 0.0, 0.05]
";

/// Wrist joints that turn all sides of the tool down.
const WRISTS: [[f64; 3]; 6] =
    [[0.0, 1.3, 0.0], [0.0, -0.3, 0.0], [1.57, -0.3, 0.0], [-1.57, -0.3, 0.0], [0.0, 2.0, 1.0], [0.7, 0.5, -1.0]];

fn at_wrist([a4, a5, a6]: [f64; 3]) -> [f64; 7] {
    let [a1, a2, e1, a3, ..] = HOME;
    [a1, a2, e1, a3, a4, a5, a6]
}

fn weigh(cell: &Cell, answer: &str, args: &[&str]) -> Talker {
    let mut arm = Arm::start(cell.port, args);
    let mut dialogue = cell.calibrate("tool");
    for wrist in WRISTS {
        arm.goes_to(&at_wrist(wrist));
        measure(&mut dialogue, "is down within");
    }
    dialogue.hears(&["Posture 7"]);
    dialogue.write("done");
    if !answer.is_empty() {
        dialogue.hears(&["Type `yes`"]);
        dialogue.write(answer);
    }
    arm.end();
    dialogue
}

const TOOL: [&str; 12] = ["--tool", "0.8", "0.01", "-0.02", "0.06", "--wrench", "1", "-2", "3", "0.1", "0.05", "-0.02"];

#[test]
fn the_tool_is_weighed_and_written_after_a_yes() {
    let cell = Cell::new(WEIGHED);
    let mut dialogue = weigh(&cell, "yes", &TOOL);
    assert_eq!(dialogue.end(), 0, "{}", dialogue.said);
    for text in ["Posture 1: turn the tool so that the +z side", "[1.00, -2.00, 3.00] N, [0.100, 0.050, -0.020] N m"] {
        assert!(dialogue.said.contains(text), "{text}: {}", dialogue.said);
    }
    let (mass, centre) = (cell.value("arm", "tool_mass").as_float().unwrap(), floats(&cell.value("arm", "tool_com")));
    assert!((mass - 0.8).abs() < 0.002, "{mass}");
    assert!(centre.iter().zip([0.01, -0.02, 0.06]).all(|(a, b)| (a - b).abs() < 0.0003), "{centre:?}");
    let rest = |text: &str| -> Vec<String> {
        text.lines().filter(|line| !line.starts_with("tool_")).map(str::to_owned).collect()
    };
    assert_eq!(rest(&cell.now()), rest(&cell.text), "the rest stays, with its comments");
    assert!(cell.now().contains("# guessed"));
}

#[test]
fn a_tool_that_is_not_confirmed_or_has_a_negative_weight_is_not_written() {
    let cell = Cell::new(WEIGHED);
    let mut dialogue = weigh(&cell, "no", &TOOL);
    assert_eq!((dialogue.end(), cell.now()), (0, cell.text.clone()), "{}", dialogue.said);
    assert!(dialogue.said.contains("nothing is written"), "{}", dialogue.said);
    // The device subtracts 0.3 kg, and the load of the controller is 1.3 kg too heavy.
    let mut dialogue = weigh(&cell, "", &["--tool", "-1.0", "0", "0", "0.05"]);
    assert_eq!((dialogue.end(), cell.now()), (1, cell.text.clone()), "{}", dialogue.said);
}

#[test]
fn postures_that_are_alike_do_not_weigh_a_tool() {
    let cell = Cell::new(WEIGHED);
    let mut arm = Arm::start(cell.port, &TOOL);
    let mut dialogue = cell.calibrate("tool");
    // A turn about the vertical.
    for base in [0.0, 0.4, 0.8, 1.2] {
        arm.goes_to(&[base, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0]);
        measure(&mut dialogue, "is down within");
    }
    dialogue.hears(&["the postures are too alike: the direction down varies by 0.00"]);
    dialogue.hears(&["Posture 5"]);
    dialogue.write("done");
    dialogue.hears(&["the postures do not determine the weight yet"]);
    assert_eq!((dialogue.end(), cell.now()), (1, cell.text.clone()), "{}", dialogue.said);
}

#[test]
fn a_controller_that_subtracts_the_weight_gets_what_its_payload_lacks() {
    let mut command = Command::new("python3");
    command.arg(workspace().join("tests/peers/ur.py")).arg(r#"{"lacks": [0.231, 0.0, 0.01, 0.05]}"#);
    let mut robot = Talker::start(&mut command);
    let ports: Value = serde_json::from_str(&robot.hears(&["rtde"])).unwrap();
    let cell = Cell::new(&format!(
        "[bind]\narm = \"arm\"\n[devices.arm]\ntype = \"ur\"\naddress = \"127.0.0.1\"\nrobot = \"builtin:ur5e.toml\"\n\
         rate_hz = 125.0\nrtde_port = {}\nscript_port = {}\ntool_mass = 0.5\n",
        ports["rtde"], ports["script"]
    ));
    let mut dialogue = cell.calibrate("tool");
    for wrist in [[-1.0, 1.57, 0.0], [0.5, 1.57, 0.0], [-1.0, 0.0, 0.0], [-1.0, 3.1, 0.0], [0.5, 0.5, 1.0]] {
        robot.write(&format!("move 0 -1.7 -2.0 {} {} {}", wrist[0], wrist[1], wrist[2]));
        robot.hears(&["move 0"]);
        thread::sleep(Duration::from_millis(100));
        measure(&mut dialogue, "is down within");
    }
    dialogue.hears(&["Posture 6"]);
    dialogue.write("done");
    dialogue.hears(&["the controller subtracts 0.231 kg less than the tool weighs, at [0.0, 10.0, 50.0] mm in the frame of the flange `tool0`"]);
    dialogue.hears(&["Which payload"]);
    dialogue.write("0.5 0 0");
    dialogue.hears(&["`0.5 0 0` is not a mass and three numbers"]);
    dialogue.hears(&["Which payload"]);
    dialogue.write("0.5 0 0 40");
    // (0.5 * 40 + 0.231 * 50) / 0.731 and 0.231 * 10 / 0.731.
    dialogue.hears(&[
        "set the payload to 0.731 kg with its centre at [0.0, 3.2, 43.2] mm in the frame of the flange `tool0`",
    ]);
    assert_eq!((dialogue.end(), cell.now()), (0, cell.text.clone()), "{}", dialogue.said);
    robot.write("mark");
    robot.hears(&["\"mark\""]);
    assert!(!robot.said.contains("\"program\""), "no program was sent to the robot: {}", robot.said);
}

/// The payload is in the frame of the flange, and the result in that of the tip. Nothing connects.
#[test]
fn a_controller_whose_tip_is_not_the_flange_is_refused() {
    let cell = Cell::new(
        "[bind]\narm = \"arm\"\n[devices.arm]\ntype = \"ur\"\naddress = \"127.0.0.1\"\nrobot = \"builtin:ur5e.toml\"\n\
         rtde_port = PORT\nflange = \"wrist_3_link\"\n",
    );
    let said = say(&["calibrate", "tool", cell.path.to_str().unwrap()]);
    assert!(said.code == 2 && said.err.contains("flange `wrist_3_link`, but the tip of device `arm`"), "{}", said.err);
}

/// The flange of an LWR 4+ in its base: its table of Denavit and Hartenberg, with the distances of its maker [m].
fn flange(q: &[f64]) -> Matrix4<f64> {
    let table = [
        (0.3105, FRAC_PI_2),
        (0.0, -FRAC_PI_2),
        (0.4, -FRAC_PI_2),
        (0.0, FRAC_PI_2),
        (0.39, FRAC_PI_2),
        (0.0, -FRAC_PI_2),
        (0.078, 0.0),
    ];
    table.iter().zip(q).fold(Matrix4::identity(), |pose, ((d, alpha), theta)| {
        let ((s, c), (sa, ca)) = (theta.sin_cos(), alpha.sin_cos());
        #[rustfmt::skip]
        let link = Matrix4::new(
            c, -s * ca, s * sa, 0.0,
            s, c * ca, -c * sa, 0.0,
            0.0, sa, ca, *d,
            0.0, 0.0, 0.0, 1.0,
        );
        pose * link
    })
}

/// The true mount: where the pad is, and its rotation about x, then y, then z of the tip.
fn true_mount() -> Matrix4<f64> {
    let turn = |axis: Vector3<f64>, angle: f64| Rotation3::new(axis * angle).to_homogeneous();
    let [roll, pitch, yaw] = [0.05, -0.03, 0.8];
    let turned = turn(Vector3::z(), yaw) * turn(Vector3::y(), pitch) * turn(Vector3::x(), roll);
    Matrix4::new_translation(&Vector3::new(0.012, -0.008, 0.095)) * turned
}

/// Returns the posture nearest to a seed in which a place on the pad is at the point, by Newton's method.
fn posture(seed: [f64; 7], place: [f64; 2], point: &Vector3<f64>) -> [f64; 7] {
    const H: f64 = 1e-6;
    let at = |q: &[f64]| (flange(q) * true_mount() * Vector4::new(place[0], place[1], 0.0, 1.0)).xyz();
    let mut q = seed;
    for _ in 0..50 {
        let off = point - at(&q);
        let columns: Vec<Vector3<f64>> = (0..7)
            .map(|i| {
                let [mut low, mut high] = [q; 2];
                low[i] -= H;
                high[i] += H;
                (at(&high) - at(&low)) / (2.0 * H)
            })
            .collect();
        let jacobian = DMatrix::from_fn(3, 7, |i, j| columns[j][i]);
        let step = jacobian.svd(true, true).solve(&DVector::from_row_slice(off.as_slice()), 1e-6).unwrap();
        (0..7).for_each(|i| q[i] += step[i]);
    }
    assert!((at(&q) - point).norm() < 1e-9);
    q
}

const ROWS: f64 = 16.0;
const COLS: f64 = 32.0;
const PITCH: f64 = 0.005;

/// Bends of the joints from home, and places on the pad in fractions of its half width and height.
const TOUCHES: [([f64; 7], [f64; 2]); 8] = [
    ([0.0, 0.0, 0.0, 0.0, 0.0, 0.5, 0.0], [0.6, 0.6]),
    ([0.0, 0.0, 0.0, 0.0, 0.0, -0.5, 0.5], [-0.6, 0.6]),
    ([0.0, 0.0, 0.0, 0.0, 0.6, 0.0, 0.0], [-0.6, -0.6]),
    ([0.0, 0.0, 0.0, 0.0, -0.6, 0.0, -0.5], [0.6, -0.6]),
    ([0.0, 0.0, 0.3, 0.0, 0.4, 0.4, 0.9], [0.1, 0.0]),
    ([0.0, 0.0, -0.3, 0.0, -0.4, 0.4, -0.9], [0.7, 0.3]),
    ([0.0, 0.2, 0.0, 0.2, 0.4, -0.4, 0.0], [0.0, -0.7]),
    ([0.0, -0.2, 0.0, -0.2, -0.5, -0.3, 1.2], [-0.7, 0.0]),
];

fn touched(link: &str, order: &str) -> Cell {
    Cell::new(&format!(
        "# My cell.
[bind]
arm = \"arm\"
pad = \"mat\"

[devices.arm]
type = \"lwr_fri\"
robot = \"builtin:lwr4p.toml\"
port = PORT

[devices.mat]
type = \"stream\"
sensor = \"builtin:pads/flexitac_16x32.toml\"
link = \"{link}\"
pitch = {PITCH}
order = {order}
mount = {{ xyz = [0.0, 0.0, 0.08], rpy = [0.0, 0.0, 0.6] }} # measured with a ruler
"
    ))
}

/// Touches the point in some of the postures.
fn touch(cell: &Cell, pad: &mut Fake, arm: &mut Arm, touches: &[([f64; 7], [f64; 2])]) -> Talker {
    let half = [(COLS - 1.0) / 2.0 * PITCH, (ROWS - 1.0) / 2.0 * PITCH];
    let point = (flange(&HOME) * true_mount() * Vector4::new(0.0, 0.0, 0.0, 1.0)).xyz();
    pad.does("release");
    pad.does("go");
    let mut dialogue = cell.calibrate("mount");
    dialogue.hears(&["Take everything off the pad"]);
    thread::sleep(Duration::from_millis(300));
    dialogue.write("");
    for (bend, part) in touches {
        let seed = std::array::from_fn(|i| HOME[i] + bend[i]);
        let place = [part[0] * half[0], part[1] * half[1]];
        arm.goes_to(&posture(seed, place, &point));
        dialogue.hears(&["of at least", "residual", "too alike", "standard"]);
        pad.does(&format!("press {} {}", part[0], part[1]));
        thread::sleep(Duration::from_millis(100));
        measure(&mut dialogue, "contact at");
    }
    dialogue
}

#[test]
fn the_mount_is_found_and_written_after_a_yes() {
    let mut pad = Fake::start("flexitac_16x32", "tcp");
    let cell = touched(&pad.link, "[]");
    let mut arm = Arm::start(cell.port, &[]);
    let mut dialogue = touch(&cell, &mut pad, &mut arm, &TOUCHES);
    dialogue.hears(&["Posture 9"]);
    dialogue.write("done");
    dialogue.hears(&["Type `yes`"]);
    dialogue.write("yes");
    assert_eq!(dialogue.end(), 0, "{}", dialogue.said);
    let mount = cell.value("mat", "mount");
    let [xyz, rpy] = [floats(&mount["xyz"]), floats(&mount["rpy"])];
    let shift = Vector3::from(xyz) - Vector3::new(0.012, -0.008, 0.095);
    let turn = Vector3::from(rpy) - Vector3::new(0.05, -0.03, 0.8);
    let said = &dialogue.said;
    assert!(shift.norm() < 2e-4 && turn.norm() < 0.3_f64.to_radians(), "{shift} {turn} {said}");
    assert!(cell.now().contains("# measured with a ruler") && said.contains("difference from the bench"), "{said}");
    assert!(!said.contains("warning"), "{said}");
    arm.end();
}

#[test]
fn a_mount_that_is_not_confirmed_or_not_determined_is_not_written() {
    let mut pad = Fake::start("flexitac_16x32", "tcp");
    let cell = touched(&pad.link, "[]");
    let mut arm = Arm::start(cell.port, &[]);
    let mut dialogue = touch(&cell, &mut pad, &mut arm, &TOUCHES[..5]);
    pad.does("release");
    thread::sleep(Duration::from_millis(100));
    dialogue.hears(&["Posture 6"]);
    dialogue.write("");
    dialogue.hears(&["not measured: nothing is pressed"]);
    dialogue.hears(&["Posture 6"]);
    dialogue.write("drop 5");
    dialogue.hears(&["Posture 5"]);
    dialogue.write("drop 4");
    dialogue.hears(&["3 of at least 4 postures"]);
    dialogue.hears(&["Posture 4"]);
    dialogue.write("done");
    dialogue.hears(&["the postures do not determine the mount yet"]);
    assert_eq!((dialogue.end(), cell.now()), (1, cell.text.clone()), "{}", dialogue.said);
    let mut dialogue = touch(&cell, &mut pad, &mut arm, &TOUCHES);
    dialogue.hears(&["Posture 9"]);
    dialogue.write("done");
    dialogue.hears(&["Type `yes`"]);
    dialogue.write("no");
    assert_eq!((dialogue.end(), cell.now()), (0, cell.text.clone()), "{}", dialogue.said);
}

/// The contacts of a mirrored image fit a mount whose z points into the tool, without a residual.
#[test]
fn a_mirrored_image_is_not_written_as_a_mount_that_points_inward() {
    let mut pad = Fake::start("flexitac_16x32", "tcp");
    let cell = touched(&pad.link, "[\"flip_x\"]");
    let mut arm = Arm::start(cell.port, &[]);
    let mut dialogue = touch(&cell, &mut pad, &mut arm, &TOUCHES);
    dialogue.hears(&["Posture 9"]);
    dialogue.write("done");
    dialogue.hears(&["difference from the bench"]);
    assert_eq!((dialogue.end(), cell.now()), (1, cell.text.clone()), "{}", dialogue.said);
    assert!(!dialogue.said.contains("Type `yes`") && !dialogue.said.contains("warning"), "{}", dialogue.said);
    arm.end();
}
