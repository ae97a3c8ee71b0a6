//! The tool as somebody else's crate gets it: their own catalogue, five lines.

use std::process::ExitCode;

use tactflow_runtime::cli::Tool;

fn main() -> ExitCode {
    Tool::new(tactflow_tests::catalogue()).command(tactflow_nodes::calibration::command::command()).main()
}
