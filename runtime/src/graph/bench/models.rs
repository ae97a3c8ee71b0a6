//! Gives the devices of a bench the parameters that the files of their robots and sensors state.

use crate::catalogue::Catalogue;
use crate::graph::syntax::{BenchDocument, ROBOT};
use crate::node::ParamSpec;
use crate::source::{Code, Diagnostic, Diagnostics, Item, Table};

/// Adds to each device the parameters of its robot and of its sensor that its type has; those of the bench replace them.
///
/// Such a file states more than one type of device needs. A parameter that no type has is misspelt.
pub(crate) fn add_models(bench: &mut BenchDocument, catalogue: &Catalogue, diagnostics: &mut Diagnostics) {
    for (from, model) in &bench.models {
        let what = from.what;
        let Some(block) = bench.devices.iter_mut().find(|block| block.key.name == from.device.name) else { continue };
        let Some(device) = block.kind.as_ref().and_then(|kind| catalogue.find_device(&kind.value)) else { continue };
        let own = device.params();
        let (mut table, before) = (Table::default(), diagnostics.len());
        for (key, value) in &model.params.entries {
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
        let takes_some = !table.entries.is_empty() || device.is_recorded();
        if !takes_some && diagnostics.len() == before && !model.params.entries.is_empty() {
            let message = format!("a device of type `{}` takes nothing from a {what}", device.name());
            let diagnostic = Diagnostic::new(Code::UnknownKey, from.file.span.clone(), message);
            let does = if what == ROBOT { "drives" } else { "reads" };
            diagnostics.push(diagnostic.help(format!("name the {what} at the device that {does} it")));
        }
        table.merge(std::mem::take(params));
        *params = table;
    }
}
