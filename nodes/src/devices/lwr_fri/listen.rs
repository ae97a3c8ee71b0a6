//! What the driver understands of the datagrams of a controller, and what it answers, without a socket.

use std::net::{Ipv4Addr, SocketAddr};
use std::time::Instant;

use super::intake::{Arrival, Intake, Stated};
use super::wire::{Answer, Impedance, Report};

/// Reads datagrams, and mirrors the posture of each that is new.
pub(crate) fn listen(datagrams: &[&[u8]]) -> Vec<String> {
    let (mut intake, now) = (Intake::new(None), Instant::now());
    let controller = SocketAddr::from((Ipv4Addr::LOCALHOST, 49_938));
    let hear = |datagram: &&[u8]| {
        let Some(report) = Report::decode(datagram) else { return "no measurement".to_owned() };
        let Report { sequence, time, sample_time, krl, commanded, .. } = &report;
        let stated = Stated { sequence: *sequence, time: *time, sample_time: *sample_time };
        let arrival = intake.take(controller, stated, now);
        if !matches!(arrival, Arrival::First | Arrival::Next { .. }) {
            return format!("{arrival:?}");
        }
        let impedance = Impedance::default();
        let answer = Answer { sequence: 1, reflected: *sequence, krl, position: commanded, impedance }.encode(true);
        format!("{arrival:?} {} {} {report:?} {answer:?}", intake.time(), intake.number)
    };
    datagrams.iter().map(hear).collect()
}
