//! `udp_pad`: a tactile pad that streams its frames as UDP datagrams.
//!
//! The driver sends `hello` to the pad, and the pad sends frames to the port that the hello came from. A frame is its
//! number (a `u64`) and one `f32` per tactel, row after row, all little-endian. When no frame comes for a while the
//! port is lost, and the driver connects again, until it succeeds or the run ends.

use std::io;
use std::time::Duration;

use async_trait::async_trait;
use tactflow_runtime::device::{Description, Device, DeviceError, Driver, Link, Live, Opened, Output};
use tactflow_runtime::node::{Describe, Mistakes, Param};
use tactflow_runtime::signal::{Image, ImageShape, Unit};
use tokio::net::UdpSocket;
use tokio::time::timeout;

/// A tactile pad that streams its frames as UDP datagrams.
///
/// The device sends `hello` to `address`. The pad answers with frames: a number (`u64`) and one `f32` per tactel in N,
/// row after row, all little-endian.
///
/// When no frame comes for `silence_s`, the pad is lost and the device connects again. It counts `bad frames` and
/// `reconnects`. It states the facts `threshold` and `calibration`.
///
/// ```toml
/// [roles]
/// pad = "tactile_pad"
///
/// [bind]
/// pad = "skin"
///
/// [devices.skin]
/// type = "udp_pad"
/// address = "192.168.0.7:5005"
/// ```
#[derive(Describe)]
pub struct UdpPad {
    image: Output<Image>,
    address: String,
    silence: Duration,
    /// The newest frame. It is kept here, so that a frame costs no allocation.
    frame: Vec<f32>,
}

/// Parameters of `udp_pad`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Where the pad listens, as `host:port`.
    address: String,
    /// Number of rows.
    #[param(range = 1..=1_000_000, default = 16)]
    rows: usize,
    /// Number of columns.
    #[param(range = 1..=1_000_000, default = 16)]
    cols: usize,
    /// Distance between the centres of two neighbours, along x and along y.
    #[param(unit = "m", above = 0.0, default = 0.005)]
    pitch: f64,
    /// Frames per second.
    #[param(unit = "Hz", range = 0.001..=1e6, default = 100.0)]
    rate_hz: f64,
    /// Time without a frame after which the pad is lost.
    #[param(unit = "s", above = 0.0, default = 0.2)]
    silence_s: f64,
    /// Time from the measurement of a frame to its arrival. The frames have no stamp of their own.
    #[param(unit = "ms", range = 0.0..=1e3, default = 0.0)]
    latency_ms: f64,
    /// Force on a tactel that is above its noise.
    #[param(unit = "N", range = 0.0.., default = 0.015)]
    threshold: f64,
}

impl Device for UdpPad {
    type Params = Params;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let (rows, cols) = (params.rows, params.cols);
        let shape = ImageShape { rows, cols, pitch: [params.pitch; 2], unit: Unit::NEWTON };
        let mut description = Description::every(1.0 / params.rate_hz);
        description.latency = params.latency_ms * 1e-3;
        let mut pad = description.fills("tactile_pad");
        let image = pad.output("image", shape);
        pad.fact_in("threshold", params.threshold, Unit::NEWTON);
        pad.fact("calibration", toml::Table::from_iter([("gain".to_owned(), 1.0.into())]));
        let silence = Duration::from_secs_f64(params.silence_s);
        let driver = Self { image, address: params.address, silence, frame: vec![0.0; rows * cols] };
        Ok(Opened { description, driver: Driver::Live(Box::new(driver)) })
    }
}

#[async_trait]
impl Live for UdpPad {
    async fn run(mut self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        loop {
            let stopped = link.stopped();
            let lost = tokio::select! {
                lost = self.stream(&mut link) => lost,
                () = stopped => return Ok(()),
            };
            link.lost(self.image, lost);
            link.count("reconnects");
        }
    }
}

impl UdpPad {
    /// Connects and publishes frames until none comes any more. Returns why.
    async fn stream(&mut self, link: &mut Link) -> String {
        let error = match self.connect().await {
            Ok(socket) => self.frames(&socket, link).await,
            Err(error) => error,
        };
        // A refused connection comes back at once: do not ask again and again.
        if error.kind() != io::ErrorKind::TimedOut {
            tokio::time::sleep(self.silence).await;
        }
        format!("{}: {error}", self.address)
    }

    async fn connect(&self) -> io::Result<UdpSocket> {
        let socket = UdpSocket::bind("0.0.0.0:0").await?;
        socket.connect(&self.address).await?;
        socket.send(b"hello").await?;
        Ok(socket)
    }

