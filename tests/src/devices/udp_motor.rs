//! `udp_motor`: a motor that gets its velocity as UDP datagrams.

use std::io;
use std::net::UdpSocket;
use std::time::{Duration, Instant};

use async_trait::async_trait;
use tactflow_runtime::device::{
    Command, Description, Device, DeviceError, Driver, Link, Live, OnSilence, Opened, Output, RoleType,
};
use tactflow_runtime::node::{Describe, Mistakes, Param, PortSpec};
use tactflow_runtime::signal::{Joint, Joints, JointsShape, Kind, Unit};

/// The role of a motor that wants to be moved.
pub fn role() -> RoleType {
    let velocity = |name, doc| PortSpec::new(name, doc, Kind::Joints, &["rad/s", "self"]);
    RoleType {
        name: "drive".into(),
        summary: "a motor".into(),
        outputs: vec![velocity("wanted", "The velocity that the motor wants.")],
        commands: vec![velocity("velocity", "The velocity of the motor.")],
        ..RoleType::default()
    }
}

/// Parameters of `udp_motor`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Where the motor listens, as `host:port`.
    address: String,
    /// Velocity that the motor wants.
    #[param(unit = "rad/s", default = 1.0)]
    wanted: f64,
    /// Maximum acceleration.
    #[param(unit = "rad/s2", above = 0.0, default = 10.0)]
    acceleration: f64,
    /// Time without a command after which the motor is at rest.
    #[param(unit = "ms", above = 0.0, default = 250.0)]
    silence_ms: f64,
    /// Whether the motor goes on after this time.
    #[param(default = false)]
    keeps_moving: bool,
    /// What stops it then.
    watchdog: Option<String>,
    /// Whether it counts as a real arm.
    #[param(default = false)]
    needs_commissioning: bool,
}

/// A motor that gets its velocity as UDP datagrams.
///
/// Every 10 ms, the device sends the velocity that holds to `address`, as one `f64` in little-endian order.
///
/// ```toml
/// [roles]
/// motor = "drive"
///
/// [commands]
/// motor.velocity = "motor.wanted"
///
/// [bind]
/// motor = "motor"
///
/// [devices.motor]
/// type = "udp_motor"
/// address = "127.0.0.1:4001"
/// ```
#[derive(Describe)]
pub struct UdpMotor {
    wanted: Output<Joints>,
    velocity: Command,
    params: Params,
}

/// Time between two commands, and between two samples.
const PERIOD: Duration = Duration::from_millis(10);

impl Device for UdpMotor {
    type Params = Params;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let mut description = Description::every(PERIOD.as_secs_f64());
        let reaction = match params.keeps_moving {
            true => OnSilence::KeepsMoving { watchdog: params.watchdog.clone() },
            false => OnSilence::Holds,
        };
        description.on_silence(reaction, params.silence_ms * 1e-3);
        description.needs_commissioning = params.needs_commissioning;
        let joint = Joint {
            name: "shaft".into(),
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
            speed: f64::INFINITY,
            acceleration: params.acceleration,
            start: None,
        };
        let shape = JointsShape { joints: vec![joint], unit: Unit::RADIAN.per_second() };
        let mut motor = description.fills("drive");
        let wanted = motor.output("wanted", shape.clone());
        let velocity = motor.command("velocity", shape);
        Ok(Opened { description, driver: Driver::Live(Box::new(Self { wanted, velocity, params })) })
    }
}

#[async_trait]
impl Live for UdpMotor {
    async fn run(self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        let socket = self.connect()?;
        let mut next = Instant::now();
        for number in 1.. {
            let stamp = link.arrival();
            link.publish(|samples| samples.write(self.wanted, stamp, number).0.fill(self.params.wanted));
            let stopped = link.stopped();
            next += PERIOD;
            tokio::select! {
                () = tokio::time::sleep_until(next.into()) => {}
                () = stopped => break,
            }
            self.send(&socket, &mut link);
        }
        self.send(&socket, &mut link);
        Ok(())
    }
}

impl UdpMotor {
    fn send(&self, socket: &UdpSocket, link: &mut Link) {
        // A motor that does not listen is no failure: it stops by itself.
        let _ = socket.send(&link.commands().joints(self.velocity)[0].to_le_bytes());
    }

    fn connect(&self) -> io::Result<UdpSocket> {
        let socket = UdpSocket::bind("127.0.0.1:0")?;
        socket.connect(&self.params.address)?;
        Ok(socket)
    }
}
