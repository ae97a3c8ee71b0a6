//! Opens the devices of a bench without a task.

use std::path::Path;

use super::commissioning::{CommissionedDevice, fingerprint};
use super::models::add_models;
use super::open::Opener;
use crate::catalogue::Catalogue;
use crate::device::Opened;
use crate::graph::load::Loader;
use crate::graph::plan::PlannedDevice;
use crate::source::{Report, Severity};

/// A bench whose devices are opened, and not started.
pub struct OpenBench {
    /// The devices that it binds.
    pub devices: Vec<BenchDevice>,
    /// The roles that it binds, each with the device and perhaps its side: `left.arm`.
    pub bind: Vec<(String, String)>,
}

/// A device of a bench.
pub struct BenchDevice {
    /// Its name.
    pub name: String,
    /// Its `type`.
    pub kind: String,
    /// Its parameters, with those of its robot and its sensor, as the files write them.
    pub params: toml::Table,
    /// What it states, and its driver.
    pub opened: Opened,
    /// Its fingerprint, if it must be commissioned.
    pub to_commission: Option<CommissionedDevice>,
}

/// Opens the devices that a bench file binds to roles. A live device is not connected yet.
///
/// # Errors
/// All mistakes in the bench and the files that it names.
pub fn open_bench(catalogue: &Catalogue, path: &Path) -> Result<OpenBench, Report> {
    let mut loader = Loader::new(catalogue.builtin_files());
    let bench = loader.load_bench(path);
    let Loader { mut sources, mut diagnostics, .. } = loader;
    let Some(mut bench) = bench else { return Err(Report::new(sources, diagnostics)) };
    add_models(&mut bench, catalogue, &mut diagnostics);
    let mut opener = Opener::new(catalogue, Some(&bench), 1.0, &mut sources, &mut diagnostics);
    opener.check_devices(&bench, &bench.bind.iter().map(|(role, _)| role.name.as_str()).collect());
    for (_, binding) in bench.bind.iter() {
        opener.device(&bench, &binding.device_word());
    }
    let devices = std::mem::take(&mut opener.opened.devices);
    if diagnostics.iter().any(|diagnostic| diagnostic.code.severity() == Severity::Error) {
        return Err(Report::new(sources, diagnostics));
    }
    let device = |device: PlannedDevice| {
        let block = bench.devices.iter().find(|block| block.key.name == device.name)?;
        Some(BenchDevice {
            to_commission: fingerprint(block, &device, &sources),
            name: device.name,
            kind: block.kind.as_ref()?.value.clone(),
            params: block.params.read().unwrap_or_default(),
            opened: Opened { description: device.description, driver: device.driver },
        })
    };
    let devices = devices.into_iter().filter_map(device).collect();
    let bind = bench.bind.iter().map(|(role, binding)| (role.name.clone(), binding.word.value.clone())).collect();
    Ok(OpenBench { devices, bind })
}
