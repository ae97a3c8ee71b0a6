//! What must hold before a real arm gets its first command.
//!
//! An arm that is commanded from another posture than the one its controller follows jumps, and an arm whose model is
//! wrong goes where no limit looks. Both show in a single sample of a still arm.

use nalgebra::IsometryMatrix3;
use tactflow_runtime::device::DeviceError;
use tactflow_runtime::node::Param;
use tactflow_runtime::signal::Twist;

use crate::arm::chain::Chain;
use crate::motion::pose::rotation_vector;
use crate::usual::{USUAL_LENGTH_M, USUAL_RAD};

/// Largest difference between the target of the driver and the posture that the controller commands [rad].
const MAX_TARGET_ERROR_RAD: f64 = 1e-3;

/// Bounds of the checks before the first command.
#[derive(Debug, Clone, Param)]
#[param(default)]
pub struct StartBounds {
    /// Maximum difference between the measured and the commanded position of a joint.
    #[param(unit = "rad", above = 0.0, usual = 0.0..=USUAL_RAD, default = 0.05)]
    pub deflection: f64,
    /// Maximum distance between the tip that the model computes and the one that the robot reports.
    #[param(unit = "m", above = 0.0, usual = 0.0..=USUAL_LENGTH_M, default = 0.002)]
    pub tip: f64,
    /// Maximum angle between the tip that the model computes and the one that the robot reports.
    #[param(unit = "rad", above = 0.0, usual = 0.0..=USUAL_RAD, default = 0.0175)]
    pub tip_angle: f64,
    /// Maximum difference between the position of a joint and `start` when a run begins.
    #[param(unit = "rad", above = 0.0, usual = 0.0..=USUAL_RAD, default = 0.1)]
    pub posture: f64,
}

/// What a controller reports of a still arm, and what the driver would command.
#[derive(Debug, Clone)]
pub(crate) struct StartReport<'r> {
    /// The measured posture [rad].
    pub(crate) measured: &'r [f64],
    /// The posture that the controller commands [rad].
    pub(crate) commanded: &'r [f64],
    /// The posture from which the driver integrates velocities [rad]; the commanded one if it does not integrate.
    pub(crate) target: &'r [f64],
    /// How far the measured posture was from the commanded one when the arm followed commands last, if it did before in
    /// this session of its controller [rad].
    pub(crate) held: Option<&'r [f64]>,
    /// The pose of the tip in the base that the robot reports for the measured posture, if it does [m].
    pub(crate) tip: Option<IsometryMatrix3<f64>>,
    /// Whether no command has moved the arm in this run.
    pub(crate) is_first: bool,
}

/// Compares what a controller reports with the model of its arm.
#[derive(Debug, Clone)]
pub(crate) struct StartCheck {
    chain: Chain,
    bounds: StartBounds,
    /// The posture from which runs begin, if the bench states one [rad].
    start: Option<Vec<f64>>,
}

impl StartCheck {
    /// `chain` ends at the tip whose pose the robot reports, and `start` has an entry for each of its joints.
    pub(crate) const fn new(chain: Chain, bounds: StartBounds, start: Option<Vec<f64>>) -> Self {
        Self { chain, bounds, start }
    }

    /// Checks a report. Call it before the first command, and again before the first command after the controller was
    /// not commanded for a while.
    ///
    /// # Errors
    /// The first difference that is too large, with both values and what to correct.
    pub(crate) fn check(&self, report: &StartReport<'_>) -> Result<(), DeviceError> {
        self.check_postures(report)?;
        if report.is_first {
            self.check_start(report.measured)?;
        }
        report.tip.as_ref().map_or(Ok(()), |tip| self.check_tip(report.measured, tip))
    }

    fn check_postures(&self, report: &StartReport<'_>) -> Result<(), DeviceError> {
        for (i, joint) in self.chain.joints().iter().enumerate() {
            let name = &joint.name;
            let [measured, commanded, target] = [report.measured, report.commanded, report.target].map(|q| q[i]);
            if ![measured, commanded, target].iter().all(|q| q.is_finite()) {
                return Err(DeviceError(format!("the controller reports no number as the position of joint `{name}`")));
            }
            if (target - commanded).abs() > MAX_TARGET_ERROR_RAD {
                let message = format!(
                    "the target of joint `{name}` is {target:.4} rad, but the controller commands {commanded:.4} rad: \
                     the first command would be a jump"
                );
                return Err(DeviceError(message));
            }
            let bound = self.bounds.deflection;
            let (deflection, held) = (measured - commanded, report.held.map_or(0.0, |held| held[i]));
            // An arm that is soft and presses is deflected, and stays so when it goes on.
            if deflection.abs() > bound && (deflection - held).abs() > bound {
                let message = format!(
                    "joint `{name}` is at {measured:.4} rad, but the controller commands {commanded:.4} rad: they differ \
                     by more than {bound} rad{}. Free the arm, check the load data of the tool, or raise \
                     `start_bounds.deflection`",
                    report.held.map_or_else(String::new, |_| format!(", and by {held:.4} rad when it moved last"))
                );
                return Err(DeviceError(message));
            }
        }
        Ok(())
    }

