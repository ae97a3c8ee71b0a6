//! Devices of unequal rates under one clock: what descends from the slow one may be as old as its samples are.

use tactflow_runtime::engine::Engine;
use tactflow_runtime::graph::{Request, compile};
use tactflow_runtime::signal::{Features, Pose, Twist};
use tactflow_tests::catalogue;

/// Two pads, of 250 Hz and of 40 Hz. The arm slides while something touches the slow one, which falls silent at 2 s.
const GRAPH: &str = r#"
[graph]
clock = "fast"
start = "slide"
show = ["look.sum", "touch.image", "pid.control"]

[roles]
fast = { type = "tactile_pad", on = "none" }
pad = { type = "tactile_pad", on = "arm" }
arm = "velocity_arm"

[commands]
arm.velocity = "move.velocity"

[nodes.look]
type = "tactile_source"
in.image = "fast.image"

[parts.touch]
file = "builtin:parts/touch.toml"
in.image = "pad.image"

[nodes.error]
type = "feature_error"
in.force = "touch.force"
setpoint = { force = 4.0 }

[nodes.pid]
type = "pid"
in.error = "error.error"
gains.force = { kp = 0.001, ki = 0.2 }

[nodes.slide]
type = "twist_source"
in.gate = "touch.present"
twist = [0.005, 0, 0, 0, 0, 0]

[parts.move]
file = "builtin:parts/move.toml"
in.twist = "slide.twist"
in.image = "touch.image"
in.contact = "touch.present"
in.position = "arm.position"
in.equilibrium = "arm.equilibrium"

[modes.slide]
on_lost = { of = "touch.present", to = "lost" }

[modes.lost]
go = { after_ms = 5000, to = "slide" }

[limits]
linear_m_per_s = 0.05
angular_rad_per_s = 0.8
linear_m_per_s2 = 2.0
angular_rad_per_s2 = 10.0
force_n = 15.0
peak_n = 3.0
workspace_min_m = [-0.8, -0.4, 0.1]
workspace_max_m = [-0.3, 0.4, 0.7]
blind_s = 20.0
blind_mm = 100.0
joint_rad_per_s2 = 5.0
lead_rad = 0.1

[bind]
fast = "fast"
pad = "slow"
arm = "arm"

[devices.fast]
type = "mock_pad"
rate_hz = 250

[devices.slow]
type = "mock_pad"
rate_hz = 40
mount = { xyz = [0.0, 0.0, 0.03] }
press = [{ from_s = 0.0, to_s = 9.0, at = [0.01, -0.005], force = 3.0 }]
glitch = [{ at_s = 2.0, for_s = 0.4, kind = "silence" }]

[devices.arm]
type = "mock_arm"
robot = "builtin:lwr4p.toml"
"#;

/// Time between two samples of the slow pad [s].
const SLOW_S: f64 = 0.025;

fn engine(rate_hz: f64) -> Engine {
    let request = Request::text(GRAPH).set(format!("devices.slow.rate_hz={rate_hz}"));
    Engine::new(compile(&catalogue(), &request).unwrap_or_else(|report| panic!("{}", report.render(false))))
}

/// Returns the way of the sensor from 0.5 s to 1.9 s [m], and checks that it slides steadily all the time.
fn way(rate_hz: f64) -> f64 {
    let mut engine = engine(rate_hz);
    let mut places = Vec::new();
    while let Some(next) = engine.next().filter(|next| *next <= 1_900_000_000) {
        engine.tick(next).unwrap_or_else(|fault| panic!("{fault}"));
        if next < 500_000_000 {
            continue;
        }
        let twist = engine.get::<Twist>("move.acceleration.twist").expect("the arm slides");
        assert!((twist.0[0] - 0.005).abs() < 1e-12, "{:?} at {next} ns", twist.0);
        places.push(engine.get::<Pose>("move.sensor_pose").unwrap().0.translation.vector);
    }
    assert!(engine.halts().is_empty(), "{:?}", engine.halts());
    assert_eq!(engine.mode(), Some("slide"), "no sample is late");
    (places[places.len() - 1] - places[0]).norm()
}

#[test]
fn a_motion_from_a_slow_pad_is_as_steady_as_from_a_fast_one() {
    let (slow, fast) = (way(40.0), way(250.0));
    assert!((slow - fast).abs() < 1e-6, "{slow} m instead of {fast} m");
    assert!((fast - 0.005 * 1.4).abs() < 0.01 * fast, "{fast} m at 5 mm/s");
}

/// Returns what the controller has integrated until 1.9 s.
fn integral(rate_hz: f64) -> f64 {
    let mut engine = engine(rate_hz);
    while let Some(next) = engine.next().filter(|next| *next <= 1_900_000_000) {
        engine.tick(next).unwrap_or_else(|fault| panic!("{fault}"));
    }
    let control = engine.get::<Features>("pid.control").expect("the pad is pressed");
    control.values().next().flatten().expect("the force is known")
}

#[test]
fn an_integral_over_a_slow_pad_grows_as_over_a_fast_one() {
    let (slow, fast) = (integral(40.0), integral(250.0));
    // The press has 3 N and the setpoint 4 N, so the error is about 1 N for 1.9 s.
    assert!((0.3..0.46).contains(&fast), "{fast}");
    assert!((slow - fast).abs() < 0.05 * fast, "{slow} instead of {fast}");
}

#[test]
fn a_slow_pad_that_falls_silent_is_lost_after_five_of_its_own_periods() {
    let mut engine = engine(1.0 / SLOW_S);
    let mut lost = None;
    while let Some(next) = engine.next().filter(|next| *next <= 2_500_000_000) {
        engine.tick(next).unwrap_or_else(|fault| panic!("{fault}"));
        lost = lost.or((engine.mode() == Some("lost")).then_some(next as f64 * 1e-9));
    }
    let last_sample = 2.0 - SLOW_S;
    let expected = last_sample + 5.0 * SLOW_S;
    let lost = lost.expect("the pad is silent for 16 periods");
    assert!((expected..expected + 0.009).contains(&lost), "{lost} s instead of {expected} s");
}
