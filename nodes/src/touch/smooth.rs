//! `smooth`: the mean of the newest samples of a feature (paper section V: of force and orientation, over ten).
//!
//! An axis has no arithmetic mean, as 89 and -89 degrees are neighbours: the mean is taken of (cos 2a, sin 2a), and
//! halved by one arctangent. Axes that cancel each other have no mean; then there is none.
//!
//! The window is summed anew in each step, from its oldest sample to its newest: no drift, and what has left the window
//! leaves no trace.

use tactflow_runtime::node::{Count, Mistakes, Node, Setup, Tick};
use tactflow_runtime::{inputs, outputs, params, state};

use super::axis;

params! {
    /// Number of samples in the mean; of fewer, as long as there are fewer.
    window: Count = Count(10),
}

inputs! {
    /// Any feature.
    value: Scalar["U", "A"],
}

outputs! {
    /// Its mean over the window; absent for axes that cancel each other.
    value: Scalar["U", "A"],
}

state! {
    /// The newest samples in a ring; of an axis cosine and sine of its double, else the value and zero.
    ring: Vec<[f64; 2]>,
    /// Where the next sample goes.
    next: usize,
    /// Number of samples so far, at most the window.
    count: usize,
}

/// Mean length of the doubled axes' unit vectors below which they cancel each other [1].
const LEAST_RESULTANT: f64 = 1e-6;

/// The window, and whether the feature is an axis.
pub struct Smooth {
    window: usize,
    is_axial: bool,
}

impl Node for Smooth {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    const NAME: &'static str = "smooth";
    const SUMMARY: &'static str = "the mean of the newest samples of a feature";

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self { window: *params.window, is_axial: setup.inputs.value.unit.is_axial() })
    }

    fn state(&self) -> State {
        State { ring: vec![[0.0; 2]; self.window], next: 0, count: 0 }
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let value = *inputs.value;
        if !self.is_axial {
            state.push([value, 0.0]);
            out.value.set(state.mean()[0]);
            return;
        }
        let (sine, cosine) = libm::sincos(2.0 * value);
        state.push([cosine, sine]);
        let [cosine, sine] = state.mean();
        if (cosine * cosine + sine * sine).sqrt() >= LEAST_RESULTANT {
            out.value.set(axis(sine, cosine));
        }
    }
}

impl State {
    fn push(&mut self, sample: [f64; 2]) {
        self.ring[self.next] = sample;
        self.next = if self.next + 1 < self.ring.len() { self.next + 1 } else { 0 };
        self.count = (self.count + 1).min(self.ring.len());
    }

    fn mean(&self) -> [f64; 2] {
        // Until the ring is full, its oldest sample is the first; then it is the one to be written next.
        let (newer, older) = self.ring[..self.count].split_at(if self.count < self.ring.len() { 0 } else { self.next });
        let mut sum = [0.0; 2];
        for samples in [older, newer] {
            for [a, b] in samples {
                sum = [sum[0] + a, sum[1] + b];
            }
        }
        sum.map(|sum| sum / self.count as f64)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Freshness, Scalar, ScalarShape, Unit};

    use super::*;

    fn rig(window: usize, unit: Unit) -> NodeRig {
        let params = format!("window = {window}");
        NodeRig::new::<Smooth>(&params, &[("value", ScalarShape { unit }.into())]).unwrap()
    }

    fn show(rig: &mut NodeRig, value: f64) -> Option<f64> {
        rig.set("value", value);
        rig.step();
        rig.get::<Scalar>("value").copied()
    }

    #[test]
    fn the_mean_is_of_as_many_as_there_are() {
        let mut rig = rig(3, Unit::NEWTON);
        for (value, mean) in [(3.0, 3.0), (5.0, 4.0), (-2.0, 2.0), (3.0, 2.0), (8.0, 3.0), (1e300, 1e300 / 3.0)] {
            assert_eq!(show(&mut rig, value), Some(mean), "{value}");
        }
        for (value, mean) in [(1.0, 1e300 / 3.0), (1.0, 1e300 / 3.0), (4.0, 2.0)] {
            assert_eq!(show(&mut rig, value), Some(mean), "what has left leaves no trace");
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
    fn a_held_value_counts_once_and_a_flicker_forgets_nothing() {
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
        assert_eq!(show(&mut rig, 7.0), Some(7.0), "a lasting absence does");
    }

    #[test]
    fn an_empty_window_is_refused() {
        let shape = ScalarShape { unit: Unit::NEWTON };
        assert!(NodeRig::new::<Smooth>("window = 0", &[("value", shape.clone().into())]).is_err());
        assert!(NodeRig::new::<Smooth>("", &[("value", shape.into())]).is_ok());
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
        fn turning_every_axis_turns_the_mean(axes in prop::collection::vec(-0.5..0.5f64, 1..10), turn in -10.0..10.0f64) {
            let mean = |turn: f64| {
                let mut rig = rig(10, Unit::AXIAL);
                axes.iter().map(|axis| show(&mut rig, axis + turn)).last().unwrap().unwrap()
            };
            let turned = mean(turn) - mean(0.0) - turn;
            prop_assert!(libm::sin(turned).abs() < 1e-12, "off by {turned}");
        }
    }
}
