//! `delay` and `twist_delay`: what their input was one tick ago. With one of them in it, a loop is allowed.
//!
//! The input is read as the last tick left it, so the node steps before the one it reads from. What was new then is new
//! now, and what was held is held; the stamp is that of the sample. While there was nothing, `initial` comes instead.

use tactflow_runtime::node::{Mistakes, Node, Setup, Tick};
use tactflow_runtime::signal::{ScalarShape, Twist, Unit};
use tactflow_runtime::{inputs, outputs, params, state};

macro_rules! delay {
    ($(#[$meta:meta])* $Name:ident in $module:ident: $name:literal, $port:ident: $Kind:ident[$($arg:literal),*],
     params { $($params:tt)* }, $make:expr, $prepare:expr, $summary:literal, $doc:literal, $example:literal) => {
        pub use $module::$Name;

        mod $module {
            use super::*;

            params! { $($params)* }

            inputs! {
                /// What is delayed [any unit].
                $port: Delayed<$Kind[$($arg),*]>,
            }

            outputs! {
                /// What it was one tick ago [unit of what comes in].
                $port: $Kind[$($arg),*],
            }

            state! {
                /// What came out in the last step.
                shown: Shown,
            }

            $(#[$meta])*
            pub struct $Name {
                initial: Option<tactflow_runtime::signal::$Kind>,
            }

            impl tactflow_runtime::node::Describe for $Name {
                const NAME: &'static str = $name;
                const SUMMARY: &'static str = $summary;
                const DOC: &'static str = $doc;
                const EXAMPLE: &'static str = $example;
                const EVERY_TICK: bool = true;
            }

            impl Node for $Name {
                type Params = Params;
                type Inputs<'a> = Inputs<'a>;
                type Outputs = Outputs;
                type State = State;

                fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
                    let prepare: fn(&Params, &mut OutputShapes) = $prepare;
                    prepare(&params, &mut setup.outputs);
                    Ok(Self { initial: params.initial.map($make) })
                }

                fn state(&self) -> State {
                    State { shown: Shown::Nothing }
                }

                fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
                    let (next, value, is_new) = match (inputs.$port, self.initial) {
                        (Some(value), _) => (Shown::Input, *value, value.is_new()),
                        (None, Some(initial)) => (Shown::Initial, initial, false),
                        (None, None) => {
                            state.shown = Shown::Nothing;
                            return;
                        }
                    };
                    if is_new || state.shown != next {
                        out.$port.set(value);
                    } else {
                        out.$port.keep();
                    }
                    state.shown = next;
                }
            }
        }
    };
}

/// What a delay shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Shown {
    Nothing,
    Initial,
    Input,
}

delay! {
    /// What it gives while there is nothing.
    Delay in scalar: "delay", value: Scalar["U", "A"],
    params {
        /// Unit of what is delayed.
        unit: Unit,
        /// What it gives while there is nothing; without it, nothing [`unit`].
        initial: Option<f64>,
    },
    |initial| initial,
    |params, outputs| outputs.value = ScalarShape::of(params.unit),
    "what a scalar was one tick ago, so that a loop is allowed",
    "A wire that goes round in a circle does not load, as no node of it could step first. A delay breaks the circle: it \
    gives what its input was one tick ago. Its unit must be said, since the input is not known yet when the graph is \
    put together; a wire in another unit is a mistake.\n\n\
    What was new a tick ago is new now, with the stamp it had; what was held is held. While the input is absent the \
    output is `initial`, or absent if that is not given. A loop that needs its own last value never starts without \
    `initial`, and starts again with it after each absence.\n\n\
    It delays by a tick, not by a sample: in a graph of 250 Hz by 4 ms, whatever the rate of the input. A port of a role \
    cannot be delayed: its sample is there before any node steps.",
    r#"
[nodes.delay]
type = "delay"
in.value = "smooth.value"
unit = "N/tactel"
initial = 0.0                       # [N per tactel]
"#
}

