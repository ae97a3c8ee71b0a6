//! What is wrong with a graph file: the place, the mistake and a way out.

use std::fmt;
use std::ops::Range;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};

use super::map::{SourceFile, SourceMap};
use super::suggest::closest;

macro_rules! codes {
    ($($(#[doc = $doc:literal])* $Code:ident $name:literal),* $(,)?) => {
        /// The sorts of mistakes a graph file can have.
        #[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
        pub enum Code { $($(#[doc = $doc])* $Code),* }

        impl Code {
            /// Every code.
            pub const ALL: &'static [Self] = &[$(Self::$Code),*];

            /// Its name, as shown in brackets.
            #[must_use]
            pub const fn name(self) -> &'static str {
                match self { $(Self::$Code => $name),* }
            }
        }
    };
}

codes! {
    /// The file is not TOML.
    Syntax "syntax",
    /// A file cannot be read.
    Unreadable "unreadable",
    /// A file of data is not what it should be.
    BadData "bad-data",
    /// A part or a bench where a graph is wanted, or the like.
    WrongFile "wrong-file",
    /// A key that means nothing here.
    UnknownKey "unknown-key",
    /// A key that must be there is not.
    MissingKey "missing-key",
    /// A value of the wrong type or out of its range.
    BadValue "bad-value",
    /// A name that cannot be one.
    BadName "bad-name",
    /// Two things with one name.
    DuplicateName "duplicate-name",
    /// A type that no catalogue lists.
    UnknownType "unknown-type",
    /// A wire from a port that does not exist.
    UnknownPort "unknown-port",
    /// A wire to an input that does not exist.
    UnknownInput "unknown-input",
    /// An input that needs a wire and has none.
    MissingInput "missing-input",
    /// A wire between two kinds.
    KindMismatch "kind-mismatch",
    /// A wire between two units.
    UnitMismatch "unit-mismatch",
    /// A wire between two frames.
    FrameMismatch "frame-mismatch",
    /// A wire between two sizes.
    ShapeMismatch "shape-mismatch",
    /// Wires that run in a circle.
    Loop "loop",
    /// A part that contains itself.
    EndlessPart "endless-part",
    /// A fact that no device states.
    UnknownFact "unknown-fact",
    /// A role that the bench binds to no device.
    UnboundRole "unbound-role",
    /// A device that cannot fill the role it is bound to.
    WrongRole "wrong-role",
    /// A task that reads what only a scenario and the recorder may read.
    ObservedRole "observed-role",
    /// A device that the bench does not have.
    UnknownDevice "unknown-device",
    /// A command of a device that nothing drives.
    UndrivenCommand "undriven-command",
    /// A command that has not crossed every limit that its device asks for.
    UnlimitedCommand "unlimited-command",
    /// A limit that a node asks for and [limits] does not say.
    MissingLimit "missing-limit",
    /// A mode that is not there.
    UnknownMode "unknown-mode",
    /// A mode that no way leads to.
    UnreachableMode "unreachable-mode",
    /// A way out of a mode that does not say what it waits for, or says too much.
    BadCondition "bad-condition",
    /// Two ways out of a mode that can hold at once.
    OverlappingConditions "overlapping-conditions",
    /// A bound that what it bounds never crosses, or always has.
    BoundOutOfRange "bound-out-of-range",
    /// A port that is absent in a mode that looks at it.
    AbsentPort "absent-port",
    /// A parameter that a mode cannot set.
    NotLive "not-live",
    /// Motion that starts by itself and that nothing ends.
    UngatedMotion "ungated-motion",
    /// A graph without a clock, or with one that cannot tick.
    BadClock "bad-clock",
    /// A node from which nothing follows that anything uses.
    UnreadNode "unread-node",
}

/// How bad it is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Severity {
    /// The graph does not load.
    Error,
    /// The graph loads, but may not be what was meant.
    Warning,
}

impl Severity {
    /// Its name, as shown before the code.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Error => "error",
            Self::Warning => "warning",
        }
    }
}

impl Code {
    /// How bad a mistake of this sort is.
    #[must_use]
    pub const fn severity(self) -> Severity {
        match self {
            Self::UnreadNode => Severity::Warning,
            _ => Severity::Error,
        }
    }
}

impl fmt::Display for Code {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// One mistake of a graph, or something to be looked at.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Diagnostic {
    /// What sort of mistake.
    pub code: Code,
    /// What is wrong: lower case, no full stop, names in backticks.
    pub message: String,
    /// The smallest token that is wrong, in [`SourceMap`].
    pub span: Range<usize>,
    /// Other places that matter, each with what it has to do with it.
    pub notes: Vec<(Range<usize>, String)>,
    /// What to do.
    pub help: Option<String>,
}

impl Diagnostic {
    /// A mistake at a place.
    pub fn new(code: Code, span: Range<usize>, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), span, notes: Vec::new(), help: None }
    }

    /// The same with a way out.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// The same with a suggestion for the misspelt `name`: the one of `known` that is near, or all of them.
    #[must_use]
    pub fn suggest<'n>(self, name: &str, known: impl Iterator<Item = &'n str>, what: &str) -> Self {
        self.help(closest(name, known, what))
    }

    /// The same with a way out, if there is one.
    #[must_use]
    pub(crate) fn with_help(self, help: Option<String>) -> Self {
        Self { help, ..self }
    }

    /// The same with another place that matters.
    #[must_use]
    pub fn note(mut self, span: Range<usize>, text: impl Into<String>) -> Self {
        self.notes.push((span, text.into()));
        self
    }
}

