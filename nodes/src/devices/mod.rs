//! The edge: what gives images and takes joint velocities. One device a file.

pub mod mock_arm;
pub mod mock_pad;
pub mod tekscan;

#[cfg(test)]
mod testing;

use tactflow_runtime::node::{Mistake, Mistakes, Positive};

/// Time between two samples of a device with a parameter `rate_hz` [ns].
fn period_of(rate_hz: Positive) -> Result<i64, Mistakes> {
    if !(1e-3..=1e5).contains(&*rate_hz) {
        return Err(Mistake::param("rate_hz", "`rate_hz` is from 0.001 to 100000").into());
    }
    Ok((1e9 / *rate_hz).round() as i64)
}
