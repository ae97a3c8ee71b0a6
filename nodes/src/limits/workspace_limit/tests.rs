//! Keep-out planes: their rows, the braking before them, and the warning about a start behind one.

use nalgebra::{IsometryMatrix3, Rotation3, Vector3};
use proptest::prelude::*;
use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::node::{Mistakes, Node};
use tactflow_runtime::signal::{Pose, PoseShape, Scalar, Shape, Twist, TwistShape};

use super::WorkspaceLimit;
use crate::limits::acceleration_limit::AccelerationLimit;
use crate::limits::twist_limit::TwistLimit;

const BOX: &str = "min_m = [-0.2, -0.2, -0.2]\nmax_m = [0.2, 0.2, 0.2]\ndeceleration_m_per_s2 = 1.0";

fn rig<N: Node>(params: &str, wires: &[(&str, Shape)]) -> Result<NodeRig, Mistakes> {
    let twist: [(&str, Shape); 1] = [("twist", TwistShape.into())];
    NodeRig::new::<N>(params, &[&twist, wires].concat())
}

fn limit(keep_out: &str, start: Option<[f64; 3]>) -> Result<NodeRig, Mistakes> {
    rig::<WorkspaceLimit>(&format!("{BOX}\nkeep_out = {keep_out}"), &[("pose", PoseShape { start }.into())])
}

fn pass(rig: &mut NodeRig, at: [f64; 3], velocity: [f64; 3]) -> Vector3<f64> {
    rig.set("pose", Pose(IsometryMatrix3::translation(at[0], at[1], at[2])));
    rig.set("twist", Twist::new(velocity.into(), Vector3::zeros()));
    rig.step();
    rig.get::<Twist>("twist").unwrap().linear().into_owned()
}

#[test]
fn a_plane_brakes_as_a_face_of_the_box_does() {
    // The planes are the faces of a box that is smaller than `BOX`.
    let rows =
        "[[1, 0, 0, -0.1], [-1, 0, 0, -0.1], [0, 1, 0, -0.1], [0, -1, 0, -0.1], [0, 0, 1, -0.1], [0, 0, -1, -0.1]]";
    let mut planes = limit(rows, None).unwrap();
    let small = BOX.replace("0.2", "0.1");
    let mut faces = rig::<WorkspaceLimit>(&small, &[("pose", PoseShape::default().into())]).unwrap();
    let cases = [
        ([0.0, 0.0, 0.0], [3.0, 0.0, 0.0]),
        ([0.09, 0.0, 0.0], [0.3, 0.0, 0.0]),
        ([0.09, 0.0, 0.0], [-0.3, 0.0, 0.0]),
        ([0.0, -0.099, 0.0], [0.1, -0.3, 0.2]),
        ([0.0, 0.0, 0.1], [0.0, 0.0, 0.1]),
        ([0.0, 0.0, 0.1], [0.1, 0.0, 0.0]),
        ([0.0, 0.0, -0.15], [0.0, 0.0, -0.1]),
        ([0.0, 0.0, -0.15], [0.0, 0.0, 0.1]),
        ([0.09, 0.095, -0.099], [0.1, 0.2, -0.3]),
    ];
    for (at, velocity) in cases {
        let [before, face] = [&mut planes, &mut faces].map(|rig| pass(rig, at, velocity));
        assert!((before - face).norm() < 1e-12, "at {at:?} with {velocity:?}: {before:?} and {face:?}");
        let shares = [&planes, &faces].map(|rig| *rig.get::<Scalar>("workspace").unwrap());
        assert!((shares[0] - shares[1]).abs() < 1e-12 && (0.0..=1.0).contains(&shares[0]), "{shares:?}");
    }
}

#[test]
fn behind_a_plane_only_the_way_back_is_free() {
    // A wedge: free where x + z >= 0.1 · √2.
    let mut rig = limit("[[0.707107, 0.0, 0.707107, 0.1]]", None).unwrap();
    let cases = [
        ([0.0, 0.0, 0.0], [0.1, 0.0, 0.0], 1.0),
        ([0.0, 0.0, 0.0], [0.1, 0.0, -0.1], 1.0),
        ([0.0, 0.0, 0.0], [0.0, 0.1, 0.0], 1.0),
        ([0.0, 0.0, 0.0], [-0.1, 0.0, 0.0], 0.0),
        ([0.0, 0.0, 0.0], [0.1, 0.0, -0.2], 0.0),
        ([0.19, 0.0, 0.19], [-0.1, 0.0, 0.0], 1.0),
    ];
    for (at, velocity, share) in cases {
        let out = pass(&mut rig, at, velocity);
        assert!((out - Vector3::from(velocity) * share).norm() < 1e-9, "at {at:?} with {velocity:?}: {out:?}");
    }
}

