//! The curves of all tactels side by side, so that a step is a few plain loops over the array.

use crate::calibration::curve::{Segment, clamp, rational};
use crate::calibration::{Calibration, CurveKind, ForceCurve, Tactel};

/// The curves of all tactels, all of one kind. The curve of a dead tactel is 0 everywhere.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum TactelCurves {
    /// Slopes.
    Linear(Vec<f32>),
    /// Rational curves with their ends.
    Rational { gain: Vec<f32>, squash: Vec<f32>, low: Vec<f32>, high: Vec<f32> },
    /// The first segments of all tactels, then the second ones; an empty segment adds 0.
    Piecewise(Vec<Vec<Segment>>),
}

impl TactelCurves {
    /// Returns the zeros and the curves of a calibration.
    pub(super) fn new(calibration: &Calibration) -> (Vec<f32>, Self) {
        let count = calibration.tactels.len();
        let mut curves = match calibration.kind {
            CurveKind::Linear => Self::Linear(vec![0.0; count]),
            CurveKind::Rational => {
                let zeros = || vec![0.0; count];
                Self::Rational { gain: zeros(), squash: zeros(), low: zeros(), high: zeros() }
            }
            CurveKind::Piecewise => {
                let knots = calibration.tactels.iter().flatten().map(|tactel| match &tactel.curve {
                    ForceCurve::Piecewise { knots } => knots.len(),
                    ForceCurve::Linear { .. } | ForceCurve::Rational { .. } => 0,
                });
                Self::Piecewise(vec![vec![Segment::default(); count]; knots.max().unwrap_or(0)])
            }
        };
        let mut offset = vec![0.0; count];
        for (i, tactel) in calibration.tactels.iter().enumerate() {
            if let Some(Tactel { offset: zero, curve }) = tactel {
                offset[i] = *zero;
                curves.set(i, curve);
            }
        }
        (offset, curves)
    }

    fn set(&mut self, i: usize, curve: &ForceCurve) {
        match (self, curve) {
            (Self::Linear(gain), ForceCurve::Linear { gain: slope }) => gain[i] = *slope,
            (Self::Rational { gain, squash, low, high }, ForceCurve::Rational { gain: slope, squash: bend, most }) => {
                (gain[i], squash[i]) = (*slope, *bend);
                [low[i], high[i]] = ForceCurve::ends(*slope, *bend, *most);
            }
            (Self::Piecewise(segments), ForceCurve::Piecewise { knots }) => {
                for (k, segment) in ForceCurve::segments(knots).enumerate() {
                    segments[k][i] = segment;
                }
            }
            _ => unreachable!("all curves of a calibration are of its kind"),
        }
    }

    /// Sets the curve of tactel `i` to 0.
    pub(super) fn disable(&mut self, i: usize) {
        match self {
            Self::Linear(gain) => gain[i] = 0.0,
            Self::Rational { gain, squash, low, high } => {
                (gain[i], squash[i], low[i], high[i]) = (0.0, 0.0, 0.0, 0.0);
            }
            Self::Piecewise(segments) => segments.iter_mut().for_each(|segments| segments[i] = Segment::default()),
        }
    }

    /// Returns whether the curve of tactel `i` is 0.
    pub(super) fn is_dead(&self, i: usize) -> bool {
        match self {
            Self::Linear(gain) | Self::Rational { gain, .. } => gain[i] == 0.0,
            Self::Piecewise(segments) => segments.iter().all(|segments| segments[i].slope == 0.0),
        }
    }

    /// Computes the forces of all tactels.
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
