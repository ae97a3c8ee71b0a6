//! `one_pole`: a low-pass filter of the first order, T dy/dt = x - y.
//!
//! Each sample holds for the time since the one before it: y += (1 - exp(-dt / T)) (x - y). That is the equation's
//! solution, so T means the same at every rate and between samples that come irregularly. The first sample passes as it
//! is. An axis is filtered as (cos 2a, sin 2a); axes that cancel each other have no mean, and then there is none.

use std::f64::consts::PI;

use tactflow_runtime::node::{At, Interval, Mistake, Mistakes, Node, Positive, Setup, Tick};
use tactflow_runtime::source::Code;
use tactflow_runtime::{inputs, outputs, params, state};

use crate::motion::axis::{doubled, halved};

params! {
    /// Time in which 63 % of a step have passed through, T; this or `cutoff_hz` [ms].
    time_constant_ms: Option<Positive>,
    /// Frequency above which less than 71 % pass through, 1 / (2 pi T); this or `time_constant_ms` [Hz].
    cutoff_hz: Option<Positive>,
}

inputs! {
    /// Any feature.
    value: Scalar["U", "A"],
}

outputs! {
    /// The same, smoothed; absent for axes that cancel each other.
    value: Scalar["U", "A"],
}

state! {
    /// What came out last: of an axis the mean of the cosine and the sine of its double, else the value and zero.
    last: Option<[f64; 2]>,
    /// Since the last sample.
    interval: Interval,
}

/// What is smaller than this is nothing: far above the subnormal numbers, which are slow, far below anything measured.
const NOTHING: f64 = 1e-200;

/// The filter's time, and whether the feature is an axis.
pub struct OnePole {
    /// T [s].
    time: f64,
    is_axial: bool,
}

impl tactflow_runtime::node::Describe for OnePole {
    const NAME: &'static str = "one_pole";
    const SUMMARY: &'static str = "smooths a feature with a low-pass filter of the first order";
    const DOC: &'static str = "T dy/dt = x - y, solved exactly from sample to sample: y += (1 - exp(-dt / T)) (x - y), with dt \
        from the stamps of the samples. So T means the same at 100 Hz and at 1 kHz, and when samples come irregularly. \
        Give `time_constant_ms`, T, or `cutoff_hz`, 1 / (2 pi T): 40 ms are 4 Hz.\n\n\
        It follows a ramp T late, and leaves dt / (2 T) of the variance of white noise: as much as a `smooth` with \
        a window of 2 T. Also called a lowpass or an exponential average. Unlike that it never quite forgets, and needs no window.\n\n\
        The first sample passes as it is. A gap counts as `max_gap_ms` of the graph at most. A sample of another device than \
        the last one changes nothing, as their times cannot be compared; the next one does.\n\n\
        **Axes.** The direction of a line (`rad mod pi`) is filtered as (cos 2a, sin 2a) and halved by one arctangent, \
        since 89° and -89° are neighbours. Turns that are small between two samples pass as those of any \
        value; a turn by 90° goes over a point without any direction, where the output is absent.\n\n\
        Absence makes the output absent; the state is kept through a flicker and forgotten after `reset_after_ms`.";
    const EXAMPLE: &'static str = r#"
[nodes.one_pole]
type = "one_pole"
in.value = "moments.orientation"
time_constant_ms = 20               # [ms]
"#;
}

impl Node for OnePole {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let is_axial = setup.inputs.value.unit.is_axial();
        setup.outputs.value.range = setup.inputs.value.range;
        match (params.time_constant_ms, params.cutoff_hz) {
            (Some(ms), None) => Ok(Self { time: *ms * 1e-3, is_axial }),
            (None, Some(hz)) => Ok(Self { time: 0.5 / (PI * *hz), is_axial }),
            (None, None) => {
                let message = "a filter needs a time: `time_constant_ms` or `cutoff_hz` is missing";
                Err(Mistake::new(Code::MissingKey, At::Node, message).into())
            }
            (Some(_), Some(_)) => {
                let mistake = Mistake::key("cutoff_hz", "`time_constant_ms` says the same: give one of the two");
                Err(mistake.help("a cutoff of 1 Hz is a time constant of 159 ms").into())
            }
        }
    }

    fn state(&self) -> State {
        State { last: None, interval: Interval::default() }
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let dt = state.interval.step(&inputs.value, tick);
        let next = if self.is_axial { doubled(*inputs.value) } else { [*inputs.value, 0.0] };
        // After a gap, or from another device, it starts afresh.
        let value = match state.last.zip(dt) {
            Some(([a, b], dt)) => {
                // With a time of next to nothing, no time at all would be none of it and all of it.
                let share = if dt > 0.0 { -libm::expm1(-dt / self.time) } else { 0.0 };
                [toward(a, next[0], share), toward(b, next[1], share)]
            }
            None => next,
        };
        state.last = Some(value);
        let value = if self.is_axial { halved(value) } else { Some(value[0]) };
        if let Some(value) = value {
            out.value.set(value);
        }
    }
}

