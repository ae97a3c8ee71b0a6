//! UDP datagrams of one sender.

use std::io::ErrorKind;
use std::net::{IpAddr, SocketAddr};

use tokio::net::{UdpSocket, lookup_host};

use super::RECEIVED_BYTES;

/// An open socket.
///
/// A socket with a peer reads the datagrams of that address alone. One that listens reads those of anybody (or of one
/// host) until [`accept_sender`](Self::accept_sender), and then those of that sender alone.
pub(crate) struct Udp {
    socket: UdpSocket,
    /// The only host that a socket which listens reads.
    from: Option<IpAddr>,
    peer: Option<SocketAddr>,
    /// The sender of the last datagram.
    sender: Option<SocketAddr>,
    /// Number of datagrams of other senders.
    pub(super) foreign: u64,
}

impl Udp {
    pub(super) async fn listen(port: u16, from: Option<IpAddr>) -> Result<Self, String> {
        let socket = UdpSocket::bind(("0.0.0.0", port)).await.map_err(|error| match error.kind() {
            ErrorKind::AddrInUse => format!("another program listens on UDP port {port}: end it, or use another port"),
            _ => error.to_string(),
        })?;
        Ok(Self { socket, from, peer: None, sender: None, foreign: 0 })
    }

    pub(super) async fn connect(peer: &str) -> Result<Self, String> {
        let mut found = lookup_host(peer).await.map_err(|error| error.to_string())?;
        let peer = found.next().ok_or_else(|| format!("`{peer}` has no address"))?;
        let any = if peer.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
        let socket = UdpSocket::bind(any).await.map_err(|error| error.to_string())?;
        Ok(Self { socket, from: None, peer: Some(peer), sender: None, foreign: 0 })
    }

    pub(super) async fn receive(&mut self, buffer: &mut Vec<u8>) -> Result<(), String> {
        buffer.resize(RECEIVED_BYTES, 0);
        loop {
            let (count, sender) = match self.socket.recv_from(buffer).await {
                Ok(received) => received,
                // The answer to an earlier datagram: nobody listens there yet.
                Err(error) if error.kind() == ErrorKind::ConnectionRefused => continue,
                Err(error) => return Err(error.to_string()),
            };
            let is_from = self.from.is_none_or(|host| host == sender.ip());
            if is_from && self.peer.is_none_or(|peer| peer == sender) {
                buffer.truncate(count);
                self.sender = Some(sender);
                return Ok(());
            }
            self.foreign += 1;
        }
    }

    pub(super) async fn send(&mut self, bytes: &[u8]) -> Result<(), String> {
        // A socket that listens has nobody to send to before the first datagram.
        let Some(peer) = self.peer.or(self.sender) else { return Ok(()) };
        self.socket.send_to(bytes, peer).await.map(drop).map_err(|error| error.to_string())
    }

    pub(super) fn accept_sender(&mut self) {
        self.peer = self.peer.or(self.sender);
    }
}
