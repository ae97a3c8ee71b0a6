//! A chain from a robot's model: the part of a URDF between its root link and a named tip link.
//!
//! Revolute, continuous and prismatic joints move; fixed ones are merged into their neighbours; anything else is
//! refused. The base is the root link. A joint that the URDF does not bound (continuous, or an omitted limit of
//! URDF 1.2) is bounded at ±[`UNBOUNDED`], so that no arithmetic on limits meets an infinity; a joint without a
//! speed limit is refused, because a sink cannot limit it.

use std::collections::BTreeMap;

use nalgebra::{IsometryMatrix3, Vector3};
use tactflow_runtime::node::{FilePath, Mistake, Mistakes};
use tactflow_runtime::signal::Joint;
use urdf_rs::JointType;

use super::chain::{Chain, Motion, Segment};
use super::mount::{Mount, pose_of};

/// Position limit of a joint that has none [rad, or m].
pub const UNBOUNDED: f64 = 1e9;

/// What is wrong with a model.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Flaw {
    /// What is wrong.
    pub message: String,
    /// Where.
    pub at: Place,
}

/// The place of a flaw.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Place {
    /// The model as a whole.
    Model,
    /// The joint or link of that name.
    Name(String),
    /// The name of the tip, which is not the model's.
    Tip,
}

/// Reads the chain from the root of a URDF file to the sensor on its link `tip`, for a node or a device with
/// parameters `urdf`, `tip` and `mount`.
///
/// # Errors
/// What is wrong with the file, at its place, or with the tip.
pub fn load(urdf: &FilePath, tip: &str, mount: &Mount) -> Result<Chain, Mistakes> {
    let bytes = urdf.bytes()?;
    let text = str::from_utf8(&bytes).map_err(|error| {
        let text = String::from_utf8_lossy(&bytes);
        let at = error.valid_up_to();
        Mistake::data(urdf, &*text, at..at + 3, "this is not UTF-8 text")
    })?;
    chain_of(text, tip, mount).map_err(|flaw| {
        let mistake = match flaw.at {
            Place::Tip => Mistake::param("tip", flaw.message),
            Place::Model => Mistake::data(urdf, text, 0..0, flaw.message),
            Place::Name(name) => Mistake::data(urdf, text, find(text, &name), flaw.message),
        };
        mistake.into()
    })
}

/// The chain from the root of a URDF to the sensor on its link `tip`.
///
/// # Errors
/// What is wrong with the model or the tip.
pub fn chain_of(text: &str, tip: &str, mount: &Mount) -> Result<Chain, Flaw> {
    let robot = urdf_rs::read_from_string(text)
        .map_err(|error| flaw(Place::Model, format!("not a URDF: {}", one_line(&error.to_string()))))?;
    let mut segments = Vec::new();
    let mut fixed = IsometryMatrix3::identity();
    for joint in path_to(&robot, tip)? {
        fixed *= origin_of(joint)?;
        if joint.joint_type == JointType::Fixed {
            continue;
        }
        let segment = segment_of(joint, fixed)?;
        if segments.iter().any(|other: &Segment| other.joint.name == joint.name) {
            return Err(flaw(named(joint), format!("two joints are called `{}`", joint.name)));
        }
        segments.push(segment);
        fixed = IsometryMatrix3::identity();
    }
    if segments.is_empty() {
        return Err(flaw(Place::Tip, format!("no joint moves between the root and `{tip}`")));
    }
    Ok(Chain::new(segments, fixed * mount.pose()))
}

/// The joints from the root to the link `tip`.
fn path_to<'r>(robot: &'r urdf_rs::Robot, tip: &str) -> Result<Vec<&'r urdf_rs::Joint>, Flaw> {
    let is_link = |name: &str| robot.links.iter().any(|link| link.name == name);
    if !is_link(tip) {
        let links: Vec<String> = robot.links.iter().map(|link| format!("`{}`", link.name)).collect();
        return Err(flaw(Place::Tip, format!("the model has no link `{tip}`; it has {}", links.join(", "))));
    }
    let mut above = BTreeMap::new();
    for joint in &robot.joints {
        if let Some(link) = [&joint.parent.link, &joint.child.link].into_iter().find(|link| !is_link(link)) {
            let message = format!("joint `{}` holds on to link `{link}`, which the model does not have", joint.name);
            return Err(flaw(named(joint), message));
        }
        if above.insert(joint.child.link.as_str(), joint).is_some() {
            let message = format!("link `{}` hangs on two joints", joint.child.link);
            return Err(flaw(Place::Name(joint.child.link.clone()), message));
        }
    }
    let mut path = Vec::new();
    let mut link = tip;
    while let Some(joint) = above.get(link) {
        if path.len() == robot.joints.len() {
            return Err(flaw(Place::Name(link.into()), format!("the joints above link `{tip}` run in a circle")));
        }
        path.push(*joint);
        link = &joint.parent.link;
    }
    path.reverse();
    Ok(path)
}

