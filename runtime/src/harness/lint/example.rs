//! Checks the examples of a catalogue: they load, their defaults are accepted, and they run.

use std::sync::{Arc, Mutex, PoisonError};

use super::watched::{StepRecord, Watched};
use super::{Lint, Notes, Violation};
use crate::engine::Engine;
use crate::example::example_graph;
use crate::graph::{Compiled, OutlinedBlock, PlannedNode, Request, Setting, ValueOrigin, compile};
use crate::node::ParamSpec;

/// Number of ticks of an example, unless its devices end earlier.
const MAX_TICKS: u64 = 2000;

impl Lint<'_> {
    pub(super) fn examples(&self, found: &mut Vec<Violation>) {
        for spec in self.catalogue.specs() {
            let mut notes = Notes { owner: spec.name.to_string(), found };
            let Some((text, compiled)) = self.example(&mut notes) else { continue };
            let block = compiled.outline().nodes.iter().find(|block| block.kind.text == spec.name).cloned();
            let Some(block) = block else { continue };
            self.defaults(&text, "nodes", &block, &spec.params, &mut notes);
            self.run_node(&text, compiled, &block, &mut notes);
        }
        for device in self.catalogue.devices() {
            let mut notes = Notes { owner: device.name().into_owned(), found };
            let Some((text, compiled)) = self.example(&mut notes) else { continue };
            let block = compiled.outline().devices.iter().find(|block| block.kind.text == notes.owner);
            let Some(block) = block else { continue };
            self.defaults(&text, "devices", block, &device.params(), &mut notes);
            self.run_device(compiled, &mut notes);
        }
    }

    /// Loads an example. Returns its text and the graph.
    fn example(&self, notes: &mut Notes<'_>) -> Option<(String, Compiled)> {
        if self.without_example.contains(&notes.owner) || !self.is_checked(&notes.owner) {
            return None;
        }
        let loaded = example_graph(self.catalogue, &notes.owner).map_err(|why| format!("it has no example: {why}"));
        let loaded = loaded.and_then(|text| match self.load(&text, None) {
            Ok(compiled) => Ok((text, compiled)),
            Err(why) => Err(format!("its example does not load:\n{why}")),
        });
        let (text, compiled) = loaded.map_err(|why| notes.add(None, why)).ok()?;
        if let Some(warnings) = compiled.warnings() {
            notes.add(None, format!("its example has warnings:\n{}", warnings.render(false)));
        }
        Some((text, compiled))
    }

    /// Writes each default into the block that relies on it.
    fn defaults(&self, text: &str, section: &str, block: &OutlinedBlock, specs: &[ParamSpec], notes: &mut Notes<'_>) {
        // A value that the example gives may be there because the default would not do.
        let is_default = |setting: &&Setting| setting.origin == ValueOrigin::Default;
        let settings: Vec<&str> = block.settings.iter().filter(is_default).map(|setting| &*setting.path).collect();
        for param in specs.iter().filter(|param| settings.contains(&param.name)) {
            let Some(default) = &param.default else { continue };
            let set = format!("{section}.{}.{}={default}", block.name, param.name);
            if let Err(why) = self.load(text, Some(set)) {
                let place = format!("parameter `{}`", param.name);
                notes.add(Some(place), format!("its default {default} is not accepted:\n{why}"));
            }
        }
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

    fn run_node(&self, text: &str, mut compiled: Compiled, block: &OutlinedBlock, notes: &mut Notes<'_>) {
        if compiled.is_live() {
            return;
        }
        let Ok(twin) = self.load(text, None) else { return };
        let record = Arc::new(Mutex::new(StepRecord::default()));
        let is_its = |node: &PlannedNode| node.name == block.name;
        let nodes = &mut compiled.plan.nodes;
        let (Some(at), Some(twin)) = (nodes.iter().position(is_its), twin.plan.nodes.into_iter().find(is_its)) else {
            return;
        };
        let planned = nodes.remove(at);
        nodes.insert(at, Watched::watch(planned, twin, self.count, Arc::clone(&record)));
        run(&mut Engine::new(compiled), notes, |_| {});
        let record = record.lock().unwrap_or_else(PoisonError::into_inner);
        let outputs: Vec<&str> = block.outputs.iter().map(|port| last_part(&port.name)).collect();
        for (i, name) in outputs.iter().enumerate() {
            let place = || Some(format!("output `{name}`"));
            let is_written = record.written.get(i) == Some(&true);
            let message = format!("no step of its example writes it ({} steps)", record.steps);
            notes.unless(is_written || self.is_quiet(&notes.owner, name), place(), message);
            if let Some((value, [min, max])) = record.out_of_range.get(i).copied().flatten() {
                notes.add(place(), format!("it is {value}, and the node declares {min} to {max}"));
            }
        }
        let allocates = format!("a step allocates ({} of {} steps)", record.allocating, record.steps);
        notes.unless(record.allocating == 0, None, allocates);
        if let Some(i) = record.differs {
            let place = outputs.get(i).map(|name| format!("output `{name}`"));
            notes.add(place, "after a reset its value differs from that of a new node with the same inputs");
        }
    }

    fn run_device(&self, compiled: Compiled, notes: &mut Notes<'_>) {
        if compiled.is_live() {
            return;
        }
        let outline = compiled.outline();
        let is_its = |device: &str| outline.devices.iter().any(|d| d.name == device && d.kind.text == notes.owner);
        let roles = outline.roles.iter().filter(|role| is_its(&role.device.text));
        let roles: Vec<String> = roles.map(|role| format!("{}.", role.name)).collect();
        let mut engine = Engine::new(compiled);
        let names = engine.ports().iter().map(|(port, _)| port.name.clone());
        let mut silent: Vec<String> = names.filter(|name| roles.iter().any(|role| name.starts_with(role))).collect();
        run(&mut engine, notes, |engine| silent.retain(|name| !engine.mark(name).is_present()));
        for output in silent.iter().map(|name| last_part(name)) {
            let is_quiet = self.is_quiet(&notes.owner, output);
            notes.unless(is_quiet, Some(format!("output `{output}`")), "the device never writes it in its example");
        }
    }

    /// Whether the test accepts that an output has no value.
    fn is_quiet(&self, owner: &str, output: &str) -> bool {
        self.quiet.contains(&format!("{owner}.{output}"))
    }
}

/// Returns the name of a port without that of its owner.
fn last_part(name: &str) -> &str {
    name.rsplit_once('.').map_or(name, |(_, port)| port)
}

/// Runs an example in virtual time.
fn run(engine: &mut Engine, notes: &mut Notes<'_>, mut observe: impl FnMut(&Engine)) {
    while let Some(now) = engine.next().filter(|_| engine.ticks() < MAX_TICKS && !engine.is_done()) {
        if let Err(fault) = engine.tick(now) {
            notes.add(None, format!("its example fails: {fault}"));
            return;
        }
        observe(engine);
    }
}
