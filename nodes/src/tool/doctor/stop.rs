//! `doctor --move`: moves an arm slowly, falls silent, and measures how the arm stops by itself.

use std::io::BufRead;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use tactflow_runtime::cli::{Commissioning, Proof, Shell};
use tactflow_runtime::engine::{self, Engine, RunOptions};
use tactflow_runtime::graph::{CommissionedDevice, Request, compile};
use tactflow_runtime::signal::{Freshness, Joints};

use super::Finding;

/// Speed of the tip [m/s].
const SPEED: f64 = 0.005;
/// Time of the motion before this process falls silent [s].
const MOTION_S: f64 = 1.5;
/// Longest time until the arm has moved for this time, with its start [s].
const PATIENCE_S: f64 = 30.0;
/// Time for which the arm is watched after it should be at rest [s].
const WATCH_S: f64 = 1.0;
/// Time before the silence in which the arm must move [s].
const JUST_BEFORE_S: f64 = 0.2;
/// Motion of a joint below which it rests [rad].
const REST_RAD: f64 = 2e-5;

/// An arm of the bench that must be commissioned.
pub(super) struct Arm<'b> {
    /// The role that the bench binds to it.
    pub(super) role: &'b str,
    pub(super) device: &'b CommissionedDevice,
    /// Time after which it is at rest without commands, as it is declared [s].
    pub(super) within: f64,
}

/// Asks for a typed yes.
pub(super) fn is_allowed(shell: &Shell, arm: &Arm<'_>) -> bool {
    shell.say(&format!(
        "The tip of `{}` will move backwards along its own z axis, at {:.0} mm/s for {MOTION_S} s. Then this program falls \
         silent, and the arm must stop by itself within {:.0} ms.\nKeep a hand on the emergency stop. Type `yes` to move:",
        arm.role,
        SPEED * 1e3,
        arm.within * 1e3
    ));
    let mut line = String::new();
    std::io::stdin().lock().read_line(&mut line).is_ok_and(|_| line.trim() == "yes")
}

/// The postures of an arm, with their times [s].
#[derive(Debug, Default)]
struct Track {
    samples: Vec<(f64, Vec<f64>)>,
    /// Time at which this process fell silent.
    silent: Option<f64>,
    /// Why the commands were held before that.
    halt: Option<String>,
}

/// Moves an arm, measures its stop and notes the proof beside the bench.
pub(super) fn prove(shell: &Shell, bench: &Path, arm: &Arm<'_>) -> Vec<Finding> {
    let request = Request::text(task(arm.role)).bench(bench);
    let plan = match compile(shell.catalogue(), &request) {
        Ok(plan) => plan,
        Err(report) => {
            shell.show(&report);
            return vec![Finding::problem("the bench does not load with a task that moves this arm")];
        }
    };
    let mut engine = Engine::new(plan);
    let mut track = Track::default();
    let position = format!("{}.position", arm.role);
    let cancel = Arc::new(AtomicBool::new(false));
    // A stop that nobody can end would end the run before the arm is at rest.
    let sends = vec![(2.0 * PATIENCE_S, "resume".to_owned())];
    let options =
        RunOptions { duration: Some(PATIENCE_S), sends, cancel: Some(cancel.clone()), ..RunOptions::default() };
    let end = MOTION_S + arm.within + WATCH_S;
    let mut began = None;
    let outcome = engine::run(&mut engine, &options, &mut |engine| {
        let now = engine.now() as f64 * 1e-9;
        // The clock has its time zero when the drivers start, and an arm may need a while until it follows commands.
        let moves = engine.commands(&arm.device.name).is_some_and(|command| command.iter().any(|v| *v != 0.0));
        if moves {
            began.get_or_insert(now);
        }
        if track.silent.is_none() && track.halt.is_none() {
            track.halt = engine.halts().first().map(|halt| halt.fault.to_string());
        }
        if began.is_some_and(|began| now > began + MOTION_S) && track.silent.is_none() {
            engine.mute(&arm.device.name, true);
            track.silent = Some(now);
        }
        if began.is_some_and(|began| now > began + end) {
            engine.mute(&arm.device.name, false);
            cancel.store(true, Ordering::Relaxed);
        }
        let mark = engine.mark(&position);
        if mark.freshness(engine.ticks()) == Freshness::New
            && let Some(joints) = engine.get::<Joints>(&position)
        {
            track.samples.push((mark.stamp().nanos as f64 * 1e-9, joints.0.to_vec()));
        }
    });
    // Also after Ctrl-C in the silence.
    engine.mute(&arm.device.name, false);
    match outcome {
        Err(error) => vec![Finding::problem(format!("cannot run: {error}"))],
        Ok(_) => judge(shell, bench, arm, &track),
    }
}

