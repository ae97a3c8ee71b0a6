//! The columns of a CSV file: by their names, or tactels in order.

use crate::recordings::common::text::{Notation, Piece, shortened};
use crate::recordings::common::{Hints, MAX_CELLS, Refusal, TextError};

/// The columns of a file with a frame a row.
#[derive(Debug)]
pub(super) struct CsvColumns {
    /// Rows and columns of the array.
    pub(super) size: [usize; 2],
    /// Number of columns of the file.
    pub(super) count: usize,
    /// Factor from the file's times to seconds.
    pub(super) second: f64,
    /// Role of each column; `None` without names, when each column is a tactel.
    named: Option<Vec<Place>>,
}

/// The role of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// The tactel with this index in a frame.
    Tactel(usize),
    /// The time.
    Time,
    /// A force that another sensor measured.
    Force,
    /// A number that is not used.
    Passed,
}

/// A compact role: the row and the column of a tactel, or one of three marks.
type Place = (u32, u32);

const TIME: Place = (u32::MAX, 0);
const FORCE: Place = (u32::MAX, 1);
const PASSED: Place = (u32::MAX, 2);

impl CsvColumns {
    /// Returns columns that are tactels row by row.
    pub(super) const fn plain(rows: usize, cols: usize) -> Self {
        Self { size: [rows, cols], count: rows * cols, second: 1.0, named: None }
    }

    /// Reads a row of names. For tactels whose names have no row and column, the bench gives the size.
    pub(super) fn named(names: Piece<'_>, hints: &Hints) -> Result<Self, Refusal> {
        let notation = names_of(names);
        let count = notation.fields(names).count();
        names.check(count <= MAX_CELLS, format_args!("{count} columns are more than the maximum of {MAX_CELLS}"))?;
        let mut columns = Self { size: [0, 0], count, second: 1.0, named: None };
        let mut places = Vec::with_capacity(count);
        let mut have_places = None;
        for name in notation.fields(names).map(unquoted) {
            let title = || shortened(name.text);
            if let Some(mark) = columns.mark(name)? {
                let is_twice = mark != PASSED && places.contains(&mark);
                name.check(!is_twice, format_args!("`{}` appears twice", title()))?;
                places.push(mark);
                continue;
            }
            let place = place(name.text);
            if *have_places.get_or_insert(place.is_some()) != place.is_some() {
                return Err(match place {
                    None => name.error(format!("`{}` has no row and column, but other names do", title())),
                    Some(_) => name.error("only some names have a row and a column"),
                }
                .into());
            }
            places.push(place.unwrap_or((0, 0)));
        }
        columns.size = if have_places == Some(true) {
            let size = settle(&mut places).map_err(|message| names.error(message))?;
            hints.size(Some(size))?
        } else {
            let size = hints.size(None)?;
            number(&mut places, size).map_err(|message| names.error(message))?;
            size
        };
        columns.named = Some(places);
        Ok(columns)
    }

    /// Returns the role of a column, by its index.
    pub(super) fn role(&self, column: usize) -> Option<Role> {
        match &self.named {
            None => (column < self.count).then_some(Role::Tactel(column)),
            Some(places) => places.get(column).map(|place| match *place {
                TIME => Role::Time,
                FORCE => Role::Force,
                PASSED => Role::Passed,
                (row, col) => Role::Tactel(row as usize * self.size[1] + col as usize),
            }),
        }
    }

    /// Returns the mark of a column that is not a tactel.
    fn mark(&mut self, name: Piece<'_>) -> Result<Option<Place>, TextError> {
        let lower = if name.text.len() > 40 { String::new() } else { name.text.to_lowercase() };
        let (base, unit) = match lower.split_once(['[', '(']) {
            Some((base, unit)) => (base.trim(), unit.trim_end_matches([']', ')']).trim()),
            None => lower.rsplit_once('_').unwrap_or((&lower, "")),
        };
        match base {
            "time" | "t" | "timestamp" | "zeit" => {}
            "force" if matches!(unit, "" | "n") => return Ok(Some(FORCE)),
            "force" => return Err(name.error("the unit of `force` must be `N`")),
            "frame" | "index" if unit.is_empty() => return Ok(Some(PASSED)),
            "" if name.text.is_empty() => return Ok(Some(PASSED)),
            _ => return Ok(None),
        }
        self.second = match unit {
            "" | "s" | "sec" | "seconds" => 1.0,
            "ms" => 1e-3,
            "us" | "µs" | "μs" => 1e-6,
            "ns" => 1e-9,
            // `t_0` is a tactel.
            _ if base == "t" => return Ok(None),
            _ => return Err(name.error("the unit of a time must be `s`, `ms`, `us` or `ns`")),
        };
        Ok(Some(TIME))
    }
}

