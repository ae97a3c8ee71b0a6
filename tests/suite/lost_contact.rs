//! A contact that is lost in closed loop: a ball is pulled away from the pad, and stays away or comes back. Judged by the
//! true motion of the sensor and the true force.

use std::fs;

use nalgebra::Vector3;
use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::signal::{Flag, Pose, Scalar};
use tactflow_tests::{catalogue, workspace};

/// When the ball begins to move away [s].
const PULLED_S: f64 = 5.0;
/// How long the arm waits after a loss, before it searches [s].
const WAIT_S: f64 = 1.4;

/// One tick of a run.
struct Moment {
    time_s: f64,
    /// Way of the sensor toward the object since the start [m].
    toward_m: f64,
    touches: bool,
    /// True force on the pad [N].
    force_n: f64,
}

/// Runs a shipped task on a ball that moves along the pad's z by these ways [m] in these times [s].
fn run(task: &str, stiffness: f64, moves: &[(f64, f64, f64)], until_s: f64) -> Vec<Moment> {
    let folder = workspace().join("graphs");
    let moves = moves.iter().map(|(from, to, by)| format!("{{ from_s = {from}, to_s = {to}, by = [0, 0, {by}] }}"));
    let motion = format!("scatter = 0.0005, motion = [{}]", moves.collect::<Vec<_>>().join(", "));
    let ball = fs::read_to_string(folder.join("benches/ball.toml")).unwrap();
    let bench = ball.replace("\"../", &format!("\"{}/", folder.display())).replace("scatter = 0.0005", &motion);
    let bench = bench.replace("[devices.bench]", &format!("[devices.bench]\nstiffness = {stiffness}"));
    assert!(bench.contains("motion = [") && bench.contains("stiffness = "), "{bench}");
    let request = Request { bench_text: Some(bench), ..Request::file(folder.join(format!("{task}.toml"))) };
    let plan = compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false)));
    let (mut engine, mut start, mut moments) = (Engine::new(plan), None, Vec::new());
    let seconds = |now: i64| now as f64 * 1e-9;
    while let Some(next) = engine.next().filter(|next| seconds(*next) < until_s) {
        engine.tick(next).unwrap_or_else(|fault| panic!("{fault}"));
        let Some(Pose(pose)) = engine.get::<Pose>("move.state.sensor_pose") else { continue };
        let (place, normal) = (pose.translation.vector, pose.rotation * Vector3::z());
        let (origin, axis) = *start.get_or_insert((place, normal));
        moments.push(Moment {
            time_s: seconds(next),
            toward_m: (place - origin).dot(&axis),
            touches: engine.get::<Flag>("touch.present").copied().unwrap_or_default(),
            force_n: engine.get::<Scalar>("truth.force").copied().unwrap_or_default(),
        });
    }
    moments
}

/// Splits a run at the first tick without the contact.
fn at_the_loss(moments: &[Moment]) -> (&[Moment], &[Moment]) {
    let lost = moments.iter().position(|moment| moment.time_s > PULLED_S && !moment.touches);
    moments.split_at(lost.expect("the ball is pulled away"))
}

fn greatest(moments: &[Moment], of: impl Fn(&Moment) -> f64) -> f64 {
    moments.iter().map(of).fold(f64::NEG_INFINITY, f64::max)
}

/// The ticks from `from` to `to` [s] after the first of them.
fn between(moments: &[Moment], from: f64, to: f64) -> &[Moment] {
    let index = |time: f64| moments.partition_point(|moment| moment.time_s - moments[0].time_s < time);
    &moments[index(from)..index(to)]
}

#[test]
fn a_stiff_arm_is_at_rest_within_the_time_to_brake_and_stays_there() {
    for task in ["force", "position", "hybrid", "rolling"] {
        let moments = run(task, 20_000.0, &[(PULLED_S, PULLED_S + 0.3, 0.02)], 8.0);
        let (_, after) = at_the_loss(&moments);
        let lost = after[0].toward_m;
        // Brake from 50 mm/s at 2 m/s², after 20 ms without the contact, two periods and the tick of the bench.
        let rest = between(after, 0.02 + 0.05 / 2.0 + 3.0 * 0.004, WAIT_S - 0.004);
        let moved = greatest(rest, |moment| moment.toward_m) - rest[0].toward_m;
        assert!(moved < 0.05e-3, "{task}: {} mm while it should rest", moved * 1e3);
        let pushed = greatest(between(after, 0.0, WAIT_S - 0.004), |moment| moment.toward_m) - lost;
        assert!(pushed < 0.3e-3, "{task}: {} mm into the void", pushed * 1e3);
        let search = between(after, 2.0, 2.5);
        let speed = (search[search.len() - 1].toward_m - search[0].toward_m) / 0.5;
        assert!((0.0..0.0052).contains(&speed), "{task}: a search at {} mm/s", speed * 1e3);
    }
}

#[test]
fn a_compliant_arm_gives_back_its_lead_and_finds_the_object_gently() {
    for task in ["force", "hybrid", "rolling"] {
        let moments = run(task, 200.0, &[(PULLED_S, PULLED_S + 0.3, 0.02)], 12.0);
        let (before, after) = at_the_loss(&moments);
        let lost = after[0].toward_m;
        // The arm has followed the ball, and the first 3 mm of the search are in this: the spring has not pushed the sensor on.
        let settled = between(after, 2.0, 2.1);
        let mean = settled.iter().map(|moment| moment.toward_m - lost).sum::<f64>() / settled.len() as f64;
        assert!((-0.003..0.005).contains(&mean), "{task}: {} mm from where the contact was lost", mean * 1e3);
        let steady = greatest(between(before, 4.0, 4.9), |moment| moment.force_n);
        let found = after.iter().position(|moment| moment.force_n > 0.2).expect("the ball is still in reach");
        let touch = greatest(between(&after[found..], 0.0, 0.1), |moment| moment.force_n);
        assert!(touch < 0.5 * steady, "{task}: {touch} N at the next touch, {steady} N before");
        assert!(after[after.len() - 1].touches, "{task}: the contact is held again");
    }
}

#[test]
fn what_comes_back_at_75_mm_per_second_meets_an_arm_at_rest() {
    // During the rest, and during the search.
    for (task, back) in [("force", 6.0), ("force", 8.0), ("hybrid", 6.0), ("hybrid", 8.0)] {
        let moves = [(PULLED_S, PULLED_S + 0.4, 0.03), (back, back + 0.4, -0.03)];
        let moments = run(task, 200.0, &moves, 12.0);
        let (before, after) = at_the_loss(&moments);
        let steady = greatest(between(before, 4.0, 4.9), |moment| moment.force_n);
        let most = greatest(after, |moment| moment.force_n);
        assert!(most < 2.0 * steady, "{task}: {most} N at the impact after {back} s, {steady} N before");
    }
}
