//! `all`, `any` and `not`: flags from flags.

use tactflow_runtime::node::{
    At, Describe, In, Inputs, Many, Mistake, Mistakes, Node, Out, Outputs, Reading, Setup, Tick,
};
use tactflow_runtime::signal::Flag;
use tactflow_runtime::source::Code;

/// Whether all of several flags are set.
///
/// Each flag is wired under a name of your choice. A flag that is absent counts as not set, as for a gate. While all of
/// them are absent, the output is absent. It is as old as the oldest present flag.
///
/// The check does not treat this flag as a contact, so it does not end a generated motion. Gate the motion with
/// `label.present` or `contact_debounce.present`.
///
/// ```toml
/// [nodes.both]                        # both pads feel the object
/// type = "all"
/// in.left = "label.present"
/// in.right = "contact_debounce.present"
/// ```
#[derive(Describe)]
pub struct All;

/// Whether at least one of several flags is set.
///
/// Each flag is wired under a name of your choice. A flag that is absent counts as not set. While all of them are
/// absent, the output is absent. It is as old as the oldest present flag.
///
/// The check does not treat this flag as a contact, so it does not end a generated motion. Gate the motion with
/// `label.present` or `contact_debounce.present`.
///
/// ```toml
/// [nodes.either]                      # one of two pads feels the object
/// type = "any"
/// in.left = "label.present"
/// in.right = "contact_debounce.present"
/// ```
#[derive(Describe)]
pub struct Any;

/// Whether a flag is not set.
///
/// While the flag is absent, the output is absent. So a sensor that sends nothing does not count as free.
///
/// The check does not treat this flag as a contact, so it does not end a generated motion. Gate the motion with
/// `label.present` or `contact_debounce.present`.
///
/// ```toml
/// [nodes.free]                        # the pad feels nothing
/// type = "not"
/// in.flag = "label.present"
/// ```
#[derive(Describe)]
pub struct Not;

/// What `all` and `any` read.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The flags.
    flag: Many<'a, Flag>,
}

/// What `not` reads.
#[derive(Inputs)]
pub struct NotInputs<'a> {
    /// The flag.
    flag: In<'a, Flag>,
}

/// What `all`, `any` and `not` write.
#[derive(Outputs)]
pub struct Outputs {
    /// The result.
    is_met: Out<Flag>,
}

/// Refuses a node without wires.
fn refuse_none(wires: usize) -> Result<(), Mistakes> {
    if wires > 0 {
        return Ok(());
    }
    let mistake = Mistake::new(Code::MissingInput, At::Node, "no flag is wired");
    Err(mistake.help("wire each under a name of your choice: `in.left = \"label.present\"`").into())
}

/// Returns what the result of this many flags says: that of one alone is the same flag.
const fn alone(wires: usize) -> Reading {
    if wires == 1 { Reading::Same } else { Reading::Other }
}

/// Writes the `decisive` value if one flag has it, and the other value if none has. An absent flag is not set; without any
/// flag the result is absent.
fn combine(inputs: &Inputs<'_>, out: &mut Outputs, decisive: bool) {
    if inputs.flag.iter().any(|flag| flag.is_some()) {
        let has_decisive = inputs.flag.iter().any(|flag| flag.is_some_and(|flag| *flag) == decisive);
        out.is_met.set(has_decisive == decisive);
    }
}

impl Node for All {
    type Params = ();
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new((): (), setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.reading = alone(setup.inputs.flag.len());
        refuse_none(setup.inputs.flag.len()).map(|()| Self)
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        combine(&inputs, out, false);
    }
}

impl Node for Any {
    type Params = ();
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new((): (), setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.reading = alone(setup.inputs.flag.len());
        refuse_none(setup.inputs.flag.len()).map(|()| Self)
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        combine(&inputs, out, true);
    }
}

impl Node for Not {
    type Params = ();
    type Inputs<'a> = NotInputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new((): (), setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.reading = Reading::Opposite;
        Ok(Self)
    }

    fn step(&self, _: &Tick, inputs: NotInputs<'_>, out: &mut Outputs, (): &mut ()) {
        out.is_met.set(!*inputs.flag);
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::FlagShape;

    use super::*;

    fn result<N: Node>(flags: [Option<bool>; 2]) -> Option<bool> {
        let wires = ["one", "two"].map(|name| (name, FlagShape.into()));
        let mut rig = NodeRig::new::<N>("", &wires).unwrap();
        for (name, flag) in ["one", "two"].into_iter().zip(flags) {
            match flag {
                Some(flag) => rig.set(name, flag),
                None => rig.lose(name),
            }
        }
        rig.step();
        rig.get::<Flag>("is_met").copied()
    }

    #[test]
    fn an_absent_flag_is_not_set() {
        let (yes, no) = (Some(true), Some(false));
        let cases = [
            ([yes, yes], yes, yes),
            ([yes, no], no, yes),
            ([no, no], no, no),
            ([yes, None], no, yes),
            ([None, no], no, no),
            ([None, None], None, None),
        ];
        for (flags, all, any) in cases {
            assert_eq!((result::<All>(flags), result::<Any>(flags)), (all, any), "{flags:?}");
        }
    }

    #[test]
    fn not_is_absent_with_its_flag() {
        let mut rig = NodeRig::new::<Not>("", &[("flag", FlagShape.into())]).unwrap();
        for flag in [true, false] {
            rig.set("flag", flag);
            rig.step();
            assert_eq!(rig.get::<Flag>("is_met"), Some(&!flag));
        }
        rig.lose("flag");
        rig.step();
        assert_eq!(rig.get::<Flag>("is_met"), None);
    }

    #[test]
    fn a_node_without_wires_is_a_mistake() {
        let mistakes = [NodeRig::new::<All>("", &[]).err(), NodeRig::new::<Any>("", &[]).err()];
        for mistakes in mistakes.map(Option::unwrap) {
            assert_eq!((mistakes.len(), mistakes[0].code, &mistakes[0].at), (1, Code::MissingInput, &At::Node));
        }
    }
}
