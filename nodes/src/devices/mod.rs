//! The edge: what gives images and takes joint velocities. One device a file.

pub(crate) mod arm_facts;
pub mod lockstep;
pub mod mock_arm;
pub mod mock_pad;
pub mod recording;

#[cfg(test)]
pub(crate) mod testing;

/// Time between two samples of a device with a parameter `rate_hz` [ns].
pub(crate) fn period_of(rate_hz: f64) -> i64 {
    (1e9 / rate_hz).round() as i64
}

/// Seconds as nanoseconds; what does not fit is for ever.
pub(crate) fn nanos(seconds: f64) -> i64 {
    (seconds * 1e9).round() as i64
}
