//! `line_length`: a live length: a number a line from a TCP connection.

use std::time::Instant;

use async_trait::async_trait;
use tactflow_runtime::device::{Description, Device, DeviceError, Driver, Link, Live, Opened, Output};
use tactflow_runtime::node::{Describe, Mistakes, Param};
use tactflow_runtime::signal::{Scalar, ScalarShape, Unit};
use tokio::io::{AsyncBufReadExt, BufReader};
use tokio::net::TcpStream;

/// Parameters of `line_length`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Address of the peer that sends the numbers.
    address: String,
}

/// A length from a TCP connection, one number a line.
///
/// Each line is a length in metres. It runs in real time.
///
/// ```toml
/// [roles]
/// length = "length"
///
/// [bind]
/// length = "ruler"
///
/// [devices.ruler]
/// type = "line_length"
/// address = "127.0.0.1:4000"
/// ```
#[derive(Describe)]
pub struct LineLength {
    address: String,
    value: Output<Scalar>,
}

impl Device for LineLength {
    type Params = Params;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let mut description = Description::every(0.01);
        let value = description.fills("length").output("value", ScalarShape::of(Unit::METRE));
        Ok(Opened { description, driver: Driver::Live(Box::new(Self { address: params.address, value })) })
    }
}

#[async_trait]
impl Live for LineLength {
    async fn run(self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        let failed = |error: std::io::Error| DeviceError(format!("{}: {error}", self.address));
        let stream = TcpStream::connect(&self.address).await.map_err(failed)?;
        let mut lines = BufReader::new(stream).lines();
        let mut sequence = 0;
        loop {
            let line = tokio::select! {
                line = lines.next_line() => line.map_err(failed)?,
                () = link.stopped() => return Ok(()),
            };
            let line = line.ok_or_else(|| DeviceError("the peer hung up".into()))?;
            let number: f64 = line.parse().map_err(|_| DeviceError(format!("`{line}` is not a number")))?;
            let stamp = link.stamp(Instant::now());
            sequence += 1;
            link.publish(|samples| *samples.write(self.value, stamp, sequence) = number);
        }
    }
}
