//! The rows of a run, read from a file that `--out` has written.

use std::fmt;
use std::path::Path;

use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};

use super::RecordFormat;
use crate::source::{quoted, suggestion};

/// Maximum number of columns that a message lists.
const MAX_LISTED: usize = 20;

/// The names of the modes of a task, and the name of the task; that of the graph itself is empty.
pub type TaskModes = (String, Vec<String>);

/// One column of a run over time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RunColumn {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: String,
    /// One value per row; NaN where it is absent.
    pub values: Vec<f64>,
}

/// The columns of a run over time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct RunRows {
    /// Time of each row [s].
    pub times: Vec<f64>,
    /// All other columns.
    pub columns: Vec<RunColumn>,
    /// The names of the modes of each task that has modes.
    pub modes: Vec<TaskModes>,
}

impl RunRows {
    /// Reads a .csv or .ndjson file.
    ///
    /// # Errors
    /// If it cannot be read, or was not written by `--out`.
    pub fn read(path: &Path) -> Result<Self, String> {
        let name = path.display();
        let text = std::fs::read_to_string(path).map_err(|error| format!("cannot read `{name}`: {error}"))?;
        let rows = match RecordFormat::of(path) {
            Some(RecordFormat::Ndjson) => ndjson(&text),
            _ => csv(&text),
        };
        rows.map_err(|why| format!("`{name}` is not a file that `--out` has written: {why}"))
    }

    /// Returns the column of that name.
    #[must_use]
    pub fn column(&self, name: &str) -> Option<&RunColumn> {
        self.columns.iter().find(|column| column.name == name)
    }

    /// Returns the columns of a port: the one of that name, or those of its components.
    ///
    /// # Errors
    /// Suggests a similar name if there is none.
    pub fn port(&self, name: &str) -> Result<Vec<&RunColumn>, String> {
        let part = |column: &&RunColumn| column.name.strip_prefix(name).is_some_and(|rest| rest.starts_with('.'));
        let is_own = |column: &&RunColumn| column.name == name;
        let found: Vec<&RunColumn> = self.columns.iter().filter(|column| is_own(column) || part(column)).collect();
        if found.is_empty() {
            let names = || self.columns.iter().map(|column| column.name.as_str());
            let mut near = suggestion(name, names(), "columns");
            if !near.starts_with("did you mean") && names().count() > MAX_LISTED {
                let mut nodes: Vec<&str> = names().map(|name| name.split('.').next().unwrap_or(name)).collect();
                nodes.dedup();
                near = format!("its {} columns are of {}", names().count(), quoted(nodes));
            }
            return Err(format!("the file has no column `{name}`: {near}"));
        }
        Ok(found)
    }

    /// Adds a row.
    fn add(&mut self, time: f64, values: impl Iterator<Item = f64>) {
        self.times.push(time);
        self.columns.iter_mut().zip(values).for_each(|(column, value)| column.values.push(value));
    }
}

fn csv(text: &str) -> Result<RunRows, String> {
    let mut rows = RunRows::default();
    let mut units = Vec::new();
    let mut lines = text.lines().enumerate();
    let header = loop {
        let (_, line) = lines.next().ok_or("it has no names of columns")?;
        let Some(comment) = line.strip_prefix("# ") else { break line };
        match comment.strip_suffix(']').and_then(|comment| comment.rsplit_once(" [")) {
            Some((name, unit)) => units.push((name.to_owned(), unit.to_owned())),
            None => rows.modes.extend(modes(comment)),
        }
    };
    let names = cells(header);
    if names.first().map(String::as_str) != Some("time") {
        return Err("its first column is not `time`".into());
    }
    let unit = |i: usize| units.get(i).map_or_else(String::new, |(_, unit)| unit.clone());
    let column = |(i, name): (usize, &String)| RunColumn { name: name.clone(), unit: unit(i), values: Vec::new() };
    rows.columns = names.iter().enumerate().skip(1).map(column).collect();
    for (number, line) in lines {
        let read = |cell: &str| if cell.is_empty() { Ok(f64::NAN) } else { cell.parse::<f64>() };
        let values: Result<Vec<f64>, _> = line.split(',').map(read).collect();
        let values = values.map_err(|_| format!("line {} has a cell that is no number", number + 1))?;
        if values.len() != names.len() {
            return Err(format!("line {} has {} cells, not {}", number + 1, values.len(), names.len()));
        }
        rows.add(values[0], values[1..].iter().copied());
    }
    Ok(rows)
}

/// Splits the line with the names, some of which are in quotes.
fn cells(line: &str) -> Vec<String> {
    let (mut cells, mut is_quoted) = (vec![String::new()], false);
    let mut characters = line.chars().peekable();
    while let Some(character) = characters.next() {
        let cell = cells.last_mut().expect("there is always a cell");
        match character {
            '"' if is_quoted && characters.next_if_eq(&'"').is_some() => cell.push('"'),
            '"' => is_quoted = !is_quoted,
            ',' if !is_quoted => cells.push(String::new()),
            other => cell.push(other),
        }
    }
    cells
}

