//! The `tactflow` tool.

use std::process::ExitCode;

use tactflow_runtime::cli::Tool;

fn main() -> ExitCode {
    Tool::new(tactflow_nodes::catalogue()).main()
}
