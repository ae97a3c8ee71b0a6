//! Gives the devices of a bench the parameters that the files of their robots state.

use crate::catalogue::Catalogue;
use crate::graph::syntax::BenchDocument;
use crate::node::ParamSpec;
use crate::source::{Code, Diagnostic, Diagnostics, Item, Table};

/// Adds to each device the parameters of its robot that its type has; those of the bench replace them.
///
/// A robot states more than one type of device needs. A parameter that no type has is misspelt.
pub(crate) fn add_robots(bench: &mut BenchDocument, catalogue: &Catalogue, diagnostics: &mut Diagnostics) {
    for (name, robot) in &bench.robots {
        let Some(block) = bench.devices.iter_mut().find(|block| block.key.name == name.name) else { continue };
        let Some(device) = block.kind.as_ref().and_then(|kind| catalogue.find_device(&kind.value)) else { continue };
        let own = device.params();
        let (mut table, before) = (Table::default(), diagnostics.len());
        for (key, value) in &robot.params.entries {
            let has = |params: &[ParamSpec]| params.iter().any(|param| param.name == key.name);
            if has(&own) {
                table.entries.push((key.clone(), value.clone()));
            } else if !catalogue.devices().iter().any(|device| has(&device.params())) {
                let message = format!("no device has a parameter `{}`", key.name);
                let diagnostic = Diagnostic::new(Code::UnknownKey, key.span.clone(), message);
                diagnostics.push(diagnostic.suggest(&key.name, own.iter().map(|param| param.name), "parameters"));
            }
        }
        let Item::Table(params) = &mut block.params.item else { continue };
        if table.entries.is_empty() && diagnostics.len() == before && !robot.params.entries.is_empty() {
            let place = bench.robot_files.iter().find(|(device, _)| device.name == name.name);
            let place = place.map_or(&block.key.span, |(_, file)| &file.span);
            let message = format!("a device of type `{}` takes nothing from a robot", device.name());
            let diagnostic = Diagnostic::new(Code::UnknownKey, place.clone(), message);
            diagnostics.push(diagnostic.help("name the robot at the device that drives it"));
        }
        table.merge(std::mem::take(params));
        *params = table;
    }
}
