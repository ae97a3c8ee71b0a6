//! Writes rows as CSV or NDJSON.

use std::io::{self, Write};
use std::path::Path;

use serde::Serializer;
use serde::ser::SerializeMap;

use super::PortColumn;

/// The format of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordFormat {
    /// Comma-separated values. Comments before the header list the units.
    Csv,
    /// One JSON object per line. The first line lists the units.
    Ndjson,
}

impl RecordFormat {
    /// The first bytes of a file in each format.
    pub const FILE_STARTS: [&'static str; 2] = ["# time [s]", "{\"units\":"];

    /// Returns the format for a file name, by its extension.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()? {
            "csv" => Some(Self::Csv),
            "ndjson" => Some(Self::Ndjson),
            _ => None,
        }
    }

    /// Writes the lines before the rows.
    pub(super) fn header(self, columns: &[PortColumn], out: &mut impl Write) -> io::Result<()> {
        match self {
            Self::Csv => {
                writeln!(out, "# time [s]")?;
                for column in columns {
                    writeln!(out, "# {} [{}]", column.name, column.unit)?;
                }
                write!(out, "time")?;
                columns.iter().try_for_each(|column| write!(out, ",{}", column.name))?;
                writeln!(out)
            }
            Self::Ndjson => {
                write!(out, "{{\"units\":")?;
                let units = columns.iter().map(|column| (column.name.as_str(), column.unit.to_string()));
                let mut json = serde_json::Serializer::new(&mut *out);
                json.collect_map(std::iter::once(("time", "s".to_owned())).chain(units))?;
                writeln!(out, "}}")
            }
        }
    }

    /// Writes one row: the time [ns] and one value per column. NaN stands for an absent value.
    pub(super) fn row(self, columns: &[PortColumn], time: i64, row: &[f64], out: &mut impl Write) -> io::Result<()> {
        let seconds = time as f64 * 1e-9;
        match self {
            Self::Csv => {
                write!(out, "{seconds:?}")?;
                for value in row {
                    if value.is_nan() { write!(out, ",")? } else { write!(out, ",{value:?}")? }
                }
                writeln!(out)
            }
            Self::Ndjson => {
                let mut json = serde_json::Serializer::new(&mut *out);
                let mut map = json.serialize_map(Some(columns.len() + 1))?;
                map.serialize_entry("time", &seconds)?;
                for (column, value) in columns.iter().zip(row) {
                    map.serialize_entry(&column.name, &Some(value).filter(|value| !value.is_nan()))?;
                }
                map.end()?;
                writeln!(out)
            }
        }
    }
}
