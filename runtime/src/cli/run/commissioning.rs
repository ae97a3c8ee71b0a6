//! The file beside a bench that says which of its devices have been commissioned.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::{fs, io};

use serde::{Deserialize, Serialize};

use crate::graph::{CommissionedDevice, Compiled};

/// Fraction of the limits that a run uses while a device is not commissioned.
pub(super) const UNCOMMISSIONED_FRACTION: f64 = 0.1;

/// What was proven of the devices of a bench, by name.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Commissioning(BTreeMap<String, Proof>);

/// What was proven of a device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Proof {
    /// Fingerprint of the device, of its robot and of the model of its arm.
    pub fingerprint: String,
    /// Time from its last command until it was at rest [ms].
    pub stopped_after_ms: f64,
    /// Way of its fastest joint in this time [mrad; mm if it is prismatic].
    pub stopped_after_mrad: f64,
}

impl Commissioning {
    /// Returns the path of the file beside a bench: `cell.commissioned.toml` for `cell.toml`.
    #[must_use]
    pub fn path(bench: &Path) -> PathBuf {
        bench.with_extension("commissioned.toml")
    }

    /// Reads the file beside a bench. A missing one is empty.
    ///
    /// # Errors
    /// If the file cannot be read or was changed by hand into something else.
    pub fn read(bench: &Path) -> Result<Self, String> {
        let path = Self::path(bench);
        match fs::read_to_string(&path) {
            Ok(text) => toml::from_str(&text).map_err(|error| {
                let message = error.message();
                format!("`{}` is not a file of `tactflow doctor --move`: {message}; delete it", path.display())
            }),
            Err(error) if error.kind() == ErrorKind::NotFound => Ok(Self::default()),
            Err(error) => Err(format!("cannot read `{}`: {error}", path.display())),
        }
    }

    /// Whether a device is as it was when it was commissioned.
    #[must_use]
    pub fn covers(&self, device: &CommissionedDevice) -> bool {
        self.0.get(&device.name).is_some_and(|proof| proof.fingerprint == device.fingerprint)
    }

    /// Adds what was proven of a device.
    pub fn add(&mut self, device: &str, proof: Proof) {
        self.0.insert(device.to_owned(), proof);
    }

    /// Writes the file beside a bench.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, bench: &Path) -> io::Result<()> {
        const HEADER: &str = "# Written by `tactflow doctor --move`. Without it, a run uses a tenth of the speeds.\n";
        let text = toml::to_string(self).map_err(io::Error::other)?;
        fs::write(Self::path(bench), format!("{HEADER}{text}"))
    }
}

/// Returns the devices of a graph that are not commissioned, each with the path of its bench.
///
/// # Errors
/// If a file beside a bench cannot be read.
pub(super) fn uncommissioned(plan: &Compiled) -> Result<Vec<(String, String)>, String> {
    let mut missing = Vec::new();
    for (device, bench) in plan.to_commission() {
        if !Commissioning::read(Path::new(bench))?.covers(device) {
            missing.push((device.name.clone(), bench.to_owned()));
        }
    }
    Ok(missing)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_read_as_it_was_written_and_covers_the_device_as_it_was() {
        let folder = std::env::temp_dir().join(format!("tactflow-commissioning-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder");
        let bench = folder.join("cell.toml");
        assert_eq!(Commissioning::read(&bench), Ok(Commissioning::default()));
        let mut written = Commissioning::default();
        let proof = Proof { fingerprint: "00ff".into(), stopped_after_ms: 81.5, stopped_after_mrad: 2.25 };
        written.add("arm", proof);
        written.write(&bench).expect("it is written");
        let read = Commissioning::read(&bench);
        assert_eq!(read.as_ref(), Ok(&written));
        let device = |fingerprint: &str| CommissionedDevice::new("arm", fingerprint);
        assert!(written.covers(&device("00ff")) && !written.covers(&device("00fe")));
        fs::write(Commissioning::path(&bench), "arm = 3").expect("it is written");
        let message = Commissioning::read(&bench).expect_err("it is no such file");
        assert!(message.contains("cell.commissioned.toml` is not a file of"), "{message}");
        fs::remove_dir_all(&folder).expect("it is there");
    }
}
