//! `mock_force`: a force sensor with a scripted wrench.

use tactflow_runtime::device::{Commands, Description, Device, DeviceError, Driver, Opened, Samples, Stepped};
use tactflow_runtime::node::{Describe, Mistakes, Param};

use super::wrench::{Wrench, WrenchPorts};
use super::{nanos, period_of};

/// Parameters of `mock_force`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// The wrench, `[fx, fy, fz, tx, ty, tz]`.
    #[param(unit = "N, N, N, N m, N m, N m", default = [0.0; 6])]
    wrench: [f64; 6],
    /// Time before which the wrench is zero.
    #[param(unit = "s", range = 0.0.., default = 0.0)]
    from_s: f64,
    /// Samples per second.
    #[param(unit = "1/s", range = 0.001..=1e6, default = 250.0)]
    rate_hz: f64,
}

/// A force sensor that measures a scripted wrench.
///
/// The wrench is zero until `from_s`, and constant from then on. It is for a first try of a task, and for tests: it
/// knows of no arm and of no contact.
///
/// ```toml
/// [roles]
/// force = { type = "force_sensor", on = "none" }   # a sensor on the arm needs no `on`
///
/// [bind]
/// force = "wrist"
///
/// [devices.wrist]
/// type = "mock_force"
/// wrench = [0.0, 0.0, -5.0, 0.0, 0.0, 0.0]
/// from_s = 1.0
/// ```
#[derive(Debug, Describe)]
pub struct MockForce {
    ports: WrenchPorts,
    wrench: Wrench,
    from: i64,
    period: i64,
    last: Option<i64>,
    sequence: u64,
}

impl Device for MockForce {
    type Params = Params;

    fn open(Params { wrench, from_s, rate_hz }: Params) -> Result<Opened, Mistakes> {
        let period = period_of(rate_hz);
        let mut description = Description::every(period as f64 * 1e-9);
        let ports = WrenchPorts::fill(&mut description, Vec::new());
        let sensor = Self { ports, wrench, from: nanos(from_s), period, last: None, sequence: 0 };
        Ok(Opened { description, driver: Driver::Stepped(Box::new(sensor)) })
    }
}

impl Stepped for MockForce {
    fn next(&self) -> Option<i64> {
        Some(self.last.map_or(0, |last| (last / self.period + 1) * self.period))
    }

    fn exchange(&mut self, now: i64, _: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        if self.next().is_some_and(|next| next <= now) {
            (self.last, self.sequence) = (Some(now), self.sequence + 1);
            let wrench = if now < self.from { [0.0; 6] } else { self.wrench };
            self.ports.write(samples, now, self.sequence, &wrench);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::devices::testing::{Bench, open};

    #[test]
    fn the_wrench_begins_when_it_should() {
        let mut bench = open::<MockForce>("wrench = [1, 2, 3, 4, 5, 6]\nfrom_s = 0.5").map(Bench::new).unwrap();
        for (ms, expected) in [(0.0, 0.0), (496.0, 0.0), (500.0, 6.0)] {
            bench.exchange((ms * 1e6) as i64);
            let port = bench.description.output::<f64>("tz").unwrap();
            assert_eq!(*bench.samples.write(port, 0, 0), expected, "{ms} ms");
        }
    }
}
