//! A calibration as a TOML file with one line a tactel, easy to read and to compare.
//!
//! Numbers have enough digits for 32 bits, so a file that is written and read again gives the same bits. Every tactel
//! is in the file, with a curve or as dead. A mistake has its place in the text. No memory is allocated from the size
//! in the header before the tactels are counted.

use std::collections::BTreeMap;
use std::ops::Range;

use tactflow_runtime::node::{At, Mistake, Mistakes, Param, Reader};
use tactflow_runtime::signal::Unit;
use tactflow_runtime::source::{Code, Item, SourceMap, Value, parse_table};

use super::{Calibration, CurveKind, ForceCurve, Tactel};

/// Maximum number of mistakes that are reported for one file.
const MAX_MISTAKES: usize = 8;

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

/// The keys of a calibration file.
#[derive(Debug, Clone, Param)]
struct FileKeys {
    /// `calibration`.
    kind: String,
    /// Version of the format.
    version: u64,
    /// Kind of the curves.
    curve: CurveKind,
    /// Number of rows.
    #[param(range = 1..=1_000_000)]
    rows: usize,
    /// Number of columns.
    #[param(range = 1..=1_000_000)]
    cols: usize,
    /// Unit of the readings.
    reading: Unit,
    /// Unit of the forces.
    unit: Unit,
    /// Tactels that give no force, as `[row, column]` from 0.
    #[param(default = Vec::new())]
    dead: Vec<Later>,
    /// The other tactels.
    tactels: Vec<Later>,
}

/// A tactel with a linear curve.
#[derive(Debug, Clone, Param)]
struct LinearLine {
    /// Row and column, from 0.
    at: [usize; 2],
    /// Unloaded reading [reading].
    offset: f64,
    /// Slope [unit per reading].
    gain: f64,
}

