//! The curve of one tactel, from its reading to a force: the inverse of its characteristic (paper section III, fig. 1).
//!
//! Every curve starts at the unloaded reading, the offset, and is a function of s = reading - offset. All arithmetic
//! uses 32-bit floats, like images, in the same order as the node `calibrate`. So a fitted curve, one from a file and
//! one in a graph give the same bits.

use std::fmt;

#[cfg(feature = "cli")]
use tactflow_runtime::cli::clap;
use tactflow_runtime::node::Param;

/// The kinds of curves.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum CurveKind {
    /// f = gain s.
    Linear,
    /// f = gain s / (1 - squash s).
    Rational,
    /// Straight lines between knots.
    Piecewise,
}

/// All kinds, the simplest first.
pub const KINDS: [CurveKind; 3] = [CurveKind::Linear, CurveKind::Rational, CurveKind::Piecewise];

impl fmt::Display for CurveKind {
    /// Writes the name in a file and on the command line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(Self::CONTENTS.words[*self as usize].0)
    }
}

/// The calibration of one tactel: its zero and its curve.
#[derive(Debug, Clone, PartialEq)]
pub struct Tactel {
    /// Unloaded reading [unit of the reading].
    pub offset: f32,
    /// Curve from the reading beyond the offset to a force.
    pub curve: ForceCurve,
}

/// A curve from s, the reading beyond the offset, to a force.
#[derive(Debug, Clone, PartialEq)]
#[must_use]
pub enum ForceCurve {
    /// A straight line without an end: f = gain s, also below zero.
    Linear {
        /// Slope [force per reading].
        gain: f32,
    },
    /// The inverse of s = f / (gain + squash f) up to a force: the saturating curve of piezo-resistive foam.
    Rational {
        /// Slope at the zero [force per reading].
        gain: f32,
        /// One over the asymptote of s, with the sign of the gain; 0 is a straight line [1 per reading].
        squash: f32,
        /// Maximum force, where the curve ends.
        most: f32,
    },
    /// Straight lines from zero through knots; the curve ends at the last knot.
    Piecewise {
        /// s and force of each knot; both move away from zero.
        knots: Vec<[f32; 2]>,
    },
}

/// Limits `s` to `low..=high` by comparisons. `min` and `max` could change the sign of a zero.
#[inline(always)]
#[must_use]
pub fn clamp(s: f32, low: f32, high: f32) -> f32 {
    let s = if s > low { s } else { low };
    if s < high { s } else { high }
}

/// Returns the force of a rational curve for an s up to its end.
#[inline(always)]
#[must_use]
pub fn rational(s: f32, gain: f32, squash: f32) -> f32 {
    gain * s / (1.0 - squash * s)
}

/// A straight line between two knots, as its contribution to the force.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Segment {
    /// Lower s of the two knots.
    pub low: f32,
    /// Higher s of the two knots.
    pub high: f32,
    /// s of the first knot.
    pub start: f32,
    /// Slope [force per reading].
    pub slope: f32,
}

impl Segment {
    /// Returns the contribution to the force at `s`.
    #[inline(always)]
    #[must_use]
    pub fn force(self, s: f32) -> f32 {
        (clamp(s, self.low, self.high) - self.start) * self.slope
    }
}

impl ForceCurve {
    /// Returns the kind.
    #[must_use]
    pub const fn kind(&self) -> CurveKind {
        match self {
            Self::Linear { .. } => CurveKind::Linear,
            Self::Rational { .. } => CurveKind::Rational,
            Self::Piecewise { .. } => CurveKind::Piecewise,
        }
    }

    /// Returns the range of s of a rational curve, lower end first.
    #[must_use]
    pub fn ends(gain: f32, squash: f32, most: f32) -> [f32; 2] {
        let end = most / (gain + squash * most);
        if end > 0.0 { [0.0, end] } else { [end, 0.0] }
    }

    /// Returns the segments between knots.
    pub fn segments(knots: &[[f32; 2]]) -> impl Iterator<Item = Segment> {
        let starts = std::iter::once([0.0, 0.0]).chain(knots.iter().copied());
        starts.zip(knots).map(|([s, f], [to, force])| {
            let [low, high] = if *to > s { [s, *to] } else { [*to, s] };
            Segment { low, high, start: s, slope: (force - f) / (to - s) }
        })
    }

