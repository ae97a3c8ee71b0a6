//! Takes the devices of a recording instead of opening those of the bench.

use super::open::Opener;
use crate::device::{Opened, RecordedDevice};
use crate::graph::plan::PlannedDevice;
use crate::graph::syntax::Block;
use crate::source::{Code, Diagnostic};

impl Opener<'_> {
    /// Opens the device of a recording that has the name of a block. Its parameters do not matter.
    pub(super) fn open_recorded(&mut self, recorded: &[RecordedDevice], block: &Block) -> Option<usize> {
        let name = &block.key.name;
        let opened = recorded.iter().find(|device| device.name == *name).map(RecordedDevice::open);
        let Some(opened) = opened else {
            let message = format!("the recording has no device `{name}`");
            let diagnostic = Diagnostic::new(Code::UnknownDevice, block.key.span.clone(), message);
            let names = recorded.iter().map(|device| device.name.as_str());
            self.diagnostics.push(diagnostic.suggest(name, names, "devices"));
            return None;
        };
        let Some(Opened { mut description, driver }) = opened else {
            let message = format!("the recording describes the device `{name}` wrongly");
            self.diagnostics.push(Diagnostic::new(Code::WrongRole, block.key.span.clone(), message));
            return None;
        };
        if !self.check_ports(&mut description, block) {
            return None;
        }
        self.opened.devices.push(PlannedDevice {
            name: name.clone(),
            driver,
            description,
            span: block.key.span.clone(),
        });
        Some(self.opened.devices.len() - 1)
    }
}
