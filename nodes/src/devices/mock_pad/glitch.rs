//! How a scripted pad misbehaves.

use tactflow_runtime::node::{NonNegative, Param, Positive, Reader, read_leaf};
use tactflow_runtime::params;
use tactflow_runtime::source::Value;

use crate::devices::nanos;

/// A way to misbehave.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trouble {
    /// The last frame comes again and again, under its old sequence number.
    Repeat,
    /// The last frame comes again and again, under new sequence numbers and stamps: a stuck sensor.
    Freeze,
    /// No frame comes.
    Silence,
    /// One cell is not a number.
    Nan,
    /// The stamps lie before those that were.
    Back,
    /// The device fails, and a plug that was out does not come back by itself.
    Unplug,
}

const TROUBLES: [(&str, Trouble); 6] = [
    ("repeat", Trouble::Repeat),
    ("freeze", Trouble::Freeze),
    ("silence", Trouble::Silence),
    ("nan", Trouble::Nan),
    ("back", Trouble::Back),
    ("unplug", Trouble::Unplug),
];

impl Param for Trouble {
    const EXPECTS: &'static str = "`repeat`, `freeze`, `silence`, `nan`, `back` or `unplug`";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let name: String = read_leaf(value, reader, Self::EXPECTS)?;
        let found = TROUBLES.iter().find(|(trouble, _)| *trouble == name).map(|(_, trouble)| *trouble);
        if found.is_none() {
            reader.wrong_type(value, Self::EXPECTS);
        }
        found
    }
}

params! {
    Glitch:
    /// When it begins [s].
    at_s: NonNegative,
    /// How long it lasts [s].
    for_s: Positive,
    /// What goes wrong.
    kind: Trouble,
}

impl Glitch {
    /// When it begins [ns].
    #[must_use]
    pub fn start(&self) -> i64 {
        nanos(*self.at_s)
    }

    /// When it is over [ns].
    #[must_use]
    pub fn end(&self) -> i64 {
        self.start().saturating_add(nanos(*self.for_s))
    }

    /// Whether it is on at `time` [ns].
    #[must_use]
    pub fn holds_at(&self, time: i64) -> bool {
        (self.start()..self.end()).contains(&time)
    }
}
