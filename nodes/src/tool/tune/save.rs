//! Writes the gains into the graph, and the contacts into the benches. Comments and order stay.

use tactflow_runtime::cli::Shell;
use tactflow_runtime::graph::Outline;

use super::cases::Stated;
use super::contact_tables::{CONTACTS, tables};
use super::tuned::Tuned;
use super::{TuneArgs, gain_keys};
use crate::tool::guided::BenchFile;

/// Writes all files, and returns what was written.
///
/// # Errors
/// If a file cannot be changed; then nothing is written.
pub(super) fn save(args: &TuneArgs, outline: &Outline, tuned: &Tuned, shell: &Shell) -> Result<String, String> {
    let mut graph = BenchFile::read(&args.graph)?;
    let mode = outline.modes.iter().find(|mode| mode.name == tuned.mode);
    for one in &tuned.features {
        let (Some(pid), Some(mode), Some(new)) = (&one.feature.pid, mode, one.new) else { continue };
        let keys = ["kp", "ki", "kd"].into_iter().zip(one.old).zip(new);
        for (key, gain) in keys.filter(|((_, old), new)| old != new).map(|((key, _), gain)| (key, gain)) {
            let path = gain_keys::gain_key(pid, &one.name, key, mode);
            let path: Vec<&str> = path.split('.').collect();
            let Some((last, section)) = path.split_last() else { continue };
            graph.set(section, last, gain)?;
        }
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
        let is_graph = bench == args.graph;
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
