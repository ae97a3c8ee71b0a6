//! A path in closed loop: the simulated arm slides along a rounded square on a table, and stays on it.

use nalgebra::{IsometryMatrix3, Vector3};
use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::Request;
use tactflow_runtime::signal::{Pose, Scalar};
use tactflow_tests::workspace;

use crate::course::{get, loaded};

/// Half of a side of the square [m].
const HALF: f64 = 0.02;
/// Radius of its corners [m].
const RADIUS: f64 = 0.005;

/// The distance of a place from the rounded square of the task, in its plane [m]. The square begins in the middle of a
/// side, along x. It is what lies at most the radius from a smaller square.
fn off_square(place: &Vector3<f64>) -> f64 {
    let [x, y] = [place.x.abs(), (place.y - HALF).abs()].map(|side| side - (HALF - RADIUS));
    (x.max(0.0).hypot(y.max(0.0)) + x.max(y).min(0.0) - RADIUS).abs()
}

/// What was seen while the arm traced the square.
#[derive(Default)]
struct Traced {
    start: Option<IsometryMatrix3<f64>>,
    worst_m: f64,
    /// The smallest and the largest coordinates, seen from the start [m].
    from: Vector3<f64>,
    to: Vector3<f64>,
    /// Largest angle from the orientation at the start [rad].
    turned_rad: f64,
    /// The smallest and the largest pressure [N per tactel].
    pressure: Option<[f64; 2]>,
    modes: Vec<String>,
}

impl Traced {
    fn look(&mut self, engine: &Engine) {
        let mode = engine.mode().unwrap_or("none");
        if self.modes.last().is_none_or(|last| last != mode) {
            self.modes.push(mode.to_owned());
        }
        if mode != "trace" {
            return;
        }
        let pose = get::<Pose>(engine, "move.state.sensor_pose").unwrap().0;
        let start = *self.start.get_or_insert(pose);
        let seen = start.inverse() * pose;
        let place = seen.translation.vector;
        self.worst_m = self.worst_m.max(off_square(&place));
        (self.from, self.to) = (self.from.inf(&place), self.to.sup(&place));
        self.turned_rad = self.turned_rad.max(seen.rotation.angle());
        let pressure = *get::<Scalar>(engine, "calm.value").unwrap();
        let [least, most] = self.pressure.unwrap_or([pressure; 2]);
        self.pressure = Some([least.min(pressure), most.max(pressure)]);
    }
}

#[test]
fn the_arm_stays_within_half_a_millimetre_of_a_square_with_round_corners() {
    let mut traced = Traced::default();
    let request = Request::file(workspace().join("graphs/square.toml"));
    let mut engine = Engine::new(loaded(&request));
    while let Some(next) = engine.next().filter(|_| !engine.is_done()) {
        engine.tick(next).unwrap_or_else(|fault| panic!("{fault}"));
        traced.look(&engine);
    }
    assert_eq!(traced.modes, ["approach", "press", "trace", "retreat"]);
    let [from, to] = [traced.from, traced.to];
    let sides = [from.x + HALF, from.y, to.x - HALF, to.y - 2.0 * HALF];
    assert!(sides.iter().all(|off| off.abs() < 5e-4), "all four sides: {from:?} to {to:?}");
    assert!(traced.worst_m < 5e-4, "{:.3} mm beside the square", 1e3 * traced.worst_m);
    assert!(traced.turned_rad < 0.02, "turned by {:.4} rad", traced.turned_rad);
    let [least, most] = traced.pressure.unwrap();
    assert!(least > 0.02 && most < 0.04, "the pressure is {least:.4} to {most:.4} N per tactel");
}
