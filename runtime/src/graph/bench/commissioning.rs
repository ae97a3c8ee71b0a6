//! The devices that must be commissioned before they use all of their limits, each with a fingerprint of what was proven
//! of it.
//!
//! The fingerprint covers the parameters of the device, which include those of its robot, the files that these and its
//! facts name, such as the model of the arm, and the version of this crate. It says whether something has changed, and it keeps nobody from changing it.

use std::fs;

use super::open::OpenedBench;
use crate::graph::net::Net;
use crate::graph::plan::PlannedDevice;
use crate::graph::syntax::Block;
use crate::source::{Item, SourceMap, Value};

/// A device that must be commissioned.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct CommissionedDevice {
    /// Its name in the bench.
    pub name: String,
    /// It changes when the parameters of the device or the files that it names do.
    pub fingerprint: String,
    /// Its place in the source.
    pub(crate) at: usize,
}

impl CommissionedDevice {
    #[cfg(all(test, feature = "cli"))]
    pub(crate) fn new(name: &str, fingerprint: &str) -> Self {
        Self { name: name.into(), fingerprint: fingerprint.into(), at: 0 }
    }
}

/// Returns the opened devices that must be commissioned.
pub(crate) fn to_commission(net: &Net<'_>, opened: &OpenedBench, sources: &SourceMap) -> Vec<CommissionedDevice> {
    let blocks: Vec<&Block> = net.flat.bench.iter().flat_map(|bench| &bench.devices).collect();
    let block_of = |device: &PlannedDevice| blocks.iter().find(|block| block.key.name == device.name);
    let real = opened.devices.iter().filter(|device| device.description.needs_commissioning);
    real.filter_map(|device| fingerprint(block_of(device)?, device, sources)).collect()
}

/// Returns the fingerprint of a device, or `None` if it need not be commissioned.
pub(super) fn fingerprint(block: &Block, device: &PlannedDevice, sources: &SourceMap) -> Option<CommissionedDevice> {
    if !device.description.needs_commissioning {
        return None;
    }
    let mut hash = Fnv::default();
    hash.add(block.kind.as_ref().map_or("", |kind| &kind.value).as_bytes());
    hash.add(serde_json::to_string(&block.params).expect("every key is a string").as_bytes());
    hash.add(env!("CARGO_PKG_VERSION").as_bytes());
    add_files(&mut hash, &block.params, sources);
    for (_, value) in device.description.fills.iter().flat_map(|fill| &fill.facts) {
        let file = value.as_str().and_then(|path| fs::read(path).ok());
        hash.add(&file.unwrap_or_else(|| value.to_string().into_bytes()));
    }
    let (name, fingerprint) = (device.name.clone(), format!("{:016x}", hash.0));
    let at = device.span.start;
    Some(CommissionedDevice { name, fingerprint, at })
}

/// Adds the content of each file that a parameter names.
fn add_files(hash: &mut Fnv, value: &Value, sources: &SourceMap) {
    match &value.item {
        Item::String(text) => {
            if let Ok(bytes) = fs::read(sources.path(text, value.span.start)) {
                hash.add(&bytes);
            }
        }
        Item::Array(items) => items.iter().for_each(|item| add_files(hash, item, sources)),
        Item::Table(table) => table.entries.iter().for_each(|(_, value)| add_files(hash, value, sources)),
        _ => {}
    }
}

/// The hash FNV-1a of 64 bits. Unlike the hash of the standard library, it is the same in each of its versions.
struct Fnv(u64);

impl Default for Fnv {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Fnv {
    /// Adds bytes, and an end that keeps them apart from the next ones.
    fn add(&mut self, bytes: &[u8]) {
        for byte in bytes.iter().chain(&[0xff]) {
            self.0 = (self.0 ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_hash_is_that_of_its_definition() {
        // Noll, "FNV hash", test vectors: the hash of no byte and of "a".
        assert_eq!(Fnv::default().0, 0xcbf2_9ce4_8422_2325);
        let a = (0xcbf2_9ce4_8422_2325_u64 ^ 0x61).wrapping_mul(0x0100_0000_01b3);
        assert_eq!(a, 0xaf63_dc4c_8601_ec8c);
        let mut hash = Fnv::default();
        hash.add(b"a");
        assert_eq!(hash.0, (a ^ 0xff).wrapping_mul(0x0100_0000_01b3));
    }

    #[test]
    fn what_is_added_apart_is_not_what_is_added_together() {
        let [mut apart, mut together] = [Fnv::default(), Fnv::default()];
        apart.add(b"a");
        apart.add(b"b");
        together.add(b"ab");
        assert_ne!(apart.0, together.0);
    }
}
