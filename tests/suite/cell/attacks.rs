//! The whole cell under attack: the tool runs the hybrid task in one process, and the cell is another one. The tool is
//! killed or suspended, or a cable between them swallows bytes or is cut, at any moment of a motion.
//!
//! The cell notes at which velocity its robot moves. After each attack, the robot is at rest within the time that its
//! driver declares, and it moves again only after `resume`.

use std::fmt::{self, Write as _};
use std::fs;
use std::io::Write as _;
use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use tactflow_runtime::random::Random;
use tempfile::TempDir;

use super::benches::{calibration, lwr_bench, lwr_wires, simulation, ur_ball, ur_bench, ur_wires};
use super::relay::{self, Cable};
use super::{Cell, Figures, ball};
use crate::peer::{SOON, free_tcp_port, free_udp_port};
use crate::tool::tool;

/// Frames of the pad per second, as many as a busy machine simulates in time.
const RATE_HZ: f64 = 100.0;
/// Time between two messages of the LWR [ms].
const FRI_MS: f64 = 4.0;
/// Speed of a joint that is a motion [rad/s].
const MOVES: f64 = 0.01;
/// Speed that the robot never exceeds in these tests [rad/s].
const FASTEST: f64 = 0.5;
/// What the precision of the wire makes of a posture that does not change [rad/s].
const STILL: f64 = 2e-4;
/// Age of an image after which the commands ramp to zero [s].
const PAD_AGE: f64 = 5.0 / RATE_HZ;
/// Time for a ramp to zero from `FASTEST`, with the joint accelerations of the robot files [s].
const RAMP: f64 = FASTEST / 5.0;
/// Shortest suspension after which the lease of the commands is lost for sure [ms].
const LONG_STOP: u64 = 100;
/// Silence of a pad after which the commands wait for `resume`: a hold of a second, and some room [ms].
const LONG_HOLD: u64 = 1300;

/// A pad and an arm.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Pair {
    SerialAndLwr,
    TcpAndUr,
}

impl Pair {
    /// Time from the last message until the robot rests by itself [s]. The LWR declares 200 ms. The UR gets 200 ms from
    /// each message, reacts within three steps, and stops with 4 rad/s².
    fn silence(self) -> f64 {
        match self {
            Self::SerialAndLwr => 0.2,
            Self::TcpAndUr => 0.2 + 0.006 + FASTEST / 4.0,
        }
    }
}

/// What happens to the tool, or to a cable.
#[derive(Debug, Clone, Copy)]
enum Attack {
    /// SIGSTOP, and SIGCONT after so many milliseconds.
    Suspend(u64),
    /// The cable of the pad swallows everything for so many milliseconds.
    MutePad(u64),
    /// Each cable of the arm does.
    MuteArm(u64),
    /// The cable of the pad is cut in the middle of a packet.
    CutPad,
    /// A cable of the arm is.
    CutArm,
    /// SIGKILL.
    Kill,
}

/// A time in which the robot must not move [s].
struct Rest {
    after: Attack,
    from: f64,
    to: f64,
}

impl fmt::Display for Rest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}, at rest from {:.3} s to {:.3} s", self.after, self.from, self.to)
    }
}

/// A run of the task in the tool, and its cell.
struct Run {
    pair: Pair,
    cell: Cell,
    tool: Tool,
    pad: Cable,
    arm: Cable,
    err: PathBuf,
    rests: Vec<Rest>,
    _folder: TempDir,
    _terminal: Option<OwnedFd>,
}

/// A process of the tool, which ends with its test.
struct Tool(Child);

