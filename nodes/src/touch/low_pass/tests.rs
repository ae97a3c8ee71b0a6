//! `low_pass` against the solution of its equation.

use proptest::prelude::*;
use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::signal::{Freshness, Scalar, ScalarShape, Stamp, Unit};

use super::*;

fn built(params: &str, unit: Unit) -> Result<NodeRig, Mistakes> {
    NodeRig::new::<LowPass>(params, &[("value", ScalarShape::of(unit).into())])
}

fn rig(ms: f64, unit: Unit) -> NodeRig {
    let mut rig = built(&format!("time_constant_ms = {ms:?}"), unit).unwrap();
    rig.tick.max_gap = 1e6;
    rig
}

/// Returns the output for a sample of that time.
fn show(rig: &mut NodeRig, ms: f64, value: f64) -> Option<f64> {
    let stamp = Stamp { nanos: (ms * 1e6).round() as i64, device: 0 };
    rig.edit("value", stamp, |old: &mut Scalar| *old = value);
    rig.step_ms(0.001);
    rig.get::<Scalar>("value").copied()
}

#[test]
fn the_response_to_a_step_is_one_minus_exp_at_any_sample_times() {
    let courses: [&[f64]; 5] =
        [&[100.0], &[1.0, 100.0], &[4.0, 8.0, 12.0, 100.0], &[99.999, 100.0], &[50.0, 50.001, 100.0]];
    for times in courses {
        let mut rig = rig(40.0, Unit::NEWTON);
        assert_eq!(show(&mut rig, 0.0, 0.0), Some(0.0));
        let last = times.iter().map(|ms| show(&mut rig, *ms, 2.0).unwrap()).last().unwrap();
        let exact = 2.0 * (1.0 - libm::exp(-100.0 / 40.0));
        assert!((last - exact).abs() < 1e-12, "{times:?}: {last} against {exact}");
    }
}

#[test]
fn a_ramp_lags_by_the_time_constant_and_a_sine_at_the_cutoff_loses_half_its_power() {
    let mut ramp = rig(20.0, Unit::METRE);
    let last = (0..40_000).map(|k| show(&mut ramp, 0.01 * f64::from(k), 0.01 * f64::from(k)).unwrap()).last().unwrap();
    assert!((399.99 - last - 20.0).abs() < 0.01, "{last}");
    let mut sine = built("cutoff_hz = 5", Unit::METRE).unwrap();
    let swing = |k: i32| (k, libm::sin(2.0 * PI * 5.0 * f64::from(k) * 1e-4));
    let passed = (0..20_000).map(swing).map(|(k, value)| (k, show(&mut sine, 0.1 * f64::from(k), value).unwrap()));
    let amplitude = passed.filter(|(k, _)| *k > 10_000).fold(0.0, |max, (_, value)| f64::max(max, value));
    assert!((amplitude - 0.5_f64.sqrt()).abs() < 1e-3, "{amplitude}");
}

#[test]
fn an_axis_goes_the_short_way_round() {
    let mut slow = rig(1000.0, Unit::AXIAL);
    show(&mut slow, 0.0, 89.0_f64.to_radians());
    let near = show(&mut slow, 1.0, -89.0_f64.to_radians()).unwrap().to_degrees();
    assert!((near - 89.002).abs() < 1e-4, "{near}");
    let mut even = rig(1.0 / std::f64::consts::LN_2, Unit::AXIAL);
    show(&mut even, 0.0, 0.0);
    assert_eq!(show(&mut even, 1.0, PI / 2.0), None, "the two axes cancel each other");
    assert!(show(&mut even, 2.0, PI / 2.0).is_some());
    let mut turning = rig(1.0 / std::f64::consts::LN_2, Unit::RADIAN);
    show(&mut turning, 0.0, 3.0);
    assert!(show(&mut turning, 1.0, -3.0).unwrap().abs() < 1e-12, "only an axis is wrapped");
}

#[test]
fn a_held_value_counts_once_and_the_state_survives_flicker() {
    let mut rig = rig(10.0 / std::f64::consts::LN_2, Unit::NEWTON);
    rig.set("value", 0.0);
    rig.step_ms(10.0);
    let near = |rig: &NodeRig, expected: f64| (rig.get::<Scalar>("value").unwrap() - expected).abs() < 1e-12;
    rig.set("value", 1.0);
    rig.step_ms(5.0);
    assert!(near(&rig, 0.5));
    rig.step_ms(5.0);
    assert!(near(&rig, 0.5) && rig.freshness("value") == Freshness::Held);
    rig.lose("value");
    rig.step_ms(10.0);
    assert_eq!(rig.get::<Scalar>("value"), None);
    rig.set("value", 1.0);
    rig.step();
    assert!(near(&rig, 0.875), "flicker: it continues 20 ms later");
    rig.lose("value");
    rig.step_ms(20.0);
    rig.step();
    rig.set("value", 7.0);
    rig.step();
    assert!(near(&rig, 7.0), "reset after a long absence");
}