/// Reads the line with the names of the modes of a task, as `modes of left: 0 approach 1 servo`.
fn modes(line: &str) -> Option<TaskModes> {
    let (head, list) = line.strip_prefix("modes")?.split_once(':')?;
    let task = head.strip_prefix(" of ").unwrap_or_default();
    Some((task.to_owned(), list.split_whitespace().skip(1).step_by(2).map(str::to_owned).collect()))
}

/// What the first line of an NDJSON file has beside its row.
#[derive(Deserialize)]
struct Head {
    units: Pairs,
}

/// The pairs of an object in the order of the file.
struct Pairs(Vec<(String, String)>);

impl<'de> Deserialize<'de> for Pairs {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct InOrder;
        impl<'de> Visitor<'de> for InOrder {
            type Value = Pairs;

            fn expecting(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
                text.write_str("the unit of each column")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Pairs, A::Error> {
                let mut pairs = Vec::new();
                while let Some(pair) = map.next_entry()? {
                    pairs.push(pair);
                }
                Ok(Pairs(pairs))
            }
        }
        deserializer.deserialize_map(InOrder)
    }
}

fn ndjson(text: &str) -> Result<RunRows, String> {
    let mut rows = RunRows::default();
    for (i, line) in text.lines().enumerate() {
        let row: Map<String, Value> =
            serde_json::from_str(line).map_err(|_| format!("line {} is no JSON object", i + 1))?;
        if i == 0 {
            let head: Head = serde_json::from_str(line).map_err(|_| "its first line has no `units`")?;
            let columns = head.units.0.into_iter().filter(|(name, _)| name != "time");
            rows.columns = columns.map(|(name, unit)| RunColumn { name, unit, values: Vec::new() }).collect();
            let about = row.get("about").and_then(Value::as_array).into_iter().flatten();
            rows.modes = about.filter_map(|line| modes(line.as_str()?)).collect();
        }
        // A run without a tick has no row.
        let Some(time) = row.get("time").and_then(Value::as_f64) else { continue };
        let value = |name: &String| row.get(name).and_then(Value::as_f64).unwrap_or(f64::NAN);
        let values: Vec<f64> = rows.columns.iter().map(|column| value(&column.name)).collect();
        rows.add(time, values.into_iter());
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::PortColumn;

    #[test]
    fn what_was_written_is_read() {
        let names = ["arm.twist.vx", "a \"b\", c", "mode"];
        let column = |name: &str| PortColumn { name: name.into(), part: String::new(), unit: "m/s".parse().unwrap() };
        let columns: Vec<PortColumn> = names.iter().map(|name| column(name)).collect();
        let about = ["tactflow 1".to_owned(), "modes: 0 approach 1 servo".into()];
        let time = |nanos: u64| f64::from_bits(nanos);
        for (format, read) in [(RecordFormat::Csv, csv as fn(&str) -> _), (RecordFormat::Ndjson, ndjson)] {
            let (rows, mut text) = (format.rows(false), Vec::new());
            rows.header(&columns, &about, &mut text).unwrap();
            rows.first_row(&columns, &[time(0), 0.5, f64::NAN, 0.0], &mut text).unwrap();
            rows.row(&columns, &[time(20_000_000), -1e-9, 3.0, 1.0], &mut text).unwrap();
            let found = read(&String::from_utf8(text).unwrap()).unwrap();
            assert_eq!(found.times, [0.0, 0.02]);
            let by_name = |name: &str| found.column(name).unwrap();
            assert_eq!(by_name("arm.twist.vx").values, [0.5, -1e-9]);
            assert!(by_name("a \"b\", c").values[0].is_nan() && by_name("a \"b\", c").values[1] == 3.0);
            assert_eq!(by_name("mode").unit, "m/s");
            assert_eq!(found.modes, [(String::new(), vec!["approach".to_owned(), "servo".to_owned()])]);
            assert_eq!(found.port("arm.twist").unwrap().len(), 1);
            assert!(found.columns.iter().map(|column| &*column.name).eq(names), "in the order of the file");
            let message = found.port("arm.twits").unwrap_err();
            assert!(message.starts_with("the file has no column `arm.twits`: "), "{message}");
        }
    }

    #[test]
    fn what_is_no_run_is_refused() {
        for (text, why) in [
            ("", "it has no names of columns"),
            ("x,y\n1,2\n", "its first column is not `time`"),
            ("time,x\n0.0\n", "line 2 has 1 cells, not 2"),
            ("time,x\n0.0,z\n", "line 2 has a cell that is no number"),
        ] {
            assert_eq!(csv(text).unwrap_err(), why);
        }
        assert_eq!(ndjson("{\"time\":1}").unwrap_err(), "its first line has no `units`");
        assert_eq!(ndjson("no").unwrap_err(), "line 1 is no JSON object");
    }
}
