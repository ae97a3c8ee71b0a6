//! The listing of novel's emed and pliance: a page for each picture, cropped to the loaded part of the array.
//!
//! A page has a header, a line of column numbers and a line for each row that begins with its number. Where forces are
//! listed too, it has a last column and a last row `Force`: sum times sensor area [N]. Rows and columns count from 1 in
//! the whole array, `Matrix: columns x rows`. Pages of a mean or a maximum over time (`MVP`, `MPP`) are not pictures.
//! Pressures are in kPa, or in N/cm² where the forces show it.
//!
//! The forces are checked against the cells, within the rounding of the file. They also show that a page is complete;
//! without them the form feed at its end does. The numbers of the pages show that none is missing.

mod header;

use tactflow_runtime::signal::{Base, Unit};

use crate::recordings::common::reel::{Properties, Reel};
use crate::recordings::common::text::{Lines, Notation, Piece, shortened};
use crate::recordings::common::{FileFormat, FileHead, Hints, MAX_CELLS, Recording, Refusal, TextError, Window};
use header::{Label, ListingHeader, PageColumns, PageHeader, digit};

pub(super) const FORMAT: FileFormat =
    FileFormat::text("novel-lst", "novel emed or pliance listing (.lst)", recognises, parse);

fn recognises(head: &FileHead<'_>) -> bool {
    let has = |word: &str| head.text.contains(word);
    has("Matrix:") && (has("Pict-No") || has("Sensor size:") || has("novel "))
}

#[derive(Default)]
struct ListingReader<'t> {
    lines: Lines<'t>,
    header: ListingHeader,
    /// Factor from the file's unit to kPa, once the forces have shown it.
    factor: Option<f64>,
    /// Value of the last digit of a cell.
    cell_digit: f64,
    page: Option<u64>,
    /// Pictures of the measurements before this one.
    before: u64,
    /// Whether any page ended with a form feed.
    has_feeds: bool,
    reel: Reel,
    /// The last row and the last column of all pages.
    reach: [Option<Label<'t>>; 2],
}

fn parse(text: &str, hints: &Hints) -> Result<Recording, Refusal> {
    let mut reader = ListingReader { lines: Lines::new(text), cell_digit: 1.0, ..ListingReader::default() };
    // A page has at least 24 characters.
    reader.reel.frames.reserve_exact(text.matches("Pict").count().min(text.len() / 24));
    while reader.page()? {}
    reader.finish(hints)
}

