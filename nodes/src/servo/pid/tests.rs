//! The control law against closed forms, and what freshness does to it.

use std::f64::consts::PI;

use proptest::prelude::*;
use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::node::At;
use tactflow_runtime::signal::{Feature, Features, FeaturesShape, Shape, Stamp};
use tactflow_runtime::source::Code;

use super::*;

const LENGTHS: [(&str, Unit); 2] = [("x", Unit::METRE), ("y", Unit::METRE)];

fn shape(features: &[(&str, Unit)]) -> FeaturesShape {
    let feature = |(name, unit): &(&str, Unit)| Feature { name: (*name).into(), unit: *unit };
    FeaturesShape { features: features.iter().map(feature).collect() }
}

/// A controller with the same gains for every feature.
fn alike(features: &[(&str, Unit)], gains: &str) -> NodeRig {
    let gains: String = features.iter().map(|(name, _)| format!("gains.{name} = {{ {gains} }}\n")).collect();
    NodeRig::new::<Pid>(&gains, &[("error", shape(features).into())]).unwrap()
}

fn one(unit: Unit, gains: &str) -> NodeRig {
    alike(&[("e", unit)], gains)
}

fn at(nanos: i64) -> Stamp {
    Stamp { nanos, device: 0 }
}

/// Component `i` of the error is new with that stamp, or goes.
fn put_at(rig: &mut NodeRig, i: usize, value: Option<f64>, stamp: Stamp) {
    let tick = rig.tick.index;
    rig.edit("error", stamp, |error: &mut Features| match value {
        Some(value) => error.set(i, value, tick, stamp),
        None => error.lose(i, tick),
    });
}

/// The components of the error are new at this moment, or go; then `ms` pass.
fn feed_all(rig: &mut NodeRig, values: &[Option<f64>], ms: f64) {
    let now = at(rig.tick.now);
    for (i, value) in values.iter().enumerate() {
        put_at(rig, i, *value, now);
    }
    rig.step_ms(ms);
}

/// A controller of two features, each with an integral of 0.1.
fn charged() -> NodeRig {
    let mut rig = alike(&LENGTHS, "ki = 1.0");
    for _ in 0..=50 {
        feed_all(&mut rig, &[Some(1.0); 2], 2.0);
    }
    rig
}

fn control(rig: &NodeRig, i: usize) -> Option<f64> {
    rig.get::<Features>("control").and_then(|control| control.components()[i].get())
}

/// A new error on component 0 at this moment; the control; then `ms` pass.
fn feed(rig: &mut NodeRig, error: f64, ms: f64) -> f64 {
    feed_all(rig, &[Some(error)], ms);
    control(rig, 0).unwrap()
}

fn assert_near(found: f64, expected: f64, what: &str) {
    assert!((found - expected).abs() < 1e-9 * (1.0 + expected.abs()), "{what}: {found}, not {expected}");
}

#[test]
fn what_nobody_wants_is_frozen_and_starts_afresh() {
    let mut rig = charged();
    rig.want(&[Components::of(2, |i| i == 0)]);
    for _ in 0..5 {
        feed_all(&mut rig, &[Some(1.0); 2], 2.0);
        assert_eq!(control(&rig, 1), None);
    }
    assert_near(control(&rig, 0).unwrap(), 0.11, "the other goes on");
    rig.want(&[Components::ALL]);
    feed_all(&mut rig, &[Some(1.0); 2], 2.0);
    assert_near(control(&rig, 1).unwrap(), 0.0, "nothing was gathered, and nothing is left");
    feed_all(&mut rig, &[Some(1.0); 2], 2.0);
    assert_near(control(&rig, 1).unwrap(), 0.002, "it gathers again");
}

#[test]
fn the_control_has_the_units_per_second() {
    let rig = alike(&[("x", Unit::METRE), ("alpha", Unit::AXIAL)], "");
    let expected = shape(&[("x", Unit::METRE.per_second()), ("alpha", Unit::RADIAN.per_second())]);
    assert_eq!(rig.shape("control"), &Shape::from(expected));
}

