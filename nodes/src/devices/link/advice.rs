//! Messages about serial ports, each with a way out.

use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};

use tactflow_runtime::source::quoted;

/// The names of the serial ports that stay the same when a port is plugged in again.
const BY_ID: &str = "/dev/serial/by-id";

/// Says why a serial port cannot be opened, and what to do.
pub(super) fn refusal(path: &str, error: &io::Error) -> String {
    refusal_among(path, error, &by_id(Path::new(BY_ID)))
}

fn refusal_among(path: &str, error: &io::Error, ports: &[PathBuf]) -> String {
    match error.kind() {
        ErrorKind::PermissionDenied => {
            "permission denied: add yourself to the group of serial ports, `sudo usermod -aG dialout $USER`, and log in \
             again"
                .to_owned()
        }
        ErrorKind::NotFound if ports.is_empty() => "there is no such port: is the pad plugged in?".to_owned(),
        ErrorKind::NotFound => {
            format!("there is no such port; plugged in is {}", quoted(ports.iter().map(|port| port.display())))
        }
        ErrorKind::ResourceBusy => {
            "another program uses the port: close it; ModemManager opens new ports for some seconds, and `sudo \
             systemctl stop ModemManager` stops it"
                .to_owned()
        }
        _ => format!("{error}{}", stable_name(path, ports)),
    }
}

/// Says that the link is gone, and how to name the port so that it is found again.
pub(super) fn unplugged(path: &str, error: &str) -> String {
    format!("the port is gone ({error}){}", stable_name(path, &by_id(Path::new(BY_ID))))
}

/// Advises a name of the port that does not depend on the order in which ports are plugged in.
fn stable_name(path: &str, ports: &[PathBuf]) -> String {
    if !["/dev/ttyUSB", "/dev/ttyACM"].iter().any(|start| path.starts_with(start)) {
        return String::new();
    }
    let own = std::fs::canonicalize(path).ok();
    let same = |port: &&PathBuf| own.is_some() && std::fs::canonicalize(port).ok() == own;
    let name =
        ports.iter().find(same).map_or_else(|| format!("a name in {BY_ID}"), |port| format!("`{}`", port.display()));
    format!("; it may come back under another number: use {name}")
}

fn by_id(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten();
    let mut ports: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    ports.sort();
    ports
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_refusal_names_a_way_out() {
        let port = PathBuf::from("/dev/serial/by-id/usb-1a86");
        let cases = [
            (ErrorKind::PermissionDenied, "usermod -aG dialout"),
            (ErrorKind::NotFound, "plugged in is `/dev/serial/by-id/usb-1a86`"),
            (ErrorKind::ResourceBusy, "ModemManager"),
            (ErrorKind::InvalidInput, "use a name in /dev/serial/by-id"),
        ];
        for (kind, expected) in cases {
            let message = refusal_among("/dev/ttyUSB7", &kind.into(), std::slice::from_ref(&port));
            assert!(message.contains(expected), "{message}");
        }
        let message = refusal_among("/dev/ttyUSB7", &ErrorKind::NotFound.into(), &[]);
        assert!(message.ends_with("is the pad plugged in?"), "{message}");
    }

    #[test]
    fn a_name_that_stays_is_advised_only_where_the_name_does_not() {
        assert_eq!(stable_name("/dev/serial/by-id/usb-1", &[]), "");
        assert_eq!(stable_name("/tmp/pad", &[]), "");
        assert!(unplugged("/dev/ttyACM0", "x").contains("/dev/serial/by-id"));
    }
}
