//! The joint velocities within their limits that lose the least of a twist: min |J v - t|² + eps² |v - c|² with min <= v
//! <= max, and with a component of J v along z of the sensor between 0 and that of t.
//!
//! 1 rad counts as [`LEVER`]. The second term is a damping: it makes the problem strictly convex, so there is one result,
//! and it is continuous in J, t, c and the limits while the arm can move along z at all. With c from [`damped`](super::damped) it takes nothing where nothing
//! is lost.
//!
//! It is solved by a primal active-set method (Nocedal and Wright, *Numerical Optimization*, algorithm 16.3) from v = 0,
//! which every constraint allows. All iterates are within the constraints, so a search that is cut off is too.

use tactflow_runtime::node::State;

use super::damped::PUSH;
use super::joint_limits::Interval;

/// Length that 1 rad of a twist counts as [m].
pub const LEVER: f64 = 0.2;
/// Multipliers below this fraction of the largest linear term are rounding errors [1].
const NEGLIGIBLE: f64 = 1e-12;
/// Joints whose motion along z of the sensor is all below this do not push [m].
const LEAST_PUSH: f64 = 1e-9;

/// Which end of its interval a quantity is held at.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
enum Held {
    #[default]
    Free,
    Min,
    Max,
}

/// Working memory for the joints of an arm. With n joints, constraint n is the one of the push.
#[derive(Debug, State)]
pub struct LeastLost {
    /// J^T J + eps², by rows.
    hessian: Vec<f64>,
    /// J^T t + eps² c.
    linear: Vec<f64>,
    /// The speed along z of the sensor for each velocity.
    push: Vec<f64>,
    limits: Vec<Interval>,
    held: Vec<Held>,
    free: Vec<usize>,
    /// L D L^T of the free part of `hessian`: L below the diagonal, D on it.
    factor: Vec<f64>,
    /// The velocities that the next step aims at [rad/s].
    target: Vec<f64>,
    solution: Vec<f64>,
    slope: Vec<f64>,
}

impl LeastLost {
    /// Returns the working memory for `count` joints.
    #[must_use]
    pub fn new(count: usize) -> Self {
        let (zeros, square) = (vec![0.0; count], vec![0.0; count * count]);
        Self {
            hessian: square.clone(),
            linear: zeros.clone(),
            push: zeros.clone(),
            limits: vec![(0.0, 0.0); count + 1],
            held: vec![Held::Free; count + 1],
            free: Vec::with_capacity(count),
            factor: square,
            target: zeros.clone(),
            solution: zeros.clone(),
            slope: zeros,
        }
    }

    /// Turns the `velocity` c [rad/s] to the one that loses the least of `twist` [m/s, rad/s], damped by eps = `damping`.
    ///
    /// `columns` are those of the Jacobian at the sensor. Every interval contains 0.
    pub fn solve(
        &mut self,
        columns: &[[f64; 6]],
        twist: &[f64; 6],
        intervals: &[Interval],
        damping: f64,
        velocity: &mut [f64],
    ) {
        self.pose(columns, twist, intervals, damping * damping, velocity);
        velocity.fill(0.0);
        let count = velocity.len();
        // Each constraint comes and goes about once; more than this is a circle among ties.
        for _ in 0..4 * (count + 3) {
            let multiplier = self.aim(velocity);
            if let Some((constraint, held)) = self.advance(velocity) {
                self.held[constraint] = held;
            } else if let Some(constraint) = self.wrong(velocity, multiplier) {
                self.held[constraint] = Held::Free;
            } else {
                break;
            }
        }
    }

    /// Sets the problem up, for the square of the damping.
    fn pose(&mut self, columns: &[[f64; 6]], twist: &[f64; 6], intervals: &[Interval], square: f64, centre: &[f64]) {
        let count = columns.len();
        for (i, column) in columns.iter().enumerate() {
            for (j, other) in columns.iter().enumerate() {
                self.hessian[i * count + j] = weighted(column, other);
            }
            self.hessian[i * count + i] += square;
            self.linear[i] = weighted(column, twist) + square * centre[i];
            self.push[i] = column[PUSH];
        }
        self.limits[..count].copy_from_slice(intervals);
        self.limits[count] = (twist[PUSH].min(0.0), twist[PUSH].max(0.0));
        self.held.fill(Held::Free);
        // The push of a slide is an equation.
        if twist[PUSH] == 0.0 {
            self.held[count] = Held::Max;
        }
    }