#[test]
fn a_constant_error_gives_a_ramp() {
    let mut rig = one(Unit::METRE, "kp = 3.0, ki = 2.0, kd = 5.0");
    for k in 0..200 {
        assert_near(feed(&mut rig, 0.5, 4.0), 1.5 + 0.5 * 2.0 * 0.004 * f64::from(k), "kp e + ki e t");
    }
}

#[test]
fn a_ramp_of_the_error_gives_its_slope() {
    let mut rig = one(Unit::METRE, "kd = 0.25");
    assert_eq!(feed(&mut rig, 7.0, 4.0), 0.0);
    for (k, ms) in [(1, 1.0), (2, 8.0), (3, 4.0), (4, 4.0)] {
        let error = 7.0 - 3.0 * rig.tick.now as f64 * 1e-9;
        assert_near(feed(&mut rig, error, ms), 0.25 * -3.0, &format!("sample {k}"));
    }
}

#[test]
fn a_sine_gives_the_sums_of_calculus_books() {
    let (speed, dt) = (5.0, 0.004);
    let mut integral = one(Unit::METRE, "ki = 1.0");
    let mut slope = one(Unit::METRE, "kd = 1.0");
    for k in 0..1000 {
        let t = dt * f64::from(k);
        let (half, error) = (speed * dt / 2.0, libm::sin(speed * t));
        // Lagrange: the sum of sin(j w dt) for j = 1..=k.
        let sum = (libm::cos(half) - libm::cos(speed * t + half)) / (2.0 * libm::sin(half));
        assert_near(feed(&mut integral, error, 4.0), dt * sum, "integral");
        let chord = libm::cos(speed * t - half) * libm::sin(half) * 2.0 / dt;
        let found = feed(&mut slope, error, 4.0);
        assert_near(found, if k == 0 { 0.0 } else { chord }, "slope");
    }
}

#[test]
fn a_gain_means_the_same_at_any_rate() {
    // An error that is constant for 20 ms at a time, and one that is smooth; over 2 s.
    let stairs = |t: f64| [0.3, -0.1, 0.2, 0.05, -0.4][(t / 0.02 - 1e-6).max(0.0) as usize % 5];
    let smooth = |t: f64| libm::cos(3.0 * t);
    for (hz, ms) in [(100, 10.0), (250, 4.0), (1000, 1.0)] {
        let mut rigs = [one(Unit::METRE, "ki = 2.0"), one(Unit::METRE, "ki = 2.0")];
        let mut found = [0.0; 2];
        for k in 0..=2 * hz {
            let t = f64::from(k) / f64::from(hz);
            found = [feed(&mut rigs[0], stairs(t), ms), feed(&mut rigs[1], smooth(t), ms)];
        }
        assert_near(found[0], 2.0 * 0.02 * 20.0 * 0.05, &format!("stairs at {hz} Hz"));
        let exact = 2.0 * libm::sin(6.0) / 3.0;
        assert!((found[1] - exact).abs() < 4.0 / f64::from(hz), "smooth at {hz} Hz: {}, not {exact}", found[1]);
    }
}

#[test]
fn a_repeated_frame_counts_once() {
    let mut rig = one(Unit::METRE, "ki = 1.0, kd = 1.0");
    let mut last = f64::NAN;
    for k in 0..=1000 {
        // 1 kHz of ticks, 250 Hz of stamps; some repeat the frame, in some nothing is new.
        if k % 4 != 3 {
            put_at(&mut rig, 0, Some(0.5), at(k / 4 * 4_000_000));
        }
        rig.step();
        last = control(&rig, 0).unwrap();
    }
    assert_near(last, 0.5, "0.5 for one second");
}

