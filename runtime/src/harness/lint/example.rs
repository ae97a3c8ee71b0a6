//! The examples of a catalogue: they load, their defaults are accepted, and they run.

use std::sync::{Arc, Mutex, PoisonError};

use super::watched::{Finding, Watched};
use super::{Lint, Notes, Violation};
use crate::engine::Engine;
use crate::example::example_graph;
use crate::graph::{Compiled, Request, compile};
use crate::node::ParamSpec;

/// An example runs for so many ticks, unless its devices end before.
const MAX_TICKS: u64 = 2000;

/// A section of a graph, the type of a block there, and its parameters.
struct Asked<'a> {
    section: &'static str,
    kind: &'a str,
    params: &'a [ParamSpec],
}

impl Lint<'_> {
    pub(super) fn examples(&self, found: &mut Vec<Violation>) {
        for spec in self.catalogue.specs() {
            let asked = Asked { section: "nodes", kind: &spec.name, params: &spec.params };
            let outputs: Vec<String> = spec.outputs.iter().map(|port| port.name.to_string()).collect();
            if let Some((text, block)) = self.example(&asked, found) {
                self.run_node(&asked, &text, &block, &outputs, found);
            }
        }
        for device in self.catalogue.devices() {
            let (name, params) = (device.name(), device.params());
            let asked = Asked { section: "devices", kind: &name, params: &params };
            if let Some((text, _)) = self.example(&asked, found) {
                self.run_device(&asked, &text, found);
            }
        }
    }

    /// Loads an example and tries the defaults. Returns the graph and the name of the block, if it loads.
    fn example(&self, asked: &Asked<'_>, found: &mut Vec<Violation>) -> Option<(String, String)> {
        let is_skipped = self.without_example.iter().any(|name| name == asked.kind);
        if is_skipped || !self.is_checked(asked.kind) {
            return None;
        }
        let mut notes = Notes { owner: asked.kind.to_owned(), found };
        let text = match example_graph(self.catalogue, asked.kind) {
            Ok(text) => text,
            Err(why) => {
                notes.unless(false, None, format!("it has no example: {why}"));
                return None;
            }
        };
        let compiled = match self.load(&text, None) {
            Ok(compiled) => compiled,
            Err(why) => {
                notes.unless(false, None, format!("its example does not load:\n{why}"));
                return None;
            }
        };
        if let Some(warnings) = compiled.warnings() {
            notes.unless(false, None, format!("its example has warnings:\n{}", warnings.render(false)));
        }
        let root: toml::Table = text.parse().ok()?;
        let blocks = root.get(asked.section)?.as_table()?;
        let is_its = |block: &toml::Value| block.get("type").and_then(toml::Value::as_str) == Some(asked.kind);
        let (name, block) = blocks.iter().find(|(_, block)| is_its(block))?;
        // A value that the example gives may be there because the default would not do.
        for param in asked.params.iter().filter(|param| block.get(param.name).is_none()) {
            let Some(default) = &param.default else { continue };
            let set = format!("{}.{name}.{}={default}", asked.section, param.name);
            if let Err(why) = self.load(&text, Some(set)) {
                let place = format!("parameter `{}`", param.name);
                notes.unless(false, Some(place), format!("its default {default} is not accepted:\n{why}"));
            }
        }
        Some((text, name.clone()))
    }

    fn load(&self, text: &str, set: Option<String>) -> Result<Compiled, String> {
        // What an example needs is built in: the folder of its graph is not there.
        let request = Request { text: Some(text.to_owned()), ..Request::file("no-folder/graph.toml") };
        let request = match set {
            Some(set) => request.set(set),
            None => request,
        };
        compile(self.catalogue, &request).map_err(|report| report.render(false))
    }

    fn run_node(&self, asked: &Asked<'_>, text: &str, block: &str, outputs: &[String], found: &mut Vec<Violation>) {
        let (Ok(mut compiled), Ok(twin)) = (self.load(text, None), self.load(text, None)) else { return };
        if compiled.is_live() {
            return;
        }
        let finding = Arc::new(Mutex::new(Finding::default()));
        let planned = compiled.plan.nodes.iter_mut().find(|node| node.name == block);
        let twin = twin.plan.nodes.into_iter().find(|node| node.name == block);
        let (Some(planned), Some(twin)) = (planned, twin) else { return };
        Watched::take_place_of(planned, twin, self.count, Arc::clone(&finding));
        let mut engine = Engine::new(compiled);
        let mut notes = Notes { owner: asked.kind.to_owned(), found };
        run(&mut engine, &mut notes, |_| {});
        let finding = finding.lock().unwrap_or_else(PoisonError::into_inner);
        for (i, name) in outputs.iter().enumerate() {
            let place = || Some(format!("output `{name}`"));
            let is_quiet = self.quiet.contains(&format!("{}.{name}", asked.kind));
            let is_written = finding.written.get(i) == Some(&true);
            notes.unless(
                is_quiet || is_written,
                place(),
                format!("no step of its example writes it ({} steps)", finding.steps),
            );
            if let Some((value, [min, max])) = finding.out_of_range.get(i).copied().flatten() {
                notes.unless(false, place(), format!("it is {value}, and the node declares {min} to {max}"));
            }
        }
        let allocates = format!("a step allocates ({} of {} steps)", finding.allocating, finding.steps);
        notes.unless(finding.allocating == 0, None, allocates);
        if let Some(i) = finding.differs {
            let place = outputs.get(i).map(|name| format!("output `{name}`"));
            notes.unless(false, place, "after a reset it differs from that of a fresh node with the same inputs");
        }
    }

    fn run_device(&self, asked: &Asked<'_>, text: &str, found: &mut Vec<Violation>) {
        let Ok(compiled) = self.load(text, None) else { return };
        if compiled.is_live() {
            return;
        }
        // The example of a device declares the roles that it fills.
        let root: toml::Table = text.parse().unwrap_or_default();
        let section = |name: &str| root.get(name).and_then(toml::Value::as_table).cloned().unwrap_or_default();
        let devices = section("devices");
        let is_its = |role: &str| {
            let device = section("bind").get(role).and_then(toml::Value::as_str).map(str::to_owned);
            let block = device.and_then(|device| devices.get(&device));
            block.and_then(|block| block.get("type")).and_then(toml::Value::as_str) == Some(asked.kind)
        };
        let mut engine = Engine::new(compiled);
        let roles: Vec<String> = section("roles").keys().filter(|role| is_its(role)).cloned().collect();
        let is_output =
            |name: &str| name.split_once('.').is_some_and(|(role, _)| roles.iter().any(|known| known == role));
        let mut silent: Vec<String> =
            engine.ports().iter().map(|(port, _)| port.name.clone()).filter(|name| is_output(name)).collect();
        let mut notes = Notes { owner: asked.kind.to_owned(), found };
        run(&mut engine, &mut notes, |engine| silent.retain(|name| !engine.mark(name).is_present()));
        for name in silent {
            let output = name.split_once('.').map_or(name.as_str(), |(_, output)| output);
            let is_quiet = self.quiet.contains(&format!("{}.{output}", asked.kind));
            notes.unless(is_quiet, Some(format!("output `{output}`")), "the device never writes it in its example");
        }
    }
}

/// Runs an example in virtual time.
fn run(engine: &mut Engine, notes: &mut Notes<'_>, mut observe: impl FnMut(&Engine)) {
    while let Some(now) = engine.next().filter(|_| engine.ticks() < MAX_TICKS && !engine.is_done()) {
        if let Err(fault) = engine.tick(now) {
            notes.unless(false, None, format!("its example fails: {fault}"));
            return;
        }
        observe(engine);
    }
}