/// Returns the notation of a row of names.
pub(super) fn names_of(names: Piece<'_>) -> Notation {
    let separator = ['\t', ';', ','].into_iter().find(|separator| names.text.contains(*separator));
    Notation { separator }
}

pub(super) fn unquoted(name: Piece<'_>) -> Piece<'_> {
    name.part(name.text.trim_matches(['"', '\''])).trimmed()
}

/// Returns the row and the column in a name such as `t0_3`, `r0c3` or `x3y0`: one with exactly two numbers.
fn place(name: &str) -> Option<Place> {
    if name.len() > 40 {
        return None;
    }
    let mut numbers = name.split(|c: char| !c.is_ascii_digit()).filter(|digits| !digits.is_empty());
    let (first, second) = (numbers.next()?.parse().ok()?, numbers.next()?.parse().ok()?);
    let letter = name.chars().take_while(|c| !c.is_ascii_digit()).filter(|c| c.is_alphabetic()).last();
    let is_column_first = matches!(letter, Some('x' | 'X' | 'c' | 'C')) && name.contains(['y', 'Y', 'r', 'R']);
    let place = if is_column_first { (second, first) } else { (first, second) };
    (numbers.next().is_none() && place.0 < u32::MAX).then_some(place)
}

fn tactels(places: &mut [Place]) -> impl Iterator<Item = &mut Place> {
    places.iter_mut().filter(|place| place.0 != u32::MAX)
}

/// Shifts the places to count from 0, and returns the size of the array. Each tactel must appear once.
fn settle(places: &mut [Place]) -> Result<[usize; 2], String> {
    let (mut first, mut last, mut found) = ((u32::MAX, u32::MAX), (0, 0), 0);
    for place in tactels(places) {
        first = (first.0.min(place.0), first.1.min(place.1));
        last = (last.0.max(place.0), last.1.max(place.1));
        found += 1;
    }
    if first.0 > 1 || first.1 > 1 {
        return Err("the names of the tactels must count rows and columns from 0 or from 1".into());
    }
    let [rows, cols] = [(last.0 - first.0) as usize + 1, (last.1 - first.1) as usize + 1];
    if rows.checked_mul(cols) != Some(found) {
        return Err(format!("the names reach {rows} rows by {cols} columns, but there are {found} names"));
    }
    let mut is_there = vec![false; found];
    for place in tactels(places) {
        let (row, col) = *place;
        *place = (row - first.0, col - first.1);
        if std::mem::replace(&mut is_there[place.0 as usize * cols + place.1 as usize], true) {
            return Err(format!("row {row} and column {col} appear twice"));
        }
    }
    Ok([rows, cols])
}

/// Numbers the tactels row by row.
fn number(places: &mut [Place], [rows, cols]: [usize; 2]) -> Result<(), String> {
    let found = tactels(places).count();
    if rows.checked_mul(cols) != Some(found) {
        return Err(format!("these are the names of {found} tactels, not of {rows} by {cols}"));
    }
    tactels(places).enumerate().for_each(|(i, place)| *place = ((i / cols) as u32, (i % cols) as u32));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_has_a_row_and_a_column() {
        let cases = [
            ("t0_3", Some((0, 3))),
            ("r12c7", Some((12, 7))),
            ("taxel[2][5]", Some((2, 5))),
            ("x3y1", Some((1, 3))),
            ("c3r1", Some((1, 3))),
            ("0_3", Some((0, 3))),
            ("row1_col2", Some((1, 2))),
            ("t3", None),
            ("t1_2_3", None),
            ("temperature", None),
            ("t99999999999_1", None),
        ];
        for (name, expected) in cases {
            assert_eq!(place(name), expected, "{name}");
        }
    }
}
