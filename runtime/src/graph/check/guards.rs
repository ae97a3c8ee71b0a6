//! Checks that each sensor on an arm has limiters of its own: an arm with two pads needs two limiters of the force.

use std::collections::BTreeSet;

use super::carried::{limits_of_sensors, on_no_arm, sensors_on};
use super::foreign::read_roles;
use super::frames::Frames;
use super::second_guard::suggest;
use crate::graph::net::limits::PathNode;
use crate::graph::net::{CommandWire, Net};
use crate::graph::plan::{PortRef, Producer};
use crate::source::{Code, Diagnostic, quoted};

/// A command, and the nodes on its path that pass its motion on, the last one first.
pub(super) struct Guards<'a> {
    pub(super) net: &'a Net<'a>,
    pub(super) wire: &'a CommandWire,
    pub(super) path: &'a [PathNode<'a>],
}

/// The limits that hold for sensors at one place of the path.
#[derive(Default)]
struct Held {
    /// The limits and their sensors, each with the node that holds it.
    kept: Vec<(&'static str, usize, usize)>,
    /// The limits and their sensors that hold no more, each with the node that may break it.
    lost: Vec<(&'static str, usize, usize)>,
}

impl Held {
    /// Drops the limits for which `is_broken` holds, which `node` breaks.
    fn drop_where(&mut self, node: usize, is_broken: impl Fn(&str, usize) -> bool) {
        let (lost, kept) = self.kept.drain(..).partition(|(limit, sensor, _)| is_broken(limit, *sensor));
        self.kept = kept;
        let lost: Vec<_> = lost;
        self.lost.extend(lost.into_iter().map(|(limit, sensor, _)| (limit, sensor, node)));
    }

    /// Returns the sensors that limiters on the path read.
    fn sensors(&self) -> BTreeSet<usize> {
        self.kept.iter().chain(&self.lost).map(|(_, sensor, _)| *sensor).collect()
    }
}

impl Guards<'_> {
    /// Reports sensors on the arm for which a required limit does not hold.
    pub(super) fn check(&self, frames: &mut Frames<'_>) -> Vec<Diagnostic> {
        let (net, arm) = (self.net, self.wire.role);
        let Some(role) = net.roles[arm] else { return Vec::new() };
        // What a limiter reads is unknown, and has a mistake of its own.
        if self.path.iter().any(|stop| stop.spec.limits.guards.is_some() && is_unknown(net, stop.node)) {
            return Vec::new();
        }
        let (required, held) = (limits_of_sensors(net, role), self.follow(frames));
        let mut found = Vec::new();
        for sensor in sensors_on(net, arm) {
            let is_kept = |limit: &&str| held.kept.iter().any(|(kept, of, _)| kept == limit && *of == sensor);
            let missing: Vec<&str> = required.iter().copied().filter(|limit| !is_kept(limit)).collect();
            if missing.is_empty() {
                continue;
            }
            let by = held.lost.iter().rev().find(|(limit, of, _)| *of == sensor && missing.contains(limit));
            found.push(match by {
                Some((_, _, node)) => self.broken(sensor, *node, &missing, &held),
                None => self.unguarded(sensor, frames, &held),
            });
        }
        found
    }

    /// Follows the motion, and returns the limits that hold for each sensor at its end.
    fn follow(&self, frames: &mut Frames<'_>) -> Held {
        let mut held = Held::default();
        for PathNode { node, spec, source, .. } in self.path.iter().rev() {
            let breaks = |limit: &str| spec.limits.breaks.contains(&limit);
            let Some(input) = spec.limits.guards else {
                held.drop_where(*node, |limit, _| breaks(limit));
                continue;
            };
            let (own, framed) = (self.guarded(*node, input), self.sensor_of(frames, *source));
            held.drop_where(*node, |limit, sensor| breaks(limit) || Some(sensor) != own && Some(sensor) != framed);
            let holds = |own: usize| spec.limits.holds.iter().map(move |limit| (*limit, own, *node));
            held.kept.extend(own.into_iter().flat_map(holds));
        }
        held
    }

    /// Returns the sensor that a limiter reads, or `None` if its value descends from several roles.
    fn guarded(&self, node: usize, input: &str) -> Option<usize> {
        let roles: BTreeSet<usize> = read_roles(self.net, node, input).into_iter().collect();
        roles.first().copied().filter(|_| roles.len() == 1)
    }

    /// Returns the sensor in whose frame a motion is.
    fn sensor_of(&self, frames: &mut Frames<'_>, motion: PortRef) -> Option<usize> {
        let frame = frames.of(motion).into_iter().next().flatten()?;
        self.net.flat.roles.position(&frame)
    }

    /// Returns the names of the sensors that limiters read.
    fn names(&self, held: &Held) -> Vec<&str> {
        held.sensors().into_iter().map(|sensor| self.net.name(Producer::Role(sensor))).collect()
    }

    /// Reports a sensor whose limits a later node may break.
    fn broken(&self, sensor: usize, by: usize, missing: &[&str], held: &Held) -> Diagnostic {
        let net = self.net;
        let (key, arm) = (&net.flat.roles[sensor].0, net.name(Producer::Role(self.wire.role)));
        let node = &net.flat.nodes[by].name;
        let plural = if missing.len() == 1 { "" } else { "s" };
        let limits = quoted(missing);
        let message = format!("`{node}` may break the limit{plural} {limits} of `{}` on `{arm}`", key.name);
        let help = match held.sensors().len() {
            0..=2 => format!("move `{node}` before the node that enforces {limits} for `{}`", key.name),
            _ => format!("{TWO_AT_MOST}: leave out one of `{}`", self.names(held).join("`, `")),
        };
        net.diagnostic_at(by, Code::UnlimitedCommand, message).note(key.span.clone(), "it is declared here").help(help)
    }

    /// Reports a sensor that no limiter reads, with the limiter to insert.
    fn unguarded(&self, sensor: usize, frames: &mut Frames<'_>, held: &Held) -> Diagnostic {
        let (net, arm) = (self.net, self.net.name(Producer::Role(self.wire.role)));
        let (key, kind) = &net.flat.roles[sensor];
        let message = format!("`{}` is on `{arm}`, and no limiter of `{arm}` bounds the force on it", key.name);
        let guard = self.path.iter().find(|stop| held.kept.iter().any(|(_, _, node)| *node == stop.node));
        let other = match held.sensors().len() {
            0 | 1 => guard.and_then(|guard| suggest((self.wire, self.path), guard, sensor, self.net, frames)),
            _ => Some(format!("{TWO_AT_MOST}: `{}` have them", self.names(held).join("` and `"))),
        };
        let other = other.map(|help| format!("\notherwise {help}")).unwrap_or_default();
        let help = format!("{}{other}", on_no_arm(&key.name, &kind.value));
        Diagnostic::new(Code::UnlimitedCommand, key.span.clone(), message).help(help)
    }
}

/// Returns whether a node, or one that it descends from, has an unknown type or lacks a wire.
fn is_unknown(net: &Net<'_>, node: usize) -> bool {
    let (mut seen, mut open) = (BTreeSet::from([node]), vec![node]);
    while let Some(node) = open.pop() {
        if net.spec(node).is_none() || net.lacks_wires(node) {
            return true;
        }
        let sources = net.wires[node].iter().filter_map(|wire| wire.source.producer.node());
        open.extend(sources.filter(|source| seen.insert(*source)));
    }
    false
}

/// A limiter may increase the motion toward the objects of sensors other than its own and that of the frame.
const TWO_AT_MOST: &str = "two sensors of an arm at most can have limits of their own";
