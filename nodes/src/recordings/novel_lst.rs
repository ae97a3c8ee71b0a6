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

use tactflow_runtime::signal::{Base, ImageShape, Unit};

use crate::recordings::common::text::{self, Lines, Piece, Wrong, flaw, shortened};
use crate::recordings::common::{Flaw, Format, Frame, Head, Hints, MAX_CELLS, Recording, Refusal, Window};
use header::{Grid, Header, Page, digit, label};

pub(super) const FORMAT: Format =
    Format { name: "novel-lst", title: "novel emed or pliance listing (.lst)", recognises, read };

fn recognises(head: &Head<'_>) -> bool {
    let has = |word: &str| head.text.contains(word);
    has("Matrix:") && (has("Pict-No") || has("Sensor size:") || has("novel "))
}

fn read(bytes: &[u8], hints: &Hints) -> Result<Recording, Refusal> {
    text::read(bytes, hints, parse)
}

/// A row or column of the array, and its place in the text.
type Reach<'t> = Option<(u64, Piece<'t>)>;

struct Reader<'t> {
    lines: Lines<'t>,
    header: Header,
    /// Factor from the file's unit to kPa, once the forces have shown it.
    factor: Option<f64>,
    /// Value of the last digit of a cell.
    cell_digit: f64,
    page: Option<u64>,
    /// Pictures of the measurements before this one.
    before: u64,
    /// Whether any page ended with a form feed.
    has_feeds: bool,
    frames: Vec<Frame>,
    cells: Vec<f32>,
    /// The last row and the last column of all pages.
    reach: [Reach<'t>; 2],
}

/// A force in the listing, for a row, a column or a page of cells.
struct Force<'t> {
    /// Place in the text.
    figure: Piece<'t>,
    /// Row, column or page.
    what: &'static str,
    /// Sum of the cells, in the file's unit.
    sum: f64,
    count: usize,
}

fn parse(text: &str, hints: &Hints) -> Result<Recording, Wrong> {
    let mut reader = Reader {
        lines: Lines::new(text),
        header: Header::default(),
        factor: None,
        cell_digit: 1.0,
        page: None,
        before: 0,
        has_feeds: false,
        // A page has at least 24 characters.
        frames: Vec::with_capacity(text.matches("Pict").count().min(text.len() / 24)),
        cells: Vec::new(),
        reach: [None, None],
    };
    while reader.page()? {}
    reader.finish(hints)
}

impl<'t> Reader<'t> {
    /// Reads a page, and returns whether there was one.
    fn page(&mut self) -> Result<bool, Flaw> {
        let mut page = Page::default();
        let grid = loop {
            let Some(line) = self.lines.next() else {
                return if page.is_begun {
                    flaw(&self.lines.end(), "the file ends in the header of a page: it is truncated")
                } else {
                    Ok(false)
                };
            };
            self.has_feeds |= line.text.contains('\u{c}');
            let line = line.trimmed();
            if let Some(grid) = Grid::of(line)? {
                break grid;
            }
            self.header.read(line, &mut page)?;
        };
        self.number(&page)?;
        let number = self.picture(&page, &grid)?;
        let start = self.cells.len();
        let window = self.rows(&grid)?;
        match number {
            Some(number) => self.frames.push(Frame { number, time: 0, window, start }),
            None => self.cells.truncate(start),
        }
        Ok(true)
    }

    /// Checks that no page is missing.
    fn number(&mut self, page: &Page<'t>) -> Result<(), Flaw> {
        if let Some((number, at)) = page.number {
            match self.page {
                Some(last) if last.checked_add(1) != Some(number) => {
                    return flaw(&at, format!("page {number} comes after page {last}"));
                }
                _ => self.page = Some(number),
            }
        }
        Ok(())
    }

    /// Returns the number of a page's picture, or `None` for a summary. It keeps counting across measurements.
    fn picture(&mut self, page: &Page<'t>, grid: &Grid<'t>) -> Result<Option<u64>, Flaw> {
        let Some((number, at)) = page.picture else {
            return if page.is_summary {
                Ok(None)
            } else {
                flaw(&grid.columns[0].1, "`Pict-No.:` is missing on this page")
            };
        };
        if number > 1_000_000_000 {
            return flaw(&at, format!("the number of a picture must be at most 1000000000, not {number}"));
        }
        let Some(last) = self.frames.last() else { return Ok(Some(number)) };
        if number == self.frames[0].number {
            self.before = last.number + 1 - number;
        } else if number + self.before <= last.number {
            return flaw(&at, format!("picture {number} comes after picture {}", last.number - self.before));
        }
        Ok(Some(number + self.before))
    }

