//! Writes the gains into the graph, and the contacts into the benches. Comments and order stay.

use std::path::Path;

use tactflow_runtime::cli::Shell;
use tactflow_runtime::graph::{Outline, OutlinedMode, ValueOrigin};
use tactflow_runtime::source::SourceMap;

use super::cases::Stated;
use super::contact_tables::{CONTACTS, tables};
use super::task::Task;
use super::tuned::Tuned;
use super::{TuneArgs, gain_keys};
use crate::tool::control::law::Feature;
use crate::tool::guided::TomlFile;

/// Writes all files, and returns what was written. The outline is that of the task.
///
/// # Errors
/// If a file cannot be changed; then nothing is written.
pub(super) fn save(args: &TuneArgs, outline: &Outline, tuned: &Tuned, shell: &Shell) -> Result<String, String> {
    let task = tuned.task.file().unwrap_or(&args.graph);
    let mut graph = TomlFile::read(task)?;
    for (key, [_, gain]) in tuned.gains(outline).filter(|(_, [old, new])| old != new) {
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
            files.push(TomlFile::read(&bench)?);
        }
        let Some(file) = (if is_graph { files.first_mut() } else { files.last_mut() }) else { continue };
        file.set_tables(&["facts", &tuned.arm], CONTACTS, tables(&contacts))?;
        if !is_graph {
            file.check(shell.catalogue())?;
        }
    }
    files.iter().try_for_each(TomlFile::write)?;
    let written = files.iter().map(|file| format!("wrote {}:\n{}\n", file.path().display(), file.changes()));
    Ok(written.collect::<String>().trim_end().to_owned())
}

/// Checks before the long measurement that the gains of a part stand in its file, and not in the `set` of a part that uses
/// it. The outline is that of the graph.
///
/// # Errors
/// If another file sets one of them.
pub(super) fn is_possible(
    outline: &Outline,
    task: &Task,
    mode: &OutlinedMode,
    features: &[Feature],
) -> Result<(), String> {
    let Some(file) = task.file() else { return Ok(()) };
    for part in task.alike(outline) {
        let own = part.outline(outline);
        let pids = features.iter().filter_map(|feature| Some((&feature.name, feature.pid.as_ref()?)));
        let keys = pids.flat_map(|(name, pid)| ["kp", "ki", "kd"].map(|key| gain_keys::gain_key(pid, name, key, mode)));
        for key in keys {
            if let Some(other) = elsewhere(&own, &key, file) {
                let (part, file) = (part.port(&key), file.display());
                return Err(format!(
                    "`{part}` is set in `{other}`, over `{file}`: remove it there, so that it can be saved"
                ));
            }
        }
    }
    Ok(())
}

/// Returns the file that sets a gain instead of the file of the task, as the `set` of a part does.
fn elsewhere<'o>(outline: &'o Outline, key: &str, task: &Path) -> Option<&'o str> {
    let nodes = outline.nodes.iter().map(|node| ("nodes", &node.name, &node.settings));
    let modes = outline.modes.iter().map(|mode| ("modes", &mode.name, &mode.settings));
    let settings = nodes.chain(modes).flat_map(|(section, name, settings)| {
        settings.iter().map(move |setting| (format!("{section}.{name}.{}", setting.path), setting))
    });
    let (_, setting) = settings.into_iter().find(|(path, _)| path == key)?;
    let ValueOrigin::Written { place } = &setting.origin else { return None };
    let is_of_task = Path::new(&place.file).canonicalize().ok() == task.canonicalize().ok();
    (!is_of_task && place.file != SourceMap::COMMAND_LINE).then_some(&*place.file)
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::graph::{Request, compile};

    use super::*;

    #[test]
    fn a_gain_that_a_graph_sets_over_its_part_is_named_with_the_graph() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/carry.toml");
        let text = std::fs::read_to_string(path).unwrap();
        let saves = |text: String| {
            let request = Request { text: Some(text), ..Request::file(path) };
            let whole = compile(&crate::catalogue(), &request).unwrap_or_else(|it| panic!("{}", it.render(false)));
            let whole = whole.outline();
            let file = &whole.nodes.iter().find(|node| node.name == "left.pid").unwrap().place.file;
            let task = Task::part("left", file.into());
            let outline = task.outline(whole);
            let mode = outline.modes.iter().find(|mode| mode.name == "hold").unwrap();
            let feature = Feature { name: "force".into(), pid: Some("pid".into()), ..Feature::default() };
            is_possible(whole, &task, mode, &[feature])
        };
        assert_eq!(saves(text.clone()), Ok(()));
        // The file is that of both parts.
        for side in ["left", "right"] {
            let head = format!("[parts.{side}]\n");
            let why = saves(text.replace(&head, &format!("{head}set.pid.gains.force.kp = 1.2\n"))).unwrap_err();
            let start = format!("`{side}.nodes.pid.gains.force.kp` is set in");
            assert!(why.starts_with(&start) && why.contains("carry.toml"), "{why}");
        }
    }
}