    fn check_start(&self, measured: &[f64]) -> Result<(), DeviceError> {
        let bound = self.bounds.posture;
        let joints = self.chain.joints().iter().zip(measured).zip(self.start.iter().flatten());
        let far = joints.into_iter().find(|((_, measured), start)| (*measured - *start).abs() > bound);
        far.map_or(Ok(()), |((joint, measured), start)| {
            Err(DeviceError(format!(
                "joint `{}` is at {measured:.4} rad, but `start` is {start:.4} rad: they differ by more than {bound} rad. \
                 Guide the arm there, raise `start_bounds.posture`, or leave out `start`",
                joint.name
            )))
        })
    }

    fn check_tip(&self, measured: &[f64], reported: &IsometryMatrix3<f64>) -> Result<(), DeviceError> {
        let computed = self.chain.forward(measured, &mut vec![Twist::default(); measured.len()]).0;
        let away = (computed.translation.vector - reported.translation.vector).norm();
        // From the sine and the cosine: a rotation in single precision can have a cosine above 1.
        let turned = rotation_vector(&(computed.rotation.inverse() * reported.rotation)).norm();
        let is_near = away <= self.bounds.tip && turned <= self.bounds.tip_angle;
        if is_near {
            return Ok(());
        }
        let [ours, theirs] = [&computed, reported].map(|pose| {
            let p = pose.translation.vector;
            format!("[{:.4}, {:.4}, {:.4}] m", p.x, p.y, p.z)
        });
        Err(DeviceError(format!(
            "the model puts the tip at {ours}, but the robot reports {theirs}: they are {:.1} mm and {:.1}° apart, and \
             the maximum is {:.1} mm and {:.1}°. Check `urdf`, `tip`, the order of the joints, and the tool that is set \
             on the controller",
            away * 1e3,
            turned.to_degrees(),
            self.bounds.tip * 1e3,
            self.bounds.tip_angle.to_degrees(),
        )))
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Rotation3, Translation3, Vector3};
    use tactflow_runtime::node::FilePath;

    use super::*;
    use crate::arm::model::load;
    use crate::arm::mount::Mount;

    const HOME: [f64; 6] = [0.0, -1.7, -2.0, -1.0124, 1.57, 0.0];

    fn check() -> StartCheck {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/robots/ur5e.urdf").into();
        let chain = load(&FilePath { path, span: 0..0, builtin: None }, "tool0", &Mount::NONE).unwrap();
        StartCheck::new(chain, StartBounds::default(), Some(HOME.to_vec()))
    }

    fn tip(check: &StartCheck) -> IsometryMatrix3<f64> {
        check.chain.forward(&HOME, &mut [Twist::default(); 6]).0
    }

    /// Checks the arm at home with one joint off in one posture: 0 measured, 1 commanded, 2 target.
    fn off(which: usize, by: f64) -> Result<(), DeviceError> {
        let mut postures = [HOME; 3];
        postures[which][2] += by;
        let [measured, commanded, target] = &postures;
        check().check(&StartReport { measured, commanded, target, held: None, tip: None, is_first: false })
    }

    #[test]
    fn a_target_that_is_not_commanded_and_a_deflected_joint_are_refused() {
        assert_eq!(off(2, 0.0), Ok(()));
        assert_eq!(off(2, 0.0009), Ok(()));
        let jump = off(2, 0.0011).unwrap_err().0;
        assert!(jump.starts_with("the target of joint `elbow_joint` is -1.9989 rad, but the controller"), "{jump}");
        assert_eq!(off(0, 0.049), Ok(()));
        let deflected = off(0, -0.051).unwrap_err().0;
        assert!(deflected.contains("joint `elbow_joint` is at -2.0510 rad"), "{deflected}");
        assert!(off(0, f64::NAN).is_err() && off(1, f64::INFINITY).is_err());
    }

