//! Limiters of a twist: motions of any size, images that change while a motion is held, motions that become too old,
//! and a sensor that moves toward a face of its box.

use nalgebra::IsometryMatrix3;
use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::node::{Node, of};
use tactflow_runtime::signal::{
    Freshness, Image, ImageShape, Pose, PoseShape, Scalar, Shape, Stamp, Twist, TwistShape, Unit,
};

use super::acceleration_limit::AccelerationLimit;
use super::bumpless::Bumpless;
use super::contact_limit::ContactLimit;
use super::second_contact_limit::SecondContactLimit;
use super::twist_limit::TwistLimit;
use super::workspace_limit::WorkspaceLimit;

const SPEEDS: &str = "linear_m_per_s = 0.05\nangular_rad_per_s = 0.8";
const ACCELERATIONS: &str = "linear_m_per_s2 = 1.0\nangular_rad_per_s2 = 10.0";
const BOX: &str = "min_m = [-0.1, -0.1, -0.1]\nmax_m = [0.1, 0.1, 0.1]\ndeceleration_m_per_s2 = 1.0";
/// On a pad of 2 by 2 tactels of 10 mm: 40 N/m under the pad, and 80 N/m under a tactel.
const CEILINGS: &str = "force_n = 10.0\npeak_n = 4.0\ndeceleration_m_per_s2 = 1.0\nfoam_n_per_m3 = 1e5";

fn rig<N: Node>(params: &str) -> NodeRig {
    let pad = ImageShape { rows: 2, cols: 2, pitch: [0.01; 2], unit: Unit::NEWTON };
    let pose = PoseShape::default();
    let all: [(&str, Shape); 4] = [
        ("twist", TwistShape.into()),
        ("image", pad.into()),
        ("pose", pose.clone().into()),
        ("image_pose", pose.into()),
    ];
    let inputs = of::<N>().spec().inputs;
    let wires = all.into_iter().filter(|(name, _)| inputs.iter().any(|input| input.name == *name));
    NodeRig::new::<N>(params, &wires.collect::<Vec<_>>()).unwrap_or_else(|mistakes| panic!("{}: {mistakes:?}", N::NAME))
}

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose(IsometryMatrix3::translation(x, y, z))
}

fn twist(parts: [f64; 6]) -> Twist {
    Twist(parts.into())
}

fn get(rig: &NodeRig) -> Option<Twist> {
    rig.get::<Twist>("twist").copied()
}

#[test]
fn a_finite_motion_of_any_size_stays_finite() {
    let mut limiters = [
        (rig::<Bumpless>(ACCELERATIONS), "bumpless"),
        (rig::<ContactLimit>(CEILINGS), "force"),
        (rig::<SecondContactLimit>(CEILINGS), "peak"),
        (rig::<WorkspaceLimit>(BOX), "workspace"),
        (rig::<TwistLimit>(SPEEDS), "speed"),
        (rig::<AccelerationLimit>(ACCELERATIONS), "acceleration"),
    ];
    for (rig, limit) in &mut limiters {
        for size in [1e-320, 1e-160, 1e100, 1e155, 1e200, 1e308, f64::MAX] {
            for sign in [1.0, -1.0, 1.0] {
                rig.set("twist", twist([size, -size, size, size, size, -size].map(|v| sign * v)));
                match *limit {
                    "force" => rig.set("image", Image::from_cells(2, &[9.0, 0.0, 0.0, 9.0])),
                    "peak" => {
                        rig.set("image", Image::from_cells(2, &[9.0, 0.0, 0.0, 9.0]));
                        rig.set("pose", at(0.0, 0.0, 0.0));
                        let turned = IsometryMatrix3::rotation(nalgebra::Vector3::new(0.3, 2.2, -0.4));
                        rig.set("image_pose", Pose(turned));
                    }
                    "workspace" => rig.set("pose", at(0.1, 0.0, 0.0)),
                    _ => {}
                }
                rig.step();
                let out = get(rig).unwrap();
                assert!(out.0.iter().all(|v| v.is_finite()), "`{limit}` of {size:e}: {out:?}");
                let share = *rig.get::<Scalar>(limit).unwrap();
                assert!((0.0..=1.0).contains(&share), "`{limit}` of {size:e} is {share}");
            }
        }
    }
}

