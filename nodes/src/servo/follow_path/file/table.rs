//! Points from a CSV file: a header that names the columns x, y and z, and a row for each point.
//!
//! The columns can be in any order, and others are left out. A header may state the unit of a column, which must be
//! metres: `x [m]`. Blank lines do not count.

use nalgebra::Vector3;

use super::{MAX_POINTS, Points, Refused, coordinate};

/// A cell and its byte offset.
type Cell<'t> = (usize, &'t str);

/// How to fix a header.
const HEADER_HELP: &str = "write `x,y,z` as the first line, and the coordinates in metres below it";

/// Reads the points of a table.
pub(super) fn read(text: &str) -> Result<Points, Refused> {
    // A byte order mark is no part of the first name.
    let content = text.strip_prefix('\u{feff}').unwrap_or(text);
    let mut lines = lines(content, text.len() - content.len());
    let Some(header) = lines.next() else {
        return Err(Refused::whole("the file is empty", HEADER_HELP));
    };
    let columns = [find(header, "x")?, find(header, "y")?, find(header, "z")?];
    let mut found = Points::default();
    for line in lines {
        if found.points.len() == MAX_POINTS {
            return Err(Refused::too_many());
        }
        found.points.push(point(line, columns)?);
        found.spans.push(line.0..line.0 + line.1.len());
    }
    Ok(found)
}

/// Returns the lines that are not blank, without surrounding blanks. The text begins at an offset.
pub(super) fn lines(text: &str, offset: usize) -> impl Iterator<Item = Cell<'_>> {
    let mut start = offset;
    let all = text.split('\n').map(move |line| {
        let begin = start;
        start += line.len() + 1;
        trimmed((begin, line))
    });
    all.filter(|(_, line)| !line.is_empty())
}

/// Returns the cells of a line.
fn cells((start, line): Cell<'_>) -> impl Iterator<Item = Cell<'_>> {
    let mut start = start;
    line.split(',').map(move |cell| {
        let begin = start;
        start += cell.len() + 1;
        trimmed((begin, cell))
    })
}

/// Returns a cell without surrounding blanks.
fn trimmed((start, text): Cell<'_>) -> Cell<'_> {
    (start + text.len() - text.trim_start().len(), text.trim())
}

/// Returns the index of the column of a name.
fn find(header: Cell<'_>, name: &str) -> Result<usize, Refused> {
    let is_named = |(_, (_, cell)): &(usize, Cell<'_>)| {
        let (word, unit) = cell.split_once('[').unwrap_or((*cell, "m]"));
        word.trim() == name && unit.trim() == "m]"
    };
    let mut matching = cells(header).enumerate().filter(is_named);
    match (matching.next(), matching.next()) {
        (Some((i, _)), None) => Ok(i),
        (Some(_), Some((_, (start, cell)))) => {
            Err(Refused::at(start..start + cell.len(), format!("two columns have the name `{name}`"), HEADER_HELP))
        }
        (None, _) => {
            let (start, line) = header;
            let end = start + line.len();
            Err(Refused::at(start..end, format!("the header has no column `{name}` in metres"), HEADER_HELP))
        }
    }
}

/// Reads the point of a line.
fn point(line: Cell<'_>, columns: [usize; 3]) -> Result<Vector3<f64>, Refused> {
    let mut point = [None; 3];
    for (i, (start, cell)) in cells(line).enumerate() {
        for axis in (0..3).filter(|axis| columns[*axis] == i) {
            point[axis] = Some(coordinate(cell, start)?);
        }
    }
    match point {
        [Some(x), Some(y), Some(z)] => Ok(Vector3::new(x, y, z)),
        _ => {
            let span = line.0..line.0 + line.1.len();
            Err(Refused::at(span, "this row has fewer cells than the header", "give each row an x, a y and a z"))
        }
    }
}
