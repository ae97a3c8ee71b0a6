//! A TOML file, such as a bench or a graph, that is changed in place. Its comments and its order stay.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::graph::open_bench;
use tactflow_runtime::signal::Joint;
use tempfile::NamedTempFile;
use toml_edit::{Array, ArrayOfTables, DocumentMut, Item, Table, TableLike, Value};

use super::tables::{comments, headed, update};

/// The text of a file, and what is to be changed in it.
#[derive(Debug, Clone)]
pub(crate) struct TomlFile {
    path: PathBuf,
    /// The text as it was read.
    before: String,
    document: DocumentMut,
    /// The changes as text: the section, and the line.
    changes: Vec<(String, String)>,
}

impl TomlFile {
    /// Reads a file.
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

    /// Returns the values of the file as it was read.
    ///
    /// # Errors
    /// If it is no TOML.
    pub(crate) fn values(&self) -> Result<toml::Value, String> {
        toml::from_str(&self.before).map_err(|error| format!("cannot read `{}`: {error}", self.path.display()))
    }

    /// Sets a key of a section: of `["devices", "arm"]` for `[devices.arm]`. A comment behind the old value stays.
    ///
    /// # Errors
    /// If something on the way is no table.
    pub(crate) fn set(&mut self, section: &[&str], key: &str, value: impl Into<Value>) -> Result<(), String> {
        let table = self.table(section)?;
        let mut value = value.into();
        let line = format!("{key} = {value}");
        if let Some(old) = table.get(key).and_then(Item::as_value) {
            *value.decor_mut() = old.decor().clone();
        }
        table.insert(key, Item::Value(value));
        self.changes.push((section.join("."), line));
        Ok(())
    }

    /// Adds values to the list at a key of a section, or sets a new list. Comments within the list stay.
    ///
    /// # Errors
    /// If something on the way is no table, or the value is no list.
    pub(crate) fn extend(&mut self, section: &[&str], key: &str, values: Array) -> Result<(), String> {
        let fail = format!("`{key}` of `{}` is not a list that can be extended", self.path.display());
        let table = self.table(section)?;
        let Some(old) = table.get_mut(key) else { return self.set(section, key, values) };
        let list = old.as_array_mut().ok_or(fail)?;
        values.into_iter().for_each(|value| push(list, value));
        // Without the comment behind the list.
        let mut shown = list.clone();
        shown.decor_mut().clear();
        let line = format!("{key} = {shown}");
        self.changes.push((section.join("."), line));
        Ok(())
    }

    /// Sets a list of tables in a section: `[[facts.arm.contacts]]` for the key `contacts` of `["facts", "arm"]`. What
    /// stays equal is left as it is written. Comments stay, except within a list of numbers that changes. Those of inline
    /// tables stand above the tables that take their place.
    ///
    /// # Errors
    /// If something on the way is no table.
    pub(crate) fn set_tables(&mut self, section: &[&str], key: &str, mut tables: ArrayOfTables) -> Result<(), String> {
        self.changes.push((String::new(), headed(section, key, tables.clone())));
        let is_new = section.iter().try_fold(self.document.as_item(), |item, name| item.get(name)).is_none();
        let table = self.table(section)?;
        if let Some(Item::ArrayOfTables(old)) = table.get_mut(key) {
            let known = old.len();
            old.iter_mut().zip(tables.iter()).for_each(|(old, new)| update(old, new));
            tables.into_iter().skip(known).for_each(|new| old.push(new));
            return Ok(());
        }
        if let (Some(above), Some(first)) = (comments(table, key), tables.get_mut(0)) {
            first.decor_mut().set_prefix(above);
        }
        table.remove(key);
        table.insert(key, Item::ArrayOfTables(tables));
        let root = self.document.as_item_mut();
        let made = section.iter().try_fold(root, |item, name| item.get_mut(name)).filter(|_| is_new);
        if let Some(Item::Table(made)) = made {
            made.set_implicit(true);
        }
        Ok(())
    }

