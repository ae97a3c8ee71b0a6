//! Which datagrams are new, which repeat others or come late, and from whom. At one time, one address is the controller.

use std::net::{IpAddr, SocketAddr};
use std::time::{Duration, Instant};

/// Time without a datagram after which a session is over, and another address can be the controller.
const SESSION_SILENCE: Duration = Duration::from_secs(1);
/// Numbers that a late datagram is behind the newest, at most. One that is further behind is implausible.
const MAX_BEHIND: i16 = 100;
/// Numbers that a datagram is ahead of the newest, at most. One that is further ahead is implausible.
const MAX_AHEAD: i16 = 2000;
/// How far the time that the controller states may be ahead of the one that its samples add up to [s].
const MAX_AHEAD_S: f64 = 0.05;

/// What a datagram is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Arrival {
    /// The first of a session.
    First,
    /// The next of its session, after some that are lost.
    Next {
        /// How many are lost.
        lost: u16,
    },
    /// It repeats the newest.
    Repeated,
    /// It was sent before the newest.
    Late,
    /// Its number fits neither before nor after the newest: it is very late, or the controller numbers anew.
    Implausible,
    /// It comes from another address than the controller's.
    Stranger,
}

/// Keeps the address of the controller, and the numbers and times of its datagrams.
#[derive(Debug, Default)]
pub(super) struct Intake {
    /// The only host that may be the controller.
    allowed: Option<IpAddr>,
    session: Option<Session>,
    /// Number of the newest sample over all sessions.
    pub(super) number: u64,
}

#[derive(Debug)]
struct Session {
    address: SocketAddr,
    heard: Instant,
    sequence: u16,
    /// Time of the newest sample [s].
    time: f64,
    /// Number of the last datagram, if it is implausible.
    implausible: Option<u16>,
}

/// What a datagram states of itself.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stated {
    pub(super) sequence: u16,
    /// Time of the controller [s].
    pub(super) time: f64,
    /// Time between two measurements [s].
    pub(super) sample_time: f64,
}

impl Intake {
    /// An intake of datagrams of one host, if it is given, or of the first host that sends.
    pub(super) fn new(allowed: Option<IpAddr>) -> Self {
        Self { allowed, ..Self::default() }
    }

    /// Returns the address of the controller.
    pub(super) fn controller(&self) -> Option<SocketAddr> {
        self.session.as_ref().map(|session| session.address)
    }

    /// Returns the time of the newest sample in the clock of the controller [ns].
    ///
    /// The `f32` of the controller has steps of 8 ms after a day. So the time is that of the first sample and a sample
    /// time for each number since, unless the controller is ahead of this.
    pub(super) fn time(&self) -> i64 {
        self.session.as_ref().map_or(0, |session| (session.time * 1e9).round() as i64)
    }

    /// Takes a datagram.
    pub(super) fn take(&mut self, from: SocketAddr, stated: Stated, now: Instant) -> Arrival {
        if self.allowed.is_some_and(|allowed| allowed != from.ip()) {
            return Arrival::Stranger;
        }
        let arrival = self.arrival(from, stated.sequence, now);
        match (arrival, &mut self.session) {
            (Arrival::Next { lost }, Some(session)) => {
                let steps = u64::from(lost) + 1;
                self.number += steps;
                let expected = session.time + steps as f64 * stated.sample_time;
                let is_ahead = stated.time > expected + MAX_AHEAD_S;
                let time = if is_ahead { stated.time } else { expected };
                *session = Session { heard: now, sequence: stated.sequence, time, address: from, implausible: None };
            }
            (Arrival::First, session) => {
                self.number += 1;
                let Stated { sequence, time, .. } = stated;
                *session = Some(Session { address: from, heard: now, sequence, time, implausible: None });
            }
            (Arrival::Repeated | Arrival::Late, Some(session)) => (session.heard, session.implausible) = (now, None),
            (Arrival::Implausible, Some(session)) => session.implausible = Some(stated.sequence),
            _ => {}
        }
        arrival
    }

