//! What a bench says of a recording where the file is silent.

use tactflow_runtime::signal::Unit;

use super::Refusal;

/// What is known from elsewhere. What the file says as well must agree.
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
    /// What is taken where neither the file nor a hint says it; nothing unless it does not matter.
    pub assumed: Option<Assumed>,
    /// Name of the pad, where a file has several.
    pub pad: Option<String>,
}

/// How far a number of the file and one of the bench may be apart, as a part of them: files round.
const ROUNDING: f64 = 5e-3;

/// The shortest and the longest time between two frames that can be played [s].
const SHORTEST: f64 = 1e-6;
const LONGEST: f64 = 1e3;

/// How a message about something missing begins.
const SILENT: &str = "the file does not say ";

fn agree(a: f64, b: f64) -> bool {
    (a - b).abs() <= ROUNDING * a.abs().max(b.abs())
}

/// What is taken where nobody says it, by those to whom it does not matter.
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
    /// The unit, from what the file says of it.
    ///
    /// # Errors
    /// When nobody says it, or they differ.
    pub fn unit(&self, said: Option<Unit>) -> Result<Unit, Refusal> {
        let help = "give the bench's device a `unit`, as `unit = \"kPa\"`, or `unit = \"raw\"` for plain counts (`features`: `--unit kPa`)";
        let given = self.given(said.is_some(), self.unit, |assumed| assumed.unit);
        choose(said, given, "unit", help, |a, b| a == b, Unit::to_string)
    }

    /// The pitch along x and along y [m], from what the file says of it.
    ///
    /// # Errors
    /// When nobody says it, or they differ.
    pub fn pitch(&self, said: Option<[f64; 2]>) -> Result<[f64; 2], Refusal> {
        let help = "give the bench's device a `pitch_mm = [x, y]`: the distances between the centres of two neighbours \
                    (`features`: `--pitch-mm 5x5`)";
        let same = |a: &[f64; 2], b: &[f64; 2]| agree(a[0], b[0]) && agree(a[1], b[1]);
        let show = |pitch: &[f64; 2]| format!("[{}, {}] mm", millimetres(pitch[0]), millimetres(pitch[1]));
        let given = self.given(said.is_some(), self.pitch, |assumed| assumed.pitch);
        choose(said, given, "pitch_mm", help, same, show)
    }

    /// The nominal time between two frames [s], from what the file says of it.
    ///
    /// # Errors
    /// When nobody says it, or they differ.
    pub fn period(&self, said: Option<f64>) -> Result<f64, Refusal> {
        let help =
            "give the bench's device a `rate_hz`: the frames per second of the recording (`features`: `--rate-hz 250`)";
        let given = self.given(said.is_some(), self.rate_hz, |assumed| assumed.rate_hz).map(|rate| 1.0 / rate);
        let show = |period: &f64| format!("{} frames a second", (1e6 / period).round() / 1e6);
        let period = choose(said, given, "rate_hz", help, |a, b| agree(*a, *b), show)?;
        if (SHORTEST..=LONGEST).contains(&period) {
            Ok(period)
        } else {
            Err(Refusal::broken(format!("a frame each {period} s is none that can be played")))
        }
    }

    /// Unit, pitch and period together, so that all that is missing is said at once.
    ///
    /// # Errors
    /// When nobody says one of them, or they differ.
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
                    missing.push(message.trim_start_matches(SILENT).to_owned());
                    ways_out.push(help);
                }
                other => return Err(other),
            }
        }
        Err(Refusal::Silent { message: format!("{SILENT}{}", missing.join(", or ")), help: ways_out.join("; ") })
    }

    /// What is known from elsewhere, and where nobody says anything, what is assumed.
    fn given<T>(&self, is_said: bool, hint: Option<T>, assumed: impl Fn(&Assumed) -> T) -> Option<T> {
        hint.or_else(|| self.assumed.as_ref().filter(|_| !is_said).map(assumed))
    }

    /// The number of rows and of columns, from what the file says of it.
    ///
    /// # Errors
    /// When nobody says it, or they differ.
    pub fn size(&self, said: Option<[usize; 2]>) -> Result<[usize; 2], Refusal> {
        let help = "give the bench's device its `size = [rows, columns]` (`features`: `--size 16x16`)";
        choose(said, self.size, "size", help, |a, b| a == b, |[rows, cols]| format!("{rows} rows by {cols} columns"))
    }
}

fn millimetres(metres: f64) -> f64 {
    (metres * 1e7).round() / 1e4
}

fn choose<T>(
    said: Option<T>,
    given: Option<T>,
    hint: &'static str,
    help: &str,
    same: impl Fn(&T, &T) -> bool,
    show: impl Fn(&T) -> String,
) -> Result<T, Refusal> {
    match (said, given) {
        (Some(said), Some(given)) if !same(&said, &given) => {
            Err(Refusal::Contradicted { hint, message: format!("the file says otherwise: {}", show(&said)) })
        }
        (Some(value), _) | (None, Some(value)) => Ok(value),
        (None, None) => {
            let what = match hint {
                "pitch_mm" => "the pitch of its tactels",
                "rate_hz" => "how fast its frames came",
                "size" => "how many rows and columns it has",
                _ => "the unit of its values",
            };
            Err(Refusal::Silent { message: format!("{SILENT}{what}"), help: help.into() })
        }
    }
}
