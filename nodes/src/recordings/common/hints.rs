//! Properties of a recording that the bench gives where the file does not.

use tactflow_runtime::signal::Unit;

use super::refusal::Refusal;

/// Properties of a recording from outside the file. Where the file has them too, both must agree.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Hints {
    /// Name of the format.
    pub format: Option<String>,
    /// Unit of the cells.
    pub unit: Option<Unit>,
    /// Distance between the centres of two neighbours along x and along y [m].
    pub pitch: Option<[f64; 2]>,
    /// Frames per second [1/s].
    pub rate_hz: Option<f64>,
    /// Number of rows and of columns.
    pub size: Option<[usize; 2]>,
    /// Defaults for what neither the file nor a hint gives; `None` where that is an error.
    pub assumed: Option<Assumed>,
    /// Name of the pad, where a file has several.
    pub pad: Option<String>,
    /// Name of the port that is the reference force, in a recording of a whole run.
    pub force: Option<String>,
    /// Unit of the times of a file that does not name it [s].
    pub time_unit: Option<f64>,
}

/// The units of times: their names, and their size [s].
pub const TIME_UNITS: [(&str, f64); 4] = [("s", 1.0), ("ms", 1e-3), ("us", 1e-6), ("ns", 1e-9)];

/// Maximum relative difference between a number of the file and one of the bench: files round.
const MAX_ROUNDING: f64 = 5e-3;

/// Minimum time between two frames that can be played [s].
const MIN_PERIOD_S: f64 = 1e-6;
/// Maximum time between two frames that can be played [s].
const MAX_PERIOD_S: f64 = 1e3;

/// A property that a hint may give.
struct Property {
    /// Name of the hint.
    hint: &'static str,
    /// What a message calls it.
    title: &'static str,
    /// What to write in the bench.
    help: &'static str,
}

const UNIT: Property = Property {
    hint: "unit",
    title: "the unit of its values",
    help: "add `unit = \"kPa\"` to the device in the bench, or `unit = \"raw\"` for plain counts (`tactflow features`: add `--unit kPa`)",
};

const PITCH: Property = Property {
    hint: "pitch_mm",
    title: "the pitch of its tactels",
    help: "add `pitch_mm = [5.0, 5.0]` to the device in the bench: the distance of neighbouring tactels along x and y [mm] \
           (`tactflow features`: add `--pitch-mm 5x5`)",
};

const RATE: Property = Property {
    hint: "rate_hz",
    title: "its frame rate",
    help: "add `rate_hz = 250` to the device in the bench: the frames per second (`tactflow features`: add `--rate-hz 250`)",
};

const SIZE: Property = Property {
    hint: "size",
    title: "its number of rows and columns",
    help: "add `size = [16, 16]` to the device in the bench: rows and columns (`tactflow features`: add `--size 16x16`)",
};

/// Defaults for callers to whom unit, pitch and rate do not matter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Assumed {
    /// Unit of the cells.
    pub unit: Unit,
    /// Distance between the centres of two neighbours along x and along y [m].
    pub pitch: [f64; 2],
    /// Frames per second [1/s].
    pub rate_hz: f64,
}

impl Hints {
    /// Returns unit, pitch [m] and nominal time between two frames [s], from those of the file and the hints.
    ///
    /// # Errors
    /// If neither the file nor a hint gives one of them, or both do and differ. One message lists all that is missing.
    pub fn complete(
        &self,
        unit: Option<Unit>,
        pitch: Option<[f64; 2]>,
        period: Option<f64>,
    ) -> Result<(Unit, [f64; 2], f64), Refusal> {
        let assumed = self.assumed;
        let units = [unit, self.unit, assumed.map(|assumed| assumed.unit)];
        let pitches = [pitch, self.pitch, assumed.map(|assumed| assumed.pitch)];
        let periods = [period, self.rate_hz.map(f64::recip), assumed.map(|assumed| assumed.rate_hz.recip())];
        let unit = UNIT.choose(units, |a, b| a == b, Unit::to_string)?;
        let pitch = PITCH.choose(pitches, |a, b| agree(a[0], b[0]) && agree(a[1], b[1]), show_pitch)?;
        let period = RATE.choose(periods, |a, b| agree(*a, *b), show_rate)?;
        if let Some(period) = period.filter(|period| !(MIN_PERIOD_S..=MAX_PERIOD_S).contains(period)) {
            let message = format!("a period of {period} s is not from {MIN_PERIOD_S} to {MAX_PERIOD_S} s");
            return Err(Refusal::broken(message));
        }
        if let (Some(unit), Some(pitch), Some(period)) = (unit, pitch, period) {
            return Ok((unit, pitch, period));
        }
        let are_missing = [(unit.is_none(), &UNIT), (pitch.is_none(), &PITCH), (period.is_none(), &RATE)];
        let missing = are_missing.into_iter().filter(|(is_missing, _)| *is_missing);
        Err(missing_properties(&missing.map(|(_, property)| property).collect::<Vec<_>>()))
    }

    /// Returns the number of rows and of columns; `found` is that of the file.
    ///
    /// # Errors
    /// If neither the file nor a hint gives it, or both do and differ.
    pub fn size(&self, found: Option<[usize; 2]>) -> Result<[usize; 2], Refusal> {
        let show = |[rows, cols]: &[usize; 2]| format!("{rows} rows by {cols} columns");
        let size = SIZE.choose([found, self.size, None], |a, b| a == b, show)?;
        size.ok_or_else(|| missing_properties(&[&SIZE]))
    }
}

impl Property {
    /// Returns the value of the file or that of the hint, which must not differ, or else the default.
    fn choose<T>(
        &self,
        [found, given, assumed]: [Option<T>; 3],
        same: impl Fn(&T, &T) -> bool,
        show: impl Fn(&T) -> String,
    ) -> Result<Option<T>, Refusal> {
        match (found, given) {
            (Some(found), Some(given)) if !same(&found, &given) => Err(Refusal::Contradicted {
                hint: self.hint,
                message: format!("the file has another value: {}", show(&found)),
            }),
            (found, given) => Ok(found.or(given).or(assumed)),
        }
    }
}

fn missing_properties(missing: &[&Property]) -> Refusal {
    let list = |text: fn(&Property) -> &'static str, separator| {
        missing.iter().map(|property| text(property)).collect::<Vec<_>>().join(separator)
    };
    Refusal::Silent {
        message: format!("the file does not give {}", list(|property| property.title, ", or ")),
        help: list(|property| property.help, "; "),
    }
}

fn agree(a: f64, b: f64) -> bool {
    (a - b).abs() <= MAX_ROUNDING * a.abs().max(b.abs())
}

fn show_pitch([x, y]: &[f64; 2]) -> String {
    let millimetres = |metres: &f64| (metres * 1e7).round() / 1e4;
    format!("[{}, {}] mm", millimetres(x), millimetres(y))
}

fn show_rate(period: &f64) -> String {
    format!("{} frames a second", (1e6 / period).round() / 1e6)
}