#[test]
fn a_face_stops_a_motion_of_any_size() {
    let mut rig = rig::<WorkspaceLimit>(BOX);
    for size in [1e-3, 1.0, 1e150, 1e200, f64::MAX] {
        for along in [0.0, 1.0] {
            rig.set("pose", at(0.1, 0.0, 0.0));
            rig.set("twist", twist([size, along * size, 0.0, 0.0, 0.0, 0.0]));
            rig.step();
            assert_eq!(get(&rig), Some(Twist::default()), "{size:e}");
            assert_eq!(rig.get::<Scalar>("workspace"), Some(&0.0));
        }
    }
}

#[test]
fn a_new_image_acts_while_the_motion_is_held() {
    let mut rig = rig::<ContactLimit>(CEILINGS);
    let into = twist([0.0, 0.0, 0.1, 0.0, 0.0, 0.0]);
    rig.set("image", Image::from_cells(2, &[0.0; 4]));
    rig.set("twist", into);
    rig.step();
    assert_eq!(get(&rig), Some(into), "no contact");
    rig.set("image", Image::from_cells(2, &[5.0; 4]));
    rig.step();
    assert_eq!(get(&rig), Some(Twist::default()), "the motion is the same, but the pad is at its ceiling");
}

#[test]
fn a_timeless_image_acts_too() {
    let mut rig = rig::<ContactLimit>(CEILINGS);
    // A load that falls counts less with each image.
    for (cell, passes, images) in [(5.0, 0.0, 1), (0.0, 0.1, 500), (5.0, 0.0, 1)] {
        for _ in 0..images {
            rig.edit("image", Stamp::TIMELESS, |image: &mut Image| *image = Image::from_cells(2, &[cell; 4]));
            rig.set("twist", twist([0.0, 0.0, 0.1, 0.0, 0.0, 0.0]));
            rig.step();
        }
        assert_eq!(get(&rig).unwrap().0[2], passes, "{cell} on each tactel");
    }
}

/// Returns the load after an approach from `load` goes on for `delay` and brakes with 1 m/s², against a spring.
fn after_braking(load: f64, speed: f64, stiffness: f64, delay: f64) -> f64 {
    load + stiffness * (speed * delay + speed * speed / 2.0)
}

/// Returns the speed after which the load is `ceiling`, by bisection; 0 if it is above.
fn braked_at(ceiling: f64, load: f64, stiffness: f64, delay: f64) -> f64 {
    let (mut slow, mut fast) = (0.0, 10.0);
    for _ in 0..100 {
        let middle = 0.5 * (slow + fast);
        if after_braking(load, middle, stiffness, delay) <= ceiling { slow = middle } else { fast = middle }
    }
    slow
}

#[test]
fn at_every_load_the_approach_can_stop_below_both_ceilings() {
    for age in [0, 3] {
        // The image is as old as the steps before this one, and the command acts for two periods of 1 ms.
        let delay = f64::from(age) * 1e-3 + 0.002;
        for sum in [1.0f32, 2.5, 5.0, 9.0, 9.99, 10.0, 30.0] {
            for cells in [[sum / 4.0; 4], [sum, 0.0, 0.0, 0.0], [sum / 2.0, 0.0, 0.0, sum / 2.0]] {
                let mut rig = rig::<ContactLimit>(CEILINGS);
                rig.set("image", Image::from_cells(2, &cells));
                (0..age).for_each(|_| rig.step());
                rig.set("twist", twist([0.3, 0.0, 5.0, 0.0, 0.0, 0.2]));
                rig.step();
                let out = get(&rig).unwrap();
                let by_sum = braked_at(10.0, f64::from(sum), 40.0, delay);
                let by_tactel = braked_at(4.0, f64::from(cells[0]), 80.0, delay);
                let allowed = by_sum.min(by_tactel);
                assert!((out.0[2] - allowed).abs() < 1e-6, "{allowed} m/s of {cells:?}, {age} ms old: {out:?}");
                assert_eq!((out.0[0], out.0[5]), (0.3, 0.2), "the other components stay");
            }
        }
    }
}

