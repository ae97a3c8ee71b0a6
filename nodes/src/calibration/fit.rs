//! Fits curves to the samples of one tactel: robust, deterministic and monotone.
//!
//! The samples of each branch, force rising and force falling, are sorted into bins of force, which are narrow where
//! the curve is steep. Each bin gives one point: the median of its forces and of its readings. So a long dwell does not
//! outweigh a press, outliers do not count, and both branches have the same weight: a curve runs through the middle of
//! the hysteresis. All fits pass through zero, so an unloaded tactel gives no force.
//!
//! The rational curve and the knots are fitted to the readings, s over f, because the noise is in the readings: by
//! least squares with Huber's weights. The straight line is fitted to the forces, because its model error is larger
//! than the noise.

use super::ForceCurve;
use super::samples::{TactelSample, median};

/// Number of bins of a branch.
const BINS: usize = 24;

/// Maximum number of segments of a piecewise curve.
const MAX_SEGMENTS: usize = 8;

/// Number of samples from which a bin has full weight.
const FULL_WEIGHT_SAMPLES: f64 = 8.0;

/// Minimum number of loaded samples of a tactel.
const MIN_SAMPLES: usize = 20;
/// Minimum number of points of a tactel.
const MIN_POINTS: usize = 5;

/// Minimum step of the reading from knot to knot, as a fraction of the range.
const MIN_STEP: f64 = 0.002;

/// The point of a bin, scaled so that the maximum force and its reading are about 1.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Point {
    x: f64,
    y: f64,
    weight: f64,
    count: usize,
    is_loading: bool,
}

/// The points of a tactel with their scale.
#[derive(Debug, Clone, PartialEq)]
pub struct Points {
    points: Vec<Point>,
    /// Maximum force [N].
    pub most: f64,
    /// Reading beyond the offset at the largest forces [reading].
    pub range: f64,
    /// The forward curve: knots of x and y, from (0, 0).
    middle: Vec<[f64; 2]>,
}

impl Points {
    /// Sorts samples into points, or returns `None` if they are too few. A force up to `unloaded` [N] counts as no
    /// load.
    #[must_use]
    pub fn new(samples: &[TactelSample], unloaded: f64) -> Option<Self> {
        let most = samples.iter().fold(0.0, |most: f64, sample| most.max(sample.force));
        let loaded = samples.iter().filter(|sample| sample.force > unloaded).count();
        if most <= 0.0 || loaded < MIN_SAMPLES {
            return None;
        }
        let mut bins: Vec<[Vec<f64>; 2]> = vec![Default::default(); 2 * BINS];
        for TactelSample { force, s, is_loading } in samples {
            // The edges of the bins are squares.
            let bin = ((force / most).max(0.0).sqrt() * BINS as f64) as usize;
            let [forces, readings] = &mut bins[bin.min(BINS - 1) * 2 + usize::from(*is_loading)];
            forces.push(*force);
            readings.push(*s);
        }
        let mut points = Vec::new();
        for (i, [forces, readings]) in bins.iter_mut().enumerate().filter(|(_, [forces, _])| !forces.is_empty()) {
            let count = forces.len();
            let weight = (count as f64 / FULL_WEIGHT_SAMPLES).min(1.0);
            points.push(Point { x: median(forces) / most, y: median(readings), weight, count, is_loading: i % 2 == 1 });
        }
        let range = points.iter().filter(|point| point.x > 0.8).fold(0.0, |range: f64, point| range.max(point.y));
        if range <= 0.0 || points.len() < MIN_POINTS {
            return None;
        }
        points.iter_mut().for_each(|point| point.y /= range);
        let mut points = Self { points, most, range, middle: Vec::new() };
        points.middle = points.knots();
        (points.middle.len() > 1).then_some(points)
    }

    /// Fits the straight line with the smallest error of the force; `sign` is 1 if readings rise with the force, else
    /// -1.
    pub fn linear(&self, sign: f32) -> ForceCurve {
        let sum = |g: fn(&Point) -> f64| self.points.iter().map(|point| point.weight * g(point)).sum::<f64>();
        let slope = sum(|point| point.x * point.y) / sum(|point| point.y * point.y).max(1e-9);
        ForceCurve::Linear { gain: (slope * self.most / self.range) as f32 * sign }
    }

    /// Fits the rational curve y = x / (g + q x).
    pub fn rational(&self, sign: f32) -> ForceCurve {
        let mut curve = self.first_guess();
        for _ in 0..5 {
            curve = self.descend(curve, &self.weights(|x| rational_at(curve, x)));
        }
        let [g, q] = curve;
        ForceCurve::Rational {
            gain: (g * self.most / self.range) as f32 * sign,
            squash: (q / self.range) as f32 * sign,
            most: self.most as f32,
        }
    }