#[test]
fn it_starts_afresh_after_a_long_gap_and_from_another_device() {
    let mut rig = built("time_constant_ms = 100", Unit::NEWTON).unwrap();
    let at = |rig: &mut NodeRig, ms: i64, device: u16, value: f64| {
        rig.edit("value", Stamp { nanos: ms * 1_000_000, device }, |old: &mut Scalar| *old = value);
        rig.step();
        *rig.get::<Scalar>("value").unwrap()
    };
    assert_eq!(at(&mut rig, 0, 0, 0.0), 0.0);
    let filtered = at(&mut rig, 100, 0, 1.0);
    assert!((filtered - 1.0 + libm::exp(-1.0)).abs() < 1e-12, "the longest gap that is filtered: {filtered}");
    assert_eq!(at(&mut rig, 201, 0, 3.0), 3.0, "a gap of 101 ms");
    assert_eq!(at(&mut rig, 202, 1, 9.0), 9.0, "another device");
    assert!(at(&mut rig, 203, 1, 0.0) > 8.0, "filtered again");
}

#[test]
fn a_decaying_output_becomes_zero_and_finite_samples_stay_finite() {
    let mut decaying = rig(0.1, Unit::NEWTON);
    show(&mut decaying, 0.0, 1.0);
    let mut values = (1..200).map(|ms| show(&mut decaying, f64::from(ms), 0.0).unwrap());
    assert!(values.all(|value| value == 0.0 || value.is_normal()));
    assert_eq!(show(&mut decaying, 200.0, 0.0), Some(0.0));
    let mut at_once = built("cutoff_hz = 1e308", Unit::NEWTON).unwrap();
    for (ms, value) in [(0.0, 1.0), (0.0, 2.0), (1.0, 3.0)] {
        let shown = show(&mut at_once, ms, value).unwrap();
        assert!(shown.is_finite(), "{value} came out as {shown}");
    }
    let mut far = rig(1.0, Unit::NEWTON);
    show(&mut far, 0.0, f64::MAX);
    assert!(show(&mut far, 1.0, -f64::MAX).unwrap().is_finite());
}

#[test]
fn it_needs_exactly_one_of_time_constant_and_cutoff() {
    let none = built("", Unit::NEWTON).err().unwrap();
    assert_eq!((none[0].at.clone(), none[0].code), (At::Node, Code::MissingKey));
    let both = built("time_constant_ms = 20\ncutoff_hz = 8", Unit::NEWTON).err().unwrap();
    assert_eq!(both[0].at, At::Key("cutoff_hz".into()));
    for (bad, place) in [
        ("time_constant_ms = 0", "bad-value: `0`"),
        ("cutoff_hz = -1", "bad-value: `-1`"),
        ("cutoff_hz = inf", "bad-value: `inf`"),
        ("time = 1", "unknown-key: `time`"),
    ] {
        assert_eq!(places(bad, &built(bad, Unit::NEWTON)), [place], "{bad}");
    }
}

proptest! {
    #[test]
    fn additional_samples_of_a_constant_change_nothing(
        gaps in prop::collection::vec(1..30_000u32, 1..20), ms in 1.0..200.0f64,
    ) {
        let mut rig = rig(ms, Unit::NEWTON);
        show(&mut rig, 0.0, -1.0);
        let mut now = 0;
        for gap in gaps {
            now += gap;
            let time = f64::from(now) * 1e-3;
            let exact = 3.0 - 4.0 * libm::exp(-time / ms);
            prop_assert!((show(&mut rig, time, 3.0).unwrap() - exact).abs() < 1e-12);
            rig.step();
            prop_assert!((rig.get::<Scalar>("value").unwrap() - exact).abs() < 1e-12, "held");
        }
    }

    #[test]
    fn turning_every_axis_turns_the_output(axes in prop::collection::vec(-0.5..0.5f64, 1..10), turn in -10.0..10.0f64) {
        let filtered = |turn: f64| {
            let mut rig = rig(5.0, Unit::AXIAL);
            axes.iter().enumerate().map(|(k, axis)| show(&mut rig, 3.0 * k as f64, axis + turn)).last().unwrap().unwrap()
        };
        let turned = filtered(turn) - filtered(0.0) - turn;
        prop_assert!(libm::sin(turned).abs() < 1e-12, "off by {turned}");
    }
}

#[test]
fn a_cutoff_above_what_a_period_can_filter_is_warned_of() {
    let warnings = |params: &str| places(params, &built(params, Unit::NEWTON));
    assert_eq!(warnings("cutoff_hz = 200"), ["short-time: `cutoff_hz`"]);
    assert!(warnings("cutoff_hz = 100").is_empty() && warnings("time_constant_ms = 1.6").is_empty());
}
