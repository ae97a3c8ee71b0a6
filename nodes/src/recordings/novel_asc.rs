//! The text of novel's pliance and pedar: a line of numbers for each moment, a column for each sensor.
//!
//! A file has a header, a line `time[secs]` with the numbers of the sensors, the pressures, a mean and a maximum over
//! time (`MVP`, `MPP`), the total force and its centre at each moment, and the corners of the sensors. The corners give
//! the place of each sensor: row 0 is at the lowest y, column 0 at the lowest x, so x and y are those of the file. Places
//! without a sensor are dead cells. A mat without corners needs a `size`, and is read row by row.
//!
//! The forces are checked against the pressures, within the rounding of the file. An insole of pedar is refused: its
//! sensors follow the sole and have no rows and columns.

mod layout;

use tactflow_runtime::signal::{ImageShape, Unit};

use crate::recordings::common::text::{self, Lines, Notation, Piece, Wrong, flaw, shortened};
use crate::recordings::common::{Flaw, Format, Frame, Head, Hints, Recording, Refusal, Window, units};
use layout::{Corners, Layout};

pub(super) const FORMAT: Format = Format { name: "novel-asc", title: "novel pliance text (.asc)", recognises, read };

fn recognises(head: &Head<'_>) -> bool {
    let has = |word: &str| head.text.contains(word);
    has("scanning rate [Hz]") || (has("pressure values in") && has("time["))
}

fn read(bytes: &[u8], hints: &Hints) -> Result<Recording, Refusal> {
    text::read(bytes, hints, parse)
}

struct Reader<'t> {
    lines: Lines<'t>,
    notation: Notation,
    /// Nominal time between two moments [s].
    period: Option<f64>,
    /// Unit of the pressures, and the factor from the file's unit to it.
    unit: Option<(Unit, f64)>,
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

fn parse(text: &str, hints: &Hints) -> Result<Recording, Wrong> {
    let mut reader = Reader {
        lines: Lines::new(text),
        notation: Notation::of(""),
        period: None,
        unit: None,
        has_masks: false,
        labels: Vec::new(),
        second: 1.0,
        times: Vec::new(),
        cells: Vec::new(),
        corners: Corners::default(),
        forces: Vec::new(),
    };
    let labels = reader.head()?;
    reader.sensors(labels)?;
    let mut next = reader.pressures(text.len())?;
    while let Some(line) = next {
        next = reader.block(line)?;
    }
    reader.finish(hints)
}

