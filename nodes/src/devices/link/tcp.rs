//! A TCP connection to a device.

use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use super::RECEIVED_BYTES;

/// An open connection.
pub(crate) struct Tcp {
    stream: TcpStream,
}

impl Tcp {
    pub(super) async fn open(peer: &str) -> Result<Self, String> {
        let stream = TcpStream::connect(peer).await.map_err(|error| error.to_string())?;
        // A request of a few bytes must not wait for more.
        stream.set_nodelay(true).map_err(|error| error.to_string())?;
        Ok(Self { stream })
    }

    pub(super) async fn receive(&mut self, buffer: &mut Vec<u8>) -> Result<(), String> {
        buffer.resize(RECEIVED_BYTES, 0);
        let count = self.stream.read(buffer).await.map_err(|error| error.to_string())?;
        buffer.truncate(count);
        if count == 0 { Err("the peer has closed the connection".to_owned()) } else { Ok(()) }
    }

    pub(super) async fn send(&mut self, bytes: &[u8]) -> Result<(), String> {
        self.stream.write_all(bytes).await.map_err(|error| error.to_string())
    }
}