    /// Returns a section, which is made if it is absent.
    fn table(&mut self, section: &[&str]) -> Result<&mut dyn TableLike, String> {
        let fail = format!("`{}` of `{}` is not a table that can be changed", section.join("."), self.path.display());
        let mut table: &mut dyn TableLike = self.document.as_table_mut();
        for (depth, part) in section.iter().enumerate() {
            let is_last = depth + 1 == section.len();
            let item = table.entry(part).or_insert_with(|| {
                let mut table = Table::new();
                table.set_implicit(!is_last);
                Item::Table(table)
            });
            table = item.as_table_like_mut().ok_or_else(|| fail.clone())?;
        }
        Ok(table)
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
                section = name;
                // A list of tables has the name of its section in its own headers.
                lines.extend(Some(format!("[{name}]")).filter(|_| !name.is_empty()));
            }
            lines.push(line.clone());
        }
        lines.join("\n")
    }

    /// Returns the changed text, with the line ends of the file.
    fn text(&self) -> String {
        let text = self.document.to_string();
        match self.before.contains("\r\n") {
            true => text.replace("\r\n", "\n").replace('\n', "\r\n"),
            false => text,
        }
    }

    /// Checks that the changed bench can be written, and loads. The bench stays as it is.
    ///
    /// # Errors
    /// If the bench is read-only, or all mistakes of the changed one.
    pub(crate) fn check(&self, catalogue: &Catalogue) -> Result<(), String> {
        let path = self.path.display();
        let fail = |error: std::io::Error| format!("cannot write `{path}`: {error}");
        self.refuse_read_only(&self.path)?;
        // Beside the bench, so that the names of its other files stay right.
        let new = self.write_beside(&self.path).map_err(fail)?;
        let Err(report) = open_bench(catalogue, new.path()) else { return Ok(()) };
        let report = report.render(false).replace(&new.path().display().to_string(), &path.to_string());
        Err(format!("with these lines, `{path}` does not load, so nothing is written\n{report}"))
    }

    /// Writes the file. It is replaced as a whole, so that it is never half written.
    ///
    /// # Errors
    /// If it has changed since it was read, is read-only, or cannot be written.
    pub(crate) fn write(&self) -> Result<(), String> {
        let path = self.path.display();
        let fail = |error: std::io::Error| format!("cannot write `{path}`: {error}");
        // A link stays a link.
        let target = fs::canonicalize(&self.path).map_err(fail)?;
        if fs::read_to_string(&target).map_err(fail)? != self.before {
            return Err(format!("`{path}` was changed by somebody else meanwhile; nothing is written"));
        }
        self.refuse_read_only(&target)?;
        let new = self.write_beside(&target).map_err(fail)?;
        let permissions = fs::metadata(&target).map_err(fail)?.permissions();
        new.as_file().set_permissions(permissions).and_then(|()| new.as_file().sync_all()).map_err(fail)?;
        new.persist(&target).map(drop).map_err(|error| fail(error.error))
    }

    /// Writes the text into a new file in the folder of `target`. It is removed when it is dropped.
    fn write_beside(&self, target: &Path) -> io::Result<NamedTempFile> {
        let prefix = format!(".{}.", target.file_name().unwrap_or_default().to_string_lossy());
        let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let mut new = tempfile::Builder::new().prefix(&prefix).suffix(".new").tempfile_in(folder)?;
        new.write_all(self.text().as_bytes())?;
        Ok(new)
    }

    fn refuse_read_only(&self, target: &Path) -> Result<(), String> {
        let path = self.path.display();
        let metadata = fs::metadata(target).map_err(|error| format!("cannot write `{path}`: {error}"))?;
        match metadata.permissions().readonly() {
            true => {
                Err(format!("`{path}` is read-only, so nothing is written: make it writable with `chmod u+w {path}`"))
            }
            false => Ok(()),
        }
    }
}

/// Adds a value to a list in the layout of its last one: on a line of its own, if the list has several lines.
fn push(list: &mut Array, mut value: Value) {
    let text = |raw: Option<&str>| raw.unwrap_or_default().to_owned();
    let last = list.len().checked_sub(1).and_then(|last| list.get_mut(last));
    let (indent, end) = match last {
        Some(last) => {
            let decor = last.decor_mut();
            let prefix = text(decor.prefix().and_then(|raw| raw.as_str()));
            let end = text(decor.suffix().and_then(|raw| raw.as_str()));
            decor.set_suffix("");
            (prefix.rsplit_once('\n').map(|(_, indent)| indent.to_owned()), end)
        }
        None => (None, String::new()),
    };
    // What stands behind the last value, perhaps with a comment.
    let end = end + &text(list.trailing().as_str());
    match end.rsplit_once('\n') {
        Some((_, close)) => {
            let indent = indent.unwrap_or_else(|| "    ".to_owned());
            value.decor_mut().set_prefix(format!("{}\n{indent}", end.trim_end()));
            list.set_trailing(format!("\n{close}"));
            list.set_trailing_comma(true);
        }
        None => {
            value.decor_mut().set_prefix(if list.is_empty() { "" } else { " " });
            list.set_trailing("");
            list.set_trailing_comma(false);
        }
    }
    list.push_formatted(value);
}

