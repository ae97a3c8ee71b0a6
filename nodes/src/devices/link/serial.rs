//! A serial port.

use serial2_tokio::SerialPort;

use super::{RECEIVED_BYTES, advice, latency};

/// An open serial port: 8 data bits, no parity, one stop bit, raw.
pub(crate) struct Serial {
    port: SerialPort,
    path: String,
}

impl Serial {
    pub(super) fn open(path: &str, baud: u32) -> Result<Self, String> {
        let port = SerialPort::open(path, baud).map_err(|error| advice::refusal(path, &error))?;
        // Bytes that arrived before the port was opened have no time of arrival. A port without this buffer has none.
        let _ = port.discard_input_buffer();
        if let Some(warning) = latency::warning(path) {
            tracing::warn!("{warning}");
        }
        Ok(Self { port, path: path.to_owned() })
    }

    pub(super) async fn receive(&mut self, buffer: &mut Vec<u8>) -> Result<(), String> {
        buffer.resize(RECEIVED_BYTES, 0);
        let read = self.port.read(buffer).await;
        let count = read.map_err(|error| advice::unplugged(&self.path, &error.to_string()))?;
        buffer.truncate(count);
        if count == 0 { Err(advice::unplugged(&self.path, "end of file")) } else { Ok(()) }
    }

    pub(super) async fn send(&mut self, bytes: &[u8]) -> Result<(), String> {
        self.port.write_all(bytes).await.map_err(|error| advice::unplugged(&self.path, &error.to_string()))
    }
}
