//! The source map: all texts of a graph laid end to end, so that one byte range identifies a place in any of them.

use std::borrow::Cow;
use std::cmp::Ordering;
use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::Serialize;

use super::suggest::{is_typing_error, suggest_name, suggestion};

/// One source text.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SourceFile {
    /// Path as the user writes it, or [`SourceMap::COMMAND_LINE`].
    pub name: String,
    /// The text.
    pub text: String,
    /// Offset of its first byte in the source map.
    pub base: usize,
    folder: PathBuf,
    /// Offsets in the text at which its lines begin.
    lines: Vec<usize>,
}

impl SourceFile {
    /// Returns the range of this text in the source map.
    #[must_use]
    pub const fn span(&self) -> Range<usize> {
        self.base..self.base + self.text.len()
    }

    /// Returns whether the text is a file that is built into a catalogue.
    #[must_use]
    pub fn is_builtin(&self) -> bool {
        self.name.starts_with(BUILTIN)
    }

    /// Converts a range of the source map into a range of this text.
    #[must_use]
    pub fn local(&self, span: &Range<usize>) -> Range<usize> {
        let clamp = |at: usize| at.saturating_sub(self.base).min(self.text.len());
        clamp(span.start)..clamp(span.end)
    }

    /// Returns the line and the column of an offset in the source map.
    ///
    /// Both count from 1; the column counts characters.
    #[must_use]
    pub fn line_column(&self, at: usize) -> (usize, usize) {
        let at = self.text.floor_char_boundary(self.local(&(at..at)).start);
        let line = self.line_at(at);
        (line, self.text[self.lines[line - 1]..at].chars().count() + 1)
    }

    /// Returns the number of the line that contains an offset in the text, from 1.
    fn line_at(&self, at: usize) -> usize {
        self.lines.partition_point(|start| *start <= at)
    }

    /// Returns the range of the whole lines around a range of this text, and the number of the first line.
    pub(super) fn lines_around(&self, local: &Range<usize>) -> (Range<usize>, usize) {
        let [first, last] = [local.start, local.end].map(|at| self.line_at(at));
        let end = self.lines.get(last).copied().unwrap_or(self.text.len());
        (self.lines[first - 1]..end, first)
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

/// A file built into a catalogue: its name after `builtin:`, and its bytes.
pub type BuiltinFile = (&'static str, &'static [u8]);

/// The path of a built-in file that does not exist.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UnknownBuiltin {
    /// What is wrong.
    pub message: String,
    /// The path of a built-in file with a similar name.
    pub similar: Option<String>,
    /// The built-in files with similar names, or all of them.
    pub help: String,
}

/// Prefix of the path of a file that is built into a catalogue.
const BUILTIN: &str = "builtin:";

/// Files by their paths, as a recording attaches them.
pub type AttachedFiles = BTreeMap<PathBuf, Vec<u8>>;

/// All texts of a graph: its files and the assignments of the command line.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct SourceMap {
    files: Vec<SourceFile>,
    builtin: Vec<BuiltinFile>,
    /// The files that stand for all files of the disk and of the catalogue, if the graph is that of a recording.
    attached: Option<Arc<AttachedFiles>>,
    /// The files that parameters name.
    named: BTreeSet<PathBuf>,
}

impl SourceMap {
    /// Name of texts from the command line.
    pub const COMMAND_LINE: &str = "command line";

    /// Creates an empty source map with the given built-in files.
    #[must_use]
    pub fn with_builtin(files: &[BuiltinFile]) -> Self {
        Self { builtin: files.to_vec(), ..Self::default() }
    }

    /// Reads no other file than these from now on.
    #[must_use]
    pub fn with_attached(self, files: Arc<AttachedFiles>) -> Self {
        Self { attached: Some(files), ..self }
    }