#[test]
fn a_row_that_is_no_plane_is_refused_with_a_row_to_paste() {
    let many = format!("[{}]", ["[0, 0, 1, -0.1]"; 33].join(", "));
    let cases = [
        (
            "[[0, 0, 2, 0.3]]",
            "the normal [0.0, 0.0, 2.0] of a plane has the length 2, not 1",
            "`[0.0, 0.0, 1.0, 0.15]`",
        ),
        ("[[3, 0, 4, 0.5]]", "the normal [3.0, 0.0, 4.0] of a plane has the length 5, not 1", "`[0.6, 0.0, 0.8, 0.1]`"),
        ("[[0, 0, 0, 0.3]]", "the normal [0.0, 0.0, 0.0] of a plane has the length 0, not 1", "the free side"),
        ("[[0, 0, 1]]", "expected a list of 4, found a list of 3", ""),
        ("[0, 0, 1, 0.1]", "expected a list of planes, found one", "`[[0.0, 0.0, 1.0, 0.1]]`"),
        ("[[0, 0, 1, 0.3]]", "the whole box is behind the plane [0.0, 0.0, 1.0, 0.3]", "the normal points to the free"),
        ("[[0, 0, 1, 0.1], [0, 0, -1, 0.0]]", "the planes together leave no room in the box", "have points in common"),
        (many.as_str(), "there are 33 planes, but at most 32 are possible", "keep those"),
    ];
    for (rows, message, help) in cases {
        let mistakes = limit(rows, None).err().unwrap_or_else(|| panic!("{rows} is taken"));
        assert_eq!(mistakes.len(), 1, "{mistakes:?}");
        assert!(mistakes[0].message.starts_with(message), "{rows}: {}", mistakes[0].message);
        assert!(mistakes[0].help.as_deref().unwrap_or_default().contains(help), "{rows}: {:?}", mistakes[0].help);
    }
    for rows in ["[]", "[[0, 0, 1, 0.2]]", "[[0, 0, 1, '100 mm']]", "[[0, 0, 1, 0.1], [0, 0, -1, -0.1]]"] {
        assert!(limit(rows, None).is_ok(), "{rows}: {:?}", limit(rows, None).err());
    }
    let far = limit("[[0, 0, 1, -300]]", None).unwrap();
    assert_eq!(far.warnings[0].message, "`keep_out` is -300 m, but usual is -5 to 5 m");
}

#[test]
fn a_start_behind_a_plane_is_warned_of_at_its_row() {
    let rows = "[[0, 0, -1, -0.15], [0, 0, 1, 0.12]]";
    let cases = [(None, ""), (Some([0.0, 0.0, 0.12]), ""), (Some([0.0, 0.0, 0.1]), "start-outside: `[0, 0, 1, 0.12]`")];
    for (start, place) in cases {
        let found = places(&format!("{BOX}\nkeep_out = {rows}"), &limit(rows, start)).join("");
        assert_eq!(found, place, "{start:?}");
    }
    let warned = limit(rows, Some([0.0, 0.0, 0.1])).unwrap();
    let warning = &warned.warnings[0];
    assert!(warning.message.contains("it is 20.0 mm behind the plane [0.0, 0.0, 1.0, 0.12]"), "{}", warning.message);
    assert!(warning.help.as_ref().unwrap().starts_with("write `[0.0, 0.0, 1.0, 0.05]`"), "{:?}", warning.help);
}

/// Maximum linear speed of the chain below [m/s].
const SPEED: f64 = 0.05;
/// Maximum angular speed [rad/s].
const TURNING: f64 = 0.8;
/// Maximum linear acceleration [m/s²].
const ACCELERATION: f64 = 1.0;
/// Maximum angular acceleration [rad/s²].
const SPIN: f64 = 10.0;

