//! The columns of a CSV file: by their names, or tactels in order.

use crate::recordings::common::text::{Notation, Piece, shortened};
use crate::recordings::common::{Hints, MAX_CELLS, Refusal, TextError};

/// The columns of a file with a frame a row.
#[derive(Debug)]
pub(super) struct CsvColumns {
    /// Rows and columns of the array.
    pub(super) size: [usize; 2],
    /// Factor from the file's times to seconds.
    pub(super) second: f64,
    /// Name of the column with the time, if it gives no unit and no hint does.
    pub(super) unlabelled: Option<String>,
    /// Role of each column.
    pub(super) roles: Vec<Role>,
}

/// The role of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Role {
    /// The tactel with this index in a frame; with three axes, its z.
    Tactel(usize),
    /// The x (0) or the y (1) of the tactel with this index.
    Drag(usize, u8),
    /// The time.
    Time,
    /// A force that another sensor measured.
    Force,
    /// A number that is not used.
    Passed,
}

/// The row and the column in the name of a tactel.
type Place = (u32, u32);

/// The axes of a tactel, as names end with them.
const AXES: [char; 3] = ['x', 'y', 'z'];

impl CsvColumns {
    /// Returns columns that are tactels row by row.
    pub(super) fn plain(rows: usize, cols: usize) -> Self {
        let roles = (0..rows * cols).map(Role::Tactel).collect();
        Self { size: [rows, cols], second: 1.0, unlabelled: None, roles }
    }

    /// Reads a row of names. For tactels whose names have no row and column, the bench gives the size.
    pub(super) fn named(names: Piece<'_>, hints: &Hints) -> Result<Self, Refusal> {
        let notation = names_of(names);
        let count = notation.fields(names).count();
        names.check(count <= MAX_CELLS, format_args!("{count} columns are more than the maximum of {MAX_CELLS}"))?;
        let roles = Vec::with_capacity(count);
        let mut columns = Self { size: [0, 0], second: 1.0, unlabelled: None, roles };
        let (mut places, mut axes, mut found) = (Vec::new(), Vec::new(), 0);
        for name in notation.fields(names).map(unquoted) {
            let title = || shortened(name.text);
            if let Some(role) = columns.beside(name)? {
                let is_twice = role != Role::Passed && columns.roles.contains(&role);
                name.check(!is_twice, format_args!("`{}` appears twice", title()))?;
                columns.roles.push(role);
                continue;
            }
            let (plain, axis) = axis(name.text);
            let place = place(plain);
            if found > 0 && axes.is_empty() == axis.is_some() {
                return Err(name.error("only some names end with an axis (x, y or z)").into());
            }
            axes.extend(axis);
            if found > 0 && places.is_empty() == place.is_some() {
                return Err(match place {
                    None => name.error(format!("`{}` has no row and column, but other names do", title())),
                    Some(_) => name.error("only some names have a row and a column"),
                }
                .into());
            }
            columns.roles.push(Role::Tactel(found));
            places.extend(place);
            found += 1;
        }
        // One and the same axis everywhere is that of a pad with one axis.
        if axes.iter().all(|axis| *axis == axes[0]) {
            axes.clear();
        }
        columns.size = if places.is_empty() {
            let size @ [rows, cols] = hints.size(None)?;
            let message = format_args!("these are the names of {found} tactels, not of {rows} by {cols}");
            names.check(rows.checked_mul(cols) == Some(found), message)?;
            size
        } else {
            let size = columns.settle(&places, &axes).map_err(|message| names.error(message))?;
            hints.size(Some(size))?
        };
        columns.take_time_unit(hints)?;
        Ok(columns)
    }

    /// Takes over the unit of the times from the hints.
    fn take_time_unit(&mut self, hints: &Hints) -> Result<(), Refusal> {
        let Some(second) = hints.time_unit else { return Ok(()) };
        let refused = |message: &str| Err(Refusal::Contradicted { hint: "time_unit", message: message.into() });
        if !self.roles.contains(&Role::Time) {
            return refused("the file has no column with the time");
        }
        if self.unlabelled.take().is_none() && second.to_bits() != self.second.to_bits() {
            return refused("the name of the column gives another unit");
        }
        self.second = second;
        Ok(())
    }

