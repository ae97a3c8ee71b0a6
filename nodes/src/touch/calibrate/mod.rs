//! `calibrate`: a curve per tactel, from what the sensor reads to a force; and its zero, taken anew on command.
//!
//! The paper inverts each tactel's squashed curve coarsely (section III, fig. 1). Without a file it is a straight line,
//! `(value - offset) * gain`; a file of `tactflow calibrate` has lines, squashed curves or knots ([`crate::calibration`]).
//! A dead tactel is 0, whatever it reads: a cell that does not exist is no measurement.
//!
//! The zero is part of the state, as a tare changes it: a reset goes back to what was calibrated.

mod lines;
mod tare;

use std::str::FromStr;

use tactflow_runtime::node::{
    At, Count, FilePath, Mistake, Mistakes, Node, Param, Positive, Reader, Setup, Tick, Written,
};
use tactflow_runtime::signal::{ImageShape, Unit};
use tactflow_runtime::source::Code;
use tactflow_runtime::source::{Item, Value};
use tactflow_runtime::{inputs, outputs, params, state};

use crate::calibration::{Calibration, file};
use lines::Lines;
use tare::{Averages, Rules};

params! {
    /// What an unloaded tactel reads: a number for all, or a list of rows; 0 unless given [unit of the input].
    offset: Option<PerTactel>,
    /// Slope: a number for all, or a list of rows; 1 unless given [output unit per input unit].
    gain: Option<PerTactel>,
    /// Unit of the calibrated image; that of the input if it is not given.
    unit: Option<String>,
    /// Tactels that measure nothing, as `[row, column]` from 0; those that the device states are added.
    dead: Vec<[usize; 2]> = Vec::new(),
    /// A calibration file with a curve for each tactel, instead of `offset`, `gain` and `unit`.
    file: Option<FilePath>,
    /// What the pad's device states of its calibration: `{ from = "pad.calibration" }`. Any of `offset`, `gain`, `unit` and `file` here takes the place of all four there.
    device: Option<Stated>,
    /// Number of frames whose mean is the new zero when it is taken anew.
    tare_window: Count = Count(50),
    /// How far the zero of a tactel may be from the calibrated one, or none is taken anew; any unless given [unit of the input].
    tare_bound: Option<Positive>,
    /// Whether the first frames are taken for the zero.
    tare_at_start: bool = false,
}

params! {
    Stated:
    /// What an unloaded tactel reads: a number for all, or a list of rows; 0 unless given [unit of the input].
    offset: Option<PerTactel>,
    /// Slope: a number for all, or a list of rows; 1 unless given [output unit per input unit].
    gain: Option<PerTactel>,
    /// Unit of the calibrated image; that of the input if it is not given.
    unit: Option<String>,
    /// Tactels that measure nothing, as `[row, column]` from 0.
    dead: Vec<[usize; 2]> = Vec::new(),
    /// A calibration file with a curve for each tactel, instead of `offset`, `gain` and `unit`.
    file: Option<FilePath>,
}

inputs! {
    /// The image as it was measured.
    image: Image["U", "A"],
    /// Takes the zero anew each time that it becomes set; hold it for a frame of the pad at least.
    tare: Option<Flag>,
    /// Whether something touches the pad: `present` of the `label` behind. No zero is taken from a frame with a contact.
    present: Delayed<Flag>,
}

outputs! {
    /// The calibrated image [`unit`].
    image: Image["V", "A"],
}

state! {
    /// What each tactel reads unloaded [unit of the input].
    offset: Vec<f32>,
    /// The frames of a new zero so far.
    averages: Averages,
}

/// One number for all tactels, or a number for each, row after row.
#[derive(Debug, Clone, PartialEq)]
pub enum PerTactel {
    /// The same for all.
    All(f64),
    /// A list of rows.
    Rows(Vec<Vec<f64>>),
}

impl Param for PerTactel {
    const EXPECTS: &'static str = "a number, or a list of rows of numbers";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        match &value.item {
            Item::Array(_) => Vec::read(value, reader).map(Self::Rows),
            Item::Integer(_) | Item::Float(_) => f64::read(value, reader).map(Self::All),
            _ => {
                reader.wrong_type(value, Self::EXPECTS);
                None
            }
        }
    }

    fn written(&self) -> Option<Written> {
        match self {
            Self::All(value) => value.written(),
            Self::Rows(rows) => rows.written(),
        }
    }
}

/// The curve of each tactel beyond its zero, and when its zero changes.
pub struct Calibrate {
    offset: Vec<f32>,
    lines: Lines,
    rules: Option<Rules>,
}

