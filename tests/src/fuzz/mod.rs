//! Spoilt inputs for everything that the project reads: files of every format, and the bytes of every wire.
//!
//! A [`Target`] is one parser with good inputs. A [`Campaign`] spoils them by a seed, and lets the parser read each
//! result. An input fails if the parser panics, breaks a promise, takes more than a second, or takes more memory than
//! its target allows. The program `fuzz` runs a million inputs of each target, and the suite a few.
//!
//! A new format is one more entry in [`TARGETS`].

mod campaign;
mod files;
mod mutate;
mod recordings;
mod runs;
mod wires;

pub use campaign::{Campaign, Failure, Measure, Tally};
pub use recordings::reason;

/// A parser, and what it may take.
pub struct Target {
    /// Name on the command line.
    pub name: &'static str,
    /// What it reads.
    pub title: &'static str,
    /// Prepares the good inputs and the parser.
    pub open: fn() -> Subject,
}

/// Reads an input. Returns whether the input is accepted, and panics if the parser breaks a promise.
pub type Parser = Box<dyn Fn(&[u8]) -> bool>;

/// The good inputs of a target, and its parser.
pub struct Subject {
    /// Good inputs, at least one.
    pub corpus: Vec<Vec<u8>>,
    /// Reads an input.
    pub read: Parser,
    /// Returns how much memory may be in use at once while an input is read [bytes].
    pub max_memory: fn(&[u8]) -> u64,
}

/// Every target.
pub const TARGETS: &[Target] = &[
    Target { name: "tekscan", title: "recordings of Tekscan", open: || recordings::plain("tekscan") },
    Target { name: "novel_lst", title: "listings of novel", open: || recordings::plain("novel-lst") },
    Target { name: "novel_asc", title: "texts of novel", open: || recordings::plain("novel-asc") },
    Target { name: "zebris", title: "recordings of zebris", open: || recordings::plain("zebris") },
    Target { name: "xsensor", title: "recordings of XSENSOR", open: || recordings::plain("xsensor") },
    Target { name: "footscan", title: "recordings of footscan", open: || recordings::plain("footscan") },
    Target { name: "csv", title: "recordings as plain CSV", open: || recordings::plain("csv") },
    Target { name: "npy", title: "recordings as an array of numpy", open: || recordings::plain("npy") },
    Target { name: "npz", title: "recordings as arrays of numpy", open: || recordings::plain("npz") },
    Target { name: "archive", title: "recordings in a zip or gzip", open: recordings::archives },
    Target { name: "lockstep", title: "lines of a simulator, and the answers", open: wires::lockstep },
    Target { name: "stream", title: "bytes of a pad, in every framing", open: wires::stream },
    Target { name: "agni", title: "messages of the AGNI protocol", open: wires::agni },
    Target { name: "lwr_fri", title: "datagrams of FRI 1.0", open: wires::lwr_fri },
    Target { name: "ur", title: "packets of RTDE", open: wires::ur },
    Target { name: "graph", title: "tasks", open: files::graphs },
    Target { name: "part", title: "parts of tasks", open: files::parts },
    Target { name: "bench", title: "benches", open: files::benches },
    Target { name: "robot", title: "robots", open: files::robots },
    Target { name: "pad", title: "descriptions of pads", open: files::pads },
    Target { name: "scenario", title: "scenarios", open: files::scenarios },
    Target { name: "urdf", title: "models of robots", open: files::models },
    Target { name: "calibration", title: "calibrations of pads", open: files::calibrations },
    Target { name: "set", title: "assignments of the command line", open: files::assignments },
    Target { name: "mcap", title: "recordings of whole runs", open: runs::recordings },
    Target { name: "words", title: "words of an operator", open: files::words },
];

/// Returns the target with a name.
#[must_use]
pub fn target(name: &str) -> Option<&'static Target> {
    TARGETS.iter().find(|target| target.name == name)
}