    /// Returns whether the tactels have three axes.
    pub(super) fn has_axes(&self) -> bool {
        self.roles.iter().any(|role| matches!(role, Role::Drag(..)))
    }

    /// Gives each tactel the index of its place, and returns the size of the array. Places count from 0 or from 1, and
    /// each must appear once, or once with each axis.
    fn settle(&mut self, places: &[Place], axes: &[usize]) -> Result<[usize; 2], String> {
        let (mut first, mut last) = (places[0], places[0]);
        for (row, col) in places {
            first = (first.0.min(*row), first.1.min(*col));
            last = (last.0.max(*row), last.1.max(*col));
        }
        if first.0 > 1 || first.1 > 1 {
            return Err("the names of the tactels must count rows and columns from 0 or from 1".into());
        }
        let [rows, cols] = [(last.0 - first.0) as usize + 1, (last.1 - first.1) as usize + 1];
        let (found, values) = (places.len(), if axes.is_empty() { 1 } else { AXES.len() });
        if rows.checked_mul(cols).and_then(|tactels| tactels.checked_mul(values)) != Some(found) {
            let each = if values > 1 { " with three axes each" } else { "" };
            return Err(format!("the names reach {rows} rows by {cols} columns{each}, but there are {found} names"));
        }
        let mut is_there = vec![false; found];
        let tactels = self.roles.iter_mut().filter(|role| matches!(role, Role::Tactel(_)));
        for (i, (role, (row, col))) in tactels.zip(places).enumerate() {
            let index = (row - first.0) as usize * cols + (col - first.1) as usize;
            let axis = axes.get(i).copied();
            if std::mem::replace(&mut is_there[index * values + axis.unwrap_or(0)], true) {
                let axis = axis.map_or_else(String::new, |axis| format!(" with the axis {}", AXES[axis]));
                return Err(format!("row {row} and column {col}{axis} appear twice"));
            }
            *role = match axis {
                Some(axis @ (0 | 1)) => Role::Drag(index, axis as u8),
                _ => Role::Tactel(index),
            };
        }
        Ok([rows, cols])
    }

    /// Returns the role of a column beside the tactels, or `None` for a tactel.
    fn beside(&mut self, name: Piece<'_>) -> Result<Option<Role>, TextError> {
        let lower = if name.text.len() > 40 { String::new() } else { name.text.to_lowercase() };
        let (base, unit) = match lower.split_once(['[', '(']) {
            Some((base, unit)) => (base.trim(), unit.trim_end_matches([']', ')']).trim()),
            None => lower.rsplit_once('_').unwrap_or((&lower, "")),
        };
        match base {
            "time" | "t" | "timestamp" | "zeit" => {}
            "force" if matches!(unit, "" | "n") => return Ok(Some(Role::Force)),
            "force" => return Err(name.error("the unit of `force` must be `N`")),
            "frame" | "index" if unit.is_empty() => return Ok(Some(Role::Passed)),
            "" if name.text.is_empty() => return Ok(Some(Role::Passed)),
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
        self.unlabelled = unit.is_empty().then(|| shortened(name.text).to_string());
        Ok(Some(Role::Time))
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

/// Splits the name of an axis of a tactel, such as `t0_3_x` or `r0c3z`, into the name of the tactel and the axis.
fn axis(name: &str) -> (&str, Option<usize>) {
    let axis = name.chars().next_back().and_then(|last| AXES.iter().position(|axis| last.eq_ignore_ascii_case(axis)));
    let plain = name[..name.len() - usize::from(axis.is_some())].trim_end_matches(['_', '.', ' ', '-']);
    match axis {
        Some(axis) if place(plain).is_some() => (plain, Some(axis)),
        _ => (name, None),
    }
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
