//! Reads a kinematic chain from a robot model: the part of a URDF between its root link and a named tip link.
//!
//! Revolute, continuous and prismatic joints move. Fixed joints are merged into their neighbours. Other joints are
//! errors. The base is the root link. A joint without position limits (continuous, or an omitted limit of URDF 1.2)
//! gets the limits ±[`UNBOUNDED`], so that computations with limits stay finite. A joint without a speed limit is an
//! error, because its velocity could not be limited.

use std::collections::BTreeMap;

use nalgebra::{IsometryMatrix3, Vector3};
use tactflow_runtime::node::{FilePath, Mistake, Mistakes};
use tactflow_runtime::signal::Joint;
use urdf_rs::{JointType, Robot};

use super::chain::{Chain, ChainSegment, JointKind};
use super::mount::Mount;
use crate::motion::pose::pose_of;
use crate::usual::USUAL_RAD;

/// Position limit of a joint without one [rad; m for a prismatic joint].
pub const UNBOUNDED: f64 = 1e9;
/// Speed that no joint of an arm has [rad/s; m/s for a prismatic joint]. A greater one is in another unit, and the arm
/// would take many seconds to stop from it.
const MAX_SPEED: f64 = 50.0;
/// Length that no link of an arm has [m].
const MAX_LENGTH: f64 = 10.0;

/// Reads the chain from the root of a URDF file to the sensor on its link `tip`, for a node or a device with the
/// parameters `urdf`, `tip` and `mount`.
///
/// # Errors
/// If the file cannot be read or is not a serial chain up to `tip`. The mistake marks the place in the file.
pub fn load(urdf: &FilePath, tip: &str, mount: &Mount) -> Result<Chain, Mistakes> {
    let bytes = urdf.bytes()?;
    let text = str::from_utf8(&bytes).map_err(|error| {
        let text = String::from_utf8_lossy(&bytes);
        let at = error.valid_up_to();
        Mistake::data(urdf, &*text, at..at + 3, "this is not UTF-8 text")
    })?;
    let robot = urdf_rs::read_from_string(text)
        .map_err(|error| Mistake::data(urdf, text, 0..0, format!("not a URDF: {}", one_line(&error.to_string()))))?;
    Ok(Model { file: urdf, text, robot }.chain(tip, mount)?)
}

/// A robot model, and the file that it was read from.
struct Model<'m> {
    file: &'m FilePath,
    text: &'m str,
    robot: Robot,
}