#[test]
fn it_integrates_near_the_target_only_and_within_the_bound() {
    // What 4 s of an error of 2 leave.
    let cases = [
        ("ki = 1.0, bound = 10.0", 8.0),
        ("ki = 1.0, bound = 0.5", 0.5),
        ("ki = 1.0", 1.0),
        ("ki = 1.0, within = 2.0, bound = 10.0", 8.0),
        ("ki = 1.0, within = 1.9, bound = 10.0", 0.0),
    ];
    for ((gains, left), sign) in cases.into_iter().flat_map(|case| [(case, 1.0), (case, -1.0)]) {
        let mut rig = one(Unit::METRE, gains);
        let found = (0..=400).map(|_| feed(&mut rig, 2.0 * sign, 10.0)).last().unwrap();
        assert_near(found, left * sign, gains);
    }
    let mut rig = one(Unit::METRE, "ki = 1.0, within = 0.5");
    for error in [0.4, 0.4, 5.0, 5.0] {
        feed(&mut rig, error, 10.0);
    }
    assert_near(control(&rig, 0).unwrap(), 0.004, "far from the target the integral stays");
}

#[test]
fn at_the_limit_the_integral_does_not_wind_up() {
    for sign in [1.0, -1.0] {
        let mut rig = one(Unit::METRE, "ki = 1.0, bound = 10.0, limit = 1.0");
        let found = (0..=500).map(|_| feed(&mut rig, sign, 10.0)).last().unwrap();
        assert_near(found, sign, "at the limit after 5 s");
        let found = (0..50).map(|_| feed(&mut rig, -sign, 10.0)).last().unwrap();
        assert_near(found, 0.5 * sign, "it comes back at once, and not after 4 s");

        let mut rig = one(Unit::METRE, "kp = 2.0, ki = 1.0, limit = 1.0");
        let found = (0..100).map(|_| feed(&mut rig, sign, 10.0)).last().unwrap();
        assert_eq!(found, sign, "limited by the proportional part alone");
        assert_eq!(feed(&mut rig, 0.0, 10.0), 0.0, "so nothing was integrated");
    }
}

#[test]
fn the_control_grows_as_fast_as_it_may_and_falls_at_once() {
    for sign in [1.0, -1.0] {
        let mut rig = one(Unit::METRE, "kp = 2.0, rise = 3.0");
        // At once what it has after 20 ms, on either side.
        let errors = [1.0, 1.0, 1.0, 0.04, 0.04, 1.0, -1.0, -1.0, 0.0, 0.02];
        let expected = [0.06, 0.09, 0.12, 0.08, 0.08, 0.11, -0.06, -0.09, 0.0, 0.04];
        for (k, (error, expected)) in errors.into_iter().zip(expected).enumerate() {
            assert_near(feed(&mut rig, sign * error, 10.0), sign * expected, &format!("sample {k}"));
        }
        feed(&mut rig, sign, 1000.0);
        assert_near(feed(&mut rig, sign, 10.0), 0.07 * sign, "a gap is no time in which it grows");
        feed_all(&mut rig, &[None; 1], 10.0);
        assert_near(feed(&mut rig, sign, 10.0), 0.13 * sign, "it survives flicker");
        feed_all(&mut rig, &[None; 1], 50.0);
        assert_near(feed(&mut rig, sign, 10.0), 0.06 * sign, "after an absence it begins again");
    }
}

#[test]
fn noise_at_rest_has_the_same_gain_with_and_without_a_rise_at_any_rate() {
    // Noise of up to 0.1 mm, at 1 kHz and at 100 Hz.
    let noise = |k: i32| 1e-4 * f64::from(k * 7919 % 13 - 6) / 6.0;
    for ms in [1.0, 10.0] {
        let mut rigs = ["kp = 3.5", "kp = 3.5, rise = 0.15"].map(|gains| one(Unit::METRE, gains));
        for k in 0..200 {
            let [plain, rising] = rigs.each_mut().map(|rig| feed(rig, noise(k), ms));
            assert_eq!(plain, rising, "sample {k}, each {ms} ms");
        }
    }
}

#[test]
fn while_the_control_grows_the_integral_does_not_wind_up() {
    let mut rig = one(Unit::METRE, "kp = 2.0, ki = 1.0, bound = 10.0, rise = 1.0");
    let found = (0..=100).map(|_| feed(&mut rig, 1.0, 10.0)).last().unwrap();
    assert_near(found, 1.02, "after a second");
    assert_eq!(feed(&mut rig, 0.0, 10.0), 0.0, "the proportional part was larger, so nothing was integrated");
    let mut rig = one(Unit::METRE, "ki = 1.0, rise = 2.0");
    let found = (0..=50).map(|_| feed(&mut rig, 1.0, 10.0)).last().unwrap();
    assert_near(found, 0.5, "an integral that grows slower than that is free");
}

