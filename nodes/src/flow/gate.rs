//! `gate` and `twist_gate`: one implementation for both kinds.
//!
//! The output is new when the input is new, and when the gate opens on a held value. A held value keeps its stamp, so
//! no time passes from one to the other.

use std::marker::PhantomData;

use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Setup, Tick};
use tactflow_runtime::signal::{Flag, Scalar, Signal, Twist};

use super::passing::State;

/// Lets a signal pass only while a flag is set.
///
/// `value` passes while `gate` is set. While the gate is not set or is absent, the output is absent, as if the sensor
/// had no value: the nodes behind it reset, fade or wait as they do when a contact is lost. An absent twist is zero
/// motion: a `twist_adder` leaves it out, and the limiters bring the arm to rest.
///
/// While the gate is open, the output is new only when `value` is new, even if the flag is new more often. When the
/// gate opens on a held value, that value passes at once and keeps its stamp: an integral does not take it twice, but a
/// `moving_average` or a `median` behind a gate that shuts and opens on one sample does. For a gate that does not
/// flicker wire `contact_debounce.present`.
///
/// Generated motion does not end with the contact by itself; a `twist_gate` on `label.present` ends it. `twist_source`
/// has such a gate built in. The output is as old as the value or the flag, whichever is older.
///
/// ```toml
/// [nodes.gate]
/// type = "gate"
/// in.value = "moments.force"
/// in.gate = "label.present"
/// ```
///
/// ```toml
/// [nodes.twist_gate]
/// type = "twist_gate"
/// in.value = "projector.twist"
/// in.gate = "label.present"
/// ```
#[derive(Describe)]
#[describe(name = "gate", of = "Gate<Scalar>")]
#[describe(name = "twist_gate", of = "Gate<Twist>")]
pub struct Gate<T>(PhantomData<T>);

/// What a gate reads.
#[derive(Inputs)]
pub struct Inputs<'a, T: Signal> {
    /// Passes while the gate is open.
    #[port(unit = "U", frame = "A", quantity = "Q")]
    value: In<'a, T>,
    /// The gate is open while this is present and set.
    gate: Option<In<'a, Flag>>,
}

/// What a gate writes.
#[derive(Outputs)]
pub struct Outputs<T: Signal> {
    /// The same value while the gate is open; absent while it is shut.
    #[port(unit = "U", frame = "A", quantity = "Q")]
    value: Out<T>,
}

impl<T: Signal> Node for Gate<T>
where
    Self: Describe,
{
    type Params = ();
    type Inputs<'a> = Inputs<'a, T>;
    type Outputs = Outputs<T>;
    type State = State;

    fn new((): (), setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.outputs.value = setup.inputs.value.clone();
        Ok(Self(PhantomData))
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_, T>, out: &mut Outputs<T>, state: &mut State) {
        let is_open = inputs.gate.is_some_and(|gate| *gate);
        let value = is_open.then_some(&*inputs.value);
        state.pass(is_open.then_some(true), value, inputs.value.is_new(), &mut out.value);
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{
        FlagShape, Freshness, Scalar, ScalarShape, Shape, Signal, Stamp, Twist, TwistShape,
    };

    use super::*;

    fn along_x(speed: f64) -> Twist {
        Twist([speed, 0.0, 0.0, 0.0, 0.0, 0.0].into())
    }

    /// What comes in on a wire in a tick.
    #[derive(Debug, Clone, Copy)]
    enum Comes<T> {
        New(T),
        Nothing,
        Lost,
    }
    use Comes::{Lost, New, Nothing};

    fn bring<T: Signal>(rig: &mut NodeRig, wire: &str, comes: Comes<T>) {
        match comes {
            New(value) => rig.set(wire, value),
            Nothing => {}
            Lost => rig.lose(wire),
        }
    }

    /// Freshness and value of the output.
    type Out = (Freshness, Option<f64>);

    fn table<N: Node, T: Signal + PartialEq + std::fmt::Debug>(port: &str, shape: Shape, make: fn(f64) -> T) {
        let steps: [(&str, Comes<f64>, Comes<bool>, Out); 15] = [
            ("nothing yet", Nothing, Nothing, (Freshness::Absent, None)),
            ("no flag", New(1.0), Nothing, (Freshness::Absent, None)),
            ("shut", New(2.0), New(false), (Freshness::Absent, None)),
            ("it opens on what is held", Nothing, New(true), (Freshness::New, Some(2.0))),
            ("held", Nothing, Nothing, (Freshness::Held, Some(2.0))),
            ("held, though the flag is new", Nothing, New(true), (Freshness::Held, Some(2.0))),
            ("new, though the flag is held", New(3.0), Nothing, (Freshness::New, Some(3.0))),
            ("it shuts", Nothing, New(false), (Freshness::Lost, None)),
            ("shut still", New(4.0), Nothing, (Freshness::Absent, None)),
            ("it opens", New(5.0), New(true), (Freshness::New, Some(5.0))),
            ("the flag goes", Nothing, Lost, (Freshness::Lost, None)),
            ("and comes back", Nothing, New(true), (Freshness::New, Some(5.0))),
            ("the value goes", Lost, New(true), (Freshness::Lost, None)),
            ("away", Nothing, New(true), (Freshness::Absent, None)),
            ("and comes back", New(6.0), Nothing, (Freshness::New, Some(6.0))),
        ];
        let mut rig = NodeRig::new::<N>("", &[(port, shape), ("gate", FlagShape.into())]).unwrap();
        for (what, value, gate, (freshness, expected)) in steps {
            bring(&mut rig, "gate", gate);
            let value = match value {
                New(value) => New(make(value)),
                Nothing => Nothing,
                Lost => Lost,
            };
            bring(&mut rig, port, value);
            rig.step();
            assert_eq!((rig.freshness(port), rig.get::<T>(port).cloned()), (freshness, expected.map(make)), "{what}");
        }
    }

    #[test]
    fn what_comes_out_when() {
        table::<Gate<Scalar>, Scalar>("value", ScalarShape::default().into(), |value| value);
        table::<Gate<Twist>, Twist>("value", TwistShape.into(), along_x);
    }

    #[test]
    fn what_passes_keeps_its_age() {
        let wires = [("value", ScalarShape::default().into()), ("gate", FlagShape.into())];
        let mut rig = NodeRig::new::<Gate<Scalar>>("", &wires).unwrap();
        rig.set("value", 1.0);
        rig.step_ms(7.0);
        rig.set("gate", true);
        rig.step();
        assert_eq!(rig.mark("value").stamp(), Stamp { nanos: 0, device: 0 });
    }
}
