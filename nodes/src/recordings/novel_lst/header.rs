//! The header of a page, and the line of column numbers that ends it.

use crate::recordings::common::text::{Notation, Piece, shortened};
use crate::recordings::common::{TextError, units};

/// Properties of the array; the first header counts.
#[derive(Debug, Default)]
pub(super) struct ListingHeader {
    /// Number of columns and of rows.
    pub(super) matrix: Option<[usize; 2]>,
    /// Sides of a sensor along x and along y [m], and the maximum relative error of their product from rounding.
    pub(super) sides: Option<([f64; 2], f64)>,
    /// Area of a sensor [m²], and its maximum relative error from rounding.
    area: Option<(f64, f64)>,
    /// Time between two pictures [s].
    pub(super) period: Option<f64>,
}

/// Properties of one page.
#[derive(Debug, Default)]
pub(super) struct PageHeader<'t> {
    /// Whether the page has a line that is not blank.
    pub(super) is_begun: bool,
    /// Number of the page, and its place.
    pub(super) number: Option<Label<'t>>,
    /// Number of the picture, and its place.
    pub(super) picture: Option<Label<'t>>,
    /// Whether it is a mean or a maximum over time.
    pub(super) is_summary: bool,
}

/// The columns of a page.
#[derive(Debug)]
pub(super) struct PageColumns<'t> {
    /// Notation of the rows.
    pub(super) notation: Notation,
    /// Numbers of the columns.
    pub(super) labels: Vec<Label<'t>>,
    /// Whether there is a last column and a last row of forces.
    pub(super) has_force: bool,
}

/// A number of a page, a picture, a row or a column, and its place.
pub(super) type Label<'t> = (u64, Piece<'t>);

/// Maximum number of a row or a column.
const MAX_LABEL: u64 = 100_000;

/// Parses the number of a row or a column.
pub(super) fn label<'t>(at: Piece<'t>, what: &str) -> Result<Label<'t>, TextError> {
    let label = at.count(&format!("the number of this {what}"))?;
    let message = format_args!("the number of this {what} must be from 1 to {MAX_LABEL}, not {label}");
    at.check((1..=MAX_LABEL).contains(&label), message)?;
    Ok((label, at))
}

impl<'t> PageColumns<'t> {
    /// Parses the line of the columns, or returns `None` for another line.
    pub(super) fn of(line: Piece<'t>) -> Result<Option<Self>, TextError> {
        let notation = Notation::of(line.text);
        let mut labels: Vec<Label<'t>> = Vec::new();
        let mut has_force = false;
        for field in notation.fields(line) {
            let is_number = !field.text.is_empty() && field.text.bytes().all(|byte| byte.is_ascii_digit());
            match labels.last() {
                Some(_) if !has_force && field.text.eq_ignore_ascii_case("Force") => has_force = true,
                // A line of words and numbers belongs to the header.
                _ if has_force || !is_number => return Ok(None),
                last => {
                    let (label, _) = label(field, "column")?;
                    if let Some((last, _)) = last {
                        field.check(label == last + 1, format_args!("column {label} comes after column {last}"))?;
                    }
                    labels.push((label, field));
                }
            }
        }
        Ok((!labels.is_empty()).then_some(Self { notation, labels, has_force }))
    }
}

impl ListingHeader {
    /// Reads a line of a header.
    pub(super) fn read<'t>(&mut self, line: Piece<'t>, page: &mut PageHeader<'t>) -> Result<(), TextError> {
        page.is_begun |= !line.text.is_empty();
        if let Some(rest) = line.after("Page") {
            let at = rest.words().next().unwrap_or(rest);
            page.number = Some((at.count("the number of this page")?, at));
        }
        if line.after("Pict").is_some() {
            let at = number_in(line);
            page.picture = Some((at.count("the number of this picture")?, at));
        }
        // The name of a file may contain any word.
        let is_summary = |word: Piece<'_>| word.text.starts_with("MVP") || word.text.starts_with("MPP");
        page.is_summary |= line.after("File").is_none() && line.words().any(is_summary);
        once(&mut self.matrix, line, "Matrix:", matrix)?;
        once(&mut self.sides, line, "Sensor size:", sides)?;
        once(&mut self.area, line, "Sensor area:", area)?;
        once(&mut self.period, line, "Time/picture:", period)
    }

    /// Area of a sensor [m²], and its maximum relative error from rounding.
    pub(super) fn area_of_sensor(&self) -> Option<(f64, f64)> {
        let product = self.sides.map(|([x, y], slack)| (x * y, slack));
        match (product, self.area) {
            (Some((product, slack)), Some((area, rough))) if (product - area).abs() <= (slack + rough) * area => {
                Some((product, slack))
            }
            (product, area) => area.or(product),
        }
    }
}