    #[test]
    fn an_arm_that_pressed_when_it_halted_goes_on_with_the_same_deflection() {
        let check = check();
        let mut commanded = HOME;
        commanded[2] += 0.09;
        let deflected_by = |by: f64, held: f64| {
            let mut measured = commanded;
            measured[2] += by;
            let held = std::array::from_fn::<f64, 6, _>(|i| if i == 2 { held } else { 0.0 });
            let report = StartReport {
                measured: &measured,
                commanded: &commanded,
                target: &commanded,
                held: Some(&held),
                tip: None,
                is_first: false,
            };
            check.check(&report).map_err(|error| error.0)
        };
        assert_eq!(deflected_by(-0.09, -0.09), Ok(()));
        assert_eq!(deflected_by(-0.13, -0.09), Ok(()), "within the bound of what it was");
        assert_eq!(deflected_by(0.0, -0.09), Ok(()), "what it pressed on is gone");
        let more = deflected_by(-0.15, -0.09).unwrap_err();
        assert!(more.contains("differ by more than 0.05 rad, and by -0.0900 rad when it moved last. Free"), "{more}");
        assert!(deflected_by(0.06, -0.09).is_err() && deflected_by(-0.06, 0.0).is_err());
    }

    #[test]
    fn a_model_that_puts_the_tip_elsewhere_is_refused() {
        let check = check();
        let reports = |turn: f64, shift: f64| {
            let shift = Translation3::new(0.0, shift, 0.0);
            let turn = Rotation3::from_axis_angle(&Vector3::x_axis(), turn.to_radians());
            let at = tip(&check);
            let tip = IsometryMatrix3::from_parts(shift * at.translation, turn * at.rotation);
            check.check(&StartReport {
                measured: &HOME,
                commanded: &HOME,
                target: &HOME,
                held: None,
                tip: Some(tip),
                is_first: true,
            })
        };
        assert_eq!(reports(0.9, 0.0019), Ok(()));
        let away = reports(0.0, 0.0021).unwrap_err().0;
        assert!(away.contains("they are 2.1 mm and 0.0° apart, and the maximum is 2.0 mm and 1.0°"), "{away}");
        assert!(reports(1.1, 0.0).is_err());
        assert!(reports(0.0, f64::NAN).is_err());
    }

    #[test]
    fn a_run_begins_near_its_start_and_goes_on_anywhere() {
        let check = check();
        let at = |by: f64, is_first: bool| {
            let mut measured = HOME;
            measured[4] += by;
            let report = StartReport {
                measured: &measured,
                commanded: &measured,
                target: &measured,
                held: None,
                tip: None,
                is_first,
            };
            check.check(&report)
        };
        assert_eq!(at(0.099, true), Ok(()));
        assert_eq!(at(-0.101, false), Ok(()), "it has moved in this run");
        let far = at(-0.101, true).unwrap_err().0;
        let message =
            "joint `wrist_2_joint` is at 1.4690 rad, but `start` is 1.5700 rad: they differ by more than 0.1 rad";
        assert!(far.starts_with(message), "{far}");
        assert!(far.contains("Guide the arm there") && far.ends_with("or leave out `start`"), "{far}");
        let without = StartCheck { start: None, ..check.clone() };
        let report = StartReport {
            measured: &[0.0; 6],
            commanded: &[0.0; 6],
            target: &[0.0; 6],
            held: None,
            tip: None,
            is_first: true,
        };
        assert_eq!(without.check(&report), Ok(()));
    }

    /// A rotation whose numbers are rounded to single precision is not orthonormal in double precision.
    #[test]
    fn a_pose_in_single_precision_is_compared_too() {
        let check = check();
        for i in 0..1000 {
            let measured: [f64; 6] = std::array::from_fn(|joint| HOME[joint] + 1e-3 * f64::from(i));
            let mut tip = check.chain.forward(&measured, &mut [Twist::default(); 6]).0;
            let rounded = tip.rotation.matrix().map(|entry| f64::from(entry as f32));
            tip.rotation = Rotation3::from_matrix_unchecked(rounded);
            let tip = Some(tip);
            let report = StartReport {
                measured: &measured,
                commanded: &measured,
                target: &measured,
                held: None,
                tip,
                is_first: false,
            };
            assert_eq!(check.check(&report), Ok(()), "{i}");
        }
    }

    #[test]
    fn two_joints_in_the_wrong_order_are_refused() {
        let check = check();
        let mut swapped = HOME;
        swapped.swap(0, 2);
        let tip = Some(tip(&check));
        let report =
            StartReport { measured: &swapped, commanded: &swapped, target: &swapped, held: None, tip, is_first: false };
        let message = check.check(&report).unwrap_err().0;
        assert!(message.contains("the order of the joints"), "{message}");
    }
}
