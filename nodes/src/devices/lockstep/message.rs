//! The messages of the lockstep protocol: those of a simulator are read and checked, those to it are written.
//!
//! JSON has no `NaN` and no infinity, so every number that is read is finite. An error names the field and the element,
//! as `img[7]`, and where the text is wrong, the byte.

use nalgebra::{Matrix3, Vector3};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};

use crate::arm::mount::Mount;

/// Version of the protocol.
const PROTO: f64 = 1.0;
/// Maximum number of tactels that fit into a line.
const MAX_TACTELS: usize = 500_000;
/// Maximum error of the rotation of `T_es`: simulators print few digits.
const MAX_ROTATION_ERROR: f64 = 1e-4;
/// Maximum integer that every writer of JSON writes exactly.
const MAX_INTEGER: f64 = 9_007_199_254_740_991.0;

/// The first message of a simulator.
#[derive(Debug, Clone, Deserialize)]
#[serde(expecting = "a JSON object")]
pub(super) struct Hello {
    #[serde(rename = "type")]
    _type: HelloType,
    #[serde(rename = "proto", deserialize_with = "version")]
    _proto: f64,
    #[serde(rename = "task")]
    _task: String,
    /// Time between two frames [s].
    #[serde(deserialize_with = "positive")]
    pub(super) dt: f64,
    /// Whether the simulator waits for each command.
    #[serde(rename = "lockstep")]
    pub(super) is_lockstep: bool,
    #[serde(deserialize_with = "names")]
    pub(super) joints: Vec<String>,
    /// Minimum positions [rad].
    pub(super) q_min: Vec<f64>,
    /// Maximum positions [rad].
    pub(super) q_max: Vec<f64>,
    /// Maximum speeds [rad/s].
    pub(super) dq_max: Vec<f64>,
    pub(super) urdf: String,
    pub(super) tip: String,
    /// Pose of the sensor on the tip.
    #[serde(rename = "T_es", deserialize_with = "mount")]
    pub(super) mount: Mount,
    #[serde(deserialize_with = "size")]
    pub(super) rows: usize,
    #[serde(deserialize_with = "size")]
    pub(super) cols: usize,
    /// Distance between the centres of two tactels [m].
    #[serde(deserialize_with = "positive")]
    pub(super) pitch: f64,
    #[serde(deserialize_with = "positive")]
    pub(super) counts_per_unit: f64,
    #[serde(deserialize_with = "positive")]
    pub(super) newton_per_unit: f64,
    #[serde(deserialize_with = "not_negative")]
    pub(super) threshold_units: f64,
}

#[derive(Debug, Clone, Deserialize)]
#[serde(rename_all = "lowercase")]
enum HelloType {
    Hello,
}