/// Parses the value of a key, the first time that a line has the key: the text after it, up to the next tab.
fn once<'t, T>(
    property: &mut Option<T>,
    line: Piece<'t>,
    key: &str,
    parse: fn(Piece<'t>, &str) -> Result<T, TextError>,
) -> Result<(), TextError> {
    if let Some((_, rest)) = line.text.split_once(key)
        && property.is_none()
    {
        let value = rest.trim_start().split('\t').next().unwrap_or("");
        *property = Some(parse(line.part(value).trimmed(), &format!("`{key}`"))?);
    }
    Ok(())
}

/// Parses `64x95`.
fn matrix(value: Piece<'_>, key: &str) -> Result<[usize; 2], TextError> {
    let [cols, rows] = pair(value, key)?;
    let count = |piece| Ok(usize::try_from(label(piece, "column")?.0).expect("a label is small"));
    Ok([count(cols)?, count(rows)?])
}

/// Parses `0.500x0.500 cm` to the sides [m] and the maximum relative error of their product.
fn sides(value: Piece<'_>, key: &str) -> Result<([f64; 2], f64), TextError> {
    let metres = length(value, key)?;
    let [x, y] = pair(value, key)?;
    let (width, height) = (x.positive(key)?, y.positive(key)?);
    let slack = 0.505 * digit(x.text) / width + 0.505 * digit(y.text) / height;
    Ok(([width * metres, height * metres], slack))
}

/// Parses `0.25 cm²` to the area [m²] and its maximum relative error.
fn area(value: Piece<'_>, key: &str) -> Result<(f64, f64), TextError> {
    let metres = length(value, key)?;
    let at = number_in(value);
    let area = at.positive(key)?;
    Ok((area * metres * metres, 0.505 * digit(at.text) / area))
}

/// Parses `10.0 ms`.
fn period(value: Piece<'_>, key: &str) -> Result<f64, TextError> {
    let at = number_in(value);
    let time = at.positive(key)?;
    let unit = value.text[at.start - value.start + at.text.len()..].trim_start();
    match unit.to_lowercase() {
        name if name.starts_with("ms") => Ok(time * 1e-3),
        name if name.starts_with('s') => Ok(time),
        _ => Err(value.error(format!("the unit of {key} must be `ms` or `s`, not `{}`", shortened(unit)))),
    }
}

/// Returns the first number in a piece, or all of the piece.
fn number_in(piece: Piece<'_>) -> Piece<'_> {
    let Some(start) = piece.text.find(|c: char| c.is_ascii_digit()) else { return piece };
    let rest = &piece.text[start..];
    let end = rest.find(|c: char| !(c.is_ascii_digit() || c == '.' || c == ','));
    piece.part(&rest[..end.unwrap_or(rest.len())])
}

/// Parses the two numbers of `64x95`.
fn pair<'t>(value: Piece<'t>, key: &str) -> Result<[Piece<'t>; 2], TextError> {
    let parts = value.text.split_once(['x', 'X', '*']).map(|(a, b)| [a, b].map(|part| number_in(value.part(part))));
    let has_digit = |part: &Piece<'_>| part.text.starts_with(|c: char| c.is_ascii_digit());
    let strange = || format!("expected `columns x rows` after {key}, found `{}`", shortened(value.text));
    parts.filter(|parts| parts.iter().all(has_digit)).ok_or_else(|| value.error(strange()))
}

/// Returns the factor to metres of the unit in `0.500x0.500 cm` or `0.25 cm²`.
fn length(value: Piece<'_>, key: &str) -> Result<f64, TextError> {
    let mut words = value.text.split(|c: char| !c.is_ascii_alphabetic());
    let name = words.find(|word| !matches!(*word, "" | "x" | "X")).unwrap_or("");
    let strange = || format!("the unit of {key} must be `cm` or `mm`, not `{}`", shortened(value.text));
    units::metres(name).ok_or_else(|| value.error(strange()))
}

/// Returns the value of the last digit of a number.
pub(super) fn digit(number: &str) -> f64 {
    let decimals = number.split_once(['.', ',']).map_or(0, |(_, decimals)| decimals.len().min(9));
    (0..decimals).fold(1.0, |digit, _| digit / 10.0)
}
