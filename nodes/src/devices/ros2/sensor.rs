//! A sensor behind a topic: its messages until the run ends, and why it is lost.

use std::time::{Duration, Instant};

use tactflow_runtime::device::{DeviceError, Link};
use tactflow_runtime::node::Mistakes;
use tokio::time::sleep_until;

use super::message::{Message, Time};
use super::place::{Place, Site, check_topic};

/// The topic of a sensor.
pub(super) struct Sensor {
    site: Site,
    topic: String,
    timeout: Duration,
}

impl Sensor {
    /// A sensor with so many messages in a second, which is lost after `timeout_ms` without one: after five periods, and at
    /// least 100 ms, if not given.
    ///
    /// # Errors
    /// Mistakes in the topic and the place.
    pub(super) fn new(place: &Place, topic: String, rate_hz: f64, timeout_ms: Option<f64>) -> Result<Self, Mistakes> {
        check_topic("topic", &topic)?;
        let timeout_ms = timeout_ms.unwrap_or_else(|| (5e3 / rate_hz).max(100.0));
        Ok(Self { site: place.site()?, topic, timeout: Duration::from_secs_f64(timeout_ms * 1e-3) })
    }

    /// Passes on messages until the run ends. `take` publishes one with its number, or returns what is wrong with it.
    /// `lose` makes the ports absent.
    ///
    /// # Errors
    /// If the topic cannot be read.
    pub(super) async fn follow<M: Message>(
        &self,
        link: &mut Link,
        mut take: impl FnMut(&mut Link, &M, u64) -> Result<(), String>,
        lose: impl Fn(&mut Link, &str),
    ) -> Result<(), DeviceError> {
        let domain = self.site.join().map_err(DeviceError)?;
        let mut reader = domain.read::<M>(&self.topic).map_err(DeviceError)?;
        let stopped = link.stopped();
        tokio::pin!(stopped);
        let (mut limit, mut number) = (Instant::now() + self.site.patience, 1);
        let (mut is_lost, mut bad) = (false, None);
        loop {
            tokio::select! {
                biased;
                () = &mut stopped => return Ok(()),
                () = sleep_until(limit.into()), if !is_lost => {
                    is_lost = true;
                    let why = bad.take().unwrap_or_else(|| domain.why_silent::<M>(&self.topic));
                    lose(link, &why);
                }
                message = reader.next() => match message.and_then(|(message, _)| take(link, &message, number)) {
                    Ok(()) => {
                        (limit, number) = (Instant::now() + self.timeout, number + 1);
                        (is_lost, bad) = (false, None);
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

/// Returns the stamp of a message that has just arrived: that of its header, or of its arrival without one [ns].
pub(super) fn stamp(link: &mut Link, header: Time) -> i64 {
    match header.nanos() {
        0 => link.arrival(),
        measured => link.stamp_of(measured),
    }
}