impl tactflow_runtime::node::Describe for Calibrate {
    const NAME: &'static str = "calibrate";
    const SUMMARY: &'static str =
        "turns what each tactel reads into a force, by a line or by the curves of a calibration file";
    const DOC: &'static str = "\
Every tactel of a foam sensor has its own zero and its own squashed curve (paper section III, fig. 1). This node inverts \
them: `force = curve(value - offset)`, tactel by tactel.\n\n\
Without a `file` the curve is a straight line, `(value - offset) * gain`, which has no end and goes below zero. With \
`file = \"pad.toml\"`, made by `tactflow calibrate` from a log with a reference force, it is a line, a squashed curve, \
`gain s / (1 - squash s)`, or straight lines between knots, where `s = value - offset`. Squashed curves and knots give no \
force below zero and stay at the largest force that was calibrated: beyond it, nobody has measured. The file must be of \
this pad: its size and the unit of its readings are compared. A `dead` tactel is 0; tactels that have died since can be \
added to those of the file.\n\n\
A task takes all of that from the pad's device, with `device = { from = \"pad.calibration\" }`, and fits any pad. What \
stands here beside it goes before it: any of `offset`, `gain`, `unit` and `file` takes the place of all four there. Dead \
tactels add up.\n\n\
The zero of foam drifts. When `in.tare` becomes set, the mean of the next `tare_window` frames becomes the zero of each \
tactel; with `tare_at_start` the first frames do. A pad is only tared while nothing touches it: wire `in.present` to the \
`label` behind (not to a `contact_debounce`, which tells of a contact only some frames after it began), give a \
`tare_bound`, or both. A contact during the window, or in the frame before, ends the attempt, and \
so does a single tactel that is off by more than the bound; then the old zero stays, all of it. Between two tares \
nothing changes: a long contact does not become the new zero. Frames that come twice count once. When the image has \
been absent for long, the zero is the calibrated one again.";
    const EXAMPLE: &'static str = r#"
[nodes.calibrate]
type = "calibrate"
in.image = "source.image"
offset = 0.0                        # [N] the mock pad is calibrated already; a real one has `file = "pad.toml"`
gain = 1.0                          # [N per N]
in.present = "label.present"
tare_at_start = true                # the first 50 frames are the zero, if nothing touches the pad
"#;
}

impl Node for Calibrate {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let mut mistakes = Mistakes::new();
        let image = setup.inputs.image.clone();
        let rules = Rules::new(&params, &setup.inputs, &mut mistakes);
        let mut is_dead = dead("dead", &params.dead, &image, &mut mistakes);
        let (stated, device) = (curve(&params), params.device.as_ref());
        if let Some(device) = device {
            let dead = dead("device.dead", &device.dead, &image, &mut mistakes);
            is_dead.iter_mut().zip(dead).for_each(|(is_dead, also)| *is_dead |= also);
        }
        let curve = stated.or_else(|| device.map(Curve::of_device)).unwrap_or_default();
        let (mut offset, mut lines, unit) = match curve.file {
            Some(path) => of_file(path, &curve, &image, &mut mistakes),
            None => of_params(&curve, &image, &mut mistakes),
        };
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        for i in (0..is_dead.len()).filter(|i| is_dead[*i]) {
            offset[i] = 0.0;
            lines.kill(i);
        }
        setup.outputs.image = ImageShape { unit, ..image };
        Ok(Self { offset, lines, rules })
    }

    fn state(&self) -> State {
        let averages = self.rules.as_ref().map_or_else(Averages::default, |rules| rules.fresh(self.offset.len()));
        State { offset: self.offset.clone(), averages }
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        if let Some(rules) = &self.rules {
            rules.step(&inputs, &self.offset, &self.lines, state);
        }
        // A command that is lost wakes the node as well: without a frame of the pad there is no new image.
        if !inputs.image.is_new() {
            out.image.keep();
            return;
        }
        self.lines.apply(inputs.image.cells(), &state.offset, out.image.write().cells_mut());
    }
}

/// Zeros and curves as somebody states them: the graph, or else the device.
#[derive(Default)]
struct Curve<'p> {
    /// What comes before the names of its parameters.
    at: &'static str,
    offset: Option<&'p PerTactel>,
    gain: Option<&'p PerTactel>,
    unit: Option<&'p str>,
    file: Option<&'p FilePath>,
}

impl<'p> Curve<'p> {
    fn of_device(Stated { offset, gain, unit, file, .. }: &'p Stated) -> Self {
        let (offset, gain) = (offset.as_ref(), gain.as_ref());
        Self { at: "device.", offset, gain, unit: unit.as_deref(), file: file.as_ref() }
    }
}

/// What the graph itself says; none if it leaves it to the device.
fn curve(Params { offset, gain, unit, file, .. }: &Params) -> Option<Curve<'_>> {
    let (offset, gain) = (offset.as_ref(), gain.as_ref());
    let says = offset.is_some() || gain.is_some() || unit.is_some() || file.is_some();
    says.then_some(Curve { at: "", offset, gain, unit: unit.as_deref(), file: file.as_ref() })
}

