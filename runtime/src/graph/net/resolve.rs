//! Names of ports: from `node.port` in a scope to the port, and back.

use super::Net;
use crate::graph::load::{Entity, Scope};
use crate::graph::plan::{PortRef, Producer};
use crate::node::{PortSpec, Word};
use crate::source::{Code, Diagnostic, closest};

/// What to do instead of reading what only a simulation knows.
const UNSEEN: &str = "a task knows what its sensors give, so that it runs on a robot too: take a port of a sensor or of \
                      a node, and check this one in a scenario";

impl Net<'_> {
    /// Where the port named by `word` is; `None` if it comes from something whose type is unknown.
    pub(crate) fn resolve(&self, scope: usize, word: &Word, depth: usize) -> Result<Option<PortRef>, Box<Diagnostic>> {
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
        Ok(Some(PortRef { producer, port }))
    }

    fn ports_of(&self, entity: Entity) -> Vec<&str> {
        let names = |producer| self.outputs(producer).unwrap_or_default().iter().map(|port| &*port.name).collect();
        match entity {
            Entity::Role(i) => names(Producer::Role(i)),
            Entity::Node(i) => names(Producer::Node(i)),
            Entity::Part(inner) => self.flat.scopes[inner].exports.iter().map(|(key, _)| key.name.as_str()).collect(),
        }
    }

    /// A port as the wires of a scope name it, if they can.
    pub(crate) fn name_in(&self, scope: usize, source: PortRef) -> Option<String> {
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

    /// A port of the scope that has the kind of an input.
    pub(super) fn candidate(&self, scope: usize, node: usize, input: &PortSpec) -> Option<String> {
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
}