    /// Publishes frames. Returns the error that ends them.
    async fn frames(&mut self, socket: &UdpSocket, link: &mut Link) -> io::Error {
        // One byte more than a frame, so that a longer datagram is not taken for one.
        let mut datagram = vec![0; 8 + 4 * self.frame.len() + 1];
        loop {
            let length = match timeout(self.silence, socket.recv(&mut datagram)).await {
                Ok(Ok(length)) => length,
                Ok(Err(error)) => return error,
                Err(_) => return io::Error::new(io::ErrorKind::TimedOut, format!("no frame for {:?}", self.silence)),
            };
            let stamp = link.arrival();
            match decode(&datagram[..length], &mut self.frame) {
                Some(number) => link.publish(|samples| {
                    samples.write(self.image, stamp, number).cells_mut().copy_from_slice(&self.frame);
                }),
                None => link.count("bad frames"),
            }
        }
    }
}

/// Reads a datagram into `cells`. Returns the number of the frame, or `None` if the datagram is no frame.
fn decode(datagram: &[u8], cells: &mut [f32]) -> Option<u64> {
    let (number, values) = datagram.split_first_chunk::<8>()?;
    let (values, rest) = values.as_chunks::<4>();
    if values.len() != cells.len() || !rest.is_empty() {
        return None;
    }
    for (cell, value) in cells.iter_mut().zip(values) {
        *cell = f32::from_le_bytes(*value);
    }
    cells.iter().all(|cell| cell.is_finite()).then(|| u64::from_le_bytes(*number))
}

#[cfg(test)]
mod tests {
    use std::net::UdpSocket;

    use tactflow_runtime::harness::LinkRig;

    use super::*;

    const SOON: Duration = Duration::from_secs(5);

    /// A pad of 1 by 2 tactels, and the driver that streams from it.
    fn rig() -> (UdpSocket, LinkRig) {
        let pad = UdpSocket::bind("127.0.0.1:0").unwrap();
        pad.set_read_timeout(Some(SOON)).unwrap();
        let address = pad.local_addr().unwrap();
        let params = format!("address = '{address}'\nrows = 1\ncols = 2\nsilence_s = 0.1");
        (pad, LinkRig::start::<UdpPad>(&params).unwrap())
    }

    /// Waits for the hello of the driver, and connects to it.
    fn accept(pad: &UdpSocket) -> std::net::SocketAddr {
        let mut hello = [0; 8];
        let (length, driver) = pad.recv_from(&mut hello).unwrap();
        assert_eq!(&hello[..length], b"hello");
        driver
    }

    fn frame(number: u64, cells: &[f32]) -> Vec<u8> {
        let cells = cells.iter().flat_map(|cell| cell.to_le_bytes());
        number.to_le_bytes().into_iter().chain(cells).collect()
    }

    #[test]
    fn frames_are_published_and_what_is_no_frame_is_counted() {
        let (pad, mut rig) = rig();
        let driver = accept(&pad);
        pad.send_to(&frame(1, &[0.5, 1.5]), driver).unwrap();
        assert_eq!(rig.next::<Image>("image", SOON).unwrap().cells(), [0.5, 1.5]);
        for bad in [&b"nonsense"[..], &frame(2, &[0.5]), &frame(2, &[0.5; 3]), &frame(2, &[0.5, f32::NAN])] {
            pad.send_to(bad, driver).unwrap();
        }
        pad.send_to(&frame(2, &[2.5, 3.5]), driver).unwrap();
        assert_eq!(rig.next::<Image>("image", SOON).unwrap().cells(), [2.5, 3.5]);
        assert_eq!(rig.count("bad frames"), 4);
        rig.stop().unwrap();
    }

    #[test]
    fn a_silent_pad_is_lost_and_connected_again() {
        let (pad, mut rig) = rig();
        let driver = accept(&pad);
        pad.send_to(&frame(1, &[0.5, 1.5]), driver).unwrap();
        assert!(rig.next::<Image>("image", SOON).is_some());
        assert!(rig.wait_until(SOON, |rig| rig.lost("image").is_some()), "the port is lost");
        assert!(rig.lost("image").unwrap().ends_with("no frame for 100ms"), "{:?}", rig.lost("image"));
        assert_eq!(rig.get::<Image>("image"), None);
        // The driver binds a new socket and says hello again. The pad may count from 1 again.
        let driver = accept(&pad);
        pad.send_to(&frame(1, &[4.5, 5.5]), driver).unwrap();
        assert_eq!(rig.next::<Image>("image", SOON).unwrap().cells(), [4.5, 5.5]);
        assert_eq!(rig.lost("image"), None);
        assert!(rig.count("reconnects") >= 1);
        rig.stop().unwrap();
    }

    #[test]
    fn a_pad_that_is_not_there_is_lost_and_the_driver_can_be_stopped() {
        let nobody = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
        let mut rig = LinkRig::start::<UdpPad>(&format!("address = '{nobody}'\nsilence_s = 0.05")).unwrap();
        assert!(rig.wait_until(SOON, |rig| rig.lost("image").is_some()));
        assert!(rig.lost("image").unwrap().starts_with(&nobody.to_string()));
        rig.stop().unwrap();
    }
}