fn segment_of(joint: &urdf_rs::Joint, fixed: IsometryMatrix3<f64>) -> Result<Segment, Flaw> {
    let bad = |what: &str| Err(flaw(named(joint), format!("joint `{}` {what}", joint.name)));
    let motion = match joint.joint_type {
        JointType::Revolute | JointType::Continuous => Motion::Revolute,
        JointType::Prismatic => Motion::Prismatic,
        JointType::Floating => {
            return bad("is floating, and a serial chain is made of revolute, continuous, prismatic and fixed joints");
        }
        JointType::Planar => {
            return bad("is planar, and a serial chain is made of revolute, continuous, prismatic and fixed joints");
        }
        _ => return bad("is of a type that a serial chain cannot have"),
    };
    if joint.mimic.is_some() {
        return bad("mimics another joint, which a serial chain cannot");
    }
    let axis = Vector3::from(joint.axis.xyz.0);
    if !(axis.norm() > 1e-6 && axis.norm().is_finite()) {
        return bad("has no axis");
    }
    let limit = &joint.limit;
    let (lower, upper) = match joint.joint_type {
        JointType::Continuous => (-UNBOUNDED, UNBOUNDED),
        _ => (limit.lower.max(-UNBOUNDED), limit.upper.min(UNBOUNDED)),
    };
    if limit.lower.is_nan() || limit.upper.is_nan() || lower >= upper {
        return bad("has no range: `<limit>` needs a `lower` that is less than its `upper`");
    }
    if !(limit.velocity > 0.0 && limit.velocity.is_finite()) {
        return bad("has no speed limit: `<limit>` needs a `velocity` greater than 0");
    }
    let joint = Joint { name: joint.name.clone(), lower, upper, speed: limit.velocity, ..Joint::default() };
    Ok(Segment { fixed, axis: axis.normalize(), motion, joint })
}

fn origin_of(joint: &urdf_rs::Joint) -> Result<IsometryMatrix3<f64>, Flaw> {
    let (xyz, rpy) = (joint.origin.xyz.0, joint.origin.rpy.0);
    if xyz.iter().chain(&rpy).any(|number| !number.is_finite()) {
        return Err(flaw(named(joint), format!("the origin of joint `{}` is not finite", joint.name)));
    }
    Ok(pose_of(xyz, rpy))
}

fn flaw(at: Place, message: String) -> Flaw {
    Flaw { message, at }
}