/// Returns a list of numbers, each rounded to a number of decimals.
pub(crate) fn numbers(list: &[f64], decimals: i32) -> Array {
    let scale = 10.0_f64.powi(decimals);
    // Adding zero turns -0 into 0.
    list.iter().map(|number| (number * scale).round() / scale + 0.0).collect()
}

/// Returns joint positions, rounded to a number of decimals and to the inside of the range of each joint.
pub(crate) fn joint_numbers(positions: &[f64], joints: &[Joint], decimals: i32) -> Array {
    let scale = 10.0_f64.powi(decimals);
    let inside = |(q, Joint { lower, upper, .. }): (&f64, &Joint)| {
        let rounded = (q * scale).round() / scale;
        let inner = if rounded > *upper {
            (upper * scale).floor() / scale
        } else if rounded < *lower {
            (lower * scale).ceil() / scale
        } else {
            rounded
        };
        // Adding zero turns -0 into 0.
        inner + 0.0
    };
    positions.iter().zip(joints).map(inside).collect()
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
        let mut bench = TomlFile::read(&path).expect("it is TOML");
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
        let mut bench = TomlFile::read(&path).expect("it is TOML");
        let message = bench.set(&["bind", "arm"], "home", 1).expect_err("a text");
        assert!(message.starts_with("`bind.arm` of"), "{message}");
        fs::remove_file(path).expect("it is there");
    }

    #[test]
    fn comments_within_a_list_stay() {
        let cases = [
            (
                "[\n  # a table\n  [1.0], # flat\n  [2.0], # a wall\n]",
                "[\n  # a table\n  [1.0], # flat\n  [2.0], # a wall\n  [3.5],\n]",
            ),
            ("[\n  [1.0], # flat\n  [2.0] # a wall\n]", "[\n  [1.0], # flat\n  [2.0], # a wall\n  [3.5],\n]"),
            ("[[1.0]]", "[[1.0], [3.5]]"),
            ("[]", "[[3.5]]"),
        ];
        for (before, after) in cases {
            let path = file("list");
            fs::write(&path, format!("[limits]\nkeep_out = {before} # mine\n")).expect("a file");
            let mut bench = TomlFile::read(&path).expect("it is TOML");
            let rows = std::iter::once(Value::Array(numbers(&[3.5], 4))).collect();
            bench.extend(&["limits"], "keep_out", rows).expect("a list");
            assert_eq!(bench.changes(), format!("[limits]\nkeep_out = {after}"));
            assert_eq!(bench.text(), format!("[limits]\nkeep_out = {after} # mine\n"));
            fs::remove_file(path).expect("it is there");
        }
    }

    #[test]
    fn a_list_of_tables_takes_the_place_of_the_old_one() {
        let contact = |object: &str, vz: f64| {
            let (mut table, mut pressure) = (Table::new(), Table::new());
            pressure.insert("vz", vz.into());
            table.insert("object", object.into());
            table.insert("pressure", Item::Table(pressure));
            table
        };
        let cases = [
            ("", "\n[[facts.arm.contacts]]\nobject = \"pen\"\n\n[facts.arm.contacts.pressure]\nvz = 7.0\n"),
            (
                "\n[facts.arm]\nend = 1\n\n# Old.\ncontacts = [{ object = \"pen\" }]\n\n[limits]\n",
                "\n[facts.arm]\nend = 1\n\n# Old.\n[[facts.arm.contacts]]\nobject = \"pen\"\n\n\
                 [facts.arm.contacts.pressure]\nvz = 7.0\n\n[limits]\n",
            ),
            (
                "\n# Mine.\n[[facts.arm.contacts]]\nobject = \"pen\" # a\n\n# Soft.\n[facts.arm.contacts.pressure]\n# b\nvz = 1.0 # c\n\n[limits]\n",
                "\n# Mine.\n[[facts.arm.contacts]]\nobject = \"pen\" # a\n\n# Soft.\n[facts.arm.contacts.pressure]\n# b\nvz = 7.0 # c\n\n[limits]\n",
            ),
            (
                "\n[facts.arm]\ncontacts = [\n  # a\n  { object = \"pen\" }, # b\n] # c\n\n[limits]\n",
                "\n[facts.arm]\n# a\n# b\n# c\n[[facts.arm.contacts]]\nobject = \"pen\"\n\n\
                 [facts.arm.contacts.pressure]\nvz = 7.0\n\n[limits]\n",
            ),
            (
                "\n[[facts.arm.contacts]]\nobject = \"pen\"\npressure = { vz = 1.0 } # mine\n\n[limits]\n",
                "\n[[facts.arm.contacts]]\nobject = \"pen\"\n\n# mine\n[facts.arm.contacts.pressure]\nvz = 7.0\n\n[limits]\n",
            ),
            (
                "\n[[facts.arm.contacts]]\nobject = \"pen\"\npressure = { vz = 7.0 } # mine\n\n[limits]\n",
                "\n[[facts.arm.contacts]]\nobject = \"pen\"\npressure = { vz = 7.0 } # mine\n\n[limits]\n",
            ),
        ];
        for (before, after) in cases {
            let path = file("tables");
            fs::write(&path, format!("[bind]\narm = \"arm\"\n{before}")).expect("a file");
            let mut bench = TomlFile::read(&path).expect("it is TOML");
            let tables = ArrayOfTables::from_iter([contact("pen", 7.0)]);
            bench.set_tables(&["facts", "arm"], "contacts", tables).expect("a table");
            assert_eq!(bench.text(), format!("[bind]\narm = \"arm\"\n{after}"));
            assert!(bench.changes().starts_with("[[facts.arm.contacts]]\nobject"), "{}", bench.changes());
            fs::remove_file(path).expect("it is there");
        }
    }

    #[test]
    fn line_ends_stay() {
        let path = file("ends");
        fs::write(&path, BENCH.replace('\n', "\r\n")).expect("a file");
        let mut bench = TomlFile::read(&path).expect("it is TOML");
        bench.set(&["limits"], "force_n", 1.5).expect("a table");
        bench.write().expect("it is written");
        let expected = format!("{BENCH}force_n = 1.5\n").replace('\n', "\r\n");
        assert_eq!(fs::read_to_string(&path).expect("it is there"), expected);
        fs::remove_file(path).expect("it is there");
    }

    #[test]
    fn other_files_stay_and_a_read_only_bench_is_refused() {
        let path = file("safe");
        let [victim, link] = ["toml.victim", "toml.new"].map(|end| path.with_extension(end));
        fs::write(&victim, "mine").expect("a file");
        std::os::unix::fs::symlink(&victim, &link).expect("a link");
        let mut bench = TomlFile::read(&path).expect("it is TOML");
        bench.set(&["limits"], "force_n", 1.5).expect("a table");
        let mut permissions = fs::metadata(&path).expect("it is there").permissions();
        let writable = permissions.clone();
        permissions.set_readonly(true);
        fs::set_permissions(&path, permissions).expect("it is ours");
        assert!(bench.write().expect_err("it is read-only").contains("is read-only, so nothing is written"));
        assert_eq!(fs::read_to_string(&path).expect("it is there"), BENCH);
        fs::set_permissions(&path, writable).expect("it is ours");
        bench.write().expect("it is written");
        assert_eq!(fs::read_to_string(&victim).expect("it is there"), "mine");
        [path, victim, link].into_iter().for_each(|path| fs::remove_file(path).expect("it is there"));
    }

    #[test]
    fn a_bench_that_does_not_load_is_refused_and_nothing_stays_behind() {
        let folder = std::env::temp_dir().join(format!("tactflow-bench-check-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder");
        let path = folder.join("cell.toml");
        fs::write(&path, "[bind]\npad = \"pad\"\n\n[devices.pad]\ntype = \"mock_pad\"\n").expect("a file");
        let mut bench = TomlFile::read(&path).expect("it is TOML");
        bench.set(&["devices", "pad", "mount"], "xyz", numbers(&[0.0, 0.0, 0.03], 4)).expect("a table");
        bench.check(&crate::catalogue()).expect("it loads");
        bench.set(&["devices", "pad"], "unheard_of", 1).expect("a table");
        let message = bench.check(&crate::catalogue()).expect_err("no such parameter");
        assert!(message.contains("does not load") && message.contains("unheard_of"), "{message}");
        assert!(message.contains("cell.toml") && !message.contains(".new"), "{message}");
        assert_eq!(fs::read_dir(&folder).expect("a folder").count(), 1);
        fs::remove_dir_all(folder).expect("it is there");
    }

    #[test]
    fn joints_are_rounded_into_their_range() {
        let joint = Joint { lower: -2.967_06, upper: 2.094_36, ..Joint::default() };
        let found = joint_numbers(&[2.094_36, -2.967_06, 0.123_46], &[joint.clone(), joint.clone(), joint], 4);
        assert_eq!(found.to_string(), "[2.0943, -2.967, 0.1235]");
    }
}