    /// Reads the rows of a page, and returns its window in the array.
    fn rows(&mut self, grid: &Grid<'t>) -> Result<Window, Flaw> {
        let cols = grid.columns.len();
        let start = self.cells.len();
        let mut first: Reach<'t> = None;
        let mut last: Reach<'t> = None;
        loop {
            let next = self.lines.next();
            let is_feed = next.is_some_and(|line| line.text.contains('\u{c}'));
            self.has_feeds |= is_feed;
            let line = next.map_or_else(|| self.lines.end(), Piece::trimmed);
            if line.after("Force").is_some() && first.is_some() {
                self.forces(grid, line, start)?;
                break;
            }
            if line.text.is_empty() {
                let is_cut = grid.has_force || (next.is_none() && self.has_feeds);
                if is_cut || first.is_none() {
                    let count = (self.cells.len() - start) / cols;
                    return flaw(&line, format!("the page ends after {count} rows: it is truncated"));
                }
                break;
            }
            let label = self.row(grid, line, last)?;
            first = first.or(Some(label));
            last = Some(label);
        }
        let (first, last) = (first.zip(last)).ok_or_else(|| {
            let at = self.lines.end();
            Flaw { span: at.span(), message: "this page has no rows".into() }
        })?;
        Ok(self.window(grid, first, last))
    }

    fn window(&mut self, grid: &Grid<'t>, first: (u64, Piece<'t>), last: (u64, Piece<'t>)) -> Window {
        let (left, right) = (grid.columns[0].0, grid.columns[grid.columns.len() - 1]);
        for (reach, label) in self.reach.iter_mut().zip([last, right]) {
            *reach = Some(reach.filter(|reach| reach.0 >= label.0).unwrap_or(label));
        }
        let index = |label: u64| u32::try_from(label - 1).expect("a label is small");
        let (rows, cols) = (index(last.0 - first.0 + 2), index(right.0 - left + 2));
        Window { top: index(first.0), left: index(left), rows, cols }
    }

    /// Reads one row, and returns its number.
    fn row(&mut self, grid: &Grid<'t>, line: Piece<'t>, last: Reach<'t>) -> Result<(u64, Piece<'t>), Flaw> {
        let mut fields = grid.notation.fields(line);
        let at = fields.next().expect("the line is not empty");
        let label = label(at, "row")?;
        if let Some((last, _)) = last
            && label != last + 1
        {
            return flaw(&at, format!("row {label} comes after row {last}"));
        }
        let (found, wanted) = (fields.clone().count(), grid.columns.len() + usize::from(grid.has_force));
        if found != wanted {
            let cut = if self.lines.is_at_end() { ": the file ends in the middle of it" } else { "" };
            return flaw(
                &line,
                format!("row {label} has {found} numbers, but the header of its page has {wanted}{cut}"),
            );
        }
        let mut sum = 0.0;
        for cell in fields.by_ref().take(grid.columns.len()) {
            let value = match cell.text {
                "" | "-" => 0.0,
                _ => grid.notation.number(cell, "this cell")?,
            };
            self.cell_digit = digit(cell.text);
            if !(value as f32 * 10.0).is_finite() {
                return flaw(&cell, format!("this cell is too large: `{}`", shortened(cell.text)));
            }
            sum += value;
            self.cells.push(value as f32);
        }
        if let Some(figure) = fields.next() {
            self.check(grid, &Force { figure, what: "row", sum, count: grid.columns.len() })?;
        }
        Ok((label, at))
    }

    /// Checks the last row of a page: the forces of its columns and of the page.
    fn forces(&mut self, grid: &Grid<'t>, line: Piece<'t>, start: usize) -> Result<(), Flaw> {
        let cols = grid.columns.len();
        let fields = grid.notation.fields(line).skip(1);
        let found = fields.clone().count();
        if found != cols + 1 && (grid.has_force || found != cols) {
            return flaw(
                &line,
                format!("the row `Force` has {found} numbers, but the header of its page has {}", cols + 1),
            );
        }
        let count = (self.cells.len() - start) / cols;
        let sum = |column: usize| -> f64 {
            self.cells[start..].iter().skip(column).step_by(cols).map(|cell| f64::from(*cell)).sum()
        };
        let mut sums: Vec<f64> = (0..cols).map(sum).collect();
        sums.push(sums.iter().sum());
        for (column, (figure, sum)) in fields.zip(sums).enumerate() {
            let (count, what) = if column < cols { (count, "column") } else { (count * cols, "page") };
            self.check(grid, &Force { figure, what, sum, count })?;
        }
        Ok(())
    }

