//! The arm in a graph, in a process that is stopped, killed and cut off.

use std::fs;
use std::io::Write;
use std::process::{Child, Command, Stdio};

use tempfile::TempDir;

use super::*;
use crate::cli::in_new_folder;
use crate::tool::tool;

/// The tip goes along its own axis.
const GRAPH: &str = "[graph]\nclock = 'arm'\nstart = 'there'\n[policy]\ndevice = 'hold'\n[roles]\narm = 'bare_arm'\n\
    [commands]\narm.velocity = 'move.velocity'\n\
    [nodes.wave]\ntype = 'twist_source'\ntwist = [0, 0, 0, 0, 0, 0]\n\
    [parts.move]\nfile = 'builtin:parts/bare_move.toml'\nin.twist = 'wave.twist'\nin.position = 'arm.position'\n\
    in.equilibrium = 'arm.equilibrium'\n\
    [modes.there]\nset.wave.twist = [0, 0, 0.015, 0, 0, 0]\nfail = { after_ms = 30000 }\n\
    [limits]\nlinear_m_per_s = 0.05\nangular_rad_per_s = 0.8\nlinear_m_per_s2 = 2.0\nangular_rad_per_s2 = 10.0\n\
    workspace_min_m = [-0.8, -0.4, 0.1]\nworkspace_max_m = [-0.3, 0.4, 0.7]\n\
    [bind]\narm = 'arm'\n[devices.arm]\ntype = 'lwr_fri'\nrobot = 'builtin:lwr4p.toml'\nwait_s = 30.0\n";

/// What a joint moves in a cycle when nothing moves it [rad].
const STILL: f64 = 1e-6;

/// A run of the graph, and the controller of its arm.
struct Run {
    child: Child,
    krc: Controller,
    err: std::path::PathBuf,
    _folder: TempDir,
}

/// Starts the graph, and a controller with its process.
fn start(args: &str, events: &str) -> Run {
    let port = free_udp_port();
    let (folder, graph) = in_new_folder("graph.toml");
    fs::write(&graph, format!("{GRAPH}port = {port}\n")).unwrap();
    let err = folder.path().join("err.txt");
    let mut command = tool(&["run", &graph, "--listen", "--slow", "1"]);
    let stderr = fs::File::create(&err).unwrap();
    let child = command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(stderr).spawn().unwrap();
    let args = format!("{args} --cycles --lag-s 0.02 --pid {}", child.id());
    let krc = Controller::start(port, &args, events);
    Run { child, krc, err, _folder: folder }
}

impl Run {
    fn resume(&mut self) {
        self.child.stdin.as_mut().unwrap().write_all(b"resume\n").unwrap();
    }

    /// Sends `resume` until the arm moves, as a busy machine may halt it again.
    fn resume_until_it_moves(&mut self) {
        for _ in 0..40 {
            self.resume();
            let from = self.krc.0.count();
            thread::sleep(Duration::from_millis(300));
            if speed(&self.krc.0.said(from)) > 3e-5 {
                return;
            }
        }
        panic!("it never moves again: {}", self.err());
    }

    /// Waits until the run writes something to standard error.
    fn wait_for_err(&self, text: &str) {
        let end = Instant::now() + SOON;
        while !self.err().contains(text) {
            assert!(Instant::now() < end, "{}", self.err());
            thread::sleep(Duration::from_millis(20));
        }
    }

    fn err(&self) -> String {
        fs::read_to_string(&self.err).unwrap()
    }

    /// Ends the run, and returns what the controller saw.
    fn end(&mut self) -> Value {
        let kill = Command::new("kill").args(["-INT", &self.child.id().to_string()]).status().unwrap();
        assert!(kill.success());
        assert!(self.child.wait().unwrap().code().is_some(), "it ends by itself");
        self.krc.seen()
    }
}

impl Drop for Run {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Returns the largest step of a joint between two cycles [rad].
fn speed(said: &[Value]) -> f64 {
    let totals: Vec<Vec<f64>> = said
        .iter()
        .filter(|said| said["event"] == "cycle")
        .map(|said| said["total"].as_array().unwrap().iter().filter_map(Value::as_f64).collect())
        .collect();
    let steps = totals.windows(2).flat_map(|pair| pair[0].iter().zip(&pair[1]).map(|(a, b)| (a - b).abs()));
    steps.fold(0.0, f64::max)
}

/// Returns what was said between two events: from `from` on, and before `to`.
fn between<'s>(said: &'s [Value], from: &str, to: Option<&str>) -> &'s [Value] {
    let place = |what: &str| said.iter().position(|said| said["what"] == what);
    let from = place(from).unwrap_or_else(|| panic!("no `{from}`"));
    &said[from..to.map_or(said.len(), |to| place(to).unwrap_or_else(|| panic!("no `{to}`")))]
}

