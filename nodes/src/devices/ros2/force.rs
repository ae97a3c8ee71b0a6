//! `ros2_force`: a force sensor behind a topic.

use async_trait::async_trait;
use nalgebra::IsometryMatrix3;
use tactflow_runtime::device::{Description, Device, DeviceError, Driver, Link, Live, Opened};
use tactflow_runtime::node::{Describe, Mistakes, Param};

use super::message::WrenchStamped;
use super::place::Place;
use super::sensor::{Sensor, stamp};
use crate::arm::mount::Mount;
use crate::devices::wrench::{Wrench, WrenchPorts, moved};

/// Parameters of `ros2_force`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// The topic of `geometry_msgs/msg/WrenchStamped`, such as `/ft_sensor/wrench`.
    topic: String,
    #[param(flatten)]
    place: Place,
    /// Samples per second.
    #[param(unit = "1/s", range = 0.001..=1e5)]
    rate_hz: f64,
    /// Time without a message after which the sensor is lost: five periods, and at least 100 ms, if not given.
    #[param(unit = "ms", above = 0.0)]
    timeout_ms: Option<f64>,
    /// Whether the messages have the wrench that the tool exerts, and not the one that the environment exerts on it.
    #[param(default = false)]
    is_reaction: bool,
    /// Pose of the frame of the messages on the tip of the arm.
    #[param(default = Mount::NONE)]
    frame: Mount,
}

/// A force sensor behind a topic of ROS 2. It needs no ROS installation.
///
/// The role `force_sensor` has the wrench that the environment exerts on the tool, about the origin of the tip and in its
/// axes. Drivers of sensors differ: state the `frame` of the messages on the tip, and whether they report the
/// reaction. The weight of the tool must be compensated by the driver.
///
/// ```toml
/// [roles]
/// force = { type = "force_sensor", on = "none" }
///
/// [bind]
/// force = "wrist"
///
/// [devices.wrist]
/// type = "ros2_force"
/// topic = "/ft_sensor/wrench"
/// rate_hz = 500.0
/// ```
#[derive(Debug, Describe)]
pub struct Ros2Force;

impl Device for Ros2Force {
    type Params = Params;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let sensor = Sensor::new(&params.place, params.topic, params.rate_hz, params.timeout_ms)?;
        let mut description = Description::every(1.0 / params.rate_hz);
        let ports = WrenchPorts::fill(&mut description, Vec::new());
        let sign = if params.is_reaction { -1.0 } else { 1.0 };
        let driver = ForceDriver { ports, sensor, sign, frame: params.frame.pose() };
        Ok(Opened { description, driver: Driver::Live(Box::new(driver)) })
    }
}

struct ForceDriver {
    ports: WrenchPorts,
    sensor: Sensor,
    sign: f64,
    frame: IsometryMatrix3<f64>,
}

#[async_trait]
impl Live for ForceDriver {
    async fn run(self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        let take = |link: &mut Link, message: &WrenchStamped, number| {
            let (stamp, wrench) = (stamp(link, message.header.stamp), self.wrench(message));
            link.publish(|samples| self.ports.write(samples, stamp, number, &wrench));
            Ok(())
        };
        self.sensor.follow(&mut link, take, |link, why| self.ports.lose(link, why)).await
    }
}

impl ForceDriver {
    fn wrench(&self, message: &WrenchStamped) -> Wrench {
        let ([fx, fy, fz], [tx, ty, tz]) = (message.force, message.torque);
        moved(&[fx, fy, fz, tx, ty, tz].map(|value| self.sign * value), &self.frame)
    }
}
