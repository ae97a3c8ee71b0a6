//! The entries `[[inject]]` of a scenario file, and the mistakes in them that show without the task.

use std::ops::Range;

use crate::node::{Amount, Mistake, Param, Reader, Spanned};
use crate::source::{Code, Diagnostic, Item, Table, Value, quoted};

/// One fault of a scenario.
#[derive(Debug, Clone, Param)]
pub(crate) struct InjectTable {
    /// Role whose images or commands the fault spoils, or whose device simulates the world that it disturbs.
    pub(crate) role: Spanned<String>,
    /// Kind of the fault.
    pub(crate) fault: Spanned<FaultKind>,
    /// The cells that it concerns: their number, or a list of `[row, column]` from 0 in the image of the device.
    pub(crate) cells: Option<Spanned<Cells>>,
    /// Value of a cell that is `stuck` or has a `spike`, and the largest value of `garbage`, in the unit of the image.
    pub(crate) reading: Option<Amount>,
    /// Factor of `gain`, or of the stiffness of the objects.
    #[param(unit = "1", range = 0.0..)]
    pub(crate) factor: Option<f64>,
    /// Speed of `drift`, in the unit of the image per second.
    pub(crate) reading_per_s: Option<f64>,
    /// Fraction of the frames or commands that are hit, at random.
    #[param(unit = "1", range = 0.0..=1.0)]
    pub(crate) rate: Option<f64>,
    /// Number of frames or commands that are hit: the first ones from `from_s` on.
    #[param(range = 1..=1_000_000)]
    pub(crate) frames: Option<u64>,
    /// Time by which frames or commands arrive later; for `jitter`, the longest one.
    #[param(unit = "ms", above = 0.0)]
    pub(crate) delay_ms: Option<f64>,
    /// Names of the joints that do not move.
    pub(crate) joints: Option<Spanned<Vec<String>>>,
    /// Force of a `push` on the sensor, in its axes at the start.
    #[param(unit = "N")]
    pub(crate) push_n: Option<[f64; 3]>,
    /// Velocity of the objects that are `moving`, in the axes of the sensor at the start.
    #[param(unit = "m/s")]
    pub(crate) velocity_m_per_s: Option<[f64; 3]>,
    /// Time from which the fault is there.
    #[param(unit = "s", range = 0.0.., default = 0.0)]
    pub(crate) from_s: f64,
    /// Time until which it is there; to the end of the run if not given.
    #[param(unit = "s", above = 0.0)]
    pub(crate) to_s: Option<f64>,
}

/// A kind of fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
pub(crate) enum FaultKind {
    /// Cells read 0.
    Dead,
    /// Cells keep one value.
    Stuck,
    /// Cells are not a number in some frames.
    Nan,
    /// Cells have one value in some frames.
    Spike,
    /// Every cell of some frames is random.
    Garbage,
    /// Cells are multiplied by a factor.
    Gain,
    /// Cells change steadily.
    Drift,
    /// Some frames have the values of the frame before, bit for bit, with a new stamp.
    Repeat,
    /// Some frames are missing.
    Missing,
    /// Frames arrive late, with their old stamps.
    Late,
    /// Frames arrive late, each by a random time.
    Jitter,
    /// Cells exchange their values.
    Swapped,
    /// Some commands do not arrive: the device follows the one before.
    Lost,
    /// Commands arrive late.
    Lag,
    /// Joints do not follow their commands.
    JointStop,
    /// A hand pushes the sensor.
    Push,
    /// The objects are gone.
    Gone,
    /// The objects have another stiffness.
    Stiff,
    /// The objects move.
    Moving,
}

/// Cells of an image.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Cells {
    /// So many, drawn at random.
    Count(usize),
    /// These: `[row, column]`.
    List(Vec<[usize; 2]>),
}

impl Param for Cells {
    const EXPECTS: &'static str = "a number of cells, or a list of `[row, column]`";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        match &value.item {
            Item::Integer(count) if *count > 0 => usize::try_from(*count).ok().map(Self::Count),
            Item::Array(items) if !items.is_empty() => Vec::read(value, reader).map(Self::List),
            _ => reader.wrong_type(value, Self::EXPECTS),
        }
    }
}

/// The keys that only some faults have.
const KEYS: [&str; 10] = [
    "cells",
    "reading",
    "factor",
    "reading_per_s",
    "delay_ms",
    "joints",
    "push_n",
    "velocity_m_per_s",
    "rate",
    "frames",
];

/// What a fault spoils.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Spoils {
    /// The images of a role.
    Images,
    /// The commands of a role.
    Commands,
    /// The world that a device simulates.
    World,
}

impl FaultKind {
    pub(crate) const fn spoils(self) -> Spoils {
        match self {
            Self::Lost | Self::Lag | Self::JointStop => Spoils::Commands,
            Self::Push | Self::Gone | Self::Stiff | Self::Moving => Spoils::World,
            _ => Spoils::Images,
        }
    }

