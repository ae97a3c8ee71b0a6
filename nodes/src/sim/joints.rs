//! The arm: joints in impedance mode, as the paper's KUKA LWR (stiffness 200, damping 0.2).
//!
//! Each joint is an inertia on a spring and a damper toward the equilibrium posture, which the commanded velocity moves:
//!
//! ```text
//! I q'' = K (q_eq - q) - 2 zeta sqrt(K I) q' - friction + J^T w
//! ```
//!
//! with J the spatial Jacobian and w the wrench on the pad about the base's origin. Damping is a ratio. Friction is a
//! bristle that gives way at the friction's torque. Left out: gravity (the controller takes it up), the coupling of the
//! joints' inertias, Coriolis forces, the elasticity of the gears and the delay of the bus.

use nalgebra::Vector6;
use parry3d_f64::math::{Pose3, Rot3, Vec3};
use tactflow_runtime::signal::{Pose, Twist};

use super::contact::{Motion, Wrench};
use crate::arm::chain::Chain;

/// What a joint is like.
#[derive(Debug, Clone, Copy)]
pub struct Joint {
    /// [N m/rad]
    pub stiffness: f64,
    /// Of critical damping.
    pub damping_ratio: f64,
    /// [kg m²]
    pub inertia: f64,
    /// [N m]
    pub friction: f64,
}

/// The arm's joints and where they are.
pub struct Arm {
    chain: Chain,
    joints: Vec<Joint>,
    columns: Vec<Twist>,
    pub(super) position: Vec<f64>,
    pub(super) equilibrium: Vec<f64>,
    speed: Vec<f64>,
    /// How far each joint's friction is strained [rad].
    strain: Vec<f64>,
    /// Pose of the sensor in the base.
    pub(super) pose: Pose,
}

/// How far friction is strained before it gives way [rad].
pub(super) const GIVES_WAY: f64 = 2e-4;

impl Arm {
    /// An arm at rest.
    #[must_use]
    pub fn new(chain: Chain, joints: Vec<Joint>, start: Vec<f64>) -> Self {
        let mut columns = vec![Twist::default(); start.len()];
        let pose = chain.forward(&start, &mut columns);
        let zeros = vec![0.0; start.len()];
        Self {
            chain,
            joints,
            columns,
            position: start.clone(),
            equilibrium: start,
            speed: zeros.clone(),
            strain: zeros,
            pose,
        }
    }

    /// Where the sensor is and how it moves.
    #[must_use]
    pub fn motion(&self) -> Motion {
        let twist: Vector6<f64> = self.columns.iter().zip(&self.speed).map(|(column, speed)| column.0 * *speed).sum();
        let pose = pose3(&self.pose);
        let angular = Vec3::new(twist[3], twist[4], twist[5]);
        // From the twist at the base's origin to the velocity of the sensor's.
        let linear = Vec3::new(twist[0], twist[1], twist[2]) + angular.cross(pose.translation);
        Motion { pose, linear, angular }
    }

    /// Goes on by `dt` [s] with the equilibrium moving at `velocity` [rad/s], under a wrench about the sensor's origin.
    pub fn step(&mut self, dt: f64, velocity: &[f64], wrench: &Wrench) {
        let place = Vec3::from(<[f64; 3]>::from(self.pose.0.translation.vector));
        let moment = wrench.moment + place.cross(wrench.force);
        let force = wrench.force;
        let about_base = Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z);
        for (i, joint) in self.joints.iter().enumerate() {
            self.equilibrium[i] += velocity[i] * dt;
            let contact = self.columns[i].0.dot(&about_base);
            let spring = joint.stiffness * (self.equilibrium[i] - self.position[i]);
            let damping = 2.0 * joint.damping_ratio * (joint.stiffness * joint.inertia).sqrt();
            self.strain[i] = (self.strain[i] + self.speed[i] * dt).clamp(-GIVES_WAY, GIVES_WAY);
            let friction = joint.friction * self.strain[i] / GIVES_WAY;
            let torque = spring - damping * self.speed[i] - friction + contact;
            // Speed first, then place: what is at rest stays at rest, and a spring gains no energy.
            self.speed[i] += torque / joint.inertia * dt;
            let limits = &self.chain.joints()[i];
            let next = self.position[i] + self.speed[i] * dt;
            self.position[i] = next.clamp(limits.lower, limits.upper);
            if next != self.position[i] {
                self.speed[i] = 0.0;
            }
        }
        self.pose = self.chain.forward(&self.position, &mut self.columns);
    }

    /// The least joint velocities that move the sensor along a straight line in the base [rad/s].
    #[cfg(test)]
    pub(super) fn moves(&self, velocity: nalgebra::Vector3<f64>) -> Vec<f64> {
        let columns: Vec<Vector6<f64>> = self.columns.iter().map(|column| column.0).collect();
        let jacobian = nalgebra::Matrix6xX::from_columns(&columns);
        let twist = Vector6::new(velocity.x, velocity.y, velocity.z, 0.0, 0.0, 0.0);
        let solved = (&jacobian * jacobian.transpose()).lu().solve(&twist).expect("no singular posture");
        (jacobian.transpose() * solved).as_slice().to_vec()
    }

    /// The energy of motion and springs [J].
    #[cfg(test)]
    pub(super) fn energy(&self) -> f64 {
        let energy = |i: usize| {
            let (joint, off) = (&self.joints[i], self.equilibrium[i] - self.position[i]);
            let friction = joint.friction / GIVES_WAY * self.strain[i] * self.strain[i];
            (joint.inertia * self.speed[i] * self.speed[i] + joint.stiffness * off * off + friction) / 2.0
        };
        (0..self.joints.len()).map(energy).sum()
    }
}

/// A pose of the runtime as one of the geometry.
#[must_use]
pub fn pose3(pose: &Pose) -> Pose3 {
    let quaternion = nalgebra::UnitQuaternion::from_rotation_matrix(&pose.0.rotation);
    let rotation = Rot3::from_xyzw(quaternion.i, quaternion.j, quaternion.k, quaternion.w);
    Pose3::from_parts(Vec3::from(<[f64; 3]>::from(pose.0.translation.vector)), rotation)
}