proptest! {
    #[test]
    fn the_control_never_grows_faster_than_its_rise(
        errors in proptest::collection::vec(-5.0_f64..5.0, 1..60),
        gains in prop::sample::select(vec!["kp = 1.0", "ki = 20.0", "kp = 3.0, ki = 9.0, kd = 0.01, limit = 0.02"]),
    ) {
        let mut rig = one(Unit::METRE, &format!("{gains}, rise = 0.5"));
        let mut last: f64 = 0.0;
        for error in errors {
            let control = feed(&mut rig, error, 4.0);
            let before = if control * last < 0.0 { 0.0 } else { last.abs() };
            prop_assert!(control.abs() <= (before + 0.002).max(0.01) + 1e-12, "{last}, then {control}");
            last = control;
        }
    }

    #[test]
    fn the_control_keeps_its_limit(errors in proptest::collection::vec(-5.0_f64..5.0, 1..60)) {
        let mut rig = one(Unit::METRE, "kp = 1.0, ki = 20.0, kd = 0.01, bound = 0.7, limit = 0.9");
        for error in errors {
            prop_assert!(feed(&mut rig, error, 4.0).abs() <= 0.9);
        }
        feed(&mut rig, 0.0, 4.0);
        prop_assert!(feed(&mut rig, 0.0, 4.0).abs() <= 0.7, "at rest only the integral is left");
    }
}

#[test]
fn a_jump_of_pi_is_no_speed() {
    let cases = [(Unit::AXIAL, 0.04 / 0.004), (Unit::RADIAN, (0.04 - PI) / 0.004)];
    for (unit, expected) in cases {
        let mut rig = one(unit, "kd = 1.0");
        feed(&mut rig, PI / 2.0 - 0.02, 4.0);
        assert_near(feed(&mut rig, -PI / 2.0 + 0.02, 4.0), expected, &unit.to_string());
    }
}

#[test]
fn a_flicker_keeps_the_integral_and_an_absence_resets_it() {
    // How long x is away [ms], whether y goes with it and how long, and what is left of an integral of 0.1.
    let cases: [(i32, i32, f64); 6] =
        [(4, 0, 0.1), (18, 0, 0.1), (20, 0, 0.0), (100, 0, 0.0), (12, 8, 0.1), (26, 12, 0.0)];
    for (away, both, left) in cases {
        let mut rig = charged();
        for k in 0..away / 2 {
            let y = (2 * k >= both).then_some(0.0);
            feed_all(&mut rig, &[None, y], 2.0);
            assert_eq!((control(&rig, 0), control(&rig, 1).is_some()), (None, y.is_some()), "{away} ms");
        }
        assert_near(feed(&mut rig, 0.0, 2.0), left, &format!("x away for {away} ms, y for {both}"));
        assert_near(control(&rig, 1).unwrap(), 0.1, "y was away for less");
    }
}

#[test]
fn an_absence_that_began_for_all_at_once_is_counted_from_its_start() {
    let mut rig = charged();
    for ms in 0..30 {
        feed_all(&mut rig, &[None, (ms >= 15).then_some(0.0)], 1.0);
    }
    assert_near(control(&rig, 1).unwrap(), 0.1, "away for 15 ms");
    assert_eq!(feed(&mut rig, 0.0, 1.0), 0.0, "away for 30 ms, though for 15 of them nothing was stepped");
}

#[test]
fn nothing_at_all_for_long_resets_everything() {
    let mut rig = charged();
    for _ in 0..40 {
        rig.lose("error");
        rig.step();
    }
    feed_all(&mut rig, &[Some(0.0); 2], 1.0);
    assert_eq!([control(&rig, 0), control(&rig, 1)], [Some(0.0); 2]);
}

