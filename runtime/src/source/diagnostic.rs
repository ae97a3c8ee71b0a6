//! Diagnostics: what is wrong in a graph file, where, and how to fix it.

use std::fmt;
use std::ops::Range;

use super::fix::Edit;
use super::suggest::{did_you_mean, suggest_name, suggestion};

macro_rules! codes {
    ($($(#[doc = $doc:literal])* $Code:ident $name:literal),* $(,)?) => {
        /// The kind of a diagnostic.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Code { $($(#[doc = $doc])* $Code),* }

        impl Code {
            /// Every code.
            pub const ALL: &'static [Self] = &[$(Self::$Code),*];

            /// Returns the name shown in brackets.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$Code => $name),* }
            }

            /// Returns the page that explains it, in Markdown.
            #[must_use]
            pub const fn page(self) -> &'static str {
                match self { $(Self::$Code => include_str!(concat!("../../../docs/errors/", $name, ".md"))),* }
            }
        }
    };
}

codes! {
    /// The file is not TOML.
    Syntax "syntax",
    /// A file cannot be read.
    Unreadable "unreadable",
    /// A data file has invalid content.
    BadData "bad-data",
    /// A file of another type than expected, such as a part in place of a graph.
    WrongFile "wrong-file",
    /// A key that is not allowed here.
    UnknownKey "unknown-key",
    /// A required key is missing.
    MissingKey "missing-key",
    /// A value of the wrong type or out of range.
    BadValue "bad-value",
    /// An invalid name.
    BadName "bad-name",
    /// A name that is used twice.
    DuplicateName "duplicate-name",
    /// A type that is not in the catalogue.
    UnknownType "unknown-type",
    /// A wire from a port that does not exist.
    UnknownPort "unknown-port",
    /// A wire to an input that does not exist.
    UnknownInput "unknown-input",
    /// A required input without a wire.
    MissingInput "missing-input",
    /// A wire between ports of different kinds.
    KindMismatch "kind-mismatch",
    /// A wire between ports in different frames.
    FrameMismatch "frame-mismatch",
    /// A parameter that names a frame which no role has.
    UnknownFrame "unknown-frame",
    /// A wire from a port that carries another quantity than its input accepts, or an unknown one.
    QuantityMismatch "quantity-mismatch",
    /// A wire between ports of different units, or a number in a unit that measures something else.
    UnitMismatch "unit-mismatch",
    /// A wire between ports of different sizes.
    ShapeMismatch "shape-mismatch",
    /// Wires that form a cycle.
    Loop "loop",
    /// A part that contains itself.
    EndlessPart "endless-part",
    /// A fact that the device does not provide.
    UnknownFact "unknown-fact",
    /// A fact of a role that its node does not read.
    ForeignFact "foreign-fact",
    /// A role that the bench does not bind to a device.
    UnboundRole "unbound-role",
    /// A device that cannot fill the role it is bound to.
    WrongRole "wrong-role",
    /// A task that reads a role reserved for scenarios and recordings.
    ObservedRole "observed-role",
    /// A device that the bench does not define.
    UnknownDevice "unknown-device",
    /// A command without a wire.
    UndrivenCommand "undriven-command",
    /// A live device that moves and does not stop by itself without commands.
    UnwatchedDevice "unwatched-device",
    /// A limiter that reads another arm or another arm's sensor.
    ForeignInput "foreign-input",
    /// A command whose path lacks a limit that its role requires.
    UnlimitedCommand "unlimited-command",
    /// A limit in raw readings on a bench that does not allow it.
    Uncalibrated "uncalibrated",
    /// A value that a node reads from [limits] and that is missing there.
    MissingLimit "missing-limit",
    /// A limiter whose bound is looser than a limit that holds for its arm.
    LooseLimit "loose-limit",
    /// A mode that does not exist.
    UnknownMode "unknown-mode",
    /// A mode that cannot be reached from the start mode.
    UnreachableMode "unreachable-mode",
    /// An exit of a mode with no condition, or with contradictory keys.
    BadCondition "bad-condition",
    /// Two exits of a mode that can hold at once.
    OverlappingConditions "overlapping-conditions",
    /// A bound that is always true or never true within the range of its port.
    BoundOutOfRange "bound-out-of-range",
    /// A condition on a port that is absent in its mode.
    AbsentPort "absent-port",
    /// A parameter that a mode cannot set.
    NotLive "not-live",
    /// Generated motion without a gate and without an end.
    UngatedMotion "ungated-motion",
    /// A graph without a clock, or with an invalid one.
    BadClock "bad-clock",
    /// A node whose outputs are not used.
    UnusedNode "unused-node",
    /// A number far beyond what an arm or a sensor can do, as in another unit.
    UnusualValue "unusual-value",
    /// A time that is shorter than a period.
    ShortTime "short-time",
    /// A gain of zero or below, so that a loop does not correct its error.
    UnusualGain "unusual-gain",
    /// A gain that is too high for the period, so that a loop diverges.
    UnstableGain "unstable-gain",
    /// A column that increases the error of its feature, or that does not change the feature.
    WrongColumn "wrong-column",
    /// A column that no mode selects, although its feature has gains.
    UnusedColumn "unused-column",
    /// A selected component that no column moves.
    IdleAxis "idle-axis",
    /// Gains with which a loop is near instability over a contact of the bench.
    LowMargin "low-margin",
    /// A filter whose delay takes most of the phase margin of a loop.
    SlowFilter "slow-filter",
    /// A derivative gain on a feature that no filter smooths.
    UnfilteredDerivative "unfiltered-derivative",
    /// An integral that grows without an effective bound.
    Windup "windup",
    /// A mode that rolls the sensor while nothing controls its force.
    UnforcedRolling "unforced-rolling",
    /// A position that is controlled along the line that a mode follows.
    LinePosition "line-position",
    /// Two motions of a mode that work against each other, or a motion into a pressed object.
    OpposedMotion "opposed-motion",
    /// A lost contact that is searched for faster than it was approached.
    FastRecovery "fast-recovery",
    /// A setpoint at or above a limit that holds for its feature.
    UnreachableSetpoint "unreachable-setpoint",
    /// A sensor that starts outside its workspace.
    StartOutside "start-outside",
    /// A mode that waits for a contact and does not move toward it.
    NoApproach "no-approach",
    /// An exit of a mode that is never taken, because another one comes first.
    LateExit "late-exit",
    /// An exit of a mode that holds as soon as the mode begins.
    ImmediateExit "immediate-exit",
    /// Two modes that lead to each other again and again.
    ChatteringModes "chattering-modes",
    /// An entry of [allow] that silences no warning.
    UnusedAllow "unused-allow",
}

