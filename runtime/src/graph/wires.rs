//! Looks up where each wire comes from and whether it goes where its kind is taken.

use super::Key;
use super::load::{Entity, Flat, Scope};
use super::plan::{Producer, Source};
use super::policy::Age;
use crate::catalogue::Catalogue;
use crate::device::RoleType;
use crate::diagnostic::{Code, Diagnostic, closest, meant};
use crate::node::{NodeSpec, PortSpec, Word};

/// A wire that goes somewhere.
#[derive(Debug, Clone)]
pub(crate) struct Wire {
    /// Index of the input in the node's declaration.
    pub(crate) input: usize,
    pub(crate) key: Key,
    pub(crate) origin: Origin,
    pub(crate) source: Source,
}

/// Where a wire was written: the node's own, or the one into its part that it passes on.
#[derive(Debug, Clone)]
pub(crate) struct Origin {
    /// The wire that says where it comes from.
    pub(crate) word: Word,
    /// The scope it stands in.
    pub(crate) scope: usize,
    /// The node's own wire, where that only passes on an input of its part.
    pub(crate) inner: Option<Word>,
    /// How old what comes over the wire may be, as the strictest says of the node's own and all into the parts around.
    pub(crate) age: Option<Age>,
}

impl Origin {
    /// A mistake of this wire.
    pub(crate) fn mistake(&self, code: Code, message: String) -> Diagnostic {
        let diagnostic = Diagnostic::new(code, self.word.span.clone(), message);
        match &self.inner {
            Some(inner) => diagnostic.note(inner.span.clone(), "the part takes it here"),
            None => diagnostic,
        }
    }
}

/// A wire under [commands] that goes somewhere.
#[derive(Debug, Clone)]
pub(crate) struct CommandWire {
    pub(crate) role: usize,
    /// Index of the command, or of the report, in the role's declaration.
    pub(crate) command: usize,
    /// Whether it only tells the role something, and moves nothing.
    pub(crate) is_report: bool,
    pub(crate) origin: Origin,
    pub(crate) source: Source,
}

/// The declarations behind a flat graph; none where the type is unknown.
pub(crate) struct Model<'a> {
    pub(crate) flat: &'a Flat,
    pub(crate) roles: Vec<Option<&'a RoleType>>,
    /// Index of the type in the catalogue, and its declaration.
    pub(crate) nodes: Vec<Option<(usize, NodeSpec)>>,
    /// What the bench binds and only a scenario and the recorder may read: name, device and type.
    pub(crate) observed: Vec<(&'a Key, &'a Word, &'a RoleType)>,
}

impl<'a> Model<'a> {
    /// Looks up every type.
    pub(crate) fn new(flat: &'a Flat, catalogue: &'a Catalogue, found: &mut Vec<Diagnostic>) -> Self {
        let specs: Vec<NodeSpec> = catalogue.nodes().iter().map(|node| node.spec()).collect();
        let mut unknown = |word: &Word, what: &str, names: Vec<&str>| {
            let message = format!("there is no {what} `{}`", word.text);
            let help = closest(&word.text, names.into_iter(), &format!("{what}s"));
            found.push(Diagnostic::new(Code::UnknownType, word.span.clone(), message).help(help));
        };
        let role = |(_, kind): &(Key, Word)| {
            let role = catalogue.roles().iter().find(|role| role.name == kind.text);
            if role.is_none() {
                let tasks = catalogue.roles().iter().filter(|role| !role.is_observed);
                unknown(kind, "role", tasks.map(|role| &*role.name).collect());
            }
            role
        };
        let roles: Vec<Option<&RoleType>> = flat.roles.iter().map(role).collect();
        let nodes = flat.nodes.iter().map(|node| {
            let kind = node.block.kind.as_ref()?;
            let index = specs.iter().position(|spec| spec.name == kind.text);
            if index.is_none() {
                unknown(kind, "node type", specs.iter().map(|spec| &*spec.name).collect());
            }
            index.map(|index| (index, specs[index].clone()))
        });
        let nodes = nodes.collect();
        let roles = flat.roles.iter().zip(roles).map(|((_, kind), role)| not_observed(kind, role?, found)).collect();
        Self { flat, roles, nodes, observed: observed(flat, catalogue, found) }
    }

    /// The declaration of a producer's outputs.
    pub(crate) fn outputs(&self, producer: Producer) -> Option<&[PortSpec]> {
        match producer {
            Producer::Role(i) => self.roles[i].map(|role| role.outputs.as_slice()),
            Producer::Node(i) => self.nodes[i].as_ref().map(|(_, spec)| spec.outputs.as_slice()),
        }
    }

