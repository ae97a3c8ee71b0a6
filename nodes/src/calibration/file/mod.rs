//! A calibration as a file: TOML, one line a tactel, for people to read and to compare.
//!
//! Numbers are written with as many digits as 32 bits need, so what is read is what was written, bit for bit. Every
//! tactel stands in the file, with a curve or as dead. A mistake knows its place in the text, and nothing is allocated
//! from the size that the file claims before its tactels are counted.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::ops::Range;

use tactflow_runtime::node::{At, Count, Param, Reader, read_leaf};
use tactflow_runtime::params;
use tactflow_runtime::signal::Unit;
use tactflow_runtime::source::{Item, SourceMap, Value, parse_table};

use super::curve::KINDS;
use super::{Calibration, Curve, Kind, Tactel};

/// What is wrong with a file, and where.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Flaw {
    /// The place.
    pub span: Range<usize>,
    /// What is wrong.
    pub message: String,
    /// What to do.
    pub help: Option<String>,
}

/// The most flaws that are told of one file.
const MOST_FLAWS: usize = 8;

/// The most knots of a curve. The node has room for as many for every tactel as the one with the most has.
const MOST_KNOTS: usize = 64;

/// The version of the format that is written, and the only one that is read.
const VERSION: u64 = 1;

/// What `kind` says in a calibration file.
const KIND: &str = "calibration";

/// A value that is read later.
#[derive(Debug, Clone)]
struct Later(Value);

impl Param for Later {
    const EXPECTS: &'static str = "a list of tables, one a tactel";

    fn read(value: &Value, _: &mut Reader<'_>) -> Option<Self> {
        Some(Self(value.clone()))
    }
}

impl Param for Kind {
    const EXPECTS: &'static str = "`linear`, `rational` or `piecewise`";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let name: String = read_leaf(value, reader, Self::EXPECTS)?;
        let found = KINDS.into_iter().find(|kind| kind.name() == name);
        if found.is_none() {
            reader.wrong_type(value, Self::EXPECTS);
        }
        found
    }
}

params! {
    Header:
    /// That it is a calibration.
    kind: String,
    /// Version of the format.
    version: u64,
    /// Sort of the curves.
    curve: Kind,
    /// Number of rows.
    rows: Count,
    /// Number of columns.
    cols: Count,
    /// Unit of what the sensor reads.
    reading: Unit,
    /// Unit of what comes out.
    unit: Unit,
    /// Tactels that measure nothing, as `[row, column]` from 0.
    dead: Vec<Later> = Vec::new(),
    /// The others.
    tactels: Vec<Later>,
}

params! {
    LinearLine:
    /// Row and column, from 0.
    at: [usize; 2],
    /// What it reads unloaded [reading].
    offset: f64,
    /// Slope [unit per reading].
    gain: f64,
}

params! {
    RationalLine:
    /// Row and column, from 0.
    at: [usize; 2],
    /// What it reads unloaded [reading].
    offset: f64,
    /// Slope at the zero [unit per reading].
    gain: f64,
    /// One over the reading beyond the offset that no force reaches [1 per reading].
    squash: f64,
    /// Largest force that was calibrated [unit].
    most: f64,
}

params! {
    PiecewiseLine:
    /// Row and column, from 0.
    at: [usize; 2],
    /// What it reads unloaded [reading].
    offset: f64,
    /// Readings beyond the offset, at the knots [reading].
    readings: Vec<f64>,
    /// Forces at the knots [unit].
    forces: Vec<f64>,
}

/// Whether a text is a calibration file, sound or not.
#[must_use]
pub fn is_calibration(text: &str) -> bool {
    let mut sources = SourceMap::default();
    let parsed = parse_table(sources.add("", text, ""));
    parsed.is_ok_and(|value| {
        value.as_table().and_then(|table| table.get("kind")).is_some_and(|kind| kind.as_str() == Some(KIND))
    })
}

/// Reads a calibration file.
///
/// # Errors
/// What is wrong with it, the first few mistakes at once.
pub fn read(text: &str) -> Result<Calibration, Vec<Flaw>> {
    let mut sources = SourceMap::default();
    let root = parse_table(sources.add("", text, "")).map_err(|mistakes| {
        let flaw = |mistake: tactflow_runtime::source::Diagnostic| flaw(&mistake.span, mistake.message.clone());
        // After the first, the reader of TOML is lost: in a file that is none it is as wrong in each line.
        mistakes.into_iter().take(1).map(flaw).collect::<Vec<_>>()
    })?;
    let mut file = File { reader: Reader::new(&sources), flaws: Vec::new() };
    let calibration = file.whole(&root);
    let mut flaws = file.flaws;
    flaws.extend(file.reader.mistakes.into_iter().map(|mistake| Flaw {
        span: if let At::Span(span) = mistake.at { span } else { root.span.clone() },
        message: mistake.message,
        help: mistake.help,
    }));
    flaws.sort_by_key(|flaw| flaw.span.start);
    flaws.truncate(MOST_FLAWS);
    match calibration {
        Some(calibration) if flaws.is_empty() => Ok(calibration),
        _ => Err(flaws),
    }
}

