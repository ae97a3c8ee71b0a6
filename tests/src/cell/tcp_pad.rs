//! A sensor behind a TCP server: `54 46 | counter u32 LE | one u16 LE per tactel, 12 bits | sum u16 LE`, row after row.
//! The sum is that of all bytes before it. Each client gets every frame, as long as it reads.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Ipv4Addr, TcpListener, TcpStream};

use serde_json::{Value, json};

use super::PadWire;

/// Clients that are served at once.
const MAX_CLIENTS: usize = 4;
/// Bytes that may wait for a client before it gets no more frames.
const MAX_WAITING: usize = 4096;

/// The sensor.
pub(super) struct TcpPad {
    listener: TcpListener,
    clients: Vec<Client>,
    full_scale: f64,
    counter: u32,
    frame: Vec<u8>,
}

struct Client {
    stream: TcpStream,
    outbox: Vec<u8>,
}

impl TcpPad {
    /// Listens on a port.
    ///
    /// # Errors
    /// If the port is taken.
    pub(super) fn open(port: u16, full_scale: f64) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        listener.set_nonblocking(true)?;
        Ok(Self { listener, clients: Vec::new(), full_scale, counter: 0, frame: Vec::new() })
    }
}

impl Client {
    /// Sends what waits, and reads what comes to nothing. Returns whether the client is still there.
    fn flush(&mut self) -> bool {
        while !self.outbox.is_empty() {
            match self.stream.write(&self.outbox) {
                Ok(count) => drop(self.outbox.drain(..count)),
                Err(error) if error.kind() == ErrorKind::WouldBlock => break,
                Err(_) => return false,
            }
        }
        match self.stream.read(&mut [0; 256]) {
            Ok(count) => count > 0,
            Err(error) => error.kind() == ErrorKind::WouldBlock,
        }
    }
}

impl PadWire for TcpPad {
    fn serve(&mut self) -> io::Result<()> {
        while let Ok((stream, _)) = self.listener.accept() {
            stream.set_nonblocking(true)?;
            stream.set_nodelay(true)?;
            if self.clients.len() < MAX_CLIENTS {
                self.clients.push(Client { stream, outbox: Vec::new() });
            }
        }
        self.clients.retain_mut(Client::flush);
        Ok(())
    }

    fn send(&mut self, counts: &[f32], _: f64) -> io::Result<bool> {
        self.counter = self.counter.wrapping_add(1);
        self.frame.clear();
        self.frame.extend_from_slice(b"TF");
        self.frame.extend_from_slice(&self.counter.to_le_bytes());
        for count in counts {
            let reading = (f64::from(*count) / self.full_scale * 4095.0).round().clamp(0.0, 4095.0) as u16;
            self.frame.extend_from_slice(&reading.to_le_bytes());
        }
        let sum = self.frame.iter().fold(0_u16, |sum, byte| sum.wrapping_add(u16::from(*byte)));
        self.frame.extend_from_slice(&sum.to_le_bytes());
        let mut has_begun = false;
        for client in self.clients.iter_mut().filter(|client| client.outbox.len() < MAX_WAITING) {
            client.outbox.extend_from_slice(&self.frame);
            has_begun = true;
        }
        self.clients.retain_mut(Client::flush);
        Ok(has_begun)
    }

    fn place(&self) -> Value {
        json!({ "wire": "tcp", "port": self.listener.local_addr().map(|address| address.port()).ok() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_has_a_mark_a_counter_twelve_bits_and_a_sum() {
        let mut pad = TcpPad::open(0, 4095.0).unwrap();
        let port = pad.listener.local_addr().unwrap().port();
        let mut host = TcpStream::connect((Ipv4Addr::LOCALHOST, port)).unwrap();
        while pad.clients.is_empty() {
            pad.serve().unwrap();
        }
        assert!(pad.send(&[0.0, 258.0, 5000.0], 0.0).unwrap());
        let mut frame = [0; 14];
        host.read_exact(&mut frame).unwrap();
        let sum = 0x54 + 0x46 + 1 + 2 + 1 + 0xFF + 0x0F;
        assert_eq!(frame, [0x54, 0x46, 1, 0, 0, 0, 0, 0, 2, 1, 0xFF, 0x0F, (sum % 256) as u8, (sum / 256) as u8]);
    }
}