fn judge(shell: &Shell, bench: &Path, arm: &Arm<'_>, track: &Track) -> Vec<Finding> {
    let (Some(silent), None) = (track.silent, &track.halt) else {
        let why = track.halt.as_deref().unwrap_or("it got no command");
        return vec![Finding::problem(format!("the arm did not move as it was commanded: {why}"))];
    };
    let Some((time, way)) = track.stop() else {
        return vec![Finding::problem(
            "the arm did not move before this program fell silent, or sent no postures after it",
        )];
    };
    let text = format!(
        "without commands, it was at rest after {:.0} ms; its fastest joint moved by {:.2} mrad in this time (declared: {:.0} ms)",
        time * 1e3,
        way * 1e3,
        arm.within * 1e3
    );
    let is_watched = track.samples.last().is_some_and(|(last, _)| *last > silent + arm.within);
    if time > arm.within || !is_watched {
        return vec![Finding::problem(text + ": it is not proven that it stops in time, so runs stay slow")];
    }
    let proof = Proof {
        fingerprint: arm.device.fingerprint.clone(),
        stopped_after_ms: (time * 1e4).round() / 10.0,
        stopped_after_mrad: (way * 1e5).round() / 100.0,
    };
    let noted = Commissioning::read(bench).and_then(|mut commissioning| {
        commissioning.add(&arm.device.name, proof);
        commissioning.write(bench).map_err(|error| format!("cannot write beside `{}`: {error}", bench.display()))
    });
    match noted {
        Ok(()) => {
            let path = Commissioning::path(bench);
            shell.say(&format!("wrote {}", path.display()));
            vec![Finding::fine(text)]
        }
        Err(message) => vec![Finding::fine(text), Finding::problem(message)],
    }
}

impl Track {
    /// Returns the time from the silence until the arm was at rest [s], and the way of its fastest joint [rad]; `None` if
    /// it did not move before, or sent nothing after it.
    fn stop(&self) -> Option<(f64, f64)> {
        let silent = self.silent?;
        let off = |one: &[f64], other: &[f64]| one.iter().zip(other).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        let (last_time, last) = self.samples.last()?;
        let at_or_before = |limit: f64| self.samples.iter().rev().find(|(time, _)| *time <= limit);
        let ((_, at), (_, before)) = (at_or_before(silent)?, at_or_before(silent - JUST_BEFORE_S)?);
        // An arm that had stopped for another reason proves nothing.
        if off(before, at) < REST_RAD || *last_time <= silent {
            return None;
        }
        let moving = self.samples.iter().rev().find(|(_, posture)| off(posture, last) > REST_RAD);
        let time = moving.map_or(0.0, |(time, _)| (time - silent).max(0.0));
        Some((time, off(at, last)))
    }
}

/// Returns a task that moves the tip of a bare arm backwards.
fn task(role: &str) -> String {
    let patience = PATIENCE_S * 1e3;
    format!(
        "[graph]
clock = \"{role}\"
start = \"wait\"

[roles]
{role} = \"bare_arm\"

[commands]
{role}.velocity = \"move.velocity\"

[nodes.guide]
type = \"twist_source\"
twist = [0, 0, 0, 0, 0, 0]

[parts.move]
file = \"builtin:parts/bare_move.toml\"
roles = {{ arm = \"{role}\" }}
in.twist = \"guide.twist\"
in.position = \"{role}.position\"
in.equilibrium = \"{role}.equilibrium\"

[modes.wait]
go = {{ to = \"back\", when = \"{role}.safety\", for_ms = 200 }}
fail = {{ after_ms = {patience} }}

[modes.back]
set.guide.twist = [0, 0, -{SPEED}, 0, 0, 0]
done = {{ after_ms = {patience} }}

[limits]
linear_m_per_s = {SPEED}
angular_rad_per_s = 0.05
linear_m_per_s2 = 0.02
angular_rad_per_s2 = 0.2
joint_rad_per_s2 = 2.0
lead_rad = 0.05
"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A joint at 0.1 rad/s until `stop`, sampled every 10 ms for 2 s; silence at 1 s.
    fn track(stop: f64) -> Track {
        let sample = |i: i32| {
            let time = f64::from(i) * 0.01;
            (time, vec![0.0, 0.1 * time.min(stop)])
        };
        Track { samples: (0..=200).map(sample).collect(), silent: Some(1.0), halt: None }
    }

    #[test]
    fn the_stop_is_measured_from_the_silence() {
        let (time, way) = track(1.25).stop().unwrap();
        assert!((time - 0.24).abs() < 0.011 && (way - 0.025).abs() < 1e-9, "{time} s, {way} rad");
        assert_eq!(track(0.7).stop(), None, "it had stopped before");
    }

    #[test]
    fn an_arm_that_never_moved_or_never_reported_proves_nothing() {
        assert_eq!(track(0.0).stop(), None);
        let mut cut = track(1.25);
        cut.samples.retain(|(time, _)| *time <= 1.0);
        assert_eq!(cut.stop(), None);
        assert_eq!(Track { silent: None, ..track(1.25) }.stop(), None);
    }
}