    /// Returns the weights of the points, smaller for those far from a forward curve.
    fn weights(&self, curve: impl Fn(f64) -> f64) -> Vec<f64> {
        let residuals: Vec<f64> = self.points.iter().map(|point| point.y - curve(point.x)).collect();
        let mut sizes: Vec<f64> = residuals.iter().map(|residual| residual.abs()).collect();
        let bound = (1.5 * 1.4826 * median(&mut sizes)).max(1e-6);
        let huber = |residual: &f64| (bound / residual.abs()).min(1.0);
        self.points.iter().zip(&residuals).map(|(point, residual)| point.weight * huber(residual)).collect()
    }

    /// Returns a first rational curve from x / y = g + q x, which is linear.
    fn first_guess(&self) -> [f64; 2] {
        let mut sums = [0.0; 5];
        for point in self.points.iter().filter(|point| point.y > 0.05 && point.x > 0.0) {
            let (x, z, w) = (point.x, point.x / point.y, point.weight * point.y * point.y);
            let terms = [w, w * x, w * x * x, w * z, w * z * x];
            sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        }
        let [w, wx, wxx, wz, wzx] = sums;
        let determinant = w * wxx - wx * wx;
        if determinant <= 1e-12 {
            return [1.0, 0.0];
        }
        inside([(wz * wxx - wzx * wx) / determinant, (w * wzx - wx * wz) / determinant])
    }

    /// Minimises the weighted squares from `curve` by the Levenberg-Marquardt method.
    fn descend(&self, mut curve: [f64; 2], weights: &[f64]) -> [f64; 2] {
        let cost = |curve: [f64; 2]| -> f64 {
            let residual = |p: &Point| p.y - rational_at(curve, p.x);
            self.points.iter().zip(weights).map(|(p, w)| w * residual(p) * residual(p)).sum()
        };
        let mut damping = 1e-3;
        let mut last = cost(curve);
        for _ in 0..40 {
            let [g, q] = curve;
            // The weighted normal equations: matrix [a b; b d], right side [e f].
            let (mut a, mut b, mut d, mut e, mut f) = (0.0, 0.0, 0.0, 0.0, 0.0);
            for (p, w) in self.points.iter().zip(weights) {
                let m = rational_at(curve, p.x);
                let (dg, dq, r) = (-m / (g + q * p.x.max(0.0)), -m * m, p.y - m);
                a += w * dg * dg;
                b += w * dg * dq;
                d += w * dq * dq;
                e += w * dg * r;
                f += w * dq * r;
            }
            let (a, d) = (a * (1.0 + damping) + 1e-15, d * (1.0 + damping) + 1e-15);
            let determinant = a * d - b * b;
            if determinant <= 0.0 {
                break;
            }
            let next = inside([g + (e * d - f * b) / determinant, q + (f * a - e * b) / determinant]);
            let now = cost(next);
            if now < last {
                (curve, last, damping) = (next, now, damping * 0.3);
            } else {
                damping *= 4.0;
            }
        }
        curve
    }

    /// Fits straight lines between knots.
    pub fn piecewise(&self, sign: f32) -> ForceCurve {
        let knots = self.middle[1..].iter().map(|[x, y]| [(y * self.range) as f32 * sign, (x * self.most) as f32]);
        ForceCurve::Piecewise { knots: knots.collect() }
    }

    /// Returns the knots of the forward curve from (0, 0): least squares, then made monotone.
    fn knots(&self) -> Vec<[f64; 2]> {
        let places = self.places();
        let mut weights: Vec<f64> = self.points.iter().map(|point| point.weight).collect();
        let mut heights = Vec::new();
        for _ in 0..5 {
            heights = self.heights(&places, &weights);
            let knots: Vec<[f64; 2]> =
                places.iter().copied().zip(heights.iter().copied()).map(<[f64; 2]>::from).collect();
            weights = self.weights(|x| between(&knots, x));
        }
        let mut knots = vec![[0.0, 0.0]];
        for (x, y) in places.iter().zip(rising(&heights)).skip(1) {
            if y > knots.last().map_or(0.0, |last| last[1]) + MIN_STEP {
                knots.push([*x, y]);
            }
        }
        knots
    }

    /// Returns the x of the knots: at squares, with at least two points between neighbours.
    fn places(&self) -> Vec<f64> {
        let between = |from: f64, to: f64| self.points.iter().filter(|p| p.x > from && p.x <= to).count();
        let mut places = vec![0.0];
        for k in 1..=MAX_SEGMENTS {
            let (last, x) = (places[places.len() - 1], (k as f64 / MAX_SEGMENTS as f64).powi(2));
            if between(last, x) >= 2 {
                places.push(x);
            } else if k == MAX_SEGMENTS {
                if places.len() > 1 {
                    places.pop();
                }
                places.push(x);
            }
        }
        places
    }

