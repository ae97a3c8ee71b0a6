//! Each mode as whole sets of parameters: the nodes that it changes are made once more, and take part as a further
//! configuration of the node that runs.

use std::collections::BTreeMap;

use super::conditions::{Lookup, exits};
use super::demand::wanted;
use super::nodes::Builder;
use crate::graph::check::motion::{Movers, ended, ungated};
use crate::graph::check::overlap::overlaps;
use crate::graph::check::reachability::{start, unreachable};
use crate::graph::load::{Entity, FlatGraph};
use crate::graph::plan::{Condition, PlannedExit, PlannedMode, PlannedModes, PlannedNode, Test, Watched};
use crate::graph::plan::{PlannedPort, PortRef, Producer};
use crate::graph::syntax::{Block, ModeBlock};
use crate::node::{AnyNode, Components, NodeSpec};
use crate::signal::Kind;
use crate::source::{Code, Diagnostic, Item, Table, Value};

/// A node as a mode has it.
struct Variant {
    node: Box<dyn AnyNode>,
    is_still: bool,
}

/// Checks the modes and gives the nodes their configurations. Without modes the graph itself is looked at as one.
pub(crate) fn plan(builder: &mut Builder<'_>, nodes: &mut [PlannedNode]) -> Option<PlannedModes> {
    let flat = builder.net.flat;
    let base = wanted(builder.net, &|index| node(nodes, index).map(|node| &*node.node));
    let mut frozen = BTreeMap::new();
    for node in &mut *nodes {
        frozen.insert(node.index, node.node.want(&base[node.index]));
    }
    let movers = Movers::new(builder.net);
    let word = flat.table.as_ref().and_then(|table| table.start.as_ref());
    if flat.modes.is_empty() {
        let found = movers.of(&|node| builder.is_still(node));
        ungated(builder.net, &found, None, &mut builder.found);
        start(word, &flat.place, &[], &mut builder.found);
        return None;
    }
    let first = start(word, &flat.place, &flat.modes, &mut builder.found);
    let (mut modes, mut moving) = (Vec::new(), Vec::new());
    for block in &flat.modes {
        let mut mode = PlannedMode {
            name: block.key.name.clone(),
            exits: conditions(block, builder, nodes),
            configurations: Vec::new(),
        };
        let mut variants = variants(block, builder);
        let of = |index: usize| variants.get(&index).map(|variant| &*variant.node);
        let reads = wanted(builder.net, &|index| of(index).or_else(|| node(nodes, index).map(|n| &*n.node)));
        rebuild(builder, nodes, &base, &reads, &mut variants);
        for (index, variant) in &mut variants {
            variant.node.want(&reads[*index]);
        }
        absent(block, &mode, &reads, &frozen, builder);
        let is_still =
            |node: usize| variants.get(&node).map_or_else(|| builder.is_still(node), |variant| variant.is_still);
        moving.push(movers.of(&is_still));
        adopt(block, variants, nodes, &mut mode, &mut builder.found);
        modes.push(mode);
    }
    let names: Vec<&str> = flat.modes.iter().map(|mode| mode.key.name.as_str()).collect();
    modes.iter().for_each(|mode| overlaps(mode, &names, &mut builder.found));
    let ended = ended(&modes, &moving, builder.net);
    for (i, block) in flat.modes.iter().enumerate().filter(|(i, _)| !ended[*i]) {
        ungated(builder.net, &moving[i], Some(block), &mut builder.found);
    }
    let start = first?;
    unreachable(start, &flat.modes, &mut builder.found);
    Some(PlannedModes { modes, start })
}

fn node(nodes: &[PlannedNode], index: usize) -> Option<&PlannedNode> {
    nodes.iter().find(|node| node.index == index)
}

fn conditions(block: &ModeBlock, builder: &mut Builder<'_>, nodes: &[PlannedNode]) -> Vec<PlannedExit> {
    let flat = builder.net.flat;
    let ports = &builder.ports;
    let port = |source: PortRef| -> Option<&PlannedPort> { ports.get(&source) };
    let poses = nodes.iter().flat_map(|node| {
        let ports = node.ports.iter().enumerate().filter(|(_, port)| port.shape.kind() == Kind::Pose);
        ports.map(|(port, _)| PortRef { producer: Producer::Node(node.index), port })
    });
    let lookup = Lookup {
        net: builder.net,
        modes: flat.modes.iter().map(|mode| mode.key.name.as_str()).collect(),
        port: &port,
        poses: poses.collect(),
        lost_after: (5e9 * builder.period) as i64,
    };
    exits(block, &lookup, &mut builder.found)
}

/// The nodes that a mode sets something of, made with what it says.
fn variants(block: &ModeBlock, builder: &mut Builder<'_>) -> BTreeMap<usize, Variant> {
    let mut tables = BTreeMap::new();
    tables_of(builder.net.flat, 0, &block.set, &mut tables, &mut builder.found);
    let mut variants = BTreeMap::new();
    for (index, mut table) in tables {
        let Some(spec) = builder.net.spec(index) else { continue };
        let block = &builder.net.flat.nodes[index].block;
        settled(spec, block, &mut table, &mut builder.found);
        let mut params = block.params.clone();
        if let Item::Table(base) = &mut params.item {
            base.merge(table);
        }
        variants.extend(
            builder
                .variant(index, &params)
                .map(|built| (index, Variant { node: built.node, is_still: built.is_still })),
        );
    }
    variants
}

