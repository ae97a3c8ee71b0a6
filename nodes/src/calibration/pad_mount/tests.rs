//! Tests with random mounts, arms and places on the pad.

use std::f64::consts::PI;

use nalgebra::{Point3, Translation3};
use proptest::prelude::*;

use super::*;
use crate::motion::pose::testing::any_pose;
use crate::motion::pose::{pose_of, rotation_vector};
use tactflow_runtime::random::Random;

/// Five places on a pad of 80 by 160 mm.
const PLACES: [[f64; 2]; 5] = [[0.03, 0.06], [-0.03, 0.06], [-0.03, -0.06], [0.03, -0.06], [0.0, 0.01]];
/// Roll, pitch and yaw of the tip: down, tilted to all sides.
const TILTS: [[f64; 3]; 5] =
    [[PI, 0.5, 0.0], [PI, -0.4, 1.0], [PI + 0.5, 0.0, -0.8], [PI - 0.5, 0.2, 0.3], [PI, 0.0, 2.0]];

fn mount() -> IsometryMatrix3<f64> {
    pose_of([0.01, -0.02, 0.11], [0.02, -0.03, 1.6])
}

/// Returns touches of a point: the tip is where its rotation and the place on the pad put it.
fn touches(rotations: &[Rotation3<f64>], places: &[[f64; 2]], mount: &IsometryMatrix3<f64>) -> Vec<MountPosture> {
    let point = Point3::new(0.5, -0.2, 0.1);
    let touch = |(rotation, place): (&Rotation3<f64>, &[f64; 2])| {
        let reach = rotation * (mount * Point3::new(place[0], place[1], 0.0)).coords;
        let tip = IsometryMatrix3::from_parts(Translation3::from(point.coords - reach), *rotation);
        MountPosture { tip, place: *place }
    };
    rotations.iter().zip(places).map(touch).collect()
}

fn tilts() -> Vec<Rotation3<f64>> {
    TILTS.iter().map(|rpy| pose_of([0.0; 3], *rpy).rotation).collect()
}

/// Shifts each contact by a noise [m].
fn noisy(touches: &[MountPosture], noise: f64, random: &mut Random) -> Vec<MountPosture> {
    touches
        .iter()
        .map(|touch| MountPosture { place: touch.place.map(|at| at + noise * random.normal()), ..*touch })
        .collect()
}

/// Returns the distance [m] and the angle [rad] between two mounts.
fn off(a: &IsometryMatrix3<f64>, b: &IsometryMatrix3<f64>) -> (f64, f64) {
    let turn = rotation_vector(&(a.rotation.inverse() * b.rotation));
    ((a.translation.vector - b.translation.vector).norm(), turn.norm())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Any mount and any start, with tilts of 20 to 60 degrees in four directions: no start is a bad one. Four postures may
    /// be too alike. Eight, in which each tilt meets two corners, never are.
    #[test]
    fn any_mount_is_found_from_any_start(
        mount in any_pose(), start in any_pose(), base in any_pose(),
        tilt in 0.35..1.05_f64, turn in prop::array::uniform4(-1.0..1.0_f64), count in prop_oneof![Just(4_usize), Just(8)],
    ) {
        let rotations: Vec<_> = (0..count).map(|i| {
            let (sin, cos) = libm::sincos(i as f64 * PI / 2.0);
            let tilted = Rotation3::new(Vector3::new(tilt * cos, tilt * sin, 0.0));
            base.0.rotation * tilted * Rotation3::new(Vector3::z() * turn[(i + i / 4) % 4])
        }).collect();
        let places: Vec<_> = (0..count).map(|i| PLACES[(i + 2 * (i / 4)) % 4]).collect();
        let found = match fit(&touches(&rotations, &places, &mount.0), &start.0) {
            Ok(found) if found.turn_deviation.is_ok() => found,
            refused => {
                prop_assert!(count == 4, "{refused:?}");
                return Ok(());
            }
        };
        let (shift, turn) = off(&found.mount, &mount.0);
        prop_assert!(shift < 1e-7 && turn < 1e-6 && found.rms() < 1e-8, "{} {} {}", shift, turn, found.rms());
        prop_assert!((found.point - Vector3::new(0.5, -0.2, 0.1)).norm() < 1e-7);
    }
}

/// A mirrored image fits without a residual, with z of the pad into the tool.
#[test]
fn a_mirrored_image_fits_with_z_into_the_tool() {
    let exact = touches(&tilts(), &PLACES, &mount());
    assert!(!fit(&exact, &mount()).unwrap().faces_away_from(&mount()));
    for [sx, sy] in [[-1.0, 1.0], [1.0, -1.0]] {
        let mirror =
            |touch: &MountPosture| MountPosture { place: [sx * touch.place[0], sy * touch.place[1]], ..*touch };
        let mirrored: Vec<_> = exact.iter().map(mirror).collect();
        let found = fit(&mirrored, &mount()).unwrap();
        assert!(found.rms() < 1e-8 && found.turn_deviation.is_ok(), "{found:?}");
        assert!(found.faces_away_from(&mount()), "{found:?}");
        // The wrong mount explains the right image too: what differs is only the mount that it is compared with.
        let inward = mount() * pose_of([0.0; 3], [PI, 0.0, 0.0]);
        assert!(!found.faces_away_from(&inward) && fit(&exact, &inward).unwrap().faces_away_from(&inward));
    }
}

