//! Warnings about poor controllers, before the robot moves.
//!
//! [`lint`] follows each command of an arm back to the features that move it, in each mode, and asks what the graph, the
//! geometry of the features and the contacts of the bench say about the loops. A check stays silent about what it does
//! not know: a feature that no known node measures, a gain that another node changes, or a stiffness that no bench
//! states.

mod columns;
mod exits;
mod gains;
mod lines;
mod modes;
mod opposed;
mod presence;
mod reach;
mod recovery;
mod rows;
mod stability;
mod unread;

use std::collections::BTreeSet;
use std::ops::Range;

use tactflow_runtime::graph::{NO_SPAN, Outline, OutlinedMode};
use tactflow_runtime::source::{Code, Diagnostics, Item, Table, Value};

use super::control::chain::{Limiter, chain};
use super::control::collect::law;
use super::control::contacts::{Contact, contacts};
use super::control::law::{Feature, Guidance, Law};
use super::control::settings::{Index, Nodes, commands};

/// An arm and what moves it.
struct Controlled<'a> {
    outline: &'a Outline,
    /// Task of the arm, "" for the graph itself.
    task: &'a str,
    limits: Vec<Limiter>,
    /// The port of the twist before all limiters.
    twist: String,
    /// What the bench declares that the arm touches.
    contacts: Vec<Contact>,
    modes: Vec<ModeLaw<'a>>,
}

/// What moves an arm in one mode.
struct ModeLaw<'a> {
    mode: Option<&'a OutlinedMode>,
    /// The frames of the sensors that arms move.
    carried: &'a BTreeSet<&'a str>,
    nodes: Nodes<'a>,
    law: Law,
}

/// Returns the warnings about the control law of a graph.
pub(crate) fn lint(outline: &Outline, facts: &[(String, toml::Value)]) -> Diagnostics {
    let commands: Vec<(String, &str)> = commands(outline).collect();
    if commands.is_empty() {
        return Diagnostics::new();
    }
    let index = Index::new(outline);
    let carried = carried(outline);
    let mut found = Diagnostics::new();
    for (command, port) in &commands {
        let name = command.split('.').next().unwrap_or_default();
        found.extend(unread::check(outline, facts, name));
        let Some(arm) = controlled((outline, &index, &carried), facts, (command, port)) else { continue };
        found.extend(unread::misnamed(outline, &arm, name));
        let before = found.len();
        modes::check(&arm, &mut found);
        reach::check(&arm, &mut found);
        lines::check(&arm, &mut found);
        opposed::check(&arm, &mut found);
        recovery::check(&arm, &mut found);
        presence::check(&arm, &mut found);
        columns::check(&arm, &mut found);
        gains::check(&arm, &mut found);
        stability::check(&arm, &mut found);
        let of_arm = found.split_off(before);
        found.extend(without_consequences(of_arm));
    }
    // Several modes, and several parts of the same file, read the same number.
    let mut seen = BTreeSet::new();
    found.retain(|one| seen.insert((one.code, one.span.start)));
    found
}

/// Removes what another warning about the same arm causes: a task that rolls without its force has a column that nothing
/// selects, and a column with an entry in the wrong place leaves a component without one.
fn without_consequences(mut found: Diagnostics) -> Diagnostics {
    let has = |code: Code| found.iter().any(|one| one.code == code);
    let (has_wrong, rolls) = (has(Code::WrongColumn), has(Code::UnforcedRolling));
    let is_along_line = has(Code::LinePosition);
    found.retain(|one| match one.code {
        Code::IdleAxis => !has_wrong,
        Code::UnusedColumn => !has_wrong && !rolls,
        Code::OpposedMotion => !is_along_line,
        _ => true,
    });
    found
}

/// Returns the frames of the sensors whose pose follows from the joints of an arm. What the others measure moves with the
/// object, and not against the sensor.
fn carried(outline: &Outline) -> BTreeSet<&str> {
    let states = outline.nodes.iter().filter(|node| node.kind.text == "arm_state");
    let poses = states.flat_map(|node| &node.outputs).filter(|port| port.name.ends_with(".sensor_pose"));
    poses.filter_map(|port| port.frames.first()?.as_deref()).collect()
}

/// Returns what moves an arm; `None` if a chain of limiters leads to no node.
fn controlled<'a>(
    (outline, index, carried): (&'a Outline, &'a Index<'a>, &'a BTreeSet<&'a str>),
    facts: &[(String, toml::Value)],
    (command, port): (&str, &str),
) -> Option<Controlled<'a>> {
    let (limits, twist) = chain(&Nodes::new(index, None), port).ok()?;
    let task = index.task_of(port);
    let modes = index.modes(task).into_iter().map(|mode| {
        let nodes = Nodes::new(index, mode);
        ModeLaw { mode, carried, nodes, law: law(&nodes, &twist) }
    });
    let modes = modes.collect();
    let contacts = contacts(facts, command.split('.').next()?).unwrap_or_default();
    Some(Controlled { outline, task, limits, twist, contacts, modes })
}

