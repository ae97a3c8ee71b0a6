//! The layout of a still picture.

/// Width of the picture [px].
pub(crate) const WIDTH: f64 = 960.0;
/// Space around the picture, and between its parts [px].
pub(crate) const MARGIN: f64 = 20.0;
/// Left and right end of the curves [px].
pub(crate) const CURVES: [f64; 2] = [400.0, WIDTH - MARGIN];
/// Top of the first curves, below the names of the modes [px].
pub(crate) const TOP: f64 = 56.0;
/// Height of a line of text [px].
pub(crate) const LINE: f64 = 18.0;
/// Estimated width of a character [px].
pub(crate) const CHARACTER: f64 = 7.5;