    /// Full name of a producer.
    pub(crate) fn name(&self, producer: Producer) -> &str {
        match producer {
            Producer::Role(i) => &self.flat.roles[i].0.name,
            Producer::Node(i) => &self.flat.nodes[i].name,
        }
    }

    /// Declaration of what a command wire goes to.
    pub(crate) fn taken(&self, wire: &CommandWire) -> &PortSpec {
        let role = self.roles[wire.role].expect("only known roles have commands");
        &(if wire.is_report { &role.reports } else { &role.commands })[wire.command]
    }

    /// `role.command` of a command wire.
    pub(crate) fn taken_name(&self, wire: &CommandWire) -> String {
        format!("{}.{}", self.name(Producer::Role(wire.role)), self.taken(wire).name)
    }

    /// Declaration of the port a wire comes from.
    pub(crate) fn port(&self, source: Source) -> &PortSpec {
        &self.outputs(source.producer).expect("a wire comes from a known port")[source.port]
    }

    /// `node.port` of a source.
    pub(crate) fn port_name(&self, source: Source) -> String {
        format!("{}.{}", self.name(source.producer), self.port(source).name)
    }

    /// The wires of each node that go somewhere.
    pub(crate) fn wires(&self, found: &mut Vec<Diagnostic>) -> Vec<Vec<Wire>> {
        let mut all = Vec::new();
        for (i, node) in self.flat.nodes.iter().enumerate() {
            let Some((_, spec)) = &self.nodes[i] else {
                all.push(Vec::new());
                continue;
            };
            let wire = |(key, word): &(Key, Word)| self.wire(i, spec, key, word, found);
            all.push(node.block.wires.iter().filter_map(wire).collect());
            self.missing(i, spec, found);
        }
        self.exports(found);
        all
    }

    /// An export comes from a port whether or not this graph takes it: the next one would find it broken.
    fn exports(&self, found: &mut Vec<Diagnostic>) {
        for (scope, Scope { exports, .. }) in self.flat.scopes.iter().enumerate() {
            let broken = exports.iter().filter_map(|(_, word)| self.resolve(scope, word, 0).err());
            found.extend(broken.map(|diagnostic| *diagnostic));
        }
    }

    /// What the parts of the graph export, as its wires name it, and the port behind each.
    pub(crate) fn exports_by_name(&self) -> Vec<(String, String)> {
        let names = self.flat.scopes.first().into_iter().flat_map(|scope| &scope.names);
        let parts = names.filter_map(|(name, (_, entity))| match entity {
            Entity::Part(inner) => Some((name, *inner)),
            _ => None,
        });
        let exports = parts.flat_map(|(name, inner)| {
            self.flat.scopes[inner].exports.iter().map(move |(key, word)| (format!("{name}.{}", key.name), inner, word))
        });
        let port = |(name, inner, word)| Some((name, self.port_name(self.resolve(inner, word, 0).ok()??)));
        exports.filter_map(port).collect()
    }

    /// What the parts export.
    pub(crate) fn exported(&self) -> impl Iterator<Item = Producer> {
        let scopes = self.flat.scopes.iter().enumerate();
        let words =
            scopes.flat_map(|(scope, Scope { exports, .. })| exports.iter().map(move |(_, word)| (scope, word)));
        words.filter_map(|(scope, word)| Some(self.resolve(scope, word, 0).ok()??.producer))
    }

    fn wire(&self, node: usize, spec: &NodeSpec, key: &Key, word: &Word, found: &mut Vec<Diagnostic>) -> Option<Wire> {
        let source = self.resolve(self.flat.nodes[node].scope, word, 0).unwrap_or_else(|diagnostic| {
            found.push(*diagnostic);
            None
        });
        let named = spec.inputs.iter().position(|input| !input.need.is_many && input.name == key.name);
        let Some(input) = named.or_else(|| spec.inputs.iter().position(|input| input.need.is_many)) else {
            let message = format!("`{}` has no input `{}`", spec.name, key.name);
            let help = closest(&key.name, spec.inputs.iter().map(|input| &*input.name), "inputs");
            found.push(Diagnostic::new(Code::UnknownInput, key.span.clone(), message).help(help));
            return None;
        };
        let source = source?;
        let (has, takes) = (self.port(source).kind, spec.inputs[input].kind);
        if has != takes {
            let consumer = format!("{}.{}", self.flat.nodes[node].name, key.name);
            let origin = self.origin(self.flat.nodes[node].scope, word);
            found.push(self.kind_mismatch(source, &consumer, takes, &origin));
            return None;
        }
        Some(Wire { input, key: key.clone(), origin: self.origin(self.flat.nodes[node].scope, word), source })
    }

