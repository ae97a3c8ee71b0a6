//! `gate` and `twist_gate`: what comes in passes while a flag is set; otherwise there is nothing.
//!
//! Shut, or without a flag, the output is absent, and an absent twist is zero motion. What passes is new when it came in
//! new, and when the gate opens on something held: that keeps its stamp, so no time passes from one to the other.

use tactflow_runtime::node::{Mistakes, Node, Setup, Tick};
use tactflow_runtime::{inputs, outputs, params, state};

use crate::unwired;

macro_rules! gate {
    ($(#[$meta:meta])* $Name:ident in $module:ident: $name:literal, $port:ident: $Kind:ident[$($arg:literal),*],
     $summary:literal, $doc:literal, $example:literal) => {
        pub use $module::$Name;

        mod $module {
            use super::*;

            params! {}

            inputs! {
                /// What passes while the gate is open [any unit].
                $port: $Kind[$($arg),*],
                /// The gate is open while this is there and set.
                gate: Trigger<Flag>,
            }

            outputs! {
                /// The same while the gate is open; absent while it is shut [unit of what comes in].
                $port: $Kind[$($arg),*],
            }

            state! {
                /// Whether it was open in the last step.
                was_open: bool,
            }

            $(#[$meta])*
            pub struct $Name;

            impl Node for $Name {
                type Params = Params;
                type Inputs<'a> = Inputs<'a>;
                type Outputs = Outputs;
                type State = State;

                const NAME: &'static str = $name;
                const SUMMARY: &'static str = $summary;
                const DOC: &'static str = $doc;
                const EXAMPLE: &'static str = $example;

                fn new(_: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
                    match setup.inputs.gate {
                        Some(_) => Ok(Self),
                        // It may be absent, but a gate that can never open is a wire that was forgotten.
                        None => Err(unwired(Self::NAME, "gate", "a flag", "label.present").into()),
                    }
                }

                fn state(&self) -> State {
                    State { was_open: false }
                }

                fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
                    let is_open = inputs.gate.is_some_and(|gate| *gate);
                    let was_open = std::mem::replace(&mut state.was_open, is_open);
                    if is_open && (inputs.$port.is_new() || !was_open) {
                        out.$port.set(*inputs.$port);
                    } else if is_open {
                        out.$port.keep();
                    }
                }
            }
        }
    };
}

gate! {
    /// A gate for scalars; it has nothing to set.
    Gate in scalar: "gate", value: Scalar["U", "A"],
    "lets a scalar pass only while a flag is set",
    "`value` passes while `gate` is set. While it is not, or is absent, there is no value, as if the sensor had none: \
    what comes after resets, fades or waits as it does when a contact is lost.\n\n\
    While the gate is open, what passes counts as new only when it came in new, however often the flag comes. When the \
    gate opens on a value that is held, that passes at once, with the stamp it had: an integral takes nothing of it \
    twice, but a `smooth` or a `median` behind a gate that shuts and opens on one sample does. For a gate that does not \
    flicker wire `contact_debounce.present`.",
    r#"
[nodes.gate]
type = "gate"
in.value = "moments.force"
in.gate = "label.present"
"#
}

gate! {
    /// A gate for twists; it has nothing to set.
    TwistGate in twist: "twist_gate", twist: Twist["A"],
    "lets a motion pass only while a flag is set; otherwise there is none",
    "`twist` passes while `gate` is set. While it is not, or is absent, the twist is absent, which is zero motion: a \
    `twist_adder` leaves it out, and the limiters bring the arm to rest.\n\n\
    Generated motion does not end with the contact by itself; a gate on `label.present` ends it. `twist_source` has such \
    a gate built in. What passes is as old as the twist or the flag, whichever is older.",
    r#"
[nodes.twist_gate]
type = "twist_gate"
in.twist = "projector.twist"
in.gate = "label.present"
"#
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{
        FlagShape, Freshness, Scalar, ScalarShape, Shape, Signal, Stamp, Twist, TwistShape,
    };
    use tactflow_runtime::source::Code;

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
        table::<Gate, Scalar>("value", ScalarShape::default().into(), |value| value);
        table::<TwistGate, Twist>("twist", TwistShape.into(), along_x);
    }

    #[test]
    fn what_passes_keeps_its_age() {
        let wires = [("value", ScalarShape::default().into()), ("gate", FlagShape.into())];
        let mut rig = NodeRig::new::<Gate>("", &wires).unwrap();
        rig.set("value", 1.0);
        rig.step_ms(7.0);
        rig.set("gate", true);
        rig.step();
        assert_eq!(rig.mark("value").stamp(), Stamp { nanos: 0, device: 0 });
    }

    #[test]
    fn a_gate_that_nothing_opens_is_a_mistake() {
        let mistakes = NodeRig::new::<Gate>("", &[("value", ScalarShape::default().into())]).err().unwrap();
        assert_eq!(
            (mistakes[0].code, mistakes[0].message.as_str()),
            (Code::MissingInput, "`gate` needs `in.gate`, a flag")
        );
    }
}
