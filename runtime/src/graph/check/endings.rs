//! Finds the modes whose generated motion ends, whatever the sensors report.
//!
//! A bound on time or travel ends a motion if it ends the run or leads to a mode that ends its motion. The loss of a
//! contact does too. Neither counts if the mode can be entered again and again without a contact, because each entry
//! starts the bound afresh. A mode that a lost contact ends first does not lead on by time.

use std::collections::BTreeSet;

use super::contact::ContactPorts;
use super::generators::Drives;
use crate::graph::net::Net;
use crate::graph::plan::{Condition, PlannedExit, PlannedMode, PortRef, Test};
use crate::graph::syntax::{ExitKind, PortState};

/// What the ends of motions depend on.
pub(super) struct Endings<'a> {
    net: &'a Net<'a>,
    contact: &'a ContactPorts,
    modes: &'a [PlannedMode],
    /// For each mode, the nodes that generate a motion.
    generators: &'a [&'a [usize]],
    drives: Drives<'a>,
}

impl<'a> Endings<'a> {
    pub(super) fn new(
        net: &'a Net<'a>,
        contact: &'a ContactPorts,
        modes: &'a [PlannedMode],
        generators: &'a [&'a [usize]],
    ) -> Self {
        Self { net, contact, modes, generators, drives: Drives::new(net) }
    }

    /// Returns for each mode whether an exit ends its motion, if the mode is entered once.
    pub(super) fn find_ended(&self) -> Vec<bool> {
        // The modes that lead to each mode with an exit that ends their motion there.
        let mut before = vec![Vec::new(); self.modes.len()];
        let mut open = Vec::new();
        for (i, mode) in self.modes.iter().enumerate() {
            let ending =
                || mode.exits.iter().filter(|exit| self.generators[i].iter().all(|node| self.ends(exit, *node)));
            ending().filter_map(|exit| exit.to).for_each(|to| before[to].push(i));
            if self.generators[i].is_empty() || ending().any(|exit| exit.to.is_none()) {
                open.push(i);
            }
        }
        // Modes that only lead to each other in a cycle stay false.
        let mut ended = vec![false; self.modes.len()];
        while let Some(mode) = open.pop() {
            if !std::mem::replace(&mut ended[mode], true) {
                open.append(&mut before[mode]);
            }
        }
        ended
    }

    /// Returns whether an exit ends the motion of a generator, if its target does.
    fn ends(&self, exit: &PlannedExit, generator: usize) -> bool {
        match (exit.kind, &exit.condition) {
            (ExitKind::OnLost, Condition::Lost(watched, _)) => {
                self.contact.need(self.net, watched.source) && self.drives.shares_sensor(watched.source, generator)
            }
            (ExitKind::OnLost, _) => false,
            (_, Condition::Elapsed(_)) => true,
            (_, Condition::Travel(pose, _)) => self.is_moved_by(*pose, generator),
            _ => false,
        }
    }

    /// Returns whether a pose descends from an arm that a generator moves.
    fn is_moved_by(&self, pose: PortRef, generator: usize) -> bool {
        let arms: BTreeSet<usize> = self.net.roles_of(pose.producer).collect();
        self.drives.commands(generator).all(|wire| arms.contains(&wire.role))
    }

    /// Returns for each mode whether modes that may follow each other without a contact lead to it and away from it
    /// without end. Few modes do, so a search for cycles among them is short. That search also asks which `on_lost`
    /// comes first.
    pub(super) fn find_cycling(&self) -> Vec<bool> {
        let next: Vec<Vec<usize>> = (0..self.modes.len()).map(|mode| self.followers(mode, &[]).collect()).collect();
        let mut entries = vec![0_usize; next.len()];
        next.iter().flatten().for_each(|to| entries[*to] += 1);
        // Modes that nothing leads to are on no cycle.
        let mut open: Vec<usize> = (0..next.len()).filter(|mode| entries[*mode] == 0).collect();
        let mut is_cycling = vec![true; next.len()];
        while let Some(mode) = open.pop() {
            is_cycling[mode] = false;
            for &to in &next[mode] {
                entries[to] -= 1;
                if entries[to] == 0 {
                    open.push(to);
                }
            }
        }
        is_cycling
    }

    /// Returns the modes, from `mode` back to itself, that can follow each other without a contact of the arms that its
    /// generators move.
    pub(super) fn find_cycle(&self, mode: usize, is_cycling: &[bool]) -> Option<Vec<usize>> {
        let mut paths = if is_cycling[mode] { vec![vec![mode]] } else { Vec::new() };
        let mut reached = BTreeSet::new();
        while let Some(path) = paths.pop() {
            for to in path.last().into_iter().flat_map(|last| self.followers(*last, self.generators[mode])) {
                if to == mode {
                    return Some(path);
                }
                if reached.insert(to) {
                    paths.push([path.as_slice(), &[to]].concat());
                }
            }
        }
        None
    }

    /// Returns the modes that can follow a mode without a contact of the arms that the generators `moved` move. Another
    /// arm may have its contact all the time.
    fn followers(&self, mode: usize, moved: &'a [usize]) -> impl Iterator<Item = usize> {
        self.modes[mode].exits.iter().filter(move |exit| self.is_free(exit, mode, moved)).filter_map(|exit| exit.to)
    }

    /// Returns whether an exit can be taken again and again without the operator, and without a contact of the arms
    /// that the generators `moved` move.
    fn is_free(&self, exit: &PlannedExit, mode: usize, moved: &[usize]) -> bool {
        match &exit.condition {
            Condition::Sent(_) => false,
            Condition::Elapsed(time) => {
                let is_late = self.ends_of(mode).any(|end| matches!(end, Condition::Elapsed(at) if at <= time));
                !is_late && !self.is_lost_before(*time, mode, moved)
            }
            Condition::Travel(pose, way) => {
                self.ends_of(mode).all(|end| !matches!(end, Condition::Travel(of, at) if of == pose && at <= way))
            }
            Condition::Port(watched, Test::Is(PortState::True | PortState::Present | PortState::New))
            | Condition::Port(watched, Test::Between { .. }) => !self.contact.need(self.net, watched.source),
            Condition::Port(..) | Condition::Lost(..) => true,
        }
    }

    /// Returns whether the loss of the contact of the arms that `moved` moves ends a mode before an exit that is taken
    /// after `time` [ns]. If both times are equal, `on_lost` wins.
    fn is_lost_before(&self, time: i64, mode: usize, moved: &[usize]) -> bool {
        let is_before = |lost: &&PlannedExit| matches!(lost.condition, Condition::Lost(_, at) if at <= time);
        let mut losses = self.modes[mode].exits.iter().filter(is_before);
        !moved.is_empty() && losses.any(|lost| moved.iter().all(|node| self.ends(lost, *node)))
    }

    /// Returns the conditions on which a mode ends the run.
    fn ends_of(&self, mode: usize) -> impl Iterator<Item = &Condition> {
        self.modes[mode].exits.iter().filter(|exit| exit.to.is_none()).map(|exit| &exit.condition)
    }
}
