//! The messages of the bridge: what a simulator says, checked field by field, and what it is told.

use nalgebra::{Matrix3, Vector3};

use super::json::{Json, object, quoted};
use crate::arm::mount::Mount;

/// The version of the protocol that is spoken here.
const PROTO: f64 = 1.0;
/// The most tactels that fit into a line.
const MOST: f64 = 500_000.0;
/// How far the rotation of `T_es` may be from one: simulators print few digits.
const TOLERANCE: f64 = 1e-4;

/// The first message of a simulator.
#[derive(Debug, Clone)]
pub(super) struct Hello {
    /// Time between two frames [s].
    pub(super) dt: f64,
    /// Whether the simulator waits for each command.
    pub(super) is_lockstep: bool,
    pub(super) joints: Vec<String>,
    /// Least and greatest positions [rad], and greatest speeds [rad/s].
    pub(super) q_min: Vec<f64>,
    pub(super) q_max: Vec<f64>,
    pub(super) dq_max: Vec<f64>,
    pub(super) urdf: String,
    pub(super) tip: String,
    /// Pose of the sensor on the tip.
    pub(super) mount: Mount,
    pub(super) rows: usize,
    pub(super) cols: usize,
    pub(super) pitch: f64,
    pub(super) counts_per_unit: f64,
    pub(super) newton_per_unit: f64,
    pub(super) threshold_units: f64,
}

/// A frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Obs {
    pub(super) seq: u64,
    /// Time of the simulator [s].
    pub(super) t: f64,
    pub(super) q: Vec<f64>,
    pub(super) q_eq: Vec<f64>,
    pub(super) img: Vec<f64>,
}

/// What a simulator says after its hello.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Message {
    Obs(Obs),
    End,
}

/// The sizes that a frame has to have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Sizes {
    pub(super) joints: usize,
    pub(super) rows: usize,
    pub(super) cols: usize,
}

/// The fields of a message.
struct Fields(Vec<(String, Json)>);

impl Fields {
    fn get(&self, name: &str) -> Result<&Json, String> {
        let field = self.0.iter().find(|(known, _)| known == name);
        field.map(|(_, value)| value).ok_or_else(|| format!("`{name}` is missing"))
    }

    fn number(&self, name: &str) -> Result<f64, String> {
        match self.get(name)? {
            Json::Number(number) if number.is_finite() => Ok(*number),
            Json::Number(number) => Err(format!("`{name}` is {number}, and not finite")),
            other => Err(format!("`{name}` is {}, and not a number", other.described())),
        }
    }

    /// A number greater than 0.
    fn positive(&self, name: &str) -> Result<f64, String> {
        let number = self.number(name)?;
        if number > 0.0 { Ok(number) } else { Err(format!("`{name}` is {number}, and has to be greater than 0")) }
    }

    /// A whole number from `least` to `most`.
    fn whole(&self, name: &str, least: f64, most: f64) -> Result<u64, String> {
        let number = self.number(name)?;
        let is_good = number.fract() == 0.0 && (least..=most).contains(&number);
        if is_good {
            Ok(number as u64)
        } else {
            Err(format!("`{name}` is {number}, and not a whole number from {least}"))
        }
    }

    fn flag(&self, name: &str) -> Result<bool, String> {
        match self.get(name)? {
            Json::Flag(flag) => Ok(*flag),
            other => Err(format!("`{name}` is {}, and neither true nor false", other.described())),
        }
    }

    fn text(&self, name: &str) -> Result<&str, String> {
        match self.get(name)? {
            Json::Text(text) => Ok(text),
            other => Err(format!("`{name}` is {}, and not a text", other.described())),
        }
    }

    fn list(&self, name: &str) -> Result<&[Json], String> {
        match self.get(name)? {
            Json::List(items) => Ok(items),
            other => Err(format!("`{name}` is {}, and not a list", other.described())),
        }
    }

