//! Names of ports: from `node.port` in a scope to the port, and back.

use super::scope_ports::ScopePorts;
use super::{Net, Resolved};
use crate::graph::load::{Entity, Scope};
use crate::graph::plan::{PortRef, Producer};
use crate::graph::syntax::{INPUTS, MODES};
use crate::node::{PortSpec, Spanned};
use crate::source::{Code, Diagnostic, quoted, suggest_name};

/// Parts through which one wire may pass; more means that it refers to itself.
const MAX_DEPTH: usize = 64;

/// Help for a task that reads a role reserved for scenarios.
const OBSERVED_HELP: &str = "this value does not exist on a robot: use a port of a sensor or of a node, and check this \
                             one in a scenario";

impl Net<'_> {
    /// Resolves the port that a wire names in a scope, through the inputs and exports of parts.
    ///
    /// A wire to an unknown type or to an unwired input of a part has its own diagnostic.
    pub(crate) fn resolve(&self, scope: usize, word: &Spanned<String>) -> Resolved<PortRef> {
        self.resolve_at_depth(scope, word, 0)
    }

    fn resolve_at_depth(&self, scope: usize, word: &Spanned<String>, depth: usize) -> Resolved<PortRef> {
        let diagnostic = |code: Code, message: String| Diagnostic::new(code, word.span.clone(), message);
        // The mistake is in the port behind the dot.
        let unknown_port = |length: usize, message: String| {
            Diagnostic::new(Code::UnknownPort, word.part(word.value.len() - length..word.value.len()), message)
        };
        if depth > MAX_DEPTH {
            let message = format!("`{}` refers to itself, through the inputs and exports of parts", word.value);
            return diagnostic(Code::Loop, message).into_err();
        }
        let Scope { names, inputs, declared, parent, task, .. } = &self.flat.scopes[scope];
        if let Some((name, rest)) = word.value.split_once('.').filter(|(_, rest)| rest.contains('.'))
            && let Some((_, Entity::Part(inner))) = names.get(name)
        {
            // A path into a part, as in `left.touch.image`.
            let rest = Spanned { value: rest.to_owned(), span: word.part(name.len() + 1..word.value.len()) };
            return self.resolve_at_depth(*inner, &rest, depth + 1);
        }
        let Some((name, port)) = word.value.split_once('.').filter(|(_, port)| !port.contains('.')) else {
            return self.not_a_port(scope, word).into_err();
        };
        if name == INPUTS
            && let Some(parent) = *parent
        {
            if declared.position(port).is_none() {
                let message = format!("the part has no input `{port}`");
                return unknown_port(port.len(), message).suggest(port, declared.names(), "inputs").into_err();
            }
            // An input that is declared and not wired has its own diagnostic.
            let wire = inputs.get(port).ok_or(None)?;
            return self.resolve_at_depth(parent, &wire.from, depth + 1);
        }
        if name == MODES && self.flat.tasks[*task].scope == scope {
            let modes = self.flat.mode_names(*task);
            let Some(number) = modes.clone().position(|mode| mode == port) else {
                let message = format!("there is no mode `{port}`");
                return unknown_port(port.len(), message).suggest(port, modes, "modes").into_err();
            };
            return Ok(PortRef { producer: Producer::Task(*task), port: number });
        }
        let Some((_, entity)) = names.get(name) else {
            return self.unknown_name(scope, word, name, port).into_err();
        };
        self.port_of(*entity, port, depth).unwrap_or_else(|| {
            let message = format!("`{name}` has no output `{port}`");
            if let Some(help) = self.path_help(name, *entity, port) {
                return unknown_port(port.len(), message).help(help).into_err();
            }
            unknown_port(port.len(), message).suggest(port, self.ports_of(*entity).into_iter(), "outputs").into_err()
        })
    }

    /// Reports a word `name.port` whose name is no role, node or part of a scope.
    fn unknown_name(&self, scope: usize, word: &Spanned<String>, name: &str, port: &str) -> Diagnostic {
        let whole = |code: Code, message: String| Diagnostic::new(code, word.span.clone(), message);
        if self.observed.iter().any(|(key, ..)| key.name == name) {
            let message = format!("`{}` is only for scenarios and recordings: a task cannot read it", word.value);
            return whole(Code::ObservedRole, message).help(OBSERVED_HELP);
        }
        let Scope { names, declared, parent, .. } = &self.flat.scopes[scope];
        let message = format!("there is no role, node or part `{name}`");
        // Both names of the port may be wrong, for example in capital letters.
        let meant = suggest_name(name, names.keys().map(String::as_str).chain(parent.map(|_| INPUTS)));
        let ports = match meant {
            Some(INPUTS) => declared.names().collect(),
            meant => meant.and_then(|best| names.get(best)).map_or_else(Vec::new, |(_, entity)| self.ports_of(*entity)),
        };
        let both = suggest_name(port, ports.iter().copied()).filter(|_| !ports.contains(&port)).zip(meant);
        if let Some((port, best)) = both {
            return whole(Code::UnknownPort, message).instead(&word.value, &format!("{best}.{port}"));
        }
        let diagnostic = Diagnostic::new(Code::UnknownPort, word.part(0..name.len()), message);
        if self.flat.bench.as_ref().is_some_and(|bench| bench.bind.position(name).is_some()) {
            return diagnostic.help(format!("declare `{name}` under [roles]: the bench binds it"));
        }
        self.suggest_name_in(scope, name, diagnostic)
    }

    /// Resolves a port of a role, a node or a part, or returns `None` if it has none with that name.
    fn port_of(&self, entity: Entity, port: &str, depth: usize) -> Option<Resolved<PortRef>> {
        let producer = match entity {
            Entity::Role(i) => Producer::Role(i),
            Entity::Node(i) => Producer::Node(i),
            Entity::Part(inner) => {
                let word = self.flat.scopes[inner].exports.get(port)?;
                return Some(self.resolve_at_depth(inner, word, depth + 1));
            }
            Entity::Unknown => return Some(Err(None)),
        };
        let Some(outputs) = self.outputs(producer) else { return Some(Err(None)) };
        let port = outputs.iter().position(|output| output.name == port)?;
        Some(Ok(PortRef { producer, port }))
    }

    /// Reports a word that is neither `node.port` nor the path of a port in a part.
    fn not_a_port(&self, scope: usize, word: &Spanned<String>) -> Diagnostic {
        let first = word.value.split('.').next().unwrap_or_default();
        let is_path = word.value.contains('.') && first != INPUTS && !self.flat.scopes[scope].names.contains_key(first);
        let diagnostic = match is_path {
            true => {
                let message = format!("there is no role, node or part `{first}`");
                Diagnostic::new(Code::UnknownPort, word.part(0..first.len()), message)
            }
            false => Diagnostic::new(Code::UnknownPort, word.span.clone(), format!("`{}` is not a port", word.value)),
        };
        match self.port_like(scope, &word.value) {
            Some(port) => diagnostic.instead(&word.value, &port),
            None if is_path => self.suggest_name_in(scope, first, diagnostic),
            None => diagnostic.help(self.ports_help(scope, word)),
        }
    }

    /// Suggests a name for an unknown one in a scope, or how to get what the file around that scope calls by this name.
    fn suggest_name_in(&self, scope: usize, name: &str, diagnostic: Diagnostic) -> Diagnostic {
        let Scope { names, parent, part, roles, .. } = &self.flat.scopes[scope];
        if let Some((own, _)) = roles.iter().find(|(own, outer)| *outer == name && names.contains_key(*own)) {
            return diagnostic.instead(name, own);
        }
        let around = parent.filter(|around| self.flat.scopes[*around].names.contains_key(name));
        if let Some(part) = around.and(part.as_ref()) {
            return diagnostic.help(format!(
                "`{name}` belongs to the file around this one: declare an input under [{INPUTS}] here, read it as \
                 `{INPUTS}.NAME`, and wire it in [parts.{}] with `in.NAME`",
                part.name
            ));
        }
        let known = names.keys().map(String::as_str).chain(parent.map(|_| INPUTS));
        diagnostic.suggest(name, known, "roles, nodes and parts")
    }

    /// Returns how to name a port in a part that does not export it: a flag of a mode, or any port if it has no exports.
    fn path_help(&self, name: &str, entity: Entity, port: &str) -> Option<String> {
        let Entity::Part(inner) = entity else { return None };
        let Scope { exports, task, .. } = &self.flat.scopes[inner];
        let is_mode = self.flat.tasks[*task].scope == inner && self.flat.mode_names(*task).any(|mode| mode == port);
        if is_mode {
            return Some(format!("write `{name}.{MODES}.{port}`, which is set while `{name}` is in that mode"));
        }
        let (example, _) = self.ports_in(inner).next().filter(|_| exports.is_empty())?;
        Some(format!("name a port in the part by its path, such as `{name}.{example}`"))
    }

    /// Returns the help for a word that is not of the form `node.port`.
    fn ports_help(&self, scope: usize, word: &Spanned<String>) -> String {
        let first = word.value.split('.').next().unwrap_or_default();
        let entity = self.flat.scopes[scope].names.get(first);
        let ports = entity.map(|(_, entity)| self.ports_of(*entity)).unwrap_or_default();
        if ports.is_empty() {
            return "write a port as `node.port`".into();
        }
        format!("ports here: {}", quoted(ports.iter().map(|port| format!("{first}.{port}"))))
    }

    /// Returns the port that a word of another form than `node.port` misspells.
    fn port_like(&self, scope: usize, word: &str) -> Option<String> {
        let inputs = self.flat.scopes[scope].declared.iter().map(|(key, _)| format!("{INPUTS}.{}", key.name));
        let known: Vec<String> = self.ports_in(scope).map(|(name, _)| name).chain(inputs).collect();
        suggest_name(word, known.iter().map(String::as_str)).map(str::to_owned)
    }

    fn ports_of(&self, entity: Entity) -> Vec<&str> {
        let names = |producer| self.outputs(producer).unwrap_or_default().iter().map(|port| &*port.name).collect();
        match entity {
            Entity::Role(i) => names(Producer::Role(i)),
            Entity::Node(i) => names(Producer::Node(i)),
            Entity::Part(inner) => self.flat.scopes[inner].exports.names().collect(),
            Entity::Unknown => Vec::new(),
        }
    }

    /// Returns the ports that the wires of a scope can read, each with its name there.
    pub(crate) fn ports_in(&self, scope: usize) -> impl Iterator<Item = (String, PortRef)> {
        let names = self.flat.scopes[scope].names.iter();
        names.flat_map(move |(name, (_, entity))| {
            let ports = self.ports_of(*entity).into_iter();
            ports.filter_map(move |port| Some((format!("{name}.{port}"), self.port_of(*entity, port, 0)?.ok()?)))
        })
    }

    fn scope_ports(&self, scope: usize) -> &ScopePorts {
        let ports = || ScopePorts::new(self.ports_in(scope), |port| self.port(port).kind);
        self.scope_ports[scope].get_or_init(ports)
    }

    /// Returns the name by which the wires of a scope refer to a port, or `None` if they cannot.
    pub(crate) fn name_in(&self, scope: usize, source: PortRef) -> Option<&str> {
        self.scope_ports(scope).name(source)
    }

    /// Returns the name of the first port for which `fits` holds and that the wires of a scope can read.
    pub(crate) fn find_port(&self, scope: usize, fits: impl Fn(PortRef) -> bool) -> Option<&str> {
        self.scope_ports(scope).find(fits)
    }

    /// Returns a port of the scope with the name and the kind of an input of a node, as a suggestion for its wire.
    pub(crate) fn find_candidate(&self, scope: usize, node: Option<usize>, input: &PortSpec) -> Option<&str> {
        // A port that follows from the node would close a loop.
        let follows = |producer: Producer| node.is_some_and(|node| self.upstream(producer.node())[node]);
        let ports = self.scope_ports(scope);
        // What the other inputs follow from has their units too.
        let upstream = node.map(|node| self.upstream([node])).unwrap_or_default();
        let is_upstream = |producer: Producer| producer.node().is_some_and(|node| upstream.get(node) == Some(&true));
        let near = ports.candidate(input, |producer| is_upstream(producer) && !follows(producer));
        near.or_else(|| ports.candidate(input, |producer| !follows(producer)))
    }

    /// Returns the exports of the parts in the graph and in its tasks, and what the tasks call the roles: each with the
    /// full name of the port behind it.
    pub(crate) fn exports_by_name(&self) -> Vec<(String, String)> {
        let ports = self.flat.tasks.iter().flat_map(|task| {
            let ports = self.ports_in(task.scope);
            ports.map(|(name, port)| (format!("{}{name}", task.prefix), self.port_name(port)))
        });
        // A role of the graph, or a node of a task, has its full name there.
        ports.filter(|(name, port)| name != port).collect()
    }

    /// Returns the producers of all exported ports.
    pub(crate) fn exported(&self) -> impl Iterator<Item = Producer> {
        let scopes = self.flat.scopes.iter().enumerate();
        let words =
            scopes.flat_map(|(scope, Scope { exports, .. })| exports.iter().map(move |(_, word)| (scope, word)));
        words.filter_map(|(scope, word)| Some(self.resolve(scope, word).ok()?.producer))
    }
}
