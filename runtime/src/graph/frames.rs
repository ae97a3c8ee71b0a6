//! Frames: unified over all wires, so that one adjoint serves every frame and a wrong one is a load error.

use std::collections::{BTreeMap, BTreeSet};

use super::load::FlatNode;
use super::plan::{Producer, Source};
use super::wires::{CommandWire, Model, Origin, Wire};
use crate::catalogue::Catalogue;
use crate::diagnostic::{Code, Diagnostic};
use crate::node::{NodeSpec, PortSpec};
use crate::signal::Kind;

/// Which frame every variable of every node stands for.
#[derive(Debug, Default)]
pub(crate) struct Frames {
    variables: BTreeMap<(Producer, String), usize>,
    parents: Vec<usize>,
    known: Vec<Option<String>>,
    /// Nodes with a wire in the wrong frame.
    clashes: BTreeSet<usize>,
}

impl Frames {
    /// Whether a wire of that node is in the wrong frame: it has been told, and the node cannot be built.
    pub(crate) fn has_clash(&self, node: usize) -> bool {
        self.clashes.contains(&node)
    }

    /// Unifies the frames of all wires; wires that tell most come first, so that a mistake shows where it is.
    pub(crate) fn unify(
        model: &Model<'_>,
        catalogue: &Catalogue,
        order: &[usize],
        wires: &[Vec<Wire>],
        commands: &[CommandWire],
        found: &mut Vec<Diagnostic>,
    ) -> Self {
        let mut frames = Self::default();
        let specs: Vec<NodeSpec> = catalogue.nodes().iter().map(|node| node.spec()).collect();
        for &node in order {
            let mut wires: Vec<&Wire> = wires[node].iter().collect();
            wires.sort_by_key(|wire| rank(model.port(wire.source).kind));
            for wire in wires {
                let (_, spec) = model.nodes[node].as_ref().expect("only known nodes have wires");
                let input = &spec.inputs[wire.input];
                let consumer = format!("{}.{}", model.flat.nodes[node].name, wire.key.name);
                let end = End { owner: Producer::Node(node), port: input, name: consumer };
                if let Some(clash) = frames.wire(model, wire.source, &wire.origin, &end, &specs) {
                    frames.clashes.insert(node);
                    found.push(clash);
                }
            }
        }
        for wire in commands {
            let end = End { owner: Producer::Role(wire.role), port: model.taken(wire), name: model.taken_name(wire) };
            found.extend(frames.wire(model, wire.source, &wire.origin, &end, &specs));
        }
        frames
    }

    /// The frames of an output, where they are known.
    pub(crate) fn of(&mut self, model: &Model<'_>, source: Source) -> Vec<Option<String>> {
        self.known(model, source.producer, model.port(source))
    }

    fn wire(
        &mut self,
        model: &Model<'_>,
        source: Source,
        origin: &Origin,
        end: &End<'_>,
        specs: &[NodeSpec],
    ) -> Option<Diagnostic> {
        let port = model.port(source);
        let (has, takes) = (self.known(model, source.producer, port), self.known(model, end.owner, end.port));
        let clash = has.iter().zip(&takes).any(|(a, b)| matches!((a, b), (Some(a), Some(b)) if a != b));
        if clash {
            let (from, kind) = (model.port_name(source), port.kind);
            let message =
                format!("`{from}` is {}, but `{}` takes {}", typed(kind, &has), end.name, typed(kind, &takes));
            let help = self.converter(model, kind, &has, &takes, specs, origin);
            return Some(origin.mistake(Code::FrameMismatch, message).with_help(help));
        }
        for (a, b) in frame_args(port).iter().zip(frame_args(end.port)) {
            let (a, b) = (self.variable(model, source.producer, a), self.variable(model, end.owner, b));
            self.join(a, b);
        }
        None
    }