/// The value that lies the fraction `share` of the way from `last` to `next`.
fn toward(last: f64, next: f64, share: f64) -> f64 {
    let way = next - last;
    // Between two that are so far apart that their difference is infinite there is still a way.
    let value = if way.is_finite() { last + share * way } else { last * (1.0 - share) + next * share };
    if value.abs() < NOTHING { 0.0 } else { value }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Freshness, Scalar, ScalarShape, Stamp, Unit};

    use super::*;

    fn built(params: &str, unit: Unit) -> Result<NodeRig, Mistakes> {
        NodeRig::new::<OnePole>(params, &[("value", ScalarShape::of(unit).into())])
    }

    fn rig(ms: f64, unit: Unit) -> NodeRig {
        let mut rig = built(&format!("time_constant_ms = {ms:?}"), unit).unwrap();
        rig.tick.max_gap = 1e6;
        rig
    }

    /// What comes out of a sample that was taken at that time.
    fn show(rig: &mut NodeRig, ms: f64, value: f64) -> Option<f64> {
        let stamp = Stamp { nanos: (ms * 1e6).round() as i64, device: 0 };
        rig.edit("value", stamp, |old: &mut Scalar| *old = value);
        rig.step_ms(0.001);
        rig.get::<Scalar>("value").copied()
    }

    #[test]
    fn a_step_is_answered_by_one_minus_exp_however_the_samples_fall() {
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
    fn a_ramp_is_followed_a_time_constant_late_and_a_sine_at_the_cutoff_is_halved_in_power() {
        let mut ramp = rig(20.0, Unit::METRE);
        let last =
            (0..40_000).map(|k| show(&mut ramp, 0.01 * f64::from(k), 0.01 * f64::from(k)).unwrap()).last().unwrap();
        assert!((399.99 - last - 20.0).abs() < 0.01, "{last}");
        let mut sine = built("cutoff_hz = 5", Unit::METRE).unwrap();
        let swing = |k: i32| (k, libm::sin(2.0 * PI * 5.0 * f64::from(k) * 1e-4));
        let passed = (0..20_000).map(swing).map(|(k, value)| (k, show(&mut sine, 0.1 * f64::from(k), value).unwrap()));
        let greatest = passed.filter(|(k, _)| *k > 10_000).fold(0.0, |most, (_, value)| f64::max(most, value));
        assert!((greatest - 0.5_f64.sqrt()).abs() < 1e-3, "{greatest}");
    }

    #[test]
    fn an_axis_goes_the_short_way_round() {
        let mut slow = rig(1000.0, Unit::AXIAL);
        show(&mut slow, 0.0, 89.0_f64.to_radians());
        let near = show(&mut slow, 1.0, -89.0_f64.to_radians()).unwrap().to_degrees();
        assert!((near - 89.002).abs() < 1e-4, "{near}");
        let mut even = rig(1.0 / std::f64::consts::LN_2, Unit::AXIAL);
        show(&mut even, 0.0, 0.0);
        assert_eq!(show(&mut even, 1.0, PI / 2.0), None, "half of each, and they cancel each other");
        assert!(show(&mut even, 2.0, PI / 2.0).is_some());
        let mut turning = rig(1.0 / std::f64::consts::LN_2, Unit::RADIAN);
        show(&mut turning, 0.0, 3.0);
        assert!(show(&mut turning, 1.0, -3.0).unwrap().abs() < 1e-12, "only an axis is wrapped");
    }

    #[test]
    fn a_held_value_counts_once_and_only_a_lasting_absence_forgets() {
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
        assert!(near(&rig, 0.875), "flicker: it goes on, 20 ms later");
        rig.lose("value");
        rig.step_ms(20.0);
        rig.step();
        rig.set("value", 7.0);
        rig.step();
        assert!(near(&rig, 7.0), "a fresh state");
    }

    #[test]
    fn it_starts_afresh_after_a_gap_and_with_another_device() {
        let mut rig = built("time_constant_ms = 100", Unit::NEWTON).unwrap();
        let at = |rig: &mut NodeRig, ms: i64, device: u16, value: f64| {
            rig.edit("value", Stamp { nanos: ms * 1_000_000, device }, |old: &mut Scalar| *old = value);
            rig.step();
            *rig.get::<Scalar>("value").unwrap()
        };
        assert_eq!(at(&mut rig, 0, 0, 0.0), 0.0);
        let longest = at(&mut rig, 100, 0, 1.0);
        assert!((longest - 1.0 + libm::exp(-1.0)).abs() < 1e-12, "100 ms are no gap: {longest}");
        assert_eq!(at(&mut rig, 5000, 0, 2.0), 2.0, "a gap");
        assert_eq!(at(&mut rig, 5001, 1, 9.0), 9.0, "another device");
        assert!(at(&mut rig, 5002, 1, 0.0) > 8.0);
    }

    #[test]
    fn what_decays_becomes_zero_and_what_is_finite_stays_so() {
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
    fn a_filter_needs_one_time() {
        let none = built("", Unit::NEWTON).err().unwrap();
        assert_eq!((none[0].at.clone(), none[0].code), (At::Node, Code::MissingKey));
        let both = built("time_constant_ms = 20\ncutoff_hz = 8", Unit::NEWTON).err().unwrap();
        assert_eq!(both[0].at, At::Key("cutoff_hz".into()));
        for bad in ["time_constant_ms = 0", "cutoff_hz = -1", "cutoff_hz = inf", "time = 1"] {
            assert!(built(bad, Unit::NEWTON).is_err(), "{bad}");
        }
    }

    proptest! {
        #[test]
        fn samples_on_the_way_of_a_constant_change_nothing(
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
}
