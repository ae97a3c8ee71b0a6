//! The latency timer of FTDI adapters: how long a few bytes wait in the adapter.

use std::path::Path;

/// Longest time of the timer that is no matter [ms].
const LONGEST_MS: u32 = 1;

/// Returns a warning if the adapter of a serial port holds bytes back for long.
pub(super) fn warning(path: &str) -> Option<String> {
    warning_in(Path::new("/sys/bus/usb-serial/devices"), path)
}

fn warning_in(devices: &Path, path: &str) -> Option<String> {
    let port = std::fs::canonicalize(path).ok()?;
    let timer = devices.join(port.file_name()?).join("latency_timer");
    let latency: u32 = std::fs::read_to_string(&timer).ok()?.trim().parse().ok()?;
    (latency > LONGEST_MS).then(|| {
        format!(
            "the adapter of `{path}` holds bytes back for up to {latency} ms: `echo 1 | sudo tee {}` sets 1 ms",
            timer.display()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_slow_timer_is_named_with_the_command_that_sets_it() {
        let folder = std::env::temp_dir().join(format!("tactflow-latency-{}", std::process::id()));
        let device = folder.join("ttyUSB0");
        std::fs::create_dir_all(&device).unwrap();
        let port = folder.join("dev-ttyUSB0");
        std::fs::create_dir_all(&port).unwrap();
        let port = port.join("ttyUSB0");
        std::fs::write(&port, "").unwrap();
        for (timer, is_warned) in [("16\n", true), ("2\n", true), ("1\n", false), ("none", false)] {
            std::fs::write(device.join("latency_timer"), timer).unwrap();
            let warning = warning_in(&folder, port.to_str().unwrap());
            assert_eq!(warning.is_some(), is_warned, "{timer}: {warning:?}");
            assert!(warning.is_none_or(|text| text.contains("echo 1 | sudo tee ")));
        }
        assert_eq!(warning_in(&folder, "/dev/null"), None, "no FTDI adapter");
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
