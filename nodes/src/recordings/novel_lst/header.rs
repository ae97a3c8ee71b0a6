//! The header of a page, and the line of column numbers that ends it.

use crate::recordings::common::text::{Notation, Piece, flaw, shortened};
use crate::recordings::common::{Flaw, units};

/// Properties of the array; the first header counts.
#[derive(Debug, Default)]
pub(super) struct Header {
    /// Number of columns and of rows.
    pub(super) matrix: Option<[usize; 2]>,
    /// Side of a sensor along x and along y [m].
    pub(super) size: Option<[f64; 2]>,
    /// Maximum relative error of the product of the sides from rounding.
    slack: f64,
    /// Area of a sensor [m²], and its maximum relative error from rounding.
    area: Option<(f64, f64)>,
    /// Time between two pictures [s].
    pub(super) period: Option<f64>,
}

/// Properties of one page.
#[derive(Debug, Default)]
pub(super) struct Page<'t> {
    /// Whether the page has a line that is not blank.
    pub(super) is_begun: bool,
    /// Number of the page, and its place.
    pub(super) number: Option<(u64, Piece<'t>)>,
    /// Number of the picture, and its place.
    pub(super) picture: Option<(u64, Piece<'t>)>,
    /// Whether it is a mean or a maximum over time.
    pub(super) is_summary: bool,
}

/// The columns of a page.
#[derive(Debug)]
pub(super) struct Grid<'t> {
    /// Notation of the rows.
    pub(super) notation: Notation,
    /// Numbers of the columns, and their places.
    pub(super) columns: Vec<(u64, Piece<'t>)>,
    /// Whether there is a last column and a last row of forces.
    pub(super) has_force: bool,
}

/// Parses the number of a row or a column, from 1 to 100000.
pub(super) fn label(at: Piece<'_>, what: &str) -> Result<u64, Flaw> {
    let label = at.count(&format!("the number of this {what}"))?;
    if label == 0 || label > 100_000 {
        return flaw(&at, format!("the number of this {what} must be from 1 to 100000, not {label}"));
    }
    Ok(label)
}

impl<'t> Grid<'t> {
    /// Parses the line of the columns, or returns `None` for another line.
    pub(super) fn of(line: Piece<'t>) -> Result<Option<Self>, Flaw> {
        let notation = Notation::of(line.text);
        let mut columns: Vec<(u64, Piece<'t>)> = Vec::new();
        let mut has_force = false;
        for field in notation.fields(line) {
            let is_number = !field.text.is_empty() && field.text.bytes().all(|byte| byte.is_ascii_digit());
            match columns.last() {
                _ if has_force => return Ok(None),
                Some(_) if field.text.eq_ignore_ascii_case("Force") => has_force = true,
                // A line of words and numbers belongs to the header.
                _ if !is_number => return Ok(None),
                None => columns.push((label(field, "column")?, field)),
                Some((last, _)) => {
                    let label = label(field, "column")?;
                    if label != last + 1 {
                        return flaw(&field, format!("column {label} comes after column {last}"));
                    }
                    columns.push((label, field));
                }
            }
        }
        Ok((!columns.is_empty()).then_some(Self { notation, columns, has_force }))
    }
}

impl Header {
    /// Reads a line of a header.
    pub(super) fn read<'t>(&mut self, line: Piece<'t>, page: &mut Page<'t>) -> Result<(), Flaw> {
        page.is_begun |= !line.text.is_empty();
        if let Some(rest) = line.after("Page") {
            let at = rest.words().next().unwrap_or(rest);
            page.number = Some((at.count("the number of this page")?, at));
        }
        if line.after("Pict").is_some() {
            let at = number_in(line).unwrap_or(line);
            page.picture = Some((at.count("the number of this picture")?, at));
        }
        // The name of a file may contain any word.
        let name = line.after("File").is_some();
        page.is_summary |=
            !name && line.words().any(|word| word.text.starts_with("MVP") || word.text.starts_with("MPP"));
        if let Some(value) = find(line, "Matrix:")
            && self.matrix.is_none()
        {
            let [cols, rows] = pair(value, "`Matrix:`")?;
            let count = |piece: Piece<'t>| Ok(usize::try_from(label(piece, "column")?).expect("a label is small"));
            self.matrix = Some([count(cols)?, count(rows)?]);
        }
        if let Some(value) = find(line, "Sensor size:")
            && self.size.is_none()
        {
            self.size(value)?;
        }
        if let Some(value) = find(line, "Sensor area:")
            && self.area.is_none()
        {
            self.area(value)?;
        }
        if let Some(value) = find(line, "Time/picture:")
            && self.period.is_none()
        {
            self.period(value)?;
        }
        Ok(())
    }

    /// Parses `0.500x0.500 cm`.
    fn size(&mut self, value: Piece<'_>) -> Result<(), Flaw> {
        let metres = length(value, "`Sensor size:`")?;
        let sides = pair(value, "`Sensor size:`")?;
        let mut size = [0.0; 2];
        self.slack = 0.0;
        for (side, at) in size.iter_mut().zip(sides) {
            let number = positive(at, "`Sensor size:`")?;
            *side = number * metres;
            self.slack += 0.505 * digit(at.text) / number;
        }
        self.size = Some(size);
        Ok(())
    }

    /// Parses `0.25 cm²`.
    fn area(&mut self, value: Piece<'_>) -> Result<(), Flaw> {
        let metres = length(value, "`Sensor area:`")?;
        let at = number_in(value).unwrap_or(value);
        let area = positive(at, "`Sensor area:`")?;
        self.area = Some((area * metres * metres, 0.505 * digit(at.text) / area));
        Ok(())
    }

    /// Parses `10.0 ms`.
    fn period(&mut self, value: Piece<'_>) -> Result<(), Flaw> {
        let at = number_in(value).unwrap_or(value);
        let time = positive(at, "`Time/picture:`")?;
        let unit = value.text[at.start - value.start + at.text.len()..].trim_start();
        let second = match unit.to_lowercase() {
            unit if unit.starts_with("ms") => 1e-3,
            unit if unit.starts_with('s') => 1.0,
            _ => {
                return flaw(
                    &value,
                    format!("the unit of `Time/picture:` must be `ms` or `s`, not `{}`", shortened(unit)),
                );
            }
        };
        self.period = Some(time * second);
        Ok(())
    }

    /// Area of a sensor [m²], and its maximum relative error from rounding.
    pub(super) fn area_of_sensor(&self) -> Option<(f64, f64)> {
        let product = self.size.map(|[x, y]| (x * y, self.slack));
        match (product, self.area) {
            (Some((product, slack)), Some((area, rough))) if (product - area).abs() <= (slack + rough) * area => {
                Some((product, slack))
            }
            (product, area) => area.or(product),
        }
    }
}

/// Returns the text after a key anywhere in a line, up to the next tab.
fn find<'t>(line: Piece<'t>, key: &str) -> Option<Piece<'t>> {
    let at = line.text.find(key)?;
    let rest = line.text[at + key.len()..].trim_start();
    Some(line.part(rest.split('\t').next().unwrap_or(rest)).trimmed())
}

