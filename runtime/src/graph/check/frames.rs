//! Checks the frames of all wires by unification.
//!
//! Node types declare frames as variables, so one type works in any frame and a wrong frame is a load error.

use std::collections::{BTreeMap, BTreeSet};

use crate::graph::load::FlatNode;
use crate::graph::net::{Net, Wire, WireOrigin};
use crate::graph::plan::{PortRef, Producer};
use crate::node::{NodeSpec, PortSpec, frame_args};
use crate::signal::Kind;
use crate::source::{Code, Diagnostic, Diagnostics};

/// The frame variables of all nodes, and the frames to which they are bound.
pub(crate) struct Frames<'a> {
    net: &'a Net<'a>,
    variables: BTreeMap<(Producer, String), usize>,
    parents: Vec<usize>,
    /// The number of variables below each root.
    sizes: Vec<usize>,
    known: Vec<Option<String>>,
    /// Nodes with a wire in the wrong frame.
    clashes: BTreeSet<usize>,
}

/// Unifies the frames of all wires, and reports wires in the wrong frame.
///
/// The most constrained wires are unified first (poses before twists), so that the error is reported on the wrong wire.
pub(crate) fn check<'a>(net: &'a Net<'a>, diagnostics: &mut Diagnostics) -> Frames<'a> {
    let (variables, clashes) = (BTreeMap::new(), BTreeSet::new());
    let mut frames = Frames { net, variables, parents: Vec::new(), sizes: Vec::new(), known: Vec::new(), clashes };
    for &node in &net.order {
        let mut wires: Vec<&Wire> = net.wires[node].iter().collect();
        wires.sort_by_key(|wire| rank(net.port(wire.source).kind));
        for wire in wires {
            let consumer = format!("{}.{}", net.flat.nodes[node].name, wire.key.name);
            let end = WireTarget { owner: Producer::Node(node), port: net.input(node, wire), name: consumer };
            if let Some(clash) = frames.wire(wire.source, &wire.origin, &end) {
                frames.clashes.insert(node);
                diagnostics.push(clash);
            }
        }
    }
    for wire in &net.commands {
        let end =
            WireTarget { owner: Producer::Role(wire.role), port: net.command_port(wire), name: net.command_name(wire) };
        diagnostics.extend(frames.wire(wire.source, &wire.origin, &end));
    }
    frames
}

