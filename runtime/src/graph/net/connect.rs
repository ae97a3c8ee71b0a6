//! Wires and commands: where each comes from, and whether its kind is taken where it goes.

use super::{CommandWire, Net, Origin, Wire};
use crate::device::RoleType;
use crate::graph::load::Scope;
use crate::graph::plan::{PortRef, Producer};
use crate::node::{NodeSpec, Word};
use crate::signal::Kind;
use crate::source::{Code, Diagnostic, Key, meant};

impl Net<'_> {
    /// The wires of each node that go somewhere.
    pub(super) fn connect(&self, found: &mut Vec<Diagnostic>) -> Vec<Vec<Wire>> {
        let mut all = Vec::new();
        for (i, node) in self.flat.nodes.iter().enumerate() {
            let Some(spec) = self.spec(i) else {
                all.push(Vec::new());
                continue;
            };
            let wire = |(key, word): &(Key, Word)| self.wire(i, spec, key, word, found);
            all.push(node.block.wires.iter().filter_map(wire).collect());
            self.missing(i, spec, found);
        }
        self.check_exports(found);
        all
    }

    /// An export comes from a port whether or not this graph takes it: the next one would find it broken.
    fn check_exports(&self, found: &mut Vec<Diagnostic>) {
        for (scope, Scope { exports, .. }) in self.flat.scopes.iter().enumerate() {
            let broken = exports.iter().filter_map(|(_, word)| self.resolve(scope, word, 0).err());
            found.extend(broken.map(|diagnostic| *diagnostic));
        }
    }

    fn wire(&self, node: usize, spec: &NodeSpec, key: &Key, word: &Word, found: &mut Vec<Diagnostic>) -> Option<Wire> {
        let source = self.resolve(self.flat.nodes[node].scope, word, 0).unwrap_or_else(|diagnostic| {
            found.push(*diagnostic);
            None
        });
        let named = spec.inputs.iter().position(|input| !input.need.is_many && input.name == key.name);
        let Some(input) = named.or_else(|| spec.inputs.iter().position(|input| input.need.is_many)) else {
            let message = format!("`{}` has no input `{}`", spec.name, key.name);
            found.push(Diagnostic::new(Code::UnknownInput, key.span.clone(), message).suggest(
                &key.name,
                spec.inputs.iter().map(|input| &*input.name),
                "inputs",
            ));
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

    fn kind_mismatch(&self, source: PortRef, consumer: &str, takes: Kind, origin: &Origin) -> Diagnostic {
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

    /// The wires of commands and reports that go somewhere; a command that nothing drives is a mistake.
    pub(super) fn connect_commands(&self, found: &mut Vec<Diagnostic>) -> Vec<CommandWire> {
        let mut wires = Vec::new();
        for (role, command, word) in &self.flat.commands {
            let index = self.flat.roles.iter().position(|(key, _)| key.name == role.name);
            let Some(index) = index else {
                let message = format!("there is no role `{}`", role.name);
                found.push(Diagnostic::new(Code::UnknownPort, role.span.clone(), message).suggest(
                    &role.name,
                    self.flat.roles.iter().map(|(key, _)| key.name.as_str()),
                    "roles",
                ));
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
            found.push(Diagnostic::new(Code::UnknownInput, key.span.clone(), message).suggest(
                &key.name,
                commands.iter().chain(reports).map(|port| &*port.name),
                "commands",
            ));
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
