//! `mock_guide`: somebody who guides an arm by a script.

use tactflow_runtime::device::{Commands, Description, Device, DeviceError, Driver, Opened, Samples, Stepped};
use tactflow_runtime::node::{Describe, Mistake, Mistakes, Param};

use super::guide::GuidePort;
use super::{nanos, period_of};

/// Parameters of `mock_guide`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// What is wanted, one after the other.
    moves: Vec<Move>,
    /// Samples per second.
    #[param(unit = "1/s", range = 0.001..=1e6, default = 50.0)]
    rate_hz: f64,
}

/// A velocity for a time.
#[derive(Debug, Clone, Param)]
struct Move {
    /// The velocity, `[vx, vy, vz, wx, wy, wz]`.
    #[param(unit = "m/s, rad/s")]
    velocity: [f64; 6],
    /// When it begins.
    #[param(unit = "s", range = 0.0..)]
    from_s: f64,
    /// When it ends.
    #[param(unit = "s", above = 0.0)]
    to_s: f64,
}

/// Somebody who guides an arm by a script.
///
/// It sends each velocity from `from_s` until `to_s`, and nothing in between, as a person who lets a joystick go. It is
/// for a first try of a task, and for tests: it knows of no arm and of no contact.
///
/// ```toml
/// [roles]
/// joystick = { type = "motion_guide", on = "none" }
///
/// [bind]
/// joystick = "hand"
///
/// [devices.hand]
/// type = "mock_guide"
/// moves = [
///   { velocity = [0.01, 0, 0, 0, 0, 0], from_s = 0.0, to_s = 60.0 },
/// ]
/// ```
#[derive(Debug, Describe)]
pub struct MockGuide {
    port: GuidePort,
    /// The velocity, and when it begins and ends [ns].
    moves: Vec<([f64; 6], i64, i64)>,
    period: i64,
    last: Option<i64>,
    sequence: u64,
}

impl Device for MockGuide {
    type Params = Params;

    fn open(Params { moves, rate_hz }: Params) -> Result<Opened, Mistakes> {
        let period = period_of(rate_hz);
        let mut description = Description::every(period as f64 * 1e-9);
        let port = GuidePort::fill(&mut description);
        if moves.iter().any(|part| part.to_s <= part.from_s) {
            return Err(Mistake::param("moves", "a move ends before it begins: `to_s` must be after `from_s`").into());
        }
        let moves = moves.into_iter().map(|part| (part.velocity, nanos(part.from_s), nanos(part.to_s)));
        let guide = Self { port, moves: moves.collect(), period, last: None, sequence: 0 };
        Ok(Opened { description, driver: Driver::Stepped(Box::new(guide)) })
    }
}

impl Stepped for MockGuide {
    fn next(&self) -> Option<i64> {
        Some(self.last.map_or(0, |last| (last / self.period + 1) * self.period))
    }

    fn exchange(&mut self, now: i64, _: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        if self.next().is_some_and(|next| next <= now) {
            self.last = Some(now);
            if let Some((velocity, ..)) = self.moves.iter().find(|(_, from, until)| (*from..*until).contains(&now)) {
                self.sequence += 1;
                self.port.write(samples, now, self.sequence, velocity);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::signal::Features;

    use super::*;
    use crate::devices::testing::{Bench, open};

    #[test]
    fn each_velocity_is_sent_in_its_time() {
        let moves = "moves = [{ velocity = [1, 0, 0, 0, 0, 0], from_s = 0.5, to_s = 0.6 }, \
                     { velocity = [0, 2, 0, 0, 0, 0], from_s = 1.0, to_s = 2.0 }]";
        let mut bench = open::<MockGuide>(moves).map(Bench::new).unwrap();
        for (ms, expected) in [(0.0, None), (500.0, Some(1.0)), (590.0, Some(1.0)), (1000.0, Some(0.0))] {
            bench.exchange((ms * 1e6) as i64);
            let port = bench.description.output::<Features>("velocity").unwrap();
            let values: Vec<Option<f64>> = bench.samples.write(port, 0, 0).values().collect();
            assert_eq!(values[0], expected, "{ms} ms");
        }
        assert!(open::<MockGuide>("moves = [{ velocity = [1, 0, 0, 0, 0, 0], from_s = 1.0, to_s = 0.5 }]").is_err());
    }
}