fn named(joint: &urdf_rs::Joint) -> Place {
    Place::Name(joint.name.clone())
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Where `name` is declared in the text.
fn find(text: &str, name: &str) -> std::ops::Range<usize> {
    let declared = [format!("name=\"{name}\""), format!("name='{name}'")];
    let at = declared.iter().find_map(|declared| Some(text.find(declared)? + "name=\"".len()));
    at.map_or(0..0, |at| at..at + name.len())
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::node::At;
    use tactflow_runtime::signal::Twist;

    use super::*;

    const LWR: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/robots/lwr4p.urdf");

    fn file(path: &str) -> FilePath {
        FilePath { path: path.into(), span: 3..7, builtin: None }
    }

    #[test]
    fn the_lwr_stretched_out_is_as_tall_as_its_links() {
        let chain = load(&file(LWR), "lwr_7_link", &Mount::NONE).unwrap();
        let mut columns = [Twist::default(); 7];
        let place = chain.forward(&[0.0; 7], &mut columns).0.translation.vector;
        assert!((place - Vector3::new(0.0, 0.0, 0.3105 + 0.4 + 0.39 + 0.078)).norm() < 1e-12, "{place}");
        // With the second joint at 90° the rest lies level, at the height of the shoulder; its axis is -y.
        let place = chain.forward(&[0.0, 90f64.to_radians(), 0.0, 0.0, 0.0, 0.0, 0.0], &mut columns).0.translation;
        assert!((place.vector - Vector3::new(-(0.4 + 0.39 + 0.078), 0.0, 0.3105)).norm() < 1e-12, "{place}");
        let degrees = [170.0, 120.0, 170.0, 120.0, 170.0, 120.0, 170.0f64];
        let speeds = [110.0, 110.0, 128.0, 128.0, 204.0, 184.0, 184.0f64];
        for ((joint, degrees), speed) in chain.joints().iter().zip(degrees).zip(speeds) {
            assert!((joint.upper - degrees.to_radians()).abs() < 1e-9 && joint.lower == -joint.upper, "{joint:?}");
            assert!((joint.speed - speed.to_radians()).abs() < 1e-9, "{joint:?}");
        }
    }

    const GANTRY: &str = r#"<robot name="gantry">
        <link name="root"/><link name="post"/><link name="sled"/><link name="hand"/><link name="spare"/>
        <joint name="up" type="fixed"><origin xyz="0 0 1" rpy="0 0 1.5707963267948966"/>
            <parent link="root"/><child link="post"/></joint>
        <joint name="slide" type="prismatic"><origin xyz="0 0 1"/><parent link="post"/><child link="sled"/>
            <axis xyz="2 0 0"/><limit lower="0" upper="0.5" effort="1" velocity="0.2"/></joint>
        <joint name="spin" type="continuous"><parent link="sled"/><child link="hand"/>
            <axis xyz="0 0 1"/><limit effort="1" velocity="3"/></joint>
    </robot>"#;

    #[test]
    fn slides_and_fixed_joints_and_a_mount() {
        let mount = Mount { xyz: [0.1, 0.0, 0.0], rpy: [0.0; 3] };
        let chain = chain_of(GANTRY, "hand", &mount).unwrap();
        let mut columns = [Twist::default(); 2];
        let place = chain.forward(&[0.25, 90f64.to_radians()], &mut columns).0.translation.vector;
        // The post turns x into y, the hand turns it on into -x.
        assert!((place - Vector3::new(-0.1, 0.25, 2.0)).norm() < 1e-12, "{place}");
        assert!((columns[0].0 - nalgebra::Vector6::new(0.0, 1.0, 0.0, 0.0, 0.0, 0.0)).norm() < 1e-12);
        let limits: Vec<(&str, f64, f64, f64)> =
            chain.joints().iter().map(|j| (j.name.as_str(), j.lower, j.upper, j.speed)).collect();
        assert_eq!(limits, [("slide", 0.0, 0.5, 0.2), ("spin", -UNBOUNDED, UNBOUNDED, 3.0)]);
    }

    #[test]
    fn bad_models_say_what_is_wrong_and_where() {
        let edits = [
            ("<robot", "<bot", "hand", Place::Model, "not a URDF: "),
            ("velocity=\"0.2\"", "", "hand", Place::Model, "not a URDF: "),
            ("2 0 0", "2 0", "hand", Place::Model, "not a URDF: "),
            (
                "",
                "",
                "claw",
                Place::Tip,
                "the model has no link `claw`; it has `root`, `post`, `sled`, `hand`, `spare`",
            ),
            ("", "", "spare", Place::Tip, "no joint moves between the root and `spare`"),
            ("", "", "post", Place::Tip, "no joint moves between the root and `post`"),
            ("prismatic", "planar", "hand", Place::Name("slide".into()), "joint `slide` is planar"),
            ("continuous", "floating", "hand", Place::Name("spin".into()), "joint `spin` is floating"),
            ("2 0 0", "0 0 0", "hand", Place::Name("slide".into()), "joint `slide` has no axis"),
            ("0.5", "0", "hand", Place::Name("slide".into()), "joint `slide` has no range"),
            ("0.5", "nan", "hand", Place::Name("slide".into()), "joint `slide` has no range"),
            ("0.2", "0", "hand", Place::Name("slide".into()), "joint `slide` has no speed limit"),
            ("0.2", "inf", "hand", Place::Name("slide".into()), "joint `slide` has no speed limit"),
            (
                "<limit effort=\"1\" velocity=\"3\"/>",
                "",
                "hand",
                Place::Name("spin".into()),
                "joint `spin` has no speed limit",
            ),
            (
                "0 0 1\" rpy",
                "0 0 inf\" rpy",
                "hand",
                Place::Name("up".into()),
                "the origin of joint `up` is not finite",
            ),
            (
                "link=\"post\"/><child link=\"sled\"",
                "link=\"pole\"/><child link=\"sled\"",
                "hand",
                Place::Name("slide".into()),
                "joint `slide` holds on to link `pole`",
            ),
            (
                "child link=\"post\"",
                "child link=\"hand\"",
                "hand",
                Place::Name("hand".into()),
                "link `hand` hangs on two joints",
            ),
            (
                "parent link=\"root\"",
                "parent link=\"hand\"",
                "hand",
                Place::Name("hand".into()),
                "the joints above link `hand` run in a circle",
            ),
            ("name=\"spin\"", "name=\"slide\"", "hand", Place::Name("slide".into()), "two joints are called `slide`"),
            (
                "<axis xyz=\"0 0 1\"/>",
                "<mimic joint=\"slide\"/>",
                "hand",
                Place::Name("spin".into()),
                "joint `spin` mimics",
            ),
        ];
        for (from, to, tip, at, message) in edits {
            assert!(GANTRY.contains(from));
            let flaw = chain_of(&GANTRY.replacen(from, to, 1), tip, &Mount::NONE).expect_err(message);
            assert!(flaw.message.starts_with(message) && flaw.at == at, "{from} -> {to}: {flaw:?}");
        }
    }

    #[test]
    fn a_flaw_is_shown_where_the_joint_is_declared() {
        assert_eq!(&GANTRY[find(GANTRY, "slide")], "slide");
        let missing = load(&file("nowhere.urdf"), "hand", &Mount::NONE).unwrap_err();
        assert!(missing[0].at == At::Span(3..7) && missing[0].message.starts_with("cannot read `nowhere.urdf`"));
        let tip = load(&file(LWR), "hand", &Mount::NONE).unwrap_err();
        assert_eq!(tip[0].at, At::Param("tip".into()));
    }
}
