//! The file that describes a cell.
//!
//! ```toml
//! bench = "graphs/benches/ball.toml"      # relative to this file
//! log = "log"                             # folder of commands.csv, motion.csv and truth.csv; no log without it
//! for_s = 20.0                            # without it, the cell runs until its standard input ends
//!
//! [set]                                   # parameters of the `sim_bench`, instead of those of the bench
//! rate_hz = 100.0
//!
//! [pad]
//! wire = "myrmex"
//!
//! [arm]
//! wire = "lwr"
//! to = "127.0.0.1:49938"
//! ```

use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;

/// A cell.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setup {
    /// The bench with the `sim_bench`.
    pub bench: PathBuf,
    /// Folder of the log.
    pub log: Option<PathBuf>,
    /// Duration; endless if not given [s].
    pub for_s: Option<f64>,
    /// Parameters of the `sim_bench`, instead of those of the bench.
    #[serde(default)]
    pub set: toml::Table,
    /// The sensor.
    pub pad: PadSetup,
    /// The robot.
    pub arm: ArmSetup,
}

/// A sensor.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "wire", rename_all = "lowercase", deny_unknown_fields)]
pub enum PadSetup {
    /// FlexiTac: `AA 55` and 8 bits per tactel, on a pseudo-terminal.
    Flexitac {
        /// Reading of the simulated pad that 255 stands for [counts].
        #[serde(default = "twelve_bits")]
        full_scale: f64,
        /// A symbolic link to the terminal, which the cell makes.
        link: Option<PathBuf>,
    },
    /// Myrmex v2: the AGNI serial protocol with 12 bits per tactel, on a pseudo-terminal.
    Myrmex {
        /// Reading of the simulated pad that 4095 stands for [counts].
        #[serde(default = "twelve_bits")]
        full_scale: f64,
        /// A symbolic link to the terminal, which the cell makes.
        link: Option<PathBuf>,
        /// Type of the sensor in its configuration.
        #[serde(default = "made_up_uid")]
        uid: u16,
        /// Unit of the stamps [µs].
        #[serde(default = "stamp_unit")]
        stamp_unit_us: f64,
        /// Serial number; none is answered without it.
        serial: Option<String>,
    },
    /// A TCP server with 16 bits per tactel, a counter and a sum.
    Tcp {
        /// Reading of the simulated pad that 4095 stands for [counts].
        #[serde(default = "twelve_bits")]
        full_scale: f64,
        /// Port; 0 takes a free one.
        #[serde(default)]
        port: u16,
    },
}

/// A robot.
#[derive(Debug, Clone, Deserialize)]
#[serde(tag = "wire", rename_all = "lowercase", deny_unknown_fields)]
pub enum ArmSetup {
    /// A KUKA LWR 4+ with FRI 1.0.
    Lwr {
        /// Where the driver listens, as `host:port`.
        to: String,
        /// Time between two messages of the robot [ms].
        #[serde(default = "fri_period")]
        period_ms: f64,
        /// Time with a perfect connection after which the program on the robot calls friStart [s].
        #[serde(default = "fri_start")]
        start_s: f64,
        /// Answers in time that raise the quality by one.
        #[serde(default = "ten")]
        good_per_level: u32,
        /// Missing answers in a row that lower the quality by one.
        #[serde(default = "three")]
        missed_per_level: u32,
        /// Whether the program on the robot calls friStart again after a drop to monitor mode.
        #[serde(default)]
        restarts: bool,
        /// FRI joint offset, the same for each joint [rad].
        #[serde(default)]
        offset_rad: f64,
    },
    /// A Universal Robots e-Series.
    Ur {
        /// Port of RTDE; 0 takes a free one.
        #[serde(default)]
        rtde_port: u16,
        /// Port that takes a script; 0 takes a free one.
        #[serde(default)]
        script_port: u16,
        /// Where the reverse interface is, as `host:port`; the script says it if not given.
        reverse: Option<String>,
        /// Acceleration of speedj [rad/s²].
        #[serde(default = "speedj_acceleration")]
        acceleration: f64,
    },
}

const fn twelve_bits() -> f64 {
    4095.0
}

const fn made_up_uid() -> u16 {
    0x1234
}

const fn stamp_unit() -> f64 {
    100.0
}

const fn fri_period() -> f64 {
    4.0
}

const fn fri_start() -> f64 {
    0.3
}

const fn ten() -> u32 {
    10
}

const fn three() -> u32 {
    3
}

const fn speedj_acceleration() -> f64 {
    40.0
}

impl Setup {
    /// Reads the file of a cell. Its paths become relative to the working folder.
    ///
    /// # Errors
    /// If the file cannot be read, or what is wrong in it.
    pub fn read(path: &Path) -> Result<Self, String> {
        let text = fs::read_to_string(path).map_err(|error| format!("{}: {error}", path.display()))?;
        let mut setup: Self = toml::from_str(&text).map_err(|error| format!("{}: {error}", path.display()))?;
        setup.check().map_err(|why| format!("{}: {why}", path.display()))?;
        let folder = path.parent().unwrap_or(Path::new(""));
        setup.bench = folder.join(&setup.bench);
        setup.log = setup.log.map(|log| folder.join(log));
        if let PadSetup::Flexitac { link: Some(link), .. } | PadSetup::Myrmex { link: Some(link), .. } = &mut setup.pad
        {
            *link = folder.join(&*link);
        }
        Ok(setup)
    }

    fn check(&self) -> Result<(), String> {
        let (PadSetup::Flexitac { full_scale, .. }
        | PadSetup::Myrmex { full_scale, .. }
        | PadSetup::Tcp { full_scale, .. }) = self.pad;
        let is_positive = |number: f64| number.is_finite() && number > 0.0;
        if !is_positive(full_scale) {
            return Err("`full_scale` must be above 0".into());
        }
        match &self.arm {
            ArmSetup::Lwr { period_ms, .. } if !(1.0..=100.0).contains(period_ms) => {
                Err("`period_ms` must be from 1 to 100".into())
            }
            ArmSetup::Lwr { good_per_level: 0, .. } | ArmSetup::Lwr { missed_per_level: 0, .. } => {
                Err("`good_per_level` and `missed_per_level` must be at least 1".into())
            }
            ArmSetup::Ur { acceleration, .. } if !is_positive(*acceleration) => {
                Err("`acceleration` must be above 0".into())
            }
            _ => Ok(()),
        }
    }
}