impl Model<'_> {
    /// Returns a mistake at the declaration of a joint or a link.
    fn mistake(&self, name: &str, message: String) -> Mistake {
        Mistake::data(self.file, self.text, find(self.text, name), message)
    }

    /// Returns the chain from the root to the sensor on the link `tip`.
    fn chain(&self, tip: &str, mount: &Mount) -> Result<Chain, Mistake> {
        let mut segments = Vec::new();
        let mut fixed = IsometryMatrix3::identity();
        for joint in self.path_to(tip)? {
            fixed *= self.origin_of(joint)?;
            if joint.joint_type == JointType::Fixed {
                continue;
            }
            let segment = self.segment_of(joint, fixed)?;
            if segments.iter().any(|other: &ChainSegment| other.joint.name == joint.name) {
                return Err(self.mistake(&joint.name, format!("two joints have the name `{}`", joint.name)));
            }
            segments.push(segment);
            fixed = IsometryMatrix3::identity();
        }
        if segments.is_empty() {
            return Err(Mistake::param("tip", format!("no joint moves between the root and `{tip}`")));
        }
        Ok(Chain::new(segments, fixed * mount.pose()))
    }

    /// Returns the joints from the root to the link `tip`.
    fn path_to(&self, tip: &str) -> Result<Vec<&urdf_rs::Joint>, Mistake> {
        let robot = &self.robot;
        let is_link = |name: &str| robot.links.iter().any(|link| link.name == name);
        if !is_link(tip) {
            let links = robot.links.iter().map(|link| link.name.as_str());
            return Err(Mistake::param("tip", format!("the model has no link `{tip}`")).suggest(tip, links, "links"));
        }
        let mut above = BTreeMap::new();
        for joint in &robot.joints {
            if let Some(link) = [&joint.parent.link, &joint.child.link].into_iter().find(|link| !is_link(link)) {
                let message = format!("joint `{}` refers to link `{link}`, which the model does not have", joint.name);
                return Err(self.mistake(&joint.name, message));
            }
            if above.insert(joint.child.link.as_str(), joint).is_some() {
                let message = format!("link `{}` is the child of two joints", joint.child.link);
                return Err(self.mistake(&joint.child.link, message));
            }
        }
        let mut path = Vec::new();
        let mut link = tip;
        while let Some(joint) = above.get(link) {
            if path.len() == robot.joints.len() {
                return Err(self.mistake(link, format!("the joints above link `{tip}` form a cycle")));
            }
            path.push(*joint);
            link = &joint.parent.link;
        }
        path.reverse();
        Ok(path)
    }

    fn segment_of(&self, joint: &urdf_rs::Joint, fixed: IsometryMatrix3<f64>) -> Result<ChainSegment, Mistake> {
        let bad = |what: &str| Err(self.mistake(&joint.name, format!("joint `{}` {what}", joint.name)));
        let motion = match joint.joint_type {
            JointType::Revolute | JointType::Continuous => JointKind::Revolute,
            JointType::Prismatic => JointKind::Prismatic,
            JointType::Floating => {
                return bad(
                    "is floating, but a serial chain has only revolute, continuous, prismatic and fixed joints",
                );
            }
            JointType::Planar => {
                return bad("is planar, but a serial chain has only revolute, continuous, prismatic and fixed joints");
            }
            _ => return bad("has a type that is not supported"),
        };
        if joint.mimic.is_some() {
            return bad("mimics another joint, which is not supported");
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
        if limit.velocity > MAX_SPEED {
            let (speed, converted) = (limit.velocity, six_digits(limit.velocity.to_radians()));
            return bad(&format!(
                "has a speed of {speed} rad/s (m/s if prismatic), which no arm has: if it is in degrees, write \
                 `velocity=\"{converted}\"`"
            ));
        }
        let joint = Joint { name: joint.name.clone(), lower, upper, speed: limit.velocity, ..Joint::default() };
        Ok(ChainSegment { fixed, axis: axis.normalize(), motion, joint })
    }

    fn origin_of(&self, joint: &urdf_rs::Joint) -> Result<IsometryMatrix3<f64>, Mistake> {
        let (xyz, rpy) = (joint.origin.xyz.0, joint.origin.rpy.0);
        if xyz.iter().chain(&rpy).any(|number| !number.is_finite()) {
            return Err(self.mistake(&joint.name, format!("the origin of joint `{}` is not finite", joint.name)));
        }
        if let Some(length) = xyz.iter().find(|length| length.abs() > MAX_LENGTH) {
            let message = format!(
                "the origin of joint `{}` is {length} m away: `xyz` of a URDF is in m; if this is in mm, write `{}`",
                joint.name,
                six_digits(length * 1e-3)
            );
            return Err(self.mistake(&joint.name, message));
        }
        if let Some(angle) = rpy.iter().find(|angle| angle.abs() > USUAL_RAD) {
            let message = format!(
                "the origin of joint `{}` is turned by {angle} rad: `rpy` of a URDF is in rad; if this is in degrees, \
                 write `{}`",
                joint.name,
                six_digits(angle.to_radians())
            );
            return Err(self.mistake(&joint.name, message));
        }
        Ok(pose_of(xyz, rpy))
    }
}

