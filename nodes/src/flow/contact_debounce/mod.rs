//! `contact_debounce`: the state of a contact, from the newest flags. A held flag is not a sample.

mod phase;

use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::{Flag, Scalar};

pub use phase::{ContactPhase, phase};

/// Removes flicker from a contact: the contact begins once it has lasted for some samples.
///
/// The node looks at the newest `samples` flags. `present` is set once all of them have a contact, and cleared once
/// none has one: a contact of a few frames does not count, and a gap of a few frames changes nothing. This delays the
/// contact by `samples - 1` frames, 16 ms with five samples at 250 Hz.
///
/// `state` has more detail, as in the authors' later code: 0 none, 1 initial (contact in the newer half), 2 stable (in
/// all), 3 leaving (in the older half), 4 uncertain (anything else). With five samples the newer half is the newest
/// three, and the older half is the oldest three.
///
/// Use it where flicker must not act: for the end of an approach, a gate of guidance, a switch of tasks. Each new flag
/// counts once; a held flag does not count again. While the flag is absent the outputs are absent, and after the
/// graph's `reset_after_ms` the node starts again without a contact.
///
/// ```toml
/// [nodes.contact_debounce]
/// type = "contact_debounce"
/// in.present = "label.present"
/// samples = 5                         # 20 ms at 250 Hz
/// ```
#[derive(Describe)]
pub struct ContactDebounce {
    /// Number of samples, from 1 to 64.
    samples: u32,
}

/// Parameters of `contact_debounce`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Number of samples that must agree.
    #[param(unit = "1", range = 1..=64, default = 5)]
    samples: u64,
}

/// What `contact_debounce` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Whether there is a contact in the newest sample.
    #[port(quantity = "contact")]
    present: In<'a, Flag>,
}

/// What `contact_debounce` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Whether there is a contact: from `stable` until `none`.
    #[port(quantity = "contact")]
    present: Out<Flag>,
    /// The state: 0 none, 1 initial, 2 stable, 3 leaving, 4 uncertain.
    #[port(unit = "1", frame = "_")]
    state: Out<Scalar>,
    /// Whether every sample has a contact.
    stable: Out<Flag>,
    /// Whether the samples are neither all equal nor a contact that begins or ends.
    uncertain: Out<Flag>,
}

/// What `contact_debounce` remembers.
#[derive(State)]
pub struct State {
    /// The newest samples, the newest in the lowest bit.
    history: u64,
    /// Whether there is a contact.
    is_present: bool,
}

impl Node for ContactDebounce {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self { samples: params.samples as u32 })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        state.history = state.history << 1 | u64::from(*inputs.present);
        let phase = phase(state.history, self.samples);
        state.is_present = match phase {
            ContactPhase::Stable => true,
            ContactPhase::None => false,
            _ => state.is_present,
        };
        out.present.set(state.is_present);
        out.state.set(f64::from(phase as u8));
        out.stable.set(phase == ContactPhase::Stable);
        out.uncertain.set(phase == ContactPhase::Uncertain);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Flag, FlagShape, Freshness, Scalar, ScalarShape, Unit};

    use super::*;

    fn rig(params: &str) -> Result<NodeRig, Mistakes> {
        NodeRig::new::<ContactDebounce>(params, &[("present", FlagShape.into())])
    }

    /// Sets each flag as a new sample. Returns `present`, `state`, `stable` and `uncertain` after the last one.
    fn feed(rig: &mut NodeRig, flags: &str) -> (bool, f64, bool, bool) {
        for flag in flags.chars() {
            rig.set("present", flag == '1');
            rig.step();
        }
        let flag = |name: &str| *rig.get::<Flag>(name).unwrap();
        (flag("present"), *rig.get::<Scalar>("state").unwrap(), flag("stable"), flag("uncertain"))
    }

    /// The authors' rules on five samples, oldest first, in their order.
    fn authors(flags: [bool; 5]) -> u8 {
        match flags {
            [true, true, true, true, true] => 2,
            [true, true, true, false, false] => 3,
            [false, false, false, false, false] => 0,
            [false, false, true, true, true] => 1,
            _ => 4,
        }
    }

    #[test]
    fn all_32_histories_of_five_samples_match_the_authors_rules() {
        for history in 0..32_u64 {
            let flags: [bool; 5] = std::array::from_fn(|i| history >> (4 - i) & 1 == 1);
            assert_eq!(phase(history, 5) as u8, authors(flags), "{history:05b}");
            // Older samples do not matter.
            assert_eq!(phase(history | 0b1011 << 5, 5) as u8, authors(flags), "{history:05b}");
        }
    }

    #[test]
    fn a_contact_that_flickers_begins_and_ends_once() {
        let mut rig = rig("").unwrap();
        let steps = [
            ("0", (false, 0.0, false, false)),
            ("01", (false, 4.0, false, true)),
            ("11", (false, 1.0, false, false)),
            ("1", (false, 4.0, false, true)),
            ("1", (true, 2.0, true, false)),
            ("0", (true, 4.0, false, true)),
            ("1111", (true, 4.0, false, true)),
            ("1", (true, 2.0, true, false)),
            ("00", (true, 3.0, false, false)),
            ("00", (true, 4.0, false, true)),
            ("0", (false, 0.0, false, false)),
            ("1111", (false, 4.0, false, true)),
        ];
        for (i, (flags, expected)) in steps.into_iter().enumerate() {
            assert_eq!(feed(&mut rig, flags), expected, "step {i}: {flags}");
        }
    }

    #[test]
    fn a_held_flag_is_not_a_sample() {
        let mut rig = rig("").unwrap();
        assert_eq!(feed(&mut rig, "1111"), (false, 4.0, false, true));
        for _ in 0..9 {
            rig.step();
            assert_eq!((rig.freshness("present"), rig.get::<Flag>("stable")), (Freshness::Held, Some(&false)));
        }
        assert_eq!(feed(&mut rig, "1"), (true, 2.0, true, false));
    }

    #[test]
    fn only_a_long_absence_resets() {
        let mut rig = rig("").unwrap();
        for (ms, expected) in [(10.0, (true, 2.0, true, false)), (25.0, (false, 4.0, false, true))] {
            assert_eq!(feed(&mut rig, "11111"), (true, 2.0, true, false));
            rig.lose("present");
            rig.step_ms(ms);
            assert_eq!(rig.get::<Flag>("present"), None);
            assert_eq!(feed(&mut rig, "1"), expected, "{ms} ms");
        }
    }

    proptest! {
        #[test]
        fn present_follows_the_last_run_that_was_long_enough(
            flags in prop::collection::vec(any::<bool>(), 1..200), samples in 1..=8_usize,
        ) {
            let mut rig = rig(&format!("samples = {samples}")).unwrap();
            let (mut run, mut expected) = ((false, samples), false);
            for flag in flags {
                run = if run.0 == flag { (flag, run.1 + 1) } else { (flag, 1) };
                expected = if run.1 >= samples { flag } else { expected };
                prop_assert_eq!(feed(&mut rig, if flag { "1" } else { "0" }).0, expected);
            }
        }
    }

    #[test]
    fn samples_are_from_1_to_64() {
        for (samples, is_good) in [("1", true), ("64", true), ("65", false), ("0", false), ("5000000000", false)] {
            assert_eq!(rig(&format!("samples = {samples}")).is_ok(), is_good, "{samples}");
        }
        assert_eq!(rig("").unwrap().shape("state"), &ScalarShape::of(Unit::ONE).into());
    }
}
