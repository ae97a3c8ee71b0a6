//! Recordings of whole runs as MCAP files: everything that a replay needs, and every port for other tools.
//!
//! A file contains, in this order:
//!
//! - metadata `tactflow`: the version, the graph, the seed, and a hash of everything that determines the run
//! - attachments: `tactflow/run.toml` (the options of the run), `tactflow/devices.toml` (the description of each device),
//!   and every file that the graph has read, under the path with which it was read
//! - the channels and their schemas
//! - for each tick, a message on `/tactflow/inputs` with its inputs in a binary encoding, then messages with all ports
//!   that have changed. The sequence number of a message is the number of its tick, its log time is the time of the tick,
//!   and its publish time is that of the sample from which the value was computed
//! - metadata `tactflow.end`: why the run ended, and whether the inputs are complete
//!
//! The engine logs the inputs and documents their encoding (`engine/session/inputs.rs`). The messages of the ports are
//! JSON: `foxglove.Grid` for images and masks, `foxglove.PoseInFrame` for poses, and plain objects for the rest. Times are
//! those of the graph in virtual time, and those of the wall clock in real time.
//!
//! A chunk is closed every half second. Nothing that is written changes later, so a file that was cut anywhere can be
//! read up to the cut.

mod about;
mod channels;
mod compare;
mod device;
mod diff;
mod export;
mod json;
mod pad;
mod reader;
mod recorder;
mod recover;
mod replay;
mod ring;
mod schema;
mod snapshot;
mod table;
mod writer;

pub use about::RunAbout;
pub(crate) use about::about_run;
pub use compare::{Differences, PortDifference};
pub use device::{PlayError, play_device};
pub use diff::{RecordingDiff, diff};
pub use export::{Exported, export};
pub use pad::{PadError, RecordedPad};
pub use reader::{RecordedChannel, RecordedTick, Recording};
pub use recorder::{RecordRequest, RunRecorded, RunRecorder};
pub use recover::{Recovered, recover};
pub use replay::{Replay, ReplayChanges, ReplayError, ReplayedTick, is_own_channel};
#[cfg(feature = "cli")]
pub(crate) use table::rows;
