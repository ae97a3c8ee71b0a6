//! `tactflow teach`: a person guides the arm by hand, and the postures become the numbers of a bench: home, start, the
//! workspace and keep-out planes. Nothing is sent to the arm.

mod dialogue;
mod plane;
mod site;
mod workspace;

use std::path::PathBuf;

use tactflow_runtime::cli::Shell;
use tactflow_runtime::cli::clap::{self, Parser, ValueEnum};

use super::guided::{GuidedCell, Left, TomlFile};
use dialogue::Dialogue;
use site::Site;

/// Teach home, start, workspace and keep-out planes of a bench by guiding the arm by hand
#[derive(Parser)]
#[command(name = "teach")]
#[command(
    after_help = "Nothing is sent to the arm. Guide it by hand: a KUKA LWR in gravity compensation, a Universal Robots arm in
freedrive. Each question names the step:

  Enter    measures the posture; hold the arm still for half a second
  s        skips the step
  done     ends a list of points

- home       the posture that the arm prefers: `home` of its device
- start      the posture from which runs begin: `start` of its device
- workspace  two points or more; the box around them: `workspace_min_m` and `workspace_max_m` of [limits]
- keep-out   three points or more on each table, wall or fixture: rows of `keep_out` of [limits]. The side on which
             home is, or else the start, is free, if it was taught or the bench states it; otherwise one more posture
             shows the free side

A point is the origin of the pad, through its `mount`; without a pad it is the tip of the arm. At the end, the lines are
printed and written into the bench after a typed `yes`. Comments in the bench stay. Lines with which the bench does not
load are not written.

With two pads on one arm, the workspace and the planes bound the origin of the first pad of the task, not that of the
second one: touch with the first pad.

Examples:
  tactflow teach cell.toml
  tactflow teach cell.toml --only workspace,keep-out --clearance 10
  tactflow teach two_arms.toml --arm left_arm --sensor left_pad

Exit codes: 0 written, or nothing to write; 1 a device failed or the file cannot be written; 2 the bench does not load,
or has no arm that can be guided; 130 interrupted."
)]
pub(super) struct TeachArgs {
    /// Bench file; it is changed in place
    bench: PathBuf,
    /// Steps, in this order; all of them if not given
    #[arg(long, value_name = "STEPS", value_enum, value_delimiter = ',')]
    only: Vec<Step>,
    /// Role of the arm, if the bench binds several; its limits are written under [limits.ROLE] then
    #[arg(long, value_name = "ROLE")]
    arm: Option<String>,
    /// Role of the pad whose origin touches the points, if the bench binds several pads or arms; `none` for the tip
    #[arg(long, value_name = "ROLE")]
    sensor: Option<String>,
    /// Room of the box around the visited points on each side; negative for a smaller box [mm]
    #[arg(long, value_name = "MM", default_value = "0", allow_hyphen_values = true, value_parser = finite)]
    margin: f64,
    /// Distance by which each keep-out plane is moved to the free side [mm]
    #[arg(long, value_name = "MM", default_value = "5", value_parser = not_negative)]
    clearance: f64,
}

/// A step of the dialogue.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Step {
    Home,
    Start,
    Workspace,
    KeepOut,
}

fn finite(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| number.is_finite());
    number.ok_or_else(|| format!("`{text}` is not a number"))
}

fn not_negative(text: &str) -> Result<f64, String> {
    finite(text).ok().filter(|number| *number >= 0.0).ok_or_else(|| format!("`{text}` is not a number from 0 on"))
}

pub(super) fn run(args: TeachArgs, shell: &Shell) -> Result<u8, u8> {
    let refuse = |why: String| shell.refuse(why);
    let file = TomlFile::read(&args.bench).map_err(refuse)?;
    let mut cell = GuidedCell::open(shell, &args.bench)?;
    let site = Site::find(&cell, &file, args.arm.as_deref(), args.sensor.as_deref()).map_err(refuse)?;
    let steps = [Step::Home, Step::Start, Step::Workspace, Step::KeepOut];
    let steps: Vec<Step> = steps.into_iter().filter(|step| args.only.is_empty() || args.only.contains(step)).collect();
    let mut dialogue = Dialogue::new(&mut cell, &site, [args.margin * 1e-3, args.clearance * 1e-3]);
    let taught = dialogue.teach(&steps).map_err(|left| left.report(shell))?;
    let file = taught.write_into(file, &site).map_err(|why| Left::Failed(why).report(shell))?;
    cell.write_after_yes(&file).map_err(|left| left.report(shell))
}
