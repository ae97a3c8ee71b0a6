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
}

/// Maximum relative difference between a number of the file and one of the bench: files round.
const MAX_ROUNDING: f64 = 5e-3;

/// Minimum time between two frames that can be played [s].
const MIN_PERIOD_S: f64 = 1e-6;
/// Maximum time between two frames that can be played [s].
const MAX_PERIOD_S: f64 = 1e3;

/// Start of a message about a missing property.
const MISSING: &str = "the file does not give ";

fn agree(a: f64, b: f64) -> bool {
    (a - b).abs() <= MAX_ROUNDING * a.abs().max(b.abs())
}

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
    /// Returns the unit; `found` is that of the file.
    ///
    /// # Errors
    /// If neither the file nor a hint gives it, or both do and differ.
    pub fn unit(&self, found: Option<Unit>) -> Result<Unit, Refusal> {
        let help = "set `unit` of the bench's device, as `unit = \"kPa\"`, or `unit = \"raw\"` for plain counts (`features`: `--unit kPa`)";
        let given = self.given(found.is_some(), self.unit, |assumed| assumed.unit);
        choose(found, given, "unit", help, |a, b| a == b, Unit::to_string)
    }

    /// Returns the pitch along x and along y [m]; `found` is that of the file.
    ///
    /// # Errors
    /// If neither the file nor a hint gives it, or both do and differ.
    pub fn pitch(&self, found: Option<[f64; 2]>) -> Result<[f64; 2], Refusal> {
        let help = "set `pitch_mm = [x, y]` of the bench's device: the distances between the centres of two tactels \
                    (`features`: `--pitch-mm 5x5`)";
        let same = |a: &[f64; 2], b: &[f64; 2]| agree(a[0], b[0]) && agree(a[1], b[1]);
        let show = |pitch: &[f64; 2]| format!("[{}, {}] mm", millimetres(pitch[0]), millimetres(pitch[1]));
        let given = self.given(found.is_some(), self.pitch, |assumed| assumed.pitch);
        choose(found, given, "pitch_mm", help, same, show)
    }

    /// Returns the nominal time between two frames [s]; `found` is that of the file.
    ///
    /// # Errors
    /// If neither the file nor a hint gives it, or both do and differ.
    pub fn period(&self, found: Option<f64>) -> Result<f64, Refusal> {
        let help =
            "set `rate_hz` of the bench's device: the frames per second of the recording (`features`: `--rate-hz 250`)";
        let given = self.given(found.is_some(), self.rate_hz, |assumed| assumed.rate_hz).map(|rate| 1.0 / rate);
        let show = |period: &f64| format!("{} frames a second", (1e6 / period).round() / 1e6);
        let period = choose(found, given, "rate_hz", help, |a, b| agree(*a, *b), show)?;
        if (MIN_PERIOD_S..=MAX_PERIOD_S).contains(&period) {
            Ok(period)
        } else {
            Err(Refusal::broken(format!("a period of {period} s is not from {MIN_PERIOD_S} to {MAX_PERIOD_S} s")))
        }
    }

    /// Returns unit, pitch and period together, so one message lists all that is missing.
    ///
    /// # Errors
    /// If neither the file nor a hint gives one of them, or both do and differ.
    pub fn complete(
        &self,
        unit: Option<Unit>,
        pitch: Option<[f64; 2]>,
        period: Option<f64>,
    ) -> Result<(Unit, [f64; 2], f64), Refusal> {
        let found = (self.unit(unit), self.pitch(pitch), self.period(period));
        let refusals = match found {
            (Ok(unit), Ok(pitch), Ok(period)) => return Ok((unit, pitch, period)),
            (unit, pitch, period) => [unit.err(), pitch.err(), period.err()],
        };
        let (mut missing, mut ways_out) = (Vec::new(), Vec::new());
        for refusal in refusals.into_iter().flatten() {
            match refusal {
                Refusal::Silent { message, help } => {
                    missing.push(message.trim_start_matches(MISSING).to_owned());
                    ways_out.push(help);
                }
                other => return Err(other),
            }
        }
        Err(Refusal::Silent { message: format!("{MISSING}{}", missing.join(", or ")), help: ways_out.join("; ") })
    }

    /// Returns the hint, or the default if the file gives nothing either.
    fn given<T>(&self, is_found: bool, hint: Option<T>, assumed: impl Fn(&Assumed) -> T) -> Option<T> {
        hint.or_else(|| self.assumed.as_ref().filter(|_| !is_found).map(assumed))
    }

    /// Returns the number of rows and of columns; `found` is that of the file.
    ///
    /// # Errors
    /// If neither the file nor a hint gives it, or both do and differ.
    pub fn size(&self, found: Option<[usize; 2]>) -> Result<[usize; 2], Refusal> {
        let help = "set `size = [rows, columns]` of the bench's device (`features`: `--size 16x16`)";
        choose(found, self.size, "size", help, |a, b| a == b, |[rows, cols]| format!("{rows} rows by {cols} columns"))
    }
}

fn millimetres(metres: f64) -> f64 {
    (metres * 1e7).round() / 1e4
}

fn choose<T>(
    found: Option<T>,
    given: Option<T>,
    hint: &'static str,
    help: &str,
    same: impl Fn(&T, &T) -> bool,
    show: impl Fn(&T) -> String,
) -> Result<T, Refusal> {
    match (found, given) {
        (Some(found), Some(given)) if !same(&found, &given) => {
            Err(Refusal::Contradicted { hint, message: format!("the file has another value: {}", show(&found)) })
        }
        (Some(value), _) | (None, Some(value)) => Ok(value),
        (None, None) => {
            let what = match hint {
                "pitch_mm" => "the pitch of its tactels",
                "rate_hz" => "its frame rate",
                "size" => "its number of rows and columns",
                _ => "the unit of its values",
            };
            Err(Refusal::Silent { message: format!("{MISSING}{what}"), help: help.into() })
        }
    }
}
