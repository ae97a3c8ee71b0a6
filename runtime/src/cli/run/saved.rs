//! The files of a graph, and which of them was saved since it was read.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::thread::sleep;
use std::time::{Duration, Instant, SystemTime};

use crate::engine::Interrupt;
use crate::source::SourceMap;

/// Time between two looks at the files.
const LOOK: Duration = Duration::from_millis(200);
/// Time for which a file must stay as it is before it counts as saved: an editor may write it in several steps.
const SETTLE: Duration = Duration::from_millis(50);

/// Size and time of a file; `None` while there is none.
type State = Option<(u64, Option<SystemTime>)>;

fn state(path: &Path) -> State {
    fs::metadata(path).ok().map(|file| (file.len(), file.modified().ok()))
}

/// The files of a graph, and how they were when they were read.
#[derive(Debug)]
pub(super) struct SavedFiles {
    files: BTreeMap<PathBuf, State>,
    looked: Instant,
}

impl SavedFiles {
    /// Follows the file of a graph, and each file that it turns out to read.
    pub(super) fn new(graph: &Path) -> Self {
        let files = BTreeMap::from([(graph.to_owned(), state(graph))]);
        Self { files, looked: Instant::now() }
    }

    /// Takes the files as they are now: they are about to be read.
    pub(super) fn begin(&mut self) {
        self.files.iter_mut().for_each(|(path, known)| *known = state(path));
    }

    /// Adds the files that a graph has read. Files that an earlier version has read stay: a mistake may hide them.
    pub(super) fn follow(&mut self, sources: &SourceMap) {
        let texts = sources.files().iter().map(|file| Path::new(&file.name));
        for path in texts.chain(sources.named()).filter(|path| path.exists()) {
            self.files.entry(path.to_owned()).or_insert_with(|| state(path));
        }
    }

    /// Returns a file that was saved since it was read, if it is time to look. A file that is gone for a moment does not
    /// count: some editors delete it and write a new one.
    pub(super) fn saved(&mut self) -> Option<PathBuf> {
        if self.looked.elapsed() < LOOK {
            return None;
        }
        self.looked = Instant::now();
        let is_saved = |(path, known): &(&PathBuf, &State)| {
            let now = state(path);
            now.is_some() && now != **known
        };
        let (path, _) = self.files.iter().find(is_saved)?;
        let path = path.clone();
        let mut seen = state(&path);
        loop {
            sleep(SETTLE);
            let now = state(&path);
            if now == seen {
                return Some(path);
            }
            seen = now;
        }
    }

    /// Waits until a file is saved. Returns `None` if a signal ends the wait.
    pub(super) fn wait(&mut self, interrupt: &Interrupt) -> Option<PathBuf> {
        loop {
            if interrupt.is_requested() {
                return None;
            }
            if let Some(path) = self.saved() {
                return Some(path);
            }
            sleep(SETTLE);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Looks at once.
    fn saved(files: &mut SavedFiles) -> Option<PathBuf> {
        files.looked = Instant::now() - LOOK;
        files.saved()
    }

    #[test]
    fn a_file_is_saved_when_it_has_changed_and_is_there() {
        let folder = tempfile::tempdir().unwrap();
        let [graph, new] = ["graph.toml", "new.toml"].map(|name| folder.path().join(name));
        fs::write(&graph, "a = 1").unwrap();
        let mut files = SavedFiles::new(&graph);
        assert_eq!(saved(&mut files), None);
        fs::write(&graph, "a = 12").unwrap();
        assert_eq!(saved(&mut files), Some(graph.clone()));
        assert_eq!(files.saved(), None, "it is not yet time to look");
        files.begin();
        assert_eq!(saved(&mut files), None);
        // An editor that deletes the file, and one that replaces it.
        fs::remove_file(&graph).unwrap();
        assert_eq!(saved(&mut files), None);
        fs::write(&new, "a = 123").unwrap();
        fs::rename(&new, &graph).unwrap();
        assert_eq!(saved(&mut files), Some(graph));
    }

    #[test]
    fn the_files_that_a_graph_reads_are_followed() {
        let folder = tempfile::tempdir().unwrap();
        let [graph, part] = ["graph.toml", "part.toml"].map(|name| folder.path().join(name));
        fs::write(&graph, "").unwrap();
        fs::write(&part, "").unwrap();
        let mut files = SavedFiles::new(&graph);
        let mut sources = SourceMap::default();
        sources.add_file(&part, "");
        sources.add(SourceMap::COMMAND_LINE, "x", "");
        files.follow(&sources);
        assert_eq!(files.files.len(), 2);
        fs::write(&part, "b = 1").unwrap();
        assert_eq!(saved(&mut files), Some(part));
    }
}
