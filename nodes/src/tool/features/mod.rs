//! `tactflow features`: runs the touch part on a recording and writes the features of the contact as a table.
//!
//! It makes an ordinary graph from the command line; `--graph` prints it as a starting point.

mod graph;
mod plot;

use std::num::NonZeroU32;
use std::path::PathBuf;

use tactflow_runtime::cli::{Job, JobOptions, Print, Shell, clap, duration};
use tactflow_runtime::graph::Request;

use super::arguments::{may_draw, pair, positive, write};
use crate::recordings::{self, Hints, Recording, TIME_UNITS};
use graph::{ContactRules, count_regions};

/// Extract the features of the contact in a recording: position, force, line direction
#[derive(clap::Parser)]
#[command(
    name = "features",
    after_help = "Reads every format of the device `recording`; `tactflow describe recording` lists them.

Examples:
  tactflow features press.csv -o features.csv
  tactflow features plate.zip --pitch-mm 5.08x7.62 --for 2s
  tactflow features pad.npy --pitch-mm 5x5 --rate-hz 250 --unit N --threshold 0.02 --min-area 6
  tactflow features press.csv --graph > press.toml
  tactflow features insoles.csv --pad \"LF S0073\" --regions all -o left.csv --svg left.svg

The columns `touch.…` are of the largest region, `whole.…` of all tactels above the threshold, and `regions.count`
is the number of regions. With `--regions all`, `region1.…` is the largest region, `region2.…` the second, and so on."
)]
pub(super) struct FeaturesArgs {
    /// Recording, optionally in a .zip or .gz
    recording: PathBuf,
    /// Write one row per frame to a .csv or .ndjson file
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Draw the way of the centre of pressure, and the force over time, to an .svg file
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
    /// Print the graph and do not run it
    #[arg(long, conflicts_with_all = ["out", "svg"])]
    graph: bool,
    /// Regions with columns of their own: only the largest one, or all
    #[arg(long, value_enum, default_value_t = RegionChoice::Largest)]
    regions: RegionChoice,
    /// Name of the pad, if the file has several
    #[arg(long, value_name = "NAME")]
    pad: Option<String>,
    /// Threshold of a touched tactel [unit of the recording]; by default that of the file, or 5 % of its maximum
    #[arg(long, value_name = "VALUE", allow_hyphen_values = true, value_parser = finite)]
    threshold: Option<f64>,
    /// Minimum area of a contact [tactels]
    #[arg(long, value_name = "TACTELS", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..))]
    min_area: u32,
    /// Minimum force of a contact: the sum over its tactels [N; raw, if the recording is]
    #[arg(long, value_name = "VALUE", default_value_t = 0.0, value_parser = finite)]
    min_force: f64,
    /// Number of frames for the averages of pressure and orientation
    #[arg(long, value_name = "FRAMES", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    window: u32,
    /// Name of the format, if the file is not recognised
    #[arg(long, value_name = "NAME")]
    format: Option<String>,
    /// Unit of the values, if the file does not give it: raw, N, kPa
    #[arg(long, value_name = "UNIT")]
    unit: Option<String>,
    /// Distance between neighbouring tactels along x and y [mm], if the file does not give it: 5x5
    #[arg(long, value_name = "XxY", value_parser = lengths)]
    pitch_mm: Option<[f64; 2]>,
    /// Frames per second, if the file does not give it
    #[arg(long, value_name = "HZ", value_parser = positive)]
    rate_hz: Option<f64>,
    /// Unit of the times, if a column of a CSV file does not name it: s, ms, us, ns
    #[arg(long, value_name = "UNIT", value_parser = TIME_UNITS.map(|(name, _)| name))]
    time_unit: Option<String>,
    /// Number of rows and columns, if the file does not give it: 16x16
    #[arg(long, value_name = "ROWSxCOLS", value_parser = pair::<NonZeroU32>)]
    size: Option<[NonZeroU32; 2]>,
    /// Stop after this time in the recording: 20s, 500ms, 2min
    #[arg(long = "for", value_name = "TIME", value_parser = duration, allow_hyphen_values = true)]
    duration: Option<f64>,
}

