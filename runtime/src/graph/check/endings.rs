//! Finds the modes whose generated motion ends, whatever the sensors report.
//!
//! A bound on time or travel ends a motion if it ends the run or leads to a mode that ends its motion. The loss of a
//! contact does too. Neither counts if the mode can be entered again and again without a contact, because each entry
//! starts the bound afresh.

use std::collections::BTreeSet;

use crate::graph::net::{CommandWire, Net};
use crate::graph::plan::{Condition, PlannedExit, PlannedMode, PortRef, Producer, Test};
use crate::graph::syntax::{ExitKind, PortState};
use crate::signal::Kind;

/// What the ends of motions depend on.
pub(super) struct Endings<'a> {
    net: &'a Net<'a>,
    modes: &'a [PlannedMode],
    /// For each mode, the nodes that generate a motion.
    generators: &'a [Vec<usize>],
}

impl<'a> Endings<'a> {
    pub(super) const fn new(net: &'a Net<'a>, modes: &'a [PlannedMode], generators: &'a [Vec<usize>]) -> Self {
        Self { net, modes, generators }
    }

    /// Returns for each mode whether an exit ends its motion, if the mode is entered once.
    pub(super) fn find_ended(&self) -> Vec<bool> {
        let mut ended: Vec<bool> = self.generators.iter().map(Vec::is_empty).collect();
        // Fixed point: modes that only lead to each other in a cycle stay false.
        loop {
            let is_ended = |mode: usize| {
                let ends =
                    |generator: &usize| self.modes[mode].exits.iter().any(|exit| self.ends(exit, *generator, &ended));
                ended[mode] || self.generators[mode].iter().all(ends)
            };
            let next: Vec<bool> = (0..self.modes.len()).map(is_ended).collect();
            if next == ended {
                return ended;
            }
            ended = next;
        }
    }

    /// Returns whether an exit ends the motion of a generator.
    fn ends(&self, exit: &PlannedExit, generator: usize, ended: &[bool]) -> bool {
        let leads_to_end = exit.to.is_none_or(|to| ended[to]);
        leads_to_end
            && match (exit.kind, &exit.condition) {
                (ExitKind::OnLost, Condition::Lost(watched, _)) => {
                    needs_contact(self.net, watched.source) && self.shares_sensor(watched.source, generator)
                }
                (ExitKind::OnLost, _) => false,
                (_, Condition::Elapsed(_)) => true,
                (_, Condition::Travel(pose, _)) => self.is_moved_by(*pose, generator),
                _ => false,
            }
    }

    /// Returns whether every command that a generator drives descends from a sensor of the port, as it does through the
    /// limiter that reads the sensor of its arm.
    fn shares_sensor(&self, port: PortRef, generator: usize) -> bool {
        let sensors: BTreeSet<usize> = self.net.roles_of(port.producer).collect();
        let reads = |wire: &CommandWire| self.net.roles_of(wire.source.producer).any(|role| sensors.contains(&role));
        self.commands_of(generator).all(reads)
    }

    /// Returns whether a pose descends from an arm that a generator moves.
    fn is_moved_by(&self, pose: PortRef, generator: usize) -> bool {
        let arms: BTreeSet<usize> = self.net.roles_of(pose.producer).collect();
        self.commands_of(generator).all(|wire| arms.contains(&wire.role))
    }

    /// Returns the commands that a generator drives.
    fn commands_of(&self, generator: usize) -> impl Iterator<Item = &CommandWire> {
        let is_driven = move |wire: &&CommandWire| {
            !wire.is_report && self.net.upstream(wire.source.producer.node()).contains(&generator)
        };
        self.net.commands.iter().filter(is_driven)
    }

    /// Returns the modes, from `mode` back to itself, that can follow each other without a contact.
    pub(super) fn find_cycle(&self, mode: usize) -> Option<Vec<usize>> {
        let mut paths = vec![vec![mode]];
        let mut reached = BTreeSet::new();
        while let Some(path) = paths.pop() {
            let last = path.last().copied().unwrap_or(mode);
            for exit in self.modes[last].exits.iter().filter(|exit| self.is_free(exit, last)) {
                match exit.to {
                    Some(to) if to == mode => return Some(path),
                    Some(to) if reached.insert(to) => paths.push([path.as_slice(), &[to]].concat()),
                    _ => {}
                }
            }
        }
        None
    }

    /// Returns whether an exit can be taken again and again without a contact and without the operator.
    fn is_free(&self, exit: &PlannedExit, mode: usize) -> bool {
        match &exit.condition {
            Condition::Sent(_) => false,
            Condition::Elapsed(time) => self.first_end(mode).is_none_or(|end| *time < end),
            Condition::Port(
                watched,
                Test::Is(PortState::True | PortState::Present | PortState::New) | Test::Between { .. },
            ) => !needs_contact(self.net, watched.source),
            Condition::Port(..) | Condition::Travel(..) | Condition::Lost(..) => true,
        }
    }

    /// Returns the time after which a mode ends the run [ns].
    fn first_end(&self, mode: usize) -> Option<i64> {
        let ends = self.modes[mode].exits.iter().filter(|exit| exit.to.is_none());
        let times = ends.filter_map(|exit| match exit.condition {
            Condition::Elapsed(time) => Some(time),
            _ => None,
        });
        times.min()
    }
}

/// Returns whether a port is present, or set, only while something touches a sensor.
///
/// Such a port descends from sensors alone. It is a flag, or the contact was segmented upstream of it.
pub(super) fn needs_contact(net: &Net<'_>, port: PortRef) -> bool {
    let mut roles = net.roles_of(port.producer).peekable();
    let is_sensor = |role: usize| net.roles[role].is_some_and(|role| role.commands.is_empty());
    roles.peek().is_some()
        && roles.all(is_sensor)
        && (net.port(port).kind == Kind::Flag || is_segmented(net, port.producer))
}

/// Returns whether a mask or a list of regions is read at or upstream of a producer.
fn is_segmented(net: &Net<'_>, producer: Producer) -> bool {
    let is_segment = |node: &usize| {
        let kinds = net.wires[*node].iter().map(|wire| net.port(wire.source).kind);
        kinds.into_iter().any(|kind| matches!(kind, Kind::Mask | Kind::Regions))
    };
    net.upstream(producer.node()).iter().any(is_segment)
}
