//! The mass and the centre of mass of a tool, from wrenches in several still postures.
//!
//! In posture i, d_i is the direction down in the axes of the tip. The sensor measures f_i = m g d_i + f0 and
//! t_i = c x m g d_i + t0, with its constant offset f0, t0. This is linear in m, k = m c, f0 and t0. Without the means
//! over all postures, marked by ~, the offsets drop out, and the normal equations are small:
//!
//! m = Σ d~_i . f~_i / (g Σ |d~_i|²),  g Σ (|d~_i|² I - d~_i d~_i') k = Σ d~_i x t~_i,
//!
//! because t~_i = g k x d~_i. The matrix is regular if the d~_i do not lie on one line, so the smallest spread that counts
//! is the second largest eigenvalue of Σ d~_i d~_i' / n.

use nalgebra::{Matrix3, Rotation3, SymmetricEigen, Vector3};

use crate::motion::weight::{GRAVITY, down};

/// Minimum number of postures.
pub const MIN_POSTURES: usize = 4;
/// Minimum spread of the direction down in the tool, across the direction in which it varies most [1].
pub const MIN_SPREAD: f64 = 0.2;
/// Standard deviations from which on a mass differs from zero.
const SIGNIFICANT_DEVIATIONS: f64 = 3.0;

/// A still posture.
#[derive(Debug, Clone, Copy)]
pub struct WeightPosture {
    /// Rotation of the tip in the base.
    pub tip: Rotation3<f64>,
    /// Wrench of the sensor in the frame of the tip, with the whole weight of the tool [N, N m].
    pub wrench: [f64; 6],
}

/// The weight of a tool and how well it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WeightFit {
    /// Mass [kg].
    pub mass: f64,
    /// Standard deviation of the mass [kg].
    pub mass_deviation: f64,
    /// Centre of mass in the frame of the tip [m].
    pub centre: Vector3<f64>,
    /// Standard deviation of each coordinate of the centre [m].
    pub centre_deviation: Vector3<f64>,
    /// Constant offset of the sensor [N, N m].
    pub offset: [f64; 6],
    /// Root mean square of the residual of the force [N].
    pub force_residual: f64,
    /// Root mean square of the residual of the torque [N m].
    pub torque_residual: f64,
}

impl WeightFit {
    /// Whether the mass differs from zero by more than the noise.
    #[must_use]
    pub fn is_significant(&self) -> bool {
        self.mass.abs() > SIGNIFICANT_DEVIATIONS * self.mass_deviation
    }
}

/// Why the postures do not determine a weight.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum WeightUnfit {
    /// There are fewer than [`MIN_POSTURES`].
    Few,
    /// The same sides of the tool are down in all of them: the spread is less than [`MIN_SPREAD`].
    Alike {
        /// The spread.
        spread: f64,
    },
}

