//! The live driver: it connects, publishes frames, and connects again when the device is gone.

use std::convert::Infallible;
use std::time::Duration;

use async_trait::async_trait;
use tactflow_runtime::device::{DeviceError, Link, Live, Output};
use tactflow_runtime::signal::Image;
use tokio::time::Instant;

use super::layout::Channels;
use super::messages::{Frame, Message};
use super::port::BAUD;
use super::sensors::{Pad, assign};
use super::session::{Identity, Session};
use crate::devices::link::{Address, Backoff, Connection, Counts};

/// The driver of a device.
pub(super) struct Agni {
    address: Address,
    pub(super) pads: Vec<PadPort>,
    /// Time between two frames that the sensors are asked for [0.1 ms].
    pub(super) period: Option<u16>,
    /// Unit of the stamps [ns]; without it, a frame is as old as its arrival.
    pub(super) stamp_unit: Option<f64>,
    /// Time without a frame after which a pad is lost.
    pub(super) silence: Duration,
    /// Serial number of the device, if it has said one.
    serial: Option<String>,
    session: Option<Session>,
}

/// A pad of the bench, and where its frames go.
pub(super) struct PadPort {
    pub(super) pad: Pad,
    pub(super) image: Output<Image>,
    /// The newest frame. It is kept here, so that a frame costs no allocation.
    cells: Vec<f32>,
    channels: Channels,
    frames: u64,
    /// Number of frames since `heard` that are none of its layout.
    bad: u64,
    heard: Instant,
    clock: StampClock,
}

impl PadPort {
    pub(super) fn new(pad: Pad, image: Output<Image>) -> Self {
        let cells = vec![0.0; pad.layout.rows * pad.layout.cols];
        let (channels, clock) = (Channels::default(), StampClock::default());
        Self { pad, image, cells, channels, frames: 0, bad: 0, heard: Instant::now(), clock }
    }
}

/// The time of a device: its stamps, unwrapped.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct StampClock {
    last: Option<u32>,
    ticks: i64,
}

impl StampClock {
    /// Returns the time of a stamp, in its unit from the first one on. A step back is one, and no turn of the counter.
    pub(super) fn ticks(&mut self, stamp: u32) -> i64 {
        let step = stamp.wrapping_sub(self.last.unwrap_or(stamp)) as i32;
        self.last = Some(stamp);
        self.ticks += i64::from(step);
        self.ticks
    }
}

/// Why a session ends.
enum Ended {
    /// The port is gone or the device is silent: try again.
    Lost(String),
    /// The device is another one than the bench says.
    Wrong(String),
}

impl From<String> for Ended {
    fn from(why: String) -> Self {
        Self::Lost(why)
    }
}

#[async_trait]
impl Live for Agni {
    async fn run(mut self: Box<Self>, mut link: Link) -> Result<(), DeviceError> {
        let mut backoff = Backoff::new();
        loop {
            let (stopped, published) = (link.stopped(), self.frames());
            let ended = tokio::select! {
                ended = self.follow(&mut link) => ended,
                () = stopped => break,
            };
            self.report(&mut link);
            self.session = None;
            let (Ended::Lost(why) | Ended::Wrong(why)) = &ended;
            let why = format!("{}: {why}", self.name());
            self.pads.iter().for_each(|pad| link.lost(pad.image, why.clone()));
            if let Ended::Wrong(_) = ended {
                // Another driver would not know the serial number of the device that was there.
                link.forbid_return();
                return Err(DeviceError(why));
            }
            link.count("reconnects");
            if self.frames() > published {
                backoff.reset();
            }
            if !backoff.pause(&link).await {
                break;
            }
        }
        if let Some(session) = &mut self.session {
            session.stop().await;
        }
        self.report(&mut link);
        Ok(())
    }
}

impl Agni {
    /// A driver that is not connected yet.
    pub(super) fn new(address: Address, pads: Vec<PadPort>) -> Self {
        Self { address, pads, period: None, stamp_unit: None, silence: Duration::ZERO, serial: None, session: None }
    }

    /// Returns the name of the device for messages: its port, and its serial number if it is known.
    fn name(&self) -> String {
        match &self.serial {
            Some(serial) => format!("{} (serial number {serial})", self.address),
            None => self.address.to_string(),
        }
    }

