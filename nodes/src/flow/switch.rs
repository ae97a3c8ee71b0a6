//! `switch` and `twist_switch`: one of two inputs, as a flag says.
//!
//! While `select` is set it is `on`, while it is not it is `off`, and without it there is nothing. If the one that is
//! selected is absent, so is the output: the other does not stand in for it.

use tactflow_runtime::node::{Mistakes, Node, Setup, Tick};
use tactflow_runtime::{inputs, outputs, params, state};

use crate::unwired;

macro_rules! switch {
    ($(#[$meta:meta])* $Name:ident in $module:ident: $name:literal, $port:ident: $Kind:ident[$($arg:literal),*],
     $article:literal, $summary:literal, $doc:literal, $example:literal) => {
        pub use $module::$Name;

        mod $module {
            use super::*;

            params! {}

            inputs! {
                /// What passes while `select` is set [any unit].
                on: Trigger<$Kind[$($arg),*]>,
                /// What passes while `select` is not set [unit of `on`].
                off: Trigger<$Kind[$($arg),*]>,
                /// Which of the two passes.
                select: Trigger<Flag>,
            }

            outputs! {
                /// The one that is selected; absent while that one or `select` is absent [unit of `on`].
                $port: $Kind[$($arg),*],
            }

            state! {
                /// Which of the two came out in the last step, if any did.
                shown: Option<bool>,
            }

            $(#[$meta])*
            pub struct $Name;

            impl tactflow_runtime::node::Describe for $Name {
                const NAME: &'static str = $name;
                const SUMMARY: &'static str = $summary;
                const DOC: &'static str = $doc;
                const EXAMPLE: &'static str = $example;
            }

            impl Node for $Name {
                type Params = Params;
                type Inputs<'a> = Inputs<'a>;
                type Outputs = Outputs;
                type State = State;

                fn new(_: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
                    let inputs = &setup.inputs;
                    let wired = [
                        ("on", $article, inputs.on.is_some()),
                        ("off", $article, inputs.off.is_some()),
                        ("select", "a flag", inputs.select.is_some()),
                    ];
                    let missing = wired.into_iter().filter(|(.., is_wired)| !is_wired);
                    let mistakes: Mistakes =
                        missing.map(|(input, kind, _)| unwired(<Self as tactflow_runtime::node::Describe>::NAME, input, kind, "node.port")).collect();
                    if mistakes.is_empty() { Ok(Self) } else { Err(mistakes) }
                }

                fn state(&self) -> State {
                    State { shown: None }
                }

                fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
                    let select = inputs.select.map(|select| *select);
                    let chosen = select.and_then(|is_on| if is_on { inputs.on } else { inputs.off });
                    let shown = std::mem::replace(&mut state.shown, select.filter(|_| chosen.is_some()));
                    match chosen {
                        Some(chosen) if chosen.is_new() || shown != select => out.$port.set(*chosen),
                        Some(_) => out.$port.keep(),
                        None => {}
                    }
                }
            }
        }
    };
}

switch! {
    /// A switch between two scalars; it has nothing to set.
    Switch in scalar: "switch", value: Scalar["U", "A"], "a scalar",
    "chooses between two scalars by a flag",
    "`on` passes while `select` is set, `off` while it is not. Without `select`, or if the chosen one is absent, there is \
    nothing: the other never stands in for it. Both have one unit.\n\n\
    The output is new when the chosen one is, and when the choice changes. It is as old as the oldest of the three, the \
    one that is not chosen too: if that comes from a device that falls silent, the output grows old.\n\n\
    The value jumps at a change. Behind it, a derivative sees that jump.",
    r#"
[nodes.switch]                      # the newest sample until the contact is sure, the mean from then on
type = "switch"
in.on = "smooth.value"
in.off = "moments.pressure"
in.select = "label.present"
"#
}

switch! {
    /// A switch between two twists; it has nothing to set.
    TwistSwitch in twist: "twist_switch", twist: Twist["A"], "a twist",
    "chooses between two motions by a flag",
    "`on` passes while `select` is set, `off` while it is not. Without `select`, or if the chosen one is absent, the \
    output is absent, which is zero motion: the other never stands in for it. Both are in one frame.\n\n\
    The output is as old as the oldest of the three, the one that is not chosen too. The motion jumps at a change; the \
    limits of the arm hold all the same. A flag that flickers makes the motion flicker: take `contact_debounce.present`.",
    r#"
[nodes.twist_switch]                # servo on a contact, search without one
type = "twist_switch"
in.on = "projector.twist"
in.off = "twist_of.twist"
in.select = "label.present"
"#
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{FlagShape, Freshness, Scalar, ScalarShape, Shape, Signal, Twist, TwistShape, Unit};

    use super::*;

    fn along_x(speed: f64) -> Twist {
        Twist([speed, 0.0, 0.0, 0.0, 0.0, 0.0].into())
    }

    /// What comes in on a wire in a tick: `Some(None)` is a loss.
    type Comes<T> = Option<Option<T>>;

    fn bring<T: Signal>(rig: &mut NodeRig, wire: &str, comes: Comes<T>) {
        match comes {
            Some(Some(value)) => rig.set(wire, value),
            Some(None) => rig.lose(wire),
            None => {}
        }
    }

    /// What comes in on `on`, `off` and `select`, and freshness and value of what comes out.
    type Step = (&'static str, Comes<f64>, Comes<f64>, Comes<bool>, (Freshness, Option<f64>));

    fn table<N: Node, T: Signal + PartialEq + std::fmt::Debug>(port: &str, shape: &Shape, make: fn(f64) -> T) {
        const GONE: Option<Option<f64>> = Some(None);
        let new = |value: f64| Some(Some(value));
        let say = |flag: bool| Some(Some(flag));
        let steps: [Step; 14] = [
            ("no choice yet", new(1.0), new(-1.0), None, (Freshness::Absent, None)),
            ("on, which is held", None, None, say(true), (Freshness::New, Some(1.0))),
            ("nothing happens", None, None, None, (Freshness::Held, Some(1.0))),
            ("the same choice once more", None, None, say(true), (Freshness::Held, Some(1.0))),
            ("only the other is new", None, new(-2.0), None, (Freshness::Held, Some(1.0))),
            ("on is new", new(2.0), None, None, (Freshness::New, Some(2.0))),
            ("off, which is held", None, None, say(false), (Freshness::New, Some(-2.0))),
            ("only the other goes", GONE, None, None, (Freshness::Held, Some(-2.0))),
            ("on, which is not there", None, None, say(true), (Freshness::Lost, None)),
            ("on comes", new(3.0), None, None, (Freshness::New, Some(3.0))),
            ("the choice goes", None, None, Some(None), (Freshness::Lost, None)),
            ("and comes back", None, None, say(true), (Freshness::New, Some(3.0))),
            ("on goes", GONE, None, None, (Freshness::Lost, None)),
            ("off stands in only when it is chosen", None, new(-4.0), say(false), (Freshness::New, Some(-4.0))),
        ];
        let wires = [("on", shape.clone()), ("off", shape.clone()), ("select", FlagShape.into())];
        let mut rig = NodeRig::new::<N>("", &wires).unwrap();
        for (what, on, off, select, (freshness, expected)) in steps {
            bring(&mut rig, "on", on.map(|on| on.map(make)));
            bring(&mut rig, "off", off.map(|off| off.map(make)));
            bring(&mut rig, "select", select);
            rig.step();
            assert_eq!((rig.freshness(port), rig.get::<T>(port).cloned()), (freshness, expected.map(make)), "{what}");
        }
    }

    #[test]
    fn what_comes_out_when() {
        table::<Switch, Scalar>("value", &ScalarShape::of(Unit::NEWTON).into(), |value| value);
        table::<TwistSwitch, Twist>("twist", &TwistShape.into(), along_x);
    }

    #[test]
    fn what_is_not_wired_shows_at_once() {
        let mistakes = NodeRig::new::<TwistSwitch>("", &[("on", TwistShape.into())]).err().unwrap();
        let messages: Vec<&str> = mistakes.iter().map(|mistake| mistake.message.as_str()).collect();
        assert_eq!(messages, ["`twist_switch` needs `in.off`, a twist", "`twist_switch` needs `in.select`, a flag"]);
    }
}
