//! Writes the gains into the graph, and the contacts into the benches. Comments and order stay.

use tactflow_runtime::cli::Shell;
use tactflow_runtime::graph::Outline;

use super::TuneArgs;
use super::cases::Stated;
use super::contact_tables::{CONTACTS, tables};
use super::tuned::Tuned;
use crate::tool::guided::BenchFile;

/// Writes all files, and returns what was written. The outline is that of the task.
///
/// # Errors
/// If a file cannot be changed; then nothing is written.
pub(super) fn save(args: &TuneArgs, outline: &Outline, tuned: &Tuned, shell: &Shell) -> Result<String, String> {
    let task = tuned.task.file().unwrap_or(&args.graph);
    let mut graph = BenchFile::read(task)?;
    for (key, gain) in tuned.gains(outline) {
        let path: Vec<&str> = key.split('.').collect();
        let Some((last, section)) = path.split_last() else { continue };
        graph.set(section, last, gain)?;
    }
    for range in &tuned.ranges {
        let path: Vec<&str> = ["live"].into_iter().chain(range.name.split('.')).collect();
        let Some((last, section)) = path.split_last() else { continue };
        graph.set(section, last, range.value())?;
    }
    let mut files = vec![graph];
    for Stated { file: bench, contacts } in tuned.stated() {
        let Some(bench) = bench else { continue };
        // A graph can have its own devices.
        let is_graph = bench == *task;
        if !is_graph {
            files.push(BenchFile::read(&bench)?);
        }
        let Some(file) = (if is_graph { files.first_mut() } else { files.last_mut() }) else { continue };
        file.set_tables(&["facts", &tuned.arm], CONTACTS, tables(&contacts))?;
        if !is_graph {
            file.check(shell.catalogue())?;
        }
    }
    files.iter().try_for_each(BenchFile::write)?;
    let written = files.iter().map(|file| format!("wrote {}:\n{}\n", file.path().display(), file.changes()));
    Ok(written.collect::<String>().trim_end().to_owned())
}
