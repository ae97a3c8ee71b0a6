//! What `tactflow calibrate mount` prints about a mount.

use std::path::Path;

use nalgebra::{IsometryMatrix3, Vector3};

use crate::calibration::pad_mount::{
    DOUBTFUL_RESIDUAL_M, KeptRotation, MIN_TOUCHES, MountFit, MountPosture, MountUnfit, Outlier,
};
use crate::motion::pose::{rotation_vector, rpy_of};
use crate::tool::guided::vectors::{direction, three};

/// Cosine of the largest angle to the axis that names a direction: about 18° [1].
const NEAR: f64 = 0.95;

/// Describes a posture that was measured.
pub(super) fn described(touch: &MountPosture, tactels: usize) -> String {
    let [x, y] = touch.place.map(|at| at * 1e3);
    let coarse = if tactels == 1 { "; one tactel shows its place only within half a pitch" } else { "" };
    format!("  contact at x {x:.1} mm, y {y:.1} mm on the pad, on {tactels} tactels{coarse}")
}

/// Describes how well the mount is known now.
pub(super) fn progress(fitted: &Result<MountFit, MountUnfit>, count: usize, worst: Option<Outlier>) -> String {
    match fitted {
        Ok(found) => {
            let line = format!("{}; {}", residual(found), deviations(found));
            let worst = worst.map(|Outlier { index, rms }| {
                let number = index + 1;
                format!(
                    "\nposture {number} does not fit the others: without it, the residual is {:.2} mm; write `drop {number}` and \
                     measure it again",
                    rms * 1e3
                )
            });
            line + &worst.unwrap_or_default()
        }
        Err(MountUnfit::Few) => format!("{count} of at least {MIN_TOUCHES} postures"),
        Err(MountUnfit::Alike { axis, deviation }) => format!(
            "the postures are too alike: the place of the pad along {} of the tip is known within {:.0} mm only; tilt the tool by \
             20° or more, each time in another direction",
            along(axis),
            deviation * 1e3
        ),
    }
}

/// Describes the result and its difference from the mount of the bench.
pub(super) fn report(found: &MountFit, present: &IsometryMatrix3<f64>) -> String {
    let shift = three(&((found.mount.translation.vector - present.translation.vector) * 1e3), 2);
    let turn = rotation_vector(&(present.rotation.inverse() * found.mount.rotation)).norm().to_degrees();
    let [roll, pitch, yaw] = rpy_of(&found.mount.rotation).map(f64::to_degrees);
    let at = three(&(found.mount.translation.vector * 1e3), 2);
    let mut lines = vec![
        format!("mount: {at} mm, roll {roll:.2}°, pitch {pitch:.2}°, yaw {yaw:.2}°"),
        residual(found),
        deviations(found),
        format!("difference from the bench: {shift} mm, {turn:.2}°"),
    ];
    if found.rms() > DOUBTFUL_RESIDUAL_M {
        lines.push(format!(
            "warning: the residual is above {:.0} mm: did the point move, or is the model of the arm another one?",
            DOUBTFUL_RESIDUAL_M * 1e3
        ));
    }
    lines.join("\n")
}

/// Says why a mount is not written whose z points away from that of the bench.
pub(super) fn facing(present: &IsometryMatrix3<f64>, bench: &Path) -> String {
    let (bench, z) = (bench.display(), direction(&(present.rotation * Vector3::z()), NEAR));
    format!(
        "z of the measured mount points away from z of the bench, so nothing is written. The contacts do not show which way z \
         points, and one of two is wrong: the image is mirrored, which `tactflow doctor {bench} --press` finds, or z of `mount` \
         in the bench, which is {z} of the tip, points into the tool and not out of the pad: `tactflow pose {bench}` prints \
         where z points"
    )
}

fn residual(found: &MountFit) -> String {
    let (largest, index) = found.largest();
    let rms = found.rms();
    format!("residual {:.2} mm (RMS), {:.2} mm at most, in posture {}", rms * 1e3, largest * 1e3, index + 1)
}

fn deviations(found: &MountFit) -> String {
    let shift = three(&(found.shift_deviation * 1e3), 2);
    match &found.turn_deviation {
        Ok(turn) => {
            let turn = three(&turn.map(f64::to_degrees), 2);
            format!("standard deviations: {shift} mm along x, y, z of the tip, {turn}° about x, y, z of the pad")
        }
        Err(KeptRotation { axis, .. }) => format!(
            "standard deviations: {shift} mm along x, y, z of the tip; the rotation is that of the bench, because the contacts do \
             not determine it about {} of the pad: touch the point with all corners of the pad",
            along(axis)
        ),
    }
}

/// Names the axis of a direction that is near to one, without a sign, and else the unit vector.
fn along(axis: &Vector3<f64>) -> String {
    direction(axis, NEAR).trim_start_matches(['+', '-']).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::pose::pose_of;

    fn found(turn: Result<Vector3<f64>, KeptRotation>) -> MountFit {
        MountFit {
            mount: pose_of([0.0, 0.01, 0.1], [0.0, 0.0, std::f64::consts::FRAC_PI_2]),
            point: Vector3::zeros(),
            residuals: vec![0.003, 0.004],
            shift_deviation: Vector3::new(1e-4, 2e-4, 3e-4),
            turn_deviation: turn,
        }
    }

    #[test]
    fn the_report_names_the_difference_and_a_doubtful_residual() {
        let text = report(&found(Ok(Vector3::new(0.01, 0.01, 0.0))), &pose_of([0.0, 0.0, 0.1], [0.0; 3]));
        for part in [
            "mount: [0.00, 10.00, 100.00] mm, roll 0.00°, pitch 0.00°, yaw 90.00°",
            "residual 3.54 mm (RMS), 4.00 mm at most, in posture 2",
            "[0.10, 0.20, 0.30] mm along x, y, z of the tip, [0.57, 0.57, 0.00]° about x, y, z of the pad",
            "difference from the bench: [0.00, 10.00, 0.00] mm, 90.00°",
            "warning: the residual is above 2 mm",
        ] {
            assert!(text.contains(part), "{part}: {text}");
        }
    }

    #[test]
    fn both_causes_of_a_z_that_points_away_are_named() {
        let up = facing(&pose_of([0.0; 3], [0.0; 3]), Path::new("cell.toml"));
        assert!(up.contains("`tactflow doctor cell.toml --press`") && up.contains("which is +z of the tip"), "{up}");
        let inward = facing(&pose_of([0.0; 3], [std::f64::consts::PI, 0.0, 0.0]), Path::new("cell.toml"));
        assert!(inward.contains("which is -z of the tip"), "{inward}");
    }

    #[test]
    fn what_is_not_determined_is_named_with_a_way_out() {
        let kept = KeptRotation { axis: Vector3::new(0.99, 0.1, 0.0), deviation: 1.0 };
        let text = progress(&Ok(found(Err(kept))), 4, Some(Outlier { index: 2, rms: 2e-4 }));
        assert!(text.contains("about x of the pad: touch the point with all corners"), "{text}");
        assert!(text.contains("posture 3 does not fit the others: without it, the residual is 0.20 mm"), "{text}");
        let alike = MountUnfit::Alike { axis: Vector3::new(0.6, 0.0, 0.8), deviation: 0.021 };
        let text = progress(&Err(alike), 4, None);
        assert!(text.contains("along [0.60, 0.00, 0.80] of the tip is known within 21 mm only"), "{text}");
    }
}