impl Frames<'_> {
    /// Returns whether a wire of the node is in the wrong frame, so that the node cannot be built.
    pub(crate) fn has_clash(&self, node: usize) -> bool {
        self.clashes.contains(&node)
    }

    /// Returns the frames of an output, `None` for those that are unknown.
    pub(crate) fn of(&mut self, source: PortRef) -> Vec<Option<String>> {
        self.known(source.producer, self.net.port(source))
    }

    fn wire(&mut self, source: PortRef, origin: &WireOrigin, end: &WireTarget<'_>) -> Option<Diagnostic> {
        let port = self.net.port(source);
        let (has, takes) = (self.known(source.producer, port), self.known(end.owner, end.port));
        let clash = has.iter().zip(&takes).any(|(a, b)| matches!((a, b), (Some(a), Some(b)) if a != b));
        if clash {
            let (from, kind) = (self.net.port_name(source), port.kind);
            let message =
                format!("`{from}` is {}, but `{}` takes {}", describe(kind, &has), end.name, describe(kind, &takes));
            let help = self.suggest_conversion(kind, [has.first()?.clone(), takes.first()?.clone()], origin);
            return Some(origin.diagnostic(Code::FrameMismatch, message).with_help(help));
        }
        for (a, b) in frame_args(port).iter().zip(frame_args(end.port)) {
            let (a, b) = (self.variable(source.producer, a), self.variable(end.owner, b));
            self.join(a, b);
        }
        None
    }

    /// Suggests a node that converts from one frame to the other.
    fn suggest_conversion(&mut self, kind: Kind, wanted: [Option<String>; 2], origin: &WireOrigin) -> Option<String> {
        let (spec, input, output, pose) = self.net.catalogue.specs().find_map(|spec| {
            let input = spec.inputs.iter().find(|input| input.kind == kind)?;
            let output = spec.outputs.iter().find(|output| output.kind == kind)?;
            let pose = spec.inputs.iter().find(|input| input.kind == Kind::Pose)?;
            let is_converter = *pose.args == [input.args[0].clone(), output.args[0].clone()];
            is_converter.then_some((spec, input, output, pose))
        })?;
        let (name, converter) = (&spec.name, with_article(&spec.name));
        let pose_port = self.find_pose(&wanted).and_then(|source| self.net.name_in(origin.scope, source));
        let Some(source) = pose_port else {
            let [from, to] = wanted.map(|frame| frame.unwrap_or_else(|| "?".into()));
            return Some(format!(
                "insert {converter} between them, with a pose of `{from}` in `{to}`, which no node outputs yet"
            ));
        };
        let (twist, from) = (&input.name, &origin.word.value);
        Some(format!(
            "insert {converter} between them, and replace `{from}` by `{name}.{}` here:\n[nodes.{name}]\ntype = \
             \"{name}\"\nin.{twist} = \"{from}\"\nin.{} = \"{source}\"",
            output.name, pose.name,
        ))
    }

    fn find_pose(&mut self, wanted: &[Option<String>]) -> Option<PortRef> {
        let net = self.net;
        let nodes = (0..net.nodes.len()).map(Producer::Node);
        let sources: Vec<PortRef> = nodes
            .flat_map(|producer| {
                let outputs = net.outputs(producer).unwrap_or_default().iter().enumerate();
                let poses = outputs.filter(|(_, output)| output.kind == Kind::Pose);
                poses.map(move |(port, _)| PortRef { producer, port }).collect::<Vec<_>>()
            })
            .collect();
        sources.into_iter().find(|source| self.of(*source) == wanted)
    }

    fn known(&mut self, owner: Producer, port: &PortSpec) -> Vec<Option<String>> {
        let args = frame_args(port).to_vec();
        args.iter()
            .map(|arg| {
                let variable = self.variable(owner, arg);
                let root = self.root(variable);
                self.known[root].clone()
            })
            .collect()
    }

    fn variable(&mut self, owner: Producer, arg: &str) -> usize {
        let key = (owner, arg.to_owned());
        if let Some(variable) = self.variables.get(&key) {
            return *variable;
        }
        let net = self.net;
        let is_letter = arg.len() == 1 && arg.starts_with(|c: char| c.is_ascii_uppercase());
        let known = match (arg, arg.strip_prefix('$'), owner) {
            ("self", _, _) => Some(net.name(owner).to_owned()),
            (_, Some(param), Producer::Node(node)) => {
                let spec = net.spec(node).expect("only known nodes have ports");
                frame_param(&net.flat.nodes[node], spec, param)
            }
            _ if is_letter => None,
            _ => Some(arg.to_owned()),
        };
        let variable = self.parents.len();
        self.parents.push(variable);
        self.sizes.push(1);
        self.known.push(known);
        self.variables.insert(key, variable);
        variable
    }

    fn root(&self, mut variable: usize) -> usize {
        while self.parents[variable] != variable {
            variable = self.parents[variable];
        }
        variable
    }

    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        if a != b {
            // The smaller tree joins the larger one, so no path to a root is long.
            let (a, b) = if self.sizes[a] < self.sizes[b] { (b, a) } else { (a, b) };
            self.parents[b] = a;
            self.sizes[a] += self.sizes[b];
            self.known[a] = self.known[a].take().or(self.known[b].take());
        }
    }
}

/// The consumer of a wire.
struct WireTarget<'a> {
    owner: Producer,
    port: &'a PortSpec,
    name: String,
}

/// Returns the frame that a parameter names, or its default.
fn frame_param(node: &FlatNode, spec: &NodeSpec, param: &str) -> Option<String> {
    let given = node.block.params.as_table().and_then(|table| table.get(param)).map(|value| value.as_str());
    given
        .unwrap_or_else(|| {
            let default = spec.params.iter().find(|spec| spec.name == param)?.default.as_deref()?;
            default.split('"').nth(1)
        })
        .map(str::to_owned)
}

/// Ranks kinds by how much they constrain frames, the most constraining first.
const fn rank(kind: Kind) -> u8 {
    match kind {
        Kind::Pose => 0,
        Kind::Jacobian => 1,
        Kind::Joints => 2,
        Kind::Image | Kind::Mask | Kind::Regions => 3,
        _ => 4,
    }
}

/// Formats the type of a node with its article.
pub(super) fn with_article(name: &str) -> String {
    let article = if name.starts_with(['a', 'e', 'i', 'o', 'u']) { "an" } else { "a" };
    format!("{article} `{name}`")
}

/// Describes a kind with its frames, for a message.
fn describe(kind: Kind, frames: &[Option<String>]) -> String {
    let name = |i: usize| frames.get(i).cloned().flatten().map_or("any frame".into(), |frame| format!("`{frame}`"));
    let kind_name = kind.with_article();
    match kind {
        Kind::Pose => format!("{kind_name} of {} in {}", name(0), name(1)),
        Kind::Jacobian => format!("{kind_name} of {} in {}", name(1), name(0)),
        Kind::Joints => format!("{kind_name} of {}", name(0)),
        _ => format!("{kind_name} in {}", name(0)),
    }
}