/// Whether the controller drops the session to monitor.
fn is_drop(said: &Value) -> bool {
    said["event"] == "state" && said["state"] == 1
}

#[test]
fn a_drop_to_monitor_stops_the_run_and_it_goes_on_after_resume() {
    let mut run =
        start("--seconds 20 --silence-ms 1500 --restart-s 0.2 --until-silent", r#"[{"at": 1.0, "do": "monitor"}]"#);
    let dropped = number(&run.krc.wait_for(|said| said["what"] == "monitor"), "t");
    // The controller takes positions again, and nothing moves.
    let is_after = |said: &Value, time: f64| number(said, "t") > time;
    let again = run.krc.wait_for(|said| said["event"] == "state" && said["state"] == 2 && is_after(said, dropped));
    let again = number(&again, "t");
    run.krc.wait_for(|said| said["event"] == "cycle" && is_after(said, again + 0.5));
    let after: Vec<Value> = run.krc.0.said(0).iter().filter(|said| is_after(said, dropped + 0.1)).cloned().collect();
    assert!(after.len() > 50 && speed(&after) < STILL, "{} lines, {}", after.len(), speed(&after));
    run.wait_for_err("does not follow commands: its FRI session is in the state monitor (1)");
    run.resume_until_it_moves();
    let seen = run.end();
    assert_clean(&seen, 0.004);
    assert_eq!(seen["flags"][0], 0x31, "the robot file states stiffness and damping: {seen}");
}

#[test]
fn a_process_that_is_killed_leaves_an_arm_that_stops_within_the_declared_time() {
    for at in [0.05, 0.41, 0.83] {
        let events = format!(r#"[{{"at": {at}, "do": "kill_process"}}]"#);
        let run = start("--seconds 4 --silence-ms 150 --until-silent", &events);
        run.krc.seen();
        let said = run.krc.0.said(0);
        let killed = between(&said, "kill_process", None);
        let late = |said: &&Value| number(said, "t") > number(&killed[0], "t") + 0.2;
        let after: Vec<Value> = killed.iter().filter(late).cloned().collect();
        assert!(after.len() > 20 && speed(&after) < STILL, "{at} s: {}", speed(&after));
        assert!(killed.iter().any(is_drop), "the session drops");
    }
}

#[test]
fn a_process_that_was_stopped_and_continues_moves_nothing_until_the_operator_resumes() {
    let events = r#"[{"at": 0.9, "do": "stop_process"}, {"at": 1.6, "do": "continue_process"}]"#;
    let mut run = start("--seconds 20 --silence-ms 150 --restart-s 0.1 --until-silent", events);
    let continued = run.krc.wait_for(|said| said["what"] == "continue_process");
    run.krc.wait_for(|said| number(said, "t") > number(&continued, "t") + 1.0);
    let said = run.krc.0.said(0);
    let after = between(&said, "continue_process", None);
    assert!(speed(after) < STILL, "{}", speed(after));
    let stopped = between(&said, "stop_process", Some("continue_process"));
    let late = |said: &&Value| number(said, "t") > number(&stopped[0], "t") + 0.2;
    let rest: Vec<Value> = stopped.iter().filter(late).cloned().collect();
    assert!(speed(&rest) < STILL && stopped.iter().any(is_drop));
    run.resume_until_it_moves();
    let seen = run.end();
    assert_clean(&seen, 0.004);
    // 0.7 s of measurements lie in the socket then. Only the one that was read at the signal, and the newest, may be
    // answered; each pause of a busy machine adds as many.
    assert!(count(&seen, "old_answers") < 20, "{seen}");
}

#[test]
fn a_cable_that_swallows_everything_for_a_moment_stops_the_arm_until_the_operator_resumes() {
    // Measurements are lost, or answers.
    for what in [r#""do": "lose", "count": 100"#, r#""do": "swallow", "count": 100"#] {
        let events = format!(r#"[{{"at": 1.0, {what}}}]"#);
        let mut run = start("--seconds 20 --silence-ms 150 --restart-s 0.1 --until-silent", &events);
        let cut = run.krc.wait_for(|said| said["event"] == "do");
        run.krc.wait_for(is_drop);
        run.krc.wait_for(|said| number(said, "t") > number(&cut, "t") + 1.5);
        let late = |said: &&Value| number(said, "t") > number(&cut, "t") + 0.2;
        let rest: Vec<Value> = run.krc.0.said(0).iter().filter(late).cloned().collect();
        assert!(speed(&rest) < STILL, "{what}: {}", speed(&rest));
        run.resume_until_it_moves();
        assert_clean(&run.end(), 0.004);
    }
}
