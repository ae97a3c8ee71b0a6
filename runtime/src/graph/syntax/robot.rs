//! Parses the file of a robot: what holds for it in any cell.

use super::correct::correct_sections;
use super::limits::{LimitOwner, LimitSection, read_limits};
use super::read::read_table;
use super::reserved::{LIMITS, ROBOT};
use crate::node::{At, Mistake, Reader};
use crate::source::{Code, Key, Table};

/// The sections of a robot file: what holds for a robot in any cell.
#[derive(Debug, Clone, Default)]
pub(crate) struct RobotDocument {
    /// Parameters for the devices that drive it.
    pub(crate) params: Table,
    pub(crate) limits: Vec<LimitSection>,
}

/// Reads the sections of the file of a robot that `device` drives.
pub(super) fn read_robot(root: &mut Table, device: &Key, reader: &mut Reader<'_>) -> RobotDocument {
    correct_sections(root, &[ROBOT, LIMITS], reader);
    let limits = read_limits(root, &LimitOwner::Robot(device.name.clone()), reader);
    for key in limits.iter().filter_map(|section| section.role.as_ref()) {
        let message = format!("a robot has no role `{}`: its limits hold wherever it is bound", key.name);
        let mistake = Mistake::new(Code::UnknownKey, At::Span(key.span.clone()), message);
        reader.mistakes.push(mistake.help("write the limits directly under [limits]"));
    }
    RobotDocument { params: read_table(root.get(ROBOT), reader), limits }
}
