//! Tasks that run against the cell: over a serial pad and the LWR, and over a pad behind TCP and the UR. The same task
//! on the same bench without wires says how good they can be.

use std::fmt::Write as _;
use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use tactflow_runtime::engine::{End, Engine, RunOptions, run};
use tactflow_runtime::graph::{Request, compile};
use tactflow_tests::{catalogue, workspace};

use super::{Cell, Figures, ball, free_udp_port};
use crate::sim::course;

/// A run of the task.
#[derive(Debug, Clone, Copy)]
struct Trial {
    /// Frames of the pad per second.
    rate_hz: f64,
    /// Time between two messages of the LWR [ms].
    fri_ms: f64,
    /// Duration [s].
    duration: f64,
}

/// As many frames as a busy machine simulates in time, and as long as it takes to hold the contact.
const SHORT: Trial = Trial { rate_hz: 100.0, fri_ms: 4.0, duration: 6.0 };
/// The rate of the paper. The robot sends twice as often, so that the first other command after an image is the answer to
/// this image.
const LONG: Trial = Trial { rate_hz: 250.0, fri_ms: 2.0, duration: 30.0 };
/// Time at the end in which the contact is held [s].
const HELD: f64 = 1.5;
/// Pressure that the task keeps [N per tactel].
const PRESSURE: f64 = 0.1;

/// How well a contact is held: means over the end of a run.
#[derive(Debug)]
struct Held {
    /// Centre of pressure [m].
    x: f64,
    y: f64,
    /// [N per tactel]
    pressure: f64,
    /// Standard deviation of x and y [m].
    unrest: f64,
}

impl Held {
    /// Computes the means of rows of time, x, y and pressure.
    fn of(rows: &[[f64; 4]]) -> Self {
        let end = rows.last().expect("the run has rows")[0];
        let held: Vec<[f64; 4]> = rows.iter().filter(|row| row[0] > end - HELD).copied().collect();
        let count = held.len() as f64;
        let [x, y, pressure] = [1, 2, 3].map(|i| held.iter().map(|row| row[i]).sum::<f64>() / count);
        let square = |row: &[f64; 4]| (row[1] - x).powi(2) + (row[2] - y).powi(2);
        let unrest = (held.iter().map(square).sum::<f64>() / count).sqrt();
        Self { x, y, pressure, unrest }
    }

    /// Checks that the contact is in the centre, within half a tactel, and its pressure within a fifth; without a
    /// contact, all are not numbers.
    fn check(&self, figures: &str) {
        assert!(self.x.abs() < 0.0025 && self.y.abs() < 0.0025, "{self:?} {figures}");
        assert!((self.pressure - PRESSURE).abs() < 0.2 * PRESSURE, "{self:?} {figures}");
        assert!(self.unrest < 0.001, "{self:?} {figures}");
    }
}

/// Returns the shipped calibration of the simulated pad, for readings that are `full` times smaller, in another unit.
fn calibration(folder: &Path, full: f64, unit: &str) -> PathBuf {
    let text = fs::read_to_string(workspace().join("graphs/calibrations/sim_pad.toml")).unwrap();
    let table: toml::Table = toml::from_str(&text).unwrap();
    let mut scaled = format!(
        "kind = 'calibration'\nversion = 1\ncurve = 'rational'\nrows = 16\ncols = 16\nreading = '{unit}'\nunit = 'N'\n\
         dead = []\ntactels = [\n"
    );
    for tactel in table["tactels"].as_array().unwrap() {
        let number = |name: &str| tactel[name].as_float().unwrap();
        let (offset, gain, squash) = (number("offset") / full, number("gain") * full, number("squash") * full);
        let (at, most) = (&tactel["at"], number("most"));
        writeln!(scaled, "{{ at = {at}, offset = {offset}, gain = {gain}, squash = {squash}, most = {most} }},")
            .unwrap();
    }
    scaled.push_str("]\n");
    let path = folder.join("calibration.toml");
    fs::write(&path, scaled).unwrap();
    path
}

/// Runs the hybrid task on a bench.
///
/// # Errors
/// If the run was held or stopped, as on a machine that is too busy to send commands in time.
fn run_hybrid(bench: String, trial: Trial) -> Result<(), String> {
    let graph = workspace().join("graphs/hybrid.toml");
    let request = Request { bench_text: Some(bench), ..Request::file(graph) };
    let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let mut engine = Engine::new(plan);
    let options = RunOptions { duration: Some(trial.duration), ..RunOptions::default() };
    let outcome = run(&mut engine, &options, &mut |_| {}).unwrap();
    if outcome.end != End::Duration || !engine.halts().is_empty() {
        return Err(format!("{:?} {:?}", outcome.end, engine.halts()));
    }
    assert_eq!(engine.mode(), Some("servo"), "{:?}", engine.changes());
    Ok(())
}

