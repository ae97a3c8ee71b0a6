//! Where a run writes a file: a path, a pipe or standard output.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

use crate::cli::shell::{Shell, standard_output};
use crate::record::OutputFile;

/// Whether a path stands for standard output.
pub(crate) fn is_stdout(path: &Path) -> bool {
    path == Path::new("-") || path == Path::new("/dev/stdout")
}

/// Whether a path is a pipe or a device, whose name says nothing about the format.
pub(crate) fn is_special(path: &Path) -> bool {
    is_stdout(path) || fs::metadata(path).is_ok_and(|file| !file.is_file() && !file.is_dir())
}

/// Opens a file, and waits for the reader of a pipe. An existing file is overwritten only if it starts with one of
/// `starts`, the first bytes of `what`.
///
/// # Errors
/// Returns a message if the file cannot be created, or is of another sort.
pub(crate) fn open(path: &Path, starts: &[&str], what: &str, shell: &Shell) -> Result<OutputFile, String> {
    let opened = if is_stdout(path) {
        standard_output().map(OutputFile::from)
    } else {
        refuse_other(path, starts, what)?;
        open_path(path, shell)
    };
    opened.map_err(|error| format!("cannot create `{}`: {error}", path.display()))
}

/// Refuses to overwrite a file that does not begin like the output of a run, such as a recording that is being played.
fn refuse_other(path: &Path, starts: &[&str], what: &str) -> Result<(), String> {
    // A pipe has nothing to overwrite, and reading it waits for its writer.
    if is_special(path) {
        return Ok(());
    }
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(16).read_to_end(&mut start));
    if read.is_ok() && !start.is_empty() && !starts.iter().any(|known| start.starts_with(known.as_bytes())) {
        return Err(format!(
            "`{}` exists and is not {what}, so it is not overwritten: write to another file",
            path.display()
        ));
    }
    Ok(())
}

/// Opens a path. If it is a pipe without a reader, says so and waits for one.
#[cfg(unix)]
fn open_path(path: &Path, shell: &Shell) -> io::Result<OutputFile> {
    use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};

    use nix::fcntl::OFlag;
    use nix::libc::ENXIO;

    if !fs::metadata(path).is_ok_and(|file| file.file_type().is_fifo()) {
        return OutputFile::create(path);
    }
    let options = || File::options().write(true).to_owned();
    let probe = options().custom_flags(OFlag::O_NONBLOCK.bits()).open(path);
    if probe.as_ref().is_err_and(|error| error.raw_os_error() == Some(ENXIO)) {
        shell.say_beside(&format!("waiting for a reader of the pipe `{}`; Ctrl-C ends the wait", path.display()));
    }
    // A reader that is there already sees one writer without a gap, because the probe stays open.
    let opened = options().open(path)?;
    drop(probe);
    Ok(opened.into())
}

#[cfg(not(unix))]
fn open_path(path: &Path, _: &Shell) -> io::Result<OutputFile> {
    OutputFile::create(path)
}
