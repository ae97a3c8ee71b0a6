//! The port to a device: a link, or in a test a pipe in memory.

use tactflow_runtime::node::Mistake;

use crate::devices::link::{Address, Connection};

/// Bits per second. It has no effect on a USB device.
const BAUD: u32 = 115_200;

/// An open port.
pub(super) enum Port {
    Link(Connection),
    #[cfg(test)]
    Pipe(tokio::io::DuplexStream),
}

impl Port {
    /// Opens a port.
    ///
    /// # Errors
    /// Why it cannot be opened, and what to do.
    pub(super) async fn open(address: &Address) -> Result<Self, String> {
        Connection::open(address, BAUD, None).await.map(Self::Link)
    }

    /// Waits for bytes and puts them into `buffer` in place of what it holds.
    ///
    /// # Errors
    /// Why nothing can arrive any more.
    pub(super) async fn receive(&mut self, buffer: &mut Vec<u8>) -> Result<(), String> {
        match self {
            Self::Link(connection) => connection.receive(buffer).await,
            #[cfg(test)]
            Self::Pipe(pipe) => {
                buffer.resize(64, 0);
                let count = tokio::io::AsyncReadExt::read(pipe, buffer).await.map_err(|error| error.to_string())?;
                buffer.truncate(count);
                if count == 0 { Err("the pipe is closed".to_owned()) } else { Ok(()) }
            }
        }
    }

    /// Sends a command.
    ///
    /// # Errors
    /// Why it cannot be sent.
    pub(super) async fn send(&mut self, bytes: &[u8]) -> Result<(), String> {
        match self {
            Self::Link(connection) => connection.send(bytes).await,
            #[cfg(test)]
            Self::Pipe(pipe) => {
                tokio::io::AsyncWriteExt::write_all(pipe, bytes).await.map_err(|error| error.to_string())
            }
        }
    }
}

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
