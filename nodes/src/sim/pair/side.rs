//! One of the two arms: the parameters that are its own, and those that both arms share.

use nalgebra::IsometryMatrix3;
use tactflow_runtime::node::{At, FilePath, Mistake, Mistakes, Param};
use tactflow_runtime::source::Code;

use super::Params;
use crate::arm::mount::Mount;
use crate::motion::pose::pose_of;
use crate::sim::arm_model::{ArmBody, ArmModel};
use crate::usual::{USUAL_RAD, USUAL_REACH_M};

/// Parameters of one arm. A parameter that is not given is that of the device, which both arms share.
#[derive(Debug, Clone, Param)]
pub struct SideParams {
    /// Where the base of the arm is in the cell.
    pub(super) base: BasePose,
    /// Model of this arm.
    urdf: Option<FilePath>,
    /// Link that carries the sensor.
    tip: Option<String>,
    /// Pose of the sensor on that link.
    mount: Option<Mount>,
    /// Posture that this arm prefers, stated as a fact; in m for a prismatic joint.
    #[param(unit = "rad")]
    home: Option<Vec<f64>>,
    /// Joint positions at the start, one per joint.
    #[param(unit = "rad")]
    start: Option<Vec<f64>>,
    /// Stiffness of the joints.
    #[param(unit = "N m/rad", above = 0.0)]
    stiffness: Option<f64>,
    /// Damping of the joints as a fraction of the critical one.
    #[param(unit = "1", range = 0.0..)]
    damping_ratio: Option<f64>,
    /// Inertia of each joint.
    #[param(unit = "kg m2")]
    inertia: Option<Vec<f64>>,
    /// Dry friction of the joints.
    #[param(unit = "N m", range = 0.0..)]
    friction: Option<f64>,
    /// Largest acceleration that the arm states for each joint.
    #[param(unit = "rad/s2", above = 0.0)]
    acceleration: Option<f64>,
}

/// Pose of the base of an arm in the cell, whose z is up.
#[derive(Debug, Clone, Param)]
pub struct BasePose {
    /// Origin of the base in the cell.
    #[param(unit = "m", usual = -USUAL_REACH_M..=USUAL_REACH_M)]
    xyz: [f64; 3],
    /// Roll, pitch and yaw of the base in the cell: Rz(yaw) Ry(pitch) Rx(roll), as in a URDF.
    #[param(unit = "rad", usual = -USUAL_RAD..=USUAL_RAD, default = [0.0; 3])]
    rpy: [f64; 3],
}

impl BasePose {
    /// Returns the pose.
    pub(super) fn pose(&self) -> IsometryMatrix3<f64> {
        pose_of(self.xyz, self.rpy)
    }
}

impl SideParams {
    /// Returns the model of the arm that the key `name` of a device describes.
    ///
    /// # Errors
    /// If neither the arm nor the device names a model or a tip.
    pub(super) fn model(&self, name: &str, shared: &Params) -> Result<ArmModel, Mistakes> {
        let missing = |key: &str| -> Mistakes {
            let mistake = Mistake::new(Code::MissingKey, At::Node, format!("the {name} arm has no `{key}`"));
            let help = format!("name a `robot`, or write `{key}` in the device or in `{name}`");
            mistake.help(help).into()
        };
        Ok(ArmModel {
            urdf: self.urdf.as_ref().or(shared.urdf.as_ref()).cloned().ok_or_else(|| missing("urdf"))?,
            tip: self.tip.as_ref().or(shared.tip.as_ref()).cloned().ok_or_else(|| missing("tip"))?,
            body: ArmBody {
                mount: self.mount.as_ref().unwrap_or(&shared.arm.mount).clone(),
                home: self.home.as_ref().or(shared.arm.home.as_ref()).cloned(),
                start: self.start.as_ref().or(shared.arm.start.as_ref()).cloned(),
                stiffness: self.stiffness.unwrap_or(shared.arm.stiffness),
                damping_ratio: self.damping_ratio.unwrap_or(shared.arm.damping_ratio),
                inertia: self.inertia.as_ref().or(shared.arm.inertia.as_ref()).cloned(),
                friction: self.friction.unwrap_or(shared.arm.friction),
                load: shared.arm.load,
                gravity_error: shared.arm.gravity_error,
                acceleration: self.acceleration.unwrap_or(shared.arm.acceleration),
            },
        })
    }

    /// Marks mistakes in parameters of the arm where they are written: in its own table, if it has them.
    pub(super) fn place(&self, name: &str, mut mistakes: Mistakes) -> Mistakes {
        for mistake in &mut mistakes {
            mistake.message = format!("{name} arm: {}", mistake.message);
            let (At::Param(path) | At::Key(path)) = &mut mistake.at else { continue };
            if self.has(path) {
                *path = format!("{name}.{path}");
            }
        }
        mistakes
    }

    /// Returns whether the arm itself gives a parameter.
    fn has(&self, name: &str) -> bool {
        self.written().is_some_and(|own| own.get(name).is_some())
    }
}
