//! `deadband` against a table, and in a loop with an arm that sticks.

use proptest::prelude::*;
use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::signal::{FeaturesShape, Freshness, Unit};

use super::super::pid::Pid;
use super::*;

fn shape() -> FeaturesShape {
    FeaturesShape::new([("x", Unit::METRE), ("pressure", Unit::NEWTON.per_tactel())])
}

fn built(params: &str) -> Result<NodeRig, Mistakes> {
    NodeRig::new::<Deadband>(params, &[("error", shape().into())])
}

fn rig(inside: &str) -> NodeRig {
    built(&format!("width.pressure = {{ inner = 1.0, outer = 3.0 }}\ninside = \"{inside}\"")).unwrap()
}

/// Shows an error of the pressure, and returns what comes out of both features.
fn show(rig: &mut NodeRig, pressure: Option<f64>) -> [Option<f64>; 2] {
    rig.set_features("error", &[Some(0.5), pressure]);
    rig.step_ms(4.0);
    let values: Vec<_> = rig.get::<Features>("error").unwrap().values().collect();
    [values[0], values[1]]
}

#[test]
fn an_error_passes_until_it_is_inside_and_rests_until_it_is_outside() {
    // The error, and whether it passes.
    let course = [
        (2.0, true),
        (-1.0, true),
        (0.9, false),
        (2.9, false),
        (-3.0, false),
        (3.1, true),
        (2.0, true),
        (1.0, true),
        (-0.5, false),
        (-3.5, true),
        (0.0, false),
        (f64::INFINITY, true),
    ];
    for (inside, resting) in [("zero", Some(0.0)), ("absent", None)] {
        let mut rig = rig(inside);
        for (error, passes) in course {
            let expected = if passes { Some(error) } else { resting };
            assert_eq!(show(&mut rig, Some(error)), [Some(0.5), expected], "{inside}: {error}");
        }
    }
}

#[test]
fn what_is_not_a_number_is_never_hidden() {
    let mut rig = rig("zero");
    show(&mut rig, Some(0.5));
    assert!(show(&mut rig, Some(f64::NAN))[1].unwrap().is_nan());
    assert_eq!(show(&mut rig, Some(2.0))[1], Some(2.0), "and it no longer rests");
}

#[test]
fn a_held_error_stays_and_a_long_absence_ends_the_rest() {
    let mut rig = rig("zero");
    show(&mut rig, Some(0.5));
    rig.step();
    assert_eq!(rig.freshness("error"), Freshness::Held);
    assert_eq!(show(&mut rig, None)[1], None);
    assert_eq!(show(&mut rig, Some(2.0))[1], Some(0.0), "flicker");
    (0..6).for_each(|_| assert_eq!(show(&mut rig, None)[1], None));
    assert_eq!(show(&mut rig, Some(2.0))[1], Some(2.0), "a fresh feature");
    show(&mut rig, Some(0.5));
    rig.lose("error");
    rig.step_ms(4.0);
    assert_eq!(rig.get::<Features>("error"), None);
    rig.step_ms(30.0);
    assert_eq!(show(&mut rig, Some(2.0))[1], Some(2.0), "all were away for long");
}

#[test]
fn wrong_widths_are_refused() {
    let cases = [
        ("width = {}", "missing-key: `width`"),
        ("width.force = { inner = 1.0, outer = 3.0 }", "unknown-key: `width.force`"),
        ("width.x = { inner = 3.0, outer = 3.0 }", "bad-value: `width.x.outer`"),
        ("width.x = { inner = 0.0, outer = 3.0 }", "bad-value: `0.0`"),
        ("width.x = { inner = 1.0, outer = 2.0 }\ninside = \"hold\"", "bad-value: `\"hold\"`"),
    ];
    for (bad, place) in cases {
        assert_eq!(places(bad, &built(bad)), [place], "{bad}");
    }
}

proptest! {
    #[test]
    fn it_changes_no_error_by_more_than_the_outer_width(errors in prop::collection::vec(-5.0..5.0f64, 1..60)) {
        let mut rig = rig("zero");
        for error in errors {
            let shown = show(&mut rig, Some(error))[1].unwrap();
            prop_assert!(shown == error || shown == 0.0 && error.abs() <= 3.0, "{error}: {shown}");
        }
    }
}

/// The second half of two minutes of a loop with an arm that sticks: the largest error, and the way of the arm.
///
/// The controller moves an equilibrium, which pulls the arm along once it is `STICK` ahead of it: a play.
fn hunt(inside: Option<&str>) -> [f64; 2] {
    const STICK: f64 = 0.02;
    let mut band = inside.map(|inside| {
        built(&format!("width.pressure = {{ inner = 0.004, outer = 0.012 }}\ninside = \"{inside}\"")).unwrap()
    });
    let gains = "gains = { x = { kp = 1.0 }, pressure = { kp = 0.5, ki = 0.2 } }";
    let mut pid = NodeRig::new::<Pid>(gains, &[("error", shape().into())]).unwrap();
    let (mut equilibrium, mut arm, mut found) = (0.0_f64, 0.0_f64, [0.0_f64; 2]);
    for i in 0..30_000 {
        let error = 0.1 - arm;
        let error = match &mut band {
            Some(band) => show(band, Some(error))[1],
            None => Some(error),
        };
        pid.set_features("error", &[Some(0.0), error]);
        pid.step_ms(4.0);
        let control = pid.get::<Features>("control").unwrap().values().nth(1).unwrap().unwrap_or(0.0);
        equilibrium += control * 0.004;
        let last = arm;
        arm = arm.clamp(equilibrium - STICK, equilibrium + STICK);
        if i >= 15_000 {
            found = [found[0].max((0.1 - arm).abs()), found[1] + (arm - last).abs()];
        }
    }
    found
}

#[test]
fn with_friction_an_integral_hunts_and_an_absent_error_lets_it_rest() {
    let [error, way] = hunt(None);
    assert!(error > 0.008 && way > 0.1, "it hunts: {error}, {way}");
    let [error, way] = hunt(Some("absent"));
    assert!(error < 0.005 && way == 0.0, "it rests: {error}, {way}");
    let [error, way] = hunt(Some("zero"));
    assert!(error > 0.012 && way > 0.1, "the integral stays, and it still hunts: {error}, {way}");
}
