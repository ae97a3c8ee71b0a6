//! `switch` and `twist_switch`: one implementation for both kinds. The output is new when the selection changes.

use std::marker::PhantomData;

use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Setup, Tick};
use tactflow_runtime::signal::{Flag, Scalar, Signal, Twist};

use super::passing::State;

/// Selects one of two signals by a flag.
///
/// `on` passes while `select` is set, and `off` while it is not. Without `select`, or while the selected input is
/// absent, the output is absent: the other input never replaces it. An absent twist is zero motion. Both inputs have
/// the same unit and the same frame.
///
/// The output is new when the selected input is new, and when the selection changes. It is as old as the oldest of the
/// three inputs: when the device behind the unselected input falls silent, the output becomes old too.
///
/// The value jumps when the selection changes: a derivative behind the switch sees the jump, and the limiters of the
/// arm smooth it. A flag that flickers makes the output flicker: wire `contact_debounce.present`.
///
/// ```toml
/// [nodes.switch]                      # the mean while there is a contact, the newest sample otherwise
/// type = "switch"
/// in.on = "moving_average.value"
/// in.off = "moments.pressure"
/// in.select = "label.present"
/// ```
///
/// ```toml
/// [nodes.twist_switch]                # servo on a contact, search without one
/// type = "twist_switch"
/// in.on = "projector.twist"
/// in.off = "compose_twist.twist"
/// in.select = "label.present"
/// ```
#[derive(Describe)]
#[describe(name = "switch", of = "Switch<Scalar>")]
#[describe(name = "twist_switch", of = "Switch<Twist>")]
pub struct Switch<T>(PhantomData<T>);

/// What a switch reads.
#[derive(Inputs)]
pub struct Inputs<'a, T: Signal> {
    /// Passes while `select` is set.
    #[port(unit = "U", frame = "A", quantity = "Q")]
    on: Option<In<'a, T>>,
    /// Passes while `select` is not set.
    #[port(unit = "U", frame = "A", quantity = "Q")]
    off: Option<In<'a, T>>,
    /// Selects `on` while it is set, and `off` while it is not.
    select: Option<In<'a, Flag>>,
}

/// What a switch writes.
#[derive(Outputs)]
pub struct Outputs<T: Signal> {
    /// The selected input; absent while that input or `select` is absent.
    #[port(unit = "U", frame = "A", quantity = "Q")]
    value: Out<T>,
}

impl<T: Signal> Node for Switch<T>
where
    Self: Describe,
{
    type Params = ();
    type Inputs<'a> = Inputs<'a, T>;
    type Outputs = Outputs<T>;
    type State = State;

    fn new((): (), _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self(PhantomData))
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_, T>, out: &mut Outputs<T>, state: &mut State) {
        let select = inputs.select.map(|select| *select);
        let selected = select.and_then(|is_on| if is_on { inputs.on } else { inputs.off });
        let is_new = selected.as_ref().is_some_and(In::is_new);
        state.pass(select.filter(|_| selected.is_some()), selected.as_deref(), is_new, &mut out.value);
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{FlagShape, Freshness, Scalar, ScalarShape, Shape, Signal, Twist, TwistShape, Unit};

    use super::*;

    fn along_x(speed: f64) -> Twist {
        Twist([speed, 0.0, 0.0, 0.0, 0.0, 0.0].into())
    }

    /// What happens at an input in a tick: a value, a loss (`Some(None)`), or nothing.
    type Event<T> = Option<Option<T>>;

    fn apply<T: Signal>(rig: &mut NodeRig, wire: &str, event: Event<T>) {
        match event {
            Some(Some(value)) => rig.set(wire, value),
            Some(None) => rig.lose(wire),
            None => {}
        }
    }

    /// Events at `on`, `off` and `select`, then freshness and value of the output.
    type Step = (&'static str, Event<f64>, Event<f64>, Event<bool>, (Freshness, Option<f64>));

    fn table<N: Node, T: Signal + PartialEq + std::fmt::Debug>(shape: &Shape, make: fn(f64) -> T) {
        const LOST: Event<f64> = Some(None);
        let new = |value: f64| Some(Some(value));
        let flag = |flag: bool| Some(Some(flag));
        let steps: [Step; 14] = [
            ("no selection yet", new(1.0), new(-1.0), None, (Freshness::Absent, None)),
            ("`on`, which is held", None, None, flag(true), (Freshness::New, Some(1.0))),
            ("no event", None, None, None, (Freshness::Held, Some(1.0))),
            ("the same selection once more", None, None, flag(true), (Freshness::Held, Some(1.0))),
            ("only `off` is new", None, new(-2.0), None, (Freshness::Held, Some(1.0))),
            ("`on` is new", new(2.0), None, None, (Freshness::New, Some(2.0))),
            ("`off`, which is held", None, None, flag(false), (Freshness::New, Some(-2.0))),
            ("only `on` is lost", LOST, None, None, (Freshness::Held, Some(-2.0))),
            ("`on`, which is absent", None, None, flag(true), (Freshness::Lost, None)),
            ("`on` is present", new(3.0), None, None, (Freshness::New, Some(3.0))),
            ("the selection is lost", None, None, Some(None), (Freshness::Lost, None)),
            ("and is present again", None, None, flag(true), (Freshness::New, Some(3.0))),
            ("`on` is lost", LOST, None, None, (Freshness::Lost, None)),
            ("`off`", None, new(-4.0), flag(false), (Freshness::New, Some(-4.0))),
        ];
        let wires = [("on", shape.clone()), ("off", shape.clone()), ("select", FlagShape.into())];
        let mut rig = NodeRig::new::<N>("", &wires).unwrap();
        for (what, on, off, select, (freshness, expected)) in steps {
            apply(&mut rig, "on", on.map(|on| on.map(make)));
            apply(&mut rig, "off", off.map(|off| off.map(make)));
            apply(&mut rig, "select", select);
            rig.step();
            assert_eq!(
                (rig.freshness("value"), rig.get::<T>("value").cloned()),
                (freshness, expected.map(make)),
                "{what}"
            );
        }
    }

    #[test]
    fn the_selected_input_passes() {
        table::<Switch<Scalar>, Scalar>(&ScalarShape::of(Unit::NEWTON).into(), |value| value);
        table::<Switch<Twist>, Twist>(&TwistShape.into(), along_x);
    }
}