    /// Returns the bytes of `builtin:NAME`, or `None` if the path is not a built-in one. In the graph of a recording,
    /// returns the bytes of any file that is attached to it.
    ///
    /// # Errors
    /// The message if no built-in file has that name, and the path of one with a similar name or a list of all.
    pub fn builtin(&self, path: &Path) -> Result<Option<Cow<'static, [u8]>>, UnknownBuiltin> {
        if let Some(files) = &self.attached {
            let bytes = files.get(path).map(|bytes| Some(Cow::Owned(bytes.clone())));
            return bytes.ok_or_else(|| UnknownBuiltin {
                message: format!("the recording does not contain `{}`", path.display()),
                similar: None,
                help: "a replay reads only the files that are attached to the recording".into(),
            });
        }
        let Some(name) = path.to_str().and_then(|path| path.strip_prefix(BUILTIN)) else { return Ok(None) };
        match self.builtin.iter().find(|(other, _)| *other == name) {
            Some((_, bytes)) => Ok(Some(Cow::Borrowed(*bytes))),
            None => {
                let known = || self.builtin.iter().map(|(name, _)| *name);
                Err(UnknownBuiltin {
                    message: format!("there is no built-in file `{name}`"),
                    similar: suggest_name(name, known()).map(|name| format!("{BUILTIN}{name}")),
                    help: suggestion(name, known(), "built-in files"),
                })
            }
        }
    }

    /// Returns how often a word occurs in the texts and in the built-in graph files, comments excepted.
    pub(crate) fn occurrences(&self, word: &str) -> usize {
        let builtin = self.builtin.iter().filter(|(name, _)| name.ends_with(".toml"));
        let builtin = builtin.filter_map(|(_, bytes)| std::str::from_utf8(bytes).ok());
        let texts = self.files.iter().map(|file| file.text.as_str()).chain(builtin);
        let is_end = |c: char| !(c.is_ascii_alphanumeric() || c == '_');
        let code = texts.flat_map(str::lines).filter_map(|line| line.split('#').next());
        code.flat_map(|code| code.split(is_end)).filter(|other| *other == word).count()
    }

    /// Returns whether `name` is the misspelt one of two similar names: it occurs less often than `meant`, or as often
    /// and looks like a typing error.
    pub(crate) fn is_misspelt(&self, name: &str, meant: &str) -> bool {
        match self.occurrences(name).cmp(&self.occurrences(meant)) {
            Ordering::Equal => is_typing_error(name, meant),
            order => order.is_lt(),
        }
    }

    /// Resolves a path written at offset `at`, relative to the folder of the file that contains it.
    #[must_use]
    pub fn path(&self, text: &str, at: usize) -> PathBuf {
        match self.file_at(at).name.strip_prefix(BUILTIN) {
            _ if text.starts_with(BUILTIN) || Path::new(text).is_absolute() => PathBuf::from(text),
            Some(name) => PathBuf::from(format!("{BUILTIN}{}", beside(name, text))),
            None => self.folder(at).join(text),
        }
    }

    /// Adds a text whose paths are relative to `folder`.
    pub fn add(&mut self, name: impl Into<String>, text: impl Into<String>, folder: impl Into<PathBuf>) -> &SourceFile {
        // Files are one byte apart: the offset just past the end of one file is not in the next.
        let base = self.files.last().map_or(0, |last| last.base + last.text.len() + 1);
        let text = text.into();
        let lines = std::iter::once(0).chain(text.match_indices('\n').map(|(end, _)| end + 1)).collect();
        self.files.push(SourceFile { name: name.into(), text, base, folder: folder.into(), lines });
        self.files.last().expect("it was just pushed")
    }

    /// Adds a file whose paths are relative to its own folder.
    ///
    /// The same file is stored once, so a mistake in a part that is used twice is reported once.
    pub fn add_file(&mut self, path: &Path, text: impl Into<String>) -> &SourceFile {
        let (name, text) = (path.display().to_string(), text.into());
        if let Some(at) = self.files.iter().position(|file| file.name == name && file.text == text) {
            return &self.files[at];
        }
        self.add(name, text, path.parent().unwrap_or(Path::new("")))
    }

    /// Adds files that parameters name.
    pub(crate) fn add_named(&mut self, files: Vec<PathBuf>) {
        self.named.extend(files);
    }

    /// Returns the files that parameters name, such as calibrations and models. Their contents are not in the source map.
    pub fn named(&self) -> impl Iterator<Item = &Path> {
        self.named.iter().map(PathBuf::as_path)
    }

    /// Returns the texts, in the order in which they were read.
    #[must_use]
    pub fn files(&self) -> &[SourceFile] {
        &self.files
    }

    /// Returns the text that contains the offset `at`.
    ///
    /// # Panics
    /// If the source map is empty.
    #[must_use]
    pub fn file_at(&self, at: usize) -> &SourceFile {
        let after = self.files.partition_point(|file| file.base <= at);
        &self.files[after.saturating_sub(1)]
    }

    /// Returns the folder to which paths written at `at` are relative.
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

    /// Formats an offset as `file:line:column`.
    #[must_use]
    pub fn locate(&self, at: usize) -> String {
        let file = self.file_at(at);
        let (line, column) = file.line_column(at);
        format!("{}:{line}:{column}", file.name)
    }
}

/// Returns the name of a built-in file whose path is written in another one.
fn beside(name: &str, path: &str) -> String {
    let mut folders: Vec<&str> = name.split('/').collect();
    folders.pop();
    for step in path.split('/') {
        match step {
            "." => {}
            ".." => drop(folders.pop()),
            step => folders.push(step),
        }
    }
    folders.join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_builtin_file_is_found_by_its_name_and_on_no_disk() {
        let mut sources = SourceMap::with_builtin(&[("arm.urdf", b"<robot/>")]);
        let base = sources.add_file(Path::new("a/one.toml"), "x = 1").base;
        assert_eq!(sources.builtin(Path::new("arm.urdf")), Ok(None));
        assert_eq!(sources.builtin(Path::new("builtin:arm.urdf")), Ok(Some(b"<robot/>".as_slice().into())));
        let unknown = sources.builtin(Path::new("builtin:arm.udrf")).unwrap_err();
        assert_eq!(unknown.message, "there is no built-in file `arm.udrf`");
        assert_eq!(unknown.similar.as_deref(), Some("builtin:arm.urdf"));
        assert_eq!(unknown.help, "did you mean `arm.urdf`?");
        assert_eq!(sources.path("b.csv", base), Path::new("a/b.csv"));
        assert_eq!(sources.path("builtin:b.csv", base), Path::new("builtin:b.csv"));
        let base = sources.add_file(Path::new("builtin:robots/a.toml"), "").base;
        assert_eq!(sources.path("a.urdf", base), Path::new("builtin:robots/a.urdf"));
        assert_eq!(sources.path("/a.urdf", base), Path::new("/a.urdf"));
        assert_eq!(sources.path("../parts/./b.toml", base), Path::new("builtin:parts/b.toml"));
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
