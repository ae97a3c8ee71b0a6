//! The report of a graph: all its diagnostics with the texts they refer to, and its text for a terminal.

use std::collections::BTreeMap;
use std::fmt;
use std::ops::Range;

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};

use super::diagnostic::{Code, Diagnostic, Diagnostics, Severity};
use super::map::{SourceFile, SourceMap};

/// Maximum number of places that a message about one missing name shows.
const MAX_NOTES: usize = 8;

/// All diagnostics of a graph, with the texts they refer to. `Debug` shows them as a terminal does, for `unwrap` in a
/// test.
#[derive(Clone)]
pub struct Report {
    /// The files that were read.
    pub sources: SourceMap,
    /// The diagnostics in the order of their places.
    pub diagnostics: Diagnostics,
}

impl fmt::Debug for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "\n{}", self.render(false))
    }
}

impl Report {
    /// Sorts the diagnostics by place, removes duplicates, and joins those of one missing name.
    #[must_use]
    pub fn new(sources: SourceMap, mut diagnostics: Diagnostics) -> Self {
        let place = |d: &Diagnostic| (d.span.start, d.span.end);
        diagnostics
            .sort_by(|a, b| (place(a), &a.message, a.fix.is_empty()).cmp(&(place(b), &b.message, b.fix.is_empty())));
        // Of two with the same message, the one with a fix stays.
        diagnostics.dedup_by(|b, a| (place(a), a.code, &a.message) == (place(b), b.code, &b.message));
        // A wire that is wrong in several ways, or for several nodes, has one diagnostic: that of the coarsest check.
        diagnostics.sort_by_key(|d| (place(d), d.code.is_mismatch().then_some(d.code)));
        diagnostics.dedup_by(|b, a| place(a) == place(b) && a.code.is_mismatch() && b.code.is_mismatch());
        let mut joined = Diagnostics::new();
        // A name that is missing at several places has one diagnostic.
        let mut places: BTreeMap<(Code, String, Option<String>), usize> = BTreeMap::new();
        for diagnostic in diagnostics {
            let name = (diagnostic.code, diagnostic.message.clone(), diagnostic.help.clone());
            match places.get(&name).filter(|_| diagnostic.code.is_missing_name()) {
                Some(first) => {
                    if joined[*first].notes.len() < MAX_NOTES {
                        joined[*first].notes.push((diagnostic.span, "and here".into()));
                    }
                    joined[*first].fix.extend(diagnostic.fix);
                }
                None => {
                    places.insert(name, joined.len());
                    joined.push(diagnostic);
                }
            }
        }
        Self { sources, diagnostics: joined }
    }

    /// Formats all diagnostics for a terminal, with or without colours.
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
        let place = marked(main, &diagnostic.span);
        let mut others: Vec<Group<'_>> = Vec::new();
        let (mut notes, mut shown) = (Vec::new(), place.clone());
        for (span, label) in &diagnostic.notes {
            let file = self.sources.file_at(span.start);
            let place = marked(file, span);
            if std::ptr::eq(file, main) {
                shown = shown.start.min(place.start)..shown.end.max(place.end);
                notes.push((place, label));
            } else {
                let excerpt = Excerpt::of(file, &place);
                let snippet = excerpt.snippet().annotation(AnnotationKind::Context.span(excerpt.within(&place)));
                others.push(Level::NOTE.secondary_title(label).element(snippet));
            }
        }
        let excerpt = Excerpt::of(main, &shown);
        let notes =
            notes.into_iter().map(|(place, label)| AnnotationKind::Context.span(excerpt.within(&place)).label(label));
        let snippet = excerpt.snippet().annotation(AnnotationKind::Primary.span(excerpt.within(&place)));
        let snippet = snippet.annotations(notes);
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

/// The lines of a file that a message shows. The time to render them does not depend on the length of the file.
struct Excerpt<'a> {
    file: &'a SourceFile,
    text: &'a str,
    /// Number of the first line.
    line: usize,
    /// Offset of the first line in the file.
    start: usize,
}

impl<'a> Excerpt<'a> {
    fn of(file: &'a SourceFile, local: &Range<usize>) -> Self {
        let (range, line) = file.lines_around(local);
        Self { file, text: &file.text[range.clone()], line, start: range.start }
    }

    fn snippet<T: Clone>(&self) -> Snippet<'a, T> {
        Snippet::source(self.text).path(&self.file.name).line_start(self.line)
    }

    /// Converts a range of the file into a range of the excerpt.
    fn within(&self, local: &Range<usize>) -> Range<usize> {
        local.start - self.start..local.end - self.start
    }
}

/// Returns the part of a span that is underlined, so that a huge value does not print a million carets.
fn marked(file: &SourceFile, span: &Range<usize>) -> Range<usize> {
    const MAX_MARKED_BYTES: usize = 200;
    let local = file.local(span);
    local.start..local.end.min(file.text.floor_char_boundary(local.start + MAX_MARKED_BYTES))
}
