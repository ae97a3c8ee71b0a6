//! Writes the gains into the graph, and the contacts into the benches. Comments and order stay.

use tactflow_runtime::cli::Shell;
use tactflow_runtime::graph::Outline;
use toml_edit::{Array, InlineTable, Value};

use super::{TuneArgs, Tuned, experiment};
use crate::tool::control::contacts::{Answer, Contact};
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
        for ((key, old), gain) in
            ["kp", "ki", "kd"].into_iter().zip(one.old).zip(new).filter(|((_, old), new)| old != new)
        {
            let _ = old;
            let path = experiment::gain_key(pid, &one.name, key, mode);
            let path: Vec<&str> = path.split('.').collect();
            let Some((last, section)) = path.split_last() else { continue };
            graph.set(section, last, gain)?;
        }
    }
    let mut files = vec![graph];
    // A bench that was measured with several settings has a contact for each.
    let measured =
        tuned.files.iter().zip(&tuned.contacts).filter_map(|(file, contact)| Some((file.as_ref()?, contact)));
    let measured: Vec<_> = measured.collect();
    for same in measured.chunk_by(|(one, _), (other, _)| one == other) {
        let Some((bench, _)) = same.first() else { continue };
        // A graph can have its own devices.
        let is_graph = **bench == args.graph;
        if !is_graph {
            files.push(BenchFile::read(bench)?);
        }
        let Some(file) = (if is_graph { files.first_mut() } else { files.last_mut() }) else { continue };
        file.set(&["facts", &tuned.arm], "contacts", Array::from_iter(same.iter().map(|(_, contact)| value(contact))))?;
        if !is_graph {
            file.check(shell.catalogue())?;
        }
    }
    files.iter().try_for_each(BenchFile::write)?;
    let written = files.iter().map(|file| format!("wrote {}:\n{}\n", file.path().display(), file.changes()));
    Ok(written.collect::<String>().trim_end().to_owned())
}

/// Writes a contact as an inline table.
pub(super) fn value(contact: &Contact) -> Value {
    let mut table = InlineTable::new();
    table.insert("object", contact.object.as_str().into());
    for (feature, answer) in &contact.features {
        table.insert(feature, inline(answer));
    }
    table.into()
}

fn inline(answer: &Answer) -> Value {
    let Answer { vx, vy, vz, wx, wy, wz, resonance_hz, damping_ratio, latency_ms } = *answer;
    let keys = [
        ("vx", vx),
        ("vy", vy),
        ("vz", vz),
        ("wx", wx),
        ("wy", wy),
        ("wz", wz),
        ("resonance_hz", resonance_hz),
        ("damping_ratio", damping_ratio),
        ("latency_ms", latency_ms),
    ];
    let mut table = InlineTable::new();
    for (key, value) in keys.into_iter().filter_map(|(key, value)| Some((key, value?))) {
        table.insert(key, value.into());
    }
    table.into()
}