#[test]
fn a_jump_over_a_flicker_is_a_speed_over_the_real_time() {
    let mut rig = one(Unit::METRE, "kd = 1.0");
    feed(&mut rig, 0.0, 1.0);
    feed(&mut rig, 0.0, 1.0);
    for _ in 0..9 {
        feed_all(&mut rig, &[None], 1.0);
    }
    assert_near(feed(&mut rig, 0.5, 1.0), 0.5 / 0.010, "over the 10 ms since the last sample");
}

#[test]
fn a_component_is_on_its_own() {
    let mut rig = alike(&LENGTHS, "kp = 1.0, ki = 1.0");
    for k in 0..=100 {
        let now = rig.tick.now;
        put_at(&mut rig, 1, Some(1.0), at(now));
        if k % 10 == 0 {
            put_at(&mut rig, 0, Some(1.0), at(now));
        }
        rig.step();
        let (tick, old) = (rig.tick.index - 1, k / 10 * 10_000_000);
        let components = rig.get::<Features>("control").unwrap().components();
        let expected = if k % 10 == 0 { Freshness::New } else { Freshness::Held };
        assert_eq!([0, 1].map(|i| components[i].freshness(tick)), [expected, Freshness::New], "tick {k}");
        assert_eq!([0, 1].map(|i| components[i].stamp()), [at(old), at(now)], "each has the stamp of its own");
        assert_near(control(&rig, 0).unwrap(), 1.0 + old as f64 * 1e-9, "a held component is not integrated");
        assert_near(control(&rig, 1).unwrap(), 1.0 + k as f64 * 0.001, "nor is its neighbour held up");
    }
    feed_all(&mut rig, &[None], 1.0);
    assert_eq!(control(&rig, 0), None);
    assert_near(control(&rig, 1).unwrap(), 1.1, "what is absent leaves the other as it is");
}

#[test]
fn what_slides_faster_than_asked_for_is_braked() {
    let mut rig = one(Unit::METRE, "kp = 4.0, brake_above = 0.01");
    assert_near(feed(&mut rig, 0.002, 4.0), 0.008, "it has yet to move");
    let last = (1..=300).map(|k| feed(&mut rig, 0.002 - 0.03 * 0.004 * f64::from(k), 4.0)).last().unwrap();
    assert_near(last, -0.136 - 0.2 * 0.02, "it slides away from the setpoint");
    assert_near(feed(&mut rig, -0.034, 2000.0), -0.136 - 0.2 * (0.03 * (-4.0_f64 / 30.0).exp() - 0.01), "it stops");
    assert_eq!(feed(&mut rig, -0.034, 4.0), -0.136, "after a gap, the rate begins at zero");
}

#[test]
fn an_angle_that_turns_on_beyond_its_range_is_no_jump() {
    let mut rig = one(Unit::AXIAL, "kp = 1.0, brake_above = 0.01");
    let at = |k: u32| (1.5 + 0.002 * f64::from(k) + PI / 2.0).rem_euclid(PI) - PI / 2.0;
    let controls: Vec<f64> = (0..200).map(|k| feed(&mut rig, at(k), 4.0) - at(k)).collect();
    assert!(controls.iter().all(|brake| (0.0..=0.2 * 0.5 + 1e-9).contains(brake)), "0.5 rad/s: {controls:?}");
}

#[test]
fn a_brake_keeps_the_other_bounds_and_needs_a_gain() {
    let slides = |gains: &str| {
        let mut rig = one(Unit::METRE, gains);
        (0..=300).map(|k| feed(&mut rig, -0.001 * f64::from(k), 4.0)).last().unwrap()
    };
    assert_near(slides("kp = 4.0, brake_above = 0.01"), -1.2 - 0.2 * 0.24, "0.25 m/s");
    assert_eq!(slides("kp = 4.0, brake_above = 0.01, limit = 0.3"), -0.3);
    assert_eq!(slides("brake_above = 0.01"), 0.0, "no gain, no motion");
    assert_near(slides("kp = -4.0, brake_above = 0.01"), 1.2, "a negative gain has no brake, which would push");
}

