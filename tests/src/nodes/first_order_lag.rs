//! `first_order_lag`: a low-pass filter of the first order, T dy/dt = x - y.
//!
//! Each sample is one implicit Euler step, y += dt / (T + dt) (x - y): no step overshoots, however late a sample comes.
//! dt is the time between two samples, so T means the same at 100 Hz and at 1 kHz. The first sample passes as it is.
//! What has decayed to almost nothing is zero, as subnormal numbers are slow.

use tactflow_runtime::node::{
    At, Describe, In, Inputs, Interval, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick,
};
use tactflow_runtime::signal::Scalar;
use tactflow_runtime::source::Code;

/// A low-pass filter of the first order.
///
/// T dy/dt = x - y, one implicit Euler step a sample: it never overshoots, however late a sample comes, and T means the
/// same at any rate. The first sample passes as it is.
///
/// It refuses the direction of a line, which has no plain mean: take a `moving_average` for that.
///
/// ```toml
/// [nodes.first_order_lag]
/// type = "first_order_lag"
/// in.value = "moments.pressure"
/// time = 0.05                         # [s]
/// ```
#[derive(Describe)]
pub struct FirstOrderLag {
    time: f64,
}

/// Parameters of `first_order_lag`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Time in which 63 % of a step have passed through, T.
    #[param(unit = "s", above = 0.0, default = 0.02)]
    time: f64,
}

/// What `first_order_lag` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Any feature that has no axis.
    #[port(unit = "U", frame = "A", quantity = "Q")]
    value: In<'a, Scalar>,
}

/// What `first_order_lag` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The same, smoothed.
    #[port(unit = "U", frame = "A", quantity = "Q")]
    value: Out<Scalar>,
}

/// What `first_order_lag` remembers.
#[derive(State)]
pub struct State {
    /// What came out last; nothing yet after a reset.
    last: Option<f64>,
    /// Since the last sample.
    interval: Interval,
}

impl Node for FirstOrderLag {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        if setup.inputs.value.unit.is_axial() {
            let place = At::Input("value".into());
            let mistake = Mistake::new(Code::UnitMismatch, place, "the direction of a line has no plain mean");
            return Err(mistake.help("take a `moving_average`: it takes the mean of axes").into());
        }
        Ok(Self { time: params.time })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let value = match state.last.zip(state.interval.step(&inputs.value, tick)) {
            Some((last, dt)) => toward(last, *inputs.value, dt / (self.time + dt)),
            None => *inputs.value,
        };
        state.last = Some(value);
        out.value.set(value);
    }
}

/// What is smaller than this is nothing: far above the subnormal numbers, far below anything measured.
const NOTHING: f64 = 1e-200;

/// The value that lies the fraction `share` of the way from `last` to `next`.
fn toward(last: f64, next: f64, share: f64) -> f64 {
    let value = last + share * (next - last);
    if value.abs() < NOTHING { 0.0 } else { value }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Freshness, Scalar, ScalarShape, Unit};

    use super::*;

    fn rig(time: f64, unit: Unit) -> Result<NodeRig, Mistakes> {
        NodeRig::new::<FirstOrderLag>(&format!("time = {time}"), &[("value", ScalarShape::of(unit).into())])
    }

    /// What comes out of a sample, `ms` before the next.
    fn show(rig: &mut NodeRig, value: f64, ms: f64) -> f64 {
        rig.set("value", value);
        rig.step_ms(ms);
        *rig.get::<Scalar>("value").unwrap()
    }

    #[test]
    fn after_its_time_63_percent_of_a_step_have_passed_at_any_rate() {
        for (ms, tolerance) in [(0.1, 0.002), (1.0, 0.01), (4.0, 0.04)] {
            let mut rig = rig(0.1, Unit::NEWTON).unwrap();
            show(&mut rig, 0.0, ms);
            let steps = (100.0_f64 / ms).round() as usize;
            let last = (0..steps).map(|_| show(&mut rig, 1.0, ms)).last().unwrap();
            let exact = 1.0 - (-1.0_f64).exp();
            assert!((last - exact).abs() < tolerance, "{ms} ms: {last} against {exact}");
        }
    }

    #[test]
    fn the_first_sample_passes_and_a_late_one_does_not_overshoot() {
        let mut rig = rig(0.02, Unit::METRE).unwrap();
        assert_eq!(show(&mut rig, 3.0, 80.0), 3.0);
        let late = show(&mut rig, 5.0, 1.0);
        assert!((late - (3.0 + 0.8 * 2.0)).abs() < 1e-12, "80 ms of 100: {late}");
    }

    #[test]
    fn a_held_value_counts_once_and_only_a_lasting_absence_forgets() {
        let mut rig = rig(0.02, Unit::NEWTON).unwrap();
        show(&mut rig, 0.0, 20.0);
        assert_eq!(show(&mut rig, 1.0, 1.0), 0.5);
        rig.step();
        assert_eq!((rig.get::<Scalar>("value"), rig.freshness("value")), (Some(&0.5), Freshness::Held));
        rig.lose("value");
        rig.step_ms(18.0);
        assert_eq!(rig.get::<Scalar>("value"), None);
        assert_eq!(show(&mut rig, 1.0, 1.0), 0.75, "flicker: it goes on from what was, 20 ms later");
        rig.lose("value");
        rig.step_ms(20.0);
        rig.step();
        assert_eq!(show(&mut rig, 7.0, 1.0), 7.0, "a fresh state");
    }

    #[test]
    fn what_decays_becomes_zero() {
        let mut rig = rig(1e-6, Unit::NEWTON).unwrap();
        show(&mut rig, 1.0, 1.0);
        let decayed = (0..100).map(|_| show(&mut rig, 0.0, 1.0)).last();
        assert_eq!(decayed, Some(0.0));
    }

    #[test]
    fn an_axis_and_a_time_of_zero_are_refused() {
        let axis = rig(0.02, Unit::AXIAL).err().unwrap();
        assert_eq!(axis[0].message, "the direction of a line has no plain mean");
        let zero = rig(0.0, Unit::NEWTON).err().unwrap();
        assert_eq!(zero[0].message, "expected a number greater than 0 [s], found 0");
    }
}
