//! The `tactflow` tool.

use std::process::ExitCode;

fn main() -> ExitCode {
    tactflow_nodes::tool(tactflow_nodes::catalogue()).main()
}
