//! The `tactflow` tool.

use std::process::ExitCode;

use tactflow_runtime::cli::Tool;

fn main() -> ExitCode {
    Tool::new(tactflow_nodes::catalogue()).command(tactflow_nodes::calibration::command::command()).main()
}
