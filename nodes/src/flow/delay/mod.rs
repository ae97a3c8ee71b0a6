//! `delay` and `twist_delay`: one implementation for both kinds.
//!
//! The input is read as the last tick left it, so the node steps before the node that it reads from. What was new then
//! is new now, and what was held is held.

mod delayable;

use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Reading, Setup, Tick};
use tactflow_runtime::signal::{Scalar, Signal, Twist};

use super::passing::State;
pub use delayable::{Delayable, ScalarParams, TwistParams};

/// Delays a signal by one tick, so that a loop is allowed.
///
/// A cycle of wires is an error, because no node of it could step first. A delay breaks the cycle: its output is its
/// input as it was one tick ago. A `delay` states its unit, because its input is not known yet when the graph is built;
/// a wire in another unit is an error.
///
/// What was new one tick ago is new now and keeps its stamp; what was held is held. While the input is absent the
/// output is `initial`, or absent if `initial` is not given. A loop that needs its own last value starts only with
/// `initial`, and starts with it again after each absence. An absent twist is zero motion. An `initial` that moves is
/// generated motion: it goes on without any contact.
///
/// The delay is one tick and not one sample: 4 ms in a graph of 250 Hz, whatever the rate of the input. A port of a
/// role cannot be delayed: its sample is present before any node steps.
///
/// ```toml
/// [nodes.delay]
/// type = "delay"
/// in.value = "moving_average.value"
/// unit = "N/tactel"
/// initial = 0.0                       # [N/tactel]
/// ```
///
/// ```toml
/// [nodes.twist_delay]
/// type = "twist_delay"
/// in.value = "sum.twist"
/// ```
#[derive(Describe)]
#[expect(clippy::duplicated_attributes, reason = "each attribute describes a node of its own")]
#[describe(name = "delay", of = "Delay<Scalar>", every_tick)]
#[describe(name = "twist_delay", of = "Delay<Twist>", every_tick)]
pub struct Delay<T> {
    initial: Option<T>,
}

/// What a delay reads.
#[derive(Inputs)]
pub struct Inputs<'a, T: Signal> {
    /// The signal to delay.
    #[port(unit = "U", frame = "A", quantity = "Q", optional, delayed)]
    value: Option<In<'a, T>>,
}

/// What a delay writes.
#[derive(Outputs)]
pub struct Outputs<T: Signal> {
    /// The input one tick ago.
    #[port(unit = "U", frame = "A", quantity = "Q")]
    value: Out<T>,
}

impl<T: Delayable> Node for Delay<T>
where
    Self: Describe,
{
    type Params = T::Params;
    type Inputs<'a> = Inputs<'a, T>;
    type Outputs = Outputs<T>;
    type State = State;

    fn new(params: T::Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let (shape, initial) = T::configure(params);
        setup.outputs.value = shape;
        setup.reading = Reading::Same;
        Ok(Self { initial })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_, T>, out: &mut Outputs<T>, state: &mut State) {
        let (input, initial) = (inputs.value, self.initial);
        let is_input = input.map(|_| true).or(initial.map(|_| false));
        let is_new = input.is_some_and(|value| value.is_new());
        state.pass(is_input, input.as_deref().or(initial.as_ref()), is_new, &mut out.value);
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Freshness, ScalarShape, Shape, Stamp, TwistShape, Unit};

    use super::*;

    fn along_x(speed: f64) -> Twist {
        Twist([speed, 0.0, 0.0, 0.0, 0.0, 0.0].into())
    }

    /// What happens at the input in a tick: a value, a loss (`Some(None)`), or nothing.
    type Event = Option<Option<f64>>;

    /// Freshness and value of each tick, without and with an initial value of 9.
    fn table<N: Node, T: Signal + PartialEq + std::fmt::Debug>(shape: &Shape, params: [&str; 2], make: fn(f64) -> T) {
        use Freshness::{Absent, Held, Lost, New};
        type Out = (Freshness, Option<f64>);
        let steps: [(&str, Event, Out, Out); 9] = [
            ("nothing yet", None, (Absent, None), (New, Some(9.0))),
            ("the first value arrives", Some(Some(1.0)), (Absent, None), (Held, Some(9.0))),
            ("the first value passes, the second arrives", Some(Some(2.0)), (New, Some(1.0)), (New, Some(1.0))),
            ("the second value passes", None, (New, Some(2.0)), (New, Some(2.0))),
            ("held; the input is lost", Some(None), (Held, Some(2.0)), (Held, Some(2.0))),
            ("lost one tick later", None, (Lost, None), (New, Some(9.0))),
            ("absent", None, (Absent, None), (Held, Some(9.0))),
            ("the third value arrives", Some(Some(3.0)), (Absent, None), (Held, Some(9.0))),
            ("the third value passes", None, (New, Some(3.0)), (New, Some(3.0))),
        ];
        for (i, params) in params.into_iter().enumerate() {
            let mut rig = NodeRig::new::<N>(params, &[("value", shape.clone())]).unwrap();
            // As in a graph: the node steps before its input is written.
            for (what, event, without, with) in &steps {
                rig.step();
                rig.tick.index -= 1;
                match event {
                    Some(Some(value)) => rig.set("value", make(*value)),
                    Some(None) => rig.lose("value"),
                    None => {}
                }
                rig.tick.index += 1;
                let (freshness, value) = if i == 0 { *without } else { *with };
                assert_eq!(
                    (rig.freshness("value"), rig.get::<T>("value").cloned()),
                    (freshness, value.map(make)),
                    "{what}, {params}"
                );
            }
        }
    }

    #[test]
    fn the_output_is_the_input_of_the_last_tick() {
        let shape = ScalarShape::of(Unit::NEWTON).into();
        table::<Delay<Scalar>, Scalar>(&shape, ["unit = 'N'", "unit = 'N'\ninitial = 9.0"], |value| value);
        let twist = ["", "initial = [9, 0, 0, 0, 0, 0]"];
        table::<Delay<Twist>, Twist>(&TwistShape.into(), twist, along_x);
    }

    #[test]
    fn a_delayed_value_keeps_its_stamp_and_the_initial_one_is_timeless() {
        let shape = ScalarShape::of(Unit::NEWTON);
        let mut rig =
            NodeRig::new::<Delay<Scalar>>("unit = 'N'\ninitial = 0.0", &[("value", shape.clone().into())]).unwrap();
        assert_eq!(rig.shape("value"), &shape.into());
        rig.step();
        assert!(rig.mark("value").stamp().is_timeless());
        rig.set("value", 1.0);
        rig.step_ms(5.0);
        rig.step();
        assert_eq!(
            (rig.get::<Scalar>("value"), rig.mark("value").stamp()),
            (Some(&1.0), Stamp { nanos: 1_000_000, device: 0 })
        );
    }
}