    /// A node that takes the one and gives the other, to be put between.
    fn converter(
        &mut self,
        model: &Model<'_>,
        kind: Kind,
        has: &[Option<String>],
        takes: &[Option<String>],
        specs: &[NodeSpec],
        origin: &Origin,
    ) -> Option<String> {
        let (spec, input, pose) = specs.iter().find_map(|spec| {
            let input = spec.inputs.iter().find(|input| input.kind == kind)?;
            let output = spec.outputs.iter().find(|output| output.kind == kind)?;
            let pose = spec.inputs.iter().find(|input| input.kind == Kind::Pose)?;
            let is_converter = *pose.args == [input.args[0].clone(), output.args[0].clone()];
            is_converter.then_some((spec, input, pose))
        })?;
        let wanted = [has.first()?.clone(), takes.first()?.clone()];
        let article = if spec.name.starts_with(['a', 'e', 'i', 'o']) { "an" } else { "a" };
        let name = &spec.name;
        let Some(source) = self.find_pose(model, &wanted).and_then(|source| model.name_in(origin.scope, source)) else {
            let [from, to] = wanted.map(|frame| frame.unwrap_or_else(|| "?".into()));
            return Some(format!(
                "put {article} `{name}` between them, with a pose of `{from}` in `{to}`: nothing here gives one yet"
            ));
        };
        let (twist, from) = (&input.name, &origin.word.text);
        Some(format!(
            "put {article} `{name}` between them:\n[nodes.{name}]\ntype = \"{name}\"\nin.{twist} = \"{from}\"\nin.{} = \"{source}\"",
            pose.name,
        ))
    }

    fn find_pose(&mut self, model: &Model<'_>, wanted: &[Option<String>]) -> Option<Source> {
        let nodes = (0..model.nodes.len()).map(Producer::Node);
        let sources: Vec<Source> = nodes
            .flat_map(|producer| {
                let outputs = model.outputs(producer).unwrap_or_default().iter().enumerate();
                let poses = outputs.filter(|(_, output)| output.kind == Kind::Pose);
                poses.map(move |(port, _)| Source { producer, port }).collect::<Vec<_>>()
            })
            .collect();
        sources.into_iter().find(|source| self.of(model, *source) == wanted)
    }

    fn known(&mut self, model: &Model<'_>, owner: Producer, port: &PortSpec) -> Vec<Option<String>> {
        let args = frame_args(port).to_vec();
        args.iter()
            .map(|arg| {
                let variable = self.variable(model, owner, arg);
                let root = self.root(variable);
                self.known[root].clone()
            })
            .collect()
    }

    fn variable(&mut self, model: &Model<'_>, owner: Producer, arg: &str) -> usize {
        let key = (owner, arg.to_owned());
        if let Some(variable) = self.variables.get(&key) {
            return *variable;
        }
        let is_letter = arg.len() == 1 && arg.starts_with(|c: char| c.is_ascii_uppercase());
        let known = match (arg, arg.strip_prefix('$'), owner) {
            ("self", _, _) => Some(model.name(owner).to_owned()),
            (_, Some(param), Producer::Node(node)) => {
                let (_, spec) = model.nodes[node].as_ref().expect("only known nodes have ports");
                frame_param(&model.flat.nodes[node], spec, param)
            }
            _ if is_letter => None,
            _ => Some(arg.to_owned()),
        };
        let variable = self.parents.len();
        self.parents.push(variable);
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
            self.parents[b] = a;
            self.known[a] = self.known[a].take().or(self.known[b].take());
        }
    }
}

/// The consumer's end of a wire.
struct End<'a> {
    owner: Producer,
    port: &'a PortSpec,
    name: String,
}

/// The frames among a port's arguments.
pub(crate) fn frame_args(port: &PortSpec) -> &[std::borrow::Cow<'static, str>] {
    let from = usize::from(port.kind.has_unit()).min(port.args.len());
    &port.args[from..]
}

/// The frame that a parameter names, or its default.
fn frame_param(node: &FlatNode, spec: &NodeSpec, param: &str) -> Option<String> {
    let given = node.block.params.as_table().and_then(|table| table.get(param)).map(|value| value.as_str());
    given
        .unwrap_or_else(|| {
            let default = spec.params.iter().find(|spec| spec.name == param)?.default.as_deref()?;
            default.split('"').nth(1)
        })
        .map(str::to_owned)
}

/// Wires that pin frames down come before those that only pass them on.
const fn rank(kind: Kind) -> u8 {
    match kind {
        Kind::Pose => 0,
        Kind::Jacobian => 1,
        Kind::Joints => 2,
        Kind::Image | Kind::Mask | Kind::Regions => 3,
        _ => 4,
    }
}

/// A kind with its frames, for a person.
fn typed(kind: Kind, frames: &[Option<String>]) -> String {
    let name = |i: usize| frames.get(i).cloned().flatten().map_or("any frame".into(), |frame| format!("`{frame}`"));
    let kind_name = kind.with_article();
    match kind {
        Kind::Pose => format!("{kind_name} of {} in {}", name(0), name(1)),
        Kind::Jacobian => format!("{kind_name} of {} in {}", name(1), name(0)),
        Kind::Joints => format!("{kind_name} of {}", name(0)),
        _ => format!("{kind_name} in {}", name(0)),
    }
}
