//! The material of the foam, and the force law of one column of it.
//!
//! The foam is an elastic foundation: independent columns side by side on a rigid plate. A column compressed by c bears
//! p(c) = k c, plus k3 (c - c0)³ above c0. A compliant object is a spring in series: of an indentation d the column
//! takes c with d = c + p(c) / k_object.

use tactflow_runtime::node::Param;

/// Properties of the foam. The defaults are those of the pad of the paper, as far as its properties are known.
#[derive(Debug, Clone, Param)]
#[param(default)]
pub struct Foam {
    /// Stiffness of the foam under a tactel of 5 mm by 5 mm; it scales with the area of a tactel.
    #[param(unit = "N/m", above = 0.0, default = 300.0)]
    pub(crate) stiffness: f64,
    /// Compression above which the foam stiffens.
    #[param(unit = "m", above = 0.0, default = 0.0025)]
    pub(crate) stiffens_from: f64,
    /// Cubic part of the stiffness under a tactel of 5 mm by 5 mm.
    #[param(unit = "N/m3", range = 0.0.., default = 9.6e7)]
    pub(crate) stiffening: f64,
    /// Thickness of the foam; behind it is the rigid plate.
    #[param(unit = "m", above = 0.0, default = 0.008)]
    pub(crate) thickness: f64,
    /// Damping of the foam under a tactel of 5 mm by 5 mm.
    #[param(unit = "N s/m", range = 0.0.., default = 1.5)]
    pub(crate) damping: f64,
    /// Shear stiffness of the foam under a tactel of 5 mm by 5 mm.
    #[param(unit = "N/m", above = 0.0, default = 200.0)]
    pub(crate) shear: f64,
    /// Standard deviation of the Gaussian with which the foam spreads a load.
    #[param(unit = "m", above = 0.0, default = 0.003)]
    pub(crate) spread: f64,
    /// Coefficient of static friction.
    #[param(unit = "1", range = 0.0.., default = 0.4)]
    pub(crate) static_friction: f64,
    /// Coefficient of sliding friction.
    #[param(unit = "1", range = 0.0.., default = 0.3)]
    pub(crate) sliding_friction: f64,
}

impl Foam {
    /// Returns the stiffness under a light load, of an area of 1 m² [N/m³].
    #[must_use]
    pub(super) fn per_area(&self) -> f64 {
        self.stiffness / REFERENCE_AREA
    }

    /// Returns the slope of the force under a tactel of 5 mm by 5 mm at a compression of `c` [m], in N/m.
    #[must_use]
    pub(super) fn slope(&self, c: f64) -> f64 {
        FoamColumn::new(self, REFERENCE_AREA).load(c).1
    }
}

/// Area of the tactel that the values of [`Foam`] refer to [m²].
pub(super) const REFERENCE_AREA: f64 = 0.005 * 0.005;

/// A column of foam under a patch of the pad.
#[derive(Debug, Clone, Copy)]
pub struct FoamColumn {
    /// [N/m]
    k: f64,
    /// [N/m³]
    k3: f64,
    from: f64,
    /// [N s/m]
    damping: f64,
}

impl FoamColumn {
    /// Returns the column under an `area` [m²].
    #[must_use]
    pub fn new(foam: &Foam, area: f64) -> Self {
        let scale = area / REFERENCE_AREA;
        Self {
            k: foam.stiffness * scale,
            k3: foam.stiffening * scale,
            from: foam.stiffens_from,
            damping: foam.damping * scale,
        }
    }

    /// Returns the force at a compression of `c` [m], and its slope [N, N/m].
    fn load(&self, c: f64) -> (f64, f64) {
        let beyond = (c - self.from).max(0.0);
        (self.k * c + self.k3 * beyond * beyond * beyond, self.k + 3.0 * self.k3 * beyond * beyond)
    }

    /// Returns the force [N] at an indentation `depth` [m] that grows at `rate` [m/s], for an object of compliance
    /// `softness` [m/N]. It is never negative: the foam does not pull.
    #[must_use]
    pub fn force(&self, depth: f64, rate: f64, softness: f64) -> f64 {
        let (elastic, _) = self.load(self.compression(depth, softness));
        (elastic + self.damping * rate).max(0.0)
    }

    /// Returns the compression of the foam at an indentation `depth` [m].
    ///
    /// The function is convex and the first guess is below its root, so Newton's method converges from above after one
    /// step, and six steps are exact.
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

    /// Returns the energy that foam and object store at an indentation [J].
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
    fn a_column_is_a_stiffening_spring() {
        let column = FoamColumn::new(&Foam::default(), 0.005 * 0.005);
        let cases = [(0.001, 0.3), (0.0025, 0.75), (0.005, 1.5 + 9.6e7 * 0.0025f64.powi(3))];
        for (depth, force) in cases {
            assert!((column.force(depth, 0.0, 0.0) - force).abs() < 1e-12, "{depth}");
        }
        assert!((column.force(0.001, 0.01, 0.0) - 0.315).abs() < 1e-12, "damped");
        assert_eq!(column.force(0.001, -1.0, 0.0), 0.0, "the foam does not pull");
        let quarter = FoamColumn::new(&Foam::default(), 0.0025 * 0.0025);
        assert!((quarter.force(0.004, 0.0, 0.0) * 4.0 - column.force(0.004, 0.0, 0.0)).abs() < 1e-12);
    }

    #[test]
    fn a_compliant_object_is_a_spring_in_series() {
        let column = FoamColumn::new(&Foam::default(), 0.005 * 0.005);
        for stiffness in [50.0, 300.0, 1e4, 1e7] {
            for depth in [1e-4, 1e-3, 3e-3, 6e-3, 8e-3] {
                let force = column.force(depth, 0.0, 1.0 / stiffness);
                // Both springs bear the same force.
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