/// Everything that is wrong with a graph, with the texts it stands in.
#[derive(Debug, Clone)]
pub struct Report {
    /// The files that were read.
    pub sources: SourceMap,
    /// What is wrong, in the order of the places.
    pub diagnostics: Vec<Diagnostic>,
}

impl Report {
    /// The mistakes in the order of their places, each once.
    #[must_use]
    pub fn new(sources: SourceMap, mut diagnostics: Vec<Diagnostic>) -> Self {
        diagnostics.sort_by(|a, b| (a.span.start, a.span.end, &a.message).cmp(&(b.span.start, b.span.end, &b.message)));
        diagnostics.dedup();
        Self { sources, diagnostics }
    }

    /// The text for a person, with or without colours.
    #[must_use]
    pub fn render(&self, has_colour: bool) -> String {
        let renderer = if has_colour { Renderer::styled() } else { Renderer::plain() };
        let mut text = String::new();
        for diagnostic in &self.diagnostics {
            text.push_str(&self.render_one(diagnostic, &renderer));
            text.push_str("\n\n");
        }
        let is_warning = |diagnostic: &&Diagnostic| diagnostic.code.severity() == Severity::Warning;
        let warnings = self.diagnostics.iter().filter(is_warning).count();
        let counts = [(self.diagnostics.len() - warnings, "mistake"), (warnings, "warning")];
        let counts = counts.iter().filter(|(count, _)| *count > 0);
        let counts: Vec<String> =
            counts.map(|(count, what)| format!("{count} {what}{}", if *count == 1 { "" } else { "s" })).collect();
        text.push_str(&format!("{}\n", counts.join(", ")));
        text
    }

    fn render_one(&self, diagnostic: &Diagnostic, renderer: &Renderer) -> String {
        let main = self.sources.file_at(diagnostic.span.start);
        let place = AnnotationKind::Primary.span(shown(main, &diagnostic.span));
        let mut snippet = Snippet::source(&main.text).path(&main.name).annotation(place);
        let mut others: Vec<Group<'_>> = Vec::new();
        for (span, label) in &diagnostic.notes {
            let file = self.sources.file_at(span.start);
            let place = AnnotationKind::Context.span(shown(file, span));
            if std::ptr::eq(file, main) {
                snippet = snippet.annotation(place.label(label));
            } else {
                let snippet = Snippet::source(&file.text).path(&file.name).annotation(place);
                others.push(Level::NOTE.secondary_title(label).element(snippet));
            }
        }
        let level = match diagnostic.code.severity() {
            Severity::Error => Level::ERROR,
            Severity::Warning => Level::WARNING,
        };
        let title = level.primary_title(&diagnostic.message).id(diagnostic.code.name());
        let mut groups = vec![title.element(snippet)];
        groups.append(&mut others);
        if let Some(help) = &diagnostic.help {
            groups.push(Group::with_title(Level::HELP.secondary_title(help)));
        }
        renderer.render(&groups)
    }
}

/// As much of a place as is marked: nobody reads a million carets.
fn shown(file: &SourceFile, span: &Range<usize>) -> Range<usize> {
    const MOST: usize = 200;
    let local = file.local(span);
    local.start..local.end.min(file.text.floor_char_boundary(local.start + MOST))
}
