//! A ceiling, and the room to brake that it leaves.

use tactflow_runtime::node::Mistake;
use tactflow_runtime::signal::Unit;

use crate::motion::braking::stopping_speed;

/// A ceiling of a load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ceiling {
    /// The largest load [unit of the image].
    pub load: f64,
    /// How much the load grows on the way into the object [unit of the image per m].
    pub stiffness: f64,
    /// Deceleration with which the approach brakes [m/s²].
    pub deceleration: f64,
    /// The largest approach at any load [m/s].
    pub approach: f64,
}

impl Ceiling {
    /// Returns the largest speed toward the object at this load [m/s]: the approach keeps it for `delay` [s], brakes,
    /// and is at rest when the load has reached the ceiling.
    ///
    /// It is the v of k (v τ + v²/(2a)) = ceiling - load, and at most `approach`. It is 0 for a load that is not a
    /// number.
    ///
    /// ```
    /// use tactflow_nodes::limits::contact_limit::Ceiling;
    ///
    /// let ceiling = Ceiling { load: 15.0, stiffness: 1000.0, deceleration: 2.0, approach: f64::INFINITY };
    /// // At 0.1 m/s the pad moves 12.5 mm before it brakes and 2.5 mm while it brakes: 15 N on a spring of 1 N/mm.
    /// assert!((ceiling.allowed_speed(0.0, 0.125) - 0.1).abs() < 1e-12);
    /// ```
    #[must_use]
    pub fn allowed_speed(&self, load: f64, delay: f64) -> f64 {
        stopping_speed((self.load - load) / self.stiffness, self.deceleration, delay).min(self.approach)
    }

    /// Returns the same ceiling with a spring in series, of this compliance [m per unit of the image].
    #[must_use]
    pub(in crate::limits) fn in_series(self, compliance: f64) -> Self {
        Self { stiffness: (self.stiffness.recip() + compliance).recip(), ..self }
    }

    /// Returns the mistake of an approach that cannot stop below this ceiling, which is the parameter `name` in `unit`.
    pub(super) fn refuse(&self, name: &str, unit: Unit, delay: f64) -> Option<Mistake> {
        let largest = Self { approach: f64::INFINITY, ..*self }.allowed_speed(0.0, delay);
        // Rounded down, so that it holds when it is pasted.
        let holds = (largest * 1e5).floor() / 1e5;
        let message = format!(
            "an approach at {} m/s cannot stop below `{name} = {}`: it goes on for {:.1} ms before it brakes, and the \
             load grows by {:.0} {unit} per mm",
            self.approach,
            self.load,
            delay * 1e3,
            self.stiffness * 1e-3,
        );
        let help =
            format!("write at most `approach_m_per_s = {holds}`, or leave it out: the largest speed is then found");
        let mistake = Mistake::param("approach_m_per_s", message).help(help);
        (self.approach > largest).then_some(mistake)
    }
}