/// A frame.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(expecting = "a JSON object")]
pub(super) struct Obs {
    #[serde(rename = "type")]
    _type: FrameType,
    #[serde(deserialize_with = "number_of_frame")]
    pub(super) seq: u64,
    /// Time of the simulator [s].
    pub(super) t: f64,
    pub(super) q: Vec<f64>,
    dq: Vec<f64>,
    pub(super) q_eq: Vec<f64>,
    pub(super) img: Vec<f64>,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum FrameType {
    Obs,
    End,
}

/// Reads a hello.
///
/// # Errors
/// What is wrong, with its field.
pub(super) fn hello(line: &str) -> Result<Hello, String> {
    let hello: Hello = parse(line)?;
    let Hello { joints, q_min, q_max, dq_max, rows, cols, .. } = &hello;
    for (name, numbers) in [("q_min", q_min), ("q_max", q_max), ("dq_max", dq_max)] {
        check_length(name, numbers, joints.len(), || format!("there are {} `joints`", joints.len()))?;
    }
    for (i, name) in joints.iter().enumerate() {
        let (lower, upper, speed) = (q_min[i], q_max[i], dq_max[i]);
        if lower >= upper {
            return Err(format!(
                "`q_min` of joint `{name}` is {lower} rad, which is not less than its `q_max` of {upper} rad"
            ));
        }
        if speed <= 0.0 {
            return Err(format!("`dq_max` of joint `{name}` is {speed} rad/s, which is not greater than 0"));
        }
    }
    if rows * cols > MAX_TACTELS {
        let message = format!("`rows` and `cols` make {rows}x{cols} tactels, but the maximum is {MAX_TACTELS}");
        return Err(message);
    }
    Ok(hello)
}

/// Reads a message after the `hello`: a frame, or `None` for the end of the run.
///
/// # Errors
/// What is wrong, with its field and, where the line is JSON, with the number of the frame.
pub(super) fn message(line: &str, hello: &Hello) -> Result<Option<Obs>, String> {
    #[derive(Deserialize)]
    struct Tag {
        r#type: FrameType,
    }
    if parse(line).is_ok_and(|tag: Tag| tag.r#type == FrameType::End) {
        return Ok(None);
    }
    let obs = parse(line).and_then(|obs| check_sizes(obs, hello));
    obs.map(Some).map_err(|why| match seq_of(line) {
        Some(seq) => format!("obs {seq}: {why}"),
        None => why,
    })
}

fn check_sizes(obs: Obs, hello: &Hello) -> Result<Obs, String> {
    let Hello { rows, cols, .. } = hello;
    let joints = hello.joints.len();
    for (name, numbers) in [("q", &obs.q), ("dq", &obs.dq), ("q_eq", &obs.q_eq)] {
        check_length(name, numbers, joints, || format!("the arm has {joints} joints"))?;
    }
    check_length("img", &obs.img, rows * cols, || format!("the pad has {rows}x{cols} = {}", rows * cols))?;
    match obs.img.iter().position(|counts| !(*counts as f32).is_finite()) {
        Some(i) => Err(format!("`img[{i}]` is {:e}, which is too large", obs.img[i])),
        None => Ok(obs),
    }
}

fn check_length(name: &str, numbers: &[f64], count: usize, reason: impl Fn() -> String) -> Result<(), String> {
    if numbers.len() == count {
        return Ok(());
    }
    Err(format!("`{name}` has {} numbers, but {}", numbers.len(), reason()))
}

/// Returns the number of a frame, or `None` if the line is not JSON or has none.
pub(super) fn seq_of(line: &str) -> Option<u64> {
    #[derive(Deserialize)]
    struct Seq {
        #[serde(deserialize_with = "number_of_frame")]
        seq: u64,
    }
    parse(line).map(|Seq { seq }| seq).ok()
}

/// Reads a line of JSON.
///
/// # Errors
/// What is wrong, with the field where it is.
fn parse<'l, T: Deserialize<'l>>(line: &'l str) -> Result<T, String> {
    let mut json = serde_json::Deserializer::from_str(line);
    let value = serde_path_to_error::deserialize(&mut json).map_err(|error| {
        let (path, why) = (error.path().to_string(), describe(line, error.inner()));
        if path == "." { why } else { format!("`{path}`: {why}") }
    })?;
    json.end().map(|()| value).map_err(|error| describe(line, &error))
}

/// Describes an error with the text it is about, instead of line and column.
fn describe(line: &str, error: &serde_json::Error) -> String {
    const MAX_SHOWN: usize = 12;
    let text = error.to_string();
    let what = text.split(" at line ").next().unwrap_or_default();
    if !error.is_syntax() {
        return what.replace("EOF while", "the line ends while");
    }
    let (before, after) = line.as_bytes().split_at(error.column().saturating_sub(1).min(line.len()));
    let is_end = |byte: &u8| b" \t,:[]{}".contains(byte);
    let start = before.iter().rposition(is_end).map_or(0, |end| end + 1);
    let length = after.iter().position(is_end).unwrap_or(after.len()).max(1);
    let token = String::from_utf8_lossy(&line.as_bytes()[start..line.len().min(before.len() + length)]);
    let token: String = token.chars().take(MAX_SHOWN).collect();
    format!("{what} at byte {}, found `{}`", start + 1, token.replace(char::is_control, "?"))
}

/// Reads a value that a check turns into another, or refuses.
fn checked<'de, D: Deserializer<'de>, T: Deserialize<'de>, U>(
    from: D,
    check: impl FnOnce(T) -> Result<U, String>,
) -> Result<U, D::Error> {
    T::deserialize(from).and_then(|value| check(value).map_err(D::Error::custom))
}