/// What a mode sets of each node, through the parts.
fn tables_of(
    flat: &FlatGraph,
    scope: usize,
    set: &Table,
    tables: &mut BTreeMap<usize, Table>,
    found: &mut Vec<Diagnostic>,
) {
    let names = &flat.scopes[scope].names;
    for (key, value) in &set.entries {
        let Some(table) = value.as_table() else {
            let message = format!("`{}` is not set as a whole: name the parameter", key.name);
            found.push(
                Diagnostic::new(Code::BadValue, value.span.clone(), message)
                    .help(format!("`set.{}.PARAMETER = …`", key.name)),
            );
            continue;
        };
        match names.get(&key.name) {
            Some((_, Entity::Node(node))) => tables.entry(*node).or_default().merge(table.clone()),
            Some((_, Entity::Part(inner))) => tables_of(flat, *inner, table, tables, found),
            Some((_, Entity::Role(_))) => {
                let message = format!("`{}` is a role: a mode sets parameters of nodes", key.name);
                found.push(Diagnostic::new(Code::UnknownKey, key.span.clone(), message));
            }
            None => {
                let message = format!("there is no node or part `{}` to set", key.name);
                let known = names.iter().filter(|(_, (_, entity))| !matches!(entity, Entity::Role(_)));
                found.push(Diagnostic::new(Code::UnknownKey, key.span.clone(), message).suggest(
                    &key.name,
                    known.map(|(name, _)| name.as_str()),
                    "nodes and parts",
                ));
            }
        }
    }
}

/// What a mode sets that is settled at load: that is told, and taken out.
fn settled(spec: &NodeSpec, block: &Block, set: &mut Table, found: &mut Vec<Diagnostic>) {
    let live = || spec.params.iter().filter(|param| param.is_live).map(|param| format!("`{}`", param.name));
    set.entries.retain(|(key, _)| {
        let param = spec.params.iter().find(|param| param.name == key.name);
        let message = match (key.name.as_str(), param) {
            ("type" | "in", _) => format!("`{}` is the same in every mode: a mode sets parameters", key.name),
            (_, Some(param)) if !param.is_live => {
                format!("`{}` of `{}` is settled at load: a mode cannot set it", key.name, block.key.name)
            }
            _ => return true,
        };
        let live: Vec<String> = live().collect();
        let help = match live.is_empty() {
            true => format!("no parameter of a `{}` can be set in a mode", spec.name),
            false => format!("a mode can set: {}", live.join(", ")),
        };
        found.push(Diagnostic::new(Code::NotLive, key.span.clone(), message).help(help));
        false
    });
}

/// Nodes that a mode does not set, but of which it reads other components than the base graph: made once more.
fn rebuild(
    builder: &mut Builder<'_>,
    nodes: &[PlannedNode],
    base: &[Vec<Components>],
    reads: &[Vec<Components>],
    variants: &mut BTreeMap<usize, Variant>,
) {
    for index in nodes.iter().map(|node| node.index) {
        if base[index] == reads[index] || variants.contains_key(&index) {
            continue;
        }
        let params: Value = builder.net.flat.nodes[index].block.params.clone();
        let built = builder.variant(index, &params);
        variants.extend(built.map(|built| (index, Variant { node: built.node, is_still: built.is_still })));
    }
}

/// Conditions on what is absent in their mode: a feature that its projector deletes.
fn absent(
    block: &ModeBlock,
    mode: &PlannedMode,
    reads: &[Vec<Components>],
    frozen: &BTreeMap<usize, bool>,
    builder: &mut Builder<'_>,
) {
    for exit in &mode.exits {
        let (Condition::Port(watched, _) | Condition::Lost(watched, _)) = &exit.condition else { continue };
        let Watched { source: PortRef { producer: Producer::Node(node), port }, feature } = *watched else { continue };
        let read = reads[node][port];
        let is_read = feature.map_or(!read.is_empty(), |feature| read.has(feature));
        if is_read || !frozen.get(&node).copied().unwrap_or(false) {
            continue;
        }
        let what = if matches!(exit.condition, Condition::Port(_, Test::Absent)) { "always" } else { "never" };
        let name = exit.text.split('`').nth(1).unwrap_or_default();
        let mode = &block.key.name;
        let message = format!("`{name}` is absent in mode `{mode}`, where nothing reads it: this {what} holds");
        let help = "select the feature in this mode, or look at what it is made from";
        builder.found.push(Diagnostic::new(Code::AbsentPort, exit.span.clone(), message).help(help));
    }
}

fn adopt(
    block: &ModeBlock,
    variants: BTreeMap<usize, Variant>,
    nodes: &mut [PlannedNode],
    mode: &mut PlannedMode,
    found: &mut Vec<Diagnostic>,
) {
    for (index, variant) in variants {
        let Some(place) = nodes.iter().position(|node| node.index == index) else { continue };
        match nodes[place].node.adopt(variant.node) {
            Ok(number) => mode.configurations.push((place, number)),
            Err(_) => {
                let message = format!(
                    "the type of `{}` knows no modes: mode `{}` cannot change it",
                    nodes[place].name, block.key.name
                );
                found.push(Diagnostic::new(Code::NotLive, block.key.span.clone(), message));
            }
        }
    }
}
