//! `median`: the middle one of the newest samples of a feature, which a few wrong samples do not move.
//!
//! Of an even number it is the mean of the two in the middle. Axes have no order: their median is that sample whose
//! angular distances to all the others, modulo pi, have the least sum; of two that are equal, the newer.

use std::cmp::Ordering;

use tactflow_runtime::node::{Count, Mistake, Mistakes, Node, Setup, Tick};
use tactflow_runtime::{inputs, outputs, params, state};

use crate::motion::axis::wrap_axial;

params! {
    /// Number of samples; of fewer, as long as there are fewer; at most 255 [samples].
    window: Count = Count(5),
}

inputs! {
    /// Any feature.
    value: Scalar["U", "A"],
}

outputs! {
    /// The median of the window.
    value: Scalar["U", "A"],
}

state! {
    /// The newest samples in a ring.
    ring: Vec<f64>,
    /// Room to put them in order.
    sorted: Vec<f64>,
    /// Where the next sample goes.
    next: usize,
    /// Number of samples so far, at most the window.
    count: usize,
}

/// Most samples in the window: those of axes are compared each with each.
const MOST: usize = 255;

/// The window, and whether the feature is an axis.
pub struct Median {
    window: usize,
    is_axial: bool,
}

impl tactflow_runtime::node::Describe for Median {
    const NAME: &'static str = "median";
    const SUMMARY: &'static str = "takes single wrong samples out of a feature: the median of the newest";
    const DOC: &'static str = "The middle one of the last `window` samples in order of size; of an even number, the mean of \
        the two in the middle; of fewer, as long as there are fewer. A glitch of fewer than half the window \
        leaves no trace at all, where a mean is pulled along. Each sample counts once, however long it is held.\n\n\
        **Axes.** The direction of a line (`rad mod pi`) has no order of size. The median is then the sample whose \
        distances to all others, taken the short way round modulo pi, have the least sum; of two that are equal, the \
        newer. It is always one of the samples, so there is one even for axes that cancel each other.\n\n\
        A step comes through half a window late, and stays a step. Against white noise a `smooth` of the same window is \
        better: the median leaves 1.25 times its deviation. Take a short `median` first and a `smooth` after it when there is \
        both.\n\n\
        Absence makes the output absent. The window is kept through a flicker and forgotten after `reset_after_ms`.";
    const EXAMPLE: &'static str = r#"
[nodes.median]
type = "median"
in.value = "moments.pressure"
window = 5                          # two wrong samples leave no trace [samples]
"#;
}

impl Node for Median {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let window = *params.window;
        setup.outputs.value.range = setup.inputs.value.range;
        if window > MOST {
            let mistake = Mistake::param("window", format!("a median is of at most {MOST} samples"));
            return Err(mistake.help("a `smooth` has no such bound").into());
        }
        Ok(Self { window, is_axial: setup.inputs.value.unit.is_axial() })
    }

    fn state(&self) -> State {
        State { ring: vec![0.0; self.window], sorted: vec![0.0; self.window], next: 0, count: 0 }
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        state.push(*inputs.value);
        out.value.set(if self.is_axial { wrap_axial(state.median_axis()) } else { state.median() });
    }
}

impl State {
    fn push(&mut self, sample: f64) {
        self.ring[self.next] = sample;
        self.next = if self.next + 1 < self.ring.len() { self.next + 1 } else { 0 };
        self.count = (self.count + 1).min(self.ring.len());
    }

    fn median(&mut self) -> f64 {
        // Until the ring is full, the samples stand at its start.
        let sorted = &mut self.sorted[..self.count];
        sorted.copy_from_slice(&self.ring[..self.count]);
        let (below, middle, _) = sorted.select_nth_unstable_by(self.count / 2, f64::total_cmp);
        if self.count % 2 == 1 {
            return *middle;
        }
        let under = below.iter().copied().max_by(f64::total_cmp);
        under.map_or(*middle, |under| under.midpoint(*middle))
    }

    fn median_axis(&self) -> f64 {
        let samples = &self.ring[..self.count];
        let away = |axis: f64| samples.iter().fold(0.0, |sum, other| sum + wrap_axial(axis - other).abs());
        // From the newest to the oldest.
        let newest_first = (1..=self.count).map(|k| samples[(self.next + self.count - k) % self.count]);
        let nearer = |a: (f64, f64), b: (f64, f64)| if a.1.total_cmp(&b.1) == Ordering::Greater { b } else { a };
        newest_first.map(|axis| (axis, away(axis))).reduce(nearer).map_or(0.0, |(axis, _)| axis)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::node::At;
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
    fn the_middle_one_of_as_many_as_there_are() {
        let mut odd = rig(3, Unit::NEWTON);
        for (value, median) in [(3.0, 3.0), (5.0, 4.0), (4.0, 4.0), (900.0, 5.0), (4.0, 4.0), (4.5, 4.5), (-900.0, 4.0)]
        {
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
    fn the_median_of_axes_is_the_one_with_the_least_way_to_the_others() {
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
    fn a_held_value_counts_once_and_a_flicker_forgets_nothing() {
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
        assert_eq!(show(&mut rig, 7.0), 7.0, "a lasting absence does");
    }

    #[test]
    fn windows_that_are_none_or_too_long_are_refused() {
        let long = built("window = 256", Unit::NEWTON).err().unwrap();
        assert_eq!(
            (&long[0].at, long[0].message.as_str()),
            (&At::Param("window".into()), "a median is of at most 255 samples")
        );
        assert!(built("window = 0", Unit::NEWTON).is_err() && built("window = 255", Unit::NEWTON).is_ok());
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
        fn no_axis_of_the_window_has_a_shorter_way_to_the_others(
            axes in prop::collection::vec(-2.0..2.0f64, 1..30), window in 1..9usize,
        ) {
            let mut rig = rig(window, Unit::AXIAL);
            let found = axes.iter().map(|axis| show(&mut rig, *axis)).last().unwrap();
            prop_assert!(found > -FRAC_PI_2 && found <= FRAC_PI_2);
            let newest = &axes[axes.len().saturating_sub(window)..];
            // The smaller angle between two lines, by the cosine of the double.
            let between = |a: f64, b: f64| 0.5 * libm::acos(libm::cos(2.0 * (a - b)).clamp(-1.0, 1.0));
            let way = |axis: f64| newest.iter().map(|other| between(axis, *other)).sum::<f64>();
            prop_assert!(newest.iter().all(|axis| way(found) <= way(*axis) + 1e-6));
            prop_assert!(newest.iter().any(|axis| ((axis - found) / PI - ((axis - found) / PI).round()).abs() < 1e-12));
        }
    }
}
