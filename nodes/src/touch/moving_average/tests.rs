//! `moving_average` against tables, and against the mean of the samples in the window.

use proptest::prelude::*;
use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::node::At;
use tactflow_runtime::signal::{Freshness, Scalar, ScalarShape, Stamp, Unit};

use super::*;

fn rig(window: usize, unit: Unit) -> NodeRig {
    let params = format!("window = {window}");
    NodeRig::new::<MovingAverage>(&params, &[("value", ScalarShape::of(unit).into())]).unwrap()
}

fn show(rig: &mut NodeRig, value: f64) -> Option<f64> {
    rig.set("value", value);
    rig.step();
    rig.get::<Scalar>("value").copied()
}

#[test]
fn the_mean_is_over_the_window_or_the_samples_so_far() {
    let mut rig = rig(3, Unit::NEWTON);
    for (value, mean) in [(3.0, 3.0), (5.0, 4.0), (-2.0, 2.0), (3.0, 2.0), (8.0, 3.0), (1e300, 1e300 / 3.0)] {
        assert_eq!(show(&mut rig, value), Some(mean), "{value}");
    }
    for (value, mean) in [(1.0, 1e300 / 3.0), (1.0, 1e300 / 3.0), (4.0, 2.0)] {
        assert_eq!(show(&mut rig, value), Some(mean), "a sample that has left has no influence");
    }
}

#[test]
fn the_mean_of_axes_is_an_axis() {
    let cases: [(&[f64], Option<f64>); 8] = [
        (&[30.0], Some(30.0)),
        (&[89.0, -89.0], Some(90.0)),
        (&[80.0, -70.0], Some(-85.0)),
        (&[10.0, -10.0], Some(0.0)),
        (&[-90.0, 90.0], Some(90.0)),
        (&[45.0, -45.0], None),
        (&[0.0, 60.0, -60.0], None),
        (&[0.0, 90.0, 20.0], Some(20.0)),
    ];
    for (degrees, mean) in cases {
        let mut rig = rig(10, Unit::AXIAL);
        let last = degrees.iter().map(|angle| show(&mut rig, angle.to_radians())).last().unwrap();
        let near = |(a, b): (f64, f64)| (a.to_degrees() - b).abs() < 1e-12;
        assert!(last.zip(mean).map_or(last == mean, near), "{degrees:?}: {last:?}");
    }
    let mut turning = rig(2, Unit::RADIAN);
    show(&mut turning, 3.0);
    assert_eq!(show(&mut turning, -3.0), Some(0.0), "only an axis is wrapped");
}

#[test]
fn a_held_value_counts_once_and_the_window_survives_flicker() {
    let mut rig = rig(4, Unit::NEWTON);
    show(&mut rig, 1.0);
    rig.step();
    assert_eq!((rig.get::<Scalar>("value"), rig.freshness("value")), (Some(&1.0), Freshness::Held));
    assert_eq!(show(&mut rig, 3.0), Some(2.0));
    rig.lose("value");
    rig.step();
    assert_eq!(rig.get::<Scalar>("value"), None);
    assert_eq!(show(&mut rig, 5.0), Some(3.0));
    rig.lose("value");
    rig.step_ms(20.0);
    rig.step();
    assert_eq!(show(&mut rig, 7.0), Some(7.0), "reset after a long absence");
}

fn built(params: &str) -> Result<NodeRig, Mistakes> {
    NodeRig::new::<MovingAverage>(params, &[("value", ScalarShape::of(Unit::NEWTON).into())])
}

#[test]
fn invalid_windows_are_refused() {
    for (bad, place) in [
        ("window = 0", "bad-value: `0`"),
        ("window_ms = 0", "bad-value: `0`"),
        ("window_ms = -1.0", "bad-value: `-1.0`"),
        ("window = 2.5", "bad-value: `2.5`"),
        ("window_ms = \"40 mm\"", "unit-mismatch: `\"40 mm\"`"),
    ] {
        assert_eq!(places(bad, &built(bad)), [place], "{bad}");
    }
    let both = built("window = 10\nwindow_ms = 40").err().unwrap();
    assert_eq!(both[0].at, At::Key("window_ms".into()));
    assert_eq!(both[0].message, "`window` and `window_ms` exclude each other");
    assert!(built("window_ms = 100000").is_ok(), "100000 samples of 1 ms");
    let long = built("window_ms = 100001").err().unwrap();
    assert_eq!(long[0].message, "a window of 100001 ms has more than 100000 samples at the graph's rate");
}

#[test]
fn the_default_window_is_ten_samples() {
    let mut rig = built("").unwrap();
    let last = (0..30).map(|k| show(&mut rig, f64::from(k))).last().unwrap();
    assert_eq!(last, Some(24.5));
}

/// Returns the mean after each sample; a sample is a time [ms], a device and a value.
fn timed(params: &str, samples: &[(f64, u16, f64)]) -> Vec<f64> {
    let mut rig = built(params).unwrap();
    let mean = |(ms, device, value): &(f64, u16, f64)| {
        let stamp = Stamp { nanos: (ms * 1e6) as i64, device: *device };
        rig.edit("value", stamp, |old: &mut Scalar| *old = *value);
        rig.step_ms(0.01);
        *rig.get::<Scalar>("value").unwrap()
    };
    samples.iter().map(mean).collect()
}

