//! The arm: joints in impedance control, as the KUKA LWR of the paper (stiffness 200, damping 0.2).
//!
//! Each joint is an inertia with a spring and a damper toward the equilibrium posture, which moves at the commanded
//! velocity:
//!
//! ```text
//! (I + m L^T L) q'' = K (q_eq - q) - 2 zeta sqrt(K I) q' - friction + J^T w
//! ```
//!
//! with J the spatial Jacobian and w the wrench on the pad about the origin of the base. Damping is a ratio. Friction
//! is a bristle that slips at the friction torque. L is the Jacobian of the origin of the sensor: a mass m there couples
//! the joints. The controller compensates gravity, up to a mass that it does not know. Not simulated: coupling by the
//! masses of the links, Coriolis forces, elasticity of the gears and delay of the bus.

use nalgebra::{Matrix3, Vector3, Vector6};
use parry3d_f64::math::Vec3;
use tactflow_runtime::signal::{Pose, Twist};

use super::contact::BodyMotion;
use super::shape::pose3;
use super::wrench::Wrench;
use crate::arm::chain::Chain;
use crate::motion::weight::GRAVITY;

/// Dynamic properties of a joint.
#[derive(Debug, Clone, Copy)]
pub struct JointDynamics {
    /// Stiffness [N m/rad].
    pub stiffness: f64,
    /// Damping as a fraction of the critical one [1].
    pub damping_ratio: f64,
    /// Inertia [kg m²].
    pub inertia: f64,
    /// Torque of dry friction [N m].
    pub friction: f64,
}

/// The simulated arm: joints with their state.
pub struct SimArm {
    chain: Chain,
    joints: Vec<JointDynamics>,
    columns: Vec<Twist>,
    pub(super) position: Vec<f64>,
    pub(super) equilibrium: Vec<f64>,
    speed: Vec<f64>,
    /// Strain of the friction bristle of each joint [rad].
    strain: Vec<f64>,
    load: ArmLoad,
    /// Acceleration of each joint [rad/s²].
    acceleration: Vec<f64>,
    /// Pose of the sensor in the base.
    pub(super) pose: Pose,
}

/// What an arm carries beside its links, at the origin of the sensor.
#[derive(Debug, Clone, Copy)]
pub struct ArmLoad {
    /// Mass that couples the joints [kg].
    pub mass: f64,
    /// Mass whose weight the controller does not compensate [kg].
    pub uncompensated: f64,
    /// Direction of the weight, in the base.
    pub down: Vec3,
}

impl Default for ArmLoad {
    fn default() -> Self {
        Self { mass: 0.0, uncompensated: 0.0, down: -Vec3::Z }
    }
}

/// Strain at which friction slips [rad].
pub(super) const MAX_STRAIN: f64 = 2e-4;