    pub(crate) const fn word(self) -> &'static str {
        Self::CONTENTS.words[self as usize].0
    }

    /// Returns the keys that the fault needs, each with an example.
    const fn needs(self) -> &'static [(&'static str, &'static str)] {
        const CELLS: (&str, &str) = ("cells", "cells = [[3, 4]]");
        match self {
            Self::Dead | Self::Nan => &[CELLS],
            Self::Swapped => &[("cells", "cells = [[3, 4], [10, 4]]")],
            Self::Stuck | Self::Spike => &[CELLS, ("reading", "reading = 4095")],
            Self::Garbage => &[("reading", "reading = 4095")],
            Self::Gain => &[("factor", "factor = 0.8")],
            Self::Stiff => &[("factor", "factor = 10.0")],
            Self::Drift => &[("reading_per_s", "reading_per_s = 1.0")],
            Self::Late | Self::Jitter | Self::Lag => &[("delay_ms", "delay_ms = 8.0")],
            Self::JointStop => &[("joints", "joints = [\"NAME\"] with the name of a joint")],
            Self::Push => &[("push_n", "push_n = [0.0, 0.0, 5.0]")],
            Self::Moving => &[("velocity_m_per_s", "velocity_m_per_s = [0.0, 0.0, -0.02]")],
            Self::Repeat | Self::Missing | Self::Lost | Self::Gone => &[],
        }
    }

    /// Whether it hits some frames or commands, and not all.
    pub(super) const fn is_of_frames(self) -> bool {
        matches!(self, Self::Nan | Self::Spike | Self::Garbage | Self::Repeat | Self::Missing | Self::Lost)
    }

    /// Returns the keys of [`KEYS`] that the fault takes.
    fn takes(self) -> impl Iterator<Item = &'static str> {
        let needs = move |key: &&str| self.needs().iter().any(|(known, _)| known == key);
        let cells = matches!(self, Self::Gain | Self::Drift);
        KEYS.into_iter().filter(move |key| match *key {
            "rate" | "frames" => self.is_of_frames(),
            "cells" => cells || needs(key),
            _ => needs(key),
        })
    }
}

/// An entry `[[inject]]`.
pub(crate) struct InjectBlock {
    value: Value,
    /// Its keys, or `None` if a mistake in them has been reported.
    pub(crate) table: Option<InjectTable>,
}

/// Reads the entries of a scenario file. Mistakes go to the reader.
pub(crate) fn blocks(root: &Table, reader: &mut Reader<'_>) -> Vec<InjectBlock> {
    let Some((key, value)) = root.entry("inject") else { return Vec::new() };
    let Item::Array(items) = &value.item else {
        let message = "each fault is an entry of a list of tables";
        reader.mistakes.push(
            Mistake::new(Code::BadValue, crate::node::At::Span(key.span.clone()), message).help("write `[[inject]]`"),
        );
        return Vec::new();
    };
    let read = |value: &Value| InjectBlock { value: value.clone(), table: InjectTable::read(value, reader) };
    items.iter().map(read).collect()
}

impl InjectBlock {
    /// Returns the span of a key, or `None` if it is not given.
    fn key(&self, name: &str) -> Option<Range<usize>> {
        self.value.as_table()?.entry(name).map(|(key, _)| key.span.clone())
    }

    /// Returns the first mistake in the keys of a fault: one that is missing, that has no meaning, or that contradicts
    /// another one.
    pub(crate) fn mistake(&self, for_s: Option<f64>) -> Option<Diagnostic> {
        let table = self.table.as_ref()?;
        let (fault, place) = (table.fault.value, &table.fault.span);
        let word = fault.word();
        let missing =
            |message: String, help: String| Diagnostic::new(Code::MissingKey, place.clone(), message).help(help);
        if let Some((key, example)) = fault.needs().iter().find(|(key, _)| self.key(key).is_none()) {
            return Some(missing(format!("the fault `{word}` needs `{key}`"), format!("add `{example}`")));
        }
        if fault.is_of_frames() && table.rate.is_none() && table.frames.is_none() {
            let help =
                "add `rate = 0.05` for a fraction of the frames, or `frames = 1` for the first ones from `from_s` on";
            return Some(missing(format!("the fault `{word}` needs `rate` or `frames`"), help.to_owned()));
        }
        let foreign = KEYS.iter().find(|key| self.key(key).is_some() && !fault.takes().any(|known| known == **key));
        if let Some(key) = foreign {
            let message = format!("the fault `{word}` has no `{key}`");
            let known: Vec<&str> = fault.takes().collect();
            let all = ["role", "fault", "from_s", "to_s"].into_iter().chain(known);
            let help = format!("remove it; the fault has {}", quoted(all));
            return Some(Diagnostic::new(Code::UnknownKey, self.key(key)?, message).help(help));
        }
        let is_alone = match table.cells.as_ref().map(|cells| &cells.value) {
            Some(Cells::Count(count)) => *count < 2,
            Some(Cells::List(list)) => list.len() < 2,
            None => false,
        };
        if fault == FaultKind::Swapped && is_alone {
            let message = "one cell has no other one to exchange its readings with";
            return Some(Diagnostic::new(Code::BadValue, self.key("cells")?, message).help("write two cells or more"));
        }
        if table.rate.is_some() && table.frames.is_some() {
            let message = "a fault has either `rate` or `frames`";
            return Some(Diagnostic::new(Code::BadValue, self.key("frames")?, message).help("remove one of them"));
        }
        if let Some(to) = table.to_s.filter(|to| *to <= table.from_s) {
            let message = format!("the fault ends at {to} s, before it begins at {} s", table.from_s);
            return Some(Diagnostic::new(Code::BadValue, self.key("to_s")?, message).help("write a later time"));
        }
        let for_s = for_s.filter(|for_s| table.from_s >= *for_s)?;
        let message = format!("the run ends after {for_s} s, before the fault begins at {} s", table.from_s);
        Some(
            Diagnostic::new(Code::BadValue, self.key("from_s")?, message)
                .help("write an earlier time, or a larger `for_s`"),
        )
    }
}