    fn arrival(&self, from: SocketAddr, sequence: u16, now: Instant) -> Arrival {
        let Some(session) = self.session.as_ref().filter(|session| now - session.heard < SESSION_SILENCE) else {
            return Arrival::First;
        };
        if session.address != from {
            return Arrival::Stranger;
        }
        // Numbers start at 0 again after 65535.
        match sequence.wrapping_sub(session.sequence) as i16 {
            0 => Arrival::Repeated,
            ahead @ 1..=MAX_AHEAD => Arrival::Next { lost: ahead as u16 - 1 },
            behind if (-MAX_BEHIND..0).contains(&behind) => Arrival::Late,
            // One that is very late must not begin a session: two that follow each other do.
            _ => match session.implausible.map(|last| sequence.wrapping_sub(last) as i16) {
                Some(1..=MAX_BEHIND) => Arrival::First,
                _ => Arrival::Implausible,
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn address(host: u8, port: u16) -> SocketAddr {
        SocketAddr::from(([127, 0, 0, host], port))
    }

    fn stated(sequence: u16) -> Stated {
        Stated { sequence, time: 10.0, sample_time: 0.004 }
    }

    #[test]
    fn a_sample_counts_once_and_the_lost_ones_are_known() {
        use Arrival::{First, Implausible, Late, Next, Repeated};
        let (mut intake, mut now) = (Intake::default(), Instant::now());
        let cases = [
            (65533, First, 1),
            (65534, Next { lost: 0 }, 2),
            (65534, Repeated, 2),
            (0, Next { lost: 1 }, 4),
            (65535, Late, 4),
            (0, Repeated, 4),
            (6, Next { lost: 5 }, 10),
            (37, Next { lost: 30 }, 41),
            (36, Late, 41),
            // Very late ones do not begin a session.
            (65400, Implausible, 41),
            (38, Next { lost: 0 }, 42),
            (65401, Implausible, 42),
            (38, Repeated, 42),
            (65402, Implausible, 42),
            (65402, Implausible, 42),
            // The controller starts again.
            (50000, Implausible, 42),
            (50001, First, 43),
            (50002, Next { lost: 0 }, 44),
            (1, Implausible, 44),
            (3, First, 45),
            (4, Next { lost: 0 }, 46),
        ];
        for (sequence, arrival, number) in cases {
            now += Duration::from_millis(4);
            assert_eq!((intake.take(address(1, 9), stated(sequence), now), intake.number), (arrival, number));
        }
        // After a silence, any number begins a session.
        assert_eq!(intake.take(address(1, 9), stated(3), now + Duration::from_secs(1)), First);
    }

    #[test]
    fn a_second_controller_waits_until_the_first_is_silent() {
        let (mut intake, now) = (Intake::default(), Instant::now());
        let at = |ms| now + Duration::from_millis(ms);
        assert_eq!(intake.take(address(1, 9), stated(1), at(0)), Arrival::First);
        assert_eq!(intake.take(address(2, 9), stated(2), at(4)), Arrival::Stranger);
        assert_eq!(intake.take(address(1, 8), stated(2), at(8)), Arrival::Stranger);
        assert_eq!(intake.take(address(1, 9), stated(2), at(500)), Arrival::Next { lost: 0 });
        assert_eq!(intake.take(address(2, 9), stated(3), at(1400)), Arrival::Stranger);
        assert_eq!(intake.take(address(2, 9), stated(3), at(1500)), Arrival::First);
        assert_eq!((intake.controller(), intake.number), (Some(address(2, 9)), 3));
        intake.allowed = Some(IpAddr::from([127, 0, 0, 1]));
        assert_eq!(intake.take(address(2, 9), stated(4), at(1504)), Arrival::Stranger);
        assert_eq!(intake.take(address(1, 9), stated(4), at(9000)), Arrival::First);
    }

    #[test]
    fn the_time_is_finer_than_the_controllers_and_follows_its_pauses() {
        // After three days, the time of the controller has steps of 16 ms.
        let (mut intake, now, start) = (Intake::default(), Instant::now(), 262_144.0_f32);
        let mut time = |number: u16, pause: f32| {
            let time = f64::from(start + pause + 0.004 * f32::from(number));
            let stated = Stated { sequence: number, time, sample_time: 0.004 };
            intake.take(address(1, 9), stated, now + Duration::from_millis(4 * u64::from(number)));
            intake.time() - (f64::from(start) * 1e9) as i64
        };
        assert_eq!(time(0, 0.0), 0);
        for number in 1..200 {
            assert!((time(number, 0.0) - 4_000_000 * i64::from(number)).abs() < 100, "{number}");
        }
        assert!((time(200, 0.5) - 1_300_000_000).abs() < 20_000_000);
    }
}
