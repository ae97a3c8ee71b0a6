//! Links to devices: bytes in and out over a serial port, TCP, UDP or a WebSocket.
//!
//! A link knows no protocol. It opens, receives into a buffer of the caller, sends, and says in one sentence why it
//! does not, with a way out.

pub(crate) mod address;
mod advice;
mod backoff;
mod latency;
mod serial;
mod tcp;
mod udp;
mod websocket;

pub(crate) use address::Address;
pub(crate) use backoff::Backoff;

use std::time::Duration;

use serial::Serial;
use tcp::Tcp;
use udp::Udp;
use websocket::WebSocket;

/// What the reader of a stream of bytes has counted and not reported yet.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    /// Frames that were refused, such as for a wrong checksum.
    pub(crate) rejected: u64,
    /// Times at which the beginning of a frame was lost.
    pub(crate) resyncs: u64,
    /// Bytes that belong to no frame.
    pub(crate) skipped: u64,
}

/// Longest time for a connection to be made.
const CONNECT_TIME: Duration = Duration::from_secs(5);
/// Longest time for bytes to be sent.
const SEND_TIME: Duration = Duration::from_secs(1);
/// Maximum number of bytes that are received at once, and of one message.
pub(crate) const RECEIVED_BYTES: usize = 1 << 16;

/// An open link.
pub(crate) enum Connection {
    Serial(Serial),
    Tcp(Tcp),
    Udp(Udp),
    WebSocket(Box<WebSocket>),
    /// A pipe in memory.
    #[cfg(test)]
    Pipe(tokio::io::DuplexStream),
}

impl Connection {
    /// Opens a link. `baud` is that of a serial port. `from` is the only host whose datagrams a UDP port reads.
    ///
    /// # Errors
    /// Why it cannot be opened, and what to do.
    pub(crate) async fn open(address: &Address, baud: u32, from: Option<std::net::IpAddr>) -> Result<Self, String> {
        let opened = async {
            match address {
                Address::Serial(path) => Serial::open(path, baud).map(Self::Serial),
                Address::Tcp(peer) => Tcp::open(peer).await.map(Self::Tcp),
                Address::UdpListen(port) => Udp::listen(*port, from).await.map(Self::Udp),
                Address::UdpPeer(peer) => Udp::connect(peer).await.map(Self::Udp),
                Address::WebSocket(peer) => WebSocket::open(peer).await.map(|socket| Self::WebSocket(Box::new(socket))),
            }
        };
        let silent = || format!("nothing answers within {} s", CONNECT_TIME.as_secs());
        tokio::time::timeout(CONNECT_TIME, opened).await.unwrap_or_else(|_| Err(silent()))
    }

    /// Waits for bytes and puts them into `buffer` in place of what it holds. From a link with messages, it is one
    /// message. It can be dropped while it waits, without a loss.
    ///
    /// # Errors
    /// Why nothing can arrive any more.
    pub(crate) async fn receive(&mut self, buffer: &mut Vec<u8>) -> Result<(), String> {
        match self {
            Self::Serial(port) => port.receive(buffer).await,
            Self::Tcp(stream) => stream.receive(buffer).await,
            Self::Udp(socket) => socket.receive(buffer).await,
            Self::WebSocket(socket) => socket.receive(buffer).await,
            #[cfg(test)]
            Self::Pipe(pipe) => {
                buffer.resize(64, 0);
                let count = tokio::io::AsyncReadExt::read(pipe, buffer).await.map_err(|error| error.to_string())?;
                buffer.truncate(count);
                if count == 0 { Err("the pipe is closed".to_owned()) } else { Ok(()) }
            }
        }
    }

    /// Sends bytes, within a second.
    ///
    /// # Errors
    /// Why they cannot be sent.
    pub(crate) async fn send(&mut self, bytes: &[u8]) -> Result<(), String> {
        let sent = async {
            match self {
                Self::Serial(port) => port.send(bytes).await,
                Self::Tcp(stream) => stream.send(bytes).await,
                Self::Udp(socket) => socket.send(bytes).await,
                Self::WebSocket(socket) => socket.send(bytes).await,
                #[cfg(test)]
                Self::Pipe(pipe) => {
                    tokio::io::AsyncWriteExt::write_all(pipe, bytes).await.map_err(|error| error.to_string())
                }
            }
        };
        tokio::time::timeout(SEND_TIME, sent).await.unwrap_or_else(|_| Err("it takes no bytes".to_owned()))
    }

    /// States that the last message was valid, so that a port that listens reads no other sender's any more.
    pub(crate) fn accept_sender(&mut self) {
        if let Self::Udp(socket) = self {
            socket.accept_sender();
        }
    }

    /// Returns the number of datagrams of other senders since the last call.
    pub(crate) fn take_foreign(&mut self) -> u64 {
        match self {
            Self::Udp(socket) => std::mem::take(&mut socket.foreign),
            _ => 0,
        }
    }
}
