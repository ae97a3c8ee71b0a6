//! The text of novel's pliance and pedar: a line of numbers for each moment, a column for each sensor.
//!
//! A file has a header, a line `time[secs]` with the numbers of the sensors, the pressures, a mean and a maximum over
//! time (`MVP`, `MPP`), the total force and its centre at each moment, and the corners of the sensors. The corners give
//! the place of each sensor: row 0 is at the lowest y, column 0 at the lowest x, so x and y are those of the file.
//! Places without a sensor are dead cells. A mat without corners needs a `size`, and is read row by row.
//!
//! The forces are checked against the pressures, within the rounding of the file. An insole of pedar is refused: its
//! sensors follow the sole and have no rows and columns.

mod mat;

use tactflow_runtime::signal::{Base, Unit};

use crate::recordings::common::reel::{Properties, Reel};
use crate::recordings::common::text::{Lines, Notation, Piece, shortened};
use crate::recordings::common::{FileFormat, FileHead, Hints, Recording, Refusal, TextError, Window, units};
use mat::{Corners, Mat};

pub(super) const FORMAT: FileFormat = FileFormat::text("novel-asc", "novel pliance text (.asc)", recognises, parse);

fn recognises(head: &FileHead<'_>) -> bool {
    let has = |word: &str| head.text.contains(word);
    has("scanning rate [Hz]") || (has("pressure values in") && has("time["))
}

#[derive(Default)]
struct AscReader<'t> {
    lines: Lines<'t>,
    notation: Notation,
    /// The unit of the pressures, and the nominal time between two moments.
    found: Properties,
    /// Whether the forces are those of only some sensors.
    has_masks: bool,
    /// Numbers of the sensors.
    labels: Vec<u64>,
    /// Factor from the file's times to seconds.
    second: f64,
    /// Times of the moments [s].
    times: Vec<f64>,
    /// Pressures, moment after moment.
    cells: Vec<f32>,
    corners: Corners,
    /// Total force at a time [s, N], and its place.
    forces: Vec<(f64, f64, Piece<'t>)>,
}

fn parse(text: &str, hints: &Hints) -> Result<Recording, Refusal> {
    let mut reader = AscReader { lines: Lines::new(text), second: 1.0, ..AscReader::default() };
    let labels = reader.head()?;
    reader.sensors(labels)?;
    let mut next = reader.pressures(text.len())?;
    while !next.text.is_empty() {
        next = reader.block(next)?;
    }
    reader.finish(hints)
}