    /// Returns the force at `s`. Only a linear curve has negative forces and no end.
    #[must_use]
    pub fn force(&self, s: f32) -> f32 {
        match self {
            Self::Linear { gain } => s * gain,
            Self::Rational { gain, squash, most } => {
                let [low, high] = Self::ends(*gain, *squash, *most);
                rational(clamp(s, low, high), *gain, *squash)
            }
            Self::Piecewise { knots } => Self::segments(knots).fold(0.0, |force, segment| force + segment.force(s)),
        }
    }

    /// Returns |s| under a force up to the maximum: the characteristic itself, for a plot.
    #[must_use]
    pub fn reading(&self, force: f64) -> f64 {
        match self {
            Self::Linear { gain } => force / f64::from(gain.abs()),
            Self::Rational { gain, squash, .. } => force / (f64::from(gain.abs()) + f64::from(squash.abs()) * force),
            Self::Piecewise { knots } => {
                let mut last = [0.0; 2];
                for knot in knots.iter().map(|knot| knot.map(f64::from)) {
                    if force <= knot[1] {
                        let part = if knot[1] > last[1] { (force - last[1]) / (knot[1] - last[1]) } else { 1.0 };
                        return (last[0] + part * (knot[0] - last[0])).abs();
                    }
                    last = knot;
                }
                last[0].abs()
            }
        }
    }

    /// Returns what makes the curve unusable: the name of the number and the mistake. `None` if the curve is good.
    #[must_use]
    pub fn flaw(&self) -> Option<(&'static str, String)> {
        match self {
            Self::Linear { gain } | Self::Rational { gain, .. } if *gain == 0.0 => {
                Some(("gain", "a `gain` of 0 gives no force; list the tactel under `dead`".into()))
            }
            Self::Linear { .. } => None,
            Self::Rational { gain, squash, most } => {
                if *most <= 0.0 {
                    return Some(("most", "`most`, the maximum force, must be greater than 0".into()));
                }
                if squash * gain < 0.0 {
                    return Some(("squash", "`squash` must have the sign of `gain`".into()));
                }
                // At its end the curve must reach `most`. Otherwise the numbers are too extreme for 32 bits.
                let [low, high] = Self::ends(*gain, *squash, *most);
                let end = rational(low + high, *gain, *squash);
                let is_off = (end - most).abs() > 0.01 * most || !end.is_finite();
                is_off.then(|| {
                    ("squash", "the curve is too flat at its end: a reading does not determine a force".into())
                })
            }
            Self::Piecewise { knots } => flaw_of_knots(knots),
        }
    }
}