    /// Returns the y of the knots with the smallest weighted squares, the first of them 0: a tridiagonal system.
    fn heights(&self, places: &[f64], weights: &[f64]) -> Vec<f64> {
        let count = places.len();
        let (mut diagonal, mut above, mut right) = (vec![1e-9; count], vec![0.0; count], vec![0.0; count]);
        for (p, w) in self.points.iter().zip(weights) {
            let x = p.x.clamp(0.0, 1.0);
            let k = places.partition_point(|place| *place < x).clamp(1, count - 1);
            let t = (x - places[k - 1]) / (places[k] - places[k - 1]);
            diagonal[k - 1] += w * (1.0 - t) * (1.0 - t);
            diagonal[k] += w * t * t;
            above[k - 1] += w * t * (1.0 - t);
            right[k - 1] += w * (1.0 - t) * p.y;
            right[k] += w * t * p.y;
        }
        // The first is 0, so it drops out of the other equations.
        for k in 2..count {
            let by = above[k - 1] / diagonal[k - 1];
            diagonal[k] -= by * above[k - 1];
            right[k] -= by * right[k - 1];
        }
        let mut heights = vec![0.0; count];
        for k in (1..count).rev() {
            let next = if k + 1 < count { above[k] * heights[k + 1] } else { 0.0 };
            heights[k] = (right[k] - next) / diagonal[k];
        }
        heights
    }

    /// Returns the maximum distance of the two branches as a fraction of the range, or `None` for a single branch.
    #[must_use]
    pub fn hysteresis(&self) -> Option<f64> {
        let beyond = |is_loading: bool| -> Vec<[f64; 2]> {
            let points = self.points.iter().filter(|p| p.is_loading == is_loading && p.count >= 3);
            points.map(|p| [p.x, p.y - between(&self.middle, p.x)]).collect()
        };
        let (up, down) = (beyond(true), beyond(false));
        let reaches = |points: &[[f64; 2]]| points.len() >= 4 && points.last().is_some_and(|last| last[0] > 0.7);
        if !reaches(&up) || !reaches(&down) {
            return None;
        }
        let distances = down.iter().map(|[x, y]| (y - between(&up, *x)).abs());
        Some(distances.fold(0.0, f64::max))
    }

    /// Returns the branches as (force, reading beyond the offset) for a plot: rising, then falling.
    #[must_use]
    pub fn branches(&self) -> [Vec<[f64; 2]>; 2] {
        [true, false].map(|is_loading| {
            let points = self.points.iter().filter(|p| p.is_loading == is_loading);
            points.map(|p| [p.x * self.most, p.y * self.range]).collect()
        })
    }
}

/// Returns the nearest valid curve: g > 0 and q ≥ 0.
fn inside([g, q]: [f64; 2]) -> [f64; 2] {
    [g.max(1e-3), q.max(0.0)]
}

/// Returns y of the rational curve at `x`, and 0 below 0.
fn rational_at([g, q]: [f64; 2], x: f64) -> f64 {
    let x = x.max(0.0);
    x / (g + q * x)
}

/// Interpolates points with increasing x at `x`; constant beyond the ends.
fn between(points: &[[f64; 2]], x: f64) -> f64 {
    let after = points.partition_point(|point| point[0] < x);
    match (after.checked_sub(1).and_then(|before| points.get(before)), points.get(after)) {
        (Some([x0, y0]), Some([x1, y1])) => y0 + (x - x0) / (x1 - x0) * (y1 - y0),
        (Some(point), None) | (None, Some(point)) => point[1],
        (None, None) => 0.0,
    }
}

