//! `compare`: a flag from a scalar and its bounds.

use tactflow_runtime::node::{
    At, Describe, In, Inputs, Mistake, Mistakes, Node, Out, Outputs, Param, Reading, Setup, State, Tick,
};
use tactflow_runtime::signal::{Flag, Scalar};
use tactflow_runtime::source::Code;

/// Compares a signal with bounds, as a condition of a mode does.
///
/// With `above` the flag is set while the value is greater, with `below` while it is less, and with both while it is
/// between them. With `hysteresis`, a flag that is set is cleared only once the value is that far beyond the bound. So
/// noise at a bound does not make it flicker.
///
/// A new value makes a new flag, which is as old as the value. While the value is absent, the flag is absent, and after
/// the graph's `reset_after_ms` the hysteresis starts afresh.
///
/// The flag is not known to be a contact, so it does not end a generated motion. For that, use `label.present` or
/// `contact_debounce.present`.
///
/// ```toml
/// [nodes.firm]                        # pressed with more than 2 N, until it is less than 1.5 N
/// type = "compare"
/// in.value = "moments.force"
/// above = 2.0                         # [N]
/// hysteresis = 0.5                    # [N]
/// ```
#[derive(Describe)]
pub struct Compare {
    above: f64,
    below: f64,
    hysteresis: f64,
}

/// Parameters of `compare`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// The value must be greater; any if not given.
    #[param(unit = "U", live)]
    above: Option<f64>,
    /// The value must be less; any if not given.
    #[param(unit = "U", live)]
    below: Option<f64>,
    /// How far beyond a bound the value must be to clear the flag.
    #[param(unit = "U", range = 0.0.., default = 0.0, live)]
    hysteresis: f64,
}

/// What `compare` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The signal.
    #[port(unit = "U", frame = "_")]
    value: In<'a, Scalar>,
}

/// What `compare` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Whether the value is within the bounds.
    is_met: Out<Flag>,
}

/// What `compare` remembers.
#[derive(State)]
pub struct State {
    /// Whether the flag is set.
    is_met: bool,
}

impl Node for Compare {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(Params { above, below, hysteresis }: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        if above.is_none() && below.is_none() {
            let mistake = Mistake::new(Code::MissingKey, At::Node, "`compare` has no bound");
            return Err(mistake.help("write `above`, `below` or both").into());
        }
        let (above, below) = (above.unwrap_or(f64::NEG_INFINITY), below.unwrap_or(f64::INFINITY));
        if above >= below {
            let message = format!("no value is above {above} and below {below}");
            return Err(Mistake::param("below", message).help("make `below` greater than `above`").into());
        }
        setup.reading = Reading::Between { min: above, max: below, hysteresis };
        Ok(Self { above, below, hysteresis })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let room = if state.is_met { self.hysteresis } else { 0.0 };
        state.is_met = *inputs.value > self.above - room && *inputs.value < self.below + room;
        out.is_met.set(state.is_met);
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Freshness, ScalarShape, Unit};

    use super::*;

    fn rig(params: &str) -> Result<NodeRig, Mistakes> {
        NodeRig::new::<Compare>(params, &[("value", ScalarShape::of(Unit::NEWTON).into())])
    }

    fn course(params: &str, values: &[f64]) -> String {
        let mut rig = rig(params).unwrap();
        let mut flag = |value: &f64| {
            rig.set("value", *value);
            rig.step();
            if *rig.get::<Flag>("is_met").unwrap() { '1' } else { '0' }
        };
        values.iter().map(&mut flag).collect()
    }

    #[test]
    fn bounds_are_open_and_hysteresis_holds_the_flag() {
        let values = [0.0, 1.0, 1.1, 0.9, 0.5, 0.4, 1.0, 2.0, 2.9, 3.0, 3.4, 3.5, 3.0, 2.0];
        assert_eq!(course("above = 1.0", &values), "00100001111111");
        assert_eq!(course("above = 1.0\nhysteresis = 0.5", &values), "00110001111111");
        assert_eq!(course("below = 3.0", &values), "11111111100001");
        assert_eq!(course("above = 1.0\nbelow = 3.0\nhysteresis = 0.5", &values), "00110001111001");
    }

    #[test]
    fn without_a_value_there_is_no_flag_and_it_starts_afresh() {
        let mut rig = rig("above = 1.0\nhysteresis = 0.5").unwrap();
        rig.set("value", 2.0);
        rig.step();
        rig.lose("value");
        rig.step();
        assert_eq!((rig.get::<Flag>("is_met"), rig.freshness("is_met")), (None, Freshness::Lost));
        (0..40).for_each(|_| rig.step());
        rig.set("value", 0.8);
        rig.step();
        assert_eq!(rig.get::<Flag>("is_met"), Some(&false));
    }

    #[test]
    fn what_cannot_be() {
        for (params, at) in [("", At::Node), ("above = 2.0\nbelow = 1.0", At::Param("below".into()))] {
            let mistakes = rig(params).err().unwrap();
            assert_eq!((mistakes.len(), &mistakes[0].at), (1, &at), "{params}");
        }
    }
}
