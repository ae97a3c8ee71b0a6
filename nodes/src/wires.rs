//! The wires of the devices without their I/O: what a device understands of any bytes that a peer sends.
//!
//! A device reads its wire with parsers that know no socket and no port. A [`Wire`] runs these parsers on bytes that
//! somebody else has, such as a fuzzer.

use tactflow_runtime::node::{Mistake, Mistakes, Param, Reader};
use tactflow_runtime::source::{SourceMap, parse_table};

use crate::builtin;
use crate::devices::lockstep;
#[cfg(feature = "drivers")]
use crate::devices::{agni, lwr_fri, stream, ur};

/// The receiving end of a connection. It takes the pieces in which bytes arrive, and returns a text for each message
/// that it understands, and for each that it refuses.
pub type Listener = Box<dyn Fn(&[&[u8]]) -> Vec<String>>;

/// What a device reads from its peer.
#[derive(Debug, Clone, Copy)]
pub struct Wire {
    /// Name of the device.
    pub name: &'static str,
    /// Opens the receiving end for the parameters of a device, a TOML text. Each call of the [`Listener`] is a
    /// connection of its own.
    pub open: fn(&str) -> Result<Listener, Mistakes>,
}

/// Every wire.
pub const WIRES: &[Wire] = &[
    Wire { name: "lockstep", open: |params| Ok(Box::new(lockstep::listen(read(params)?))) },
    #[cfg(feature = "drivers")]
    Wire { name: "stream", open: |params| Ok(Box::new(stream::listen(&read(params)?)?)) },
    #[cfg(feature = "drivers")]
    Wire { name: "agni", open: |params| Ok(Box::new(agni::listen(&read(params)?)?)) },
    #[cfg(feature = "drivers")]
    Wire { name: "lwr_fri", open: |_| Ok(Box::new(lwr_fri::listen)) },
    #[cfg(feature = "drivers")]
    Wire { name: "ur", open: |_| Ok(Box::new(ur::listen)) },
];

/// Reads the parameters of a device.
fn read<P: Param>(params: &str) -> Result<P, Mistakes> {
    let mut sources = SourceMap::with_builtin(builtin::FILES);
    let table = parse_table(sources.add("parameters", params, ""));
    let table = table.map_err(|first| Mistake::param("", first.message))?;
    let mut reader = Reader::new(&sources);
    let read = P::read(&table, &mut reader);
    read.filter(|_| reader.mistakes.is_empty()).ok_or(reader.mistakes)
}
