//! A file that takes the place of another one as a whole.

use std::fs::{self, File, OpenOptions};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

/// Number of names that are tried.
const MAX_NAMES: u32 = 100;

/// A new file beside another one. It is removed when this value is dropped.
pub(super) struct Temporary {
    path: PathBuf,
    file: File,
    is_there: bool,
}

impl Temporary {
    /// Writes a text into a new file in the folder of `beside`. No file that exists is opened, and no link is followed.
    ///
    /// # Errors
    /// If no file can be created or written there.
    pub(super) fn write(beside: &Path, text: &str) -> io::Result<Self> {
        let name = beside.file_name().unwrap_or_default().to_string_lossy();
        for number in 0..MAX_NAMES {
            let path = beside.with_file_name(format!(".{name}.{}-{number}.new", std::process::id()));
            match OpenOptions::new().write(true).create_new(true).open(&path) {
                Ok(file) => {
                    let mut new = Self { path, file, is_there: true };
                    new.file.write_all(text.as_bytes())?;
                    return Ok(new);
                }
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error),
            }
        }
        Err(io::Error::other(format!("{MAX_NAMES} temporary files are in its folder already")))
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Replaces a file of the same folder. The permissions stay, and the text is on the disk before the name changes.
    ///
    /// # Errors
    /// If the file cannot be replaced.
    pub(super) fn replace(mut self, target: &Path) -> io::Result<()> {
        self.file.set_permissions(fs::metadata(target)?.permissions())?;
        self.file.sync_all()?;
        fs::rename(&self.path, target)?;
        self.is_there = false;
        Ok(())
    }
}

impl Drop for Temporary {
    fn drop(&mut self) {
        if self.is_there {
            // It may be gone already.
            let _ = fs::remove_file(&self.path);
        }
    }
}
