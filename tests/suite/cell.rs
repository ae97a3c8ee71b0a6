//! The simulated cell as a process, and tasks that run against it over the wires of real devices.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::net::UdpSocket;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde_json::Value;
use tactflow_tests::workspace;

use crate::peer::SOON;

mod attacks;
pub(crate) mod benches;
mod relay;
mod tasks;

/// A cell that runs.
pub(crate) struct Cell {
    child: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
    /// Where it is served.
    place: Value,
    folder: tempfile::TempDir,
}

/// What a cell has measured.
struct Figures {
    /// Its last line.
    summary: Value,
    /// Rows of truth.csv: time, force, x, y, pressure, tip, sensor, speed; NaN where there is nothing.
    truth: Vec<Vec<f64>>,
    /// Rows of commands.csv: time, time since the last image, whether it is followed, velocities.
    commands: Vec<Vec<f64>>,
    /// Rows of motion.csv: time and the largest speed of a joint.
    motion: Vec<Vec<f64>>,
}

impl Cell {
    /// Starts a cell. Its file gets the pad and the arm from `wires`.
    pub(crate) fn start(bench: &Path, wires: &str) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cell.toml");
        fs::write(&path, format!("bench = '{}'\nlog = 'log'\n{wires}", bench.display())).unwrap();
        let mut command = Command::new(env!("CARGO_BIN_EXE_tactflow-cell"));
        command.arg(&path).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut output = BufReader::new(child.stdout.take().unwrap());
        let mut line = String::new();
        output.read_line(&mut line).unwrap();
        let place = serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line:?}"));
        Self { input: child.stdin.take(), child, output, place, folder }
    }

    /// The path of the pad's terminal.
    fn pad_path(&self) -> PathBuf {
        self.place["pad"]["path"].as_str().unwrap().into()
    }

    /// A port on which it serves a device.
    pub(crate) fn port(&self, (device, name): (&str, &str)) -> u16 {
        self.place[device][name].as_u64().and_then(|port| port.try_into().ok()).unwrap()
    }

    /// Says a word to the cell. Returns when it came [s], and how fast the arm moved then [rad/s].
    fn tell(&mut self, word: &str) -> [f64; 2] {
        writeln!(self.input.as_mut().expect("it has not ended"), "{word}").unwrap();
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        let told: Value = serde_json::from_str(&line).unwrap_or_else(|error| panic!("{error}: {line:?}"));
        assert_eq!(told["told"], word);
        ["t_s", "speed_rad_s"].map(|key| told[key].as_f64().unwrap())
    }

    /// Ends the cell, by the end of its input.
    fn end(mut self) -> Figures {
        self.input = None;
        let mut line = String::new();
        self.output.read_line(&mut line).unwrap();
        assert!(self.child.wait().unwrap().success(), "{line}");
        let rows = |name: &str| {
            let text = fs::read_to_string(self.folder.path().join("log").join(name)).unwrap();
            let number = |field: &str| field.parse().unwrap_or(f64::NAN);
            text.lines().skip(1).map(|line| line.split(',').map(number).collect()).collect()
        };
        Figures {
            summary: serde_json::from_str(&line).unwrap(),
            truth: rows("truth.csv"),
            commands: rows("commands.csv"),
            motion: rows("motion.csv"),
        }
    }
}

