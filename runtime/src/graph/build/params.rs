//! Reads the parameters of a node: its facts, its units, and the place of each mistake.

use std::ops::Range;

use super::nodes::Builder;
use crate::graph::bench::{fill_facts, place_mistakes};
use crate::graph::net::limits::is_looser;
use crate::graph::plan::Producer;
use crate::graph::syntax::LIMITS;
use crate::node::{At, Configured, Given, KnownUnits, Mistake, Mistakes, Reader};
use crate::source::{Code, Diagnostic, Value, suggest_name};

impl Builder<'_> {
    /// Reads the parameters of a node, and returns them with all facts filled in.
    ///
    /// The units of parameters follow from the shapes on the wires, which may be incomplete. A filled-in value of
    /// [limits] keeps its span there, so a mistake in it is reported in that section.
    pub(super) fn configure(
        &mut self,
        index: usize,
        kind: usize,
        written: &Value,
        given: &Given,
        is_complete: bool,
    ) -> (Option<Box<dyn Configured>>, Value) {
        let mut params = written.clone();
        if !fill_facts(&mut params, Some(index), self.net, self.opened, &mut self.diagnostics) {
            return (None, params);
        }
        self.check_limits(index, &params);
        let spec = self.net.spec(index);
        let (specs, inputs) = spec.map_or((&[][..], &[][..]), |spec| (&spec.params, &spec.inputs));
        let units = KnownUnits::of_params(&params, specs).with_wires(inputs, &given.inputs, !is_complete);
        let period = self.opened.shortest_period(self.net.roles_of(Producer::Node(index))).unwrap_or(self.period);
        let mut reader = Reader::new(&self.sources).with_units(units).with_period(period);
        let configured = self.net.catalogue.nodes()[kind].configure(&params, &mut reader);
        let Reader { mistakes, warnings, measured, files, .. } = reader;
        self.sources.add_named(files);
        self.measured.add(Some(index), measured);
        let is_valid = mistakes.is_empty();
        let place = |mistake| self.at_wire(self.at_reference(mistake, written), index);
        let mistakes = mistakes.into_iter().map(place).collect();
        place_mistakes(mistakes, &params, &[], &mut self.sources, &mut self.diagnostics);
        let warnings = self.warnings_of_written(warnings, written);
        place_mistakes(warnings, &params, &[], &mut self.sources, &mut self.diagnostics);
        (configured.filter(|_| is_valid), params)
    }

    /// Reports parameters of a limiter that are looser than the limits of the arm whose motion it passes on.
    fn check_limits(&mut self, index: usize, params: &Value) {
        let (net, arms) = (self.net, self.net.arms_of(index));
        let Some(spec) = net.spec(index).filter(|_| !arms.is_empty()) else { return };
        for (key, value) in params.as_table().into_iter().flat_map(|table| &table.entries) {
            let Some(limit) = net.catalogue.limit_readers().limit_of(&spec.name, &key.name) else { continue };
            let Some(bound) = net.limit(arms, limit).filter(|bound| is_looser(limit, value, bound)) else { continue };
            let name = &net.flat.nodes[index].name;
            let message = format!("`{}` of `{name}` is looser than the limit `{limit}`", key.name);
            let diagnostic = Diagnostic::new(Code::LooseLimit, value.span.clone(), message);
            let diagnostic = diagnostic.note(bound.span, "the limit is here");
            let help = format!("write `{{ from = \"{LIMITS}.{limit}\" }}`, or a tighter value");
            let diagnostic = diagnostic.help(help);
            // That nothing else uses the limit is not the mistake.
            let unused = net.flat.all_limits().filter(|(key, _)| key.name == limit).map(|(key, _)| &key.span);
            let unused: Vec<&Range<usize>> = unused.collect();
            self.diagnostics.retain(|found| found.code != Code::UnknownKey || !unused.contains(&&found.span));
            if !self.diagnostics.contains(&diagnostic) {
                self.diagnostics.push(diagnostic);
            }
        }
    }

    /// Moves the mistake that a limit is in another unit than its parameter to the reference in the parameter.
    fn at_reference(&self, mistake: Mistake, written: &Value) -> Mistake {
        let (At::Span(span), Code::UnitMismatch) = (&mistake.at, mistake.code) else { return mistake };
        // A text has the unit that the user wrote, so the mistake is there.
        let limit = self.net.flat.limit_at(span).filter(|(_, value)| !value.has_text_at(span));
        let Some((key, _)) = limit else { return mistake };
        let word = format!("{LIMITS}.{}", key.name);
        let Some(fact) = written.facts().into_iter().find(|fact| fact.word == word) else { return mistake };
        let help = format!(
            "the name `{}` says its unit: use a limit whose name ends with the unit of the parameter",
            key.name
        );
        Mistake { at: At::Span(fact.place.clone()), help: Some(help), ..mistake }
    }

    /// Moves the mistake that an entry has the name of no wire to the wire, if that looks misspelt.
    pub(super) fn at_wire(&self, mistake: Mistake, node: usize) -> Mistake {
        let (Code::UnknownKey, Some(names)) = (mistake.code, &mistake.instead) else { return mistake };
        let (name, wired) = &**names;
        let wires = &self.net.flat.nodes[node].block.wires.valid;
        if suggest_name(name, std::iter::once(wired.as_str())).is_none() {
            return mistake;
        }
        let named = wires.iter().find(|wire| wire.key.name == *wired && self.sources.is_misspelt(wired, name));
        let Some(wire) = named.filter(|_| self.net.takes_any_wire(node)) else { return mistake };
        let message = format!("no other key has the name `{wired}`, and no wire has the name `{name}`");
        Mistake::new(mistake.code, At::Span(wire.key.span.clone()), message).instead(wired, name)
    }

    /// Returns the warnings about numbers that the graph contains, under their name there. A fact has its warnings in
    /// the bench.
    fn warnings_of_written(&self, warnings: Mistakes, written: &Value) -> Mistakes {
        let facts = written.facts().into_iter().filter(|fact| fact.word.split('.').next() != Some(LIMITS));
        let facts: Vec<Range<usize>> = facts.map(|fact| fact.place.clone()).collect();
        let name = |mut warning: Mistake| {
            let At::Span(span) = &warning.at else { return Some(warning) };
            let limit = self.net.flat.limit_at(span);
            if let (Some((key, _)), Some((_, rest))) = (limit, warning.message[1..].split_once('`')) {
                warning.message = format!("`{}`{rest}", key.name);
            }
            facts.iter().all(|fact| !span.contains(&fact.start)).then_some(warning)
        };
        warnings.into_iter().filter_map(name).collect()
    }
}