#[test]
fn before_the_first_touch_no_corner_is_too_fast_and_the_direction_stays() {
    let mut rig = rig::<ContactLimit>(CEILINGS);
    for (cell, wanted) in [(0.0, [0.1, 0.0, 2.0, 10.0, -20.0, 0.3]), (-3.0, [0.0, 0.0, 3.0, 0.0, 0.0, 0.0])] {
        rig.set("image", Image::from_cells(2, &[cell; 4]));
        rig.set("twist", twist(wanted));
        rig.step();
        let out = get(&rig).unwrap();
        let fastest = |of: &Twist| of.0[2] + 0.01 * (of.0[3].abs() + of.0[4].abs());
        assert!(
            (after_braking(0.0, fastest(&out), 80.0, 0.002) - 4.0).abs() < 1e-9,
            "{out:?}: one tactel is the first"
        );
        let scale = fastest(&out) / fastest(&twist(wanted));
        assert!((out.0 - twist(wanted).0 * scale).amax() < 1e-12, "{out:?}");
        assert!((rig.get::<Scalar>("force").unwrap() * rig.get::<Scalar>("peak").unwrap() - scale).abs() < 1e-12);
    }
    let away = twist([3.0, 0.0, -2.0, 5.0, 0.0, 0.0]);
    rig.set("twist", away);
    rig.step();
    assert_eq!(get(&rig), Some(away), "the way out is free");
}

#[test]
fn an_approach_that_cannot_stop_is_refused_with_the_largest_that_can() {
    let pad = ImageShape { rows: 16, cols: 16, pitch: [0.005; 2], unit: Unit::NEWTON };
    let wires: [(&str, Shape); 2] = [("twist", TwistShape.into()), ("image", pad.into())];
    let usual = "force_n = 15.0\npeak_n = 3.0\ndeceleration_m_per_s2 = 2.0\n";
    let params = |more: &str| format!("{usual}{more}");
    let refused = |more: &str| NodeRig::new::<ContactLimit>(&params(more), &wires).err();
    // 76.8 kN/m under the whole pad, and two periods of 1 ms: v 0.002 + v²/4 = 15 / 76,800.
    let mistakes = refused("approach_m_per_s = 0.05").unwrap();
    assert_eq!(
        mistakes[0].help.as_deref().unwrap(),
        "write at most `approach_m_per_s = 0.02423`, or leave it out: the largest speed is then found"
    );
    assert!(
        mistakes[0].message.starts_with("an approach at 0.05 m/s cannot stop below `force_n = 15`"),
        "{mistakes:?}"
    );
    assert!(refused("approach_m_per_s = 0.02423").is_none());
    assert!(refused("approach_m_per_s = 0.02424").is_some());
    // A soft or small object gives way.
    assert!(refused("approach_m_per_s = 0.05\ncontact_n_per_m = 2000.0").is_none());
    assert!(refused("").is_none());
}

