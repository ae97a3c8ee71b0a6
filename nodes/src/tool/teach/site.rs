//! What is taught: an arm of a bench, the point on it that touches, and what the bench states already.

use std::collections::BTreeSet;
use std::path::Path;

use nalgebra::{IsometryMatrix3, Vector3};
use tactflow_runtime::graph::{OpenBench, open_bench};
use tactflow_runtime::signal::{Joints, Shape};
use tactflow_runtime::source::quoted;
use toml::Value;

use super::super::guided::{BoundRole, GuidedArm, GuidedCell, TomlFile, mount};
use crate::motion::pose::pose_of;

/// An arm of a bench, and the point on it that touches.
pub(super) struct Site {
    pub(super) arm: GuidedArm,
    /// Pose of the touching point in the frame of the tip.
    mount: IsometryMatrix3<f64>,
    /// The touching point in words.
    pub(super) point: String,
    /// Section of the limits of this arm: `limits`, and the role if the bench binds several arms.
    pub(super) limits: Vec<String>,
    /// Postures of the device, perhaps of its robot file [rad].
    pub(super) home: Option<Vec<f64>>,
    pub(super) start: Option<Vec<f64>>,
    /// Whether the bench itself states home and the start.
    pub(super) is_stated: [bool; 2],
    /// Rows of `keep_out` that the bench states in the section of this arm.
    pub(super) rows: Vec<[f64; 4]>,
    /// The section `[limits]` if this arm has one of its own: it holds too.
    pub(super) general: Option<Value>,
    /// Number of pads of the bench, if it has one arm.
    pub(super) pads_of_one_arm: usize,
}

/// A pad that a bench binds: its role, and the origin and the angles of its mount [m, rad].
type Pad = (String, [[f64; 3]; 2]);

impl Site {
    /// Finds the arm and the pad.
    ///
    /// # Errors
    /// If the bench has no such arm or pad, or several and none is named, or if the arm cannot be taught.
    pub(super) fn find(
        cell: &GuidedCell<'_>,
        file: &TomlFile,
        arm: Option<&str>,
        sensor: Option<&str>,
    ) -> Result<Self, String> {
        let found = GuidedArm::find(cell, arm)?;
        let description = cell.device(found.position).description();
        let BoundRole { role, device, side } = &found.bound;
        if side.is_some() {
            return Err(format!(
                "device `{device}` has several sides, and their postures cannot be written by `teach`: write them by hand"
            ));
        }
        let home = description.fact_on(None, "velocity_arm", "home").and_then(read_numbers);
        let start = match description.shape("position") {
            Some(Shape::Joints(shape)) => shape.joints.iter().map(|joint| joint.start).collect(),
            _ => None,
        };
        let arms = arms(cell);
        let mut limits = vec!["limits".to_owned()];
        limits.extend((arms > 1).then(|| role.clone()));
        let pads = pads(cell, file.path())?;
        let pads_of_one_arm = if arms > 1 { 0 } else { pads.len() };
        let (mount, point) = match pad(pads, sensor, arms)? {
            Some((pad, [xyz, rpy])) => {
                (pose_of(xyz, rpy), format!("the origin of `{pad}`, which is at {xyz:?} m on the tip of `{role}`"))
            }
            None => (IsometryMatrix3::identity(), format!("the tip of `{role}`")),
        };
        let text = file.values()?;
        let rows = rows(&text, &limits)?;
        let is_stated = ["home", "start"].map(|key| section(&text, &["devices", device, key]).is_some());
        let general = (arms > 1).then(|| section(&text, &["limits"]).cloned()).flatten();
        Ok(Self { arm: found, mount, point, limits, home, start, is_stated, rows, general, pads_of_one_arm })
    }

    /// Returns the touching point of a pose of the tip [m].
    pub(super) fn point_of(&self, tip: &IsometryMatrix3<f64>) -> Vector3<f64> {
        (tip * self.mount).translation.vector
    }

    /// Returns the touching point in a posture [m].
    pub(super) fn point_at(&self, joints: &[f64]) -> Vector3<f64> {
        self.point_of(&self.arm.tip(joints))
    }
}

/// Counts the arms of a cell. A device that fills several roles is one arm.
fn arms(cell: &GuidedCell<'_>) -> usize {
    let is_arm = |bound: &&BoundRole| cell.port::<Joints>(bound, "position").is_some();
    let arms = cell.bound().iter().filter(is_arm).map(|BoundRole { device, side, .. }| (device, side));
    arms.collect::<BTreeSet<_>>().len()
}

/// Reads a list of plain numbers.
pub(super) fn read_numbers(value: &Value) -> Option<Vec<f64>> {
    value.clone().try_into().ok()
}

/// Returns the pads of a bench. A pad may be simulated, so the devices are opened once more, without a connection.
fn pads(cell: &GuidedCell<'_>, path: &Path) -> Result<Vec<Pad>, String> {
    let bench = open_bench(cell.shell().catalogue(), path);
    let OpenBench { devices, .. } = bench.map_err(|report| report.render(false))?;
    let pad = |bound: &BoundRole| {
        let device = devices.iter().find(|device| device.name == bound.device)?;
        let mount = mount::stated(&device.opened.description, bound.side.as_deref())?;
        Some((bound.role.clone(), [mount.xyz, mount.rpy]))
    };
    Ok(cell.bound().iter().filter_map(pad).collect())
}

/// Returns the pad of the role `wanted`, or the only one if there is one arm; `None` without a pad.
fn pad(pads: Vec<Pad>, wanted: Option<&str>, arms: usize) -> Result<Option<Pad>, String> {
    let names = || quoted(pads.iter().map(|(role, _)| role));
    match wanted {
        Some("none") => Ok(None),
        Some(wanted) => {
            let message = match pads.is_empty() {
                true => format!("the bench binds no pad `{wanted}`: leave out `--sensor` to touch with the tip"),
                false => format!("the bench binds no pad `{wanted}`: write `--sensor` with one of {}", names()),
            };
            pads.into_iter().find(|(role, _)| role == wanted).map(Some).ok_or(message)
        }
        None if pads.len() > 1 => Err(format!(
            "the bench binds several pads: name the one that touches with `--sensor`, one of {}, or `none` for the tip",
            names()
        )),
        None if arms > 1 && !pads.is_empty() => Err(format!(
            "the bench binds several arms, and does not state which of them carries the pad {}: add `--sensor {}` if it is \
             on this arm, or `--sensor none` for the tip",
            names(),
            pads[0].0
        )),
        None => Ok(pads.into_iter().next()),
    }
}

fn section<'v>(root: &'v Value, names: &[&str]) -> Option<&'v Value> {
    names.iter().try_fold(root, |value, name| value.get(name))
}

/// Returns the rows of `keep_out` in a section of a bench file.
fn rows(root: &Value, names: &[String]) -> Result<Vec<[f64; 4]>, String> {
    let found = names.iter().try_fold(root, |value, name| value.get(name)).and_then(|limits| limits.get("keep_out"));
    let Some(rows) = found.and_then(Value::as_array) else { return Ok(Vec::new()) };
    let read = |row: &Value| {
        let message = "a row of `keep_out` is not four plain numbers, so it cannot be kept: write it without units";
        read_numbers(row).and_then(|row| row.try_into().ok()).ok_or_else(|| message.to_owned())
    };
    rows.iter().map(read).collect()
}
