//! `ros2_force`: a force sensor behind a topic.

use std::time::{Duration, Instant};

use async_trait::async_trait;
use nalgebra::IsometryMatrix3;
use tactflow_runtime::device::{Description, Device, DeviceError, Driver, Link, Live, Opened};
use tactflow_runtime::node::{Describe, Mistakes, Param};
use tokio::time::sleep_until;

use super::message::WrenchStamped;
use super::place::{Place, Site, check_topic};
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
        check_topic("topic", &params.topic)?;
        let mut description = Description::every(1.0 / params.rate_hz);
        let ports = WrenchPorts::fill(&mut description, Vec::new());
        let timeout_ms = params.timeout_ms.unwrap_or_else(|| (5e3 / params.rate_hz).max(100.0));
        let driver = ForceDriver {
            ports,
            site: params.place.site()?,
            topic: params.topic,
            timeout: Duration::from_secs_f64(timeout_ms * 1e-3),
            sign: if params.is_reaction { -1.0 } else { 1.0 },
            frame: params.frame.pose(),
        };
        Ok(Opened { description, driver: Driver::Live(Box::new(driver)) })
    }
}

struct ForceDriver {
    ports: WrenchPorts,
    site: Site,
    topic: String,
    timeout: Duration,
    sign: f64,
    frame: IsometryMatrix3<f64>,
}

#[async_trait]
impl Live for ForceDriver {
    async fn run(mut self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        let domain = self.site.join().map_err(DeviceError)?;
        let mut reader = domain.read::<WrenchStamped>(&self.topic).map_err(DeviceError)?;
        let stopped = link.stopped();
        tokio::pin!(stopped);
        let (mut limit, mut number) = (Instant::now() + self.site.patience, 0);
        let (mut is_lost, mut bad) = (false, None);
        loop {
            tokio::select! {
                biased;
                () = &mut stopped => return Ok(()),
                () = sleep_until(limit.into()), if !is_lost => {
                    is_lost = true;
                    let why = bad.take().unwrap_or_else(|| domain.why_silent::<WrenchStamped>(&self.topic));
                    self.ports.lose(&mut link, &why);
                }
                message = reader.next() => match message {
                    Ok((message, _)) => {
                        (limit, number) = (Instant::now() + self.timeout, number + 1);
                        (is_lost, bad) = (false, None);
                        let stamp = message.header.stamp.nanos();
                        let stamp = if stamp == 0 { link.arrival() } else { link.stamp_of(stamp) };
                        let wrench = self.wrench(&message);
                        link.publish(|samples| self.ports.write(samples, stamp, number, &wrench));
                    }
                    Err(why) => {
                        link.count("bad messages");
                        bad = Some(format!("`{}`: {why}", self.topic));
                    }
                },
            }
        }
    }
}

impl ForceDriver {
    fn wrench(&self, message: &WrenchStamped) -> Wrench {
        let ([fx, fy, fz], [tx, ty, tz]) = (message.force, message.torque);
        moved(&[fx, fy, fz, tx, ty, tz].map(|value| self.sign * value), &self.frame)
    }
}