    /// Where a wire was written.
    fn origin(&self, scope: usize, word: &Word) -> Origin {
        let of = |word: &Word| self.flat.ages.get(&word.span.start).copied();
        let (mut at, mut outer, mut age) = (scope, word, of(word));
        while let (Some(("inputs", port)), Some(parent)) = (outer.text.split_once('.'), self.flat.scopes[at].parent) {
            let Some((_, wire)) = self.flat.scopes[at].inputs.iter().find(|(key, _)| key.name == port) else { break };
            (at, outer) = (parent, wire);
            age = of(wire).map(|own| own.and(age)).or(age);
        }
        Origin { age, word: outer.clone(), scope: at, inner: (at != scope).then(|| word.clone()) }
    }

    /// A port as the wires of a scope name it, if they can.
    pub(crate) fn name_in(&self, scope: usize, source: Source) -> Option<String> {
        let names = self.flat.scopes[scope].names.iter();
        names.into_iter().find_map(|(name, (_, entity))| match *entity {
            Entity::Role(i) if source.producer == Producer::Role(i) => {
                Some(format!("{name}.{}", self.port(source).name))
            }
            Entity::Node(i) if source.producer == Producer::Node(i) => {
                Some(format!("{name}.{}", self.port(source).name))
            }
            Entity::Part(inner) => {
                let mut exports = self.flat.scopes[inner].exports.iter();
                let export =
                    exports.find(|(_, word)| matches!(self.resolve(inner, word, 0), Ok(Some(s)) if s == source))?;
                Some(format!("{name}.{}", export.0.name))
            }
            _ => None,
        })
    }

    fn kind_mismatch(&self, source: Source, consumer: &str, takes: crate::signal::Kind, origin: &Origin) -> Diagnostic {
        let port = self.port_name(source);
        let has = self.port(source).kind.with_article();
        let message = format!("`{port}` is {has}, but `{consumer}` takes {}", takes.with_article());
        let outputs = self.outputs(source.producer).unwrap_or_default();
        let other = outputs.iter().find(|output| output.kind == takes);
        let help = other.map(|other| {
            let written = origin.word.text.rsplit_once('.').map_or("", |(node, _)| node);
            format!("`{written}.{}` is {}", other.name, takes.with_article())
        });
        // What an export hides is no way out.
        let help = help.filter(|_| self.name_in(origin.scope, source).is_some_and(|name| name == origin.word.text));
        origin.mistake(Code::KindMismatch, message).with_help(help)
    }

    fn missing(&self, node: usize, spec: &NodeSpec, found: &mut Vec<Diagnostic>) {
        let block = &self.flat.nodes[node].block;
        let names = || spec.inputs.iter().map(|input| &*input.name);
        for input in spec.inputs.iter().filter(|input| input.need.must_be_wired) {
            let is_meant =
                |key: &Key| !names().any(|name| name == key.name) && meant(&key.name, names()) == Some(&input.name);
            let mut wired = block.wires.iter().map(|(key, _)| key).chain(&block.unread);
            if !wired.any(|key| key.name == input.name || is_meant(key)) {
                let name = &input.name;
                let message = format!("`{}` needs `in.{name}`, {}", block.key.name, input.kind.with_article());
                let help = self.candidate(self.flat.nodes[node].scope, node, input);
                let help = format!("add `in.{name} = \"{}\"`", help.as_deref().unwrap_or("node.port"));
                found.push(Diagnostic::new(Code::MissingInput, block.key.span.clone(), message).help(help));
            }
        }
    }

    /// A port of the scope that has the kind of an input.
    fn candidate(&self, scope: usize, node: usize, input: &PortSpec) -> Option<String> {
        self.flat.scopes[scope].names.iter().find_map(|(name, (_, entity))| {
            let outputs = match *entity {
                Entity::Role(i) => self.outputs(Producer::Role(i)),
                Entity::Node(i) if i != node => self.outputs(Producer::Node(i)),
                Entity::Node(_) => None,
                Entity::Part(inner) => {
                    let (export, word) =
                        self.flat.scopes[inner].exports.iter().find(|(key, _)| key.name == input.name)?;
                    let source = self.resolve(inner, word, 0).ok().flatten()?;
                    return (self.port(source).kind == input.kind).then(|| format!("{name}.{}", export.name));
                }
            };
            let port = outputs?.iter().find(|output| output.kind == input.kind && output.name == input.name)?;
            Some(format!("{name}.{}", port.name))
        })
    }

