//! All files that a graph has read, so that it can be loaded again when the disk has others.

use std::path::{Path, PathBuf};

use super::map::{AttachedFiles, SourceMap};

impl SourceMap {
    /// Returns all files that a graph has read: its texts, and the files that parameters name.
    ///
    /// # Errors
    /// If a file that a parameter names cannot be read again.
    pub(crate) fn attach(&self) -> Result<AttachedFiles, String> {
        let texts = self.files().iter().filter(|file| file.name != Self::COMMAND_LINE);
        let mut files: AttachedFiles =
            texts.map(|file| (PathBuf::from(&file.name), file.text.clone().into_bytes())).collect();
        for path in self.named() {
            if !files.contains_key(path) {
                files.insert(path.to_owned(), self.read(path)?);
            }
        }
        Ok(files)
    }

    fn read(&self, path: &Path) -> Result<Vec<u8>, String> {
        match self.builtin(path) {
            Ok(Some(bytes)) => Ok(bytes.into_owned()),
            Ok(None) => std::fs::read(path).map_err(|error| format!("cannot attach `{}`: {error}", path.display())),
            Err(unknown) => Err(unknown.message),
        }
    }
}
