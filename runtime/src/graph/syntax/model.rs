//! Parses the file of a robot or of a sensor: what holds for it in any cell.

use super::correct::correct_sections;
use super::limits::{LimitOwner, LimitSection, read_limits};
use super::read::read_table;
use super::reserved::{LIMITS, ROBOT};
use crate::node::{At, FilePath, Mistake, Reader};
use crate::source::{Code, Key, Table};

/// The file of the robot or of the sensor of a device.
#[derive(Debug, Clone)]
pub(crate) struct ModelFile {
    /// The device.
    pub(crate) device: Key,
    /// What it describes: the key of the device that names it, and its section.
    pub(crate) what: &'static str,
    pub(crate) file: FilePath,
}

/// The sections of such a file: what holds for a robot or a sensor in any cell.
#[derive(Debug, Clone, Default)]
pub(crate) struct ModelDocument {
    /// Parameters for the devices that drive or read it.
    pub(crate) params: Table,
    /// The limits of a robot.
    pub(crate) limits: Vec<LimitSection>,
}

/// Reads the sections of the file of a robot or of a sensor.
pub(super) fn read_model(root: &mut Table, from: &ModelFile, reader: &mut Reader<'_>) -> ModelDocument {
    let limits = match from.what == ROBOT {
        true => {
            correct_sections(root, &[ROBOT, LIMITS], reader);
            limits_of_robot(root, &from.device, reader)
        }
        false => {
            correct_sections(root, &[from.what], reader);
            Vec::new()
        }
    };
    ModelDocument { params: read_table(root.get(from.what), reader), limits }
}

fn limits_of_robot(root: &mut Table, device: &Key, reader: &mut Reader<'_>) -> Vec<LimitSection> {
    let limits = read_limits(root, &LimitOwner::Robot(device.name.clone()), reader);
    for key in limits.iter().filter_map(|section| section.role.as_ref()) {
        let message = format!("a robot has no role `{}`: its limits hold wherever it is bound", key.name);
        let mistake = Mistake::new(Code::UnknownKey, At::Span(key.span.clone()), message);
        reader.mistakes.push(mistake.help("write the limits directly under [limits]"));
    }
    limits
}