impl<'t> AscReader<'t> {
    /// Reads the header, and returns the line of the sensors that ends it.
    fn head(&mut self) -> Result<Piece<'t>, Refusal> {
        for line in self.lines.by_ref().map(Piece::trimmed) {
            if line.after("time[").is_some() {
                return Ok(line);
            }
            if line.after("left insole").is_some() || line.after("right insole").is_some() {
                return Err(insole());
            }
            self.has_masks |= line.after("mask definition").is_some();
            if let Some(value) = find(line, "time per frame [secs]:") {
                self.found.period = Some(value.positive("`time per frame [secs]:`")?);
            }
            if let Some(value) = find(line, "scanning rate [Hz]:").filter(|_| self.found.period.is_none()) {
                self.found.period = Some(value.positive("`scanning rate [Hz]:`")?.recip());
            }
            if let Some(value) = find(line, "pressure values in") {
                self.found.unit = Some(units::parse(value)?);
            }
        }
        Err(self.lines.end().error("the line `time[secs]` with the sensors is missing").into())
    }

    /// Reads the line of the sensors.
    fn sensors(&mut self, line: Piece<'t>) -> Result<(), Refusal> {
        self.notation = Notation::of(line.text);
        self.second = if line.after("time[ms]").is_some() { 1e-3 } else { 1.0 };
        for field in self.notation.fields(line).skip(1) {
            let message = "the file has forces over time, but not the pressures of the sensors";
            field.check(!field.text.contains('['), message)?;
            self.labels.push(field.count("the number of this sensor")?);
        }
        let mut sorted = self.labels.clone();
        sorted.sort_unstable();
        let is_twice = sorted.windows(2).any(|pair| pair[0] == pair[1]);
        // The sensors of each foot count from 1 to 99.
        if is_twice && sorted.len() == 198 {
            return Err(insole());
        }
        line.check(!sorted.is_empty(), "this line has no sensors")?;
        line.check(!is_twice, "a sensor appears twice in this line")?;
        Ok(())
    }

    /// Reads the pressures, and returns the line after them.
    fn pressures(&mut self, bytes: usize) -> Result<Piece<'t>, TextError> {
        let sensors = self.labels.len();
        // A number takes at least one character and one separator.
        let most = bytes / (2 * sensors + 2);
        self.cells.reserve_exact((self.lines.clone().take(most).count() * sensors).min(bytes / 2));
        loop {
            let line = self.lines.next_filled();
            let mut fields = self.notation.fields(line);
            let time = fields.next().unwrap_or(line);
            if matches!(time.text, "MVP" | "MPP") || time.text.is_empty() && !line.text.is_empty() {
                continue;
            }
            if !time.text.starts_with(|c: char| c.is_ascii_digit() || c == '-' || c == '.') {
                return Ok(line);
            }
            let seconds = self.notation.number(time, "this time")? * self.second;
            time.check(self.times.last().is_none_or(|last| *last < seconds), "the time does not increase")?;
            let is_in_range = (0.0..1e9).contains(&seconds);
            time.check(is_in_range, format_args!("the time is not from 0 to 1e9 s: `{}`", shortened(time.text)))?;
            self.check_count(line, fields.clone().count(), "pressures")?;
            for field in fields {
                let value = (self.notation.number(field, "this pressure")? * self.found.factor()) as f32;
                let message = format_args!("this pressure is too large: `{}`", shortened(field.text));
                field.check(value.is_finite(), message)?;
                self.cells.push(value);
            }
            self.times.push(seconds);
        }
    }

    /// Checks that a line has a number for each sensor.
    fn check_count(&self, line: Piece<'t>, found: usize, what: &str) -> Result<(), TextError> {
        let (sensors, cut) = (self.labels.len(), self.lines.cut());
        line.check(found == sensors, format_args!("this line has {found} {what}, but there are {sensors} sensors{cut}"))
    }

    /// Reads the block that begins with a line, and returns the line after it.
    fn block(&mut self, line: Piece<'t>) -> Result<Piece<'t>, TextError> {
        let first = line.words().next().map_or("", |first| first.text);
        if first.starts_with("time[") {
            return self.total_forces(line);
        }
        if first.starts_with("corner") {
            self.corners.unit(line)?;
        } else if first == "sensor" {
            let labels: Vec<u64> = numbers(line, |field| field.count("the number of this sensor"))?;
            line.check(labels == self.labels, "these sensors differ from those of the pressures")?;
            self.corners.is_begun = true;
        } else if first.starts_with("x[") || first.starts_with("y[") || first == "area" {
            let places = numbers(line, |field| field.decimal("this figure"))?;
            self.check_count(line, places.len(), "numbers")?;
            // `x[0]` to `x[3]` are corners, `x[c]` is the centre.
            if first.split_once('[').is_some_and(|(_, which)| which.starts_with(|c: char| c.is_ascii_digit())) {
                self.corners.add(usize::from(first.starts_with('y')), &places);
            }
        }
        Ok(self.lines.next_filled())
    }

    /// Reads the total forces, and returns the line after them.
    fn total_forces(&mut self, head: Piece<'t>) -> Result<Piece<'t>, TextError> {
        head.check(head.text.contains("force"), "a second block of pressures is not supported")?;
        loop {
            let line = self.lines.next_filled();
            if !line.text.starts_with(|c: char| c.is_ascii_digit()) {
                return Ok(line);
            }
            let mut words = line.words();
            let time = words.next().unwrap_or(line).decimal("this time")? * self.second;
            let force = words.next().ok_or_else(|| line.error("the force at this time is missing"))?;
            self.forces.push((time, force.decimal("this force")?, force));
        }
    }

    fn finish(self, hints: &Hints) -> Result<Recording, Refusal> {
        self.lines.end().check(!self.times.is_empty(), "the file has no pressures")?;
        let sensors = self.labels.len();
        let mat = if self.corners.is_begun {
            self.corners.mat(sensors).map_err(|message| self.lines.end().error(message))?
        } else {
            Mat::row_by_row(hints.size(None)?, sensors).map_err(Refusal::broken)?
        };
        mat.pitch.map_or(Ok(()), |pitch| self.check_forces(pitch))?;
        let Mat { rows, cols, pitch, .. } = mat;
        let mut reel = Reel::default();
        reel.cells = mat.place(&self.cells);
        reel.dead = mat.dead();
        for (number, time) in (1..).zip(&self.times) {
            let time = ((time - self.times[0]) * 1e9).round() as i64;
            reel.frame(number, Some(time), Window::whole(rows, cols));
        }
        reel.finish(FORMAT.name, Properties { size: Some([rows, cols]), pitch, ..self.found }, hints)
    }

    /// Checks each total force against the pressures at its time.
    fn check_forces(&self, pitch: [f64; 2]) -> Result<(), TextError> {
        // Forces have three decimals in the file, and places have four.
        const ROUNDING: f64 = 5e-4;
        let area = pitch[0] * pitch[1];
        let sensors = self.labels.len();
        let is_pressure = self.found.unit.is_some_and(|(unit, _)| unit == Unit::of(Base::Kilopascal));
        for (time, force, at) in self.forces.iter().filter(|_| is_pressure && !self.has_masks) {
            let index = self.times.partition_point(|other| *other < time - 1e-6);
            if self.times.get(index).is_none_or(|other| *other > time + 1e-6) {
                continue;
            }
            let sum: f64 = self.cells[index * sensors..][..sensors].iter().map(|cell| f64::from(*cell)).sum();
            let newtons = 1e3 * area * sum;
            let rounding = ROUNDING + sensors as f64 * ROUNDING * 1e3 * area + 2e-3 * force.abs();
            let is_sum = (newtons - force).abs() <= 1.01 * rounding;
            let newtons = (newtons * 1e4).round() / 1e4;
            at.check(is_sum, format_args!("the total force is {force} N, but the pressures sum to {newtons} N"))?;
        }
        Ok(())
    }
}

fn insole() -> Refusal {
    let message = "an insole of pedar has no rows and columns: its sensors follow the sole and have different sizes";
    let help = "use the recording of a mat, or write the sensors that you need to a plain table";
    Refusal::Broken { message: message.into(), help: Some(help.into()) }
}

/// Returns the word after a key anywhere in a line.
fn find<'t>(line: Piece<'t>, key: &str) -> Option<Piece<'t>> {
    let (_, rest) = line.text.split_once(key)?;
    line.part(rest).words().next()
}

/// Returns the numbers after the first word of a line.
fn numbers<'t, T>(line: Piece<'t>, read: impl Fn(Piece<'t>) -> Result<T, TextError>) -> Result<Vec<T>, TextError> {
    line.words().skip(1).map(read).collect()
}

#[cfg(test)]
mod tests;
