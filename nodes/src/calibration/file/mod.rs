//! A calibration as a TOML file with one line a tactel, easy to read and to compare.
//!
//! Numbers have enough digits for 32 bits, so a file that is written and read again gives the same bits. Every tactel is
//! in the file, with a curve or as dead. A mistake has its place in the text. No memory is allocated from the size in the
//! header before the tactels are counted.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::ops::Range;

use tactflow_runtime::node::{At, Count, Param, Reader, read_leaf};
use tactflow_runtime::params;
use tactflow_runtime::signal::Unit;
use tactflow_runtime::source::{Item, SourceMap, Value, parse_table};

use super::curve::KINDS;
use super::{Calibration, Curve, Kind, Tactel};

/// A mistake in a file, with its place.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Flaw {
    /// Byte range in the text.
    pub span: Range<usize>,
    /// What is wrong.
    pub message: String,
    /// What to do instead.
    pub help: Option<String>,
}

/// Maximum number of flaws that are reported for one file.
const MAX_FLAWS: usize = 8;

/// Maximum number of knots of a curve. The node reserves the same number of knots for every tactel.
const MAX_KNOTS: usize = 64;

/// Version of the format.
const VERSION: u64 = 1;

/// Value of `kind` in a calibration file.
const KIND: &str = "calibration";

/// A value that is parsed later.
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
    /// `calibration`.
    kind: String,
    /// Version of the format.
    version: u64,
    /// Kind of the curves.
    curve: Kind,
    /// Number of rows.
    rows: Count,
    /// Number of columns.
    cols: Count,
    /// Unit of the readings.
    reading: Unit,
    /// Unit of the forces.
    unit: Unit,
    /// Tactels that give no force, as `[row, column]` from 0.
    dead: Vec<Later> = Vec::new(),
    /// The other tactels.
    tactels: Vec<Later>,
}

params! {
    LinearLine:
    /// Row and column, from 0.
    at: [usize; 2],
    /// Unloaded reading [reading].
    offset: f64,
    /// Slope [unit per reading].
    gain: f64,
}

params! {
    RationalLine:
    /// Row and column, from 0.
    at: [usize; 2],
    /// Unloaded reading [reading].
    offset: f64,
    /// Slope at the zero [unit per reading].
    gain: f64,
    /// One over the asymptote of the reading beyond the offset [1 per reading].
    squash: f64,
    /// Maximum calibrated force [unit].
    most: f64,
}

params! {
    PiecewiseLine:
    /// Row and column, from 0.
    at: [usize; 2],
    /// Unloaded reading [reading].
    offset: f64,
    /// Readings beyond the offset, at the knots [reading].
    readings: Vec<f64>,
    /// Forces at the knots [unit].
    forces: Vec<f64>,
}

/// Whether a text is a calibration file, with or without mistakes.
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
/// The first mistakes in it.
pub fn read(text: &str) -> Result<Calibration, Vec<Flaw>> {
    let mut sources = SourceMap::default();
    let root = parse_table(sources.add("", text, "")).map_err(|mistakes| {
        let flaw = |mistake: tactflow_runtime::source::Diagnostic| flaw(&mistake.span, mistake.message.clone());
        // Later mistakes follow from the first: a file that is not TOML has one on every line.
        mistakes.into_iter().take(1).map(flaw).collect::<Vec<_>>()
    })?;
    let mut file = File { reader: Reader::new(&sources), flaws: Vec::new() };
    let calibration = file.calibration(&root);
    let mut flaws = file.flaws;
    flaws.extend(file.reader.mistakes.into_iter().map(|mistake| Flaw {
        span: if let At::Span(span) = mistake.at { span } else { root.span.clone() },
        message: mistake.message,
        help: mistake.help,
    }));
    flaws.sort_by_key(|flaw| flaw.span.start);
    flaws.truncate(MAX_FLAWS);
    match calibration {
        Some(calibration) if flaws.is_empty() => Ok(calibration),
        _ => Err(flaws),
    }
}

fn flaw(span: &Range<usize>, message: impl Into<String>) -> Flaw {
    Flaw { span: span.clone(), message: message.into(), help: None }
}

/// Returns the place of the value of `key` in a table, or that of the table.
fn place(table: &Value, key: &str) -> Range<usize> {
    table.as_table().and_then(|table| table.get(key)).unwrap_or(table).span.clone()
}

/// The reader of a file.
struct File<'s> {
    reader: Reader<'s>,
    flaws: Vec<Flaw>,
}

impl File<'_> {
    fn calibration(&mut self, root: &Value) -> Option<Calibration> {
        let table = root.as_table()?;
        let is_kind = |value: &Value| value.as_str() == Some(KIND);
        if !table.get("kind").is_some_and(is_kind) {
            let help = format!("a calibration file has `kind = \"{KIND}\"`; `tactflow calibrate` makes one from a log");
            let flaw =
                flaw(&table.get("kind").map_or(0..0, |kind| kind.span.clone()), "this is not a calibration file");
            self.flaws.push(Flaw { help: Some(help), ..flaw });
            return None;
        }
        if let Some((_, version)) = table.entry("version").filter(|(_, value)| value.item != Item::Integer(1)) {
            let message = format!("unsupported version {}: this tool reads version {VERSION}", version.described());
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
        let is_sound = self.reader.mistakes.is_empty() && self.flaws.is_empty();
        if is_sound && tactels.len() < rows * cols {
            let missing = (0..).find(|i| !tactels.contains_key(i)).expect("some tactel is missing");
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

    /// Stores a tactel at its place, which must be on the array and free.
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
            self.flaws.push(flaw(span, format!("tactel [{i}, {j}] appears twice")));
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
                if line.readings.len() > MAX_KNOTS {
                    let message = format!("{} knots, but the maximum is {MAX_KNOTS}", line.readings.len());
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

/// Returns a number that is too large for 32 bits, with a message.
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
    Some((key, "too large: images have 32-bit floats".into()))
}

/// Returns the text of a file; its first lines are `origin`, as comments.
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
         reading = \"{reading}\"\nunit = \"{unit}\"\n\n# These give a force of 0, as [row, column] from 0.\n\
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
        writeln!(text, "  {{ at = {at}, offset = {offset:?}, {line} }},").expect("writing to a string cannot fail");
    }
    text.push_str("]\n");
    text
}

#[cfg(test)]
mod tests;
