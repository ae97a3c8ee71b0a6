//! From the parameters to a plan of the stream, or to all mistakes in them, each on its key and with a way out.

mod bounds;
mod frame;
mod order;
pub(crate) mod params;
mod parts;
mod sending;
pub(crate) mod text;

use std::net::IpAddr;
use std::time::Duration;

use tactflow_runtime::node::{Mistake, Mistakes};

use crate::devices::link::Address;
use crate::devices::stream::decoding::clock::{Counter, Stamps};
use crate::devices::stream::decoding::decoder::{Decoder, Image, Place};
use crate::devices::stream::decoding::order::Grid;
use crate::devices::stream::decoding::parts::Parts;
use crate::devices::stream::framing::Framer;
use params::Params;

/// Everything that a driver needs to know of a pad.
#[derive(Clone)]
pub(crate) struct Plan {
    pub(crate) address: Address,
    pub(crate) baud: u32,
    pub(crate) from: Option<IpAddr>,
    pub(crate) start: Vec<u8>,
    pub(crate) stop: Vec<u8>,
    /// What asks for a frame, and how often.
    pub(crate) poll: Option<Vec<u8>>,
    pub(crate) period: Duration,
    /// Time without a frame after which the pad is lost.
    pub(crate) timeout: Duration,
    pub(crate) framer: Framer,
    pub(crate) decoder: Decoder,
    pub(crate) parts: Option<Parts>,
    pub(crate) image: Image,
    /// Of a pad with three axes: its x, y and z.
    pub(crate) vectors: Option<[Image; 3]>,
    /// Number of values of an image, with those of all axes.
    pub(crate) values: usize,
    pub(crate) stamps: Option<Stamps>,
    pub(crate) counter: Option<Counter>,
    pub(crate) repeats_are_new: bool,
    /// Whether a frame has a checksum.
    pub(crate) has_check: bool,
    /// Rows and columns of the image.
    pub(crate) size: [usize; 2],
}

/// Time without a frame after which a pad is lost, at least.
const MIN_TIMEOUT: Duration = Duration::from_millis(100);
/// Number of periods without a frame after which a pad is lost.
const TIMEOUT_PERIODS: f64 = 5.0;

impl Plan {
    /// Checks the parameters.
    ///
    /// # Errors
    /// All mistakes.
    pub(crate) fn new(params: &Params) -> Result<Self, Mistakes> {
        let mut mistakes = Mistakes::new();
        let link = sending::link(params, &mut mistakes);
        let sent = sending::sent(params, link.as_ref().map(|link| &link.address), &mut mistakes);
        let shape = order::shape(params, &mut mistakes);
        let made = shape.and_then(|shape| {
            let parts = parts::parts(params, &shape, &mut mistakes);
            let frame =
                frame::frame(params, &shape, parts.as_ref(), link.as_ref().map(|link| &link.address), &mut mistakes);
            let image = order::image(params, &shape, &mut mistakes);
            Some((shape, parts, frame?, image?))
        });
        let (Some(link), Some(sent), Some((shape, parts, frame, (Grid { rows, cols, places }, scale)))) =
            (link, sent, made)
        else {
            return Err(mistakes);
        };
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        let along = |axis: usize, gain: f64, offset: f64| Image {
            places: places.iter().map(|cell| cell * shape.axes + axis).collect(),
            gain,
            offset,
        };
        let image = along(shape.axis, scale.0, scale.1);
        let gain = params.scale.gain;
        let vectors = shape
            .tangential
            .map(|[(x, turn), (y, other)]| [along(x, turn * gain, 0.0), along(y, other * gain, 0.0), image.clone()]);
        let period = Duration::from_secs_f64(1.0 / params.rate_hz);
        let timeout = params.timeout_ms.map(|ms| Duration::from_secs_f64((ms * 1e-3).min(1e6)));
        let stamp =
            params.clock.stamp.map(|stamp| Stamps::new(Place { offset: stamp.offset, cell: stamp.cell }, stamp.unit));
        Ok(Self {
            address: link.address,
            baud: link.baud,
            from: link.from,
            start: sent.start,
            stop: sent.stop,
            poll: sent.poll,
            period,
            timeout: timeout.unwrap_or_else(|| period.mul_f64(TIMEOUT_PERIODS).max(MIN_TIMEOUT)),
            framer: frame.framer,
            decoder: frame.decoder,
            parts,
            values: shape.values(),
            image,
            vectors,
            stamps: stamp,
            counter: params.clock.counter.map(Counter::new),
            repeats_are_new: params.repeats_are_new,
            has_check: params.check != "none",
            size: [rows, cols],
        })
    }
}

/// Refuses a key that says nothing with the other ones.
fn useless(key: &str, why: &str, help: &str) -> Mistake {
    Mistake::key(key, format!("`{key}` has no meaning {why}")).help(help)
}
