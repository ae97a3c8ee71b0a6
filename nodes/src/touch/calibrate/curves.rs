//! Zeros and curves from the parameters: as numbers, or from a calibration file.

use std::str::FromStr;

use tactflow_runtime::node::{At, FilePath, Mistake, Mistakes, Param, Reader, Written};
use tactflow_runtime::signal::{ImageShape, Unit};
use tactflow_runtime::source::{Code, Item, Value};

use super::lines::Lines;
use super::{DeviceParams, Params};
use crate::calibration::{Calibration, file};

/// The zeros and the curves of all tactels, and the unit of the calibrated image.
pub(super) type Curves = (Vec<f32>, Lines, Unit);

/// A number for each tactel.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum PerTactel {
    /// One number for all.
    All(f64),
    /// One number each, as a list of rows.
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

/// The parameters of the curves, of the graph or of the device.
#[derive(Default)]
pub(super) struct CurveParams<'p> {
    /// Prefix of the names of the parameters.
    prefix: &'static str,
    offset: Option<&'p PerTactel>,
    gain: Option<&'p PerTactel>,
    unit: Option<&'p str>,
    file: Option<&'p FilePath>,
}

impl<'p> CurveParams<'p> {
    /// Returns those of the graph if it has any, else those of the device.
    pub(super) fn new(Params { offset, gain, unit, file, device, .. }: &'p Params) -> Self {
        let (offset, gain, unit, file) = (offset.as_ref(), gain.as_ref(), unit.as_deref(), file.as_ref());
        if offset.is_some() || gain.is_some() || unit.is_some() || file.is_some() {
            return Self { prefix: "", offset, gain, unit, file };
        }
        device.as_ref().map_or_else(Self::default, |DeviceParams { offset, gain, unit, file, .. }| {
            let (offset, gain, unit, file) = (offset.as_ref(), gain.as_ref(), unit.as_deref(), file.as_ref());
            Self { prefix: "device.", offset, gain, unit, file }
        })
    }

    /// Returns the curves for an image.
    pub(super) fn curves(&self, image: &ImageShape) -> Result<Curves, Mistakes> {
        let Some(path) = self.file else { return self.read_numbers(image) };
        let numbers = [("offset", self.offset.is_some()), ("gain", self.gain.is_some()), ("unit", self.unit.is_some())];
        let excluded = numbers.into_iter().filter(|(_, is_set)| *is_set).map(|(name, _)| {
            let mistake = Mistake::key(self.at(name), format!("`{name}` and `file` exclude each other"));
            mistake.help(format!("the file has its own: leave out `{name}`, or `file`"))
        });
        let mut mistakes: Mistakes = excluded.collect();
        let curves = self.read_file(path, image).map_err(|others| mistakes.extend(others)).ok();
        curves.filter(|_| mistakes.is_empty()).ok_or(mistakes)
    }

    fn at(&self, name: &str) -> String {
        format!("{}{name}", self.prefix)
    }

    /// Returns straight lines.
    fn read_numbers(&self, image: &ImageShape) -> Result<Curves, Mistakes> {
        let mut mistakes = Mistakes::new();
        let offset = spread(&self.at("offset"), self.offset.unwrap_or(&PerTactel::All(0.0)), image, &mut mistakes);
        let gain = spread(&self.at("gain"), self.gain.unwrap_or(&PerTactel::All(1.0)), image, &mut mistakes);
        let unit = self.unit.map_or(Ok(image.unit), Unit::from_str);
        let unit = unit.map_err(|message| mistakes.push(Mistake::param(self.at("unit"), message))).ok();
        let curves = unit.map(|unit| (offset, Lines::linear(gain), unit));
        curves.filter(|_| mistakes.is_empty()).ok_or(mistakes)
    }

    /// Returns the curves of a calibration file.
    fn read_file(&self, path: &FilePath, image: &ImageShape) -> Result<Curves, Mistakes> {
        let bytes = path.bytes()?;
        let text = String::from_utf8_lossy(&bytes);
        let calibration = file::read(&text).map_err(|mistakes| {
            let in_file = |Mistake { at, message, help, .. }: Mistake| {
                let span = if let At::Span(span) = at { span } else { 0..0 };
                Mistake { help, ..Mistake::data(path, &*text, span, message) }
            };
            mistakes.into_iter().map(in_file).collect::<Mistakes>()
        })?;
        let Calibration { rows, cols, reading, unit, .. } = calibration;
        let unlike = |code, what: String, image: String| {
            let message = format!("`{}` calibrates {what}, but the image {image}", path.path.display());
            let mistake = Mistake::new(code, At::Param(self.at("file")), message);
            Err(mistake.help("use the file that was made for this pad").into())
        };
        if (rows, cols) != (image.rows, image.cols) {
            let size = format!("has {} by {}", image.rows, image.cols);
            return unlike(Code::ShapeMismatch, format!("{rows} by {cols} tactels"), size);
        }
        if reading != image.unit {
            return unlike(Code::UnitMismatch, format!("readings in `{reading}`"), format!("is in `{}`", image.unit));
        }
        let (offset, lines) = Lines::new(&calibration);
        Ok((offset, lines, unit))
    }
}

/// Returns for each tactel whether it is in the list of dead ones.
pub(super) fn dead(name: &str, list: &[[usize; 2]], image: &ImageShape, mistakes: &mut Mistakes) -> Vec<bool> {
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

/// Returns the parameter `name` for each tactel; its length is only right if there is no mistake.
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