/// Reads a number for which a condition holds.
fn number<'de, D: Deserializer<'de>>(from: D, what: &str, holds: impl FnOnce(f64) -> bool) -> Result<f64, D::Error> {
    checked(from, |number| if holds(number) { Ok(number) } else { Err(format!("{number} is not {what}")) })
}

fn version<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    number(from, &format!("the supported protocol version, {PROTO}"), |proto| proto == PROTO)
}

fn positive<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    number(from, "greater than 0", |number| number > 0.0)
}

fn not_negative<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    number(from, "0 or greater", |number| number >= 0.0)
}

/// Integers and floats are both numbers: `17.0` is a whole number too.
fn size<'de, D: Deserializer<'de>>(from: D) -> Result<usize, D::Error> {
    let is_size = |number: f64| number.fract() == 0.0 && (1.0..=MAX_TACTELS as f64).contains(&number);
    number(from, &format!("a whole number from 1 to {MAX_TACTELS}"), is_size).map(|number| number as usize)
}

fn number_of_frame<'de, D: Deserializer<'de>>(from: D) -> Result<u64, D::Error> {
    let is_number = |number: f64| number.fract() == 0.0 && (0.0..=MAX_INTEGER).contains(&number);
    number(from, "a whole number from 0", is_number).map(|number| number as u64)
}

fn names<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<String>, D::Error> {
    checked(from, |names: Vec<String>| {
        let is_taken = |(i, name): &(usize, &String)| name.is_empty() || names[..*i].contains(name);
        match names.iter().enumerate().find(is_taken) {
            Some((i, name)) => Err(format!("element {i} is `{name}`, but each joint needs its own name")),
            None if names.is_empty() => Err("the list is empty".into()),
            None => Ok(names),
        }
    })
}

/// Reads the pose of the sensor from a 4x4 matrix, row after row.
fn mount<'de, D: Deserializer<'de>>(from: D) -> Result<Mount, D::Error> {
    checked(from, |matrix: [f64; 16]| mount_of(&matrix))
}

fn mount_of(m: &[f64; 16]) -> Result<Mount, String> {
    let rotation = Matrix3::new(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
    if (0..4).any(|i| (m[12 + i] - [0.0, 0.0, 0.0, 1.0][i]).abs() > MAX_ROTATION_ERROR) {
        return Err("this is not a pose: its last row is not 0, 0, 0, 1; write the matrix row by row, from the flange to the sensor".into());
    }
    let error = (rotation.transpose() * rotation - Matrix3::identity()).amax();
    // A product that overflows is not a rotation.
    if error.is_nan() || error > MAX_ROTATION_ERROR {
        return Err(format!("this is not a pose: its rotation matrix is off by {error:.1e} from an orthonormal one"));
    }
    if rotation.determinant() < 0.0 {
        return Err("this is not a pose: its axes are left-handed, but they must be right-handed".into());
    }
    Ok(Mount { xyz: [m[3], m[7], m[11]], rpy: rpy(&rotation) })
}

/// Returns roll, pitch and yaw of a rotation, Rz(yaw) Ry(pitch) Rx(roll) [rad].
///
/// Roll and pitch are read after the yaw is removed. So they are exact also where the yaw is arbitrary: at and near a
/// pitch of a quarter turn.
fn rpy(rotation: &Matrix3<f64>) -> [f64; 3] {
    let r = |i, j| rotation[(i, j)];
    let yaw = libm::atan2(r(1, 0), r(0, 0));
    let (sin, cos) = libm::sincos(yaw);
    let across: Vector3<f64> =
        Vector3::new(cos * r(0, 0) + sin * r(1, 0), cos * r(1, 1) - sin * r(0, 1), sin * r(0, 2) - cos * r(1, 2));
    [libm::atan2(across[2], across[1]), libm::atan2(-r(2, 0), across[0]), yaw]
}

/// A message to the simulator: a command of joint speeds [rad/s] with where the task finds the contact [m], or the end of
/// a run.
#[derive(Serialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub(super) enum Reply<'a> {
    Cmd { seq: u64, dq: &'a [f64], est: Option<[f64; 3]> },
    End { reason: &'a str },
}

impl Reply<'_> {
    /// Returns the message as a line.
    pub(super) fn line(&self) -> String {
        serde_json::to_string(self).expect("numbers and text can always be written") + "\n"
    }
}

#[cfg(test)]
mod tests;