/// Returns the weight that fits the postures best.
///
/// # Errors
/// If the postures are too few or too alike.
pub fn fit(postures: &[WeightPosture]) -> Result<WeightFit, WeightUnfit> {
    if postures.len() < MIN_POSTURES {
        return Err(WeightUnfit::Few);
    }
    let count = postures.len() as f64;
    let rows: Vec<[Vector3<f64>; 3]> = postures.iter().map(row).collect();
    let means = [0, 1, 2].map(|column| rows.iter().map(|row| row[column]).sum::<Vector3<f64>>() / count);
    let centred: Vec<[Vector3<f64>; 3]> = rows.iter().map(|row| [0, 1, 2].map(|i| row[i] - means[i])).collect();
    let spread = second_spread(centred.iter().map(|[down, ..]| *down));
    if spread < MIN_SPREAD {
        return Err(WeightUnfit::Alike { spread });
    }
    let square: f64 = centred.iter().map(|[down, ..]| down.norm_squared()).sum();
    let mass = centred.iter().map(|[down, force, _]| down.dot(force)).sum::<f64>() / (GRAVITY * square);
    let across = |down: &Vector3<f64>| Matrix3::identity() * down.norm_squared() - down * down.transpose();
    let normal: Matrix3<f64> = centred.iter().map(|[down, ..]| across(down) * GRAVITY).sum();
    let inverse = normal.try_inverse().ok_or(WeightUnfit::Alike { spread })?;
    let moment: Vector3<f64> =
        inverse * centred.iter().map(|[down, _, torque]| down.cross(torque)).sum::<Vector3<f64>>();
    let squares = centred.iter().fold([0.0; 2], |[forces, torques], [down, force, torque]| {
        let (off_force, off_torque) = (force - down * (mass * GRAVITY), torque - moment.cross(down) * GRAVITY);
        [forces + off_force.norm_squared(), torques + off_torque.norm_squared()]
    });
    // Unknown are m and f0, k and t0.
    let [force_variance, torque_variance] = [squares[0] / (3.0 * count - 4.0), squares[1] / (3.0 * count - 6.0)];
    let mass_deviation = (force_variance / square).sqrt() / GRAVITY;
    let centre = moment / mass;
    let centre_deviation = Vector3::from_fn(|i, _| {
        let of_moment = torque_variance * inverse[(i, i)] / GRAVITY;
        (of_moment + (centre[i] * mass_deviation).powi(2)).sqrt() / mass.abs()
    });
    let (force, torque) = (means[1] - means[0] * (mass * GRAVITY), means[2] - moment.cross(&means[0]) * GRAVITY);
    Ok(WeightFit {
        mass,
        mass_deviation,
        centre,
        centre_deviation,
        offset: [force.x, force.y, force.z, torque.x, torque.y, torque.z],
        force_residual: (squares[0] / count).sqrt(),
        torque_residual: (squares[1] / count).sqrt(),
    })
}

/// Returns the direction down, the force and the torque of a posture.
fn row(posture: &WeightPosture) -> [Vector3<f64>; 3] {
    let [fx, fy, fz, tx, ty, tz] = posture.wrench;
    [down(&posture.tip), Vector3::new(fx, fy, fz), Vector3::new(tx, ty, tz)]
}

/// Returns the root mean square of vectors around zero along the direction of their second largest spread.
fn second_spread(vectors: impl ExactSizeIterator<Item = Vector3<f64>>) -> f64 {
    let count = vectors.len() as f64;
    let scatter: Matrix3<f64> = vectors.map(|vector| vector * vector.transpose() / count).sum();
    let mut spreads: [f64; 3] = SymmetricEigen::new(scatter).eigenvalues.into();
    spreads.sort_by(f64::total_cmp);
    spreads[1].max(0.0).sqrt()
}

/// The sides of a tool by the axes of its tip, in the order in which they are asked for.
const SIDES: [(&str, [f64; 3]); 6] = [
    ("+z", [0.0, 0.0, 1.0]),
    ("+x", [1.0, 0.0, 0.0]),
    ("+y", [0.0, 1.0, 0.0]),
    ("-x", [-1.0, 0.0, 0.0]),
    ("-y", [0.0, -1.0, 0.0]),
    ("-z", [0.0, 0.0, -1.0]),
];

/// Returns the side of the tool that is nearest to down in a posture, and the angle between the two [rad].
#[must_use]
pub fn side_down(tip: &Rotation3<f64>) -> (&'static str, f64) {
    let down = down(tip);
    let angles = SIDES.map(|(name, side)| (name, Vector3::from(side).angle(&down)));
    angles.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or(SIDES.map(|(name, _)| (name, 0.0))[0])
}

/// Returns the side of the tool to turn down next: the first one of those that are furthest from all that were down.
#[must_use]
pub fn next_side(postures: &[WeightPosture]) -> &'static str {
    // Sides at about the same distance are taken in their order.
    const ALIKE_RAD: f64 = 0.35;
    let nearest = |side: [f64; 3]| {
        let angles = postures.iter().map(|posture| Vector3::from(side).angle(&down(&posture.tip)));
        angles.fold(f64::INFINITY, f64::min)
    };
    let mut best = (SIDES[0].0, nearest(SIDES[0].1));
    for (name, side) in &SIDES[1..] {
        let distance = nearest(*side).min(std::f64::consts::FRAC_PI_2);
        if distance > best.1 + ALIKE_RAD {
            best = (name, distance);
        }
    }
    best.0
}

#[cfg(test)]
mod tests;