impl Drop for Tool {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A ball that moves to and fro, so that the arm never rests by itself.
fn moving_ball() -> String {
    let mut motion = String::new();
    for i in 0..120 {
        let by = if i % 2 == 0 { -0.02 } else { 0.02 };
        write!(motion, "{{ from_s = {i}.0, to_s = {i}.9, by = [0.0, {by}, 0.0] }},").unwrap();
    }
    format!(
        "objects = [{{ shape = 'ball', radius = 0.08, at = [0.0, 0.01, 0.086], stiffness = 200.0, scatter = 0.0005, \
         motion = [{motion}] }}]\n"
    )
}

impl Run {
    fn start(pair: Pair) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let (pad, arm) = (Cable::default(), Cable::default());
        let set = format!("{}{}", simulation(RATE_HZ), moving_ball());
        let (cell, bench, terminal) = match pair {
            Pair::SerialAndLwr => {
                let port = free_udp_port();
                let more = "missed_per_level = 20\nrestarts = true\nstart_s = 0.1\n";
                let cell = Cell::start(&ball(), &format!("{set}{}", lwr_wires(relay::udp(port, &arm), FRI_MS, more)));
                let calibration = calibration(cell.folder.path(), 4095.0, "1");
                let (path, terminal) = relay::terminal(&cell.pad_path(), &pad);
                (cell, lwr_bench(&path, &calibration, port, RATE_HZ, FRI_MS), Some(terminal))
            }
            Pair::TcpAndUr => {
                let reverse = free_tcp_port();
                let wires = ur_wires(relay::tcp(reverse, &arm), "");
                let cell = Cell::start(&ur_ball(folder.path()), &format!("{set}{wires}"));
                let skin = relay::tcp(cell.port(("pad", "port")), &pad);
                let rtde = relay::tcp(cell.port(("arm", "rtde_port")), &arm);
                let script = cell.port(("arm", "script_port"));
                (cell, ur_bench(skin, [reverse, rtde, script], RATE_HZ), None)
            }
        };
        let [bench_path, err] = ["bench.toml", "err.txt"].map(|name| folder.path().join(name));
        fs::write(&bench_path, bench).unwrap();
        let mut command = tool(&["run", "graphs/hybrid.toml", "--listen", "--slow", "1", "--bench"]);
        command.arg(&bench_path).args(["--set", "policy.device=\"hold\""]);
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(fs::File::create(&err).unwrap());
        let tool = Tool(command.spawn().unwrap());
        Self { pair, cell, tool, pad, arm, err, rests: Vec::new(), _folder: folder, _terminal: terminal }
    }

    fn err(&self) -> String {
        fs::read_to_string(&self.err).unwrap()
    }

    fn signal(&self, name: &str) {
        let kill = Command::new("kill").args([&format!("-{name}"), &self.tool.0.id().to_string()]).status().unwrap();
        assert!(kill.success());
    }

    /// Returns the time of the cell [s].
    fn now(&mut self) -> f64 {
        self.cell.tell("now")[0]
    }

    /// Says `resume` again and again until the robot moves, as a busy machine may halt it again.
    fn resume_until_it_moves(&mut self) {
        const PATIENCE: Duration = Duration::from_millis(500);
        let (end, mut resumed) = (Instant::now() + SOON, Instant::now());
        while self.cell.tell("speed")[1] < MOVES {
            assert!(Instant::now() < end, "{:?}: it does not move: {}", self.pair, self.err());
            if resumed.elapsed() > PATIENCE {
                self.tool.0.stdin.as_mut().unwrap().write_all(b"resume\n").unwrap();
                resumed = Instant::now();
            }
            thread::sleep(Duration::from_millis(5));
        }
    }

    /// Attacks it, and watches for a while. The times at which something begins are taken behind it, so a busy machine
    /// makes the test milder and never fails it.
    fn attack(&mut self, attack: Attack) {
        let (silence, told) = (self.pair.silence(), self.err().len());
        let watch = Duration::from_millis(500);
        let (from, to) = match attack {
            Attack::Suspend(ms) => {
                self.signal("STOP");
                let from = self.now() + silence;
                thread::sleep(Duration::from_millis(ms));
                self.signal("CONT");
                let from = from.max(self.now() + RAMP);
                thread::sleep(watch);
                if ms < LONG_STOP && self.err().len() == told {
                    // The commands were renewed in time.
                    return;
                }
                (from, self.now())
            }
            Attack::MutePad(ms) => {
                self.pad.swallow(true);
                let from = self.now() + PAD_AGE + silence;
                thread::sleep(Duration::from_millis(ms));
                let to = self.now();
                self.pad.swallow(false);
                if ms < LONG_HOLD {
                    // A short gap of a sensor is over when it sends again.
                    return self.rests.push(Rest { after: attack, from, to });
                }
                thread::sleep(watch);
                (from, self.now())
            }
            Attack::MuteArm(ms) => {
                self.arm.swallow(true);
                let from = self.now() + silence;
                thread::sleep(Duration::from_millis(ms));
                self.arm.swallow(false);
                thread::sleep(watch);
                (from, self.now())
            }
            Attack::CutPad => {
                self.pad.cut();
                let from = self.now() + PAD_AGE + silence;
                thread::sleep(watch);
                let to = self.now();
                self.pad.swallow(false);
                (from, to)
            }
            Attack::CutArm => {
                self.arm.cut();
                let from = self.now() + silence;
                thread::sleep(watch);
                self.arm.swallow(false);
                thread::sleep(watch);
                (from, self.now())
            }
            Attack::Kill => {
                self.tool.0.kill().unwrap();
                self.tool.0.wait().unwrap();
                let from = self.now() + silence;
                thread::sleep(watch + Duration::from_secs_f64(silence));
                (from, self.now())
            }
        };
        self.rests.push(Rest { after: attack, from, to });
    }

