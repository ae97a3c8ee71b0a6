//! Helpers for tests of devices.

use std::path::Path;
use std::sync::mpsc::{Receiver, Sender, channel};

use async_trait::async_trait;
use tactflow_runtime::catalogue::Catalogue;
use tactflow_runtime::device::{
    Attached, Commands, Description, Device, DeviceError, Driver, Link, Live, Opened, Samples, Stepped,
};
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

/// What a driver does with its link.
type Act = Box<dyn FnOnce(&mut Link) + Send>;

/// A live device whose driver does what the test says, one act after the other. Ports are named without their role.
pub(crate) struct Puppet {
    attached: Attached,
    acts: Sender<Act>,
}

struct Strings(Receiver<Act>);

#[async_trait]
impl Live for Strings {
    async fn run(self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        // The device has a thread of its own, so it may block.
        self.0.iter().for_each(|act| act(&mut link));
        Ok(())
    }
}

impl Puppet {
    pub(crate) fn start(description: Description) -> Self {
        let (acts, strings) = channel();
        let attached = Attached::start("puppet", description, Box::new(Strings(strings)));
        Self { attached: attached.expect("the operating system gives a thread"), acts }
    }

    /// Has the driver do something, and returns what comes of it.
    pub(crate) fn has<T: Send + 'static>(&mut self, act: impl FnOnce(&mut Link) -> T + Send + 'static) -> T {
        let (done, result) = channel();
        let act: Act = Box::new(move |link| drop(done.send(act(link))));
        self.acts.send(act).expect("the driver runs");
        result.recv().expect("the driver runs")
    }

    /// Sends a command of the graph. It is valid for 40 ms.
    pub(crate) fn command(&mut self, port: &str, values: &[f64]) {
        let command = self.attached.description().command(port).expect("a port of the device");
        self.attached.commands().command(command, values);
        self.attached.send();
    }

    /// The operator resumes: the next command begins a new epoch.
    pub(crate) fn resume(&mut self) {
        self.attached.resume();
    }

    /// Returns why the driver refuses commands.
    pub(crate) fn refusal(&self) -> Option<String> {
        self.attached.refusal()
    }
}
