//! Plans the tasks: their modes, their policies, and which of them a trouble concerns.

use std::collections::{BTreeMap, BTreeSet};

use crate::graph::bench::OpenedBench;
use crate::graph::load::Task;
use crate::graph::net::Net;
use crate::graph::plan::{
    PlannedExit, PlannedMode, PlannedModes, PlannedNode, PlannedPort, PlannedTask, PortRef, Producer, Reach,
};
use crate::graph::syntax::default_max_age_s;

/// Plans the tasks with the modes of all of them, of which `starts` are the start modes. `shown` are the ports that the
/// run shows, and `gaps` the maximum time step of each task [s].
pub(crate) fn plan_tasks(
    net: &Net<'_>,
    ports: &BTreeMap<PortRef, PlannedPort>,
    modes: Vec<PlannedMode>,
    (starts, shown): (&[usize], &[PortRef]),
    gaps: &[f64],
) -> Vec<PlannedTask> {
    let flat = net.flat;
    let mut read: BTreeSet<PortRef> = net.wires.iter().flatten().map(|wire| wire.source).collect();
    read.extend(
        modes.iter().flat_map(|mode| &mode.exits).filter_map(|exit| exit.condition.port()).chain(shown.iter().copied()),
    );
    let numbers: Vec<usize> = local_numbers(net);
    let mut of_tasks: Vec<Vec<PlannedMode>> = flat.tasks.iter().map(|_| Vec::new()).collect();
    for (mode, block) in modes.into_iter().zip(&flat.modes) {
        let local = |exit: PlannedExit| PlannedExit { to: exit.to.map(|to| numbers[to]), ..exit };
        let exits = mode.exits.into_iter().map(local).collect();
        of_tasks[block.task].push(PlannedMode { exits, ..mode });
    }
    let plan = |(number, (task, modes)): (usize, (&Task, Vec<PlannedMode>))| {
        let start = starts.iter().find(|start| flat.modes[**start].task == number).map(|start| numbers[*start]);
        let is_driver = net.commands.iter().any(|wire| wire.task == number);
        let flag = |port: usize| PortRef { producer: Producer::Task(number), port };
        let flags = (0..modes.len()).filter(|mode| flat.tasks.len() > 1 || read.contains(&flag(*mode)));
        let flags = flags.map(|mode| (mode, flag(mode), ports[&flag(mode)].clone())).collect();
        PlannedTask {
            name: task.name().to_owned(),
            parent: task.parent,
            is_active: is_driver || start.is_some(),
            modes: start.map(|start| PlannedModes { modes, start }),
            flags,
            policy: flat.policy(number),
            ends_run: task.ends_run,
            max_gap: gaps[number],
            reset_after: reset_after(net, number),
        }
    };
    flat.tasks.iter().zip(of_tasks).enumerate().map(plan).collect()
}

/// Returns the maximum time step between two samples in each task [s]: that of its section [graph], or five periods of
/// the slowest device that it uses, and at least five of the graph, whose period is `period` [s].
pub(crate) fn max_gaps(net: &Net<'_>, opened: &OpenedBench, period: f64) -> Vec<f64> {
    let own = |task: &Task| task.table.as_ref().and_then(|table| table.max_gap_ms).map(|ms| ms * 1e-3);
    let periods = |task: &Task| {
        let bound = task.roles.iter().filter_map(|role| opened.roles.get(*role)?.as_ref());
        bound.map(|bound| opened.period(bound)).fold(period, f64::max)
    };
    net.flat.tasks.iter().map(|task| own(task).unwrap_or_else(|| default_max_age_s(periods(task)))).collect()
}

/// Returns the number of each mode in its task.
fn local_numbers(net: &Net<'_>) -> Vec<usize> {
    let mut counts = vec![0; net.flat.tasks.len()];
    let number = |task: usize| {
        counts[task] += 1;
        counts[task] - 1
    };
    net.flat.modes.iter().map(|mode| mode.task).map(number).collect()
}

/// Returns how long an input must be absent before the state of a node of the task is reset [ns].
fn reset_after(net: &Net<'_>, task: usize) -> i64 {
    let around = std::iter::successors(Some(task), |task| net.flat.tasks[*task].parent);
    let mut tables = around.filter_map(|task| net.flat.tasks[task].table.as_ref());
    tables.next().map_or(0, |table| (table.reset_after_ms * 1e6) as i64)
}

/// Finds the tasks that a trouble of each role and each node concerns.
///
/// A task is also concerned by what only the conditions of its `modes` read.
pub(crate) fn find_reach(net: &Net<'_>, nodes: &[PlannedNode], modes: &[PlannedMode]) -> Reach {
    let flat = net.flat;
    if flat.tasks.len() == 1 {
        return Reach::default();
    }
    let mut of_nodes: Vec<BTreeSet<usize>> =
        flat.nodes.iter().map(|node| BTreeSet::from([flat.scopes[node.scope].task])).collect();
    let mut of_roles: Vec<BTreeSet<usize>> = flat.roles.iter().map(|_| BTreeSet::new()).collect();
    for wire in &net.commands {
        of_roles[wire.role].insert(wire.task);
        if let Some(node) = wire.source.producer.node() {
            of_nodes[node].insert(wire.task);
        }
    }
    for (mode, block) in modes.iter().zip(&flat.modes) {
        for watched in mode.exits.iter().filter_map(|exit| exit.condition.port()) {
            match watched.producer {
                Producer::Node(node) => of_nodes[node].insert(block.task),
                Producer::Role(role) => of_roles[role].insert(block.task),
                Producer::Task(_) => continue,
            };
        }
    }
    // A delayed wire comes from a later node, so one pass may not be enough.
    let mut has_changed = true;
    while has_changed {
        has_changed = false;
        for &node in net.order.iter().rev() {
            let own = of_nodes[node].clone();
            for wire in &net.wires[node] {
                let of = match wire.source.producer {
                    Producer::Node(source) => &mut of_nodes[source],
                    Producer::Role(role) => &mut of_roles[role],
                    Producer::Task(_) => continue,
                };
                let before = of.len();
                of.extend(&own);
                has_changed |= of.len() > before;
            }
        }
    }
    // What no task uses concerns the graph itself.
    of_roles.iter_mut().filter(|tasks| tasks.is_empty()).for_each(|tasks| tasks.extend([0]));
    let list = |set: &BTreeSet<usize>| set.iter().copied().collect();
    Reach {
        roles: of_roles.iter().map(list).collect(),
        nodes: nodes.iter().map(|node| list(&of_nodes[node.index])).collect(),
    }
}
