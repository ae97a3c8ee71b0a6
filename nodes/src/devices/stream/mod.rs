//! `stream`: a tactile pad that is described in TOML.
//!
//! `link` receives bytes, `framing` finds the frames in them, `decoding` reads the cells, and `driver`
//! publishes the images. `plan` checks the description. Only `driver` and `link` do I/O.

mod decoding;
mod driver;
mod framing;
mod listen;
mod plan;
mod reader;

use tactflow_runtime::device::{Description, Device, Driver, Opened};
use tactflow_runtime::node::{Describe, Mistakes};
use tactflow_runtime::signal::ImageShape;

use super::{Facts, pad};
#[cfg(feature = "cli")]
pub(crate) use decoding::order::{Grid, Turn};
use driver::PadDriver;
#[cfg(feature = "cli")]
pub(crate) use framing::check::{has_checksum, names as checksums, size_of as checksum_size};
pub(crate) use listen::listen;
use plan::Plan;
pub use plan::params::Params;
#[cfg(feature = "cli")]
pub(crate) use plan::text::bytes_of;

/// A tactile pad that is described in TOML: its link, its frames and its cells.
///
/// The description of a pad stands in a file of its own, with the section `[sensor]`, and holds wherever the pad is
/// used. The bench names it with `sensor`, and adds the `link`. Keys of the bench replace those of the file.
/// `tactflow pads` lists the descriptions that ship, and `docs/pads.md` describes a new pad step by step.
///
/// **Frames.** A frame is delivered if it is the third in a row that has its `mark` where `length` says, and from then
/// on each frame as soon as it is complete. A frame whose `check` does not hold is never delivered. A CRC of 16 bits or
/// more is a proof, so such a frame need not be the third in a row; a shorter checksum holds by chance too often. Lines,
/// packets and datagrams have borders that do not occur in the data, so the first good one is delivered. After a
/// frame that is not where it should be, the next one is looked for one byte behind its beginning. If the data has the
/// mark at the same place in every frame, only a pause between the frames can say where they begin; without a pause,
/// nothing is delivered. A value that is not finite, or not `plausible`, spoils its frame.
///
/// **Text.** With `cell = "dec"` or `"hex"`, a frame is numbers with commas, semicolons or white space between them.
/// `offset`, `stride` and `length` count values.
///
/// **Three axes.** With `tangential`, a pad whose tactels have several values fills the role `three_axis_pad`: it has a
/// vector image beside the image. The bench states how forces come from it: `facts.pad.vector_gain = [0.001, 0.001, 0.002]`
/// in N per reading, and `facts.pad.friction`.
///
/// **Silence.** A pad that sends no frame for `timeout_ms` is lost. The device sends `start` again, and opens the link
/// again, until a frame comes or the run ends. A board may need 3 s for its first frame.
///
/// The device counts `frames`, `rejected frames`, `resyncs`, `skipped bytes`, `repeated frames`, `lost frames` (gaps of
/// the counter), `late frames` (older than the last one), `foreign datagrams` and `reconnects`. It states the facts
/// `dead` (no tactel is), `calibration`, `rest_frames`, and if they are given `threshold`, `pressure`, `tare_bound` and `mount`. The zero of the pad
/// is that of `calibrate`: set `tare_at_start` there.
///
/// ```toml
/// [roles]
/// pad = "tactile_pad"
///
/// [bind]
/// pad = "skin"
///
/// [devices.skin]
/// type = "stream"
/// sensor = "builtin:pads/flexitac_16x32.toml"
/// link = "serial:/dev/serial/by-id/usb-1a86_USB_Serial-if00-port0"
/// ```
#[derive(Debug, Describe)]
pub struct Stream;

impl Device for Stream {
    type Params = Params;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let plan = Plan::new(&params)?;
        let [rows, cols] = plan.size;
        let shape = ImageShape { rows, cols, pitch: [params.pitch; 2], unit: params.unit };
        let mut description = Description::every(1.0 / params.rate_hz);
        description.latency = params.latency_ms * 1e-3;
        let facts = facts(&params)?;
        let (image, vectors) = if plan.vectors.is_some() {
            let (image, vectors) = pad::fill_three_axes(description.fills(pad::THREE_AXES), shape, facts);
            (image, Some(vectors))
        } else {
            (pad::fill(description.fills(pad::ROLE), shape, facts), None)
        };
        let driver = PadDriver::new(image, vectors, plan);
        Ok(Opened { description, driver: Driver::Live(Box::new(driver)) })
    }
}

fn facts(params: &Params) -> Result<Facts, Mistakes> {
    let facts = pad::PadFacts {
        unit: params.unit,
        threshold: params.threshold,
        pressure: params.pressure,
        calibration: params.calibration.as_ref(),
        mount: params.mount.as_ref(),
        rest_frames: params.rest_frames,
        tare_bound: params.tare_bound,
    };
    facts.facts()
}

#[cfg(test)]
mod tests;
