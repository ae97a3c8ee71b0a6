//! Where a run writes a file: a path, a pipe or standard output.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use crate::cli::shell::{Shell, standard_output};
use crate::engine::Interrupt;
use crate::record::OutputFile;

/// Whether a path stands for standard output.
pub(crate) fn is_stdout(path: &Path) -> bool {
    path == Path::new("-") || path == Path::new("/dev/stdout")
}

/// Whether a path is a pipe or a device, whose name says nothing about the format.
pub(crate) fn is_special(path: &Path) -> bool {
    is_stdout(path) || fs::metadata(path).is_ok_and(|file| !file.is_file() && !file.is_dir())
}

/// Returns the path of a file of a further run: `run-2.csv` beside `run.csv`, or the next number of which there is none. A
/// pipe or a device is the same for all runs.
pub(crate) fn numbered(path: &Path) -> PathBuf {
    let (Some(stem), false) = (path.file_stem(), is_special(path)) else { return path.to_owned() };
    let named = |n: usize| {
        let mut name = stem.to_owned();
        name.push(format!("-{n}"));
        if let Some(extension) = path.extension() {
            name.push(".");
            name.push(extension);
        }
        path.with_file_name(name)
    };
    (2..).map(named).find(|path| !path.exists()).expect("there are fewer files than numbers")
}

/// Opens a file without removing its content, and waits for the reader of a pipe. An existing file is accepted only if
/// it starts with one of `starts`, the first bytes of `what`.
///
/// # Errors
/// Returns a message if the file cannot be created, or is of another sort, or if a signal ends the wait.
pub(crate) fn open(
    path: &Path,
    starts: &[&[u8]],
    what: &str,
    interrupt: &Interrupt,
    shell: &Shell,
) -> Result<OutputFile, String> {
    let cannot = |error: io::Error| format!("cannot create `{}`: {error}", path.display());
    if is_stdout(path) {
        return standard_output().map(OutputFile::from).map_err(cannot);
    }
    refuse_other(path, starts, what)?;
    open_path(path, interrupt, shell).map_err(cannot)
}

/// Removes the content of a file that was opened; standard output may be a file to which others write too.
///
/// # Errors
/// Returns a message if that is not possible.
pub(crate) fn clear(path: &Path, file: &OutputFile) -> Result<(), String> {
    if is_stdout(path) {
        return Ok(());
    }
    file.clear().map_err(|error| format!("cannot create `{}`: {error}", path.display()))
}

/// Refuses to overwrite a file that does not begin like the output of a run, such as a recording that is being played.
///
/// # Errors
/// Returns a message if it does not.
pub(crate) fn refuse_other(path: &Path, starts: &[&[u8]], what: &str) -> Result<(), String> {
    // A pipe has nothing to overwrite, and reading it waits for its writer.
    if is_special(path) {
        return Ok(());
    }
    let mut start = Vec::new();
    let read = File::open(path).and_then(|file| file.take(16).read_to_end(&mut start));
    if read.is_ok() && !start.is_empty() && !starts.iter().any(|known| start.starts_with(known)) {
        return Err(format!(
            "`{}` exists and is not {what}, so it is not overwritten: write to another file",
            path.display()
        ));
    }
    Ok(())
}

/// Opens a path. If it is a pipe without a reader, prints that it waits, and waits until a program opens the pipe for
/// reading or a signal ends the wait.
#[cfg(unix)]
fn open_path(path: &Path, interrupt: &Interrupt, shell: &Shell) -> io::Result<OutputFile> {
    use std::os::unix::fs::{FileTypeExt, OpenOptionsExt};
    use std::time::Duration;

    use nix::fcntl::{FcntlArg, OFlag, fcntl};
    use nix::libc::ENXIO;

    /// Interval at which a pipe is tried again.
    const RETRY_INTERVAL: Duration = Duration::from_millis(20);

    if !fs::metadata(path).is_ok_and(|file| file.file_type().is_fifo()) {
        return OutputFile::open(path);
    }
    let try_open = || File::options().write(true).custom_flags(OFlag::O_NONBLOCK.bits()).open(path);
    let has_no_reader =
        |opened: &io::Result<File>| opened.as_ref().is_err_and(|error| error.raw_os_error() == Some(ENXIO));
    let mut opened = try_open();
    if has_no_reader(&opened) {
        shell.say_beside(&format!("waiting for a reader of the pipe `{}`; Ctrl-C ends the wait", path.display()));
    }
    while has_no_reader(&opened) {
        if let Some(signal) = interrupt.signal() {
            return Err(io::Error::other(format!("{signal} ended the wait for a reader of the pipe")));
        }
        std::thread::sleep(RETRY_INTERVAL);
        opened = try_open();
    }
    let file = opened?;
    fcntl(&file, FcntlArg::F_SETFL(OFlag::empty()))?;
    Ok(file.into())
}

#[cfg(not(unix))]
fn open_path(path: &Path, _: &Interrupt, _: &Shell) -> io::Result<OutputFile> {
    OutputFile::open(path)
}