/// Which regions have columns of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
#[value(rename_all = "lower")]
enum RegionChoice {
    /// The largest one.
    Largest,
    /// All of them.
    All,
}

/// Default threshold of a touched tactel, as a fraction of the maximum value of the recording.
const DEFAULT_THRESHOLD: f64 = 0.05;
/// Maximum number of regions with columns of their own.
const MAX_REGIONS: usize = 32;

pub(super) fn features(args: FeaturesArgs, shell: &Shell) -> Result<u8, u8> {
    let refuse = |message: String| shell.refuse(message);
    args.check().map_err(refuse)?;
    let mut options = JobOptions { duration: args.duration, out: args.out.clone(), ..JobOptions::default() };
    options.reserve_output(shell).map_err(refuse)?;
    let text = match args.read() {
        Some(recording) => {
            let (threshold, origin) = args.threshold(&recording);
            let mut rules = args.rules(&recording, threshold, &origin);
            if args.regions == RegionChoice::All {
                rules.regions = args.count(&rules, shell)?;
            }
            let text = args.graph_text(&rules);
            if args.graph {
                shell.say(text.trim_end());
                return Ok(0);
            }
            let headline = args.headline(&recording, threshold, &origin);
            shell.say(&headline);
            options.about = headline.lines().map(str::to_owned).collect();
            text
        }
        // The check of the graph reports what is wrong with the recording, once and at its place.
        None => args.graph_text(&ContactRules::default()),
    };
    // The picture is drawn from the rows, so that it shows what a table has.
    let rows = tempfile::tempdir().map_err(|error| shell.refuse(format_args!("no temporary folder: {error}")))?;
    let is_hidden = args.out.is_none() && args.svg.is_some();
    if is_hidden {
        options.out = Some(rows.path().join("rows.csv"));
        options.hides_out = true;
    }
    let table = options.out.clone();
    let title = format!("features of {}", args.recording.display());
    let code = Job { request: args.request(text), title, options, print: Print::Ports }.run(shell);
    match (&args.svg, table) {
        (Some(svg), Some(table)) if code == 0 => {
            let picture = plot::draw(&args.recording.display().to_string(), &table).map_err(refuse)?;
            write(svg, &picture).map_err(refuse)?;
            shell.say(&format!("wrote {}", svg.display()));
            Ok(0)
        }
        _ => Ok(code),
    }
}

impl FeaturesArgs {
    /// Checks the files to write.
    fn check(&self) -> Result<(), String> {
        let Some(svg) = &self.svg else { return Ok(()) };
        if self.out.as_ref().is_some_and(|out| out.as_os_str() == "-") {
            return Err("`--svg` draws the rows of a file: write `-o features.csv` instead of `-o -`".into());
        }
        may_draw(svg)
    }

    /// Returns the request of a graph, with the settings as `--set`, so that a mistake shows in the arguments.
    fn request(&self, text: String) -> Request {
        let set = self.settings().iter().map(|setting| format!("devices.recording.{setting}")).collect();
        Request { set, ..Request::text(text) }
    }

    /// Returns what a contact is.
    fn rules(&self, recording: &Recording, threshold: f64, origin: &str) -> ContactRules {
        ContactRules {
            threshold,
            origin: origin.to_owned(),
            newtons: newtons(recording),
            noise: recording.threshold,
            regions: 0,
        }
    }

    /// Returns the largest number of regions in one frame.
    fn count(&self, rules: &ContactRules, shell: &Shell) -> Result<usize, u8> {
        let count = count_regions(&self.request(self.graph_text(rules)), self.duration, shell)?;
        if count > MAX_REGIONS {
            return Err(shell.refuse(format_args!(
                "a frame has {count} regions, but at most {MAX_REGIONS} have columns of their own: raise `--threshold`, \
                 `--min-area` or `--min-force`"
            )));
        }
        Ok(count)
    }

