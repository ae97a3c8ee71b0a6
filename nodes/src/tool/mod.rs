//! The commands that know sensors. The commands of the runtime know none.

mod arguments;
mod calibrate;
mod control;
mod doctor;
mod explain;
mod features;
mod guided;
mod lint;
mod new;
#[cfg(feature = "drivers")]
mod pads;
mod pose;
mod press;
#[cfg(all(feature = "ros2", unix))]
mod ros2;
#[cfg(feature = "process")]
mod signature;
#[cfg(feature = "drivers")]
mod sniff;
mod teach;
mod tune;

use tactflow_runtime::catalogue::Catalogue;
#[cfg(not(all(feature = "ros2", unix)))]
use tactflow_runtime::cli::{Shell, clap};
use tactflow_runtime::cli::{Tool, derived};

pub(crate) use lint::lint;

/// Returns the tool with all commands, for a catalogue that includes that of this crate.
pub fn tool(catalogue: Catalogue) -> Tool {
    let tool = Tool::new(catalogue)
        .command(derived(features::features))
        .command(derived(calibrate::run))
        .command(derived(doctor::run))
        .command(derived(explain::run))
        .command(derived(new::run))
        .command(derived(pose::run))
        .command(derived(press::run))
        .command(derived(teach::run))
        .command(derived(tune::run));
    #[cfg(feature = "drivers")]
    let tool = tool.command(derived(pads::run)).command(derived(sniff::run));
    #[cfg(feature = "process")]
    let tool = tool.command(derived(signature::run));
    #[cfg(all(feature = "ros2", unix))]
    let tool = tool.command(derived(ros2::run));
    #[cfg(not(all(feature = "ros2", unix)))]
    let tool = tool.command(derived(left_out));
    tool
}

/// What stands in place of `ros2` in a tool without it.
#[cfg(not(all(feature = "ros2", unix)))]
#[derive(clap::Parser)]
#[command(name = "ros2", hide = true, disable_help_flag = true)]
struct LeftOut {
    #[arg(trailing_var_arg = true, allow_hyphen_values = true)]
    _arguments: Vec<String>,
}

#[cfg(not(all(feature = "ros2", unix)))]
fn left_out(_: LeftOut, shell: &Shell) -> u8 {
    let help = "build the tool with ROS 2: `cargo install --path nodes --features ros2` (docs/ros2.md)";
    shell.refuse(format_args!("this build leaves out `ros2`\nhelp: {help}"))
}
