//! Builds the configurations of each mode: nodes that a mode changes are built again with its parameters.

use std::collections::BTreeMap;

use super::conditions::ExitContext;
use super::demand::{Demand, DemandChanges};
use super::nodes::Builder;
use crate::graph::check::generators::Motions;
use crate::graph::check::live;
use crate::graph::check::readings::Readings;
use crate::graph::load::{Entity, FlatGraph};
use crate::graph::plan::{PlannedExit, PlannedMode, PlannedNode, PlannedPort, PortRef};
use crate::graph::syntax::{ModeBlock, default_max_age_ns};
use crate::node::Built;
use crate::signal::Kind;
use crate::source::{Code, Diagnostic, Diagnostics, Item, Table};

/// The modes of a graph, with what the checks need to know about each.
pub(crate) struct BuiltModes {
    pub(crate) modes: Vec<PlannedMode>,
    /// The motion that each node generates.
    pub(crate) motions: Motions,
    pub(crate) readings: Readings,
    /// The components that are read with the parameters of the graph.
    pub(crate) demand: Demand,
    /// For each mode, where it reads other components.
    pub(crate) demand_changes: Vec<DemandChanges>,
    /// Nodes whose outputs are absent where nothing reads them.
    pub(crate) freezes: BTreeMap<usize, bool>,
}

/// Builds the modes and adds their configurations to the nodes.
pub(crate) fn build_modes(builder: &mut Builder<'_>, nodes: &mut [PlannedNode]) -> BuiltModes {
    let net = builder.net;
    let mut places = vec![None; net.flat.nodes.len()];
    nodes.iter().enumerate().for_each(|(place, node)| places[node.index] = Some(place));
    let demand = Demand::find(net, &|index| Some(&*nodes[places[index]?].node));
    let (wanted, unchanged) = (&mut builder.wanted, DemandChanges::new());
    let want = |node: &mut PlannedNode| {
        let read = demand.of(node.index, &unchanged);
        wanted.entry(node.index).or_default().push(read.to_vec());
        (node.index, node.node.want(read))
    };
    let freezes = nodes.iter_mut().map(want).collect();
    let mut motions = Motions::new((0..places.len()).map(|node| builder.motion(node)).collect());
    let readings = Readings::new((0..places.len()).map(|node| builder.reading(node)).collect());
    let (mut modes, mut demand_changes) = (Vec::new(), Vec::new());
    for (number, exits) in exits(builder, nodes).into_iter().enumerate() {
        let block = &net.flat.modes[number];
        let mut variants = variants(block, builder);
        let changed: Vec<usize> = variants.keys().copied().collect();
        let built = |index: usize| match variants.get(&index) {
            Some(variant) => Some(&*variant.node),
            None => Some(&*nodes[places[index]?].node),
        };
        let changes = demand.changes(net, changed.into_iter(), &built);
        // A node whose parameters the mode does not set is built again if other components of its outputs are read.
        let differing: Vec<usize> = changes.keys().copied().filter(|node| !variants.contains_key(node)).collect();
        for index in differing {
            let built = builder.variant(index, &net.flat.nodes[index].block.params);
            variants.extend(built.map(|built| (index, built)));
        }
        for (index, variant) in &mut variants {
            let read = demand.of(*index, &changes);
            variant.node.want(read);
            builder.wanted.entry(*index).or_default().push(read.to_vec());
        }
        motions.add_mode(variants.iter().map(|(node, variant)| (*node, variant.motion)));
        demand_changes.push(changes);
        let configurations = adopt(block, variants, nodes, &places, &mut builder.diagnostics);
        modes.push(PlannedMode { name: net.flat.mode_name(number), exits, configurations });
    }
    BuiltModes { modes, motions, readings, demand, demand_changes, freezes }
}

/// Resolves the exits of each mode.
fn exits(builder: &mut Builder<'_>, nodes: &[PlannedNode]) -> Vec<Vec<PlannedExit>> {
    let ports = &builder.ports;
    let port = |source: PortRef| -> Option<&PlannedPort> { ports.get(&source) };
    let poses = nodes.iter().flat_map(PlannedNode::outputs).filter(|(_, port)| port.shape.kind() == Kind::Pose);
    let poses = poses.filter(|(source, _)| builder.net.roles_of(source.producer).next().is_some());
    let poses: Vec<_> = poses.map(|(source, port)| (source, port.name.as_str())).collect();
    let flat = builder.net.flat;
    let lost_after = |source: PortRef| default_max_age_ns(builder.sample_times.of(source.producer).period);
    let context = |task: usize| ExitContext {
        net: builder.net,
        task,
        modes: flat.mode_numbers(task),
        port: &port,
        poses: poses
            .iter()
            .filter(|(_, name)| name.starts_with(&flat.tasks[task].prefix))
            .map(|(pose, _)| *pose)
            .collect(),
        lost_after: &lost_after,
    };
    let contexts: Vec<_> = (0..flat.tasks.len()).map(context).collect();
    let (measured, diagnostics) = (&mut builder.measured, &mut builder.diagnostics);
    flat.modes.iter().map(|block| contexts[block.task].resolve(block, measured, diagnostics)).collect()
}