fn flaw(span: &Range<usize>, message: impl Into<String>) -> Flaw {
    Flaw { span: span.clone(), message: message.into(), help: None }
}

/// Where the value of `key` stands in a table, or the table itself.
fn place(table: &Value, key: &str) -> Range<usize> {
    table.as_table().and_then(|table| table.get(key)).unwrap_or(table).span.clone()
}

/// A file that is being read.
struct File<'s> {
    reader: Reader<'s>,
    flaws: Vec<Flaw>,
}

impl File<'_> {
    fn whole(&mut self, root: &Value) -> Option<Calibration> {
        let table = root.as_table()?;
        let is_kind = |value: &Value| value.as_str() == Some(KIND);
        if !table.get("kind").is_some_and(is_kind) {
            let help =
                format!("a calibration file says `kind = \"{KIND}\"`; `tactflow calibrate` makes one from a log");
            let flaw = flaw(&table.get("kind").map_or(0..0, |kind| kind.span.clone()), "this is no calibration file");
            self.flaws.push(Flaw { help: Some(help), ..flaw });
            return None;
        }
        if let Some((_, version)) = table.entry("version").filter(|(_, value)| value.item != Item::Integer(1)) {
            let message = format!("this tool reads version {VERSION} of the format, not {}", version.described());
            self.flaws.push(flaw(&version.span, message));
            return None;
        }
        let header = Header::read(root, &mut self.reader)?;
        let (rows, cols) = (header.rows.0, header.cols.0);
        let mut tactels = BTreeMap::new();
        for Later(value) in &header.dead {
            let at = <[usize; 2]>::read(value, &mut self.reader);
            self.put(&mut tactels, [rows, cols], at, &value.span, None);
        }
        for Later(value) in &header.tactels {
            let (at, tactel) = self.tactel(header.curve, value).unzip();
            self.put(&mut tactels, [rows, cols], at, &place(value, "at"), tactel);
        }
        let is_whole = self.reader.mistakes.is_empty() && self.flaws.is_empty();
        if is_whole && tactels.len() < rows * cols {
            let missing = (0..).find(|i| !tactels.contains_key(i)).expect("fewer than all are there");
            let message = format!("tactel [{}, {}] is missing", missing / cols, missing % cols);
            let rest = rows * cols - tactels.len() - 1;
            let message = if rest > 0 { format!("{message}, and {rest} more") } else { message };
            let help = "give it a curve, or list it under `dead`".to_owned();
            self.flaws.push(Flaw { help: Some(help), ..flaw(&place(root, "tactels"), message) });
            return None;
        }
        let tactels = tactels.into_values().collect();
        let Header { curve: kind, reading, unit, .. } = header;
        Some(Calibration { kind, rows, cols, reading, unit, tactels })
    }

    /// Puts a tactel into its place, which must be on the array and still free.
    fn put(
        &mut self,
        tactels: &mut BTreeMap<usize, Option<Tactel>>,
        [rows, cols]: [usize; 2],
        at: Option<[usize; 2]>,
        span: &Range<usize>,
        tactel: Option<Tactel>,
    ) {
        let Some([i, j]) = at else { return };
        if i >= rows || j >= cols {
            let message = format!("tactel [{i}, {j}] is not on an array of {rows} by {cols}");
            let help = Some("rows and columns count from 0".to_owned());
            self.flaws.push(Flaw { help, ..flaw(span, message) });
        } else if tactels.insert(i * cols + j, tactel).is_some() {
            self.flaws.push(flaw(span, format!("tactel [{i}, {j}] is given twice")));
        }
    }

    fn tactel(&mut self, kind: Kind, value: &Value) -> Option<([usize; 2], Tactel)> {
        let reader = &mut self.reader;
        let (at, offset, curve) = match kind {
            Kind::Linear => {
                let line = LinearLine::read(value, reader)?;
                (line.at, line.offset, Curve::Linear { gain: line.gain as f32 })
            }
            Kind::Rational => {
                let line = RationalLine::read(value, reader)?;
                let [gain, squash, most] = [line.gain, line.squash, line.most].map(|number| number as f32);
                (line.at, line.offset, Curve::Rational { gain, squash, most })
            }
            Kind::Piecewise => {
                let line = PiecewiseLine::read(value, reader)?;
                if line.readings.len() != line.forces.len() {
                    let message = format!("{} readings, but {} forces", line.readings.len(), line.forces.len());
                    self.flaws.push(flaw(&place(value, "forces"), message));
                    return None;
                }
                if line.readings.len() > MOST_KNOTS {
                    let message = format!("{} knots, but a curve has {MOST_KNOTS} at most", line.readings.len());
                    self.flaws.push(flaw(&place(value, "readings"), message));
                    return None;
                }
                let knots = line.readings.iter().zip(&line.forces).map(|(s, f)| [*s as f32, *f as f32]).collect();
                (line.at, line.offset, Curve::Piecewise { knots })
            }
        };
        let tactel = Tactel { offset: offset as f32, curve };
        if let Some((key, message)) = too_large(&tactel).or_else(|| tactel.curve.flaw()) {
            self.flaws.push(flaw(&place(value, key), message));
        }
        Some((at, tactel))
    }
}

