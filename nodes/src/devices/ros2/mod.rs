//! ROS 2 without a ROS installation: pads, force sensors and arms behind topics. `docs/ros2.md` describes their set-up.
//!
//! `domain` joins a domain of DDS and says what others offer there, `message` has the messages, and `place` the parameters
//! that all devices share. `sensor` follows the topic of
//! a pad or a force sensor, and `frame` reads images. `guide` follows the topic of somebody who
//! guides. `shown` writes what others see of a run. `driver` runs an arm: `clock` compares the clocks, `course` makes the commands, and `output` sends
//! them. Only `domain` does I/O.

mod arm;
mod beyond;
mod clock;
mod course;
mod domain;
mod driver;
mod force;
mod frame;
mod guide;
mod message;
mod output;
mod pad;
mod place;
mod sensor;
#[cfg(all(feature = "cli", unix))]
pub(crate) mod shown;

#[cfg(all(feature = "cli", unix))]
pub(crate) use domain::offers;

pub use arm::Ros2Arm;
pub use force::Ros2Force;
pub use guide::Ros2Guide;
pub use pad::Ros2Pad;