/// Returns the nearest monotone numbers: decreasing neighbours are pooled.
fn rising(numbers: &[f64]) -> Vec<f64> {
    let mut pools: Vec<(f64, usize)> = Vec::new();
    for number in numbers {
        let mut pool = (*number, 1);
        while let Some((mean, count)) = pools.pop_if(|(mean, _)| *mean > pool.0) {
            let sum = mean * count as f64 + pool.0 * pool.1 as f64;
            pool = (sum / (count + pool.1) as f64, count + pool.1);
        }
        pools.push(pool);
    }
    pools.into_iter().flat_map(|(mean, count)| std::iter::repeat_n(mean, count)).collect()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// Samples of a characteristic, up and down, with some unloaded ones.
    fn samples(s: impl Fn(f64) -> f64, most: f64) -> Vec<TactelSample> {
        let force = |k: usize| most * (k as f64 / 400.0);
        let up = (0..=400).map(|k| TactelSample { force: force(k), s: s(force(k)), is_loading: true });
        let down = (0..400).rev().map(|k| TactelSample { force: force(k), s: s(force(k)), is_loading: false });
        let rest = (0..50).map(|_| TactelSample { force: 0.0, s: 0.0, is_loading: true });
        rest.chain(up).chain(down).collect()
    }

    proptest! {
        #[test]
        fn what_is_squashed_is_found_again(a in 500.0..5000.0f64, b in 0.5..50.0f64, most in 1.0..20.0f64) {
            let points = Points::new(&samples(|f| a * f / (f + b), most), 0.01).unwrap();
            let ForceCurve::Rational { gain, squash, .. } = points.rational(1.0) else { panic!("squashed") };
            prop_assert!((f64::from(gain) * a / b - 1.0).abs() < 1e-3, "gain {} for {}", gain, b / a);
            prop_assert!((f64::from(squash) * a - 1.0).abs() < 1e-3 * (1.0 + b / most), "squash {} for {}", squash, 1.0 / a);
            prop_assert!(points.hysteresis().unwrap() < 0.005);
        }

        #[test]
        fn outliers_do_not_count(a in 1000.0..4000.0f64, b in 1.0..10.0f64, every in 12..30usize, by in 300.0..3000.0f64) {
            let clean = samples(|f| a * f / (f + b), 5.0);
            let mut outliers = clean.clone();
            outliers.iter_mut().skip(60).step_by(every).for_each(|sample| sample.s += by);
            let at = |samples: &[TactelSample], kind: usize| {
                let points = Points::new(samples, 0.01).unwrap();
                let curve = [points.rational(1.0), points.piecewise(1.0)][kind].clone();
                f64::from(curve.force((a * 2.5 / (2.5 + b)) as f32))
            };
            for kind in 0..2 {
                let moved = (at(&outliers, kind) - at(&clean, kind)).abs();
                prop_assert!(moved < 0.1, "outliers of {} counts move 2.5 N by {}", by, moved);
            }
        }

        #[test]
        fn pooled_neighbours_are_the_nearest_that_rise(numbers in prop::collection::vec(-5.0..5.0f64, 1..12)) {
            // The closed form: the maximum over starts of the minimum over ends of the mean of each range around a number.
            let mean = |from: usize, to: usize| numbers[from..=to].iter().sum::<f64>() / (to + 1 - from) as f64;
            for (i, number) in rising(&numbers).into_iter().enumerate() {
                let least = |from: usize| (i..numbers.len()).map(|to| mean(from, to)).fold(f64::INFINITY, f64::min);
                let exact = (0..=i).map(least).fold(f64::NEG_INFINITY, f64::max);
                prop_assert!((number - exact).abs() < 1e-9, "{} at {} of {:?}", number, i, numbers);
            }
        }

        #[test]
        fn no_heights_near_the_best_are_better(noise in prop::collection::vec(-0.1..0.1f64, 200), which in 1..6usize, by in -0.05..0.05f64) {
            let samples: Vec<TactelSample> = noise.iter().enumerate().map(|(i, noise)| {
                let force = i as f64 / 199.0;
                TactelSample { force, s: force.sqrt() + noise, is_loading: true }
            }).collect();
            let points = Points::new(&samples, 0.01).unwrap();
            let (places, weights) = (points.places(), vec![1.0; points.points.len()]);
            let best = points.heights(&places, &weights);
            let cost = |heights: &[f64]| {
                let knots: Vec<[f64; 2]> = places.iter().zip(heights).map(|(x, y)| [*x, *y]).collect();
                points.points.iter().map(|p| (p.y - between(&knots, p.x)).powi(2)).sum::<f64>()
            };
            let mut other = best.clone();
            let which = which.min(other.len() - 1);
            other[which] += by;
            prop_assert!(best[0] == 0.0 && cost(&best) <= cost(&other) + 1e-12);
        }
    }

    #[test]
    fn a_straight_line_is_found_and_knots_lie_on_it() {
        let points = Points::new(&samples(|f| 120.0 * f, 4.0), 0.01).unwrap();
        let ForceCurve::Linear { gain } = points.linear(-1.0) else { panic!("a line") };
        assert!((gain + 1.0 / 120.0).abs() < 1e-7, "{gain}");
        let ForceCurve::Piecewise { knots } = points.piecewise(-1.0) else { panic!("knots") };
        assert_eq!(knots.len(), MAX_SEGMENTS);
        for [s, force] in knots {
            assert!((s + 120.0 * force).abs() < 0.01, "{s} for {force} N");
        }
    }

    #[test]
    fn too_few_samples_have_no_points() {
        let all = samples(|f| 100.0 * f, 4.0);
        assert!(Points::new(&all[..60], 0.01).is_none(), "ten with a force");
        assert!(Points::new(&[], 0.01).is_none());
        assert!(Points::new(&all, 3.9).is_none(), "the rest is nothing");
        assert!(Points::new(&samples(|_| 0.0, 4.0), 0.01).is_none(), "no answer");
        assert!(Points::new(&samples(|f| -f, 4.0), 0.01).is_none(), "the wrong way");
    }
}
