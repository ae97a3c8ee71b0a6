//! Writes the gains into the graph, and the contacts into the benches. Comments and order stay.

use std::path::Path;

use tactflow_runtime::cli::Shell;
use tactflow_runtime::graph::{Outline, ValueOrigin};
use tactflow_runtime::source::SourceMap;

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
    for (key, [_, gain]) in tuned.gains(outline).filter(|(_, [old, new])| old != new) {
        if let Some(other) = elsewhere(outline, &key, task) {
            return Err(format!("`{key}` is set in `{other}`, over `{}`: change it there", task.display()));
        }
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
    use crate::tool::tune::task::Task;

    #[test]
    fn a_gain_that_a_graph_sets_over_its_part_is_named_with_the_graph() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/carry.toml");
        let part = Path::new(path).with_file_name("parts").join("carry_side.toml");
        let text = std::fs::read_to_string(path).unwrap();
        let set = text.replace("[parts.left]\n", "[parts.left]\nset.pid.gains.force.kp = 1.2\n");
        let found = [text, set].map(|text| {
            let request = Request { text: Some(text), ..Request::file(path) };
            let whole = compile(&crate::catalogue(), &request).unwrap_or_else(|it| panic!("{}", it.render(false)));
            let outline = Task::part("left", part.clone()).outline(whole.outline());
            let of = |key: &str| elsewhere(&outline, &format!("nodes.pid.gains.force.{key}"), &part).map(str::to_owned);
            [of("kp"), of("ki")]
        });
        assert_eq!(found[0], [None, None]);
        assert!(found[1][0].as_ref().unwrap().ends_with("carry.toml") && found[1][1].is_none(), "{found:?}");
    }
}