    /// A list of finite numbers, as long as `has` says, which is `count`.
    fn numbers(&self, name: &str, count: usize, has: impl Fn() -> String) -> Result<Vec<f64>, String> {
        let items = self.list(name)?;
        if items.len() != count {
            return Err(format!("`{name}` has {} numbers, but {}", items.len(), has()));
        }
        let number = |(i, item): (usize, &Json)| match item {
            Json::Number(number) if number.is_finite() => Ok(*number),
            Json::Number(number) => Err(format!("number {} of `{name}` is {number}, and not finite", i + 1)),
            other => Err(format!("entry {} of `{name}` is {}, and not a number", i + 1, other.described())),
        };
        items.iter().enumerate().map(number).collect()
    }
}

/// Reads a hello.
///
/// # Errors
/// What is wrong, with its field.
pub(super) fn hello(line: &str) -> Result<Hello, String> {
    let fields = Fields(object(line)?);
    match fields.text("type")? {
        "hello" => {}
        other => return Err(format!("the first message is of type `{other}`, and not a hello")),
    }
    let proto = fields.number("proto")?;
    if proto != PROTO {
        return Err(format!("`proto` is {proto}, but the protocol that is spoken here is {PROTO}"));
    }
    fields.text("task")?;
    let joints = names(fields.list("joints")?)?;
    let per_joint = |name: &str| fields.numbers(name, joints.len(), || format!("there are {} `joints`", joints.len()));
    let (q_min, q_max, dq_max) = (per_joint("q_min")?, per_joint("q_max")?, per_joint("dq_max")?);
    for (i, name) in joints.iter().enumerate() {
        if q_min[i] >= q_max[i] {
            return Err(format!(
                "`q_min` of joint `{name}` is {}, and not less than its `q_max` of {}",
                q_min[i], q_max[i]
            ));
        }
        if dq_max[i] <= 0.0 {
            return Err(format!("`dq_max` of joint `{name}` is {}, and has to be greater than 0", dq_max[i]));
        }
    }
    let threshold_units = fields.number("threshold_units")?;
    if threshold_units < 0.0 {
        return Err(format!("`threshold_units` is {threshold_units}, and cannot be less than 0"));
    }
    let (rows, cols) = (fields.whole("rows", 1.0, MOST)?, fields.whole("cols", 1.0, MOST)?);
    if rows * cols > MOST as u64 {
        return Err(format!(
            "`rows` and `cols` make {rows}x{cols} tactels, and more than {MOST} do not fit into a line"
        ));
    }
    Ok(Hello {
        dt: fields.positive("dt")?,
        is_lockstep: fields.flag("lockstep")?,
        q_min,
        q_max,
        dq_max,
        urdf: fields.text("urdf")?.to_owned(),
        tip: fields.text("tip")?.to_owned(),
        mount: mount(&fields.numbers("T_es", 16, || "a 4x4 matrix has 16".into())?)?,
        rows: rows as usize,
        cols: cols as usize,
        pitch: fields.positive("pitch")?,
        counts_per_unit: fields.positive("counts_per_unit")?,
        newton_per_unit: fields.positive("newton_per_unit")?,
        threshold_units,
        joints,
    })
}

fn names(list: &[Json]) -> Result<Vec<String>, String> {
    let mut names: Vec<String> = Vec::new();
    for (i, item) in list.iter().enumerate() {
        let Json::Text(name) = item else {
            return Err(format!("entry {} of `joints` is {}, and not a name", i + 1, item.described()));
        };
        if name.is_empty() || names.contains(name) {
            return Err(format!("entry {} of `joints` is `{name}`: each joint needs a name of its own", i + 1));
        }
        names.push(name.clone());
    }
    if names.is_empty() { Err("`joints` names none".into()) } else { Ok(names) }
}