    /// Where the port named by `word` is; `None` if it comes from something whose type is unknown.
    pub(crate) fn resolve(&self, scope: usize, word: &Word, depth: usize) -> Result<Option<Source>, Box<Diagnostic>> {
        const DEEPEST: usize = 64;
        let wrong = |message: String, help: String| {
            Box::new(Diagnostic::new(Code::UnknownPort, word.span.clone(), message).help(help))
        };
        if depth > DEEPEST {
            let message = format!("`{}` comes from itself, through the inputs and exports of parts", word.text);
            return Err(Box::new(Diagnostic::new(Code::Loop, word.span.clone(), message)));
        }
        let names = &self.flat.scopes[scope].names;
        let Some((name, port)) = word.text.split_once('.').filter(|(_, port)| !port.contains('.')) else {
            let first = word.text.split('.').next().unwrap_or_default();
            let ports = names.get(first).map(|(_, entity)| self.ports_of(*entity)).unwrap_or_default();
            let list = ports.iter().map(|port| format!("`{first}.{port}`")).collect::<Vec<_>>().join(", ");
            let help =
                if list.is_empty() { "a port is written `node.port`".into() } else { format!("ports here: {list}") };
            return Err(wrong(format!("`{}` is no port", word.text), help));
        };
        if name == "inputs"
            && let Some(parent) = self.flat.scopes[scope].parent
        {
            let Scope { inputs, declared, .. } = &self.flat.scopes[scope];
            if !declared.iter().any(|(key, _)| key.name == port) {
                let help = closest(port, declared.iter().map(|(key, _)| key.name.as_str()), "inputs");
                return Err(wrong(format!("the part has no input `{port}`"), help));
            }
            // An input that is declared and not wired has been complained about.
            let wired = inputs.iter().find(|(key, _)| key.name == port);
            return wired.map_or(Ok(None), |(_, word)| self.resolve(parent, word, depth + 1));
        }
        let Some((_, entity)) = names.get(name) else {
            if self.observed.iter().any(|(key, ..)| key.name == name) {
                let message = format!("`{}` is for scenarios and the recorder: no task reads it", word.text);
                return Err(Box::new(Diagnostic::new(Code::ObservedRole, word.span.clone(), message).help(UNSEEN)));
            }
            let help = closest(name, names.keys().map(String::as_str), "roles, nodes and parts");
            return Err(wrong(format!("nothing here is called `{name}`"), help));
        };
        let no_port = || {
            let ports = self.ports_of(*entity);
            wrong(format!("`{name}` has no output `{port}`"), closest(port, ports.into_iter(), "outputs"))
        };
        let producer = match *entity {
            Entity::Role(i) => Producer::Role(i),
            Entity::Node(i) => Producer::Node(i),
            Entity::Part(inner) => {
                let export = self.flat.scopes[inner].exports.iter().find(|(key, _)| key.name == port);
                let (_, word) = export.ok_or_else(no_port)?;
                return self.resolve(inner, word, depth + 1);
            }
        };
        let Some(outputs) = self.outputs(producer) else { return Ok(None) };
        let port = outputs.iter().position(|output| output.name == port).ok_or_else(no_port)?;
        Ok(Some(Source { producer, port }))
    }

    fn ports_of(&self, entity: Entity) -> Vec<&str> {
        let names = |producer| self.outputs(producer).unwrap_or_default().iter().map(|port| &*port.name).collect();
        match entity {
            Entity::Role(i) => names(Producer::Role(i)),
            Entity::Node(i) => names(Producer::Node(i)),
            Entity::Part(inner) => self.flat.scopes[inner].exports.iter().map(|(key, _)| key.name.as_str()).collect(),
        }
    }

    /// The wires of commands and reports that go somewhere; a command that nothing drives is a mistake.
    pub(crate) fn commands(&self, found: &mut Vec<Diagnostic>) -> Vec<CommandWire> {
        let mut wires = Vec::new();
        for (role, command, word) in &self.flat.commands {
            let index = self.flat.roles.iter().position(|(key, _)| key.name == role.name);
            let Some(index) = index else {
                let message = format!("there is no role `{}`", role.name);
                let help = closest(&role.name, self.flat.roles.iter().map(|(key, _)| key.name.as_str()), "roles");
                found.push(Diagnostic::new(Code::UnknownPort, role.span.clone(), message).help(help));
                continue;
            };
            wires.extend(self.command(index, command, word, found));
        }
        self.undriven(found);
        wires
    }

