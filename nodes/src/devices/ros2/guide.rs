//! `ros2_guide`: somebody behind a topic who guides an arm.

use std::time::{Duration, Instant};

use async_trait::async_trait;
use rustdds::GUID;
use tactflow_runtime::device::{Description, Device, DeviceError, Driver, Link, Live, Opened};
use tactflow_runtime::node::{Describe, Mistake, Mistakes, Param};
use tokio::time::sleep_until;

use super::clock::Agreement;
use super::message::{Message, TwistStamped};
use super::output::wall_clock;
use super::place::{Place, Site, check_topic};
use crate::devices::guide::GuidePort;
use crate::devices::seldom::Seldom;

/// How long somebody who guides keeps others from it.
const HOLD: Duration = Duration::from_secs(1);
/// The number of publishers whose clocks are remembered.
const CLOCKS: usize = 16;

/// Parameters of `ros2_guide`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// The topic of `geometry_msgs/msg/TwistStamped`, such as `/guide/twist`.
    topic: String,
    /// The frame in which the velocities are: `frame_id` of the messages. It must be the frame in which the task uses them,
    /// under its name in ROS; a message in another one is refused.
    frame: String,
    #[param(flatten)]
    place: Place,
    /// Messages per second while somebody guides.
    #[param(unit = "1/s", range = 1.0..=1e4)]
    rate_hz: f64,
    /// Largest difference between the clock of the publisher and that of this machine.
    #[param(unit = "ms", above = 0.0, default = 50.0)]
    clock_bound_ms: f64,
}

/// Somebody behind a topic of ROS 2 who guides an arm: a joystick, a planner, MoveIt. It needs no ROS installation.
///
/// The messages have velocities in m/s and rad/s. Somebody who lets go may stop publishing, or publish zeros. Silence is no failure
/// of this device: the greatest age on the wire of the velocity, and the policy of the role, decide what it means.
///
/// The stamp of a message says when the velocity was wanted. It counts by the wall clock, so that one that was delayed moves
/// nothing. A message is refused, counted (`bad messages`) and named in a warning if it has no stamp or another `frame_id`,
/// if the clocks differ by more than `clock_bound_ms`, or if somebody else has guided in the last second. A number that is
/// not finite is a trouble of the policy `not_finite`.
///
/// ```toml
/// [roles]
/// joystick = { type = "motion_guide", on = "none" }
///
/// [bind]
/// joystick = "hand"
///
/// [devices.hand]
/// type = "ros2_guide"
/// topic = "/guide/twist"
/// frame = "tactile_pad"
/// rate_hz = 30.0
/// ```
#[derive(Debug, Describe)]
pub struct Ros2Guide;

impl Device for Ros2Guide {
    type Params = Params;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        check_topic("topic", &params.topic)?;
        if params.frame.is_empty() {
            let message = "velocities without a frame mean nothing";
            let help = "write the `frame_id` of the messages, such as `frame = \"tactile_pad\"`";
            return Err(Mistake::param("frame", message).help(help).into());
        }
        let mut description = Description::every(1.0 / params.rate_hz);
        let port = GuidePort::fill(&mut description);
        let site = params.place.site()?;
        let bound = (params.clock_bound_ms * 1e6) as i64;
        let hearing = Hearing::new(params.topic, params.frame, bound);
        Ok(Opened { description, driver: Driver::Live(Box::new(GuideDriver { port, site, hearing })) })
    }
}

struct GuideDriver {
    port: GuidePort,
    site: Site,
    hearing: Hearing,
}

