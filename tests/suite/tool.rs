//! The tool as a process: what it is told, what it says and how it ends.

use std::process::{Command, Stdio};

use tactflow_tests::workspace;

/// What the tool said, and its exit code.
pub(crate) struct Said {
    pub(crate) code: i32,
    pub(crate) out: String,
    pub(crate) err: String,
}

/// The tool, about to run in the workspace's folder, with nothing of the environment that changes what it says.
pub(crate) fn tool(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_tactflow-under-test"));
    command.args(args).current_dir(workspace()).stdin(Stdio::null());
    for name in ["NO_COLOR", "CLICOLOR_FORCE", "RUST_LOG", "RUST_BACKTRACE"] {
        command.env_remove(name);
    }
    command
}

/// Runs the tool to its end.
pub(crate) fn say(args: &[&str]) -> Said {
    said(&mut tool(args))
}

/// Runs a command to its end.
pub(crate) fn said(command: &mut Command) -> Said {
    let output = command.output().unwrap_or_else(|error| panic!("{command:?}: {error}"));
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("the tool speaks UTF-8");
    let code = output.status.code().unwrap_or_else(|| panic!("{command:?}: {}", output.status));
    Said { code, out: text(output.stdout), err: text(output.stderr) }
}

/// Runs a command to its end, with its standard output in a file.
#[cfg(target_os = "linux")]
pub(crate) fn said_into(command: &mut Command, out: std::fs::File) -> Said {
    let child = command.stdout(out).stderr(Stdio::piped()).spawn().expect("the tool starts");
    let output = child.wait_with_output().expect("the tool ends");
    let err = String::from_utf8(output.stderr).expect("the tool speaks UTF-8");
    Said { code: output.status.code().expect("it ends by itself"), out: String::new(), err }
}

/// Runs one of the Python peers and gives what it printed.
pub(crate) fn peer(script: &str, args: &[&str]) -> String {
    let path = workspace().join("tests/peers").join(script);
    let said = said(Command::new("python3").arg(path).args(args));
    assert_eq!((said.code, said.err.as_str()), (0, ""), "{script} {args:?}: {}", said.out);
    said.out
}
