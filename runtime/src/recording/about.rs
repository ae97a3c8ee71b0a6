//! What a recording attaches: which graph ran, with which options, on which devices, and all files that it read.

use std::path::PathBuf;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::device::RecordedDevice;
use crate::engine::Engine;
use crate::graph::{RecordedGraph, Request};
use crate::source::AttachedFiles;

/// Name of the attachment with the options of the run.
pub(crate) const RUN_FILE: &str = "tactflow/run.toml";
/// Name of the attachment with the devices.
pub(crate) const DEVICES_FILE: &str = "tactflow/devices.toml";

/// Which graph ran, and with which options.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct RunAbout {
    /// Version of tactflow.
    pub tactflow: String,
    /// Hash of all attached files, options and devices.
    #[serde(default)]
    pub hash: String,
    /// Path of the graph.
    pub graph: PathBuf,
    /// Path of the bench, if it is not that of the graph.
    pub bench: Option<PathBuf>,
    /// The values that replaced those of the files.
    #[serde(default)]
    pub set: Vec<String>,
    /// Fraction of the limits that was used, if not all of them.
    pub slow: Option<f64>,
    /// Whether the run was in real time.
    pub is_real: bool,
    /// Seed of the run of a scenario.
    pub seed: Option<u64>,
    /// Nominal time between two ticks [ns].
    pub period_ns: i64,
}

/// Everything that a recording contains before its first tick.
#[derive(Debug, Clone, Default)]
pub(crate) struct Contents {
    pub(crate) about: RunAbout,
    pub(crate) devices: Vec<RecordedDevice>,
    pub(crate) files: AttachedFiles,
}

/// The devices as a document, since TOML needs a table.
#[derive(Serialize, Deserialize)]
struct DeviceList {
    #[serde(default)]
    devices: Vec<RecordedDevice>,
}

impl Contents {
    /// Collects what belongs to the run of an engine.
    ///
    /// # Errors
    /// If a file that the graph has read cannot be read again.
    pub(crate) fn of(engine: &Engine, request: &Request, (is_real, seed): (bool, Option<u64>)) -> Result<Self, String> {
        let bench = request.bench.clone().or_else(|| request.bench_text.as_ref().map(|_| "bench.toml".into()));
        let about = RunAbout {
            tactflow: env!("CARGO_PKG_VERSION").to_owned(),
            hash: String::new(),
            graph: request.graph.clone(),
            bench,
            set: request.set.clone(),
            slow: request.slow,
            is_real,
            seed,
            period_ns: engine.period(),
        };
        let mut contents = Self { about, devices: engine.recorded_devices(), files: engine.sources().attach()? };
        contents.about.hash = format!("{:016x}", contents.hash());
        Ok(contents)
    }

    /// Returns the texts of the attachments that describe the run.
    pub(crate) fn documents(&self) -> [(&'static str, String); 2] {
        let run = toml::to_string(&self.about).expect("the options are TOML");
        let list = DeviceList { devices: self.devices.clone() };
        [(RUN_FILE, run), (DEVICES_FILE, toml::to_string(&list).expect("a device is TOML"))]
    }

    /// Adds an attachment of a recording.
    ///
    /// # Errors
    /// If it describes the run and is damaged.
    pub(crate) fn add(&mut self, name: &str, data: Vec<u8>) -> Result<(), String> {
        let text = || String::from_utf8_lossy(&data).into_owned();
        let damaged = |error: toml::de::Error| format!("the attachment `{name}` is damaged: {}", error.message());
        match name {
            RUN_FILE => self.about = toml::from_str(&text()).map_err(damaged)?,
            DEVICES_FILE => self.devices = toml::from_str::<DeviceList>(&text()).map_err(damaged)?.devices,
            _ => drop(self.files.insert(PathBuf::from(name), data)),
        }
        Ok(())
    }

    /// Returns the request that loads the recorded graph on the recorded devices.
    pub(crate) fn request(&self) -> Request {
        let recorded = RecordedGraph { devices: self.devices.clone(), files: Some(Arc::new(self.files.clone())) };
        Request {
            graph: self.about.graph.clone(),
            bench: self.about.bench.clone(),
            set: self.about.set.clone(),
            slow: self.about.slow,
            recorded: Some(Arc::new(recorded)),
            ..Request::default()
        }
    }

    /// Returns the hash (FNV-1a) of everything that determines the graph.
    fn hash(&self) -> u64 {
        let about = RunAbout { hash: String::new(), is_real: false, ..self.about.clone() };
        let [(_, run), (_, devices)] = Self { about, ..self.clone() }.documents();
        let files = self.files.iter().flat_map(|(path, bytes)| [path.as_os_str().as_encoded_bytes(), bytes]);
        let parts = [run.as_bytes(), devices.as_bytes()].into_iter().chain(files);
        let bytes = parts.flat_map(|part| part.iter().chain(&[0xff]));
        bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3))
    }
}

/// Describes a run in one line: the graph, and the hash of everything that determines it. Without the hash if a file of the
/// graph cannot be read again.
pub(crate) fn about_run(engine: &Engine, request: &Request, is_real: bool) -> String {
    let contents = Contents::of(engine, request, (is_real, None));
    let hash = contents.map_or_else(|_| String::new(), |contents| format!(", hash {}", contents.about.hash));
    format!("graph {}{hash}", request.graph.display())
}
