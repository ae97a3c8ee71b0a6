//! The tool as somebody else's crate gets it: their own catalogue, five lines.

use std::process::ExitCode;

fn main() -> ExitCode {
    tactflow_runtime::cli::main(&tactflow_tests::catalogue())
}