impl SimArm {
    /// Returns an arm at rest at the joint positions `start` [rad].
    #[must_use]
    pub fn new(chain: Chain, joints: Vec<JointDynamics>, start: Vec<f64>) -> Self {
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
            acceleration: zeros.clone(),
            strain: zeros,
            load: ArmLoad::default(),
            pose,
        }
    }

    /// Returns the same arm with a load. It begins at rest where it is: its springs bear the weight.
    #[must_use]
    pub fn with_load(mut self, load: ArmLoad) -> Self {
        self.load = load;
        if load.uncompensated != 0.0 {
            let weight = self.about_base(&self.weight());
            let sag = |(column, joint): (&Twist, &JointDynamics)| column.0.dot(&weight) / joint.stiffness;
            let sags = self.columns.iter().zip(&self.joints).map(sag);
            self.equilibrium.iter_mut().zip(sags).for_each(|(equilibrium, sag)| *equilibrium -= sag);
        }
        self
    }

    /// Returns the weight that the controller does not compensate.
    fn weight(&self) -> Wrench {
        Wrench { force: self.load.down * (GRAVITY * self.load.uncompensated), moment: Vec3::ZERO }
    }

    /// Returns a wrench about the origin of the sensor as one about the origin of the base.
    fn about_base(&self, wrench: &Wrench) -> Vector6<f64> {
        let place = Vec3::from(<[f64; 3]>::from(self.pose.0.translation.vector));
        let (force, moment) = (wrench.force, wrench.moment + place.cross(wrench.force));
        Vector6::new(force.x, force.y, force.z, moment.x, moment.y, moment.z)
    }

    /// Returns pose and velocity of the sensor in the base.
    #[must_use]
    pub fn motion(&self) -> BodyMotion {
        let twist: Vector6<f64> = self.columns.iter().zip(&self.speed).map(|(column, speed)| column.0 * *speed).sum();
        let pose = pose3(&self.pose);
        let angular = Vec3::new(twist[3], twist[4], twist[5]);
        // The twist is at the origin of the base, and the velocity is that of the origin of the sensor.
        let linear = Vec3::new(twist[0], twist[1], twist[2]) + angular.cross(pose.translation);
        BodyMotion { pose, linear, angular }
    }

    /// Advances by `dt` [s] with the equilibrium moving at `velocity` [rad/s], under a wrench about the origin of the
    /// sensor.
    pub fn step(&mut self, dt: f64, velocity: &[f64], wrench: &Wrench) {
        let mut about_base = self.about_base(wrench);
        if self.load.uncompensated != 0.0 {
            about_base += self.about_base(&self.weight());
        }
        for (i, joint) in self.joints.iter().enumerate() {
            self.equilibrium[i] += velocity[i] * dt;
            let contact = self.columns[i].0.dot(&about_base);
            let spring = joint.stiffness * (self.equilibrium[i] - self.position[i]);
            let damping = 2.0 * joint.damping_ratio * (joint.stiffness * joint.inertia).sqrt();
            self.strain[i] = (self.strain[i] + self.speed[i] * dt).clamp(-MAX_STRAIN, MAX_STRAIN);
            let friction = joint.friction * self.strain[i] / MAX_STRAIN;
            let torque = spring - damping * self.speed[i] - friction + contact;
            self.acceleration[i] = torque / joint.inertia;
        }
        if self.load.mass > 0.0 {
            self.couple();
        }
        for i in 0..self.joints.len() {
            // Semi-implicit Euler, speed before position: a spring gains no energy.
            self.speed[i] += self.acceleration[i] * dt;
            let limits = &self.chain.joints()[i];
            let next = self.position[i] + self.speed[i] * dt;
            self.position[i] = next.clamp(limits.lower, limits.upper);
            if next != self.position[i] {
                self.speed[i] = 0.0;
            }
        }
        self.pose = self.chain.forward(&self.position, &mut self.columns);
    }

    /// Turns the accelerations of uncoupled joints, a = I⁻¹ τ, into those with the mass m at the sensor, by the matrix
    /// inversion lemma: (I + m Lᵀ L)⁻¹ τ = a - I⁻¹ Lᵀ (1/m + L I⁻¹ Lᵀ)⁻¹ L a.
    fn couple(&mut self) {
        let place = self.pose.0.translation.vector;
        // The velocity of the origin of the sensor, by each joint.
        let linear = |column: &Twist| column.0.fixed_rows::<3>(0) + column.0.fixed_rows::<3>(3).cross(&place);
        let mut inverse = Matrix3::from_diagonal_element(1.0 / self.load.mass);
        let mut free = Vector3::zeros();
        for (i, column) in self.columns.iter().enumerate() {
            let l = linear(column);
            inverse += l * l.transpose() / self.joints[i].inertia;
            free += l * self.acceleration[i];
        }
        // It is positive definite: a positive diagonal and a sum of squares.
        let Some(force) = inverse.cholesky().map(|inverse| inverse.solve(&free)) else { return };
        for (i, column) in self.columns.iter().enumerate() {
            self.acceleration[i] -= linear(column).dot(&force) / self.joints[i].inertia;
        }
    }

    /// Returns the smallest joint velocities that move the sensor without rotation at `velocity` in the base [rad/s].
    #[cfg(test)]
    pub(super) fn moves(&self, velocity: nalgebra::Vector3<f64>) -> Vec<f64> {
        let columns: Vec<Vector6<f64>> = self.columns.iter().map(|column| column.0).collect();
        let jacobian = nalgebra::Matrix6xX::from_columns(&columns);
        let twist = Vector6::new(velocity.x, velocity.y, velocity.z, 0.0, 0.0, 0.0);
        let solved = (&jacobian * jacobian.transpose()).lu().solve(&twist).expect("no singular posture");
        (jacobian.transpose() * solved).as_slice().to_vec()
    }

    /// Returns the kinetic energy plus that of the springs [J].
    #[cfg(test)]
    pub(super) fn energy(&self) -> f64 {
        let energy = |i: usize| {
            let (joint, off) = (&self.joints[i], self.equilibrium[i] - self.position[i]);
            let friction = joint.friction / MAX_STRAIN * self.strain[i] * self.strain[i];
            (joint.inertia * self.speed[i] * self.speed[i] + joint.stiffness * off * off + friction) / 2.0
        };
        let speed = self.motion().linear.length_squared();
        (0..self.joints.len()).map(energy).sum::<f64>() + self.load.mass * speed / 2.0
    }
}
