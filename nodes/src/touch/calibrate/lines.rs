//! The curves of all tactels side by side, so that a step is a few plain loops over the array.

use crate::calibration::curve::{Segment, clamp, rational};
use crate::calibration::{Calibration, Curve, Kind, Tactel};

/// The curves of all tactels beyond their zeros; all of one sort. A dead tactel's is 0 everywhere.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Lines {
    /// Slopes.
    Linear(Vec<f32>),
    /// Squashed curves with their ends.
    Rational { gain: Vec<f32>, squash: Vec<f32>, low: Vec<f32>, high: Vec<f32> },
    /// The first segments of all tactels, then the second ones; an empty one adds nothing.
    Piecewise(Vec<Vec<Segment>>),
}

impl Lines {
    /// Straight lines of these slopes.
    pub(super) const fn linear(gain: Vec<f32>) -> Self {
        Self::Linear(gain)
    }

    /// The zeros and the curves of a calibration.
    pub(super) fn new(calibration: &Calibration) -> (Vec<f32>, Self) {
        let count = calibration.tactels.len();
        let mut lines = match calibration.kind {
            Kind::Linear => Self::Linear(vec![0.0; count]),
            Kind::Rational => {
                let zeros = || vec![0.0; count];
                Self::Rational { gain: zeros(), squash: zeros(), low: zeros(), high: zeros() }
            }
            Kind::Piecewise => {
                let most = calibration.tactels.iter().flatten().map(|tactel| match &tactel.curve {
                    Curve::Piecewise { knots } => knots.len(),
                    Curve::Linear { .. } | Curve::Rational { .. } => 0,
                });
                Self::Piecewise(vec![vec![Segment::default(); count]; most.max().unwrap_or(0)])
            }
        };
        let mut offset = vec![0.0; count];
        for (i, tactel) in calibration.tactels.iter().enumerate() {
            if let Some(Tactel { offset: zero, curve }) = tactel {
                offset[i] = *zero;
                lines.set(i, curve);
            }
        }
        (offset, lines)
    }

    fn set(&mut self, i: usize, curve: &Curve) {
        match (self, curve) {
            (Self::Linear(gain), Curve::Linear { gain: slope }) => gain[i] = *slope,
            (Self::Rational { gain, squash, low, high }, Curve::Rational { gain: slope, squash: bend, most }) => {
                (gain[i], squash[i]) = (*slope, *bend);
                [low[i], high[i]] = Curve::ends(*slope, *bend, *most);
            }
            (Self::Piecewise(segments), Curve::Piecewise { knots }) => {
                for (k, segment) in Curve::segments(knots).enumerate() {
                    segments[k][i] = segment;
                }
            }
            _ => unreachable!("all curves of a calibration are of its sort"),
        }
    }

    /// Makes tactel `i` 0 everywhere.
    pub(super) fn kill(&mut self, i: usize) {
        match self {
            Self::Linear(gain) => gain[i] = 0.0,
            Self::Rational { gain, squash, low, high } => {
                (gain[i], squash[i], low[i], high[i]) = (0.0, 0.0, 0.0, 0.0);
            }
            Self::Piecewise(segments) => segments.iter_mut().for_each(|segments| segments[i] = Segment::default()),
        }
    }

    /// Whether tactel `i` measures nothing.
    pub(super) fn is_dead(&self, i: usize) -> bool {
        match self {
            Self::Linear(gain) | Self::Rational { gain, .. } => gain[i] == 0.0,
            Self::Piecewise(segments) => segments.iter().all(|segments| segments[i].slope == 0.0),
        }
    }

    /// The forces of all tactels.
    pub(super) fn apply(&self, cells: &[f32], offset: &[f32], forces: &mut [f32]) {
        match self {
            Self::Linear(gain) => {
                for ((to, from), (offset, gain)) in forces.iter_mut().zip(cells).zip(offset.iter().zip(gain)) {
                    *to = (from - offset) * gain;
                }
            }
            Self::Rational { gain, squash, low, high } => {
                let curves = gain.iter().zip(squash).zip(low.iter().zip(high));
                let readings = cells.iter().zip(offset);
                for ((to, (from, offset)), ((gain, squash), (low, high))) in forces.iter_mut().zip(readings).zip(curves)
                {
                    *to = rational(clamp(from - offset, *low, *high), *gain, *squash);
                }
            }
            Self::Piecewise(segments) => {
                forces.fill(0.0);
                for segments in segments {
                    let readings = cells.iter().zip(offset);
                    for ((to, (from, offset)), segment) in forces.iter_mut().zip(readings).zip(segments) {
                        *to += segment.force(from - offset);
                    }
                }
            }
        }
    }
}
