//! The declarations of ports, independent of any graph.

use std::borrow::Cow;

use crate::signal::{Kind, Signal};

/// When an input wakes its node, and whether it must be wired and present; see the table in [`node`](super).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Need {
    /// Whether the graph must wire it.
    pub must_be_wired: bool,
    /// Whether the node steps only while the wired value is present. While it is absent, the outputs are absent.
    pub must_be_present: bool,
    /// Whether a new value wakes the node. The loss of a value always wakes it.
    pub is_trigger: bool,
    /// Whether it accepts any number of wires, each named in the graph.
    pub is_many: bool,
    /// Whether the node reads the value of the last tick. Such an input wakes the node, one tick late, only if no other
    /// input does. Its shape is unknown when the node is built, except for a flag: `Some` if it is wired.
    pub is_delayed: bool,
    /// Whether it accepts only a port whose quantity is known; see [`PortSpec::quantity`].
    pub must_be_known: bool,
}

impl Need {
    /// Must be wired and present, and wakes the node.
    pub const REQUIRED: Self = Self {
        must_be_wired: true,
        must_be_present: true,
        is_trigger: true,
        is_many: false,
        is_delayed: false,
        must_be_known: false,
    };
    /// May be unwired or absent, and wakes the node.
    pub const OPTIONAL: Self = Self { must_be_wired: false, must_be_present: false, ..Self::REQUIRED };
}

/// The declaration of a port.
#[derive(Debug, Clone, PartialEq)]
#[must_use]
pub struct PortSpec {
    /// Name in the graph file.
    pub name: Cow<'static, str>,
    /// What the port carries.
    pub doc: Cow<'static, str>,
    /// Kind of signal.
    pub kind: Kind,
    /// Unit, then frames: `"N"`, `"E/s"`, `"base"`; a capital letter is a variable, `"$name"` the parameter `name`.
    pub args: Cow<'static, [Cow<'static, str>]>,
    /// What the value is, beside its unit: `position` is not `equilibrium`. A capital letter is a variable. `"$wire"` is
    /// the name of the wire. `None` if an output does not know it, or an input accepts any.
    pub quantity: Option<Cow<'static, str>>,
    /// What an input needs. An output of a role that [need not be wired](Need::must_be_wired) is one that a device need
    /// not state; it is absent then. Without meaning for an output of a node.
    pub need: Need,
}

impl PortSpec {
    /// Returns the declaration of an output, or of an input that must be wired and present, with the arguments in the
    /// order of its kind.
    pub fn new(name: &'static str, doc: &'static str, kind: Kind, args: &[&'static str]) -> Self {
        let args = args.iter().copied().map(Cow::Borrowed).collect();
        Self { name: name.into(), doc: doc.into(), kind, args, quantity: None, need: Need::REQUIRED }
    }

    /// Returns the declaration with a quantity.
    pub fn of_quantity(self, quantity: &'static str) -> Self {
        Self { quantity: Some(quantity.into()), ..self }
    }

    /// Returns the declaration of an input that may be unwired, or of an output of a role that a device need not state.
    pub fn optional(self) -> Self {
        Self { need: Need::OPTIONAL, ..self }
    }

    /// Returns the declaration of a port of signal `T`, with its arguments by name. It leaves out arguments that the
    /// kind does not have, and frames from the first `"_"` on.
    pub fn of<T: Signal>(
        name: &'static str,
        doc: &'static str,
        arguments: &[(&str, &'static str)],
        need: Need,
    ) -> Self {
        let value = |argument: &&str| arguments.iter().find(|(name, _)| name == argument).map(|(_, value)| *value);
        let is_said = |argument: &&str| *argument == "unit" || value(argument) != Some("_");
        let arguments = T::KIND.arguments().iter().take_while(|argument| is_said(argument));
        let args: Vec<&'static str> = arguments.filter_map(value).collect();
        Self { need, quantity: value(&"quantity").map(Cow::Borrowed), ..Self::new(name, doc, T::KIND, &args) }
    }
}

/// The letters that the inputs of a node bind; used by the derives.
#[doc(hidden)]
#[derive(Debug, Clone, Copy)]
pub struct Letters {
    units: &'static str,
    frames: &'static str,
    quantities: &'static str,
    are_complete: bool,
}

/// What a letter stands for; used by the derives.
#[doc(hidden)]
#[derive(Debug, Clone, Copy)]
pub enum LetterKind {
    /// A unit.
    Unit,
    /// A frame.
    Frame,
    /// A quantity.
    Quantity,
}

impl Letters {
    /// Creates it from the letters of the units, the frames and the quantities. If an input lacks an argument, they are
    /// not complete.
    #[must_use]
    pub const fn of([units, frames, quantities]: [&'static str; 3], are_complete: bool) -> Self {
        Self { units, frames, quantities, are_complete }
    }

    /// Whether an input binds a letter. If the letters are not complete it returns `true`, so that one mistake has one
    /// message.
    #[must_use]
    pub const fn binds(&self, kind: LetterKind, letter: char) -> bool {
        let letters = match kind {
            LetterKind::Unit => self.units,
            LetterKind::Frame => self.frames,
            LetterKind::Quantity => self.quantities,
        };
        let letters = letters.as_bytes();
        let mut i = 0;
        while i < letters.len() && letters[i] != letter as u8 {
            i += 1;
        }
        i < letters.len() || !self.are_complete
    }
}
