//! `contact_debounce`: a contact counts once it has lasted for some samples, and is over once it has been away for some.
//!
//! The state follows from the newest `samples` flags, oldest first; with five of them this is the debouncer of the
//! authors' later code:
//!
//! | flags | state | code |
//! |---|---|---|
//! | 00000 | none | 0 |
//! | 00111 | initial | 1 |
//! | 11111 | stable | 2 |
//! | 11100 | leaving | 3 |
//! | any other | uncertain | 4 |
//!
//! Before there are as many samples, those that are missing count as no contact. A held flag is no sample.

use tactflow_runtime::node::{Count, Mistake, Mistakes, Node, Setup, Tick};
use tactflow_runtime::{inputs, outputs, params, state};

params! {
    /// How many of the newest samples are looked at, 64 at most [1].
    samples: Count = Count(5),
}

inputs! {
    /// Whether there is a contact in the newest sample.
    present: Flag,
}

outputs! {
    /// Whether there is a contact: from `stable` on, until `none`.
    present: Flag,
    /// The state: 0 none, 1 initial, 2 stable, 3 leaving, 4 uncertain [1].
    state: Scalar["1"],
    /// Whether every sample has a contact.
    stable: Flag,
    /// Whether the samples are neither all alike nor a contact that begins or ends.
    uncertain: Flag,
}

state! {
    /// The newest samples, the newest in the lowest bit.
    history: u64,
    /// Whether there is a contact.
    is_present: bool,
}

/// What the newest samples say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// No contact in any.
    None,
    /// Contact in the newer ones only.
    Initial,
    /// Contact in all.
    Stable,
    /// Contact in the older ones only.
    Leaving,
    /// Anything else.
    Uncertain,
}

/// How many samples are looked at.
pub struct ContactDebounce {
    samples: u32,
}

impl tactflow_runtime::node::Describe for ContactDebounce {
    const NAME: &'static str = "contact_debounce";
    const SUMMARY: &'static str =
        "makes a contact that does not flicker: it counts once it has lasted for some samples";
    const DOC: &'static str = "Looks at the newest `samples` flags, five unless given. `present` is set once all \
        of them have a contact and cleared once none has, so a contact of a few frames never counts and a gap of a \
        few frames changes nothing. The price is a delay of `samples - 1` frames, 16 ms at 250 Hz.\n\n\
        `state` says more, as in the authors' later code: 0 none, 1 initial (the newer half), 2 stable (all), 3 \
        leaving (the older half), 4 uncertain (anything else). With five samples the newer half is the newest \
        three, and the older half is the oldest three.\n\n\
        Use it for what must not react to flicker: the end of an approach, a gate of guidance, a switch of tasks. \
        Each new flag counts once; one that is held does not count again. An image that stays away makes the \
        outputs absent, and after the graph's `reset_after_ms` it starts afresh with no contact.";
    const EXAMPLE: &'static str = r#"
[nodes.contact_debounce]
type = "contact_debounce"
in.present = "label.present"
samples = 5                         # 20 ms at 250 Hz
"#;
}

impl Node for ContactDebounce {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        match u32::try_from(*params.samples) {
            Ok(samples) if samples <= u64::BITS => Ok(Self { samples }),
            _ => Err(Mistake::param("samples", format!("`samples` is {} at most", u64::BITS)).into()),
        }
    }

    fn state(&self) -> State {
        State { history: 0, is_present: false }
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        state.history = state.history << 1 | u64::from(*inputs.present);
        let phase = phase(state.history, self.samples);
        state.is_present = match phase {
            Phase::Stable => true,
            Phase::None => false,
            _ => state.is_present,
        };
        out.present.set(state.is_present);
        out.state.set(f64::from(phase as u8));
        out.stable.set(phase == Phase::Stable);
        out.uncertain.set(phase == Phase::Uncertain);
    }
}

/// What the newest `samples` of a history say, 1 to 64 of them, the newest in the lowest bit.
#[must_use]
pub fn phase(history: u64, samples: u32) -> Phase {
    let ones = |count: u32| u64::MAX.checked_shr(u64::BITS - count).unwrap_or(0);
    let (all, newer) = (ones(samples), ones(samples - samples / 2));
    let older = all ^ ones(samples / 2);
    match history & all {
        0 => Phase::None,
        flags if flags == all => Phase::Stable,
        flags if flags == newer => Phase::Initial,
        flags if flags == older => Phase::Leaving,
        _ => Phase::Uncertain,
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

    /// What comes out of the flags, each a new sample: present, state, stable and uncertain of the last.
    fn show(rig: &mut NodeRig, flags: &str) -> (bool, f64, bool, bool) {
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
    fn all_32_histories_of_five_are_the_authors() {
        for history in 0..32_u64 {
            let flags: [bool; 5] = std::array::from_fn(|i| history >> (4 - i) & 1 == 1);
            assert_eq!(phase(history, 5) as u8, authors(flags), "{history:05b}");
            // What came before is of no account.
            assert_eq!(phase(history | 0b1011 << 5, 5) as u8, authors(flags), "{history:05b}");
        }
    }

    #[test]
    fn a_contact_comes_flickers_and_goes() {
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
            assert_eq!(show(&mut rig, flags), expected, "step {i}: {flags}");
        }
    }

    #[test]
    fn a_held_flag_is_no_sample() {
        let mut rig = rig("").unwrap();
        assert_eq!(show(&mut rig, "1111"), (false, 4.0, false, true));
        for _ in 0..9 {
            rig.step();
            assert_eq!((rig.freshness("present"), rig.get::<Flag>("stable")), (Freshness::Held, Some(&false)));
        }
        assert_eq!(show(&mut rig, "1"), (true, 2.0, true, false));
    }

    #[test]
    fn only_a_lasting_absence_forgets() {
        let mut rig = rig("").unwrap();
        for (ms, expected) in [(10.0, (true, 2.0, true, false)), (25.0, (false, 4.0, false, true))] {
            assert_eq!(show(&mut rig, "11111"), (true, 2.0, true, false));
            rig.lose("present");
            rig.step_ms(ms);
            assert_eq!(rig.get::<Flag>("present"), None);
            assert_eq!(show(&mut rig, "1"), expected, "{ms} ms");
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
                prop_assert_eq!(show(&mut rig, if flag { "1" } else { "0" }).0, expected);
            }
        }
    }

    #[test]
    fn how_many_samples_there_may_be() {
        for (samples, is_good) in [("1", true), ("64", true), ("65", false), ("0", false), ("5000000000", false)] {
            assert_eq!(rig(&format!("samples = {samples}")).is_ok(), is_good, "{samples}");
        }
        assert_eq!(rig("").unwrap().shape("state"), &ScalarShape::of(Unit::ONE).into());
    }
}
