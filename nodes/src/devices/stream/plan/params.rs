//! The parameters of `stream`: the vocabulary in which a pad is described.

use tactflow_runtime::node::{FilePath, Map, Param};
use tactflow_runtime::signal::Unit;

use crate::arm::mount::Mount;
use crate::devices::pad;
use crate::devices::stream::decoding::cell::{Cell, Field};
use crate::devices::stream::decoding::clock::StampUnit;
use crate::devices::stream::decoding::decoder::Place;
use crate::devices::stream::decoding::order::Turn;
use crate::devices::stream::framing::check::ByteOrder;

/// How the beginning and the end of a frame are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
pub(crate) enum Framing {
    /// Each frame begins with the bytes of `mark`.
    Sync,
    /// Each frame ends with the bytes of `mark`.
    Trailer,
    /// Each frame is a line of text, or several lines up to one that begins with `mark`.
    Lines,
    /// Each frame is a COBS packet, which a byte 00 ends.
    Cobs,
    /// Each frame is a SLIP packet, which a byte C0 ends.
    Slip,
    /// Each frame is a datagram, or a message of a WebSocket.
    Datagram,
    /// Each frame is the reply to the bytes of `poll`.
    Reply,
}

/// Parameters of `stream`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Where the bytes come from: `serial:PATH`, `tcp:HOST:PORT`, `udp:PORT` to listen, `udp:HOST:PORT` to ask, or
    /// `ws:HOST:PORT/PATH`.
    pub(crate) link: String,
    /// Speed of a serial port, in bits per second.
    #[param(range = 50..=50_000_000)]
    pub(crate) baud: Option<usize>,
    /// The only address from which `udp:PORT` reads datagrams, such as `192.168.0.7`. Without it, the port reads the
    /// first sender whose datagrams are frames.
    pub(crate) from: Option<String>,
    /// What to send when the link opens: text, or bytes such as `hex:F0C4`.
    pub(crate) start: Option<String>,
    /// What to send at the end of a run.
    pub(crate) stop: Option<String>,
    /// What to send to ask for a frame, `rate_hz` times a second.
    pub(crate) poll: Option<String>,
    /// How the beginning and the end of a frame are found.
    pub(crate) frame: Framing,
    /// The bytes that begin or end a frame, such as `hex:AA55`; with `lines`, the beginning of the line that ends a frame.
    pub(crate) mark: Option<String>,
    /// Offset of the mark in the frame, in bytes: 0 with `sync` and `reply`, and at the end with `trailer`.
    pub(crate) mark_at: Option<usize>,
    /// Number of bytes of a frame, with its mark and its checksum; of a text, its number of values. It follows from the
    /// other parameters.
    pub(crate) length: Option<usize>,
    /// Checksum at the end of a frame: `none`, `xor8`, `sum8`, `sum16le`, `sum16be`, or the name of a CRC, such as
    /// `crc-16/modbus`.
    #[param(default = "none")]
    pub(crate) check: String,
    /// The first byte that the checksum covers. It covers all bytes up to itself.
    #[param(default = 0)]
    pub(crate) check_from: usize,
    /// Order of the bytes of a CRC. Without it, a CRC that takes the low bit first has the low byte first.
    pub(crate) check_order: Option<ByteOrder>,
    /// Type of a value.
    pub(crate) cell: Cell,
    /// The bits that belong to the value, such as 4095 for the low 12.
    pub(crate) mask: Option<u64>,
    /// By how many bits the value is shifted to the right, after the mask.
    #[param(range = 0..=31, default = 0)]
    pub(crate) shift: usize,
    /// Offset of the first value, in bytes; in a text, the number of values before it. Behind the mark without it.
    pub(crate) offset: Option<usize>,
    /// Step from a value to the next one, in bytes; in a text, in values. The size of a value without it.
    pub(crate) stride: Option<usize>,
    /// Numbers of rows and columns in the order of the bytes, `[rows, cols]`, or `[rows, cols, axes]`.
    pub(crate) shape: Vec<usize>,
    /// Names of the axes, if a tactel has several values, such as `["temperature", "x", "y", "z"]`.
    #[param(default = Vec::new())]
    pub(crate) axes: Vec<String>,
    /// The axis that becomes the image.
    pub(crate) axis: Option<String>,
    /// Of a pad with three axes: the axes of the drag along the image's x and y, after `order`. A minus sign turns one
    /// around: `["x", "-y"]`. The pad then has a vector image too, with `axis` as its z. `scale` applies to z, and its
    /// `gain` alone to x and y.
    pub(crate) tangential: Option<Vec<String>>,
    /// The least and the greatest value of an axis, as it is in the frame; of a pad without axes, of `value`. A frame
    /// with another value is no frame.
    #[param(unit = "raw", default = Map(std::collections::BTreeMap::new()))]
    pub(crate) plausible: Map<[f64; 2]>,
    /// Turns of the image, one after the other.
    #[param(default = Vec::new())]
    pub(crate) order: Vec<Turn>,
    /// For each cell of the image, row after row, the number of its value in the frame, from 0. `order` turns the result.
    pub(crate) lut: Option<Vec<usize>>,
    /// From the values in the frame to `unit`.
    #[param(default = Scale::default())]
    pub(crate) scale: Scale,
    /// Unit of the image.
    #[param(default = Unit::RAW)]
    pub(crate) unit: Unit,
    /// How a frame is put together, if it comes in parts.
    pub(crate) parts: Option<PartParams>,
    /// The clock of the pad. Without it, the time of arrival counts.
    #[param(default = ClockParams::default())]
    pub(crate) clock: ClockParams,
    /// Whether a frame with the same bytes as the last one is new data: set it for a pad without noise, whose frames are
    /// equal while nothing touches it. A pad that hangs and repeats its last frame is not noticed then.
    #[param(default = false)]
    pub(crate) repeats_are_new: bool,
    /// Images per second, also if an image comes in parts. With `poll`, the pad is asked this often.
    #[param(unit = "1/s", range = 0.001..=1e5)]
    pub(crate) rate_hz: f64,
    /// Time without a frame after which the pad is lost: five periods, and at least 100 ms.
    #[param(unit = "ms", above = 0.0)]
    pub(crate) timeout_ms: Option<f64>,
    /// Time from the measurement of a frame to its arrival.
    #[param(unit = "ms", range = 0.0..=1e3, default = 0.0)]
    pub(crate) latency_ms: f64,
    /// Distance between the centres of neighbouring tactels, along x and along y.
    #[param(unit = "m", above = 0.0)]
    pub(crate) pitch: f64,
    /// Noise threshold that the pad states as a fact; in N with a `calibration`.
    #[param(unit = "$unit", range = 0.0..)]
    pub(crate) threshold: Option<f64>,
    /// Number of frames of the self-test at the start, stated as a fact; 0 for none.
    #[param(default = pad::REST_FRAMES)]
    pub(crate) rest_frames: usize,
    /// Largest difference of a zero from the calibrated one, stated as a fact. Without it, the self-test does not compare
    /// the zeros.
    #[param(unit = "$unit", above = 0.0)]
    pub(crate) tare_bound: Option<f64>,
    /// Unit of pressure that the pad states as a fact, per tactel: p = 1 in the paper; in N with a `calibration`.
    #[param(unit = "$unit", above = 0.0)]
    pub(crate) pressure: Option<f64>,
    /// A calibration file from `tactflow calibrate`, stated as a fact. It converts the image to forces.
    pub(crate) calibration: Option<FilePath>,
    /// Pose of the pad on the tip of its arm, stated as a fact.
    pub(crate) mount: Option<Mount>,
}