impl<'a> Controlled<'a> {
    /// Returns the objects of a simulated bench.
    fn objects(&self) -> impl Iterator<Item = &'a Table> {
        let settings = self.outline.devices.iter().flat_map(|device| &device.settings);
        let objects = settings.filter(|setting| setting.path == "objects");
        let objects = objects.filter_map(|setting| match &setting.value.item {
            Item::Array(objects) => Some(objects),
            _ => None,
        });
        objects.flatten().filter_map(Value::as_table)
    }

    /// Returns whether a feature has a gain in any mode.
    fn has_gain(&self, feature: &Feature) -> bool {
        let mut features = self.modes.iter().flat_map(|mode| &mode.law.features);
        features.any(|other| other.name == feature.name && other.pid == feature.pid && other.has_gain())
    }
}

impl ModeLaw<'_> {
    /// Returns what a feature measures, such as `x`, if it comes from a sensor on an arm, by a node whose geometry is
    /// known.
    fn quantity<'f>(&self, feature: &'f Feature) -> Option<&'f str> {
        self.quantity_of(feature.measured.as_deref()?)
    }

    /// Returns what a port measures, under the same conditions.
    fn quantity_of<'p>(&self, port: &'p str) -> Option<&'p str> {
        let node = self.nodes.writer(port)?;
        let frame = node.outputs.iter().find(|output| output.name == port)?.frames.first()?.as_deref()?;
        let is_known = ["moments", "principal_axes", "hough", "curvature", "shear", "contact_area"]
            .contains(&&*node.kind.text)
            && self.carried.contains(frame);
        is_known.then(|| port.rsplit('.').next())?
    }

    /// Returns the smallest and the largest value of what a feature measures, where its node states them.
    fn range(&self, feature: &Feature) -> Option<[f64; 2]> {
        let port = feature.measured.as_deref()?;
        self.nodes.writer(port)?.outputs.iter().find(|output| output.name == port)?.range
    }

    /// Returns the largest distance of a measurement from its setpoint, where its node states the range of its values.
    fn farthest(&self, feature: &Feature) -> Option<f64> {
        let ([min, max], setpoint) = (self.range(feature)?, feature.setpoint?);
        Some((setpoint - min).max(max - setpoint))
    }

    /// Returns the column of a feature before all projectors.
    fn column(&self, feature: &Feature) -> Option<[f64; 6]> {
        let jacobian = self.nodes.node(&feature.jacobian)?;
        self.nodes.value(jacobian, &format!("columns.{}", feature.name))?.value.read()
    }

    /// Returns the largest control of a feature.
    fn limit(&self, feature: &Feature) -> Option<f64> {
        let pid = self.nodes.node(feature.pid.as_deref()?)?;
        self.nodes.number(pid, &format!("gains.{}.limit", feature.name))
    }

    /// Returns the error within which the integral of a feature grows.
    fn within(&self, feature: &Feature) -> Option<f64> {
        let pid = self.nodes.node(feature.pid.as_deref()?)?;
        self.nodes.number(pid, &format!("gains.{}.within", feature.name))
    }

    /// Returns the place of the column of a feature.
    fn place_of_column(&self, feature: &Feature) -> Range<usize> {
        self.place(&feature.jacobian, &format!("columns.{}", feature.name))
    }

    /// Returns the place of a gain of a feature.
    fn place_of_gain(&self, feature: &Feature, gain: &str) -> Range<usize> {
        self.place(feature.pid.as_deref().unwrap_or_default(), &format!("gains.{}.{gain}", feature.name))
    }

    /// Returns where a value of a node is written; the place of the node if it is a default.
    fn place(&self, node: &str, path: &str) -> Range<usize> {
        let Some(node) = self.nodes.node(node) else { return NO_SPAN };
        let written = self.nodes.value(node, path).map(|setting| setting.value.span.clone());
        written.filter(|span| *span != NO_SPAN).unwrap_or_else(|| node.span.clone())
    }

    /// Returns whether a node that guides the sensor has a speed of 0 in this mode.
    fn rests(&self, guide: &Guidance) -> bool {
        let node = self.nodes.node(guide.node());
        node.and_then(|node| self.nodes.number(node, "speed_m_per_s")) == Some(0.0)
    }

    /// Returns the start of a message about this mode.
    fn named(&self) -> String {
        self.mode.map(|mode| format!("in mode `{}`, ", mode.name)).unwrap_or_default()
    }

    /// Returns the features that move the arm, and whose gains have the right sign.
    fn moving(&self) -> impl Iterator<Item = &Feature> {
        let is_right = |feature: &&Feature| [feature.kp, feature.ki, feature.kd].iter().all(|gain| *gain >= 0.0);
        self.law.features.iter().filter(|feature| feature.moves()).filter(is_right)
    }
}
