//! `replay`: a device of a recorded run, so that any graph runs on yesterday's arm, pads and force sensors.
//!
//! The recording is read whole when the device is opened, so a mistake in it shows before anything runs. What it has
//! sampled in a tick of the recorded run comes at the time of that tick, with the stamps that it had.

use tactflow_runtime::device::{Device, Opened};
use tactflow_runtime::node::{At, Describe, FilePath, Mistake, Mistakes, Param};
use tactflow_runtime::recording::{PlayError, play_device};
use tactflow_runtime::source::Code;

/// Parameters of `replay`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// The recording.
    file: FilePath,
    /// A role of the recorded graph, whose device is played; only if the recording has several devices.
    role: Option<String>,
}

/// Plays a device of a recorded run (`run --record`): an arm, a pad, a force sensor, or all of them in one.
///
/// The device fills the roles that the recorded one could fill, with the same sides, joints, units and facts, and any
/// graph may use it. A bench that was recorded with several devices has a block of this type for each:
///
/// ```text
/// [devices.skin]
/// type = "replay"
/// file = "run.mcap"
/// role = "pad"                # the device that filled the role `pad`
/// ```
///
/// The arm reports the joints that it had. It takes commands and follows none: the loop is open, and a run says so at
/// its start. A sample comes in the tick in which it came to the recorded run, and keeps its stamp; so in virtual time
/// the recorded graph computes the same values again, to the last bit. What has lost or failed then, does so again.
/// Words of the operator, changed parameters, lost leases and ticks without a sample, as on a busy machine, belong to the
/// run and not to the device, so they are not repeated; `tactflow replay` repeats everything.
///
/// A run ends with the recording. A recording that was cut is played up to the cut. One that has lost inputs is refused.
///
/// ```toml
/// [roles]
/// pad = "tactile_pad"
/// arm = "velocity_arm"
///
/// [commands]
/// arm.velocity = "joint_limit.velocity"
///
/// [bind]
/// pad = "yesterday"
/// arm = "yesterday"
///
/// [devices.yesterday]
/// type = "replay"
/// file = "run.mcap"                 # your recording: `tactflow run GRAPH --record run.mcap`
/// ```
#[derive(Describe)]
#[describe(name = "replay")]
pub struct Replay;

impl Device for Replay {
    type Params = Params;

    const IS_RECORDED: bool = true;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let Params { file, role } = params;
        play_device(&file.path, file.builtin.as_deref(), role.as_deref()).map_err(|error| {
            let (message, help) = error.describe();
            let mistake = match &error {
                PlayError::Unknown(..) => Mistake::param("role", message),
                PlayError::Broken(_) | PlayError::Unnamed(_) => {
                    Mistake::new(Code::BadData, At::Span(file.span.clone()), message)
                }
            };
            help.into_iter().fold(mistake, Mistake::help).into()
        })
    }
}