fn a_plane() -> impl Strategy<Value = [f64; 4]> {
    let normal = prop::array::uniform3(-1.0..1.0f64).prop_map(Vector3::from);
    let normal = normal.prop_filter("a direction", |normal| normal.norm() > 0.1);
    // The origin, where each motion begins, is on the free side.
    (normal, 0.0..0.1f64).prop_map(|(normal, room)| {
        let n = normal.normalize();
        [n.x, n.y, n.z, -room]
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]
    #[test]
    fn a_sensor_passes_no_plane_by_more_than_documented(
        rows in prop::collection::vec(a_plane(), 1..6),
        gap in prop_oneof![Just(0.02), Just(0.1)],
        motions in prop::collection::vec((prop::array::uniform6(-1.0..1.0f64), 1..400usize), 1..12),
    ) {
        let mut chain = [
            limit(&format!("{rows:?}"), None).unwrap(),
            rig::<TwistLimit>(&format!("linear_m_per_s = {SPEED}\nangular_rad_per_s = {TURNING}"), &[]).unwrap(),
            rig::<AccelerationLimit>(
                &format!("linear_m_per_s2 = {ACCELERATION}\nangular_rad_per_s2 = {SPIN}"), &[],
            ).unwrap(),
        ];
        chain[0].tick.max_gap = gap;
        let bound = SPEED * f64::max(2.0 * TURNING / SPIN, 2.0 * SPEED / ACCELERATION);
        let (mut pose, mut command) = (IsometryMatrix3::identity(), Twist::default());
        for (motion, ticks) in motions {
            for _ in 0..ticks {
                let mut twist = Twist(motion.into());
                chain[0].set("pose", Pose(pose));
                for rig in &mut chain {
                    rig.set("twist", twist);
                    rig.step_ms(4.0);
                    twist = *rig.get::<Twist>("twist").unwrap();
                }
                // The arm follows the command one tick later.
                pose.translation.vector += pose.rotation * command.linear() * 0.004;
                pose.rotation *= Rotation3::new(command.angular() * 0.004);
                command = twist;
                for row in &rows {
                    let [x, y, z, d] = *row;
                    let past = d - Vector3::new(x, y, z).dot(&pose.translation.vector);
                    prop_assert!(past <= bound, "{past} m behind {row:?}, more than {bound} m");
                }
            }
        }
    }
}

#[test]
fn the_whole_capsule_stays_before_a_plane() {
    // The sensor is 0.1 m in front of the tip, and the tool reaches 0.05 m behind the tip. Its radius is 0.02 m.
    let tool = "mount = { xyz = [0.0, 0.0, 0.1] }\n\
                capsule = { ends_m = [[0.0, 0.0, -0.05], [0.0, 0.0, 0.1]], radius_m = 0.02 }";
    let params = format!("{BOX}\nkeep_out = [[0, 0, 1, -0.1]]\n{tool}");
    let mut rig = rig::<WorkspaceLimit>(&params, &[("pose", PoseShape::default().into())]).unwrap();
    // The far end is 0.15 m behind the sensor: with its radius it touches the plane when the sensor is at z = 0.07.
    for room in [0.001, 0.02] {
        let v = pass(&mut rig, [0.0, 0.0, 0.07 + room], [0.0, 0.0, -1.0]).norm();
        let delay = 2.0 * rig.tick.max_gap;
        let way = v * delay + v * v / 2.0;
        assert!((way - room).abs() < 1e-9, "{v} m/s with {room} m");
    }
    assert_eq!(pass(&mut rig, [0.0, 0.0, 0.07], [0.0, 0.0, -1.0]).norm(), 0.0);
    assert_eq!(pass(&mut rig, [0.0, 0.0, 0.05], [0.3, 0.0, 0.1]).norm(), Vector3::new(0.3, 0.0, 0.1).norm());
    // At the plane, a turn that brings the far end nearer is barred, and the way back is not.
    let tilted = Rotation3::from_axis_angle(&Vector3::x_axis(), 0.5);
    let end = tilted * Vector3::new(0.0, 0.0, -0.15);
    rig.set("pose", Pose(IsometryMatrix3::from_parts([0.0, 0.0, -0.08 - end.z].into(), tilted)));
    for (sign, passes) in [(1.0, false), (-1.0, true)] {
        rig.set("twist", Twist::new(Vector3::zeros(), Vector3::x() * sign * -0.5));
        rig.step();
        let turned = rig.get::<Twist>("twist").unwrap().angular().norm() > 1e-6;
        assert_eq!(turned, passes, "{sign}");
    }
}