    /// Sets the target: the best velocities with all held constraints as equations. Returns the multiplier of the push.
    fn aim(&mut self, velocity: &[f64]) -> f64 {
        let count = velocity.len();
        self.free.clear();
        self.free.extend((0..count).filter(|i| self.held[*i] == Held::Free));
        self.target.copy_from_slice(velocity);
        for (row, i) in self.free.iter().enumerate() {
            for (column, j) in self.free[..=row].iter().enumerate() {
                self.factor[row * count + column] = self.hessian[i * count + j];
            }
            let of_held: f64 = (0..count)
                .filter(|j| self.held[*j] != Held::Free)
                .map(|j| self.hessian[i * count + j] * velocity[j])
                .sum();
            self.solution[row] = self.linear[*i] - of_held;
            self.slope[row] = self.push[*i];
        }
        let free = self.free.len();
        factorise(&mut self.factor, count, free);
        substitute(&self.factor, count, &mut self.solution[..free]);
        let mut multiplier = 0.0;
        if self.held[count] != Held::Free {
            substitute(&self.factor, count, &mut self.slope[..free]);
            let per_multiplier: f64 = self.free.iter().zip(&self.slope).map(|(i, slope)| self.push[*i] * slope).sum();
            // A push that no free joint changes is no equation.
            if self.free.iter().any(|i| self.push[*i].abs() > LEAST_PUSH) {
                let free_push: f64 = self.free.iter().zip(&self.solution).map(|(i, v)| self.push[*i] * v).sum();
                let held_push: f64 =
                    (0..count).filter(|j| self.held[*j] != Held::Free).map(|j| self.push[j] * velocity[j]).sum();
                let (min, max) = self.limits[count];
                let wanted = if self.held[count] == Held::Min { min } else { max };
                multiplier = (free_push + held_push - wanted) / per_multiplier;
                for (v, slope) in self.solution.iter_mut().zip(&self.slope).take(free) {
                    *v -= multiplier * slope;
                }
            }
        }
        for (i, v) in self.free.iter().zip(&self.solution) {
            self.target[*i] = *v;
        }
        multiplier
    }

    /// Moves to the target, or to the first constraint on the way, which it returns with the end that it is held at.
    fn advance(&self, velocity: &mut [f64]) -> Option<(usize, Held)> {
        let count = velocity.len();
        let push = |v: &[f64]| self.push.iter().zip(v).map(|(push, v)| push * v).sum::<f64>();
        let ends =
            |i: usize| if i < count { (velocity[i], self.target[i]) } else { (push(velocity), push(&self.target)) };
        let (mut step, mut first) = (1.0, None);
        for i in (0..=count).filter(|i| self.held[*i] == Held::Free) {
            let ((from, to), (min, max)) = (ends(i), self.limits[i]);
            let (end, held) = if to > max { (max, Held::Max) } else { (min, Held::Min) };
            if to > max || to < min {
                let until = ((end - from) / (to - from)).max(0.0);
                if until < step {
                    (step, first) = (until, Some((i, held)));
                }
            }
        }
        for (v, target) in velocity.iter_mut().zip(&self.target) {
            *v += step * (target - *v);
        }
        // Exactly: no rounding is left to cross a limit with.
        if let Some((i, held)) = first.filter(|(i, _)| *i < count) {
            velocity[i] = if held == Held::Min { self.limits[i].0 } else { self.limits[i].1 };
        }
        first
    }

    /// Returns the held constraint whose multiplier shows most that it should be free, if there is one.
    fn wrong(&self, velocity: &[f64], multiplier: f64) -> Option<usize> {
        let count = velocity.len();
        let largest = self.linear.iter().fold(0.0, |largest: f64, x| largest.max(x.abs()));
        let (mut most, mut wrong) = (NEGLIGIBLE * largest, None);
        for i in (0..=count).filter(|i| self.limits[*i].0 < self.limits[*i].1) {
            // How much the objective grows if the quantity grows.
            let growth = if i < count {
                let row = &self.hessian[i * count..(i + 1) * count];
                let sum: f64 = row.iter().zip(velocity).map(|(h, v)| h * v).sum();
                sum - self.linear[i] + multiplier * self.push[i]
            } else {
                -multiplier
            };
            let gain = match self.held[i] {
                Held::Free => 0.0,
                Held::Min => -growth,
                Held::Max => growth,
            };
            if gain > most {
                (most, wrong) = (gain, Some(i));
            }
        }
        wrong
    }
}

/// Returns the product of two twists in which 1 rad counts as [`LEVER`] [m²/s²].
#[must_use]
pub fn weighted(a: &[f64; 6], b: &[f64; 6]) -> f64 {
    (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) + LEVER * LEVER * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])
}

/// Factorises the first `size` rows of a positive definite matrix with rows of `stride` entries, in place: L D L^T.
fn factorise(m: &mut [f64], stride: usize, size: usize) {
    for i in 0..size {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| m[i * stride + k] * m[j * stride + k] * m[k * stride + k]).sum();
            m[i * stride + j] -= sum;
            if j < i {
                m[i * stride + j] /= m[j * stride + j];
            }
        }
    }
}

/// Solves L D L^T x = b in place.
fn substitute(factor: &[f64], stride: usize, b: &mut [f64]) {
    let size = b.len();
    for i in 0..size {
        for k in 0..i {
            b[i] -= factor[i * stride + k] * b[k];
        }
    }
    for i in (0..size).rev() {
        b[i] /= factor[i * stride + i];
        for k in i + 1..size {
            b[i] -= factor[k * stride + i] * b[k];
        }
    }
}

#[cfg(test)]
mod tests;