/// Which tactels are dead.
fn dead(name: &str, list: &[[usize; 2]], image: &ImageShape, mistakes: &mut Mistakes) -> Vec<bool> {
    let mut is_dead = vec![false; image.tactels()];
    for [i, j] in list {
        if *i >= image.rows || *j >= image.cols {
            let message = format!("tactel [{i}, {j}] is not on an array of {} by {}", image.rows, image.cols);
            mistakes.push(Mistake::param(name, message).help("rows and columns count from 0"));
        } else {
            is_dead[i * image.cols + j] = true;
        }
    }
    is_dead
}

/// Zero, curves and unit as numbers: straight lines.
fn of_params(curve: &Curve<'_>, image: &ImageShape, mistakes: &mut Mistakes) -> (Vec<f32>, Lines, Unit) {
    let at = |name: &str| format!("{}{name}", curve.at);
    let offset = spread(&at("offset"), curve.offset.unwrap_or(&PerTactel::All(0.0)), image, mistakes);
    let gain = spread(&at("gain"), curve.gain.unwrap_or(&PerTactel::All(1.0)), image, mistakes);
    let unit = curve.unit.map_or(Ok(image.unit), Unit::from_str);
    let unit = unit.unwrap_or_else(|message| {
        mistakes.push(Mistake::param(at("unit"), message));
        image.unit
    });
    (offset, Lines::linear(gain), unit)
}

/// Zero, curves and unit as a calibration file has them.
fn of_file(path: &FilePath, curve: &Curve<'_>, image: &ImageShape, mistakes: &mut Mistakes) -> (Vec<f32>, Lines, Unit) {
    let given = [("offset", curve.offset.is_some()), ("gain", curve.gain.is_some()), ("unit", curve.unit.is_some())];
    for (name, _) in given.into_iter().filter(|(_, is_given)| *is_given) {
        let mistake = Mistake::key(format!("{}{name}", curve.at), format!("`{name}` and `file` exclude each other"));
        mistakes.push(mistake.help(format!("the file has its own: leave out `{name}`, or `file`")));
    }
    let nothing = (Vec::new(), Lines::linear(Vec::new()), image.unit);
    let bytes = match path.bytes() {
        Ok(bytes) => bytes,
        Err(mistake) => {
            mistakes.push(mistake);
            return nothing;
        }
    };
    let text = String::from_utf8_lossy(&bytes);
    let calibration = match file::read(&text) {
        Ok(calibration) => calibration,
        Err(flaws) => {
            mistakes.extend(flaws.into_iter().map(|flaw| {
                let mistake = Mistake::data(path, &*text, flaw.span, flaw.message);
                Mistake { help: flaw.help, ..mistake }
            }));
            return nothing;
        }
    };
    let at = || At::Param(format!("{}file", curve.at));
    let Calibration { rows, cols, reading, unit, .. } = calibration;
    if (rows, cols) != (image.rows, image.cols) {
        let message = format!(
            "`{}` calibrates {rows} by {cols} tactels, but the image has {} by {}",
            path.path.display(),
            image.rows,
            image.cols
        );
        mistakes
            .push(Mistake::new(Code::ShapeMismatch, at(), message).help("take the file that was made for this pad"));
        return nothing;
    }
    if reading != image.unit {
        let message = format!(
            "`{}` calibrates readings in `{reading}`, but the image is in `{}`",
            path.path.display(),
            image.unit
        );
        mistakes.push(Mistake::new(Code::UnitMismatch, at(), message).help("take the file that was made for this pad"));
        return nothing;
    }
    let (offset, lines) = Lines::new(&calibration);
    (offset, lines, unit)
}

/// The parameter `name` for each tactel as f32; nothing of use if there is a mistake.
fn spread(name: &str, value: &PerTactel, image: &ImageShape, mistakes: &mut Mistakes) -> Vec<f32> {
    let &ImageShape { rows, cols, .. } = image;
    let numbers = match value {
        PerTactel::All(number) => vec![*number; rows * cols],
        PerTactel::Rows(list) => list.concat(),
    };
    if let PerTactel::Rows(list) = value {
        if list.len() != rows {
            let message = format!("`{name}` has {} rows, but the image has {rows}", list.len());
            mistakes.push(Mistake::param(name, message));
        } else if let Some(i) = list.iter().position(|row| row.len() != cols) {
            let message =
                format!("row {i} of `{name}` has {} numbers, but the image has {cols} columns", list[i].len());
            mistakes.push(Mistake::param(name, message));
        }
    }
    if let Some(number) = numbers.iter().find(|number| !(**number as f32).is_finite()) {
        mistakes
            .push(Mistake::param(name, format!("{number:e} is too large for a tactel: images are of 32-bit floats")));
    }
    numbers.into_iter().map(|number| number as f32).collect()
}

#[cfg(test)]
mod tests;
