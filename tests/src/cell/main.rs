//! `tactflow-cell CELL.toml`: serves the simulated bench as a real cell.

#![cfg(unix)]

use std::io::{self, Write};
use std::path::Path;
use std::process::ExitCode;

fn main() -> ExitCode {
    let mut arguments = std::env::args_os().skip(1);
    let (Some(path), None) = (arguments.next(), arguments.next()) else {
        return refuse("give one file that describes the cell: `tactflow-cell CELL.toml`");
    };
    let setup = match tactflow_tests::cell::Setup::read(Path::new(&path)) {
        Ok(setup) => setup,
        Err(why) => return refuse(&why),
    };
    match tactflow_tests::cell::run(&setup, &mut io::stdout()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(why) => refuse(&why),
    }
}

fn refuse(why: &str) -> ExitCode {
    // Nobody may listen any more.
    let _ = writeln!(io::stderr(), "error: {why}");
    ExitCode::FAILURE
}
