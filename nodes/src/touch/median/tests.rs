//! `median` against tables and sorted windows.

use std::f64::consts::{FRAC_PI_2, PI};

use proptest::prelude::*;
use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::signal::{Freshness, Scalar, ScalarShape, Unit};

use super::*;

fn built(params: &str, unit: Unit) -> Result<NodeRig, Mistakes> {
    NodeRig::new::<Median>(params, &[("value", ScalarShape::of(unit).into())])
}

fn rig(window: usize, unit: Unit) -> NodeRig {
    built(&format!("window = {window}"), unit).unwrap()
}

fn show(rig: &mut NodeRig, value: f64) -> f64 {
    rig.set("value", value);
    rig.step();
    *rig.get::<Scalar>("value").unwrap()
}

#[test]
fn it_is_the_middle_of_the_window_or_of_the_samples_so_far() {
    let mut odd = rig(3, Unit::NEWTON);
    for (value, median) in [(3.0, 3.0), (5.0, 4.0), (4.0, 4.0), (900.0, 5.0), (4.0, 4.0), (4.5, 4.5), (-900.0, 4.0)] {
        assert_eq!(show(&mut odd, value), median, "{value}");
    }
    let mut even = rig(4, Unit::NEWTON);
    for (value, median) in [(1.0, 1.0), (2.0, 1.5), (9.0, 2.0), (3.0, 2.5), (4.0, 3.5), (f64::MAX, 6.5)] {
        assert_eq!(show(&mut even, value), median, "{value}");
    }
    let mut large = rig(2, Unit::NEWTON);
    show(&mut large, f64::MAX);
    assert_eq!(show(&mut large, f64::MAX), f64::MAX);
}

#[test]
fn the_median_of_axes_has_the_smallest_sum_of_distances() {
    let cases: [(&[f64], f64); 8] = [
        (&[30.0], 30.0),
        (&[80.0, -85.0], -85.0),
        (&[-85.0, 80.0], 80.0),
        (&[88.0, -88.0, 89.0], 89.0),
        (&[88.0, -88.0, 0.0], -88.0),
        (&[45.0, -45.0], -45.0),
        (&[0.0, 1.0, 2.0, 60.0, 3.0], 2.0),
        (&[-90.0], 90.0),
    ];
    for (degrees, median) in cases {
        let mut rig = rig(5, Unit::AXIAL);
        let last = degrees.iter().map(|angle| show(&mut rig, angle.to_radians())).last().unwrap();
        assert!((last.to_degrees() - median).abs() < 1e-12, "{degrees:?}: {last}");
    }
    let mut turning = rig(3, Unit::RADIAN);
    show(&mut turning, 3.0);
    assert_eq!(show(&mut turning, -3.0), 0.0, "only an axis is wrapped");
}

#[test]
fn a_held_value_counts_once_and_the_window_survives_flicker() {
    let mut rig = rig(3, Unit::NEWTON);
    show(&mut rig, 1.0);
    rig.step();
    assert_eq!((rig.get::<Scalar>("value"), rig.freshness("value")), (Some(&1.0), Freshness::Held));
    assert_eq!(show(&mut rig, 3.0), 2.0);
    rig.lose("value");
    rig.step();
    assert_eq!(rig.get::<Scalar>("value"), None);
    assert_eq!(show(&mut rig, 9.0), 3.0);
    rig.lose("value");
    rig.step_ms(20.0);
    rig.step();
    assert_eq!(show(&mut rig, 7.0), 7.0, "reset after a long absence");
}

#[test]
fn empty_and_too_long_windows_are_refused() {
    let long = built("window = 256", Unit::NEWTON).err().unwrap();
    assert_eq!(long[0].message, "expected a whole number from 1 to 255 [sample], found 256");
    assert_eq!(places("window = 0", &built("window = 0", Unit::NEWTON)), ["bad-value: `0`"]);
    assert!(built("window = 255", Unit::NEWTON).is_ok());
}

proptest! {
    #[test]
    fn it_is_the_middle_of_the_sorted_window(values in prop::collection::vec(-1e3..1e3f64, 1..60), window in 1..12usize) {
        let mut rig = rig(window, Unit::NEWTON);
        for last in 0..values.len() {
            let mut newest = values[(last + 1).saturating_sub(window)..=last].to_vec();
            newest.sort_by(f64::total_cmp);
            let half = newest.len() / 2;
            let median = if newest.len() % 2 == 1 { newest[half] } else { (newest[half - 1] + newest[half]) / 2.0 };
            prop_assert!((show(&mut rig, values[last]) - median).abs() < 1e-9);
            rig.step();
            prop_assert!((rig.get::<Scalar>("value").unwrap() - median).abs() < 1e-9, "held");
        }
    }

    #[test]
    fn no_axis_of_the_window_has_a_smaller_sum_of_distances(
        axes in prop::collection::vec(-2.0..2.0f64, 1..30), window in 1..9usize,
    ) {
        let mut rig = rig(window, Unit::AXIAL);
        let found = axes.iter().map(|axis| show(&mut rig, *axis)).last().unwrap();
        prop_assert!(found > -FRAC_PI_2 && found <= FRAC_PI_2);
        let newest = &axes[axes.len().saturating_sub(window)..];
        // The smaller angle between two lines, by the cosine of the double.
        let between = |a: f64, b: f64| 0.5 * libm::acos(libm::cos(2.0 * (a - b)).clamp(-1.0, 1.0));
        let distances = |axis: f64| newest.iter().map(|other| between(axis, *other)).sum::<f64>();
        prop_assert!(newest.iter().all(|axis| distances(found) <= distances(*axis) + 1e-6));
        prop_assert!(newest.iter().any(|axis| ((axis - found) / PI - ((axis - found) / PI).round()).abs() < 1e-12));
    }
}