/// From a value of the frame to a value of the image: `gain * value + offset`, or `gain * (invert_full - value) + offset`.
#[derive(Debug, Clone, Copy, PartialEq, Param)]
#[param(default)]
pub(crate) struct Scale {
    /// The reading of an unloaded tactel, if readings fall with the load.
    #[param(unit = "raw")]
    pub(crate) invert_full: Option<f64>,
    /// Slope, in `unit` per reading.
    #[param(unit = "1", default = 1.0)]
    pub(crate) gain: f64,
    /// Value of the image at the reading 0, or at `invert_full`, in `unit`.
    #[param(unit = "1", default = 0.0)]
    pub(crate) offset: f64,
}

/// How a frame is put together from parts, which come one after the other.
#[derive(Debug, Clone, PartialEq, Eq, Param)]
pub(crate) struct PartParams {
    /// The number of a part.
    pub(crate) index: Option<Place>,
    /// Number of the first part.
    #[param(default = 0)]
    pub(crate) first: usize,
    /// The index of the first value of a part, in place of the number of the part.
    pub(crate) start: Option<Place>,
    /// Number of values in a part.
    #[param(range = 1..=1_000_000)]
    pub(crate) values: usize,
    /// Number of bytes of each part, from the first one, if they differ.
    pub(crate) lengths: Option<Vec<usize>>,
    /// Number of the part that completes a frame; the last one without it.
    pub(crate) completes: Option<usize>,
}

/// The clock of a pad.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
#[param(default)]
pub(crate) struct ClockParams {
    /// The time of the measurement, in the clock of the pad.
    pub(crate) stamp: Option<StampParams>,
    /// The number of the frame, or of the part.
    pub(crate) counter: Option<Place>,
}

/// Where the stamp of a frame stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
pub(crate) struct StampParams {
    /// Offset from the first byte of the frame; in a text, the number of values before it.
    pub(crate) offset: usize,
    /// Type of the stamp.
    pub(crate) cell: Field,
    /// Unit of the stamp.
    pub(crate) unit: StampUnit,
}
