//! Helpers for tests of devices.

use std::path::Path;

use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::device::{Commands, Description, Device, Driver, Opened, Samples, Stepped};
use tactflow_runtime::node::{Mistakes, Param, Reader};
use tactflow_runtime::signal::Image;
use tactflow_runtime::source::{SourceMap, parse_table};

use crate::builtin;

/// Opens a device with the parameters of a TOML text, as a bench file would.
pub(crate) fn open<D: Device>(params: &str) -> Result<Opened, Mistakes> {
    let mut sources = SourceMap::with_builtin(builtin::FILES);
    let table = parse_table(sources.add_file(Path::new("bench.toml"), params)).expect("the test's TOML");
    let mut reader = Reader::new(&sources);
    let catalogue = Catalogue::new().device::<D>();
    catalogue.devices()[0].open(&table, &mut reader).ok_or(reader.mistakes)
}

/// Reads valid parameters.
pub(crate) fn read<P: Param>(params: &str) -> P {
    let mut sources = SourceMap::with_builtin(builtin::FILES);
    let table = parse_table(sources.add_file(Path::new("bench.toml"), params)).expect("the test's TOML");
    P::read(&table, &mut Reader::new(&sources)).expect("the test's parameters")
}

/// An open stepped device with its samples and commands.
pub(crate) struct Bench {
    pub(crate) description: Description,
    pub(crate) device: Box<dyn Stepped>,
    pub(crate) samples: Samples,
    pub(crate) commands: Commands,
}

impl Bench {
    pub(crate) fn new(opened: Opened) -> Self {
        let Opened { description, driver: Driver::Stepped(device) } = opened else { panic!("a stepped device") };
        let (samples, commands) = (Samples::of(&description), Commands::of(&description));
        Self { description, device, samples, commands }
    }

    pub(crate) fn fact(&self, name: &str) -> Option<&toml::Value> {
        self.description.fact(name)
    }

    /// Returns the last image of the device.
    pub(crate) fn image(&mut self) -> &mut Image {
        self.samples.write(self.description.output("image").expect("the device has an image"), 0, 0)
    }

    pub(crate) fn exchange(&mut self, now: i64) {
        self.device.exchange(now, &self.commands, &mut self.samples).expect("the device runs");
    }
}