    fn command(&self, role: usize, key: &Key, word: &Word, found: &mut Vec<Diagnostic>) -> Option<CommandWire> {
        let source = self.resolve(0, word, 0).unwrap_or_else(|diagnostic| {
            found.push(*diagnostic);
            None
        });
        let RoleType { commands, reports, .. } = self.roles[role]?;
        let taken = commands.iter().map(|port| (false, port)).chain(reports.iter().map(|port| (true, port)));
        let Some((place, (is_report, takes))) = taken.enumerate().find(|(_, (_, port))| port.name == key.name) else {
            let message = format!("`{}` takes no command `{}`", self.name(Producer::Role(role)), key.name);
            let help = closest(&key.name, commands.iter().chain(reports).map(|port| &*port.name), "commands");
            found.push(Diagnostic::new(Code::UnknownInput, key.span.clone(), message).help(help));
            return None;
        };
        let source = source?;
        if self.port(source).kind != takes.kind {
            let consumer = format!("{}.{}", self.name(Producer::Role(role)), key.name);
            found.push(self.kind_mismatch(source, &consumer, takes.kind, &self.origin(0, word)));
            return None;
        }
        let command = if is_report { place - commands.len() } else { place };
        Some(CommandWire { role, command, is_report, origin: self.origin(0, word), source })
    }

    fn undriven(&self, found: &mut Vec<Diagnostic>) {
        for ((key, _), role) in self.flat.roles.iter().zip(&self.roles) {
            for command in role.iter().flat_map(|role| &role.commands) {
                let is_driven =
                    |(role, driven, _): &&(Key, Key, Word)| role.name == key.name && driven.name == command.name;
                // A command wire that goes nowhere has been complained about, and may be the one that is missing.
                let is_strange = |(role, driven, _): &&(Key, Key, Word)| {
                    let roles =
                        || self.flat.roles.iter().zip(&self.roles).filter(|((key, _), _)| key.name == role.name);
                    let known = roles().any(|(_, kind)| {
                        kind.is_some_and(|kind| {
                            kind.commands.iter().chain(&kind.reports).any(|c| c.name == driven.name)
                        })
                    });
                    !known && (role.name == key.name || roles().next().is_none())
                };
                if !self.flat.commands.iter().any(|wire| is_driven(&wire) || is_strange(&wire)) {
                    let message = format!("nothing drives `{}.{}`", key.name, command.name);
                    let port = self.candidate(0, usize::MAX, command).unwrap_or_else(|| "node.port".into());
                    let help = format!("add `{}.{} = \"{port}\"` under [commands]", key.name, command.name);
                    found.push(Diagnostic::new(Code::UndrivenCommand, key.span.clone(), message).help(help));
                }
            }
        }
    }
}

/// What to do instead of reading what only a simulation knows.
const UNSEEN: &str = "a task knows what its sensors give, so that it runs on a robot too: take a port of a sensor or of \
                      a node, and check this one in a scenario";

/// The type of a role, unless it is one that no task may declare: that is told.
fn not_observed<'r>(kind: &Word, role: &'r RoleType, found: &mut Vec<Diagnostic>) -> Option<&'r RoleType> {
    if role.is_observed {
        let message = format!("a `{}` is for scenarios and the recorder: no task declares it", kind.text);
        let help = format!("take it out: a bench binds it, as `{} = \"device\"`", role.observed_name());
        found.push(Diagnostic::new(Code::ObservedRole, kind.span.clone(), message).help(help));
    }
    (!role.is_observed).then_some(role)
}

/// What the bench binds beside what the task declares, and only a scenario and the recorder may read.
fn observed<'a>(
    flat: &'a Flat,
    catalogue: &'a Catalogue,
    found: &mut Vec<Diagnostic>,
) -> Vec<(&'a Key, &'a Word, &'a RoleType)> {
    let bound = flat.bench.iter().flat_map(|bench| &bench.bind);
    let undeclared = bound.filter(|(key, _)| !flat.roles.iter().any(|(role, _)| role.name == key.name));
    let all = undeclared.filter_map(|(key, device)| {
        let role = catalogue.roles().iter().find(|role| role.is_observed_as(&key.name))?;
        Some((key, device, role))
    });
    let mut all: Vec<_> = all.collect();
    all.retain(|(key, ..)| {
        let taken = flat.scopes.first().and_then(|scope| scope.names.get(&key.name));
        if let Some((other, _)) = taken {
            let message = format!("`{}` is the name of two things", key.name);
            let diagnostic = Diagnostic::new(Code::DuplicateName, other.span.clone(), message);
            let diagnostic = diagnostic.note(key.span.clone(), "the bench binds a role of that name here");
            found.push(
                diagnostic.help("what a scenario reads has its name from the bench: rename the node or the part"),
            );
        }
        taken.is_none()
    });
    all
}
