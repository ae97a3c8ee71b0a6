//! The travel of a sensor along its own z, measured or commanded.

use nalgebra::Vector3;
use tactflow_runtime::node::State;
use tactflow_runtime::signal::{Jacobian, Joints, Pose};

use crate::motion::normal::along_z;

/// Measures the steps of a sensor along its z, and delays them.
#[derive(State)]
pub(super) struct Travel {
    /// Position of the sensor in the base at the last sample [m].
    position: Option<Vector3<f64>>,
    /// Equilibrium at the last sample.
    equilibrium: Vec<f64>,
    /// Whether that equilibrium is known.
    is_known: bool,
    /// How far the spring of the arm gave way at the last sample [m], if that is known.
    deflection: Option<f64>,
    /// The way that is not yet passed on [m]; `None` before the first step.
    behind: Option<f64>,
}

impl Travel {
    /// Nothing is known yet of an arm with so many joints.
    pub(super) fn new(joints: usize) -> Self {
        Self { position: None, equilibrium: vec![0.0; joints], is_known: false, deflection: None, behind: None }
    }

    /// Returns the measured step since the last sample [m]; `None` for the first one.
    pub(super) fn measured(&mut self, pose: &Pose) -> Option<f64> {
        let position = pose.0.translation.vector;
        let last = self.position.replace(position)?;
        Some(pose.0.rotation.inverse_transform_vector(&(position - last)).z)
    }

    /// Returns the commanded step since the last sample [m]; `None` for the first one.
    pub(super) fn commanded(&mut self, pose: &Pose, jacobian: &Jacobian, equilibrium: &Joints) -> Option<f64> {
        let moved = equilibrium.0.iter().zip(&self.equilibrium).map(|(now, last)| now - last);
        let step = along_z(pose, jacobian).zip(moved).map(|(part, moved)| part * moved).sum();
        self.equilibrium.copy_from_slice(&equilibrium.0);
        std::mem::replace(&mut self.is_known, true).then_some(step)
    }

    /// Returns the step since the last sample that an arm at rest would have made [m], of which `measured` is that of the
    /// sensor, while its spring gives way by `deflection` [m]; `None` for the first one.
    pub(super) fn at_rest(&mut self, measured: Option<f64>, deflection: Option<f64>) -> Option<f64> {
        let last = std::mem::replace(&mut self.deflection, deflection)?;
        measured.zip(deflection).map(|(measured, deflection)| measured + deflection - last)
    }

    /// Forgets the last sample.
    pub(super) fn forget(&mut self) {
        self.is_known = false;
    }

    /// Returns the step of a travel that follows the true one as a low-pass filter with the time constant `lag` [s].
    ///
    /// The sensor meets an object while it moves: before the first step, it has moved as in this step.
    pub(super) fn lagging(&mut self, step: f64, dt: f64, lag: f64) -> f64 {
        let share = if lag > 0.0 { -libm::expm1(-dt / lag) } else { 1.0 };
        // No time has passed: what came before is not known yet.
        let Some(before) = self.behind.or((share > 0.0).then(|| step * (1.0 - share) / share)) else { return 0.0 };
        let behind = step + before;
        let passed = share * behind;
        self.behind = Some(behind - passed);
        passed
    }

    /// Discards the way that is not yet passed on.
    pub(super) const fn drop_lag(&mut self) {
        self.behind = None;
    }
}