impl<'t> Reader<'t> {
    /// Reads the header, and returns the line of the sensors that ends it.
    fn head(&mut self) -> Result<Piece<'t>, Wrong> {
        for line in self.lines.by_ref() {
            let line = line.trimmed();
            if line.after("time[").is_some() {
                return Ok(line);
            }
            if line.after("left insole").is_some() || line.after("right insole").is_some() {
                return Err(insole());
            }
            self.has_masks |= line.after("mask definition").is_some();
            if let Some(value) = find(line, "time per frame [secs]:") {
                self.period = Some(positive(value, "`time per frame [secs]:`")?);
            }
            if let Some(value) = find(line, "scanning rate [Hz]:")
                && self.period.is_none()
            {
                self.period = Some(1.0 / positive(value, "`scanning rate [Hz]:`")?);
            }
            if let Some(value) = find(line, "pressure values in") {
                let unit = units::unit(value.text).ok_or_else(|| Flaw {
                    span: value.span(),
                    message: format!("the unit `{}` is unknown", shortened(value.text)),
                })?;
                self.unit = Some(unit);
            }
        }
        Err(Flaw { span: self.lines.end().span(), message: "the line `time[secs]` with the sensors is missing".into() }
            .into())
    }

    /// Reads the line of the sensors.
    fn sensors(&mut self, line: Piece<'t>) -> Result<(), Wrong> {
        self.notation = Notation::of(line.text);
        self.second = if line.after("time[ms]").is_some() { 1e-3 } else { 1.0 };
        for field in self.notation.fields(line).skip(1) {
            if field.text.contains('[') {
                let message = "the file has forces over time, but not the pressures of the sensors";
                return Err(Flaw { span: field.span(), message: message.into() }.into());
            }
            self.labels.push(field.count("the number of this sensor")?);
        }
        let mut sorted = self.labels.clone();
        sorted.sort_unstable();
        let is_twice = sorted.windows(2).any(|pair| pair[0] == pair[1]);
        match self.labels.len() {
            0 => Err(Flaw { span: line.span(), message: "this line has no sensors".into() }.into()),
            // The sensors of each foot count from 1 to 99.
            198 if is_twice => Err(insole()),
            _ if is_twice => {
                Err(Flaw { span: line.span(), message: "a sensor appears twice in this line".into() }.into())
            }
            _ => Ok(()),
        }
    }

    /// Reads the pressures, and returns the line after them.
    fn pressures(&mut self, bytes: usize) -> Result<Option<Piece<'t>>, Flaw> {
        let sensors = self.labels.len();
        // A number takes at least one character and one separator.
        let most = bytes / (2 * sensors + 2);
        self.cells.reserve_exact((self.lines.clone().take(most).count() * sensors).min(bytes / 2));
        while let Some(line) = self.lines.next() {
            let line = line.trimmed();
            let mut fields = self.notation.fields(line);
            let Some(time) = fields.next().filter(|first| !first.text.is_empty()) else { continue };
            if matches!(time.text, "MVP" | "MPP") {
                continue;
            }
            if !time.text.starts_with(|c: char| c.is_ascii_digit() || c == '-' || c == '.') {
                return Ok(Some(line));
            }
            let seconds = self.notation.number(time, "this time")? * self.second;
            if self.times.last().is_some_and(|last| *last >= seconds) {
                return flaw(&time, "the time does not increase");
            }
            if !(0.0..1e9).contains(&seconds) {
                return flaw(&time, format!("the time is not from 0 to 1e9 s: `{}`", shortened(time.text)));
            }
            let found = fields.clone().count();
            if found != sensors {
                let cut = if self.lines.is_at_end() { ": the file ends in the middle of it" } else { "" };
                return flaw(&line, format!("this line has {found} pressures, but there are {sensors} sensors{cut}"));
            }
            for field in fields {
                let factor = self.unit.map_or(1.0, |(_, factor)| factor);
                let value = (self.notation.number(field, "this pressure")? * factor) as f32;
                if !value.is_finite() {
                    return flaw(&field, format!("this pressure is too large: `{}`", shortened(field.text)));
                }
                self.cells.push(value);
            }
            self.times.push(seconds);
        }
        Ok(None)
    }

    /// Reads the block that begins with a line, and returns the line after it.
    fn block(&mut self, line: Piece<'t>) -> Result<Option<Piece<'t>>, Flaw> {
        let first = line.words().next().map_or("", |first| first.text);
        if first.starts_with("time[") {
            return self.total_forces(line);
        }
        if first.starts_with("corner") {
            self.corners.unit(line)?;
        } else if first == "sensor" {
            let labels: Vec<u64> = numbers(line, |field| field.count("the number of this sensor"))?;
            if labels != self.labels {
                return flaw(&line, "these sensors are not those of the pressures");
            }
            self.corners.is_begun = true;
        } else if first.starts_with("x[") || first.starts_with("y[") || first == "area" {
            let places = numbers(line, |field| field.decimal("this figure"))?;
            if places.len() != self.labels.len() {
                let cut = if self.lines.is_at_end() { ": the file ends in the middle of it" } else { "" };
                let message =
                    format!("this line has {} numbers, but there are {} sensors{cut}", places.len(), self.labels.len());
                return flaw(&line, message);
            }
            // `x[0]` to `x[3]` are corners, `x[c]` is the centre.
            if first.split_once('[').is_some_and(|(_, which)| which.starts_with(|c: char| c.is_ascii_digit())) {
                self.corners.add(usize::from(first.starts_with('y')), &places);
            }
        }
        Ok(self.next_line())
    }

    fn next_line(&mut self) -> Option<Piece<'t>> {
        self.lines.by_ref().map(Piece::trimmed).find(|line| !line.text.is_empty())
    }

    /// Reads the total forces, and returns the line after them.
    fn total_forces(&mut self, head: Piece<'t>) -> Result<Option<Piece<'t>>, Flaw> {
        if !head.text.contains("force") {
            return flaw(&head, "a second block of pressures is not supported");
        }
        while let Some(line) = self.next_line() {
            if !line.text.starts_with(|c: char| c.is_ascii_digit()) {
                return Ok(Some(line));
            }
            let mut words = line.words();
            let time = words.next().unwrap_or(line).decimal("this time")? * self.second;
            match words.next() {
                Some(force) => self.forces.push((time, force.decimal("this force")?, force)),
                None => return flaw(&line, "the force at this time is missing"),
            }
        }
        Ok(None)
    }

    fn finish(self, hints: &Hints) -> Result<Recording, Wrong> {
        if self.times.is_empty() {
            return Err(Flaw { span: self.lines.end().span(), message: "the file has no pressures".into() }.into());
        }
        let unit = hints.unit(self.unit.map(|(unit, _)| unit))?;
        let period = hints.period(self.period.or_else(|| mean_step(&self.times)))?;
        let layout = if self.corners.is_begun {
            let layout = self
                .corners
                .layout(self.labels.len())
                .map_err(|message| Flaw { span: self.lines.end().span(), message })?;
            hints.size(Some([layout.rows, layout.cols]))?;
            hints.pitch(Some(layout.pitch))?;
            self.check_forces(&layout)?;
            layout
        } else {
            let size = hints.size(None)?;
            Layout::rows(size, hints.pitch(None)?, self.labels.len()).map_err(Refusal::broken)?
        };
        let Layout { rows, cols, pitch, .. } = layout;
        let frames = (0..self.times.len()).map(|index| Frame {
            number: index as u64 + 1,
            time: ((self.times[index] - self.times[0]) * 1e9).round() as i64,
            window: Window::whole(rows, cols),
            start: index * rows * cols,
        });
        Ok(Recording {
            format: FORMAT.name,
            shape: ImageShape { rows, cols, pitch, unit },
            frames: frames.collect(),
            cells: layout.place(&self.cells),
            dead: layout.dead(),
            threshold: None,
            period,
            force: None,
        })
    }

    /// Checks each total force against the pressures at its time.
    fn check_forces(&self, layout: &Layout) -> Result<(), Flaw> {
        // Forces have three decimals in the file, and places have four.
        const ROUNDING: f64 = 5e-4;
        let area = layout.pitch[0] * layout.pitch[1];
        let sensors = self.labels.len();
        let is_pressure = self.unit.is_some_and(|(unit, _)| unit.to_string() == "kPa");
        for (time, force, at) in self.forces.iter().filter(|_| is_pressure && !self.has_masks) {
            let index = self.times.partition_point(|other| *other < time - 1e-6);
            if self.times.get(index).is_none_or(|other| *other > time + 1e-6) {
                continue;
            }
            let sum: f64 = self.cells[index * sensors..][..sensors].iter().map(|cell| f64::from(*cell)).sum();
            let made = 1e3 * area * sum;
            let rounding = ROUNDING + sensors as f64 * ROUNDING * 1e3 * area + 2e-3 * force.abs();
            if (made - force).abs() > 1.01 * rounding {
                let made = (made * 1e4).round() / 1e4;
                return flaw(at, format!("the total force is {force} N, but the pressures sum to {made} N"));
            }
        }
        Ok(())
    }
}

fn insole() -> Wrong {
    let message = "an insole of pedar has no rows and columns: its sensors follow the sole and have different sizes";
    let help = "use the recording of a mat, or write the sensors that you need to a plain table";
    Refusal::Broken { message: message.into(), help: Some(help.into()) }.into()
}

fn mean_step(times: &[f64]) -> Option<f64> {
    match times {
        [first, .., last] => Some((last - first) / (times.len() - 1) as f64),
        _ => None,
    }
}

/// Returns the word after a key anywhere in a line.
fn find<'t>(line: Piece<'t>, key: &str) -> Option<Piece<'t>> {
    let at = line.text.find(key)?;
    line.part(&line.text[at + key.len()..]).words().next()
}

fn positive(at: Piece<'_>, key: &str) -> Result<f64, Flaw> {
    let number = at.decimal(key)?;
    if number > 0.0 { Ok(number) } else { flaw(&at, format!("{key} must be greater than 0")) }
}

/// Returns the numbers after the first word of a line.
fn numbers<'t, T>(line: Piece<'t>, read: impl Fn(Piece<'t>) -> Result<T, Flaw>) -> Result<Vec<T>, Flaw> {
    line.words().skip(1).map(read).collect()
}

#[cfg(test)]
mod tests;