#[test]
fn a_window_of_time_ends_with_the_newest_stamp() {
    let samples = [(0.0, 1, 1.0), (4.0, 1, 3.0), (8.0, 1, 5.0), (11.9, 1, 7.0), (12.0, 1, 9.0), (100.0, 1, 2.0)];
    let means = timed("window_ms = 8", &samples);
    assert_eq!(means, [1.0, 2.0, 4.0, 5.0, 7.0, 2.0], "the sample of 8 ms ago is out");
    assert_eq!(timed("window_ms = 0.5", &samples), [1.0, 3.0, 5.0, 7.0, 8.0, 2.0]);
    let devices = [(0.0, 1, 1.0), (1.0, 1, 3.0), (2.0, 2, 8.0), (3.0, 2, 4.0)];
    assert_eq!(timed("window_ms = 50", &devices), [1.0, 2.0, 8.0, 6.0], "another device");
    let back = [(5.0, 1, 1.0), (4.0, 1, 3.0), (20.0, 1, 8.0)];
    assert_eq!(timed("window_ms = 10", &back), [1.0, 2.0, 8.0]);
}

#[test]
fn a_window_of_time_starts_afresh_after_a_long_gap() {
    // The harness has a max_gap of 100 ms.
    let samples = [(0.0, 1, 1.0), (100.0, 1, 3.0), (200.1, 1, 9.0), (210.0, 1, 5.0)];
    assert_eq!(timed("window_ms = 500", &samples), [1.0, 2.0, 9.0, 7.0]);
    assert_eq!(timed("window = 9", &samples), [1.0, 2.0, 13.0 / 3.0, 4.5], "a number of samples has no time");
}

#[test]
fn more_samples_than_the_capacity_make_the_window_shorter() {
    // 5 ms at the rig's 1 ms a tick: a capacity of eleven.
    let samples: Vec<_> = (0..100).map(|k| (0.1 * f64::from(k), 1, f64::from(k))).collect();
    assert_eq!(timed("window_ms = 5", &samples).last(), Some(&94.0), "the mean of 89 to 99");
}

#[test]
fn the_mean_of_finite_samples_is_finite() {
    let mut rig = rig(3, Unit::NEWTON);
    let last = (0..3).map(|_| show(&mut rig, f64::MAX)).last().unwrap();
    assert!((last.unwrap() / f64::MAX - 1.0).abs() < 1e-15);
}

proptest! {
    #[test]
    fn only_the_window_matters(values in prop::collection::vec(-1e3..1e3f64, 1..60), window in 1..12usize) {
        let mut rig = rig(window, Unit::NEWTON);
        for last in 0..values.len() {
            let newest = &values[(last + 1).saturating_sub(window)..=last];
            let mean = newest.iter().fold(0.0, |sum, value| sum + value) / newest.len() as f64;
            prop_assert_eq!(show(&mut rig, values[last]), Some(mean));
        }
    }

    #[test]
    fn only_the_samples_of_the_time_matter(
        steps in prop::collection::vec((1..30_000u32, -1e3..1e3f64), 1..60),
        window_us in 1..40_000u32,
    ) {
        let mut now = 0;
        let samples: Vec<(i64, f64)> = steps.iter().map(|(us, value)| {
            now += i64::from(*us);
            (now, *value)
        }).collect();
        let params = format!("window_ms = {}", f64::from(window_us) / 1e3);
        let mut rig = built(&params).unwrap();
        let capacity = 2 * (f64::from(window_us) / 1e3).ceil() as usize + 1;
        for (i, (now, value)) in samples.iter().enumerate() {
            let stamp = Stamp { nanos: now * 1000, device: 0 };
            rig.edit("value", stamp, |old: &mut Scalar| *old = *value);
            rig.step();
            let counting: Vec<f64> = samples[..=i]
                .iter()
                .filter(|(then, _)| now - then < i64::from(window_us))
                .map(|(_, value)| *value)
                .collect();
            let newest = &counting[counting.len().saturating_sub(capacity)..];
            let mean = newest.iter().fold(0.0, |sum, value| sum + value) / newest.len() as f64;
            prop_assert_eq!(rig.get::<Scalar>("value"), Some(&mean));
            rig.step();
            prop_assert_eq!(rig.get::<Scalar>("value"), Some(&mean), "a held sample counts once");
        }
    }

    #[test]
    fn turning_every_axis_turns_the_mean(axes in prop::collection::vec(-0.5..0.5f64, 1..10), turn in -10.0..10.0f64) {
        let mean = |turn: f64| {
            let mut rig = rig(10, Unit::AXIAL);
            axes.iter().map(|axis| show(&mut rig, axis + turn)).last().unwrap().unwrap()
        };
        let turned = mean(turn) - mean(0.0) - turn;
        prop_assert!(libm::sin(turned).abs() < 1e-12, "off by {turned}");
    }
}
