//! The model of a simulated arm: its kinematics, and the springs and dampers of its joints.

use parry3d_f64::math::Vec3;
use tactflow_runtime::node::{At, FilePath, Mistake, Mistakes, Param};
use tactflow_runtime::signal::JointsShape;
use tactflow_runtime::source::Code;

use super::joints::{ArmLoad, JointDynamics, MAX_STRAIN, SimArm};
use super::steps::is_resolved;
use crate::arm::chain::Chain;
use crate::arm::model::load;
use crate::arm::mount::Mount;
use crate::devices::{Facts, arm};

/// Inertia of the joints of an LWR in a bent posture, with rotors [kg m²].
const INERTIA: [f64; 7] = [2.0, 2.0, 1.0, 0.8, 0.3, 0.25, 0.1];

/// The parameters of a simulated arm.
#[derive(Debug, Clone, Param)]
pub struct ArmModel {
    /// Model of the arm.
    pub urdf: FilePath,
    /// Link that carries the sensor.
    pub tip: String,
    /// All but its model.
    #[param(flatten)]
    pub body: ArmBody,
}

/// The parameters of a simulated arm beside its model.
#[derive(Debug, Clone, Param)]
pub struct ArmBody {
    /// Pose of the sensor on that link.
    #[param(default = Mount::NONE)]
    pub mount: Mount,
    /// Posture that an arm prefers, stated as a fact; in m for a prismatic joint.
    #[param(unit = "rad")]
    pub home: Option<Vec<f64>>,
    /// Joint positions at the start, one per joint; `home` if not given.
    #[param(unit = "rad")]
    pub start: Option<Vec<f64>>,
    /// Stiffness of the joints.
    #[param(unit = "N m/rad", above = 0.0, default = 200.0)]
    pub stiffness: f64,
    /// Damping of the joints as a fraction of the critical one.
    #[param(unit = "1", range = 0.0.., default = 0.2)]
    pub damping_ratio: f64,
    /// Inertia of each joint; that of the seven joints of an LWR if not given.
    #[param(unit = "kg m2")]
    pub inertia: Option<Vec<f64>>,
    /// Dry friction of the joints.
    #[param(unit = "N m", range = 0.0.., default = 0.1)]
    pub friction: f64,
    /// Mass at the sensor that couples the joints, such as a heavy tool.
    #[param(unit = "kg", range = 0.0.., usual = ..=20.0, default = 0.0)]
    pub load: f64,
    /// Mass at the sensor whose weight the controller does not compensate; negative if it compensates too much. The weight
    /// acts along -z of the base, and of the cell in `sim_pair`.
    #[param(unit = "kg", usual = -5.0..=5.0, default = 0.0)]
    pub gravity_error: f64,
    /// Largest acceleration that an arm states for each joint.
    #[param(unit = "rad/s2", above = 0.0, default = 10.0)]
    pub acceleration: f64,
}

/// An arm whose files are read.
pub struct LoadedArm {
    chain: Chain,
    start: Vec<f64>,
    /// Its joints, with their limits.
    pub joints: JointsShape,
}

impl ArmModel {
    /// Reads the kinematics.
    ///
    /// # Errors
    /// If the model cannot be read, or if the arm cannot start where it should.
    pub fn load(&self) -> Result<LoadedArm, Mistakes> {
        let chain = load(&self.urdf, &self.tip, &self.body.mount)?;
        self.body.home.as_ref().map_or(Ok(()), |home| arm::check_posture("home", home, chain.joints()))?;
        let start = arm::start_of(self.body.start.as_deref(), self.body.home.as_deref())?;
        let joints = arm::joints(&chain, self.body.acceleration, &start)?;
        Ok(LoadedArm { chain, start, joints })
    }

    /// Returns the facts of the arm.
    ///
    /// # Errors
    /// If the path of the model cannot be stated.
    pub fn facts(&self, loaded: &LoadedArm) -> Result<Facts, Mistakes> {
        let mut facts = arm::facts(&self.urdf, &self.tip, Some(self.body.home.as_deref().unwrap_or(&loaded.start)))?;
        facts.push(("joint_n_m_per_rad".into(), self.body.stiffness.into()));
        facts.push(("joint_damping_ratio".into(), self.body.damping_ratio.into()));
        Ok(facts)
    }

    /// Returns the arm at rest in its first posture, with the direction of weights in its base.
    #[must_use]
    pub fn arm(&self, loaded: LoadedArm, down: Vec3) -> SimArm {
        let joint = |inertia: f64| JointDynamics {
            stiffness: self.body.stiffness,
            damping_ratio: self.body.damping_ratio,
            inertia,
            friction: self.body.friction,
        };
        let arm = SimArm::new(loaded.chain, self.inertia().iter().copied().map(joint).collect(), loaded.start);
        arm.with_load(ArmLoad { mass: self.body.load, uncompensated: self.body.gravity_error, down })
    }

    fn inertia(&self) -> &[f64] {
        self.body.inertia.as_deref().unwrap_or(&INERTIA)
    }

    /// Returns the mistakes in the inertia of an arm of so many joints.
    #[must_use]
    pub fn check_inertia(&self, joints: usize) -> Mistakes {
        let mut mistakes = Mistakes::new();
        if let Some(inertia) = &self.body.inertia {
            if inertia.len() != joints {
                let message = format!("`inertia` has {} entries, but the arm has {joints} joints", inertia.len());
                mistakes.push(Mistake::param("inertia", message));
            }
            if inertia.iter().any(|inertia| !(0.01..=1e3).contains(inertia)) {
                mistakes.push(Mistake::param("inertia", "each inertia must be from 0.01 to 1000 kg m²"));
            }
        } else if joints != INERTIA.len() {
            let message = format!("an arm of {joints} joints needs `inertia`");
            mistakes.push(Mistake::new(Code::MissingKey, At::Node, message));
        }
        mistakes
    }

    /// Returns the mistakes in the springs and dampers of joints that steps of `dt` [s] do not resolve.
    #[must_use]
    pub fn check_motion(&self, dt: f64) -> Mistakes {
        let min_inertia = self.inertia().iter().copied().fold(f64::INFINITY, f64::min);
        let rate = self.body.stiffness / min_inertia;
        let parts = [
            ("stiffness", rate, 0.0),
            ("damping_ratio", 0.0, 2.0 * self.body.damping_ratio * rate.sqrt()),
            ("friction", self.body.friction / MAX_STRAIN / min_inertia, 0.0),
        ];
        let unresolved = parts.iter().filter(|(_, stiffness, damping)| !is_resolved(*stiffness, *damping, dt));
        let mistake = |name: &str| {
            let message = format!(
                "a joint of {min_inertia} kg m² moves too fast for a `step_s` of {dt} s: make `step_s` smaller"
            );
            Mistake::param(name, message)
        };
        unresolved.map(|(name, _, _)| mistake(name)).collect()
    }
}
