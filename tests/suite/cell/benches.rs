//! The cell of the tests over wires, and the benches of the tool that runs against it.

use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

use tactflow_tests::workspace;

use super::ball;

/// The simulation of a cell whose pad sends so many frames per second. It ends with `[set]`, so that more can follow.
pub(super) fn simulation(rate_hz: f64) -> String {
    format!("[set]\nrate_hz = {rate_hz:?}\nlatency_s = 0.0\nfor_s = 1e6\n")
}

/// The wires of a cell with a serial pad and the LWR, which sends to a UDP port every `fri_ms`.
pub(super) fn lwr_wires(port: u16, fri_ms: f64, more: &str) -> String {
    format!(
        "[pad]\nwire = 'myrmex'\n[arm]\nwire = 'lwr'\nto = '127.0.0.1:{port}'\n\
         period_ms = {fri_ms:?}\n{more}"
    )
}

/// The wires of a cell with a pad behind TCP and the UR, whose program connects to a TCP port.
pub(super) fn ur_wires(reverse: u16, set: &str) -> String {
    format!("stiffness = 2000.0\n{set}[pad]\nwire = 'tcp'\n[arm]\nwire = 'ur'\nreverse = '127.0.0.1:{reverse}'\n")
}

/// The bench of the serial pad and the LWR.
pub(super) fn lwr_bench(pad: &Path, calibration: &Path, port: u16, rate_hz: f64, fri_ms: f64) -> String {
    format!(
        "
        [bind]
        pad = 'skin'
        arm = 'lwr'
        [devices.skin]
        type = 'agni'
        link = 'serial:{}'
        rate_hz = {rate_hz:?}
        silence_ms = 1000
        calibration = '{}'
        mount = {{ xyz = [0.0, 0.0, 0.03] }}
        [devices.lwr]
        type = 'lwr_fri'
        port = {port}
        sample_ms = {fri_ms:?}
        robot = '{}'
        [limits]
        workspace_min_m = [-0.8, -0.4, 0.1]
        workspace_max_m = [-0.3, 0.4, 0.7]
        ",
        pad.display(),
        calibration.display(),
        workspace().join("graphs/robots/lwr4p.toml").display(),
    )
}

/// The bench of the pad behind a TCP port and the UR, with its ports: reverse interface, RTDE, scripts.
pub(super) fn ur_bench(pad: u16, [reverse, rtde, script]: [u16; 3], rate_hz: f64) -> String {
    format!(
        "
        [bind]
        pad = 'skin'
        arm = 'arm'
        [devices.skin]
        type = 'stream'
        link = 'tcp:127.0.0.1:{pad}'
        frame = 'sync'
        mark = 'hex:5446'
        cell = 'u16le'
        offset = 6
        shape = [16, 16]
        check = 'sum16le'
        clock.counter = {{ offset = 2, cell = 'u32le' }}
        rate_hz = {rate_hz:?}
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
        rtde_port = {rtde}
        script_port = {script}
        receive_timeout_ms = 200
        [limits]
        {UR_WORKSPACE}
        ",
        workspace().join("graphs/calibrations/sim_pad.toml").display(),
        workspace().join("graphs/robots/ur5e.toml").display(),
    )
}

/// Returns the shipped calibration of the simulated pad, for readings that are `full` times smaller, in another unit.
pub(super) fn calibration(folder: &Path, full: f64, unit: &str) -> PathBuf {
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

/// What the UR5e may reach.
const UR_WORKSPACE: &str = "workspace_min_m = [-1.0, -1.0, 0.0]\nworkspace_max_m = [1.0, 1.0, 1.0]\n";

/// A bench with the ball in front of a UR5e, which is stiffer than an LWR.
pub(crate) fn ur_ball(folder: &Path) -> PathBuf {
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
