//! The path of the parameters, and the mistakes in it: from the list of points or from the file.

use nalgebra::Vector3;
use tactflow_runtime::node::{At, Mistake, Mistakes};
use tactflow_runtime::source::Code;

use super::path::{Path, Refusal};
use super::{Params, file};

/// Maximum number of points in a graph file; a file of points may have more.
const MAX_INLINE_POINTS: usize = 1000;

impl Params {
    /// Returns the path, and a warning about coordinates in another unit.
    pub(super) fn read_path(&self) -> Result<(Path, Option<Mistake>), Mistakes> {
        let round = |points: &[Vector3<f64>]| Path::new(points, self.corner_m, self.closed);
        match (&self.path, &self.file) {
            (Some(path), None) if path.len() > MAX_INLINE_POINTS => {
                let message = format!("the path has {} points, but the maximum is {MAX_INLINE_POINTS}", path.len());
                Err(Mistake::param("path", message).help("write them to a file, and name it with `file`").into())
            }
            (Some(path), None) => {
                let points: Vec<Vector3<f64>> = path.iter().map(|point| Vector3::from(*point)).collect();
                let place = |i: usize| At::Param(format!("path.{i}"));
                let path = round(&points).map_err(|refusal| self.mistake(&refusal, At::Param("path".into()), place))?;
                Ok((path, None))
            }
            (None, Some(file)) => {
                let points = file::read(file)?;
                let place = |i: usize| points.place(file, i);
                let path =
                    round(&points.points).map_err(|refusal| self.mistake(&refusal, At::Param("file".into()), place))?;
                Ok((path, points.unusual()))
            }
            (given, _) => {
                let message = match given {
                    None => "the path has no points",
                    Some(_) => "`path` and `file` exclude each other",
                };
                let help = "give one of the two: `path = [[x, y, z], …]` in metres, or `file = \"path.csv\"`";
                let code = if given.is_none() { Code::MissingKey } else { Code::BadValue };
                let at = if given.is_none() { At::Node } else { At::Param("file".into()) };
                Err(Mistake::new(code, at, message).help(help).into())
            }
        }
    }

    /// Returns the mistake for points that make no path. `whole` is the place of all points, and `place` that of one.
    fn mistake(&self, refusal: &Refusal, whole: At, place: impl Fn(usize) -> At) -> Mistake {
        let code = if self.file.is_some() { Code::BadData } else { Code::BadValue };
        match refusal {
            Refusal::TooFew => {
                let (least, what) = if self.closed { (3, "a closed path") } else { (2, "a path") };
                Mistake::new(Code::BadValue, whole, format!("{what} needs at least {least} points"))
            }
            Refusal::Repeated(i) => {
                let help = if self.closed { "; a closed path returns to its first point by itself" } else { "" };
                Mistake::new(code, place(*i), format!("point {} is at the same place as the next one", i + 1))
                    .help(format!("leave out one of the two{help}"))
            }
            Refusal::TurnsBack(i) => {
                let message = format!("the path turns back at point {}, which no arc can round", i + 1);
                Mistake::new(code, place(*i), message)
                    .help("add a point beside it, so that the path turns in two corners")
            }
            Refusal::Corner { from, corner, leg_m, fits_m } => {
                let message = format!(
                    "the corner at point {} with a radius of {} m does not fit the leg of {} m that begins at point {}",
                    corner + 1,
                    self.corner_m,
                    rounded(*leg_m),
                    from + 1
                );
                let help = format!("write `corner_m = {}` or less, or move the points apart", rounded_down(*fits_m));
                Mistake::param("corner_m", message).help(help)
            }
        }
    }
}

/// Returns a number with four significant digits.
fn rounded(number: f64) -> f64 {
    format!("{number:.3e}").parse().expect("a formatted number is a number")
}

/// Returns a number that is a little smaller, with few digits.
fn rounded_down(number: f64) -> f64 {
    rounded(number * (1.0 - 5e-4))
}