fn flaw_of_knots(knots: &[[f32; 2]]) -> Option<(&'static str, String)> {
    let Some([first, _]) = knots.first() else {
        return Some(("readings", "the curve has no knot; list the tactel under `dead`".into()));
    };
    let sign = if *first < 0.0 { -1.0 } else { 1.0 };
    let mut last = [0.0, 0.0];
    for [s, force] in knots {
        if (s - last[0]) * sign <= 0.0 {
            let message =
                format!("`readings` must increase from 0 or decrease from 0, but {s} comes after {}", last[0]);
            return Some(("readings", message));
        }
        if force - last[1] < 0.0 {
            return Some(("forces", format!("`forces` must not decrease, but {force} comes after {}", last[1])));
        }
        last = [*s, *force];
    }
    if last[1] <= 0.0 {
        return Some(("forces", "the last force must be greater than 0".into()));
    }
    let is_steep = ForceCurve::segments(knots).any(|segment| !segment.slope.is_finite());
    is_steep.then(|| ("readings", "two knots are too close to each other".into()))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::calibration::testing::max_force;

    fn rational_of(gain: f32, squash: f32, most: f32) -> ForceCurve {
        ForceCurve::Rational { gain, squash, most }
    }

    #[test]
    fn the_squashed_curve_is_the_inverse_of_its_characteristic() {
        // s = a f / (f + b) with a = 4000 counts and b = 3 N: gain = b / a, squash = 1 / a.
        let curve = rational_of(3.0 / 4000.0, 1.0 / 4000.0, 5.0);
        for force in [0.0, 0.01, 0.5, 1.0, 3.0, 4.9, 5.0_f64] {
            let s = 4000.0 * force / (force + 3.0);
            let back = f64::from(curve.force(s as f32));
            assert!((back - force).abs() < 1e-5, "{force} N came back as {back}");
        }
    }

    #[test]
    fn outside_of_what_was_calibrated_a_curve_stays() {
        let squashed = rational_of(3.0 / 4000.0, 1.0 / 4000.0, 5.0);
        let falling = rational_of(-3.0 / 4000.0, -1.0 / 4000.0, 5.0);
        let knots = ForceCurve::Piecewise { knots: vec![[100.0, 0.5], [300.0, 2.5]] };
        let down = ForceCurve::Piecewise { knots: vec![[-100.0, 0.5], [-300.0, 2.5]] };
        let line = ForceCurve::Linear { gain: 0.01 };
        let cases = [
            (&squashed, -100.0, 0.0),
            (&squashed, 4000.0, 5.0),
            (&squashed, 1e30, 5.0),
            (&falling, 100.0, 0.0),
            (&falling, -4000.0, 5.0),
            (&knots, -1.0, 0.0),
            (&knots, 50.0, 0.25),
            (&knots, 200.0, 1.5),
            (&knots, 1e9, 2.5),
            (&down, 1.0, 0.0),
            (&down, -200.0, 1.5),
            (&down, -1e9, 2.5),
            (&line, -100.0, -1.0),
            (&line, 1e6, 1e4),
        ];
        for (curve, s, force) in cases {
            assert!(
                (curve.force(s) - force).abs() < 1e-5 * force.abs().max(1.0),
                "{curve:?} at {s}: {}",
                curve.force(s)
            );
            assert_eq!(curve.flaw(), None, "{curve:?}");
        }
    }

    #[test]
    fn what_is_no_curve_is_named() {
        let knots = |knots: &[[f32; 2]]| ForceCurve::Piecewise { knots: knots.to_vec() };
        let cases = [
            (ForceCurve::Linear { gain: 0.0 }, "gain"),
            (rational_of(0.0, 1e-3, 1.0), "gain"),
            (rational_of(1e-3, 1e-3, 0.0), "most"),
            (rational_of(1e-3, -1e-3, 1.0), "squash"),
            (rational_of(-1e-3, 1e-3, 1.0), "squash"),
            (rational_of(1e-9, 1.0, 1e9), "squash"),
            (rational_of(1e-38, 0.0, 1e38), "squash"),
            (knots(&[]), "readings"),
            (knots(&[[0.0, 1.0]]), "readings"),
            (knots(&[[1.0, 1.0], [1.0, 2.0]]), "readings"),
            (knots(&[[1.0, 1.0], [-2.0, 2.0]]), "readings"),
            (knots(&[[1.0, 1.0], [2.0, 0.5]]), "forces"),
            (knots(&[[1.0, -1.0], [2.0, 0.5]]), "forces"),
            (knots(&[[1.0, 0.0]]), "forces"),
            (knots(&[[1e-30, 1e30]]), "readings"),
        ];
        for (curve, place) in cases {
            assert_eq!(curve.flaw().map(|(place, _)| place), Some(place), "{curve:?}");
        }
    }

    /// A curve of any sort without a flaw, with an end.
    fn any_curve() -> impl Strategy<Value = ForceCurve> {
        let rational = (1e-5..1.0f32, 0.0..0.1f32, 0.1..50.0f32)
            .prop_map(|(gain, squash, most)| ForceCurve::Rational { gain, squash, most });
        let steps = prop::collection::vec((0.5..400.0f32, 0.0..3.0f32), 1..9);
        let knots = steps.prop_map(|steps| {
            let mut last = [0.0, 0.0];
            let add = |(s, force): (f32, f32)| {
                last = [last[0] + s, last[1] + force];
                last
            };
            ForceCurve::Piecewise { knots: steps.into_iter().map(add).collect() }
        });
        prop_oneof![rational, knots].prop_filter("a curve without a flaw", |curve| curve.flaw().is_none())
    }

    proptest! {
        #[test]
        fn the_characteristic_and_its_inverse_belong_together(curve in any_curve(), part in 0.0..1.0f64) {
            let force = part * f64::from(max_force(&curve));
            let back = f64::from(curve.force(curve.reading(force) as f32));
            // Where the curve is flat, 32 bits of a reading are few of a force; flat knots have a range of readings.
            prop_assert!((back - force).abs() < 0.01 * f64::from(max_force(&curve)), "{} of {}", back, force);
        }

        #[test]
        fn more_is_never_less_and_never_out_of_bounds(curve in any_curve(), s in -1e4..1e5f32, more in 0.0..1e5f32) {
            let (one, other) = (curve.force(s), curve.force(s + more));
            let most = max_force(&curve);
            // Every operation rounds monotonically, so not even the last bit goes back.
            prop_assert!(other >= one, "{} then {}", one, other);
            for force in [one, other] {
                prop_assert!(force >= 0.0 && force <= 1.01 * most, "{} of {}", force, most);
            }
        }
    }
}