/// A number that is more than 32 bits hold.
fn too_large(tactel: &Tactel) -> Option<(&'static str, String)> {
    let mut numbers = vec![("offset", tactel.offset)];
    match &tactel.curve {
        Curve::Linear { gain } => numbers.push(("gain", *gain)),
        Curve::Rational { gain, squash, most } => {
            numbers.extend([("gain", *gain), ("squash", *squash), ("most", *most)]);
        }
        Curve::Piecewise { knots } => {
            numbers.extend(knots.iter().flat_map(|[s, force]| [("readings", *s), ("forces", *force)]));
        }
    }
    let (key, _) = numbers.into_iter().find(|(_, number)| !number.is_finite())?;
    Some((key, "too large: images are of 32-bit floats".into()))
}

/// A calibration as the text of a file, with `origin` told in its first lines.
#[must_use]
pub fn write(calibration: &Calibration, origin: &str) -> String {
    let Calibration { kind, rows, cols, reading, unit, tactels } = calibration;
    let mut text = String::from("# The calibration of a tactile pad, for `calibrate`: `file = \"…\"`.\n");
    origin.lines().for_each(|line| text.push_str(&format!("# {line}\n")));
    let formula = match kind {
        Kind::Linear => "force = gain s, with s = reading - offset",
        Kind::Rational => "force = gain s / (1 - squash s), with s = reading - offset, from 0 up to the force `most`",
        Kind::Piecewise => "straight lines from 0 through (readings, forces), with readings counted from offset",
    };
    let units = match kind {
        Kind::Linear => format!("offset [{reading}], gain [{unit} per {reading}]"),
        Kind::Rational => {
            format!("offset [{reading}], gain [{unit} per {reading}], squash [1 per {reading}], most [{unit}]")
        }
        Kind::Piecewise => format!("offset [{reading}], readings [{reading}], forces [{unit}]"),
    };
    let dead: Vec<String> =
        (0..tactels.len()).filter(|i| tactels[*i].is_none()).map(|i| format!("[{}, {}]", i / cols, i % cols)).collect();
    let head = format!(
        "# {formula}.\nkind = \"{KIND}\"\nversion = {VERSION}\ncurve = \"{kind}\"\nrows = {rows}\ncols = {cols}\n\
         reading = \"{reading}\"\nunit = \"{unit}\"\n\n# They measure nothing and are 0, as [row, column] from 0.\n\
         dead = [{}]\n\n# At [row, column] from 0: {units}.\ntactels = [\n",
        dead.join(", ")
    );
    text.push_str(&head);
    for (i, tactel) in tactels.iter().enumerate() {
        let Some(Tactel { offset, curve }) = tactel else { continue };
        let line = match curve {
            Curve::Linear { gain } => format!("gain = {gain:?}"),
            Curve::Rational { gain, squash, most } => format!("gain = {gain:?}, squash = {squash:?}, most = {most:?}"),
            Curve::Piecewise { knots } => {
                let list = |k: usize| knots.iter().map(|knot| format!("{:?}", knot[k])).collect::<Vec<_>>().join(", ");
                format!("readings = [{}], forces = [{}]", list(0), list(1))
            }
        };
        let at = format!("[{}, {}]", i / cols, i % cols);
        writeln!(text, "  {{ at = {at}, offset = {offset:?}, {line} }},").expect("a string takes all");
    }
    text.push_str("]\n");
    text
}

#[cfg(test)]
mod tests;