/// Builds the nodes whose parameters a mode sets.
fn variants(block: &ModeBlock, builder: &mut Builder<'_>) -> BTreeMap<usize, Built> {
    let mut tables = BTreeMap::new();
    let (flat, task) = (builder.net.flat, block.task);
    collect_tables(flat, flat.tasks[task].scope, &block.set, &mut tables, &mut builder.diagnostics);
    tables.retain(|node, _| {
        let is_own = flat.task_with_modes(*node) == Some(task);
        builder.diagnostics.extend((!is_own).then(|| set_in_other_task(flat, *node, block)));
        is_own
    });
    let mut variants = BTreeMap::new();
    for (index, mut table) in tables {
        let Some(spec) = builder.net.spec(index) else { continue };
        let block = &builder.net.flat.nodes[index].block;
        live::check(spec, &block.key.name, &mut table, &mut builder.diagnostics);
        let mut params = block.params.clone();
        if let Item::Table(base) = &mut params.item {
            base.merge(table);
        }
        variants.extend(builder.variant(index, &params).map(|built| (index, built)));
    }
    variants
}

/// Reports a mode that sets a parameter in a part with modes of its own: two modes would decide about one node.
fn set_in_other_task(flat: &FlatGraph, node: usize, block: &ModeBlock) -> Diagnostic {
    let name = &flat.nodes[node].name;
    let message = format!("mode `{}` sets `{name}`, which is in a part with modes of its own", block.key.name);
    let place =
        block.set.entries.iter().find(|(key, _)| name[flat.tasks[block.task].prefix.len()..].starts_with(&key.name));
    let place = place.map_or_else(|| block.key.span.clone(), |(key, _)| key.span.clone());
    Diagnostic::new(Code::UnknownKey, place, message).help("set it in a mode of that part, or under `set` of the part")
}

/// Collects the parameters that a mode sets of each node, through the parts.
fn collect_tables(
    flat: &FlatGraph,
    scope: usize,
    set: &Table,
    tables: &mut BTreeMap<usize, Table>,
    diagnostics: &mut Diagnostics,
) {
    let names = &flat.scopes[scope].names;
    for (key, value) in &set.entries {
        let Some(table) = value.as_table() else {
            let message = format!("`set.{}` does not name a parameter", key.name);
            let help = format!("write the name of a parameter behind `set.{}`", key.name);
            diagnostics.push(Diagnostic::new(Code::BadValue, value.span.clone(), message).help(help));
            continue;
        };
        let unknown = |message: String| Diagnostic::new(Code::UnknownKey, key.span.clone(), message);
        match names.get(&key.name) {
            Some((_, Entity::Node(node))) => tables.entry(*node).or_default().merge(table.clone()),
            Some((_, Entity::Unknown)) => {}
            Some((_, Entity::Part(inner))) => collect_tables(flat, *inner, table, tables, diagnostics),
            Some((_, Entity::Role(_))) => {
                let message = format!("`{}` is a role: a mode sets only parameters of nodes", key.name);
                diagnostics.push(unknown(message));
            }
            None => {
                let known = names.iter().filter(|(_, (_, entity))| !matches!(entity, Entity::Role(_)));
                let known = known.map(|(name, _)| name.as_str());
                let diagnostic = unknown(format!("there is no node or part `{}`", key.name));
                diagnostics.push(diagnostic.suggest(&key.name, known, "nodes and parts"));
            }
        }
    }
}

/// Adds the configurations of a mode to the nodes, and returns where each is.
fn adopt(
    block: &ModeBlock,
    variants: BTreeMap<usize, Built>,
    nodes: &mut [PlannedNode],
    places: &[Option<usize>],
    diagnostics: &mut Diagnostics,
) -> Vec<(usize, usize)> {
    let mut configurations = Vec::new();
    for (index, variant) in variants {
        let Some(place) = places[index] else { continue };
        match nodes[place].node.adopt(variant.node) {
            Ok(number) => configurations.push((place, number)),
            Err(_) => {
                let (node, mode) = (&nodes[place].name, &block.key);
                let message =
                    format!("the type of `{node}` does not support modes: mode `{}` cannot change it", mode.name);
                diagnostics.push(Diagnostic::new(Code::NotLive, mode.span.clone(), message));
            }
        }
    }
    configurations
}