/// Runs a trial up to three times, until it was not held by a busy machine. Returns its figures.
fn patiently(run: fn(Trial) -> Result<String, String>, trial: Trial) -> String {
    const TRIALS: usize = 3;
    let mut held = Vec::new();
    for _ in 0..TRIALS {
        match run(trial) {
            Ok(figures) => return figures,
            Err(why) => held.push(why),
        }
    }
    panic!("it was held {TRIALS} times: {held:?}");
}

/// Returns time, centre and pressure of each row of truth.csv.
fn truth(figures: &Figures) -> Vec<[f64; 4]> {
    // At the end of the run the arm stops, and nothing holds the contact any more.
    let last = figures.commands.iter().rev().find(|row| row[2] == 1.0 && row[3..].iter().any(|v| *v != 0.0));
    let end = last.expect("the arm is commanded")[0] - 0.5;
    figures.truth.iter().filter(|row| row[0] < end).map(|row| [row[0], row[2], row[3], row[4]]).collect()
}

/// Returns how well the same task holds the contact without wires.
fn without_wires(trial: Trial, bench: &Path, set: &[&str]) -> Held {
    let rate = format!("devices.bench.rate_hz={:?}", trial.rate_hz);
    let request = Request::file(workspace().join("graphs/hybrid.toml")).bench(bench).set(rate);
    let request = set.iter().fold(request, |request, set| request.set(*set));
    let rows = course(&request, trial.duration, &["truth.x", "truth.y", "truth.pressure"]);
    let rows = rows.iter().enumerate().map(|(i, row)| [i as f64 / trial.rate_hz, row[0], row[1], row[2]]);
    Held::of(&rows.collect::<Vec<_>>())
}

/// Checks the quality of a run, and that it is that of the same task without wires. Returns the figures of both.
fn compare(figures: &Figures, without: &Held, trial: Trial) -> String {
    let with = Held::of(&truth(figures));
    let text = format!("over wires:    {with:?}\nwithout wires: {without:?}\n{}\n", figures.summary);
    without.check(&text);
    with.check(&text);
    let age = &figures.summary["since_image_ms"];
    assert!(age["count"].as_u64().unwrap() > 100 && age["p50"].as_f64().unwrap() < 1e3 / trial.rate_hz + 10.0, "{age}");
    text
}

fn simulation(trial: Trial) -> String {
    format!("[set]\nrate_hz = {:?}\nlatency_s = 0.0\nfor_s = 1e6\n", trial.rate_hz)
}

/// Runs the task over a serial pad and the LWR. Returns its figures.
///
/// # Errors
/// If the run was held.
fn serial_pad_and_lwr(trial: Trial) -> Result<String, String> {
    let port = free_udp_port();
    let wires = format!(
        "{}[pad]\nwire = 'myrmex'\n[arm]\nwire = 'lwr'\nto = '127.0.0.1:{port}'\nmissed_per_level = 50\n\
         period_ms = {:?}\n",
        simulation(trial),
        trial.fri_ms
    );
    let cell = Cell::start(&ball(), &wires);
    let calibration = calibration(cell.folder.path(), 4095.0, "1");
    let bench = format!(
        "
        [bind]
        pad = 'skin'
        arm = 'lwr'
        [devices.skin]
        type = 'agni'
        link = 'serial:{}'
        rate_hz = {:?}
        silence_ms = 1000
        calibration = '{}'
        mount = {{ xyz = [0.0, 0.0, 0.03] }}
        [devices.lwr]
        type = 'lwr_fri'
        port = {port}
        sample_ms = {:?}
        robot = '{}'
        [limits]
        workspace_min_m = [-0.8, -0.4, 0.1]
        workspace_max_m = [-0.3, 0.4, 0.7]
        ",
        cell.pad_path().display(),
        trial.rate_hz,
        calibration.display(),
        trial.fri_ms,
        workspace().join("graphs/robots/lwr4p.toml").display()
    );
    run_hybrid(bench, trial)?;
    let figures = cell.end();
    let arm = &figures.summary["arm"];
    assert_eq!(
        [&arm["starts"], &arm["faults"], &arm["unmirrored"], &arm["interpolation_errors"], &arm["changed_flags"]],
        [1, 0, 0, 0, 0].map(serde_json::Value::from).each_ref(),
        "{}",
        figures.summary
    );
    Ok(compare(&figures, &without_wires(trial, &ball(), &[]), trial))
}