    /// Returns the recording, or `None` if it has mistakes. The graph reads it again.
    fn read(&self) -> Option<Recording> {
        let bytes = std::fs::read(&self.recording).ok()?;
        let hints = Hints {
            format: self.format.clone(),
            unit: self.unit.as_ref().map(|unit| unit.parse()).transpose().ok()?,
            pitch: self.pitch_mm.map(|pitch| pitch.map(|mm| mm * 1e-3)),
            rate_hz: self.rate_hz,
            size: self.size.map(|size| size.map(|count| count.get() as usize)),
            pad: self.pad.clone(),
            time_unit: self
                .time_unit
                .as_ref()
                .and_then(|unit| TIME_UNITS.iter().find(|(name, _)| name == unit))
                .map(|unit| unit.1),
            ..Hints::default()
        };
        recordings::read(&bytes, &self.recording.to_string_lossy(), &hints).ok()
    }

    /// Returns the threshold and its origin.
    fn threshold(&self, recording: &Recording) -> (f64, String) {
        match (self.threshold, recording.threshold) {
            (Some(value), _) => (value, "from --threshold".into()),
            (None, Some(value)) => (value, "from the file".into()),
            (None, None) => {
                let peak = recording.cells.iter().fold(0.0_f32, |peak, cell| peak.max(*cell));
                let percent = DEFAULT_THRESHOLD * 100.0;
                let origin = format!("{percent} % of the maximum value; set another with --threshold");
                (f64::from(peak) * DEFAULT_THRESHOLD, origin)
            }
        }
    }

    /// Returns the summary: the recording, and the definition of a contact.
    fn headline(&self, recording: &Recording, threshold: f64, origin: &str) -> String {
        let shape = &recording.shape;
        let [x, y] = shape.pitch.map(|pitch| (pitch * 1e6).round() * 1e-3);
        let seconds = recording.frames.last().map_or(0.0, |frame| frame.time as f64 * 1e-9);
        let forces = match newtons(recording) {
            Some(factor) => format!("\nforces: in N, of the pressure on {:.4} cm2 a tactel", factor * 10.0),
            None => String::new(),
        };
        format!(
            "{}: {}, {} by {} tactels of {x} by {y} mm, {} frames in {seconds:.2} s, in {}\n\
             contact: the largest region of at least {} tactels above {threshold:.4} {} ({origin}){forces}",
            self.recording.display(),
            recording.format,
            shape.rows,
            shape.cols,
            recording.frames.len(),
            shape.unit,
            self.min_area,
            shape.unit,
        )
    }

    /// Returns the parameters of the device from the command line.
    fn settings(&self) -> Vec<String> {
        let Self { format, unit, pitch_mm, rate_hz, size, pad, time_unit, .. } = self;
        let word = |text: &str| toml::Value::from(text).to_string();
        // A printed graph may be stored in any folder.
        let path = if self.graph { std::path::absolute(&self.recording).ok() } else { None };
        let path = path.as_ref().unwrap_or(&self.recording).to_string_lossy();
        let settings = [
            ("file", Some(word(&path))),
            ("format", format.as_deref().map(word)),
            ("unit", unit.as_deref().map(word)),
            ("pitch_mm", pitch_mm.map(|pitch| format!("{pitch:?}"))),
            ("rate_hz", rate_hz.map(|rate| format!("{rate:?}"))),
            ("size", size.map(|size| format!("{size:?}"))),
            ("pad", pad.as_deref().map(word)),
            ("time_unit", time_unit.as_deref().map(word)),
        ];
        settings.into_iter().filter_map(|(name, value)| Some(format!("{name} = {}", value?))).collect()
    }
}

/// Returns the force of one kPa on a tactel of a recording in kPa [N].
fn newtons(recording: &Recording) -> Option<f64> {
    let [x, y] = recording.shape.pitch;
    (recording.shape.unit.to_string() == "kPa").then_some(x * y * 1e3)
}

/// Parses two lengths greater than 0: a parser for arguments.
fn lengths(text: &str) -> Result<[f64; 2], String> {
    let two = pair::<f64>(text)?;
    if two.iter().all(|length| *length > 0.0 && length.is_finite()) {
        Ok(two)
    } else {
        Err("expected two numbers greater than 0".into())
    }
}

fn finite(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() => Ok(number),
        _ => Err("expected a number".into()),
    }
}
