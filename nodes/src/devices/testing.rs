//! What the tests of the devices share.

use std::path::Path;

use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::device::{Commands, Description, Device, Driver, Filled, Opened, Samples, Stepped};
use tactflow_runtime::graph::{Sources, parse_table};
use tactflow_runtime::node::{Mistakes, Param, Reader};

use crate::builtin;

/// Opens a device with the parameters of a TOML text, as a bench file would.
pub(super) fn open<D: Device>(params: &str) -> Result<Opened, Mistakes> {
    let mut sources = Sources::with_builtin(builtin::FILES);
    let table = parse_table(sources.add_file(Path::new("bench.toml"), params)).expect("the test's TOML");
    let mut reader = Reader::new(&sources);
    let catalogue = Catalogue::new().device::<D>();
    catalogue.devices()[0].open(&table, &mut reader).ok_or(reader.mistakes)
}

/// Reads parameters that are known to be right.
pub(super) fn read<P: Param>(params: &str) -> P {
    let mut sources = Sources::with_builtin(builtin::FILES);
    let table = parse_table(sources.add_file(Path::new("bench.toml"), params)).expect("the test's TOML");
    P::read(&table, &mut Reader::new(&sources)).expect("the test's parameters")
}

/// An open stepped device with room for what it gives and takes.
pub(super) struct Bench {
    pub(super) description: Description,
    pub(super) device: Box<dyn Stepped>,
    pub(super) samples: Samples,
    pub(super) commands: Commands,
}

impl Bench {
    pub(super) fn new(opened: Opened) -> Self {
        let Opened { description, driver: Driver::Stepped(device) } = opened else { panic!("a stepped device") };
        let samples = Samples::with_shapes(description.fills.iter().flat_map(|fill| &fill.outputs));
        let commands = Commands::with_shapes(description.fills.iter().flat_map(|fill| &fill.commands));
        Self { description, device, samples, commands }
    }

    pub(super) fn fill(&self) -> &Filled {
        &self.description.fills[0]
    }

    pub(super) fn fact(&self, name: &str) -> Option<&toml::Value> {
        self.fill().facts.iter().find(|(fact, _)| fact == name).map(|(_, value)| value)
    }

    pub(super) fn exchange(&mut self, now: i64) {
        self.device.exchange(now, &self.commands, &mut self.samples).expect("the device goes on");
    }
}