#[test]
fn with_an_old_image_or_pose_the_output_is_absent() {
    let along = twist([0.01, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let mut blind = rig::<ContactLimit>(&format!("{CEILINGS}\nmax_age_ms = 3"));
    let mut lost = rig::<WorkspaceLimit>(&format!("{BOX}\nmax_age_ms = 3"));
    blind.set("image", Image::from_cells(2, &[0.0; 4]));
    lost.set("pose", at(0.0, 0.0, 0.0));
    for ms in 0..8 {
        let expected = (ms <= 3).then_some(along);
        for rig in [&mut blind, &mut lost] {
            // The motion is set once and is then held: the node must stop it without a new one.
            if ms == 0 {
                rig.set("twist", along);
            }
            rig.step();
            assert_eq!(get(rig), expected, "{ms} ms old");
        }
    }
}

#[test]
fn a_lost_or_old_motion_goes_to_zero_on_a_straight_line_and_is_absent_then() {
    let wanted = twist([0.02, 0.0, 0.0, 0.0, 0.0, 0.0]);
    for is_lost in [true, false] {
        let mut rig = rig::<AccelerationLimit>(&format!("{ACCELERATIONS}\nmax_age_ms = 3"));
        for _ in 0..30 {
            rig.set("twist", wanted);
            rig.step();
        }
        assert_eq!(get(&rig), Some(wanted));
        let begin = if is_lost { 0 } else { 3 };
        if is_lost {
            rig.lose("twist");
        }
        for ms in 0..begin {
            rig.step();
            assert_eq!(get(&rig), Some(wanted), "{ms} ms old");
        }
        for ms in 1..20 {
            rig.step();
            let left = get(&rig).unwrap().0[0];
            assert!((left - (0.02 - 1e-3 * f64::from(ms))).abs() < 1e-12, "{left} after {ms} ms");
            // The rest of an old motion keeps its stamp.
            assert_eq!(rig.mark("twist").stamp().is_timeless(), is_lost);
        }
        (0..2).for_each(|_| rig.step());
        assert_eq!(rig.freshness("twist"), Freshness::Absent);
    }
}

#[test]
fn a_tick_without_time_changes_nothing_and_a_long_gap_counts_as_max_gap() {
    let mut rig = rig::<AccelerationLimit>(ACCELERATIONS);
    let (far, cases) = (twist([5.0, 0.0, 0.0, 0.0, 0.0, 0.0]), [(0.0, 0.0), (0.0, 0.0), (40.0, 0.0), (900.0, 0.04)]);
    for (ms, reached) in cases.into_iter().chain([(0.0, 0.14)]) {
        rig.set("twist", far);
        rig.step_ms(ms);
        assert!((get(&rig).unwrap().0[0] - reached).abs() < 1e-12, "{:?}, not {reached}", get(&rig));
    }
}

/// Returns how far a sensor passes a face of its box when it moves straight toward it and turns to and fro at full
/// speed: the acceleration limit keeps the direction of a change, so the turning delays the braking.
fn past(gap: f64, turning: f64, flip: usize, margin: f64) -> f64 {
    let accelerations = format!("linear_m_per_s2 = 1.0\nangular_rad_per_s2 = {turning}");
    let (mut near, mut slow) = (rig::<WorkspaceLimit>(BOX), rig::<TwistLimit>(SPEEDS));
    let mut smooth = rig::<AccelerationLimit>(&accelerations);
    let (mut x, mut command, mut worst) = (0.05, Twist::default(), f64::NEG_INFINITY);
    for tick in 0..1000 {
        let sign = if (tick / flip).is_multiple_of(2) { 1.0 } else { -1.0 };
        // Toward the face until it is near; then only turning, so that no limit scales the turning down.
        let ahead = if 0.1 - x > margin { 0.05 } else { 0.0 };
        near.tick.max_gap = gap;
        near.set("pose", at(x, 0.0, 0.0));
        near.set("twist", twist([ahead, 0.0, 0.0, sign * 0.8, 0.0, 0.0]));
        near.step_ms(4.0);
        slow.set("twist", get(&near).unwrap());
        slow.step_ms(4.0);
        smooth.set("twist", get(&slow).unwrap());
        smooth.step_ms(4.0);
        // The sensor follows the command one tick later.
        x += command.linear().x * 0.004;
        command = get(&smooth).unwrap();
        worst = f64::max(worst, x - 0.1);
    }
    worst
}

#[test]
fn turning_delays_the_braking_by_no_more_than_documented() {
    // Turns that are reversed in 0.16 s and in 0.8 s: speed times that time, and the worst case found.
    for (gap, turning, found) in [(0.1, 10.0, 1e-6), (0.02, 10.0, 0.0023), (0.02, 2.0, 0.018)] {
        let bound = 0.05 * (2.0 * 0.8 / turning) + 0.05 * 0.008;
        let flips = [1, 3, 10, 20, 30, 40, 80];
        let tries = flips.iter().flat_map(|flip| (0..15).map(move |mm| (*flip, f64::from(mm) * 1e-3)));
        let worst = tries.map(|(flip, margin)| past(gap, turning, flip, margin)).fold(f64::NEG_INFINITY, f64::max);
        assert!(worst <= bound, "{worst} m beyond the face, with {turning} rad/s²");
        assert!(worst < found, "{worst} m beyond the face, with {turning} rad/s² and a gap of {gap} s");
    }
}

#[test]
fn a_start_outside_the_box_is_warned_of_at_its_corner() {
    let warnings = |start: Option<[f64; 3]>| {
        let wires = [("twist", TwistShape.into()), ("pose", PoseShape { start }.into())];
        places(BOX, &NodeRig::new::<WorkspaceLimit>(BOX, &wires))
    };
    for start in [None, Some([0.0; 3]), Some([0.1, -0.1, 0.1]), Some([0.0, 0.0, 30.0])] {
        assert!(warnings(start).is_empty(), "{start:?}");
    }
    assert_eq!(warnings(Some([0.0, -0.11, 0.0])), ["start-outside: `min_m`"]);
    assert_eq!(warnings(Some([0.0, 0.0, 0.2])), ["start-outside: `max_m`"]);
}