/// A tactel with a rational curve.
#[derive(Debug, Clone, Param)]
struct RationalLine {
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

/// A tactel with a piecewise linear curve.
#[derive(Debug, Clone, Param)]
struct PiecewiseLine {
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
/// The first mistakes in it, each with its place in the text.
pub fn read(text: &str) -> Result<Calibration, Mistakes> {
    let mut sources = SourceMap::default();
    let root = parse_table(sources.add("", text, "")).map_err(|first| mistake(&first.span, first.message))?;
    let mut reader = Reader::new(&sources);
    let calibration = read_calibration(&root, &mut reader);
    let mut mistakes = reader.mistakes;
    mistakes.sort_by_key(|mistake| if let At::Span(span) = &mistake.at { span.start } else { 0 });
    mistakes.truncate(MAX_MISTAKES);
    calibration.filter(|_| mistakes.is_empty()).ok_or(mistakes)
}

fn mistake(span: &Range<usize>, message: impl Into<String>) -> Mistake {
    Mistake::new(Code::BadData, At::Span(span.clone()), message)
}

/// Returns the place of the value of `key` in a table, or that of the table.
fn place(table: &Value, key: &str) -> Range<usize> {
    table.as_table().and_then(|table| table.get(key)).unwrap_or(table).span.clone()
}

fn read_calibration(root: &Value, reader: &mut Reader<'_>) -> Option<Calibration> {
    let table = root.as_table()?;
    if table.get("kind").is_none_or(|kind| kind.as_str() != Some(KIND)) {
        let span = table.get("kind").map_or(0..0, |kind| kind.span.clone());
        let help = format!("a calibration file has `kind = \"{KIND}\"`; `tactflow calibrate` makes one from a log");
        reader.mistakes.push(mistake(&span, "this is not a calibration file").help(help));
        return None;
    }
    if let Some((_, version)) = table.entry("version").filter(|(_, value)| value.item != Item::Integer(1)) {
        let message = format!("unsupported version {}: this tool reads version {VERSION}", version.described());
        reader.mistakes.push(mistake(&version.span, message));
        return None;
    }
    let FileKeys { curve: kind, rows, cols, reading, unit, dead, tactels, .. } = FileKeys::read(root, reader)?;
    let mut entries = Vec::new();
    for Later(value) in &dead {
        entries.extend(<[usize; 2]>::read(value, reader).map(|at| (at, value.span.clone(), None)));
    }
    for Later(value) in &tactels {
        entries.extend(read_tactel(kind, value, reader).map(|(at, tactel)| (at, place(value, "at"), Some(tactel))));
    }
    let mut tactels = BTreeMap::new();
    for ([i, j], span, tactel) in entries {
        if i >= rows || j >= cols {
            let message = format!("tactel [{i}, {j}] is outside the array of {rows} rows by {cols} columns");
            reader.mistakes.push(mistake(&span, message).help("rows and columns count from 0"));
        } else if tactels.insert(i * cols + j, tactel).is_some() {
            reader.mistakes.push(mistake(&span, format!("tactel [{i}, {j}] appears twice")));
        }
    }
    let is_missing = |i: &usize| !tactels.contains_key(i);
    if let Some(first) = (0..rows * cols).find(is_missing).filter(|_| reader.mistakes.is_empty()) {
        let rest = rows * cols - tactels.len() - 1;
        let more = if rest > 0 { format!(", and {rest} more") } else { String::new() };
        let message = format!("tactel [{}, {}] is missing{more}", first / cols, first % cols);
        let help = "add a curve for it under `tactels`, or list it under `dead`";
        reader.mistakes.push(mistake(&place(root, "tactels"), message).help(help));
    }
    Some(Calibration { kind, rows, cols, reading, unit, tactels: tactels.into_values().collect() })
}

fn read_tactel(kind: CurveKind, value: &Value, reader: &mut Reader<'_>) -> Option<([usize; 2], Tactel)> {
    let (at, offset, curve) = match kind {
        CurveKind::Linear => {
            let line = LinearLine::read(value, reader)?;
            (line.at, line.offset, ForceCurve::Linear { gain: line.gain as f32 })
        }
        CurveKind::Rational => {
            let line = RationalLine::read(value, reader)?;
            let [gain, squash, most] = [line.gain, line.squash, line.most].map(|number| number as f32);
            (line.at, line.offset, ForceCurve::Rational { gain, squash, most })
        }
        CurveKind::Piecewise => {
            let PiecewiseLine { at, offset, readings, forces } = PiecewiseLine::read(value, reader)?;
            let (count, others) = (readings.len(), forces.len());
            let refused = if count != others {
                Some(("forces", format!("{count} readings, but {others} forces")))
            } else {
                (count > MAX_KNOTS).then(|| ("readings", format!("{count} knots, but the maximum is {MAX_KNOTS}")))
            };
            if let Some((key, message)) = refused {
                reader.mistakes.push(mistake(&place(value, key), message));
                return None;
            }
            let knots = readings.iter().zip(&forces).map(|(s, f)| [*s as f32, *f as f32]).collect();
            (at, offset, ForceCurve::Piecewise { knots })
        }
    };
    let tactel = Tactel { offset: offset as f32, curve };
    if let Some((key, message)) = too_large(&tactel).or_else(|| tactel.curve.flaw()) {
        reader.mistakes.push(mistake(&place(value, key), message));
    }
    Some((at, tactel))
}

/// Returns the name of a number that is too large for 32 bits, with a message.
fn too_large(Tactel { offset, curve }: &Tactel) -> Option<(&'static str, String)> {
    let numbers = match curve {
        ForceCurve::Linear { gain } => vec![("gain", *gain)],
        ForceCurve::Rational { gain, squash, most } => vec![("gain", *gain), ("squash", *squash), ("most", *most)],
        ForceCurve::Piecewise { knots } => {
            knots.iter().flat_map(|[s, force]| [("readings", *s), ("forces", *force)]).collect()
        }
    };
    let mut numbers = std::iter::once(("offset", *offset)).chain(numbers);
    let (key, _) = numbers.find(|(_, number)| !number.is_finite())?;
    Some((key, "too large for a 32-bit float".into()))
}

/// Returns the text of a file; its first lines are `origin`, as comments.
#[must_use]
pub fn write(calibration: &Calibration, origin: &str) -> String {
    let Calibration { kind, rows, cols, reading, unit, tactels } = calibration;
    let (formula, units) = match kind {
        CurveKind::Linear => ("force = gain s, with s = reading - offset", format!("gain [{unit} per {reading}]")),
        CurveKind::Rational => (
            "force = gain s / (1 - squash s), with s = reading - offset, from 0 up to the force `most`",
            format!("gain [{unit} per {reading}], squash [1 per {reading}], most [{unit}]"),
        ),
        CurveKind::Piecewise => (
            "straight lines from 0 through (readings, forces), with readings counted from offset",
            format!("readings [{reading}], forces [{unit}]"),
        ),
    };
    let at = |i: usize| [i / cols, i % cols];
    let dead: Vec<[usize; 2]> = (0..tactels.len()).filter(|i| tactels[*i].is_none()).map(at).collect();
    let mut text = String::from("# The calibration of a tactile pad, for `calibrate`: `file = \"…\"`.\n");
    origin.lines().for_each(|line| text.push_str(&format!("# {line}\n")));
    text.push_str(&format!(
        "# {formula}.\nkind = \"{KIND}\"\nversion = {VERSION}\ncurve = \"{kind}\"\nrows = {rows}\ncols = {cols}\n\
         reading = \"{reading}\"\nunit = \"{unit}\"\n\n# Tactels whose force is always 0, as [row, column] counted from 0.\n\
         dead = {dead:?}\n\n# At [row, column] from 0: offset [{reading}], {units}.\ntactels = [\n"
    ));
    for (i, tactel) in tactels.iter().enumerate() {
        let Some(Tactel { offset, curve }) = tactel else { continue };
        let numbers = match curve {
            ForceCurve::Linear { gain } => format!("gain = {gain:?}"),
            ForceCurve::Rational { gain, squash, most } => {
                format!("gain = {gain:?}, squash = {squash:?}, most = {most:?}")
            }
            ForceCurve::Piecewise { knots } => {
                let (readings, forces): (Vec<f32>, Vec<f32>) = knots.iter().map(|knot| (knot[0], knot[1])).unzip();
                format!("readings = {readings:?}, forces = {forces:?}")
            }
        };
        text.push_str(&format!("  {{ at = {:?}, offset = {offset:?}, {numbers} }},\n", at(i)));
    }
    text + "]\n"
}

#[cfg(test)]
mod tests;