#[async_trait]
impl Live for GuideDriver {
    async fn run(self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        let Self { port, site, mut hearing } = *self;
        let domain = site.join().map_err(DeviceError)?;
        let mut reader = domain.read::<TwistStamped>(&hearing.topic).map_err(DeviceError)?;
        let stopped = link.stopped();
        tokio::pin!(stopped);
        let (patience, mut has_waited, mut number) = (Instant::now() + site.patience, false, 0);
        loop {
            tokio::select! {
                biased;
                () = &mut stopped => return Ok(()),
                () = sleep_until(patience.into()), if !has_waited => {
                    has_waited = true;
                    // Somebody who publishes may have let go of a joystick.
                    if domain.writers(&hearing.topic).iter().all(|writer| writer.kind != TwistStamped::TYPE) {
                        hearing.warn(&domain.why_silent::<TwistStamped>(&hearing.topic));
                    }
                }
                message = reader.next() => {
                    let heard = message.map_err(|why| format!("`{}`: {why}", hearing.topic));
                    match heard.and_then(|(message, writer)| hearing.take(&message, writer, Instant::now(), wall_clock())) {
                        Ok((age, velocity)) => {
                            (has_waited, number) = (true, number + 1);
                            let stamp = link.arrival() - age;
                            link.publish(|samples| port.write(samples, stamp, number, &velocity));
                        }
                        Err(why) => {
                            link.count("bad messages");
                            hearing.warn(&why);
                        }
                    }
                }
            }
        }
    }
}

/// What has been heard on the topic.
#[derive(Debug)]
struct Hearing {
    topic: String,
    frame: String,
    /// Largest difference of two clocks that agree [ns].
    bound: i64,
    /// The clocks of the publishers, the newest publisher last.
    clocks: Vec<(GUID, Agreement)>,
    /// Who guides, and since when nothing came from there.
    guide: Option<(GUID, Instant)>,
    warnings: Seldom,
}

impl Hearing {
    fn new(topic: String, frame: String, bound: i64) -> Self {
        Self { topic, frame, bound, clocks: Vec::new(), guide: None, warnings: Seldom::default() }
    }

    /// Takes a message that has arrived, also by the wall clock [ns]. Returns its age [ns] and its velocity.
    ///
    /// # Errors
    /// Why it guides nothing.
    fn take(
        &mut self,
        message: &TwistStamped,
        writer: GUID,
        now: Instant,
        arrived: i64,
    ) -> Result<(i64, [f64; 6]), String> {
        let (topic, frame, of) = (&self.topic, &self.frame, &message.header.frame_id);
        let is_other = |(guide, at): &(GUID, Instant)| *guide != writer && now.duration_since(*at) < HOLD;
        if self.guide.as_ref().is_some_and(is_other) {
            return Err(format!("two programs publish on `{topic}`: only one may guide, and the first one does"));
        }
        if of != frame {
            let help = "the publisher must convert them, or `frame` of the bench is wrong";
            return Err(format!("`{topic}` has velocities in `{of}`, and not in `{frame}`: {help}"));
        }
        let stamp = message.header.stamp.nanos();
        if stamp == 0 {
            return Err(format!("the messages of `{topic}` have no stamp, so that an old one could not be recognized"));
        }
        let place = self.clocks.iter().position(|(known, _)| *known == writer).unwrap_or(self.clocks.len());
        if place == self.clocks.len() {
            self.clocks.push((writer, Agreement::new(self.bound, now)));
        }
        let clock = &mut self.clocks[place].1;
        clock.hear(now, arrived, stamp);
        let why_not = clock.why_not(topic);
        if self.clocks.len() > CLOCKS {
            let guide = self.guide.as_ref().map(|(guide, _)| *guide);
            let oldest = self.clocks.iter().position(|(known, _)| Some(*known) != guide);
            oldest.map(|oldest| self.clocks.remove(oldest));
        }
        if let Some(why) = why_not {
            return Err(why);
        }
        self.guide = Some((writer, now));
        let ([vx, vy, vz], [wx, wy, wz]) = (message.linear, message.angular);
        Ok(((arrived - stamp).max(0), [vx, vy, vz, wx, wy, wz]))
    }

