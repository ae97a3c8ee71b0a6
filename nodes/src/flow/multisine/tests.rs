//! `multisine` against its discrete Fourier transform.

use std::f64::consts::TAU;

use proptest::prelude::*;
use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::signal::{FlagShape, Freshness, Shape};

use super::*;

const BAND: &str = "period = 0.5\nmin_frequency = 6.0\nmax_frequency = 40.0";

fn built(params: &str, wires: &[(&str, Shape)]) -> Result<NodeRig, Mistakes> {
    NodeRig::new::<Multisine>(&format!("unit = 'm/s'\n{params}"), wires)
}

/// The values in as many ticks of a millisecond, and whether the signal is done.
fn samples(rig: &mut NodeRig, count: usize) -> Vec<(f64, bool)> {
    let mut sample = || {
        rig.step();
        (*rig.get::<Scalar>("value").unwrap(), *rig.get::<Flag>("done").unwrap())
    };
    (0..count).map(|_| sample()).collect()
}

/// The amplitude at a multiple of the inverse of the period, of the samples of one period.
fn amplitude(period: &[f64], multiple: usize) -> f64 {
    let (mut real, mut imaginary) = (0.0, 0.0);
    for (i, value) in period.iter().enumerate() {
        let angle = TAU * (multiple * i) as f64 / period.len() as f64;
        real += value * angle.cos();
        imaginary += value * angle.sin();
    }
    2.0 * libm::hypot(real, imaginary) / period.len() as f64
}

#[test]
fn a_period_contains_the_multiples_in_the_band_with_one_amplitude_and_nothing_else() {
    let mut rig = built(&format!("amplitude = 0.5\n{BAND}"), &[]).unwrap();
    let values: Vec<f64> = samples(&mut rig, 1500).into_iter().map(|(value, _)| value).collect();
    let (first, second) = (&values[..500], &values[1000..]);
    assert!(first.iter().zip(second).all(|(a, b)| (a - b).abs() < 1e-9), "each period is the same");
    let height = amplitude(first, 3);
    assert!(height > 0.0);
    for multiple in 0..250 {
        let expected = if (3..=20).contains(&multiple) { height } else { 0.0 };
        let found = amplitude(first, multiple);
        assert!((found - expected).abs() < 1e-9, "{multiple}: {found} instead of {expected}");
    }
    let peak = values.iter().fold(0.0_f64, |peak, value| peak.max(value.abs()));
    let deviation = height * (18.0_f64 / 2.0).sqrt();
    assert!(peak <= 0.5 && peak < 2.0 * deviation, "{peak}, {deviation}");
}

proptest! {
    #[test]
    fn it_stays_within_its_bound_and_begins_and_ends_at_zero(
        first in 1..30usize, count in 1..60usize, parts in prop::collection::vec(0.0..1.0f64, 200),
    ) {
        let wave = Wave::new(first, count, 2.0);
        prop_assert!(parts.iter().all(|part| wave.at(2.0 * part).abs() <= 1.0));
        prop_assert!(wave.at(0.0).abs() < 1e-9 && wave.at(6.0).abs() < 1e-7);
        // The standard deviation over the peak.
        prop_assert!(count < 8 || wave.amplitude() * (count as f64 / 2.0).sqrt() > 0.45);
    }
}

#[test]
fn it_ends_after_its_periods_at_zero() {
    let mut rig = built(&format!("{BAND}\nperiods = 2"), &[]).unwrap();
    let values = samples(&mut rig, 1100);
    assert!(values[0].0.abs() < 1e-9 && values[..1000].iter().all(|(_, is_done)| !is_done));
    assert!(values[999].0.abs() > 1e-6 && values[1000..].iter().all(|sample| *sample == (0.0, true)));
    // Five weeks later the phase is still exact.
    let mut rig = built(BAND, &[]).unwrap();
    rig.tick.now = 3_024_000_123_000_000;
    assert!((samples(&mut rig, 1)[0].0 - values[123].0).abs() < 1e-6);
}

#[test]
fn a_gate_begins_and_ends_the_signal() {
    let mut rig = built(BAND, &[("gate", FlagShape.into())]).unwrap();
    let mut step = |gate: Option<bool>| {
        match gate {
            Some(gate) => rig.set("gate", gate),
            None => rig.lose("gate"),
        }
        rig.step();
        (rig.freshness("value"), rig.get::<Scalar>("value").copied())
    };
    assert_eq!(step(Some(false)), (Freshness::Absent, None));
    let begin = step(Some(true));
    let next = step(Some(true));
    assert!(begin.1.unwrap().abs() < 1e-9 && next.1.unwrap() != begin.1.unwrap());
    assert_eq!(step(None), (Freshness::Lost, None));
    assert_eq!((step(Some(true)), step(Some(true))), (begin, next), "it begins again");
    assert_eq!(step(Some(false)).1, None);
}

#[test]
fn what_cannot_be_is_refused() {
    for (bad, place) in [
        ("period = 0.5003\nmin_frequency = 6.0\nmax_frequency = 40.0", "bad-value: `period`"),
        ("period = 0.0005\nmin_frequency = 6.0\nmax_frequency = 40.0", "bad-value: `period`"),
        ("period = 0.5\nmin_frequency = 6.0\nmax_frequency = 501.0", "bad-value: `max_frequency`"),
        ("period = 0.5\nmin_frequency = 6.3\nmax_frequency = 7.7", "bad-value: `max_frequency`"),
        ("period = 0.5\nmin_frequency = 40.0\nmax_frequency = 6.0", "bad-value: `max_frequency`"),
        ("period = 9.0\nmin_frequency = 6.0\nmax_frequency = 40.0", "bad-value: `period`"),
        ("min_frequency = 6.0\nmax_frequency = 40.0", "missing-key: `the node`"),
        ("period = 0.5\nmin_frequency = 6.0\nmax_frequency = 40.0\nperiods = 0", "bad-value: `0`"),
    ] {
        let params = format!("unit = 'm/s'\n{bad}");
        assert_eq!(places(&params, &built(bad, &[])), [place], "{bad}");
    }
    assert!(built("period = 0.5\nmin_frequency = 6.0\nmax_frequency = 6.0", &[]).is_ok(), "one sine");
}