/// Rounds a number for a message.
fn six_digits(number: f64) -> f64 {
    (number * 1e6).round() / 1e6
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Returns where `name` is declared in the text; an empty range at the start if it is not found.
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

    fn load_text(text: &str, tip: &str, mount: &Mount) -> Result<Chain, Mistakes> {
        let bytes = Some(text.as_bytes().to_vec().into());
        load(&FilePath { builtin: bytes, ..file("gantry.urdf") }, tip, mount)
    }

    #[test]
    fn the_stretched_lwr_is_as_tall_as_the_sum_of_its_links() {
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
    fn prismatic_and_fixed_joints_and_a_mount() {
        let mount = Mount { xyz: [0.1, 0.0, 0.0], rpy: [0.0; 3] };
        let chain = load_text(GANTRY, "hand", &mount).unwrap();
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
    fn every_bad_model_gives_its_message_and_place() {
        // The place is the text that is marked in the model, or the parameter.
        let edits = [
            ("<robot", "<bot", "hand", "", "not a URDF: "),
            ("velocity=\"0.2\"", "", "hand", "", "not a URDF: "),
            ("2 0 0", "2 0", "hand", "", "not a URDF: "),
            ("", "", "claw", "param tip", "the model has no link `claw`"),
            ("", "", "spare", "param tip", "no joint moves between the root and `spare`"),
            ("", "", "post", "param tip", "no joint moves between the root and `post`"),
            ("prismatic", "planar", "hand", "slide", "joint `slide` is planar"),
            ("continuous", "floating", "hand", "spin", "joint `spin` is floating"),
            ("2 0 0", "0 0 0", "hand", "slide", "joint `slide` has no axis"),
            ("0.5", "0", "hand", "slide", "joint `slide` has no range"),
            ("0.5", "nan", "hand", "slide", "joint `slide` has no range"),
            ("0.2", "0", "hand", "slide", "joint `slide` has no speed limit"),
            ("0.2", "inf", "hand", "slide", "joint `slide` has no speed limit"),
            ("<limit effort=\"1\" velocity=\"3\"/>", "", "hand", "spin", "joint `spin` has no speed limit"),
            ("0 0 1\" rpy", "0 0 inf\" rpy", "hand", "up", "the origin of joint `up` is not finite"),
            ("velocity=\"3\"", "velocity=\"180\"", "hand", "spin", "joint `spin` has a speed of 180 rad/s"),
            ("0 0 1\" rpy", "0 0 162.5\" rpy", "hand", "up", "the origin of joint `up` is 162.5 m away"),
            ("1.5707963267948966", "90", "hand", "up", "the origin of joint `up` is turned by 90 rad"),
            (
                "link=\"post\"/><child link=\"sled\"",
                "link=\"pole\"/><child link=\"sled\"",
                "hand",
                "slide",
                "joint `slide` refers to link `pole`",
            ),
            ("child link=\"post\"", "child link=\"hand\"", "hand", "hand", "link `hand` is the child of two joints"),
            (
                "parent link=\"root\"",
                "parent link=\"hand\"",
                "hand",
                "hand",
                "the joints above link `hand` form a cycle",
            ),
            ("name=\"spin\"", "name=\"slide\"", "hand", "slide", "two joints have the name `slide`"),
            ("<axis xyz=\"0 0 1\"/>", "<mimic joint=\"slide\"/>", "hand", "spin", "joint `spin` mimics"),
        ];
        for (from, to, tip, at, message) in edits {
            assert!(GANTRY.contains(from));
            let mistake = &load_text(&GANTRY.replacen(from, to, 1), tip, &Mount::NONE).expect_err(message)[0];
            let place = match &mistake.at {
                At::Data { text, span, .. } => text[span.clone()].to_owned(),
                At::Param(name) => format!("param {name}"),
                other => panic!("{other:?}"),
            };
            assert!(mistake.message.starts_with(message) && place == at, "{from} -> {to}: {mistake:?}");
        }
    }

    #[test]
    fn an_error_marks_the_declaration_of_the_joint() {
        assert_eq!(&GANTRY[find(GANTRY, "slide")], "slide");
        let missing = load(&file("nowhere.urdf"), "hand", &Mount::NONE).unwrap_err();
        assert!(missing[0].at == At::Span(3..7) && missing[0].message.starts_with("cannot read `nowhere.urdf`"));
        let tip = load(&file(LWR), "hand", &Mount::NONE).unwrap_err();
        assert_eq!(tip[0].at, At::Param("tip".into()));
    }
}
