//! FlexiTac: `AA 55 | one u8 per tactel`, row after row, without a checksum, a counter or a stamp. It runs freely.

use std::io;
use std::path::Path;

use serde_json::{Value, json};

use super::PadWire;
use super::pty::Pty;

/// The sensor.
pub(super) struct Flexitac {
    pty: Pty,
    /// Reading that 255 stands for [counts].
    full_scale: f64,
    frame: Vec<u8>,
    /// What hosts write; the sensor has no commands.
    ignored: Vec<u8>,
}

impl Flexitac {
    /// Opens its terminal.
    ///
    /// # Errors
    /// If there is no terminal.
    pub(super) fn open(link: Option<&Path>, full_scale: f64) -> io::Result<Self> {
        Ok(Self { pty: Pty::open(link)?, full_scale, frame: Vec::new(), ignored: Vec::new() })
    }
}

impl PadWire for Flexitac {
    fn serve(&mut self) -> io::Result<()> {
        self.ignored.clear();
        self.pty.receive(&mut self.ignored, 0)?;
        self.pty.flush()
    }

    fn send(&mut self, counts: &[f32], _: f64) -> io::Result<bool> {
        self.frame.clear();
        self.frame.extend_from_slice(&[0xAA, 0x55]);
        let cell = |count: &f32| (f64::from(*count) / self.full_scale * 255.0).round().clamp(0.0, 255.0) as u8;
        self.frame.extend(counts.iter().map(cell));
        self.pty.send(&self.frame)
    }

    fn place(&self) -> Value {
        json!({ "wire": "flexitac", "path": self.pty.path() })
    }
}

#[cfg(test)]
mod tests {
    use std::fs::File;
    use std::io::Read;

    use super::*;

    #[test]
    fn a_frame_is_the_mark_and_eight_bits_per_tactel() {
        let mut pad = Flexitac::open(None, 4095.0).unwrap();
        let mut host = File::open(pad.pty.path()).unwrap();
        assert!(pad.send(&[0.0, 4095.0, 2048.0, 9999.0], 0.0).unwrap());
        let mut bytes = [0; 6];
        host.read_exact(&mut bytes).unwrap();
        assert_eq!(bytes, [0xAA, 0x55, 0, 255, 128, 255]);
    }
}
