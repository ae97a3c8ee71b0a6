//! `recording`: a file of a tactile or pressure sensor as a pad.
//!
//! The file is read whole when the device is opened, so a mistake in it shows before anything runs. Frames come at the
//! times that the file gives them; those between two exchanges are skipped but for the newest, and none is served
//! twice. What the readers take is in [`crate::recordings`].

use std::sync::Arc;

use tactflow_runtime::device::{Commands, Description, Device, DeviceError, Driver, Opened, Output, Samples, Stepped};
use tactflow_runtime::node::{At, Describe, FilePath, Mistake, Mistakes, Param};
use tactflow_runtime::signal::{Image, Unit, VectorImage};
use tactflow_runtime::source::{Code, quoted};

use super::{Facts, pad};
use crate::arm::mount::Mount;
use crate::recordings::{self, Hints, Recording, Refusal, TIME_UNITS};

/// Parameters of `recording`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// The recording.
    file: FilePath,
    /// Name of the format; recognised if not given.
    format: Option<String>,
    /// Unit of the values, if the file does not state it.
    unit: Option<Unit>,
    /// Distance between the centres of neighbouring tactels along x and along y, if the file does not state it.
    #[param(unit = "mm", above = 0.0)]
    pitch_mm: Option<[f64; 2]>,
    /// Frames per second, if the file does not state it.
    #[param(unit = "1/s", range = 0.001..=1e6)]
    rate_hz: Option<f64>,
    /// Numbers of rows and columns, if the file does not state them.
    #[param(range = 1..=1_000_000)]
    size: Option<[usize; 2]>,
    /// Name of the pad to play, if the file has several; in a recording of a whole run, the role of the pad.
    pad: Option<String>,
    /// Unit of the times of a `csv` file whose column does not name it: `s`, `ms`, `us` or `ns`.
    time_unit: Option<TimeUnit>,
    /// Noise threshold that the pad states as a fact, in place of the one in the file.
    #[param(unit = "$unit", range = 0.0..)]
    threshold: Option<f64>,
    /// Unit of pressure that the pad states as a fact, per tactel: p = 1 in the paper.
    #[param(unit = "$unit", above = 0.0)]
    pressure: Option<f64>,
    /// Pose of the pad on the tip of its arm, stated as a fact.
    #[param(default = Mount::NONE)]
    mount: Mount,
}

/// Plays a recorded file of a tactile or pressure sensor (Tekscan, novel, XSENSOR, CSV, …) as a pad.
///
/// The device recognises the format from the beginning of the file, or `format` names it:
///
/// - `tekscan`: ASCII movies of I-Scan, F-Scan and CONFORMat, `.csv` or `.asf`
/// - `novel-lst`: listings of novel's emed and pliance, `.lst`
/// - `novel-asc`: text exports of novel's pliance, `.asc`; pedar insoles have no rows and columns and are not supported
/// - `footscan`: texts of RSscan's footscan plates
/// - `zebris`: `RawDataGaitAnalysis` texts of Zebris treadmills and plates
/// - `xsensor`: `.csv` of XSENSOR
/// - `csv`: plain tables with one frame per row or one frame per block
/// - `npy`, `npz`: arrays of numpy, frames x rows x columns; with 3 values for each tactel the pad has three axes
/// - `mcap`: a recording of a whole run, as `run --record` writes it; another graph then runs on the pad of that run
///
/// Any of them may be in a `.zip` or `.gz`. Pressures are converted to kPa, and forces to N.
///
/// The file is read whole before anything runs. A damaged file is refused with the line of the damage; no damage is
/// repaired silently. `unit`, `pitch_mm`, `rate_hz` and `size` give what the file does not state. Where the file states
/// another value, that is an error. `pad` picks one of several pads in a file.
///
/// Frames come at the times of the file, the first at once. If several frames come between two ticks, only the newest
/// is played. Rows and columns are counted as in the file: `tactile_source` turns them into the sensor's frame.
///
/// It states these facts: `dead` (places without a sensor, as [row, column]), `frames`, `format`, `threshold` if the
/// parameter or the file gives a value below which the values are noise; `pressure`, if it is given, and `mount`. Its
/// `calibration` lists the dead places and does not change the values.
///
/// ```toml
/// [roles]
/// pad = "tactile_pad"
///
/// [bind]
/// pad = "pad"
///
/// [devices.pad]
/// type = "recording"
/// file = "builtin:finger_press.csv"   # a finger on a Tekscan I-Scan: 28 by 28 sensels, 1.27 mm apart, raw, 10 Hz
/// ```
#[derive(Debug, Describe)]
#[describe(name = "recording")]
pub struct Player {
    image: Output<Image>,
    /// The vector image of a pad with three axes.
    vectors: Option<Output<VectorImage>>,
    recording: Recording,
    next: usize,
}

