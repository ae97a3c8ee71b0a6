//! The shipped tasks beside a reference controller that was tuned by hand, in the same random scenes of the physics
//! engine MuJoCo. `.ci/edge` installs it and runs this.

use std::io::Write as _;
use std::thread;

use crate::engine::run_with;

/// Scenes of each row.
const SCENES: u32 = 10;
/// Ratio to the reference that no median and no worst response may exceed, and a difference that always may be [1, s].
/// The scenes are few, and a response lasts until the last swing has left its bounds.
const SLOWER: (f64, f64) = (1.2, 0.05);
/// Frames without a contact that a run may have after the first 25.
const LOST: f64 = 25.0;

/// The reference: the filters of the task and constant gains, without `rise`, `limit`, `brake_above`, schedule and
/// damping.
const FORCE: [&str; 4] = [
    "nodes.pid.gains.pressure={ kp = 0.35, ki = 0.06, within = 0.02 }",
    "nodes.schedule.min=1.0",
    "nodes.schedule.max=1.0",
    "nodes.damping.rate=0.0",
];
const PLACE: [&str; 2] = ["nodes.pid.gains.x={ kp = 2.0, ki = 0.4 }", "nodes.pid.gains.y={ kp = 2.0, ki = 0.4 }"];

/// A task on an object: what it controls, and how fast the paper's own robot was, if the paper says it [s].
struct Row {
    task: &'static str,
    object: &'static str,
    features: &'static [(&'static str, f64)],
}

const ANY: f64 = f64::INFINITY;
const POSITION: &[(&str, f64)] = &[("x", 0.9), ("y", 0.9)];
const HYBRID: &[(&str, f64)] = &[("pressure", 1.5), ("x", 0.9), ("y", 0.9)];
const ROLLING: &[(&str, f64)] = &[("pressure", ANY), ("x", ANY), ("y", ANY)];
const ROWS: [Row; 12] = [
    Row { task: "force", object: "pen", features: &[("pressure", 3.0)] },
    Row { task: "force", object: "box", features: &[("pressure", 1.2)] },
    Row { task: "force", object: "ball", features: &[("pressure", 0.6)] },
    Row { task: "position", object: "pen", features: POSITION },
    Row { task: "position", object: "box", features: POSITION },
    Row { task: "position", object: "ball", features: POSITION },
    Row { task: "hybrid", object: "pen", features: HYBRID },
    Row { task: "hybrid", object: "box", features: HYBRID },
    Row { task: "hybrid", object: "ball", features: HYBRID },
    Row { task: "rolling", object: "pen", features: ROLLING },
    Row { task: "rolling", object: "box", features: ROLLING },
    Row { task: "rolling", object: "ball", features: ROLLING },
];

impl Row {
    /// What the reference changes in the task.
    fn reference(&self) -> Vec<&'static str> {
        let holds = |name| self.features.iter().any(|(feature, _)| *feature == name);
        let force = if holds("pressure") { &FORCE[..] } else { &[] };
        let place = if holds("x") { &PLACE[..] } else { &[] };
        [force, place].concat()
    }

    /// Responses of each feature in all scenes [s], from fast to slow, and the most frames without a contact.
    fn run(&self, changes: &[&str]) -> (Vec<Vec<f64>>, f64) {
        let more: Vec<&str> = changes.iter().flat_map(|change| ["--set", change]).collect();
        let runs: Vec<_> = (0..SCENES).map(|seed| run_with(self.task, &scene(self.object, seed), &more)).collect();
        let failed = runs.iter().find(|(_, failure)| !failure.is_empty());
        assert!(failed.is_none(), "{} on a {}: {failed:?}", self.task, self.object);
        let of_feature = |(name, _): &(&str, f64)| {
            let mut responses: Vec<f64> =
                runs.iter().map(|(seen, _)| seen["response"][name].as_f64().unwrap_or(ANY)).collect();
            responses.sort_by(f64::total_cmp);
            responses
        };
        let lost = runs.iter().map(|(seen, _)| seen["lost"].as_f64().unwrap()).fold(0.0, f64::max);
        (self.features.iter().map(of_feature).collect(), lost)
    }
}

/// A scene with a place, an angle, an object and an arm of its own.
fn scene(object: &str, seed: u32) -> String {
    let mut primes = [2.0, 3.0, 5.0, 7.0, 11.0, 13.0].into_iter();
    // Multiples of a root fill the range evenly.
    let mut between =
        |low: f64, high: f64| low + (high - low) * (f64::from(seed + 1) * f64::sqrt(primes.next().unwrap())).fract();
    let place = format!(
        "--seconds 6 --seed {seed} --offset {:.4} {:.4} --angle {:.3} --joints {:.0}",
        between(-0.012, 0.012),
        between(-0.012, 0.012),
        between(-1.5, 1.5),
        between(150.0, 300.0),
    );
    let kind = match object {
        "ball" => {
            let (radius, stiffness) = (between(0.025, 0.05), between(120.0, 1000.0));
            format!("--scene ball --radius {radius:.4} --stiffness {stiffness:.0}")
        }
        "pen" => {
            let (radius, length) = (between(0.004, 0.006), between(0.04, 0.06));
            format!("--scene pen --radius {radius:.4} --size {length:.3} 0.05")
        }
        _ => {
            let (length, stiffness) = (between(0.03, 0.045), between(500.0, 3000.0));
            format!("--scene box --size {length:.4} 0.03 --stiffness {stiffness:.0}")
        }
    };
    format!("{kind} {place}")
}

/// The median and the worst one of responses that are sorted.
fn median_and_worst(sorted: &[f64]) -> [f64; 2] {
    let middle = sorted.len() / 2;
    [f64::midpoint(sorted[middle - 1], sorted[middle]), sorted[sorted.len() - 1]]
}

#[test]
#[ignore = "it needs MuJoCo: `.ci/edge` installs it"]
fn no_task_is_slower_than_the_paper_and_a_reference_controller_in_random_scenes() {
    let mut wrong = Vec::new();
    for row in &ROWS {
        let reference = row.reference();
        let (shipped, reference) = thread::scope(|scope| {
            let reference = scope.spawn(|| row.run(&reference));
            (row.run(&[]), reference.join().unwrap())
        });
        for (i, (feature, paper)) in row.features.iter().enumerate() {
            let (ours, theirs) = (median_and_worst(&shipped.0[i]), median_and_worst(&reference.0[i]));
            let line = format!(
                "{} on a {}, {feature}: {:.2}, {:.2} s; reference {:.2}, {:.2} s; lost for {} and {} frames",
                row.task, row.object, ours[0], ours[1], theirs[0], theirs[1], shipped.1, reference.1
            );
            std::io::stdout().write_all(format!("{line}\n").as_bytes()).unwrap();
            let is_slower = ours.iter().zip(theirs).any(|(ours, theirs)| *ours > SLOWER.0 * theirs + SLOWER.1);
            if ours[0] > *paper || is_slower || shipped.1 > LOST {
                wrong.push(line);
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