/// The severity of a diagnostic.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Severity {
    /// The graph does not load.
    Error,
    /// The graph loads, but probably contains a mistake.
    Warning,
}

impl Severity {
    /// Returns the name shown before the code.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Warning => "warning",
        }
    }
}

impl Code {
    /// Returns the severity of this code.
    #[must_use]
    pub const fn severity(self) -> Severity {
        match self {
            Self::UnusedNode
            | Self::UnusualValue
            | Self::ShortTime
            | Self::UnusualGain
            | Self::UnstableGain
            | Self::WrongColumn
            | Self::UnusedColumn
            | Self::IdleAxis
            | Self::LowMargin
            | Self::SlowFilter
            | Self::UnfilteredDerivative
            | Self::Windup
            | Self::UnforcedRolling
            | Self::LinePosition
            | Self::FastRecovery
            | Self::UnreachableSetpoint
            | Self::StartOutside
            | Self::NoApproach
            | Self::LateExit
            | Self::ImmediateExit
            | Self::ChatteringModes
            | Self::OpposedMotion
            | Self::UnusedAllow => Severity::Warning,
            _ => Severity::Error,
        }
    }

    /// Returns whether it reports that the two ends of a wire differ. The coarsest difference comes first.
    pub(super) const fn is_mismatch(self) -> bool {
        matches!(self, Self::KindMismatch | Self::FrameMismatch | Self::QuantityMismatch | Self::UnitMismatch)
    }