    fn frames(&self) -> u64 {
        self.pads.iter().map(|pad| pad.frames).sum()
    }

    /// Connects, and publishes frames until the device is gone.
    async fn follow(&mut self, link: &mut Link) -> Ended {
        let Err(ended) = self.session(link).await;
        ended
    }

    async fn session(&mut self, link: &mut Link) -> Result<Infallible, Ended> {
        let port = Connection::open(&self.address, BAUD, None).await?;
        let session = self.session.insert(Session::new(port));
        let Identity { config, serial } = session.greet().await?;
        if let (Some(known), Some(new)) = (&self.serial, &serial)
            && known != new
        {
            // Its calibration and its self-test are those of the device that was there.
            return Err(Ended::Wrong(format!("another device has come back, with the serial number {new}")));
        }
        self.serial = serial.or(self.serial.take());
        let pads: Vec<Pad> = self.pads.iter().map(|port| port.pad.clone()).collect();
        let served = assign(&pads, &config).map_err(Ended::Wrong)?;
        let used = served.iter().enumerate().filter(|(_, pad)| pad.is_some()).map(|(at, _)| at as u8 + 1);
        session.start(used, self.period).await?;
        let now = Instant::now();
        for pad in &mut self.pads {
            (pad.heard, pad.bad, pad.clock) = (now, 0, StampClock::default());
        }
        loop {
            self.publish(link, &served);
            self.report(link);
            let quiet = self.pads.iter().map(|pad| pad.heard).min().unwrap_or(now) + self.silence;
            if Instant::now() >= quiet {
                return Err(Ended::Lost(self.silent()));
            }
            if let Some(session) = &mut self.session {
                session.receive(quiet).await?;
            }
        }
    }

    /// Publishes the frames that have arrived.
    fn publish(&mut self, link: &mut Link, served: &[Option<usize>]) {
        let (pads, unit) = (&mut self.pads, self.stamp_unit);
        let Some(session) = &mut self.session else { return };
        while let Some(message) = session.messages.next() {
            match message {
                Message::Frame(Frame { sensor, stamp, payload }) => {
                    let Some(at) = served.get(usize::from(sensor) - 1).copied().flatten() else { continue };
                    let pad = &mut pads[at];
                    if !pad.pad.layout.read(payload, &mut pad.channels, &mut pad.cells) {
                        pad.bad += 1;
                        link.count("bad frames");
                        continue;
                    }
                    let ticks = pad.clock.ticks(stamp);
                    let stamp = match unit {
                        Some(unit) => link.stamp_of((ticks as f64 * unit).round() as i64),
                        None => link.arrival(),
                    };
                    (pad.frames, pad.bad, pad.heard) = (pad.frames + 1, 0, Instant::now());
                    let (image, number, cells) = (pad.image, pad.frames, &pad.cells);
                    link.publish(|samples| {
                        samples.count("frames");
                        samples.write(image, stamp, number).cells_mut().copy_from_slice(cells);
                    });
                }
                Message::Fault(fault) => {
                    link.count("errors of the device");
                    session.fault = Some(fault);
                }
                Message::Config(_) | Message::Serial(_) | Message::Other => {}
            }
        }
    }

    /// Adds what the session has counted to the summary of the run.
    fn report(&mut self, link: &mut Link) {
        let Some(session) = &mut self.session else { return };
        let Counts { rejected, resyncs, skipped } = std::mem::take(&mut session.messages.counts);
        link.count_each(&[("rejected frames", rejected), ("resyncs", resyncs), ("skipped bytes", skipped)]);
    }

    /// Returns the message about a device that has sent no frame for a while.
    fn silent(&mut self) -> String {
        let fault = self.session.as_mut().and_then(|session| session.fault.take());
        let fault = fault.map_or_else(String::new, |fault| format!("; the device reports {fault}"));
        let oldest = self.pads.iter().min_by_key(|pad| pad.heard);
        let of =
            oldest.and_then(|pad| pad.pad.side.as_deref()).map_or_else(String::new, |side| format!(" of `{side}`"));
        let bad = match oldest.map_or(0, |pad| pad.bad) {
            0 => String::new(),
            count => format!("; {count} frames do not fit its layout, or have other channels than the frames before"),
        };
        format!("no frame{of} for {:?}{bad}{fault}", self.silence)
    }
}