impl Device for Player {
    type Params = Params;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let file = &params.file;
        let hints = hints(&params)?;
        let bytes = file.bytes()?;
        let recording = recordings::read(&bytes, &file.path.to_string_lossy(), &hints)
            .map_err(|refusal| mistakes(refusal, file, &bytes))?;
        let mut description = Description::every(recording.period);
        let (shape, facts) = (recording.shape.clone(), facts(&recording, &params));
        let (image, vectors) = if recording.drag.is_empty() {
            (pad::fill(description.fills(pad::ROLE), shape, facts), None)
        } else {
            let (image, vectors) = pad::fill_three_axes(description.fills(pad::THREE_AXES), shape, facts);
            (image, Some(vectors))
        };
        Ok(Opened { description, driver: Driver::Stepped(Box::new(Self { image, vectors, recording, next: 0 })) })
    }
}

/// Unit of the times of a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
enum TimeUnit {
    /// Seconds.
    S,
    /// Milliseconds.
    Ms,
    /// Microseconds.
    Us,
    /// Nanoseconds.
    Ns,
}

impl TimeUnit {
    /// Returns its size [s].
    const fn seconds(self) -> f64 {
        TIME_UNITS[self as usize].1
    }
}

fn hints(params: &Params) -> Result<Hints, Mistakes> {
    let is_known = |name: &String| recordings::FORMATS.iter().any(|format| format.name == name);
    if let Some(format) = params.format.as_ref().filter(|format| !is_known(format)) {
        let names = quoted(recordings::FORMATS.iter().map(|format| format.name));
        let mistake = Mistake::param("format", format!("unknown format `{format}`"));
        return Err(mistake.help(format!("known formats are {names}")).into());
    }
    Ok(Hints {
        assumed: None,
        format: params.format.clone(),
        unit: params.unit,
        pitch: params.pitch_mm.map(|pitch| pitch.map(|mm| mm * 1e-3)),
        rate_hz: params.rate_hz,
        size: params.size,
        pad: params.pad.clone(),
        force: None,
        time_unit: params.time_unit.map(TimeUnit::seconds),
    })
}

fn mistakes(refusal: Refusal, file: &FilePath, bytes: &[u8]) -> Mistakes {
    let name = file.path.display();
    let here = |message: String| Mistake::new(Code::BadData, At::Span(file.span.clone()), message);
    match refusal {
        Refusal::Stranger => {
            let head = recordings::FileHead::new(bytes, "");
            let begins = match head.text.trim().lines().next() {
                Some(line) => format!("it begins with `{}`", recordings::text::shortened(line.trim())),
                None => "it is empty".into(),
            };
            here(format!("`{name}` has an unknown format: {begins}")).help(recordings::list()).into()
        }
        Refusal::Damaged { text, flaws } => {
            let text: Arc<str> = text.into();
            flaws.into_iter().map(|flaw| Mistake::data(file, text.clone(), flaw.span, flaw.message)).collect()
        }
        Refusal::Broken { message, help } => {
            let mistake = here(format!("`{name}`: {message}"));
            help.into_iter().fold(mistake, Mistake::help).into()
        }
        Refusal::Silent { message, help } => here(message).help(help).into(),
        Refusal::Contradicted { hint, message } => Mistake::param(hint, message).into(),
    }
}

impl Stepped for Player {
    fn next(&self) -> Option<i64> {
        self.recording.frames.get(self.next).map(|frame| frame.time)
    }

    fn end(&self) -> Option<i64> {
        self.recording.frames.last().map(|frame| frame.time)
    }