/// What the UR5e may reach.
const UR_WORKSPACE: &str = "workspace_min_m = [-1.0, -1.0, 0.0]\nworkspace_max_m = [1.0, 1.0, 1.0]\n";

/// A bench with the ball in front of a UR5e, which is stiffer than an LWR.
fn ur_bench(folder: &Path) -> PathBuf {
    let text = fs::read_to_string(ball()).unwrap();
    let robots = workspace().join("graphs/robots");
    let text = text.replace("../robots/lwr4p.toml", robots.join("ur5e.toml").to_str().unwrap());
    let (text, _) = text.split_once("[limits]").expect("the bench has limits");
    let text = format!("{text}[limits]\n{UR_WORKSPACE}");
    let text = text.replace("../calibrations", workspace().join("graphs/calibrations").to_str().unwrap());
    let path = folder.join("bench.toml");
    fs::write(&path, text).unwrap();
    path
}

/// Runs the task over a pad behind TCP and the UR. Returns its figures.
///
/// # Errors
/// If the run was held.
fn tcp_pad_and_ur(trial: Trial) -> Result<String, String> {
    let folder = tempfile::tempdir().unwrap();
    let reverse = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let wires = format!(
        "{}stiffness = 2000.0\n[pad]\nwire = 'tcp'\n[arm]\nwire = 'ur'\nreverse = '127.0.0.1:{reverse}'\n",
        simulation(trial)
    );
    let ball = ur_bench(folder.path());
    let cell = Cell::start(&ball, &wires);
    let place = |device: &str, port: &str| cell.place[device][port].as_u64().unwrap();
    let bench = format!(
        "
        [bind]
        pad = 'skin'
        arm = 'arm'
        [devices.skin]
        type = 'stream'
        link = 'tcp:127.0.0.1:{}'
        frame = 'sync'
        mark = 'hex:5446'
        cell = 'u16le'
        offset = 6
        shape = [16, 16]
        check = 'sum16le'
        clock.counter = {{ offset = 2, cell = 'u32le' }}
        rate_hz = {:?}
        timeout_ms = 500
        pitch = 0.005
        calibration = '{}'
        threshold = 0.015
        pressure = 0.1
        mount = {{ xyz = [0.0, 0.0, 0.03] }}
        [devices.arm]
        type = 'ur'
        address = '127.0.0.1'
        robot = '{}'
        reverse_port = {reverse}
        rtde_port = {}
        script_port = {}
        receive_timeout_ms = 200
        [limits]
        {UR_WORKSPACE}
        ",
        place("pad", "port"),
        trial.rate_hz,
        workspace().join("graphs/calibrations/sim_pad.toml").display(),
        workspace().join("graphs/robots/ur5e.toml").display(),
        place("arm", "rtde_port"),
        place("arm", "script_port"),
    );
    run_hybrid(bench, trial)?;
    let figures = cell.end();
    let arm = &figures.summary["arm"];
    let counts = [&arm["programs"], &arm["faults"], &arm["timeouts"], &arm["stops"]];
    assert_eq!(counts, [1, 0, 0, 1].map(serde_json::Value::from).each_ref(), "{}", figures.summary);
    Ok(compare(&figures, &without_wires(trial, &ball, &["devices.bench.stiffness=2000.0"]), trial))
}

#[test]
fn the_hybrid_task_holds_a_contact_over_a_serial_pad_and_the_lwr() {
    patiently(serial_pad_and_lwr, SHORT);
}

#[test]
fn the_hybrid_task_holds_a_contact_over_a_pad_behind_tcp_and_the_ur() {
    patiently(tcp_pad_and_ur, SHORT);
}

#[test]
#[ignore = "it takes a minute on a machine that does nothing else: `.ci/edge` runs it"]
fn figures_of_the_hybrid_task_over_wires() {
    let lwr = patiently(serial_pad_and_lwr, LONG);
    let ur = patiently(tcp_pad_and_ur, LONG);
    let text = format!("\na serial pad and the LWR\n{lwr}\na pad behind TCP and the UR\n{ur}\n");
    std::io::stdout().write_all(text.as_bytes()).unwrap();
}
