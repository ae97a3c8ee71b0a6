//! Checks the frames of all wires by unification.
//!
//! Node types declare frames as variables, so one type works in any frame and a wrong frame is a load error.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use super::frame_names::FrameNames;
use crate::graph::net::{Net, Wire, WireOrigin};
use crate::graph::plan::{PortRef, Producer};
use crate::node::{PortSpec, frame_args};
use crate::signal::Kind;
use crate::source::{Code, Diagnostic, Diagnostics, Edit};

/// The frame variables of all nodes, and the frames to which they are bound.
pub(crate) struct Frames<'a> {
    net: &'a Net<'a>,
    names: FrameNames<'a>,
    variables: BTreeMap<(Producer, String), usize>,
    parents: Vec<usize>,
    /// The number of variables below each root.
    sizes: Vec<usize>,
    known: Vec<Option<KnownFrame>>,
    /// Nodes with a wire in the wrong frame.
    clashes: BTreeSet<usize>,
}

/// A frame, and the place that determined it.
#[derive(Debug, Clone)]
struct KnownFrame {
    name: String,
    place: Range<usize>,
}

/// Unifies the frames of all wires, and reports wires in the wrong frame.
///
/// The most constrained wires are unified first (poses before twists), so that the error is reported on the wrong wire.
pub(crate) fn check<'a>(net: &'a Net<'a>, diagnostics: &mut Diagnostics) -> Frames<'a> {
    let names = FrameNames::new(net);
    names.check(diagnostics);
    let (variables, clashes) = (BTreeMap::new(), BTreeSet::new());
    let mut frames =
        Frames { net, names, variables, parents: Vec::new(), sizes: Vec::new(), known: Vec::new(), clashes };
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
        // A frame that belongs to another one, as the base to its arm, is known once the inputs are.
        let outputs = net.outputs(Producer::Node(node)).unwrap_or_default();
        outputs.iter().for_each(|output| drop(frames.known(Producer::Node(node), output)));
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
        self.names(source.producer, self.net.port(source))
    }

    fn names(&mut self, owner: Producer, port: &PortSpec) -> Vec<Option<String>> {
        self.known(owner, port).into_iter().map(|known| Some(known?.name)).collect()
    }

    fn wire(&mut self, source: PortRef, origin: &WireOrigin, end: &WireTarget<'_>) -> Option<Diagnostic> {
        let port = self.net.port(source);
        let (has, takes) = (self.known(source.producer, port), self.known(end.owner, end.port));
        let differ = |(a, b): &(&Option<KnownFrame>, &Option<KnownFrame>)| match (a, b) {
            (Some(a), Some(b)) => a.name != b.name,
            _ => false,
        };
        if let Some((Some(a), Some(b))) = has.iter().zip(&takes).find(differ) {
            let notes = [a, b].map(|known| (known.place.clone(), format!("`{}` comes from here", known.name)));
            let [has, takes] =
                [(source.producer, port), (end.owner, end.port)].map(|(owner, port)| self.names(owner, port));
            let (from, kind) = (self.net.port_name(source), port.kind);
            let message =
                format!("`{from}` is {}, but `{}` takes {}", describe(kind, &has), end.name, describe(kind, &takes));
            let help = self.suggest_conversion(kind, [has.first()?.clone(), takes.first()?.clone()], origin);
            let mut diagnostic = origin.diagnostic(Code::FrameMismatch, message);
            if let Some((help, edits)) = help {
                diagnostic = edits.into_iter().fold(diagnostic.help(help), Diagnostic::edit);
            }
            diagnostic.notes.extend(notes);
            return Some(diagnostic);
        }
        for (a, b) in frame_args(port).iter().zip(frame_args(end.port)) {
            let (a, b) = (self.variable(source.producer, a), self.variable(end.owner, b));
            self.join(a, b);
        }
        None
    }

    /// Suggests a node that converts from one frame to the other.
    fn suggest_conversion(
        &mut self,
        kind: Kind,
        wanted: [Option<String>; 2],
        origin: &WireOrigin,
    ) -> Option<(String, Vec<Edit>)> {
        let (spec, input, output, pose) = self.net.catalogue.specs().find_map(|spec| {
            let input = spec.inputs.iter().find(|input| input.kind == kind)?;
            let output = spec.outputs.iter().find(|output| output.kind == kind)?;
            let pose = spec.inputs.iter().find(|input| input.kind == Kind::Pose)?;
            let is_converter = kind != Kind::Pose && *pose.args == [input.args[0].clone(), output.args[0].clone()];
            is_converter.then_some((spec, input, output, pose))
        })?;
        let (name, converter) = (&spec.name, with_article(&spec.name));
        let pose_port = self.find_pose(&wanted).and_then(|source| self.net.name_in(origin.scope, source));
        let Some(source) = pose_port else {
            let [from, to] = wanted.map(|frame| frame.unwrap_or_else(|| "?".into()));
            let help = format!(
                "insert {converter} between them, with a pose of `{from}` in `{to}`, which no node outputs yet"
            );
            return Some((help, Vec::new()));
        };
        let (twist, from) = (&input.name, &origin.word.value);
        let (output, place) = (&output.name, &origin.word.span);
        let block =
            format!("[nodes.{name}]\ntype = \"{name}\"\nin.{twist} = \"{from}\"\nin.{} = \"{source}\"", pose.name);
        let help = format!("insert {converter} between them, and replace `{from}` by `{name}.{output}` here:\n{block}");
        let is_taken = self.net.flat.scopes[origin.scope].names.contains_key(&**name);
        let edits = [
            Edit::Replace(place.clone(), format!("\"{name}.{output}\"")),
            Edit::Append(place.clone(), format!("\n{block}")),
        ];
        Some((help, if is_taken { Vec::new() } else { edits.into() }))
    }

    fn find_pose(&mut self, wanted: &[Option<String>]) -> Option<PortRef> {
        let net = self.net;
        let nodes = (0..net.nodes.len()).map(Producer::Node);
        let mut sources: Vec<PortRef> = nodes
            .flat_map(|producer| {
                let outputs = net.outputs(producer).unwrap_or_default().iter().enumerate();
                let poses = outputs.filter(|(_, output)| output.kind == Kind::Pose);
                poses.map(move |(port, _)| PortRef { producer, port }).collect::<Vec<_>>()
            })
            .collect();
        // A measured pose first: behind the limiters, no other one is accepted.
        sources.sort_by_key(|source| net.port(*source).quantity.is_none());
        sources.into_iter().find(|source| self.of(*source) == wanted)
    }

    fn known(&mut self, owner: Producer, port: &PortSpec) -> Vec<Option<KnownFrame>> {
        let args = frame_args(port).to_vec();
        let known = args.iter().map(|arg| {
            let variable = self.variable(owner, arg);
            self.known[self.root(variable)].clone()
        });
        known.collect()
    }

    fn variable(&mut self, owner: Producer, arg: &str) -> usize {
        let key = (owner, arg.to_owned());
        if let Some(variable) = self.variables.get(&key) {
            return *variable;
        }
        let known = self.first_known(owner, arg);
        let variable = self.parents.len();
        self.parents.push(variable);
        self.sizes.push(1);
        self.known.push(known);
        self.variables.insert(key, variable);
        variable
    }

    /// Returns the frame that a declaration determines by itself.
    fn first_known(&mut self, owner: Producer, arg: &str) -> Option<KnownFrame> {
        let net = self.net;
        let is_letter = arg.len() == 1 && arg.starts_with(|c: char| c.is_ascii_uppercase());
        let place = net.place(owner);
        match (arg.split_once('.'), arg.strip_prefix('$'), owner) {
            (Some((whole, part)), ..) => {
                let whole = self.variable(owner, whole);
                let whole = self.known[self.root(whole)].clone();
                // An unknown frame has no parts that another one could be mistaken for, unless a mistake hides it.
                if whole.is_none() && owner.node().is_some_and(|node| net.lacks_wires(node)) {
                    return None;
                }
                let name = whole.map_or_else(|| net.name(owner).to_owned(), |whole| whole.name);
                Some(KnownFrame { name: format!("{name}.{part}"), place })
            }
            (_, Some(param), Producer::Node(node)) => {
                let (name, place) = self.names.named(node, param)?;
                Some(KnownFrame { name, place })
            }
            _ if arg == "self" => Some(KnownFrame { name: net.name(owner).to_owned(), place }),
            _ if is_letter => None,
            _ => Some(KnownFrame { name: arg.to_owned(), place }),
        }
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

/// Ranks kinds by how much they constrain frames, the most constraining first.
const fn rank(kind: Kind) -> u8 {
    match kind {
        Kind::Pose => 0,
        Kind::Jacobian => 1,
        Kind::Joints => 2,
        Kind::Image | Kind::VectorImage | Kind::Mask | Kind::Regions => 3,
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