    /// Returns whether a wire may be missing because of it, so that what depends on the wire is not known.
    pub(crate) const fn hides_wires(self) -> bool {
        use Code::{BadName, KindMismatch, Loop, MissingInput, MissingKey};
        let is_wire = matches!(self, KindMismatch | Loop | MissingInput | MissingKey | BadName | Self::BadValue);
        is_wire || matches!(self, Self::UnknownInput | Self::UnknownPort | Self::UnknownType | Self::UnknownKey)
    }

    /// Returns whether it reports a reference to a name that does not exist.
    pub(super) const fn is_missing_name(self) -> bool {
        matches!(self, Self::UnknownPort | Self::UnknownFact | Self::UnknownMode | Self::UnknownDevice)
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// One error or warning about a graph file.
#[derive(Debug, Clone, PartialEq, Eq)]
#[must_use]
pub struct Diagnostic {
    /// The kind of diagnostic.
    pub code: Code,
    /// What is wrong: lower case, no full stop, names in backticks.
    pub message: String,
    /// The smallest wrong token, as a range of the [`SourceMap`].
    pub span: Range<usize>,
    /// Related places, each with a label.
    pub notes: Vec<(Range<usize>, String)>,
    /// How to fix it.
    pub help: Option<String>,
    /// The changes that the help asks for, if they can be made as they stand; otherwise empty.
    pub fix: Vec<Edit>,
}

impl Diagnostic {
    /// Creates a diagnostic without notes and help.
    pub fn new(code: Code, span: Range<usize>, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), span, notes: Vec::new(), help: None, fix: Vec::new() }
    }

    /// Creates the diagnostic of a `name` for which there is no `what`, with a suggestion among the `known` names.
    pub fn unknown<'n>(
        code: Code,
        what: &str,
        name: &str,
        span: &Range<usize>,
        known: impl Iterator<Item = &'n str>,
    ) -> Self {
        let message = format!("there is no {what} `{name}`");
        Self::new(code, span.clone(), message).suggest(name, known, &format!("{what}s"))
    }

    /// Sets the help text.
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// Sets the help for an unknown `name`: the closest of the `known` names, or all of them.
    ///
    /// `what` names the known things in the plural, for example "roles".
    pub fn suggest<'n>(self, name: &str, known: impl Iterator<Item = &'n str>, what: &str) -> Self {
        let known: Vec<&str> = known.collect();
        match suggest_name(name, known.iter().copied()) {
            Some(best) => self.instead(name, best),
            None => self.help(suggestion(name, known.into_iter(), what)),
        }
    }

    /// Suggests `best` in place of `name`, which is marked.
    pub fn instead(mut self, name: &str, best: &str) -> Self {
        self.fix.extend(inside(&self.span, name).map(|span| Edit::Replace(span, best.to_owned())));
        self.help(did_you_mean(best))
    }

    /// Adds a change that the help asks for.
    pub fn edit(mut self, edit: Edit) -> Self {
        self.fix.push(edit);
        self
    }

    /// Sets or clears the help text.
    pub(crate) fn with_help(self, help: Option<String>) -> Self {
        Self { help, ..self }
    }

    /// Returns the diagnostic as the error of something that may also fail without one.
    pub(crate) fn into_err<T>(self) -> Result<T, Option<Box<Self>>> {
        Err(Some(Box::new(self)))
    }

    /// Adds a related place with a label.
    pub fn note(mut self, span: Range<usize>, text: impl Into<String>) -> Self {
        self.notes.push((span, text.into()));
        self
    }
}

/// A list of diagnostics, in the order in which they were found.
pub type Diagnostics = Vec<Diagnostic>;

/// Returns the place of `name` in the text at `span`: a word with or without quotes.
fn inside(span: &Range<usize>, name: &str) -> Option<Range<usize>> {
    match span.len().checked_sub(name.len())? {
        0 => Some(span.clone()),
        2 => Some(span.start + 1..span.end - 1),
        _ => None,
    }
}