fn is_number(c: char) -> bool {
    c.is_ascii_digit() || c == '.' || c == ','
}

/// Returns the first number in a piece.
fn number_in(piece: Piece<'_>) -> Option<Piece<'_>> {
    let start = piece.text.find(|c: char| c.is_ascii_digit())?;
    let rest = &piece.text[start..];
    Some(piece.part(&rest[..rest.find(|c| !is_number(c)).unwrap_or(rest.len())]))
}

/// Parses the two numbers of `64x95`.
fn pair<'t>(value: Piece<'t>, key: &str) -> Result<[Piece<'t>; 2], Flaw> {
    let parts = value.text.split_once(['x', 'X', '*']).map(|(a, b)| [value.part(a), value.part(b)]);
    let [a, b] = parts.map_or([None; 2], |parts| parts.map(number_in));
    match (a, b) {
        (Some(a), Some(b)) => Ok([a, b]),
        _ => flaw(&value, format!("expected `columns x rows` after {key}, found `{}`", shortened(value.text))),
    }
}

fn positive(at: Piece<'_>, key: &str) -> Result<f64, Flaw> {
    let number = at.decimal(key)?;
    if number > 0.0 { Ok(number) } else { flaw(&at, format!("{key} must be greater than 0")) }
}

/// Returns the factor to metres of the unit in `0.500x0.500 cm` or `0.25 cm²`.
fn length(value: Piece<'_>, key: &str) -> Result<f64, Flaw> {
    let mut words = value.text.split(|c: char| !c.is_ascii_alphabetic());
    let name = words.find(|word| !matches!(*word, "" | "x" | "X")).unwrap_or("");
    match units::metres(name) {
        Some(metres) => Ok(metres),
        None => flaw(&value, format!("the unit of {key} must be `cm` or `mm`, not `{}`", shortened(value.text))),
    }
}

/// Returns the value of the last digit of a number.
pub(super) fn digit(number: &str) -> f64 {
    let decimals = number.split_once(['.', ',']).map_or(0, |(_, decimals)| decimals.len().min(9));
    (0..decimals).fold(1.0, |digit, _| digit / 10.0)
}
