//! The columns of a CSV file: by their names, or tactels in order.

use crate::recordings::common::text::{Notation, Piece, Wrong, flaw, shortened};
use crate::recordings::common::{Flaw, Hints, MAX_CELLS};

/// The columns of a file with a frame a row.
#[derive(Debug)]
pub(super) struct Columns {
    /// Rows and columns of the array.
    pub(super) size: (usize, usize),
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

impl Columns {
    /// Returns columns that are tactels row by row.
    pub(super) const fn plain(rows: usize, cols: usize) -> Self {
        Self { size: (rows, cols), count: rows * cols, second: 1.0, named: None }
    }

    /// Reads a row of names. For tactels whose names have no row and column, the bench gives the size.
    pub(super) fn named(names: Piece<'_>, hints: &Hints) -> Result<Self, Wrong> {
        let notation = names_of(names);
        let count = notation.fields(names).count();
        if count > MAX_CELLS {
            let message = format!("{count} columns are more than the maximum of {MAX_CELLS}");
            return flaw(&names, message).map_err(Wrong::from);
        }
        let mut columns = Self { size: (0, 0), count, second: 1.0, named: None };
        let mut places = Vec::with_capacity(count);
        let mut have_places = None;
        for name in notation.fields(names).map(unquoted) {
            let place = match columns.mark(name)? {
                Some(mark) if mark != PASSED && places.contains(&mark) => {
                    return flaw(&name, format!("`{}` appears twice", shortened(name.text))).map_err(Wrong::from);
                }
                Some(mark) => mark,
                None => {
                    let place = place(name.text);
                    if *have_places.get_or_insert(place.is_some()) != place.is_some() {
                        let message = format!("`{}` has no row and column, but other names do", shortened(name.text));
                        let message =
                            if place.is_none() { message } else { "only some names have a row and a column".into() };
                        return flaw(&name, message).map_err(Wrong::from);
                    }
                    place.unwrap_or((0, 0))
                }
            };
            places.push(place);
        }
        columns.size = match have_places {
            Some(true) => {
                let size = settle(&mut places).or_else(|message| flaw(&names, message))?;
                hints.size(Some([size.0, size.1]))?;
                size
            }
            _ => in_order(&mut places, names, hints)?,
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
                (row, col) => Role::Tactel(row as usize * self.size.1 + col as usize),
            }),
        }
    }

    /// Returns the mark of a column that is not a tactel.
    fn mark(&mut self, name: Piece<'_>) -> Result<Option<Place>, Flaw> {
        let lower = if name.text.len() > 40 { String::new() } else { name.text.to_lowercase() };
        let (base, unit) = match lower.split_once(['[', '(']) {
            Some((base, unit)) => (base.trim(), unit.trim_end_matches([']', ')']).trim()),
            None => lower.rsplit_once('_').unwrap_or((&lower, "")),
        };
        match base {
            "time" | "t" | "timestamp" | "zeit" => {}
            "force" if matches!(unit, "" | "n") => return Ok(Some(FORCE)),
            "force" => return flaw(&name, "the unit of `force` must be `N`"),
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
            _ => return flaw(&name, "the unit of a time must be `s`, `ms`, `us` or `ns`"),
        };
        Ok(Some(TIME))
    }
}

/// Returns the notation of a row of names.
pub(super) fn names_of(names: Piece<'_>) -> Notation {
    let separator = ['\t', ';', ','].into_iter().find(|separator| names.text.contains(*separator));
    Notation { separator, has_decimal_comma: false }
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

/// Shifts the places to count from 0, and returns the size of the array. Each tactel must appear once.
fn settle(places: &mut [Place]) -> Result<(usize, usize), String> {
    let tactels = || places.iter().filter(|place| place.0 != u32::MAX);
    let range = |of: fn(&Place) -> u32| (tactels().map(of).min().unwrap_or(0), tactels().map(of).max().unwrap_or(0));
    let ((top, bottom), (left, right)) = (range(|place| place.0), range(|place| place.1));
    if top > 1 || left > 1 {
        return Err("the names of the tactels must count rows and columns from 0 or from 1".into());
    }
    let size = ((bottom - top) as usize + 1, (right - left) as usize + 1);
    let found = tactels().count();
    if size.0.checked_mul(size.1) != Some(found) {
        return Err(format!("the names reach {} rows by {} columns, but there are {found} names", size.0, size.1));
    }
    let mut is_there = vec![false; found];
    for place in places.iter_mut().filter(|place| place.0 != u32::MAX) {
        *place = (place.0 - top, place.1 - left);
        let index = place.0 as usize * size.1 + place.1 as usize;
        if std::mem::replace(&mut is_there[index], true) {
            return Err(format!("row {} and column {} appear twice", place.0 + top, place.1 + left));
        }
    }
    Ok(size)
}

/// Numbers the tactels row by row, and returns the size of the array.
fn in_order(places: &mut [Place], names: Piece<'_>, hints: &Hints) -> Result<(usize, usize), Wrong> {
    let [rows, cols] = hints.size(None)?;
    let found = places.iter().filter(|place| place.0 != u32::MAX).count();
    if rows.checked_mul(cols) != Some(found) {
        let message = format!("these are the names of {found} tactels, not of {rows} by {cols}");
        return flaw(&names, message).map_err(Wrong::from);
    }
    let tactels = places.iter_mut().filter(|place| place.0 != u32::MAX);
    tactels.enumerate().for_each(|(i, place)| *place = ((i / cols) as u32, (i % cols) as u32));
    Ok((rows, cols))
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
