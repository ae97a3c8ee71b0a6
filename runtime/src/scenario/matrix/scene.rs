//! What the matrix watches in a task: each pad on an arm with its true force, its pose and its commanded twist, and the
//! commands with their limits.

use crate::catalogue::Catalogue;
use crate::graph::{Compiled, PlannedCommand, PlannedPort, PlannedRole};
use crate::signal::{Kind, Shape, Unit};
use crate::source::Item;

/// A task on a bench, as the matrix sees it.
#[derive(Debug, Clone)]
pub(super) struct Scene {
    pub(super) sides: Vec<Side>,
    /// The commanded devices: name, and the maximum acceleration of each joint [rad/s²].
    pub(super) devices: Vec<(String, Vec<f64>)>,
    /// The role that is commanded first, and the names of its joints.
    pub(super) arm: Option<(String, Vec<String>)>,
    /// Nominal time between two ticks [s].
    pub(super) period: f64,
}

/// A pad whose true force is known. The first one is attacked.
#[derive(Debug, Clone)]
pub(super) struct Side {
    /// The role of the pad, the name of its image and its number of cells.
    pub(super) pad: String,
    pub(super) image: String,
    pub(super) cells: usize,
    /// The port of the true force.
    pub(super) force: String,
    pub(super) pose: Option<String>,
    pub(super) twist: Option<String>,
    /// Limits of the true force [N], and of the commanded twist [m/s, m/s²].
    pub(super) force_n: Option<f64>,
    pub(super) speed: Option<f64>,
    pub(super) acceleration: Option<f64>,
}

impl Scene {
    /// Looks at a task. A pad without a true force is not seen.
    pub(super) fn of(compiled: &Compiled, catalogue: &Catalogue) -> Self {
        let plan = &compiled.plan;
        let sides = plan.roles.iter().filter_map(|role| Side::of(role, compiled, catalogue)).collect();
        let commands = || plan.commands.iter().filter(|command| !command.is_report);
        let devices = plan.devices.iter().enumerate().filter_map(|(i, device)| {
            let mut own: Vec<&PlannedCommand> = commands().filter(|command| command.device == i).collect();
            own.sort_by_key(|command| command.port);
            let accelerations: Vec<f64> = own.iter().flat_map(|command| command.accelerations.clone()).collect();
            (!own.is_empty()).then(|| (device.name.clone(), accelerations))
        });
        let arm = commands().next().map(|command| {
            let joints = match &command.shape {
                Shape::Joints(shape) => shape.joints.iter().map(|joint| joint.name.clone()).collect(),
                _ => Vec::new(),
            };
            (command.name[0].clone(), joints)
        });
        Self { sides, devices: devices.collect(), arm, period: compiled.period() }
    }
}

impl Side {
    fn of(role: &PlannedRole, compiled: &Compiled, catalogue: &Catalogue) -> Option<Self> {
        let image = role.ports.iter().find(|port| port.shape.kind() == Kind::Image && !role.is_observed)?;
        let Shape::Image(shape) = &image.shape else { return None };
        let nodes = || compiled.plan.nodes.iter();
        let of_pad = |kind: Kind| {
            let is_of_pad = move |port: &&PlannedPort| {
                let frame = port.frames.first().and_then(Option::as_deref);
                port.shape.kind() == kind && frame == Some(role.name.as_str())
            };
            nodes().flat_map(|node| &node.ports).filter(is_of_pad)
        };
        let twist = of_pad(Kind::Twist).next_back().map(|port| port.name.clone());
        // The limiters stand in the part of the last motion in the frame of the pad.
        let part = twist.as_deref().and_then(|name| name.rsplitn(3, '.').nth(2)).unwrap_or_default();
        let limit = |name: &str| {
            let blocks = compiled.outline().nodes.iter().filter(|node| node.name.starts_with(part));
            let settings = blocks.flat_map(|node| node.settings.iter().map(move |setting| (&node.kind.text, setting)));
            let own = settings
                .filter(|(kind, setting)| catalogue.limit_readers().limit_of(kind, &setting.path) == Some(name));
            own.filter_map(|(_, setting)| number(&setting.value.item)).reduce(f64::min)
        };
        Some(Self {
            pad: role.name.clone(),
            image: image.name.clone(),
            cells: shape.tactels(),
            force: true_force(role, compiled)?,
            pose: of_pad(Kind::Pose).next().map(|port| port.name.clone()),
            force_n: limit("force_n"),
            speed: limit("linear_m_per_s"),
            acceleration: limit("linear_m_per_s2"),
            twist,
        })
    }
}

fn number(item: &Item) -> Option<f64> {
    match item {
        Item::Float(number) => Some(*number),
        Item::Integer(number) => Some(*number as f64),
        _ => None,
    }
}

/// Returns the port of the true force on a pad: `force` of its device, or `SIDE_force` if the device has several pads and
/// the name of the role begins with the side.
fn true_force(role: &PlannedRole, compiled: &Compiled) -> Option<String> {
    let observed = compiled.plan.roles.iter().filter(|truth| truth.is_observed && truth.device == role.device);
    let forces = observed.flat_map(|truth| &truth.ports).filter(|port| match &port.shape {
        Shape::Scalar(shape) => shape.unit == Unit::NEWTON,
        _ => false,
    });
    let is_its = |port: &&PlannedPort| {
        let name = port.name.rsplit('.').next().unwrap_or_default();
        match name.strip_suffix("force") {
            Some("") => true,
            Some(side) => role.name.starts_with(side),
            None => false,
        }
    };
    forces.into_iter().find(is_its).map(|port| port.name.clone())
}