/// The place of the sensor from a matrix, row after row.
fn mount(m: &[f64]) -> Result<Mount, String> {
    let rotation = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    if (0..4).any(|i| (m[12 + i] - [0.0, 0.0, 0.0, 1.0][i]).abs() > TOLERANCE) {
        return Err("`T_es` is no pose: its last row is not 0, 0, 0, 1; it is row-major, flange to sensor".into());
    }
    let error = (rotation.transpose() * rotation - Matrix3::identity()).amax();
    // A product that overflows is no rotation.
    if error.is_nan() || error > TOLERANCE {
        return Err(format!(
            "`T_es` is no pose: its rotation is off by {error:.1e} from one that keeps lengths and angles"
        ));
    }
    if rotation.determinant() < 0.0 {
        return Err("`T_es` is no pose: its rotation mirrors, and its axes have to be right-handed".into());
    }
    Ok(Mount { xyz: [m[3], m[7], m[11]], rpy: rpy(&rotation) })
}

/// Roll, pitch and yaw of a rotation, Rz(yaw) Ry(pitch) Rx(roll) [rad]. Roll and pitch are read after the yaw is taken
/// out, so that they make up for it where it is of no meaning, at a pitch of a quarter turn and near it.
fn rpy(rotation: &Matrix3<f64>) -> [f64; 3] {
    let r = |i, j| rotation[(i, j)];
    let yaw = libm::atan2(r(1, 0), r(0, 0));
    let (sin, cos) = libm::sincos(yaw);
    let across: Vector3<f64> =
        Vector3::new(cos * r(0, 0) + sin * r(1, 0), cos * r(1, 1) - sin * r(0, 1), sin * r(0, 2) - cos * r(1, 2));
    [libm::atan2(across[2], across[1]), libm::atan2(-r(2, 0), across[0]), yaw]
}

/// Reads what comes after the hello.
///
/// # Errors
/// What is wrong, with its field and the frame's number where that is known.
pub(super) fn message(line: &str, sizes: Sizes) -> Result<Message, String> {
    let fields = Fields(object(line)?);
    match fields.text("type")? {
        "obs" => {}
        "end" => return Ok(Message::End),
        other => return Err(format!("a message is of type `{other}`, and neither `obs` nor `end`")),
    }
    /// The greatest whole number that every writer of JSON can write.
    const LAST: f64 = 9_007_199_254_740_991.0;
    let seq = fields.whole("seq", 0.0, LAST)?;
    obs(&fields, seq, sizes).map(Message::Obs).map_err(|why| format!("obs {seq}: {why}"))
}

fn obs(fields: &Fields, seq: u64, Sizes { joints, rows, cols }: Sizes) -> Result<Obs, String> {
    let per_joint = |name: &str| fields.numbers(name, joints, || format!("the arm has {joints} joints"));
    let t = fields.number("t")?;
    let (q, _, q_eq) = (per_joint("q")?, per_joint("dq")?, per_joint("q_eq")?);
    let img = fields.numbers("img", rows * cols, || format!("the pad has {rows}x{cols} = {}", rows * cols))?;
    match img.iter().position(|counts| !(*counts as f32).is_finite()) {
        Some(i) => Err(format!("number {} of `img` is {:e}, and too large", i + 1, img[i])),
        None => Ok(Obs { seq, t, q, q_eq, img }),
    }
}

/// The number of a frame, if it can be read at all; an end has none.
pub(super) fn seq_of(line: &str) -> Option<u64> {
    let fields = Fields(object(line).ok()?);
    fields.whole("seq", 0.0, 2.0f64.powi(53)).ok()
}

/// A command, as a line.
pub(super) fn cmd(seq: u64, dq: &[f64], est: Option<[f64; 3]>) -> String {
    let est = est.map_or_else(|| "null".to_owned(), |est| list(&est));
    format!("{{\"type\":\"cmd\",\"seq\":{seq},\"dq\":{},\"est\":{est}}}\n", list(dq))
}

/// The end, as a line.
pub(super) fn end(reason: &str) -> String {
    format!("{{\"type\":\"end\",\"reason\":{}}}\n", quoted(reason))
}

fn list(numbers: &[f64]) -> String {
    format!("[{}]", numbers.iter().map(|number| format!("{number:?}")).collect::<Vec<_>>().join(","))
}

#[cfg(test)]
mod tests;