    /// Checks a force against its cells, within their rounding. The first nonzero force shows the unit of the cells.
    fn check(&mut self, grid: &Grid<'t>, force: &Force<'t>) -> Result<(), Flaw> {
        let Force { figure, what, sum, count } = *force;
        let listed = match figure.text {
            "" | "-" => 0.0,
            _ => grid.notation.number(figure, "the force")?,
        };
        let Some((area, slack)) = self.header.area_of_sensor() else { return Ok(()) };
        // A square metre of 1 kPa is 1000 N.
        let newtons = |factor: f64| sum * factor * 1e3 * area;
        let agrees = |factor: f64| {
            let rounding = digit(figure.text) + self.cell_digit * count as f64 * factor * 1e3 * area;
            (newtons(factor) - listed).abs() <= 0.505 * rounding + slack * listed.abs()
        };
        match self.factor {
            None if agrees(KILOPASCAL) && agrees(NEWTON_PER_CM2) => return Ok(()),
            None if agrees(NEWTON_PER_CM2) => self.factor = Some(NEWTON_PER_CM2),
            _ => {}
        }
        let factor = *self.factor.get_or_insert(KILOPASCAL);
        if agrees(factor) {
            return Ok(());
        }
        let made = (newtons(factor) * 1e4).round() / 1e4;
        flaw(&figure, format!("the force of this {what} is {listed} N, but its cells sum to {made} N"))
    }

    fn finish(mut self, hints: &Hints) -> Result<Recording, Wrong> {
        if self.frames.is_empty() {
            return Err(Flaw { span: self.lines.end().span(), message: "the file has no picture".into() }.into());
        }
        let [rows, cols] = self.size(hints)?;
        let period = hints.period(self.header.period)?;
        let unit = hints.unit(Some(Unit::of(Base::Kilopascal)))?;
        let pitch = hints.pitch(self.header.size)?;
        let factor = self.factor.unwrap_or(KILOPASCAL) as f32;
        self.cells.iter_mut().for_each(|cell| *cell *= factor);
        let start = self.frames[0].number;
        for frame in &mut self.frames {
            frame.time = ((frame.number - start) as f64 * period * 1e9).round() as i64;
        }
        let shape = ImageShape { rows, cols, pitch, unit };
        let Self { frames, cells, .. } = self;
        Ok(Recording { format: FORMAT.name, shape, frames, cells, dead: vec![], threshold: None, period, force: None })
    }

    /// Returns the number of rows and of columns of the whole array.
    fn size(&self, hints: &Hints) -> Result<[usize; 2], Wrong> {
        let reach = self.reach.map(|reach| reach.expect("a picture has rows and columns"));
        let holds = |size: &[usize; 2]| (0..2).all(|k| reach[k].0 <= size[k] as u64);
        // The file has `columns x rows`; some programs write `rows x columns`.
        let matrix = self.header.matrix.map(|[cols, rows]| {
            let turned = [cols, rows];
            if !holds(&[rows, cols]) && holds(&turned) { turned } else { [rows, cols] }
        });
        let size = hints.size(matrix)?;
        if !holds(&size) {
            let worst = usize::from(reach[0].0 <= size[0] as u64);
            let (label, at) = reach[worst];
            let name = ["row", "column"][worst];
            let message = format!("{name} {label} is outside the array of {} rows and {} columns", size[0], size[1]);
            return Err(Flaw { span: at.span(), message }.into());
        }
        if size[0].checked_mul(size[1]).is_none_or(|cells| cells > MAX_CELLS) {
            let message = format!("an array of {} by {} has more than {MAX_CELLS} cells", size[0], size[1]);
            return Err(Refusal::broken(message).into());
        }
        Ok(size)
    }
}

/// Factors from the units of a listing to kPa.
const KILOPASCAL: f64 = 1.0;
const NEWTON_PER_CM2: f64 = 10.0;

#[cfg(test)]
mod tests;
