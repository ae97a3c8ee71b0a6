//! The texts a graph is made from, laid end to end, so that a place in any of them is one plain range.

use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::source::closest;

/// One text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceFile {
    /// Path as the user would write it, or [`SourceMap::COMMAND_LINE`].
    pub name: String,
    /// The text.
    pub text: String,
    /// Where its first byte stands in the whole.
    pub base: usize,
    folder: PathBuf,
}

impl SourceFile {
    /// A range of the whole as a range of this text.
    #[must_use]
    pub fn local(&self, span: &Range<usize>) -> Range<usize> {
        let clamp = |at: usize| at.saturating_sub(self.base).min(self.text.len());
        clamp(span.start)..clamp(span.end)
    }

    /// Line and column of a place of the whole, both from 1; the column counts characters.
    #[must_use]
    pub fn line_column(&self, at: usize) -> (usize, usize) {
        let before = &self.text[..self.text.floor_char_boundary(self.local(&(at..at)).start)];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().unwrap_or("").chars().count() + 1;
        (line, column)
    }
}

/// A range of text, as a program or a person refers to it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Location {
    /// The file, or [`SourceMap::COMMAND_LINE`].
    pub file: String,
    /// Line, from 1.
    pub line: usize,
    /// Column, from 1 [characters].
    pub column: usize,
    /// Length [characters].
    pub length: usize,
}

/// A file that a catalogue brings along: its name behind `builtin:`, and its bytes.
pub type BuiltinFile = (&'static str, &'static [u8]);

/// What the path of a file starts with that a catalogue brings along, and no disk.
const BUILTIN: &str = "builtin:";

/// All texts a graph was read from: files, and what the command line sets.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SourceMap {
    files: Vec<SourceFile>,
    builtin: Vec<BuiltinFile>,
}

impl SourceMap {
    /// Name of the texts that the command line gives.
    pub const COMMAND_LINE: &str = "command line";

    /// No text yet, and files that `builtin:NAME` stands for.
    #[must_use]
    pub fn with_builtin(files: &[BuiltinFile]) -> Self {
        Self { files: Vec::new(), builtin: files.to_vec() }
    }

    /// The bytes of `builtin:NAME`; none for a path on the disk.
    ///
    /// # Errors
    /// What is wrong and a way out, when nothing of that name is built in.
    pub fn builtin(&self, path: &Path) -> Result<Option<&'static [u8]>, (String, String)> {
        let Some(name) = path.to_str().and_then(|path| path.strip_prefix(BUILTIN)) else { return Ok(None) };
        match self.builtin.iter().find(|(other, _)| *other == name) {
            Some((_, bytes)) => Ok(Some(bytes)),
            None => {
                let help = closest(name, self.builtin.iter().map(|(name, _)| *name), "built-in files");
                Err((format!("no file `{name}` is built in"), help))
            }
        }
    }

    /// A path as it is written at `at`: relative to the folder of the file it stands in.
    #[must_use]
    pub fn path(&self, text: &str, at: usize) -> PathBuf {
        if text.starts_with(BUILTIN) { PathBuf::from(text) } else { self.folder(at).join(text) }
    }

    /// Adds a text; paths in it are relative to `folder`.
    pub fn add(&mut self, name: impl Into<String>, text: impl Into<String>, folder: impl Into<PathBuf>) -> &SourceFile {
        // One byte lies between two files, so that the place just past the end of one is not in the next.
        let base = self.files.last().map_or(0, |last| last.base + last.text.len() + 1);
        self.files.push(SourceFile { name: name.into(), text: text.into(), base, folder: folder.into() });
        self.files.last().expect("it was just pushed")
    }

    /// Adds a file of text; paths in it are relative to its folder. The same file twice has one place, so that a
    /// mistake in a part that is used twice is told once.
    pub fn add_file(&mut self, path: &Path, text: impl Into<String>) -> &SourceFile {
        let (name, text) = (path.display().to_string(), text.into());
        if let Some(at) = self.files.iter().position(|file| file.name == name && file.text == text) {
            return &self.files[at];
        }
        self.add(name, text, path.parent().unwrap_or(Path::new("")))
    }

    /// The text that the place `at` is in.
    ///
    /// # Panics
    /// If there is no text at all.
    #[must_use]
    pub fn file_at(&self, at: usize) -> &SourceFile {
        let after = self.files.partition_point(|file| file.base <= at);
        &self.files[after.saturating_sub(1)]
    }

    /// The folder that paths at `at` are relative to.
    #[must_use]
    pub fn folder(&self, at: usize) -> &Path {
        &self.file_at(at).folder
    }

    /// Returns the location of a span.
    #[must_use]
    pub fn location(&self, span: &Range<usize>) -> Location {
        let file = self.file_at(span.start);
        let (line, column) = file.line_column(span.start);
        let length = file.text[file.local(span)].chars().count();
        Location { file: file.name.clone(), line, column, length }
    }

    /// `file:line:column` of a place.
    #[must_use]
    pub fn locate(&self, at: usize) -> String {
        let file = self.file_at(at);
        let (line, column) = file.line_column(at);
        format!("{}:{line}:{column}", file.name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_builtin_file_is_found_by_its_name_and_on_no_disk() {
        let mut sources = SourceMap::with_builtin(&[("arm.urdf", b"<robot/>")]);
        let base = sources.add_file(Path::new("a/one.toml"), "x = 1").base;
        assert_eq!(sources.builtin(Path::new("arm.urdf")), Ok(None));
        assert_eq!(sources.builtin(Path::new("builtin:arm.urdf")), Ok(Some(b"<robot/>".as_slice())));
        let (message, help) = sources.builtin(Path::new("builtin:arm.udrf")).unwrap_err();
        assert_eq!((message.as_str(), help.as_str()), ("no file `arm.udrf` is built in", "did you mean `arm.urdf`?"));
        assert_eq!(sources.path("b.csv", base), Path::new("a/b.csv"));
        assert_eq!(sources.path("builtin:b.csv", base), Path::new("builtin:b.csv"));
    }

    #[test]
    fn a_location_counts_characters() {
        let mut sources = SourceMap::default();
        sources.add_file(Path::new("a.toml"), "x = 1\n");
        let base = sources.add_file(Path::new("b.toml"), "y = 2\nµ = \"é\"\n").base;
        let expected = Location { file: "b.toml".into(), line: 2, column: 5, length: 3 };
        assert_eq!(sources.location(&(base + 11..base + 15)), expected);
    }

    #[test]
    fn a_place_is_found_in_its_own_text() {
        let mut sources = SourceMap::default();
        sources.add_file(Path::new("a/one.toml"), "x = 1\ny = 2");
        let second = sources.add_file(Path::new("b/two.toml"), "µ = 1\n  z = 2").base;
        assert_eq!(sources.locate(6), "a/one.toml:2:1");
        assert_eq!(sources.locate(11), "a/one.toml:2:6", "just past the end");
        assert_eq!(sources.locate(second), "b/two.toml:1:1");
        assert_eq!(sources.locate(second + 9), "b/two.toml:2:3");
        assert_eq!(sources.folder(second + 3), Path::new("b"));
    }
}
