//! Fixes: changes of the source texts that mend a mistake, as data beside the help of a diagnostic.

use std::ops::Range;

use super::map::{SourceFile, SourceMap};

/// One change of a source text. Places are ranges of the [`SourceMap`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Edit {
    /// Replaces the text at a place.
    Replace(Range<usize>, String),
    /// Inserts lines below the line of a place, such as the header of a section.
    Below(Range<usize>, String),
    /// Appends lines to the file of a place.
    Append(Range<usize>, String),
}

impl Edit {
    /// Returns the changed range of the source map and the new text.
    fn resolve(&self, sources: &SourceMap) -> (Range<usize>, String) {
        let file = |span: &Range<usize>| sources.file_at(span.start);
        let insert = |file: &SourceFile, at: usize, text: &str| {
            let starts_line = at == 0 || file.text[..at].ends_with('\n');
            (file.base + at..file.base + at, format!("{}{text}\n", if starts_line { "" } else { "\n" }))
        };
        match self {
            Self::Replace(span, text) => (span.clone(), text.clone()),
            Self::Below(span, text) => {
                let file = file(span);
                let end = file.text[file.local(span).end..].find('\n').map(|end| file.local(span).end + end + 1);
                insert(file, end.unwrap_or(file.text.len()), text)
            }
            Self::Append(span, text) => insert(file(span), file(span).text.len(), text),
        }
    }
}

impl SourceMap {
    /// Returns the files that the edits change: their names, and their new texts.
    #[must_use]
    pub fn edited(&self, edits: &[Edit]) -> Vec<(String, String)> {
        let mut edits: Vec<_> = edits.iter().map(|edit| edit.resolve(self)).collect();
        // An insertion stands before a replacement at the same place.
        edits.sort_by_key(|(span, _)| (span.start, span.end));
        let mut files: Vec<(usize, String, String)> = Vec::new();
        // From the last place to the first, so that the earlier places stay valid.
        for (span, text) in edits.iter().rev() {
            let file = self.file_at(span.start);
            if !files.iter().any(|(base, ..)| *base == file.base) {
                files.push((file.base, file.name.clone(), file.text.clone()));
            }
            let changed = files.iter_mut().find(|(base, ..)| *base == file.base);
            changed.into_iter().for_each(|(.., whole)| whole.replace_range(file.local(span), text));
        }
        files.into_iter().map(|(_, name, text)| (name, text)).collect()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;

    #[test]
    fn edits_of_two_files_are_made_together() {
        let mut sources = SourceMap::default();
        let first = sources.add_file(Path::new("a.toml"), "[a]\nx = 1").base;
        let second = sources.add_file(Path::new("b.toml"), "y = 2\n").base;
        let edits = [
            Edit::Replace(first + 4..first + 5, "z".into()),
            Edit::Below(first + 1..first + 2, "w = 0".into()),
            Edit::Append(first..first, "[b]".into()),
            Edit::Append(second..second, "[c]".into()),
        ];
        let mut fixed = sources.edited(&edits);
        fixed.sort();
        let text = |text: &str| text.to_owned();
        let expected = [(text("a.toml"), text("[a]\nw = 0\nz = 1\n[b]\n")), (text("b.toml"), text("y = 2\n[c]\n"))];
        assert_eq!(fixed, expected);
    }
}
