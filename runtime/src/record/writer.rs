//! Writes rows as CSV or NDJSON.

use std::borrow::Cow;
use std::io::{self, Write};
use std::path::Path;

use serde::Serializer;

use super::PortColumn;

/// The format of a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordFormat {
    /// Comma-separated values. Comments before the header list the units, and what is known about the run.
    Csv,
    /// One JSON object per line. That of the first row has the units and what is known about the run, too.
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

    /// Returns the format of the rows of a run. Those of a run in real time have the column `wall`, with the wall clock;
    /// in virtual time, two runs write the same file.
    #[must_use]
    pub const fn rows(self, is_real: bool) -> RowFormat {
        RowFormat { format: self, has_wall: is_real }
    }
}

/// The format of the rows of a run: their times, and the values of the columns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RowFormat {
    format: RecordFormat,
    has_wall: bool,
}

impl RowFormat {
    /// Returns the number of times in a row.
    pub(super) fn times(self) -> usize {
        self.names().len()
    }

    /// Returns the names of the times.
    const fn names(self) -> &'static [&'static str] {
        if self.has_wall { &["time", "wall"] } else { &["time"] }
    }

    /// Writes what stands before the rows: the units, and the lines `about` the run. That of NDJSON is the beginning of the
    /// first row, so that each line is a row.
    pub(crate) fn header(self, columns: &[PortColumn], about: &[String], out: &mut impl Write) -> io::Result<()> {
        match self.format {
            RecordFormat::Csv => {
                self.names().iter().try_for_each(|name| writeln!(out, "# {name} [s]"))?;
                columns.iter().try_for_each(|column| writeln!(out, "# {} [{}]", cell(&column.name), column.unit))?;
                about.iter().try_for_each(|line| writeln!(out, "# {}", line.replace(['\n', '\r'], " ")))?;
                write!(out, "{}", self.names().join(","))?;
                columns.iter().try_for_each(|column| write!(out, ",{}", cell(&column.name)))?;
                writeln!(out)
            }
            RecordFormat::Ndjson => {
                write!(out, "{{\"units\":")?;
                let times = self.names().iter().map(|name| (*name, "s".to_owned()));
                let units = columns.iter().map(|column| (column.name.as_str(), column.unit.to_string()));
                let mut json = serde_json::Serializer::new(&mut *out);
                json.collect_map(times.chain(units))?;
                write!(out, ",\"about\":")?;
                serde_json::to_writer(&mut *out, about)?;
                Ok(())
            }
        }
    }

    /// Writes the end of what stands before the rows, if there is no row.
    pub(super) fn end_of_header(self, out: &mut impl Write) -> io::Result<()> {
        match self.format {
            RecordFormat::Csv => Ok(()),
            RecordFormat::Ndjson => writeln!(out, "}}"),
        }
    }

    /// Writes the first row, after the header.
    pub(crate) fn first_row(self, columns: &[PortColumn], row: &[f64], out: &mut Vec<u8>) -> io::Result<()> {
        let begin = out.len();
        self.row(columns, row, out)?;
        if self.format == RecordFormat::Ndjson {
            // The object was begun by the header.
            out[begin] = b',';
        }
        Ok(())
    }

    /// Writes one row: the bits of the times [ns], and one value per column. NaN stands for an absent value.
    pub(crate) fn row(self, columns: &[PortColumn], row: &[f64], out: &mut impl Write) -> io::Result<()> {
        let (times, row) = row.split_at(self.times());
        let times = self.names().iter().zip(times).map(|(name, time)| (*name, time_text(time.to_bits() as i64)));
        match self.format {
            RecordFormat::Csv => {
                for (i, (_, time)) in times.enumerate() {
                    write!(out, "{}{time}", if i > 0 { "," } else { "" })?;
                }
                for value in row {
                    if value.is_nan() { write!(out, ",")? } else { write!(out, ",{value:?}")? }
                }
                writeln!(out)
            }
            RecordFormat::Ndjson => {
                for (i, (name, time)) in times.enumerate() {
                    write!(out, "{}\"{name}\":{time}", if i > 0 { "," } else { "{" })?;
                }
                for (column, value) in columns.iter().zip(row) {
                    write!(out, ",")?;
                    serde_json::to_writer(&mut *out, &column.name)?;
                    write!(out, ":")?;
                    serde_json::to_writer(&mut *out, &Some(value).filter(|value| !value.is_nan()))?;
                }
                writeln!(out, "}}")
            }
        }
    }
}

/// Writes nanoseconds as seconds, without an exponent and with at least one decimal.
pub(crate) fn time_text(nanos: i64) -> String {
    let seconds = seconds(nanos);
    if seconds.fract() == 0.0 { format!("{seconds:.1}") } else { seconds.to_string() }
}

/// Converts nanoseconds to seconds. The result is the float next to the decimal number, so it is printed without noise.
pub(crate) fn seconds(nanos: i64) -> f64 {
    const MAX_EXACT: i64 = 1 << 53;
    // Beyond 104 days a float does not hold the nanoseconds, and microseconds still do.
    if nanos.abs() < MAX_EXACT { nanos as f64 / 1e9 } else { (nanos / 1000) as f64 / 1e6 }
}

/// Returns a name as a cell of a CSV file: in quotes if it has characters that mean something there.
fn cell(name: &str) -> Cow<'_, str> {
    if name.contains([',', '"', '#', '\n', '\r', ' ']) {
        // A reader of the comments takes the file line by line.
        format!("\"{}\"", name.replace('"', "\"\"").replace(['\n', '\r'], " ")).into()
    } else {
        name.into()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::Unit;

    #[test]
    fn times_are_printed_without_noise() {
        let cases = [
            (0, "0.0"),
            (1, "0.000000001"),
            (2_193, "0.000002193"),
            (5_000_000_000, "5.0"),
            (300_000_000, "0.3"),
            (700_000_000, "0.7"),
            (1_001_000_000, "1.001"),
            (4_123_456_789, "4.123456789"),
            (8_640_000_300_000_000, "8640000.3"),
            (1_763_866_339_123_456_000, "1763866339.123456"),
        ];
        for (nanos, text) in cases {
            assert_eq!(time_text(nanos), text);
            assert_eq!(text.parse(), Ok(seconds(nanos)));
        }
        for tick in 0..100_000 {
            let text = time_text(tick * 4_000_000);
            assert!(text.len() <= 7, "{text}");
        }
    }

    #[test]
    fn names_with_commas_are_quoted() {
        let column = |name: &str| PortColumn { name: name.into(), part: String::new(), unit: Unit::NEWTON };
        let columns = ["a.b", "mix.out.x,y", "mix.out.\"q\"", "arm.joint #1"].map(column);
        let format = RecordFormat::Csv.rows(true);
        let (mut text, mut row) = (Vec::new(), [1_300_000_000, 1_763_866_339_123_456_789].map(f64::from_bits).to_vec());
        row.extend([0.5, f64::NAN, 1.0, -2.0]);
        format.header(&columns, &[], &mut text).expect("a vector takes everything");
        format.row(&columns, &row, &mut text).expect("a vector takes everything");
        let expected = "# time [s]\n# wall [s]\n# a.b [N]\n# \"mix.out.x,y\" [N]\n# \"mix.out.\"\"q\"\"\" [N]\n\
                        # \"arm.joint #1\" [N]\n\
                        time,wall,a.b,\"mix.out.x,y\",\"mix.out.\"\"q\"\"\",\"arm.joint #1\"\n\
                        1.3,1763866339.123456,0.5,,1.0,-2.0\n";
        assert_eq!(String::from_utf8_lossy(&text), expected);
    }
}