impl Drop for Cell {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn ball() -> PathBuf {
    workspace().join("graphs/benches/ball.toml")
}

/// Answers each MSR of the controller until `until` says so of a position: in command mode joint 1 moves on by 0.4 mrad
/// in each answer, which is 0.1 rad/s.
fn drive(socket: &UdpSocket, until: f64) {
    let (mut msr, mut target, mut sequence) = ([0; 1000], None, 0_u16);
    loop {
        let (count, from) = socket.recv_from(&mut msr).unwrap();
        assert_eq!(count, 916);
        let float = |at: usize| f32::from_le_bytes([msr[at], msr[at + 1], msr[at + 2], msr[at + 3]]);
        if f64::from(float(216)) > until {
            return;
        }
        let mut position: [f32; 7] = std::array::from_fn(|i| float(292 + 4 * i) + float(320 + 4 * i));
        if msr[144] == 2 {
            position[0] = target.unwrap_or(position[0]) + 0.0004;
            target = Some(position[0]);
        }
        sequence += 1;
        let mut cmd = [0; 376];
        cmd[..2].copy_from_slice(&sequence.to_le_bytes());
        cmd[2..4].copy_from_slice(&msr[..2]);
        cmd[4..8].copy_from_slice(&[0x78, 0x01, 0x05, 0x10]);
        cmd[140] = 1;
        for (i, q) in position.iter().enumerate() {
            cmd[144 + 4 * i..148 + 4 * i].copy_from_slice(&q.to_le_bytes());
        }
        socket.send_to(&cmd, from).unwrap();
    }
}

#[test]
fn a_cell_moves_as_it_is_commanded_and_rests_when_nobody_answers() {
    let driver = UdpSocket::bind("127.0.0.1:0").unwrap();
    driver.set_read_timeout(Some(SOON)).unwrap();
    let wires = format!(
        "pad.wire = 'flexitac'\n[arm]\nwire = 'lwr'\nto = '{}'\nstart_s = 0.1\nmissed_per_level = 25\n",
        driver.local_addr().unwrap()
    );
    let cell = Cell::start(&ball(), &wires);
    assert!(cell.pad_path().starts_with("/dev"), "{:?}", cell.place);
    drive(&driver, 0.05);
    // Nobody answers any more. The quality falls to bad within 50 periods of 4 ms, and the compliant arm swings out.
    let (mut msr, mut last, mut at_rest) = ([0; 1000], 0.0, 0);
    while at_rest < 100 {
        driver.recv_from(&mut msr).unwrap();
        let position = f32::from_le_bytes([msr[216], msr[217], msr[218], msr[219]]);
        let is_at_rest = msr[144] == 1 && (position - last).abs() < 1e-5;
        (last, at_rest) = (position, if is_at_rest { at_rest + 1 } else { 0 });
    }
    let Figures { summary, truth, commands, motion } = cell.end();
    let arm = &summary["arm"];
    assert_eq!((&arm["starts"], &arm["drops"], &arm["faults"]), (&1.into(), &1.into(), &0.into()), "{summary}");
    assert_eq!(arm["unmirrored"], 0, "{summary}");
    let followed: Vec<f64> = commands.iter().filter(|row| row[2] == 1.0).map(|row| row[3]).collect();
    let mean = followed.iter().sum::<f64>() / followed.len() as f64;
    assert!((mean - 0.1).abs() < 0.02, "{mean}");
    let fastest = motion.iter().map(|row| row[1]).fold(0.0, f64::max);
    assert!((fastest - 0.1).abs() < 0.02 && motion.last().unwrap()[1] == 0.0, "{fastest}");
    assert!(truth.last().unwrap()[11] < 0.01, "it rests: {:?}", truth.last());
    assert!((truth.last().unwrap()[6] - truth[0][6]).abs() > 0.02, "its tip has moved along y");
}

#[test]
fn a_cell_that_cannot_be_served_says_why() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("cell.toml");
    let lwr = "[arm]\nwire = 'lwr'\nto = '127.0.0.1:1'\n";
    let ball = ball();
    for (text, expected) in [
        (format!("bench = 'nothing.toml'\npad.wire = 'flexitac'\n{lwr}"), "nothing.toml: No such file"),
        (format!("bench = '{}'\npad.wire = 'braille'\n{lwr}", ball.display()), "unknown variant `braille`"),
        (format!("bench = '{}'\npad = {{ wire = 'tcp', bits = 3 }}\n{lwr}", ball.display()), "unknown field `bits`"),
        (format!("bench = '{}'\npad.wire = 'tcp'\narm.wire = 'ur'\n", ball.display()), "a UR has 6 joints"),
        (format!("bench = '{}'\nset = {{ stiffnes = 1 }}\npad.wire = 'tcp'\n{lwr}", ball.display()), "stiffnes"),
    ] {
        fs::write(&path, text).unwrap();
        let said = crate::tool::said(Command::new(env!("CARGO_BIN_EXE_tactflow-cell")).arg(&path));
        assert!(said.code == 1 && said.err.contains(expected), "{expected}: {}", said.err);
    }
}
