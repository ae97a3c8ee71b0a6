//! What the foam is made of, and the laws of one column of it.
//!
//! The foam is an elastic foundation: columns that stand side by side on a rigid plate and do not know of each other.
//! A column that is pressed in by c bears p(c) = k c, and k3 (c - c0)³ more past c0. An object that gives way is a spring
//! in series: of an indentation d the column takes c, so that d = c + p(c) / k_object.

use tactflow_runtime::node::{NonNegative, Positive};
use tactflow_runtime::params;

params! {
    Foam:
    /// Stiffness of the foam under one tactel of 5 mm by 5 mm; others go by their area [N/m].
    stiffness: Positive = Positive(300.0),
    /// Indentation from which on it stiffens [m].
    stiffens_from: Positive = Positive(0.0025),
    /// How much: the cubic part of the stiffness [N/m³ for a tactel of 5 mm by 5 mm].
    stiffening: NonNegative = NonNegative(9.6e7),
    /// Thickness; what is pressed deeper meets the plate [m].
    thickness: Positive = Positive(0.008),
    /// Damping of the foam under one such tactel [N s/m].
    damping: NonNegative = NonNegative(1.5),
    /// Stiffness against shear of the foam under one such tactel [N/m].
    shear: Positive = Positive(200.0),
    /// Standard deviation of the bell by which the foam spreads a load over its neighbours [m].
    spread: Positive = Positive(0.003),
    /// Coefficient of friction at rest [1].
    static_friction: NonNegative = NonNegative(0.4),
    /// Coefficient of friction in motion [1].
    sliding_friction: NonNegative = NonNegative(0.3),
}

impl Foam {
    /// The pad of the paper, as far as is known.
    pub const USUAL: Self = Self {
        stiffness: Positive(300.0),
        stiffens_from: Positive(0.0025),
        stiffening: NonNegative(9.6e7),
        thickness: Positive(0.008),
        damping: NonNegative(1.5),
        shear: Positive(200.0),
        spread: Positive(0.003),
        static_friction: NonNegative(0.4),
        sliding_friction: NonNegative(0.3),
    };
}

/// Area of the tactel that the numbers of [`Foam`] are for [m²].
pub(super) const AREA: f64 = 0.005 * 0.005;

/// The foam under a patch of some area.
#[derive(Debug, Clone, Copy)]
pub struct Column {
    /// [N/m]
    k: f64,
    /// [N/m³]
    k3: f64,
    from: f64,
    /// [N s/m]
    damping: f64,
}

impl Column {
    /// The foam under `area` [m²].
    #[must_use]
    pub fn new(foam: &Foam, area: f64) -> Self {
        let share = area / AREA;
        Self {
            k: *foam.stiffness * share,
            k3: *foam.stiffening * share,
            from: *foam.stiffens_from,
            damping: *foam.damping * share,
        }
    }

    /// What the foam bears when it is pressed in by `c` [m], and how fast that rises [N, N/m].
    fn load(&self, c: f64) -> (f64, f64) {
        let beyond = (c - self.from).max(0.0);
        (self.k * c + self.k3 * beyond * beyond * beyond, self.k + 3.0 * self.k3 * beyond * beyond)
    }

    /// The force at an indentation `depth` [m] that grows at `rate` [m/s], of an object that gives way by `softness`
    /// [m/N]. It never pulls.
    #[must_use]
    pub fn force(&self, depth: f64, rate: f64, softness: f64) -> f64 {
        let (elastic, _) = self.load(self.compression(depth, softness));
        (elastic + self.damping * rate).max(0.0)
    }

    /// What of an indentation the foam takes [m]. Newton's steps on a convex function from below fall onto its root
    /// from above after the first, so a few are exact.
    fn compression(&self, depth: f64, softness: f64) -> f64 {
        if softness == 0.0 {
            return depth;
        }
        let mut c = depth / (1.0 + self.k * softness);
        if c <= self.from {
            return c;
        }
        for _ in 0..6 {
            let (load, slope) = self.load(c);
            c -= (c + load * softness - depth) / (1.0 + slope * softness);
        }
        c
    }

    /// The energy that foam and object store at an indentation [J].
    #[cfg(test)]
    pub(super) fn energy(&self, depth: f64, softness: f64) -> f64 {
        let c = self.compression(depth, softness);
        let beyond = (c - self.from).max(0.0);
        let (load, _) = self.load(c);
        self.k * c * c / 2.0 + self.k3 * beyond * beyond * beyond * beyond / 4.0 + softness * load * load / 2.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_column_is_a_spring_that_stiffens() {
        let column = Column::new(&Foam::USUAL, 0.005 * 0.005);
        let cases = [(0.001, 0.3), (0.0025, 0.75), (0.005, 1.5 + 9.6e7 * 0.0025f64.powi(3))];
        for (depth, force) in cases {
            assert!((column.force(depth, 0.0, 0.0) - force).abs() < 1e-12, "{depth}");
        }
        assert!((column.force(0.001, 0.01, 0.0) - 0.315).abs() < 1e-12, "damped");
        assert_eq!(column.force(0.001, -1.0, 0.0), 0.0, "it never pulls");
        let quarter = Column::new(&Foam::USUAL, 0.0025 * 0.0025);
        assert!((quarter.force(0.004, 0.0, 0.0) * 4.0 - column.force(0.004, 0.0, 0.0)).abs() < 1e-12);
    }

    #[test]
    fn an_object_in_series_takes_its_part() {
        let column = Column::new(&Foam::USUAL, 0.005 * 0.005);
        for stiffness in [50.0, 300.0, 1e4, 1e7] {
            for depth in [1e-4, 1e-3, 3e-3, 6e-3, 8e-3] {
                let force = column.force(depth, 0.0, 1.0 / stiffness);
                // Both springs bear the same.
                let foam = depth - force / stiffness;
                let load = 300.0 * foam + 9.6e7 * (foam - 0.0025f64).max(0.0).powi(3);
                assert!((load - force).abs() < 1e-9 * force.max(1.0), "{stiffness} {depth}: {load} {force}");
                // The force is the slope of the energy.
                let step = 1e-7;
                let slope = column.energy(depth + step, 1.0 / stiffness) - column.energy(depth - step, 1.0 / stiffness);
                assert!((slope / (2.0 * step) - force).abs() < 1e-5 * force.max(0.1), "{stiffness} {depth}");
            }
        }
    }
}
