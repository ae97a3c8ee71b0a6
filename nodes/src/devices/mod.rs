//! The devices, one per file: pads that provide images, and arms that take joint velocities.

use std::borrow::Cow;

#[cfg(feature = "drivers")]
pub mod agni;
pub(crate) mod arm;
pub(crate) mod guide;
#[cfg(feature = "drivers")]
pub(crate) mod link;
pub mod lockstep;
#[cfg(feature = "drivers")]
pub mod lwr_fri;
pub mod mock_arm;
pub mod mock_force;
pub mod mock_guide;
pub mod mock_pad;
pub(crate) mod pad;
pub(crate) mod per_joint;
#[cfg(feature = "process")]
pub mod process;
pub mod recording;
#[cfg(feature = "mcap")]
pub mod replay;
#[cfg(feature = "ros2")]
pub mod ros2;
#[cfg(any(feature = "process", feature = "ros2"))]
pub(crate) mod seldom;
#[cfg(feature = "drivers")]
pub mod start;
#[cfg(feature = "drivers")]
pub mod stream;
#[cfg(feature = "drivers")]
pub mod ur;
#[cfg_attr(not(feature = "drivers"), expect(dead_code, reason = "only drivers compensate a weight and lose a sensor"))]
pub(crate) mod wrench;

#[cfg(test)]
pub(crate) mod testing;

/// Facts that a device states of a role, by name.
pub(crate) type Facts = Vec<(Cow<'static, str>, toml::Value)>;

/// Returns the time between two samples of a device with a parameter `rate_hz` [ns].
pub(crate) fn period_of(rate_hz: f64) -> i64 {
    (1e9 / rate_hz).round() as i64
}

/// Converts seconds to nanoseconds. Times that are too long for an `i64` saturate.
pub(crate) fn nanos(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}