delay! {
    /// What it gives while there is nothing.
    TwistDelay in twist: "twist_delay", twist: Twist["A"],
    params {
        /// What it gives while there is nothing, `[vx, vy, vz, wx, wy, wz]`; without it, nothing [m/s, rad/s].
        initial: Option<[f64; 6]>,
    },
    |initial| Twist(initial.into()),
    |_, _| {},
    "what a motion was one tick ago, so that a loop is allowed",
    "Gives the twist that was commanded one tick ago, for whatever looks back at it: a wire that goes round in a circle \
    does not load, unless it runs through a delay.\n\n\
    What was new a tick ago is new now, with the stamp it had; what was held is held. While the input is absent the \
    output is `initial`, or absent if that is not given, which is zero motion. An `initial` that moves is generated \
    motion: it goes on without any contact.",
    r#"
[nodes.twist_delay]
type = "twist_delay"
in.twist = "sum.twist"
"#
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Freshness, Scalar, Shape, Signal, Stamp, TwistShape};

    use super::*;

    fn along_x(speed: f64) -> Twist {
        Twist([speed, 0.0, 0.0, 0.0, 0.0, 0.0].into())
    }

    /// What comes in: `Some(None)` is a loss.
    type Comes = Option<Option<f64>>;

    /// Without and with an initial value of 9: freshness and value of each tick.
    fn table<N: Node, T: Signal + PartialEq + std::fmt::Debug>(
        port: &str,
        shape: &Shape,
        params: [&str; 2],
        make: fn(f64) -> T,
    ) {
        use Freshness::{Absent, Held, Lost, New};
        type Out = (Freshness, Option<f64>);
        let steps: [(&str, Comes, Out, Out); 9] = [
            ("nothing yet", None, (Absent, None), (New, Some(9.0))),
            ("comes", Some(Some(1.0)), (Absent, None), (Held, Some(9.0))),
            ("comes out, the next comes", Some(Some(2.0)), (New, Some(1.0)), (New, Some(1.0))),
            ("so does that", None, (New, Some(2.0)), (New, Some(2.0))),
            ("held, and goes", Some(None), (Held, Some(2.0)), (Held, Some(2.0))),
            ("lost a tick later", None, (Lost, None), (New, Some(9.0))),
            ("away", None, (Absent, None), (Held, Some(9.0))),
            ("comes back", Some(Some(3.0)), (Absent, None), (Held, Some(9.0))),
            ("comes out", None, (New, Some(3.0)), (New, Some(3.0))),
        ];
        for (i, params) in params.into_iter().enumerate() {
            let mut rig = NodeRig::new::<N>(params, &[(port, shape.clone())]).unwrap();
            // As in a graph: the node steps first, and what it reads from is written after it.
            for (what, comes, without, with) in &steps {
                rig.step();
                rig.tick.index -= 1;
                match comes {
                    Some(Some(value)) => rig.set(port, make(*value)),
                    Some(None) => rig.lose(port),
                    None => {}
                }
                rig.tick.index += 1;
                let (freshness, value) = if i == 0 { *without } else { *with };
                assert_eq!(
                    (rig.freshness(port), rig.get::<T>(port).cloned()),
                    (freshness, value.map(make)),
                    "{what}, {params}"
                );
            }
        }
    }

    #[test]
    fn what_comes_out_when() {
        let shape = ScalarShape::of(Unit::NEWTON).into();
        table::<Delay, Scalar>("value", &shape, ["unit = 'N'", "unit = 'N'\ninitial = 9.0"], |value| value);
        let twist = ["", "initial = [9, 0, 0, 0, 0, 0]"];
        table::<TwistDelay, Twist>("twist", &TwistShape.into(), twist, along_x);
    }

    #[test]
    fn what_is_delayed_is_as_old_as_its_sample_and_what_is_made_up_is_of_no_age() {
        let shape = ScalarShape::of(Unit::NEWTON);
        let mut rig = NodeRig::new::<Delay>("unit = 'N'\ninitial = 0.0", &[("value", shape.clone().into())]).unwrap();
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
