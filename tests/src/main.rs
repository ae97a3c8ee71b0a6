//! The tool as somebody else's crate gets it: their own catalogue, five lines.

use std::process::ExitCode;

fn main() -> ExitCode {
    tactflow_nodes::tool(tactflow_tests::catalogue()).main()
}
