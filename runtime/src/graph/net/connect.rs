//! Connects wires and commands to their sources, and compares kinds.

use std::collections::BTreeMap;
use std::ops::Range;

use super::{CommandWire, Net, Wire, WireOrigin, report};
use crate::device::RoleType;
use crate::graph::load::FlatNode;
use crate::graph::plan::{PortRef, Producer};
use crate::graph::syntax::{CommandEntry, WireEntry};
use crate::node::{NodeSpec, Spanned};
use crate::signal::Kind;
use crate::source::{Code, Diagnostic, Diagnostics, quoted, suggest_name};

impl Net<'_> {
    /// Resolves the wires of each node; wires with a mistake are left out.
    pub(super) fn connect(&self, diagnostics: &mut Diagnostics) -> Vec<Vec<Wire>> {
        let nodes = self.flat.nodes.iter().enumerate().map(|(i, node)| {
            let wire = |wire: &WireEntry| self.wire(i, self.spec(i)?, wire, diagnostics);
            node.block.wires.valid.iter().filter_map(wire).collect()
        });
        nodes.collect()
    }

    fn wire(&self, node: usize, spec: &NodeSpec, wire: &WireEntry, diagnostics: &mut Diagnostics) -> Option<Wire> {
        let (FlatNode { scope, name, .. }, key) = (&self.flat.nodes[node], &wire.key);
        let source = self.resolve(*scope, &wire.from).map_err(|found| self.same_name(*scope, wire, found));
        let source = report(source, diagnostics);
        let named = spec.inputs.iter().position(|input| !input.need.is_many && input.name == key.name);
        let Some(input) = named.or_else(|| spec.inputs.iter().position(|input| input.need.is_many)) else {
            let message = format!("`{}` has no input `{}`", spec.name, key.name);
            let known = spec.inputs.iter().map(|input| &*input.name);
            let diagnostic = Diagnostic::new(Code::UnknownInput, key.span.clone(), message);
            let required = spec.inputs.iter().filter(|input| input.need.must_be_wired).map(|input| &*input.name);
            let wires = &self.flat.nodes[node].block.wires;
            diagnostics.push(match wires.only_lacks(known.clone(), required) {
                Some(name) => diagnostic.instead(&key.name, name),
                None => diagnostic.suggest(&key.name, known, "inputs"),
            });
            return None;
        };
        let (source, origin, takes) = (source?, self.origin(*scope, wire), spec.inputs[input].kind);
        if self.port(source).kind != takes {
            diagnostics.push(self.kind_mismatch(source, &format!("{name}.{}", key.name), takes, &origin));
            return None;
        }
        Some(Wire { input, key: key.clone(), origin, source })
    }

    /// Suggests the output with the name of the input for a port of one or two letters, to which many are close.
    fn same_name(&self, scope: usize, wire: &WireEntry, found: Option<Box<Diagnostic>>) -> Option<Box<Diagnostic>> {
        let Some((node, port)) = wire.from.value.split_once('.') else { return found };
        let same = Spanned { value: format!("{node}.{}", wire.key.name), span: wire.from.span.clone() };
        let is_short = port.chars().count() <= 2 && self.resolve(scope, &same).is_ok();
        match found {
            Some(found) if is_short => {
                let Diagnostic { code, message, span, notes, .. } = *found;
                let diagnostic = Diagnostic { notes, ..Diagnostic::new(code, span, message) };
                Some(Box::new(diagnostic.instead(port, &wire.key.name)))
            }
            found => found,
        }
    }

    /// Follows a wire out of the parts around it, to the text that names its source.
    fn origin(&self, scope: usize, wire: &WireEntry) -> WireOrigin {
        let (mut at, mut outer, mut age) = (scope, &wire.from, wire.age);
        while let (Some(("inputs", port)), Some(parent)) = (outer.value.split_once('.'), self.flat.scopes[at].parent) {
            let Some(wire) = self.flat.scopes[at].inputs.get(port) else { break };
            (at, outer) = (parent, &wire.from);
            age = wire.age.map(|own| own.and(age)).or(age);
        }
        WireOrigin { age, word: outer.clone(), scope: at, inner: (at != scope).then(|| wire.from.clone()) }
    }

    fn kind_mismatch(&self, source: PortRef, consumer: &str, takes: Kind, origin: &WireOrigin) -> Diagnostic {
        let port = self.port_name(source);
        let has = self.port(source).kind.with_article();
        let message = format!("`{port}` is {has}, but `{consumer}` takes {}", takes.with_article());
        let outputs = self.outputs(source.producer).unwrap_or_default();
        let other = outputs.iter().find(|output| output.kind == takes);
        let help = other.map(|other| {
            let written = origin.word.value.rsplit_once('.').map_or("", |(node, _)| node);
            format!("`{written}.{}` is {}", other.name, takes.with_article())
        });
        // A port inside a part cannot be wired directly, so it is not suggested.
        let help = help.filter(|_| self.name_in(origin.scope, source).is_some_and(|name| name == origin.word.value));
        origin.diagnostic(Code::KindMismatch, message).with_help(help)
    }

    /// Resolves the wires of commands and reports; wires with a mistake are left out.
    pub(super) fn connect_commands(&self, diagnostics: &mut Diagnostics) -> Vec<CommandWire> {
        let mut wires = Vec::new();
        for CommandEntry { task, role, wire } in &self.flat.commands {
            let Some(index) = self.flat.roles.position(&role.name) else {
                let known = self.flat.roles.names();
                diagnostics.push(Diagnostic::unknown(Code::UnknownPort, "role", &role.name, &role.span, known));
                continue;
            };
            wires.extend(self.command(index, *task, wire, diagnostics));
        }
        self.check_drivers(&mut wires, diagnostics);
        wires
    }

    fn command(
        &self,
        role: usize,
        task: usize,
        wire: &WireEntry,
        diagnostics: &mut Diagnostics,
    ) -> Option<CommandWire> {
        let scope = self.flat.tasks[task].scope;
        let (source, key) = (report(self.resolve(scope, &wire.from), diagnostics), &wire.key);
        let RoleType { commands, reports, .. } = self.roles[role]?;
        let name = self.name(Producer::Role(role));
        let ports = commands.iter().map(|port| (false, port)).chain(reports.iter().map(|port| (true, port)));
        let Some((place, (is_report, port))) = ports.enumerate().find(|(_, (_, port))| port.name == key.name) else {
            let what = if self.is_beside(role) { "input" } else { "command" };
            let message = format!("`{name}` has no {what} `{}`", key.name);
            // A command that has a wire is not what was meant.
            let wires = self.flat.commands.iter().filter(|entry| entry.role.name == name);
            let is_open = |port: &&str| !wires.clone().any(|entry| entry.wire.key.name == *port);
            let known = || commands.iter().chain(reports).map(|port| &*port.name);
            let diagnostic = Diagnostic::new(Code::UnknownInput, key.span.clone(), message);
            diagnostics.push(match suggest_name(&key.name, known().filter(is_open)) {
                Some(best) => diagnostic.instead(&key.name, best),
                None => diagnostic.help(format!("{what}s here: {}", quoted(known()))),
            });
            return None;
        };
        let (source, origin) = (source?, self.origin(scope, wire));
        if self.port(source).kind != port.kind {
            diagnostics.push(self.kind_mismatch(source, &format!("{name}.{}", key.name), port.kind, &origin));
            return None;
        }
        let command = if is_report { place - commands.len() } else { place };
        Some(CommandWire { role, command, is_report, origin, source, task })
    }

    /// Reports commands and reports that two tasks drive, and removes the second wire of each report.
    fn check_drivers(&self, wires: &mut Vec<CommandWire>, diagnostics: &mut Diagnostics) {
        let mut first: BTreeMap<(usize, bool, usize), (usize, Range<usize>)> = BTreeMap::new();
        wires.retain(|wire| {
            let own = (wire.task, wire.origin.word.span.clone());
            let Some((task, place)) = first.insert((wire.role, wire.is_report, wire.command), own) else { return true };
            let [one, other] = [task, wire.task].map(|task| match self.flat.tasks[task].name() {
                "" => "the graph".to_owned(),
                name => format!("part `{name}`"),
            });
            let message = format!("`{}` has two drivers: {one} and {other}", self.command_name(wire));
            let diagnostic = wire.origin.diagnostic(Code::DuplicateName, message);
            let diagnostic = diagnostic.note(place, "the other one drives it here");
            diagnostics
                .push(diagnostic.help("give each part an arm of its own with `roles`, or remove one of the wires"));
            !wire.is_report
        });
    }
}