    fn exchange(&mut self, now: i64, _: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        let left = &self.recording.frames[self.next..];
        let due = left.partition_point(|frame| frame.time <= now);
        if due > 0 {
            self.next += due;
            let newest = self.next - 1;
            let frame = self.recording.frames[newest];
            self.recording.show(newest, samples.write(self.image, frame.time, frame.number).cells_mut());
            if let Some(vectors) = self.vectors {
                let vectors = samples.write(vectors, frame.time, frame.number).cells_mut();
                self.recording.show_vectors(newest, vectors);
            }
        }
        Ok(())
    }
}

fn facts(recording: &Recording, params: &Params) -> Facts {
    let cols = recording.shape.cols;
    let place = |index: &usize| toml::Value::from(vec![(index / cols) as i64, (index % cols) as i64]);
    let dead: Vec<toml::Value> = recording.dead.iter().map(place).collect();
    let mut facts = vec![
        ("calibration".into(), toml::Table::from_iter([("dead".to_owned(), dead.clone().into())]).into()),
        ("dead".into(), dead.into()),
        ("frames".into(), (recording.frames.len() as i64).into()),
        ("format".into(), recording.format.into()),
        pad::mount(&params.mount),
    ];
    if let Some(threshold) = params.threshold.or(recording.threshold) {
        facts.push(("threshold".into(), threshold.into()));
    }
    facts.extend(params.pressure.map(|pressure| ("pressure".into(), pressure.into())));
    facts
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::signal::Shape;

    use super::*;
    use crate::devices::testing::{Bench, open};

    const PATH: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/recordings/pressuRe/iscan_test.csv");

    #[test]
    fn the_doc_names_every_format() {
        for format in recordings::FORMATS {
            assert!(Player::DOC.contains(&format!("`{}`", format.name)), "{}", format.name);
        }
    }

    #[test]
    fn frames_are_served_once_and_the_newest_wins() {
        let mut bench = Bench::new(open::<Player>(&format!("file = '{PATH}'")).unwrap());
        let Some(Shape::Image(shape)) = bench.description.shape("image") else { panic!("an image") };
        assert_eq!((shape.rows, shape.cols), (28, 28));
        assert_eq!(bench.fact("threshold"), Some(&3.0.into()));
        assert_eq!(bench.fact("frames"), Some(&309.into()));
        assert_eq!(bench.fact("dead").unwrap()[1], vec![0, 1].into());
        let force = |bench: &mut Bench| {
            let image = bench.image();
            let sum: f32 = image.cells().iter().sum();
            image.cells_mut().fill(f32::NAN);
            sum
        };
        assert_eq!(bench.device.next(), Some(0));
        bench.exchange(0);
        assert_eq!((force(&mut bench), bench.device.next()), (310.0, Some(100_000_000)));
        bench.exchange(99_999_999);
        assert!(force(&mut bench).is_nan(), "nothing is due");
        bench.exchange(350_000_000);
        assert_eq!((force(&mut bench), bench.device.next()), (309.0, Some(400_000_000)), "frame 4 and neither 2 nor 3");
        bench.exchange(i64::MAX);
        assert_eq!((force(&mut bench), bench.device.next()), (29.0, None));
        bench.exchange(i64::MAX);
        assert!(force(&mut bench).is_nan(), "the movie is over");
    }

    #[test]
    fn a_packed_recording_plays_as_it_is() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/recordings/pawlabeling/dog1_sel_1.zip");
        let mut bench = Bench::new(open::<Player>(&format!("file = '{path}'")).unwrap());
        let Some(Shape::Image(shape)) = bench.description.shape("image") else { panic!("an image") };
        assert_eq!((shape.rows, shape.cols), (256, 63));
        assert_eq!(bench.fact("format"), Some(&"footscan".into()));
        bench.exchange(0);
        let image = bench.image();
        let load: f32 = image.cells().iter().sum();
        assert!((load - 11.9).abs() < 1e-3, "{load} N");
    }

    #[test]
    fn a_missing_file_and_another_file_are_mistakes_where_the_bench_names_them() {
        for (path, message) in
            [("nowhere.csv", "cannot read"), (concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml"), "`")]
        {
            let mistakes = open::<Player>(&format!("file = '{path}'")).err().unwrap();
            assert_eq!(mistakes[0].at, At::Span(7..9 + path.len()));
            assert!(mistakes[0].message.starts_with(message), "{mistakes:?}");
        }
    }
}