    /// Ends the tool and the cell, and checks what the cell has noted. Returns in how many times the robot was to rest.
    fn check(mut self) -> usize {
        let _ = self.tool.0.kill();
        let (pair, err, rests) = (self.pair, self.err(), std::mem::take(&mut self.rests));
        let Figures { summary, commands, motion, .. } = self.cell.end();
        for rest in &rests {
            let is_in = |row: &&Vec<f64>| (rest.from..=rest.to).contains(&row[0]);
            if let Some(row) = motion.iter().filter(is_in).find(|row| row[1] > STILL) {
                let [motion, commands] = [&motion, &commands].map(|rows| around(row[0], rows));
                panic!("{pair:?}, {rest}: it moves:\n{motion}the commands:\n{commands}{err}");
            }
            let is_motion = |row: &&Vec<f64>| row[2] == 1.0 && row[3..].iter().any(|v| v.abs() > STILL);
            if let Some(row) = commands.iter().filter(is_in).find(is_motion) {
                panic!("{pair:?}, {rest}: it is commanded:\n{}{err}", around(row[0], &commands));
            }
        }
        let fastest = motion.iter().map(|row| row[1]).fold(0.0, f64::max);
        assert!(fastest < FASTEST, "{pair:?}: {fastest} rad/s");
        assert_eq!(summary["arm"]["faults"], 0, "{pair:?}: {summary}");
        rests.len()
    }
}

/// The rows within 50 ms of a time.
fn around(time: f64, rows: &[Vec<f64>]) -> String {
    let near = rows.iter().filter(|row| (row[0] - time).abs() < 0.05);
    near.map(|row| format!("  {row:?}\n")).collect()
}

/// Attacks a run with all of these, one after the other, each at a random moment of a motion.
fn withstand(pair: Pair, random: &mut Random, attacks: &[Attack]) -> usize {
    let mut run = Run::start(pair);
    for attack in attacks {
        run.resume_until_it_moves();
        thread::sleep(Duration::from_secs_f64(random.uniform(0.0, 0.4)));
        run.attack(*attack);
    }
    run.check()
}

/// Sieges of `.ci/edge`: each has every attack once, in a random order, and ends with a kill.
const SIEGES: u64 = 30;

/// Attacks many runs of a pair. Returns in how many times the arm was to rest.
fn withstand_all(pair: Pair) -> usize {
    let siege = |seed| {
        let mut random = Random::new(seed, pair as u64);
        let mut attacks = vec![
            Attack::Suspend(random.uniform(50.0, 200.0) as u64),
            Attack::Suspend(random.uniform(200.0, 1500.0) as u64),
            Attack::MutePad(random.uniform(400.0, 2000.0) as u64),
            Attack::MuteArm(random.uniform(300.0, 1500.0) as u64),
            Attack::CutPad,
            Attack::CutArm,
        ];
        for i in (1..attacks.len()).rev() {
            attacks.swap(i, random.below(i + 1));
        }
        attacks.push(Attack::Kill);
        withstand(pair, &mut random, &attacks)
    };
    (1..=SIEGES).map(siege).sum()
}

/// A moment of each attack.
const FEW: [Attack; 6] =
    [Attack::MutePad(400), Attack::Suspend(300), Attack::MuteArm(700), Attack::CutPad, Attack::CutArm, Attack::Kill];

#[test]
fn no_attack_on_the_serial_pad_and_the_lwr_moves_the_arm() {
    assert_eq!(withstand(Pair::SerialAndLwr, &mut Random::new(1, 0), &FEW), FEW.len());
}

#[test]
fn no_attack_on_the_pad_behind_tcp_and_the_ur_moves_the_arm() {
    assert_eq!(withstand(Pair::TcpAndUr, &mut Random::new(1, 1), &FEW), FEW.len());
}

#[test]
#[ignore = "it takes some minutes: `.ci/edge` runs it"]
fn no_attack_at_many_moments_moves_the_lwr() {
    besiege(Pair::SerialAndLwr);
}

#[test]
#[ignore = "it takes some minutes: `.ci/edge` runs it"]
fn no_attack_at_many_moments_moves_the_ur() {
    besiege(Pair::TcpAndUr);
}

fn besiege(pair: Pair) {
    let rests = withstand_all(pair);
    let text = format!("{pair:?}: the arm rested after each of {rests} attacks\n");
    std::io::stdout().write_all(text.as_bytes()).unwrap();
    assert!(rests as u64 >= 6 * SIEGES, "{rests}");
}
