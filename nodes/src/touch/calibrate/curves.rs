//! Zeros and curves from the parameters: as numbers, or from a calibration file.

use std::str::FromStr;

use tactflow_runtime::node::{At, FilePath, Mistake, Mistakes, Param, Reader, Written, collect_both, refuse_any};
use tactflow_runtime::signal::{Base, ImageShape, Unit};
use tactflow_runtime::source::{Code, Item, Value};

use super::Inputs;
use super::tactel_curves::TactelCurves;
use crate::calibration::{Calibration, file};
use crate::touch::common::narrow;

/// The zeros and the curves of all tactels, and the unit of the calibrated image.
pub(super) type Curves = (Vec<f32>, TactelCurves, Unit);

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
            Item::Integer(_) | Item::Float(_) | Item::String(_) => f64::read(value, reader).map(Self::All),
            _ => reader.wrong_type(value, Self::EXPECTS),
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
#[derive(Debug, Clone, Default, Param)]
pub(super) struct CurveParams {
    /// Reading of an unloaded tactel: a number for all, or a list of rows; 0 without it.
    #[param(unit = "U")]
    pub(super) offset: Option<PerTactel>,
    /// Slope of the line, in units of the output per unit of the input: a number for all, or a list of rows; 1 without
    /// it.
    #[param(unit = "1")]
    pub(super) gain: Option<PerTactel>,
    /// Unit of the calibrated image; without it, the unit of the input.
    pub(super) unit: Option<String>,
    /// Tactels that measure nothing, as `[row, column]` from 0.
    #[param(default = Vec::new())]
    pub(super) dead: Vec<[usize; 2]>,
    /// A calibration file with a curve for each tactel, instead of `offset`, `gain` and `unit`.
    pub(super) file: Option<FilePath>,
}

impl CurveParams {
    /// Returns whether any of the parameters that exclude those of the device is given.
    pub(super) const fn has_curves(&self) -> bool {
        self.offset.is_some() || self.gain.is_some() || self.unit.is_some() || self.file.is_some()
    }

    /// Returns the curves for an image. `prefix` is that of the names of the parameters.
    pub(super) fn curves(&self, prefix: &str, image: &ImageShape) -> Result<Curves, Mistakes> {
        let Some(path) = &self.file else { return self.read_numbers(prefix, image) };
        let numbers = [("offset", self.offset.is_some()), ("gain", self.gain.is_some()), ("unit", self.unit.is_some())];
        let excluded = numbers.into_iter().filter(|(_, is_set)| *is_set).map(|(name, _)| {
            let mistake = Mistake::key(format!("{prefix}{name}"), format!("`{name}` and `file` exclude each other"));
            mistake.help(format!("the file has its own: leave out `{name}`, or `file`"))
        });
        let ((), curves) = collect_both(refuse_any(excluded), read_file(path, prefix, image))?;
        Ok(curves)
    }

    /// Returns straight lines.
    fn read_numbers(&self, prefix: &str, image: &ImageShape) -> Result<Curves, Mistakes> {
        let spread = |name: &str, value: &Option<PerTactel>, default| {
            spread(&format!("{prefix}{name}"), value.as_ref().unwrap_or(&PerTactel::All(default)), image)
        };
        let unit = self.unit.as_deref().map_or(Ok(image.unit), Unit::from_str);
        let unit = unit.map_err(|message| Mistake::param(format!("{prefix}unit"), message));
        let unit = unit.and_then(|unit| Ok((unit, self.default_gain(prefix, image, unit)?)));
        let default_gain = unit.as_ref().map_or(1.0, |(_, gain)| *gain);
        let numbers = collect_both(spread("offset", &self.offset, 0.0), spread("gain", &self.gain, default_gain));
        let ((offset, gain), (unit, _)) = collect_both(numbers, unit.map_err(Mistakes::from))?;
        Ok((offset, TactelCurves::Linear(gain), unit))
    }

    /// Returns the slope of the line if `gain` is not given: 1, or the area of a tactel from kPa to N.
    fn default_gain(&self, prefix: &str, image: &ImageShape, unit: Unit) -> Result<f64, Mistake> {
        if unit == image.unit || self.gain.is_some() {
            return Ok(1.0);
        }
        if (image.unit, unit) == (Unit::of(Base::Kilopascal), Unit::NEWTON) {
            let [along_x, along_y] = image.pitch;
            return Ok(1e3 * along_x * along_y);
        }
        let message = format!("nothing converts the image from `{}` to `{unit}`", image.unit);
        let help = format!("set `{prefix}gain` [{unit} per {}], or name a calibration in `file`", image.unit);
        Err(Mistake::param(format!("{prefix}unit"), message).help(help))
    }

    /// Returns the indices of the dead tactels.
    pub(super) fn dead(&self, prefix: &str, image: &ImageShape) -> Result<Vec<usize>, Mistakes> {
        let outside = self.dead.iter().filter(|[i, j]| *i >= image.rows || *j >= image.cols).map(|[i, j]| {
            let message =
                format!("tactel [{i}, {j}] is outside the array of {} rows by {} columns", image.rows, image.cols);
            Mistake::param(format!("{prefix}dead"), message).help("rows and columns count from 0")
        });
        refuse_any(outside)?;
        Ok(self.dead.iter().map(|[i, j]| i * image.cols + j).collect())
    }
}

/// Returns the curves of a calibration file.
fn read_file(path: &FilePath, prefix: &str, image: &ImageShape) -> Result<Curves, Mistakes> {
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
        let mistake = Mistake::new(code, At::Param(format!("{prefix}file")), message);
        Err(mistake.help("use the file that was made for this pad").into())
    };
    if (rows, cols) != (image.rows, image.cols) {
        let size = format!("has {} by {}", image.rows, image.cols);
        return unlike(Code::ShapeMismatch, format!("{rows} by {cols} tactels"), size);
    }
    if reading != image.unit {
        return unlike(Code::UnitMismatch, format!("readings in `{reading}`"), format!("is in `{}`", image.unit));
    }
    let (offset, curves) = TactelCurves::new(&calibration);
    Ok((offset, curves, unit))
}

/// Returns the parameter `name` for each tactel.
fn spread(name: &str, value: &PerTactel, image: &ImageShape) -> Result<Vec<f32>, Mistakes> {
    let &ImageShape { rows, cols, .. } = image;
    let (numbers, flaw) = match value {
        PerTactel::All(number) => (vec![*number; rows * cols], None),
        PerTactel::Rows(list) if list.len() != rows => {
            (list.concat(), Some(format!("`{name}` has {} rows, but the image has {rows}", list.len())))
        }
        PerTactel::Rows(list) => {
            let flaw = list.iter().enumerate().find(|(_, row)| row.len() != cols).map(|(i, row)| {
                format!("row {i} of `{name}` has {} numbers, but the image has {cols} columns", row.len())
            });
            (list.concat(), flaw)
        }
    };
    let flaws = refuse_any(flaw.map(|message| Mistake::param(name, message)));
    let numbers = numbers.into_iter().map(|number| narrow(name, number)).collect();
    let ((), numbers) = collect_both(flaws, numbers)?;
    Ok(numbers)
}