impl<'t> ListingReader<'t> {
    /// Returns the next line, or `None` at the end of the file.
    fn line(&mut self) -> Option<Piece<'t>> {
        let line = self.lines.next()?;
        self.has_feeds |= line.text.contains('\u{c}');
        Some(line.trimmed())
    }

    /// Reads a page, and returns whether there was one.
    fn page(&mut self) -> Result<bool, TextError> {
        let mut page = PageHeader::default();
        let columns = loop {
            let Some(line) = self.line() else {
                let message = "the file ends in the header of a page: it is truncated";
                return self.lines.end().check(!page.is_begun, message).map(|()| false);
            };
            if let Some(columns) = PageColumns::of(line)? {
                break columns;
            }
            self.header.read(line, &mut page)?;
        };
        // No page may be missing.
        if let Some((number, at)) = page.number {
            if let Some(last) = self.page {
                let follows = last.checked_add(1) == Some(number);
                at.check(follows, format_args!("page {number} comes after page {last}"))?;
            }
            self.page = Some(number);
        }
        let number = self.picture(&page, &columns)?;
        let start = self.reel.cells.len();
        let window = self.rows(&columns)?;
        match number {
            Some(number) => self.reel.frame(number, None, window),
            None => self.reel.cells.truncate(start),
        }
        Ok(true)
    }

    /// Returns the number of a page's picture, or `None` for a summary. It keeps counting across measurements.
    fn picture(&mut self, page: &PageHeader<'t>, columns: &PageColumns<'t>) -> Result<Option<u64>, TextError> {
        let Some((number, at)) = page.picture else {
            let (_, at) = columns.labels[0];
            return at.check(page.is_summary, "`Pict-No.:` is missing on this page").map(|()| None);
        };
        let message = format_args!("the number of a picture must be at most {MAX_PICTURE}, not {number}");
        at.check(number <= MAX_PICTURE, message)?;
        if let (Some(first), Some(last)) = (self.reel.frames.first(), self.reel.frames.last()) {
            if number == first.number {
                self.before = last.number + 1 - number;
            }
            let is_next = number + self.before > last.number;
            at.check(is_next, format_args!("picture {number} comes after picture {}", last.number - self.before))?;
        }
        Ok(Some(number + self.before))
    }

    /// Reads the rows of a page, and returns its window in the array.
    fn rows(&mut self, columns: &PageColumns<'t>) -> Result<Window, TextError> {
        let cols = columns.labels.len();
        let start = self.reel.cells.len();
        let mut first = None;
        let mut last = None;
        loop {
            let next = self.line();
            let line = next.unwrap_or_else(|| self.lines.end());
            if line.after("Force").is_some() && first.is_some() {
                self.forces(columns, line, start)?;
                break;
            }
            if line.text.is_empty() {
                let is_cut = columns.has_force || (next.is_none() && self.has_feeds) || first.is_none();
                let count = (self.reel.cells.len() - start) / cols;
                line.check(!is_cut, format_args!("the page ends after {count} rows: it is truncated"))?;
                break;
            }
            let label = self.row(columns, line, last)?;
            first = first.or(Some(label));
            last = Some(label);
        }
        let rows = first.zip(last).ok_or_else(|| self.lines.end().error("this page has no rows"))?;
        Ok(self.window(columns, rows))
    }

    /// Returns the window of a page from its first and its last row.
    fn window(&mut self, columns: &PageColumns<'t>, (top, bottom): (Label<'t>, Label<'t>)) -> Window {
        let (left, right) = (columns.labels[0], columns.labels[columns.labels.len() - 1]);
        for (reach, label) in self.reach.iter_mut().zip([bottom, right]) {
            *reach = Some(reach.filter(|reach| reach.0 >= label.0).unwrap_or(label));
        }
        let index = |label: u64| u32::try_from(label - 1).expect("a label is small");
        let (rows, cols) = (index(bottom.0 - top.0 + 2), index(right.0 - left.0 + 2));
        Window { top: index(top.0), left: index(left.0), rows, cols }
    }

    /// Reads one row, and returns its number.
    fn row(
        &mut self,
        columns: &PageColumns<'t>,
        line: Piece<'t>,
        last: Option<Label<'t>>,
    ) -> Result<Label<'t>, TextError> {
        let mut fields = columns.notation.fields(line);
        let (label, at) = header::label(fields.next().expect("the line is not empty"), "row")?;
        if let Some((last, _)) = last {
            at.check(label == last + 1, format_args!("row {label} comes after row {last}"))?;
        }
        let cols = columns.labels.len();
        let (found, wanted) = (fields.clone().count(), cols + usize::from(columns.has_force));
        let cut = self.lines.cut();
        let message = format_args!("row {label} has {found} numbers, but the header of its page has {wanted}{cut}");
        line.check(found == wanted, message)?;
        let mut sum = 0.0;
        for cell in fields.by_ref().take(cols) {
            let value = number(columns.notation, cell, "this cell")?;
            self.cell_digit = digit(cell.text);
            let is_small = (value as f32 * NEWTON_PER_CM2 as f32).is_finite();
            cell.check(is_small, format_args!("this cell is too large: `{}`", shortened(cell.text)))?;
            sum += value;
            self.reel.cells.push(value as f32);
        }
        if let Some(force) = fields.next() {
            self.check(columns, force, "row", sum, cols)?;
        }
        Ok((label, at))
    }

    /// Checks the last row of a page: the forces of its columns and of the page.
    fn forces(&mut self, columns: &PageColumns<'t>, line: Piece<'t>, start: usize) -> Result<(), TextError> {
        let cols = columns.labels.len();
        let fields = columns.notation.fields(line).skip(1);
        let found = fields.clone().count();
        let is_whole = found == cols + 1 || (!columns.has_force && found == cols);
        let message = format_args!("the row `Force` has {found} numbers, but the header of its page has {}", cols + 1);
        line.check(is_whole, message)?;
        let cells = &self.reel.cells[start..];
        let count = cells.len() / cols;
        let sum = |column: usize| cells.iter().skip(column).step_by(cols).map(|cell| f64::from(*cell)).sum();
        let sums: Vec<f64> = (0..cols).map(sum).collect();
        let page = ("page", sums.iter().sum(), count * cols);
        let sums = sums.into_iter().map(|sum| ("column", sum, count)).chain([page]);
        fields.zip(sums).try_for_each(|(force, (what, sum, count))| self.check(columns, force, what, sum, count))
    }

    /// Checks the force of a row, a column or a page against the sum of its `count` cells, within their rounding. The
    /// first nonzero force shows the unit of the cells.
    fn check(
        &mut self,
        columns: &PageColumns<'t>,
        force: Piece<'t>,
        what: &str,
        sum: f64,
        count: usize,
    ) -> Result<(), TextError> {
        let listed = number(columns.notation, force, "the force")?;
        let Some((area, slack)) = self.header.area_of_sensor() else { return Ok(()) };
        // A square metre of 1 kPa is 1000 N.
        let newtons = |factor: f64| sum * factor * 1e3 * area;
        let agrees = |factor: f64| {
            let rounding = digit(force.text) + self.cell_digit * count as f64 * factor * 1e3 * area;
            (newtons(factor) - listed).abs() <= 0.505 * rounding + slack * listed.abs()
        };
        let factor = match self.factor {
            Some(factor) => factor,
            None if agrees(KILOPASCAL) && agrees(NEWTON_PER_CM2) => return Ok(()),
            None if agrees(NEWTON_PER_CM2) => NEWTON_PER_CM2,
            None => KILOPASCAL,
        };
        let made = (newtons(factor) * 1e4).round() / 1e4;
        let message = format_args!("the force of this {what} is {listed} N, but its cells sum to {made} N");
        force.check(agrees(factor), message)?;
        self.factor = Some(factor);
        Ok(())
    }

    fn finish(mut self, hints: &Hints) -> Result<Recording, Refusal> {
        self.lines.end().check(!self.reel.frames.is_empty(), "the file has no picture")?;
        let size = Some(self.size(hints)?);
        let factor = self.factor.unwrap_or(KILOPASCAL) as f32;
        self.reel.cells.iter_mut().for_each(|cell| *cell *= factor);
        let unit = Some((Unit::of(Base::Kilopascal), 1.0));
        let pitch = self.header.sides.map(|(sides, _)| sides);
        let found = Properties { size, unit, pitch, period: self.header.period, ..Properties::default() };
        let mut recording = self.reel.finish(FORMAT.name, found, hints)?;
        let start = recording.frames[0].number;
        for frame in &mut recording.frames {
            frame.time = ((frame.number - start) as f64 * recording.period * 1e9).round() as i64;
        }
        Ok(recording)
    }

    /// Returns the number of rows and of columns of the whole array.
    fn size(&self, hints: &Hints) -> Result<[usize; 2], Refusal> {
        let reach = self.reach.map(|reach| reach.expect("a picture has rows and columns"));
        let holds = |size: &[usize; 2]| (0..2).all(|k| reach[k].0 <= size[k] as u64);
        // The file has `columns x rows`; some programs write `rows x columns`.
        let matrix = self.header.matrix.map(|[cols, rows]| {
            let turned = [cols, rows];
            if !holds(&[rows, cols]) && holds(&turned) { turned } else { [rows, cols] }
        });
        let size = hints.size(matrix)?;
        let [rows, cols] = size;
        for ((label, at), (count, name)) in reach.into_iter().zip([(rows, "row"), (cols, "column")]) {
            let message = format_args!("{name} {label} is outside the array of {rows} rows and {cols} columns");
            at.check(label <= count as u64, message)?;
        }
        if rows.checked_mul(cols).is_none_or(|cells| cells > MAX_CELLS) {
            return Err(Refusal::broken(format!("an array of {rows} by {cols} has more than {MAX_CELLS} cells")));
        }
        Ok(size)
    }
}

/// Parses a number of a listing; an empty field and `-` are 0.
fn number(notation: Notation, field: Piece<'_>, what: &str) -> Result<f64, TextError> {
    if matches!(field.text, "" | "-") { Ok(0.0) } else { notation.number(field, what) }
}

/// Maximum number of a picture.
const MAX_PICTURE: u64 = 1_000_000_000;

/// Factors from the units of a listing to kPa.
const KILOPASCAL: f64 = 1.0;
const NEWTON_PER_CM2: f64 = 10.0;

#[cfg(test)]
mod tests;