/// The stated standard deviations are those of many fits with other noise.
#[test]
fn the_deviations_are_those_of_many_fits() {
    const RUNS: usize = 300;
    let exact = touches(&tilts(), &PLACES, &mount());
    let mut random = Random::new(3, 0);
    let [mut squares, mut stated] = [[0.0; 6]; 2];
    for _ in 0..RUNS {
        let noise = |touch: &MountPosture, random: &mut Random| {
            let shift = Vector3::from_fn(|_, _| 0.0004 * random.normal());
            MountPosture { tip: Translation3::from(shift) * touch.tip, ..*touch }
        };
        let noisy: Vec<_> = exact.iter().map(|touch| noise(touch, &mut random)).collect();
        let found = fit(&noisy, &mount()).unwrap();
        let shift = found.mount.translation.vector - mount().translation.vector;
        let turn = rotation_vector(&(mount().rotation.inverse() * found.mount.rotation));
        let turn_deviation = found.turn_deviation.unwrap();
        for i in 0..3 {
            squares[i] += shift[i].powi(2);
            stated[i] += found.shift_deviation[i].powi(2);
            squares[3 + i] += turn[i].powi(2);
            stated[3 + i] += turn_deviation[i].powi(2);
        }
    }
    for (square, stated) in squares.iter().zip(stated) {
        assert!((square / stated - 1.0).abs() < 0.25, "{squares:?} {stated}");
    }
}

#[test]
fn contacts_at_one_place_keep_the_rotation_of_the_bench() {
    let exact = touches(&tilts(), &[[0.012, -0.004]; 5], &mount());
    let start = pose_of([0.0, 0.0, 0.1], [0.02, -0.03, 1.7]);
    let found = fit(&noisy(&exact, 0.0002, &mut Random::new(1, 0)), &start).unwrap();
    assert_eq!(found.mount.rotation, start.rotation);
    let kept = found.turn_deviation.unwrap_err();
    assert!(kept.deviation > 1.0, "{kept:?}");
    // The place itself is found: the pivot is where the contact is on the true mount.
    let place = Point3::new(0.012, -0.004, 0.0);
    assert!(((found.mount * place) - (mount() * place)).norm() < 0.001);
}

#[test]
fn contacts_on_a_line_do_not_determine_the_turn_about_it() {
    let line = [[0.03, 0.0], [-0.03, 0.0], [0.02, 0.0], [-0.01, 0.0], [0.01, 0.0]];
    let found = fit(&touches(&tilts(), &line, &mount()), &mount()).unwrap();
    let kept = found.turn_deviation.unwrap_err();
    assert!((kept.axis - Vector3::x()).norm() < 1e-3, "{kept:?}");
}

#[test]
fn postures_that_are_few_or_alike_are_refused() {
    let exact = touches(&tilts(), &PLACES, &mount());
    assert_eq!(fit(&exact[..3], &mount()), Err(MountUnfit::Few));
    // The tip only turns about its own z, so the pad may be anywhere along it.
    let turns: Vec<_> = [0.0, 0.5, 1.0, 1.5, 2.0].map(|yaw| pose_of([0.0; 3], [0.0, 0.0, yaw]).rotation).into();
    let Err(MountUnfit::Alike { axis, deviation }) = fit(&touches(&turns, &PLACES, &mount()), &mount()) else {
        panic!()
    };
    assert!((axis - Vector3::z()).norm() < 1e-3 && deviation > 0.1, "{axis} {deviation}");
    // It hardly turns at all.
    let alike: Vec<_> = tilts().iter().map(|turn| Rotation3::new(0.02 * rotation_vector(turn))).collect();
    assert!(matches!(fit(&touches(&alike, &PLACES, &mount()), &mount()), Err(MountUnfit::Alike { .. })));
}

#[test]
fn a_posture_with_a_gross_error_is_named() {
    let exact = touches(&tilts(), &PLACES, &mount());
    let mut random = Random::new(9, 0);
    for wrong in 0..5 {
        let more = [exact.clone(), touches(&tilts()[1..3], &PLACES[3..], &mount())].concat();
        let mut touches = noisy(&more, 0.0001, &mut random);
        let all = fit(&touches, &mount()).unwrap();
        assert!(all.rms() < 0.0005 && outlier(&touches, &mount(), &all).is_none());
        touches[wrong].tip.translation.vector += Vector3::new(0.0, 0.01, 0.01);
        let all = fit(&touches, &mount()).unwrap();
        let found = outlier(&touches, &mount(), &all).expect("one of seven is wrong");
        assert!(found.index == wrong && found.rms < 0.0005, "{found:?}");
    }
}

#[test]
fn there_are_24_quarter_turns_and_the_first_one_is_none() {
    let turns: Vec<_> = quarter_turns().collect();
    assert_eq!((turns.len(), turns[0]), (24, Rotation3::identity()));
    assert!(turns.iter().all(|turn| turn.matrix().determinant() == 1.0));
}