#[test]
fn what_is_subnormal_becomes_zero() {
    let mut rig = one(Unit::METRE, "ki = 1.0");
    assert_eq!([1e-306, 1e-306].map(|error| feed(&mut rig, error, 4.0)), [0.0; 2]);
}

#[test]
fn what_comes_after_a_gap_tells_no_slope() {
    let mut rig = one(Unit::METRE, "kd = 1.0");
    let after = [(0.0, 10.0), (0.0, 1000.0), (-1.0, 10.0)].map(|(error, ms)| feed(&mut rig, error, ms));
    assert_eq!(after, [0.0; 3], "the gap is longer than the greatest that counts");
    assert_near(feed(&mut rig, -0.5, 10.0), 50.0, "and then it goes on");
}

#[test]
fn gains_and_features_must_agree() {
    let missing = (Code::MissingKey, At::Key("gains".into()));
    let cases = [
        ("gains = { x = {} }", vec![missing.clone()]),
        ("gains = {}", vec![missing.clone(), missing]),
        ("gains = { x = {}, y = {}, z = {} }", vec![(Code::UnknownKey, At::Key("gains.z".into()))]),
        ("gains = { x = {}, Y = {} }", vec![(Code::UnknownKey, At::Key("gains.Y".into()))]),
    ];
    let wires = [("error", Shape::from(shape(&LENGTHS)))];
    for (params, expected) in cases {
        let mistakes = NodeRig::new::<Pid>(params, &wires).err().unwrap();
        let found: Vec<_> = mistakes.into_iter().map(|mistake| (mistake.code, mistake.at)).collect();
        assert_eq!(found, expected, "{params}");
    }
    let bad = [
        "kq = 1.0",
        "kp = \"high\"",
        "kp = nan",
        "within = 0.0",
        "bound = -1.0",
        "bound = 0",
        "limit = 0.0",
        "rise = 0.0",
        "brake_above = 0.0",
    ];
    for bad in bad {
        let params = format!("gains = {{ x = {{ {bad} }}, y = {{}} }}");
        let mistakes = NodeRig::new::<Pid>(&params, &wires).err().unwrap();
        let start = params.find(bad).unwrap();
        let token = start..start + bad.len();
        assert_eq!(mistakes.len(), 1, "{bad}");
        let At::Span(span) = &mistakes[0].at else { panic!("{bad}: {:?}", mistakes[0].at) };
        assert!(token.start <= span.start && span.end <= token.end, "{bad}: {span:?} is not in {token:?}");
    }
}

#[test]
fn gains_that_do_not_reduce_the_error_are_warned_of() {
    let wires = [("error", Shape::from(shape(&[("x", Unit::METRE)])))];
    let cases: [(&str, &[&str]); 14] = [
        ("{ kp = 2.0, ki = 0.1, kd = 0.0 }", &[]),
        ("{ kp = 1999.0 }", &[]),
        ("{ kp = 2000.0 }", &["unstable-gain: `gains.x.kp`"]),
        ("{ kp = 0.0 }", &[]),
        ("{}", &[]),
        ("{ kd = 0.1 }", &["unusual-gain: `gains.x.kp`"]),
        ("{ kp = 0, ki = 0.1 }", &["unusual-gain: `gains.x.kp`"]),
        ("{ kp = -2.0 }", &["unusual-gain: `gains.x.kp`"]),
        ("{ kp = 2.0, ki = -0.1 }", &["unusual-gain: `gains.x.ki`"]),
        ("{ kp = 2.0, kd = -0.1 }", &["unusual-gain: `gains.x.kd`"]),
        ("{ kp = 2.0, limit = 0.0002 }", &[]),
        ("{ kp = 2.0, limit = 0.00019 }", &["unusual-gain: `gains.x.limit`"]),
        ("{ kp = 2.0, rise = 0.0041 }", &[]),
        ("{ kp = 2.0, rise = 0.0039 }", &["unusual-gain: `gains.x.rise`"]),
    ];
    for (gains, expected) in cases {
        let params = format!("gains.x = {gains}");
        assert_eq!(places(&params, &NodeRig::new::<Pid>(&params, &wires)), expected, "{gains}");
    }
}
