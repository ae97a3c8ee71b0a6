//! The `tactflow` tool.

use std::process::ExitCode;

fn main() -> ExitCode {
    tactflow_runtime::cli::main(&tactflow_nodes::catalogue())
}
