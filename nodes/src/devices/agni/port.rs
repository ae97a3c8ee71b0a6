//! The serial port of a device.

use std::io;

use serial2_tokio::SerialPort;
use tactflow_runtime::node::Mistake;

use super::driver::Open;
use super::session::Port;

/// Bits per second. It has no effect on a USB device.
const BAUD: u32 = 115_200;

/// Returns the function that opens the port `serial:PATH`.
///
/// # Errors
/// If `link` names no serial port.
pub(super) fn opener(link: &str) -> Result<Open, Mistake> {
    let Some(path) = link.strip_prefix("serial:").filter(|path| !path.is_empty()) else {
        let mistake = Mistake::param("link", format!("`{link}` is no serial port"));
        return Err(mistake.help("write `link = \"serial:/dev/serial/by-id/…\"`"));
    };
    let path = path.to_owned();
    Ok(Box::new(move || {
        let port = SerialPort::open(&path, BAUD)?;
        // What has arrived before is of no use; a terminal that cannot forget it is read until it is silent.
        let _: io::Result<()> = port.discard_buffers();
        Ok(Box::new(port) as Box<dyn Port>)
    }))
}
