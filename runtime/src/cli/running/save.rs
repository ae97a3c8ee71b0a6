//! `set --save`: writes values to the graph file that has defined them. Its comments and its layout stay.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use toml_edit::{DocumentMut, Formatted, Item, TableLike, Value};

use crate::socket::{Ask, Client, Got, Origin};

/// Files that are about to be written.
pub(super) struct Save {
    files: BTreeMap<PathBuf, TextFile>,
    lines: Vec<String>,
}

/// A text file before and after.
struct TextFile {
    before: String,
    document: DocumentMut,
}

impl Save {
    /// Asks the run where the values are written, and changes them in memory.
    ///
    /// # Errors
    /// If one of them is not written in the graph file, or the file cannot be written.
    pub(super) fn prepare(client: &mut Client, values: &BTreeMap<String, f64>) -> Result<Self, String> {
        let mut save = Self { files: BTreeMap::new(), lines: Vec::new() };
        for (name, value) in values {
            let got: Result<Got, String> = client.ask(&Ask::Get { pattern: Some(name.clone()) });
            // The run says what is wrong with a name when it is set.
            let Ok(Got { live, .. }) = got else { continue };
            let Some(live) = live.into_iter().find(|live| live.name == *name) else { continue };
            save.change(name, &live.origin, *value)?;
        }
        Ok(save)
    }

    /// Changes a value in memory.
    fn change(&mut self, name: &str, origin: &Origin, value: f64) -> Result<(), String> {
        let no = |why: String| Err(format!("`{name}` cannot be saved: {why}"));
        let (file, keys) = match origin {
            Origin::Graph { file, keys } => (PathBuf::from(file), keys),
            Origin::Other { file, line } => {
                return no(format!(
                    "its value comes from `{file}`, line {line}, which other graphs may use: change it there by hand"
                ));
            }
            Origin::CommandLine => {
                return no(format!(
                    "its value comes from `--set` of the run: start it with `--set nodes.{name}={value}`"
                ));
            }
            Origin::Default => {
                return no("its value is the default, so no file has it: add it to the graph by hand".into());
            }
            Origin::Fact { fact } => {
                return no(format!("its value is the fact `{fact}` of a device: change the bench"));
            }
        };
        let text = match self.files.remove(&file) {
            Some(text) => text,
            None => TextFile::read(&file)?,
        };
        let text = self.files.entry(file.clone()).or_insert(text);
        let shown = file.display();
        let old = text.set(keys, value).ok_or_else(|| {
            format!(
                "`{name}` cannot be saved: `{shown}` has no number at `{}` any more: change it by hand",
                keys.join(".")
            )
        })?;
        self.lines.push(format!("saved {} = {value} (before: {old}) to {shown}", keys.join(".")));
        Ok(())
    }

    /// Writes the files, each as a whole. Returns what is written.
    ///
    /// # Errors
    /// If one has changed meanwhile, or cannot be written.
    pub(super) fn write(&self) -> Result<String, String> {
        for (path, file) in &self.files {
            file.write(path)?;
        }
        Ok(self.lines.join("\n"))
    }
}

impl TextFile {
    fn read(path: &Path) -> Result<Self, String> {
        let fail = |error: &dyn std::fmt::Display| format!("cannot read `{}`: {error}", path.display());
        let before = fs::read_to_string(path).map_err(|error| fail(&error))?;
        let document = before.parse::<DocumentMut>().map_err(|error| fail(&error))?;
        let metadata = fs::metadata(path).map_err(|error| fail(&error))?;
        if metadata.permissions().readonly() {
            return Err(format!("`{0}` is read-only: make it writable with `chmod u+w {0}`", path.display()));
        }
        Ok(Self { before, document })
    }

    /// Replaces a number, and returns the old one. `None` if there is no number.
    fn set(&mut self, keys: &[String], value: f64) -> Option<f64> {
        let (last, way) = keys.split_last()?;
        let mut table: &mut dyn TableLike = self.document.as_table_mut();
        for key in way {
            table = table.get_mut(key)?.as_table_like_mut()?;
        }
        let old = table.get_mut(last).and_then(Item::as_value_mut)?;
        let number = old.as_float().or_else(|| old.as_integer().map(|number| number as f64))?;
        let mut new = Value::Float(Formatted::new(value));
        *new.decor_mut() = old.decor().clone();
        *old = new;
        Some(number)
    }

    fn text(&self) -> String {
        let text = self.document.to_string();
        // The line ends of the file stay.
        if self.before.contains("\r\n") { text.replace("\r\n", "\n").replace('\n', "\r\n") } else { text }
    }

    /// Writes the file as a whole, so that it is never half written.
    fn write(&self, path: &Path) -> Result<(), String> {
        let fail = |error: std::io::Error| format!("cannot write `{}`: {error}", path.display());
        // A link stays a link.
        let target = fs::canonicalize(path).map_err(fail)?;
        if fs::read_to_string(&target).map_err(fail)? != self.before {
            return Err(format!("`{}` was changed by somebody else meanwhile", path.display()));
        }
        let folder = target.parent().unwrap_or(Path::new("."));
        let mut new = tempfile::Builder::new().prefix(".tactflow.").suffix(".new").tempfile_in(folder).map_err(fail)?;
        new.write_all(self.text().as_bytes()).map_err(fail)?;
        let permissions = fs::metadata(&target).map_err(fail)?.permissions();
        new.as_file().set_permissions(permissions).and_then(|()| new.as_file().sync_all()).map_err(fail)?;
        new.persist(&target).map(drop).map_err(|error| fail(error.error))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(text: &str) -> TextFile {
        TextFile { before: text.into(), document: text.parse().expect("it is TOML") }
    }

    fn keys(path: &str) -> Vec<String> {
        path.split('.').map(str::to_owned).collect()
    }

    #[test]
    fn comments_and_layout_stay() {
        let text = "# mine\n[nodes.pid]   # law\ngains.x = { kp = 3.5,  ki = 1 } # both\n\n[nodes.pid.gains.y]\nkp   =  4 # N\n";
        let mut changed = file(text);
        assert_eq!(changed.set(&keys("nodes.pid.gains.x.kp"), 2.0), Some(3.5));
        assert_eq!(changed.set(&keys("nodes.pid.gains.y.kp"), 0.25), Some(4.0));
        assert_eq!(changed.text(), text.replace("3.5", "2.0").replace("4 # N", "0.25 # N"));
        assert_eq!(changed.set(&keys("nodes.pid.gains.z.kp"), 2.0), None);
        assert_eq!(file("[nodes.pid]\nkp = \"1 mm\"\n").set(&keys("nodes.pid.kp"), 2.0), None);
    }

    #[test]
    fn line_ends_stay() {
        let mut changed = file("[nodes.pid]\r\nkp = 1.0\r\n");
        assert_eq!(changed.set(&keys("nodes.pid.kp"), 2.5), Some(1.0));
        assert_eq!(changed.text(), "[nodes.pid]\r\nkp = 2.5\r\n");
    }
}
