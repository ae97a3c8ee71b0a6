//! An arm and what moves it, with what its limits say about its features.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::f64::consts::FRAC_PI_2;

use tactflow_runtime::graph::Outline;
use tactflow_runtime::source::{Item, Table, Value};

use super::mode_law::ModeLaw;
use crate::tool::control::chain::{Chain, Limiter, chain};
use crate::tool::control::collect::law_behind;
use crate::tool::control::contacts::Contact;
use crate::tool::control::filters::way;
use crate::tool::control::law::Feature;
use crate::tool::control::nodes::{Command, Index, Nodes};

/// An arm and what moves it.
pub(super) struct Arm<'a> {
    pub(super) outline: &'a Outline,
    /// Name of its role.
    pub(super) name: &'a str,
    /// Task of the arm, "" for the graph itself.
    pub(super) task: &'a str,
    pub(super) limits: Vec<Limiter>,
    /// The port of the twist before all limiters.
    pub(super) twist: String,
    /// What the bench declares that the arm touches.
    pub(super) contacts: Vec<Contact>,
    /// Damping ratio of the springs in its joints; `None` if the arm states none.
    pub(super) damping_ratio: Option<f64>,
    pub(super) modes: Vec<ModeLaw<'a>>,
}

/// Returns the frames of the sensors whose pose follows from the joints of an arm. What the others measure moves with the
/// object, and not against the sensor.
pub(super) fn carried(outline: &Outline) -> BTreeSet<&str> {
    let states = outline.nodes.iter().filter(|node| node.kind.text == "arm_state");
    let poses = states.flat_map(|node| &node.outputs).filter(|port| port.name.ends_with(".sensor_pose"));
    poses.filter_map(|port| port.frames.first()?.as_deref()).collect()
}

impl<'a> Arm<'a> {
    /// Returns what moves an arm with these facts; `None` if a chain of limiters leads to no node.
    pub(super) fn of(
        index: &'a Index<'a>,
        carried: &'a BTreeSet<&'a str>,
        command: Command<'a>,
        contacts: Vec<Contact>,
        damping_ratio: Option<f64>,
    ) -> Option<Self> {
        let Chain { limits, twist, mounts } = chain(&Nodes::new(index, None), command.port).ok()?;
        let task = index.task_of(&twist);
        let modes = index.modes(task).into_iter().map(|mode| {
            let nodes = Nodes::new(index, mode);
            ModeLaw { mode, carried, nodes, law: law_behind(&nodes, &twist, &mounts) }
        });
        let modes = modes.collect();
        Some(Self { outline: index.outline(), name: command.arm, task, limits, twist, contacts, damping_ratio, modes })
    }

    /// Returns the objects of a simulated bench.
    pub(super) fn objects(&self) -> impl Iterator<Item = &'a Table> {
        let settings = self.outline.devices.iter().flat_map(|device| &device.settings);
        let objects = settings.filter(|setting| setting.path == "objects");
        let objects = objects.filter_map(|setting| match &setting.value.item {
            Item::Array(objects) => Some(objects),
            _ => None,
        });
        objects.flatten().filter_map(Value::as_table)
    }

    /// Returns what the bench declares that the arm touches, or what geometry alone says.
    pub(super) fn contacts_or_geometry(&self) -> Cow<'_, [Contact]> {
        match self.contacts[..] {
            [] => Cow::Owned(vec![Contact::by_geometry()]),
            [..] => Cow::Borrowed(&self.contacts),
        }
    }

    /// Returns whether a feature has a gain in any mode.
    pub(super) fn has_gain(&self, feature: &Feature) -> bool {
        let mut features = self.modes.iter().flat_map(|mode| &mode.law.features);
        features.any(|other| other.has_gains_of(feature) && other.has_gain())
    }

    /// Returns what moves the arm in a mode, by the name that the mode has in its task.
    pub(super) fn mode(&self, name: &str) -> Option<&ModeLaw<'a>> {
        self.modes.iter().find(|mode| mode.own_name() == name)
    }

    /// Returns whether the sensor moves away from the object in a mode.
    pub(super) fn leaves(&self, mode: &str) -> bool {
        self.mode(mode).is_some_and(ModeLaw::backs_off)
    }

    /// Returns the smallest limit of a force, and its key.
    pub(super) fn force_limit(&self, mode: &ModeLaw<'_>, quantity: &str) -> Option<(f64, String)> {
        let limit = match quantity {
            "pressure" => "peak",
            // The spare force is a part of it.
            "force" | "spare" => "force",
            _ => return None,
        };
        let limiters = self.limits.iter().filter(|limiter| limiter.kind.ends_with("contact_limit"));
        let limits = limiters.filter_map(|limiter| {
            let node = mode.nodes.node(&limiter.node)?;
            let keys = [format!("{limit}_n"), format!("{limit}_raw")];
            keys.into_iter().find_map(|key| Some((mode.nodes.number(node, &key)?, key)))
        });
        limits.min_by(|(one, _), (other, _)| one.total_cmp(other))
    }

    /// Returns the largest error that a feature can have, as far as it is known.
    pub(super) fn largest_error(&self, mode: &ModeLaw<'_>, feature: &Feature) -> f64 {
        match mode.quantity(feature) {
            Some("orientation") => FRAC_PI_2,
            Some(quantity @ ("pressure" | "force")) => {
                // At the first touch it is the setpoint.
                let most = self.force_limit(mode, quantity).map_or(f64::INFINITY, |(most, _)| most);
                feature.setpoint.filter(|setpoint| *setpoint > 0.0).map_or(most, |setpoint| most.min(setpoint))
            }
            _ => mode.farthest(feature).unwrap_or(f64::INFINITY),
        }
    }

    /// Returns what an exit watches, through filters, or by the name that a part gives it.
    pub(super) fn watched(&self, mode: &ModeLaw<'_>, when: &str) -> Option<String> {
        let when = self.port(when);
        let measured = way(&mode.nodes, &when).measured;
        if let Some(quantity) = mode.quantity_of(&measured) {
            return Some(quantity.to_owned());
        }
        let (part, name) = when.rsplit_once('.')?;
        let ports = self.outline.nodes.iter().flat_map(|node| &node.outputs);
        let mut inside = ports.filter(|port| port.name.strip_prefix(part).is_some_and(|rest| rest.starts_with('.')));
        inside.any(|port| mode.quantity_of(&port.name) == Some(name)).then(|| name.to_owned())
    }

    /// Returns the name in the whole graph of a port that a mode names as its task calls it.
    pub(super) fn port(&self, name: &str) -> String {
        if self.task.is_empty() { name.to_owned() } else { format!("{}.{name}", self.task) }
    }
}
