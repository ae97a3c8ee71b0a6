//! A bench file that is changed in place. Its comments and its order stay.

use std::fs;
use std::path::{Path, PathBuf};

use toml_edit::{Array, DocumentMut, Item, Table, Value};

/// The text of a bench, and what is to be changed in it.
#[derive(Debug, Clone)]
pub(crate) struct BenchFile {
    path: PathBuf,
    /// The text as it was read.
    before: String,
    document: DocumentMut,
    /// The changes as text: the section, and the line.
    changes: Vec<(String, String)>,
}

impl BenchFile {
    /// Reads a bench file.
    ///
    /// # Errors
    /// If it cannot be read, or is no TOML.
    pub(crate) fn read(path: &Path) -> Result<Self, String> {
        let fail = |error: &dyn std::fmt::Display| format!("cannot read `{}`: {error}", path.display());
        let before = fs::read_to_string(path).map_err(|error| fail(&error))?;
        let document = before.parse::<DocumentMut>().map_err(|error| fail(&error))?;
        Ok(Self { path: path.to_owned(), before, document, changes: Vec::new() })
    }

    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Sets a key of a section: of `["devices", "arm"]` for `[devices.arm]`. A comment behind the old value stays.
    ///
    /// # Errors
    /// If something on the way is no table.
    pub(crate) fn set(&mut self, section: &[&str], key: &str, value: impl Into<Value>) -> Result<(), String> {
        let name = section.join(".");
        let fail = || format!("`{name}` of `{}` is not a table that can be changed", self.path.display());
        let mut table: &mut dyn toml_edit::TableLike = self.document.as_table_mut();
        for (depth, part) in section.iter().enumerate() {
            let is_last = depth + 1 == section.len();
            let item = table.entry(part).or_insert_with(|| {
                let mut table = Table::new();
                table.set_implicit(!is_last);
                Item::Table(table)
            });
            table = item.as_table_like_mut().ok_or_else(fail)?;
        }
        let mut value = value.into();
        self.changes.push((name, format!("{key} = {value}")));
        if let Some(old) = table.get(key).and_then(Item::as_value) {
            *value.decor_mut() = old.decor().clone();
        }
        table.insert(key, Item::Value(value));
        Ok(())
    }

    /// Whether nothing is to be changed.
    pub(crate) fn is_unchanged(&self) -> bool {
        self.changes.is_empty()
    }

    /// Returns the changes as lines of TOML.
    pub(crate) fn changes(&self) -> String {
        let mut lines = Vec::new();
        let mut section = "";
        for (name, line) in &self.changes {
            if section != name {
                lines.push(format!("[{name}]"));
                section = name;
            }
            lines.push(line.clone());
        }
        lines.join("\n")
    }

    /// Writes the file. It is replaced as a whole, so that it is never half written.
    ///
    /// # Errors
    /// If it has changed since it was read, or cannot be written.
    pub(crate) fn write(&self) -> Result<(), String> {
        let path = self.path.display();
        let fail = |error: std::io::Error| format!("cannot write `{path}`: {error}");
        // A link stays a link.
        let target = fs::canonicalize(&self.path).map_err(fail)?;
        if fs::read_to_string(&target).map_err(fail)? != self.before {
            return Err(format!("`{path}` was changed by somebody else meanwhile; nothing is written"));
        }
        let new = target.with_extension("toml.new");
        fs::write(&new, self.document.to_string()).map_err(fail)?;
        let kept = fs::metadata(&target).and_then(|metadata| fs::set_permissions(&new, metadata.permissions()));
        kept.and_then(|()| fs::rename(&new, &target)).map_err(fail)
    }
}

/// Returns a list of numbers, each rounded to a number of decimals.
pub(crate) fn numbers(list: &[f64], decimals: i32) -> Array {
    let scale = 10.0_f64.powi(decimals);
    // Adding zero turns -0 into 0.
    list.iter().map(|number| (number * scale).round() / scale + 0.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const BENCH: &str = "# My cell.
[bind]
arm = \"arm\"

[devices.arm]
type = \"ur\"
home = [0, 0, 0, 0, 0, 0] # yours

# Of the cell.
[limits]
linear_m_per_s = 0.05
";

    fn file(name: &str) -> PathBuf {
        let path = std::env::temp_dir().join(format!("tactflow-bench-{name}-{}.toml", std::process::id()));
        fs::write(&path, BENCH).expect("a file");
        path
    }

    #[test]
    fn comments_and_order_stay() {
        let path = file("order");
        let mut bench = BenchFile::read(&path).expect("it is TOML");
        assert!(bench.is_unchanged());
        bench.set(&["devices", "arm"], "home", numbers(&[0.123_46, -1e-9], 4)).expect("a table");
        bench.set(&["limits"], "workspace_min_m", numbers(&[0.1], 4)).expect("a table");
        bench.set(&["limits", "left"], "linear_m_per_s", 0.01).expect("a table");
        let changes = "[devices.arm]\nhome = [0.1235, 0.0]\n[limits]\nworkspace_min_m = [0.1]\n[limits.left]\nlinear_m_per_s = 0.01";
        assert_eq!(bench.changes(), changes);
        assert_eq!(fs::read_to_string(&path).expect("it is there"), BENCH);
        bench.write().expect("it is written");
        let expected = BENCH
            .replace("[0, 0, 0, 0, 0, 0]", "[0.1235, 0.0]")
            .replace("= 0.05\n", "= 0.05\nworkspace_min_m = [0.1]\n\n[limits.left]\nlinear_m_per_s = 0.01\n");
        assert_eq!(fs::read_to_string(&path).expect("it is there"), expected);
        assert!(bench.write().expect_err("it has changed").contains("was changed by somebody else"));
        fs::remove_file(path).expect("it is there");
    }

    #[test]
    fn a_section_that_is_no_table_is_refused() {
        let path = file("table");
        let mut bench = BenchFile::read(&path).expect("it is TOML");
        let message = bench.set(&["bind", "arm"], "home", 1).expect_err("a text");
        assert!(message.starts_with("`bind.arm` of"), "{message}");
        fs::remove_file(path).expect("it is there");
    }
}