    /// Warns, but not more often than a person reads.
    fn warn(&mut self, why: &str) {
        if self.warnings.is_due() {
            tracing::warn!("a message of a guide is refused: {why}");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::message::{Header, Time};
    use super::*;

    const MS: i64 = 1_000_000;

    fn message(frame: &str, stamp: i64) -> TwistStamped {
        let header = Header { stamp: Time::of_nanos(stamp), frame_id: frame.into() };
        TwistStamped { header, linear: [0.01, 0.0, 0.0], angular: [0.0, 0.0, 0.1] }
    }

    #[test]
    fn a_message_guides_or_is_named() {
        let arrived = 1_700_000_000_000 * MS;
        for (message, expected) in [
            (message("pad", arrived - 2 * MS), Ok((2 * MS, [0.01, 0.0, 0.0, 0.0, 0.0, 0.1]))),
            (message("pad", arrived + MS), Ok((0, [0.01, 0.0, 0.0, 0.0, 0.0, 0.1]))),
            (message("base", arrived), Err("has velocities in `base`, and not in `pad`")),
            (message("", arrived), Err("has velocities in ``, and not in `pad`")),
            (message("pad", 0), Err("have no stamp")),
            (message("pad", arrived - 3000 * MS), Err("are 3.000 s behind the clock of this machine")),
            (message("pad", arrived + 300 * MS), Err("are 0.300 s ahead of the clock of this machine")),
            (message("pad", 5 * MS), Err("are years away")),
        ] {
            let mut hearing = Hearing::new("/guide".into(), "pad".into(), 50 * MS);
            let taken = hearing.take(&message, GUID::GUID_UNKNOWN, Instant::now(), arrived);
            match expected {
                Ok(expected) => assert_eq!(taken, Ok(expected)),
                Err(text) => assert!(taken.as_ref().is_err_and(|why| why.contains(text)), "{taken:?}"),
            }
        }
    }

    #[test]
    fn the_first_of_two_guides_until_it_is_silent() {
        let mut hearing = Hearing::new("/guide".into(), "pad".into(), 50 * MS);
        let other = GUID::from_bytes([7; 16]);
        let (begin, arrived) = (Instant::now(), 1_700_000_000_000 * MS);
        let mut at = |ms: u64, writer| {
            let (now, arrived) = (begin + Duration::from_millis(ms), arrived + ms as i64 * MS);
            hearing.take(&message("pad", arrived), writer, now, arrived)
        };
        assert!(at(0, GUID::GUID_UNKNOWN).is_ok());
        assert!(at(500, other).unwrap_err().contains("two programs publish on `/guide`"));
        assert!(at(900, GUID::GUID_UNKNOWN).is_ok());
        assert!(at(1500, other).is_err());
        assert!(at(2000, other).is_ok());
    }

    #[test]
    fn a_publisher_with_another_clock_keeps_nobody_from_guiding() {
        let mut hearing = Hearing::new("/guide".into(), "pad".into(), 50 * MS);
        let (begin, arrived) = (Instant::now(), 1_700_000_000_000 * MS);
        let mut at = |ms: u64, writer: u8, ahead: i64| {
            let (now, arrived) = (begin + Duration::from_millis(ms), arrived + ms as i64 * MS);
            hearing.take(&message("pad", arrived + ahead), GUID::from_bytes([writer; 16]), now, arrived)
        };
        // Many publishers with a wrong clock come first.
        for i in 2..200 {
            let wrong = at(u64::from(i), i, 9000 * MS);
            assert!(wrong.as_ref().is_err_and(|why| why.contains("ahead of the clock")), "{wrong:?}");
        }
        assert!(at(500, 1, -MS).is_ok());
        assert!(at(510, 7, 9000 * MS).is_err_and(|why| why.contains("two programs")));
        assert!(at(520, 1, -MS).is_ok());
        assert!(at(1600, 7, 9000 * MS).is_err_and(|why| why.contains("ahead of the clock")));
        assert!(at(1610, 8, -MS).is_ok());
        assert!(hearing.clocks.len() <= CLOCKS);
    }
}
