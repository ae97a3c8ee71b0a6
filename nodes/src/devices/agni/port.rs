//! The port to a device.

use tactflow_runtime::node::Mistake;

use crate::devices::link::Address;

/// Bits per second. It has no effect on a USB device.
pub(super) const BAUD: u32 = 115_200;

/// Reads the address of a port: a serial one, or a TCP server that passes one on.
///
/// # Errors
/// If `link` names none.
pub(super) fn address(link: &str) -> Result<Address, Mistake> {
    const HELP: &str = "write `link = \"serial:/dev/serial/by-id/…\"`, or `tcp:HOST:PORT` for a server that passes on a \
                        serial port";
    let address = Address::parse(link).map_err(|why| Mistake::param("link", why).help(HELP))?;
    if address.has_messages() {
        return Err(Mistake::param("link", format!("`{link}` is no serial port")).help(HELP));
    }
    Ok(address)
}
