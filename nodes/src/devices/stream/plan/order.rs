//! The shape of the values, and their way to the image.

use tactflow_runtime::node::{At, Mistake, Mistakes};
use tactflow_runtime::source::Code;

use super::bounds::MAX_VALUES;
use super::params::{Params, Scale};
use super::useless;
use crate::devices::stream::decoding::order::Grid;

/// Rows and columns in the order of the bytes, and the axes of each tactel.
pub(crate) struct Shape {
    pub(crate) rows: usize,
    pub(crate) cols: usize,
    pub(crate) axes: usize,
    /// The axis that becomes the image.
    pub(crate) axis: usize,
    /// The axes along the image's x and y, and their signs.
    pub(crate) tangential: Option<[(usize, f64); 2]>,
}

impl Shape {
    pub(crate) const fn values(&self) -> usize {
        self.rows * self.cols * self.axes
    }
}

pub(crate) fn shape(params: &Params, mistakes: &mut Mistakes) -> Option<Shape> {
    let (rows, cols, axes) = match params.shape[..] {
        [rows, cols] => (rows, cols, 1),
        [rows, cols, axes] => (rows, cols, axes),
        _ => {
            let message = format!("`shape` has {} numbers", params.shape.len());
            mistakes.push(Mistake::param("shape", message).help("write `[rows, cols]`, or `[rows, cols, axes]`"));
            return None;
        }
    };
    if rows == 0 || cols == 0 || axes == 0 {
        mistakes.push(Mistake::param("shape", "`shape` has a number that is 0"));
        return None;
    }
    let values = rows.checked_mul(cols).and_then(|cells| cells.checked_mul(axes));
    if values.is_none_or(|values| values > MAX_VALUES) {
        mistakes.push(Mistake::param("shape", format!("{rows} by {cols} by {axes} values are more than {MAX_VALUES}")));
        return None;
    }
    let axis = axis(params, axes, mistakes)?;
    let before = mistakes.len();
    let tangential = params.tangential.as_ref().and_then(|names| tangential(params, names, axis, mistakes));
    (mistakes.len() == before).then_some(Shape { rows, cols, axes, axis, tangential })
}

/// Returns the axis that becomes the image.
fn axis(params: &Params, axes: usize, mistakes: &mut Mistakes) -> Option<usize> {
    if axes == 1 && params.shape.len() == 2 {
        let help = "leave it out, or write `shape = [rows, cols, axes]`";
        let why = "for a `shape` of two numbers";
        let before = mistakes.len();
        mistakes.extend((!params.axes.is_empty()).then(|| useless("axes", why, help)));
        mistakes.extend(params.axis.is_some().then(|| useless("axis", why, help)));
        return (mistakes.len() == before).then_some(0);
    }
    if params.axes.len() != axes {
        let at = if params.axes.is_empty() { "shape" } else { "axes" };
        let message = format!("a tactel has {axes} values, and `axes` names {}", params.axes.len());
        let help = "name each value of a tactel in the order of the bytes, such as `axes = [\"x\", \"y\", \"z\"]`";
        mistakes.push(Mistake::param(at, message).help(help));
        return None;
    }
    let names = || params.axes.iter().map(String::as_str);
    let twice = names().enumerate().find(|(i, name)| names().take(*i).any(|other| other == *name));
    if let Some((_, name)) = twice {
        mistakes.push(Mistake::param("axes", format!("two axes are called `{name}`")).help("give each its own name"));
        return None;
    }
    let Some(wanted) = &params.axis else {
        let message = "`axis` is missing: which of the `axes` becomes the image";
        let mistake = Mistake::new(Code::MissingKey, At::Param("axes".into()), message);
        let last = params.axes.last().map_or("z", String::as_str);
        mistakes.push(mistake.help(format!("write for example `axis = \"{last}\"`")));
        return None;
    };
    let found = names().position(|name| name == wanted);
    if found.is_none() {
        let mistake = Mistake::param("axis", format!("no axis is called `{wanted}`"));
        mistakes.push(mistake.suggest(wanted, names(), "axes"));
    }
    found
}

/// Returns the axes along x and y of the image, and their signs.
fn tangential(params: &Params, names: &[String], axis: usize, mistakes: &mut Mistakes) -> Option<[(usize, f64); 2]> {
    let wrong = |message: String| Mistake::param("tangential", message);
    if params.axes.len() < 3 {
        let help = "leave it out, or write `shape = [rows, cols, axes]` with three `axes` or more";
        mistakes.push(wrong("a vector image needs three axes".into()).help(help));
        return None;
    }
    let [x, y] = names else {
        let mistake = wrong(format!("`tangential` has {} names", names.len()));
        mistakes.push(mistake.help("write the axes along x and y of the image: `tangential = [\"x\", \"y\"]`"));
        return None;
    };
    let mut find = |name: &String| {
        let (sign, plain) = name.strip_prefix('-').map_or((1.0, name.as_str()), |plain| (-1.0, plain));
        let known = || params.axes.iter().map(String::as_str);
        let found = known().position(|known| known == plain);
        if found.is_none() {
            mistakes.push(wrong(format!("no axis is called `{plain}`")).suggest(plain, known(), "axes"));
        }
        found.map(|found| (found, sign))
    };
    let [x, y] = [find(x), find(y)];
    let [x, y] = [x?, y?];
    if x.0 == y.0 || x.0 == axis || y.0 == axis {
        mistakes.push(wrong("x, y and the `axis` of the image must be three axes".into()).help("name each axis once"));
        return None;
    }
    Some([x, y])
}

/// Returns the values that each axis can have.
pub(crate) fn plausible(params: &Params, mistakes: &mut Mistakes) -> Vec<(usize, [f64; 2])> {
    let mut ranges = Vec::new();
    for (name, range) in &params.plausible.0 {
        let names: Vec<&str> = match params.axes.is_empty() {
            true => vec!["value"],
            false => params.axes.iter().map(String::as_str).collect(),
        };
        let path = format!("plausible.{name}");
        match names.iter().position(|known| known == name) {
            _ if range[0] > range[1] => {
                let message = format!("the least value {} is above the greatest value {}", range[0], range[1]);
                mistakes.push(Mistake::param(path, message).help("write the least value first"));
            }
            Some(axis) => ranges.push((axis, *range)),
            None => {
                let mistake = Mistake::key(path, format!("no axis is called `{name}`"));
                mistakes.push(mistake.suggest(name, names.iter().copied(), "axes"));
            }
        }
    }
    ranges
}

/// Returns the places of the cells of the image in the frame, and gain and offset of their scale.
pub(crate) fn image(params: &Params, shape: &Shape, mistakes: &mut Mistakes) -> Option<(Grid, (f64, f64))> {
    let Scale { invert_full, gain, offset } = params.scale;
    if gain == 0.0 {
        mistakes.push(Mistake::param("scale.gain", "with a `gain` of 0 the image is always the same"));
    }
    let scale = invert_full.map_or((gain, offset), |full| (-gain, gain * full + offset));
    let grid = match &params.lut {
        None => Ok(Grid::new(shape.rows, shape.cols)),
        Some(lut) => Grid::with_lut(shape.rows, shape.cols, lut),
    };
    let grid = grid.map_err(|message| {
        let help =
            "each index from 0 to the last cell is there once: cell `i` of the image is value `lut[i]` of the frame";
        mistakes.push(Mistake::param("lut", message).help(help));
    });
    let grid = params.order.iter().fold(grid.ok()?, |grid, turn| grid.turned(*turn));
    Some((grid, scale))
}
