//! Dry friction as a bristle: it shears like a spring until its force reaches the friction limit, and then it slips.

use parry3d_f64::math::Vec2;

/// The shear of a bristle [m].
#[derive(Debug, Clone, Copy, Default)]
pub struct BristleShear(Vec2);

impl BristleShear {
    /// Shears the bristle by a `velocity` [m/s] for `dt` [s], and returns its force against the motion [N].
    ///
    /// The bristle is a spring [N/m] and a damper [N s/m]. Neither the spring alone nor both together exceed
    /// `max_force` [N].
    pub fn rub(&mut self, dt: f64, velocity: Vec2, [stiffness, damping]: [f64; 2], max_force: f64) -> Vec2 {
        self.0 += velocity * dt;
        let force = stiffness * self.0.length();
        if force > max_force {
            self.0 *= max_force / force;
        }
        let spring = self.0 * -stiffness;
        if damping == 0.0 {
            return spring;
        }
        (spring - velocity * damping).clamp_length_max(max_force)
    }

    /// Returns the energy that the bristle stores [J], with its stiffness [N/m].
    #[cfg(test)]
    pub(super) fn energy(self, stiffness: f64) -> f64 {
        stiffness / 2.0 * self.0.length_squared()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_sticks_like_a_spring_and_slips_at_the_limit() {
        let mut shear = BristleShear::default();
        let velocity = Vec2::new(0.6, -0.8);
        for step in 1..=100 {
            let force = shear.rub(1e-5, velocity, [1000.0, 2.0], 2.5);
            let wanted = (1000.0 * 1e-5 * f64::from(step) + 2.0).min(2.5);
            assert!((force + velocity * wanted).length() < 1e-12, "{step}: {force}");
        }
        // Without a limit nothing is held: the bristle is straight again.
        assert_eq!(shear.rub(1e-5, velocity, [1000.0, 2.0], 0.0).length(), 0.0);
        assert_eq!(shear.energy(1000.0), 0.0);
    }
}
