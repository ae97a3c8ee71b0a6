//! The frames of a simulator: their order, and whether their times can be right.

use super::message::{self, Hello, Obs};

/// Longest time between two frames [s]. The clock of a simulator that is further ahead has been set.
const MAX_GAP: f64 = 60.0;
/// Number of frames in a row after which a wrong time is no accident.
const WRONG_FRAMES: u32 = 5;
/// Bounds of the time between two frames, as a multiple of `dt`, beyond which it is wrong.
const RATIOS: std::ops::RangeInclusive<f64> = 0.2..=5.0;

/// Reads frames and compares each with those before it.
#[derive(Debug)]
pub(super) struct Frames {
    pub(super) hello: Hello,
    /// Number and time [s] of the last frame.
    pub(super) newest: Option<(u64, f64)>,
    /// Number of frames in a row whose time is wrong.
    wrong: u32,
    /// Whether any time has been right.
    has_been_right: bool,
}

impl Frames {
    pub(super) const fn new(hello: Hello) -> Self {
        Self { hello, newest: None, wrong: 0, has_been_right: false }
    }

    /// Returns the nominal time between two frames [ns].
    pub(super) fn period(&self) -> i64 {
        ((self.hello.dt * 1e9).round() as i64).max(1)
    }

    /// Reads a frame from the line with a number. Returns `None` at the end of the run.
    ///
    /// # Errors
    /// What is wrong, with its line and its field.
    pub(super) fn read(&mut self, line: &str, number: u64) -> Result<Option<Obs>, String> {
        let frame = message::message(line, &self.hello).map_err(|why| format!("line {number}: {why}"))?;
        let Some(obs) = frame else { return Ok(None) };
        self.check(&obs).map_err(|why| format!("line {number}: obs {}: {why}", obs.seq))?;
        self.newest = Some((obs.seq, obs.t));
        Ok(Some(obs))
    }

    fn check(&mut self, obs: &Obs) -> Result<(), String> {
        let Some((seq, t)) = self.newest else { return Ok(()) };
        if obs.seq <= seq {
            return Err(format!(
                "`seq` is {} after a frame with {seq}, but it must increase with every frame",
                obs.seq
            ));
        }
        if obs.t < t {
            return Err(format!("`t` is {} s after a frame at {t} s: the time must not go back", obs.t));
        }
        let (grows, dt) = ((obs.t - t) / (obs.seq - seq) as f64, self.hello.dt);
        let ratio = grows / dt;
        let unit = unit_of(ratio);
        if obs.t - t > MAX_GAP && (unit.is_none() || self.has_been_right) {
            return Err(format!("`t` jumps from {t} s to {} s: the clock of a run must not be set", obs.t));
        }
        let is_right = RATIOS.contains(&ratio);
        self.wrong = if is_right { 0 } else { self.wrong + 1 };
        self.has_been_right |= is_right;
        if self.wrong < WRONG_FRAMES {
            return Ok(());
        }
        let why = format!("`t` grows by {grows} s with each frame, but `dt` is {dt} s");
        Err(match unit {
            Some(unit) => format!("{why}: it seems to be in {unit}, and must be in seconds"),
            None => format!("{why}: `dt` must be the time between two frames in the simulator's clock"),
        })
    }
}

/// Returns the unit of times that are this many times too large, or `None` if no unit explains that.
fn unit_of(ratio: f64) -> Option<&'static str> {
    let units = [(1e3, "milliseconds"), (1e6, "microseconds"), (1e9, "nanoseconds")];
    units.into_iter().find(|(size, _)| (0.5..=2.0).contains(&(ratio / size))).map(|(_, unit)| unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads frames at `times` [s], numbered from 1, with a `dt` of 10 ms. Returns the number of the frame that is
    /// refused, and why.
    fn read(times: impl IntoIterator<Item = f64>) -> Option<(u64, String)> {
        let hello = r#"{"type":"hello","proto":1,"dt":0.01,"lockstep":true,"task":"","joints":["a"],"q_min":[-1],"q_max":[1],
            "dq_max":[1],"urdf":"a","tip":"b","T_es":[1,0,0,0,0,1,0,0,0,0,1,0,0,0,0,1],"rows":1,"cols":1,"pitch":0.005,
            "counts_per_unit":1,"newton_per_unit":1,"threshold_units":1}"#;
        let mut frames = Frames::new(message::hello(hello).unwrap());
        (1..).zip(times).find_map(|(seq, t)| {
            let line = format!(r#"{{"type":"obs","seq":{seq},"t":{t},"q":[0],"dq":[0],"q_eq":[0],"img":[0]}}"#);
            frames.read(&line, seq).err().map(|why| (seq, why))
        })
    }

    #[test]
    fn times_that_cannot_be_right_are_named_as_what_they_are() {
        let by = |step: f64| (0..100).map(move |i| f64::from(i) * step);
        for (times, frame, why) in [
            (
                by(10.0).collect::<Vec<_>>(),
                6,
                "grows by 10 s with each frame, but `dt` is 0.01 s: it seems to be in milliseconds",
            ),
            (by(10_000.0).collect(), 6, "in microseconds"),
            (by(0.001).collect(), 6, "grows by 0.001 s with each frame, but `dt` is 0.01 s: `dt` must be"),
            (vec![0.0; 100], 6, "grows by 0 s"),
            (vec![0.0, 0.01, 1e9, 1e9 + 0.01], 3, "`t` jumps from 0.01 s to 1000000000 s"),
            (vec![0.0, 0.01, 0.0], 3, "the time must not go back"),
        ] {
            let (at, said) = read(times).unwrap();
            assert!(said.contains(why), "{said}");
            assert_eq!(at, frame, "{said}");
        }
        // Jitter, drift, a pause and a clock that starts anywhere are usual.
        let unusual =
            (0..100).map(|i| 1.7e9 + f64::from(i) * 0.0105 + if i > 50 { 3.0 } else { 0.0 } + f64::from(i % 3) * 0.004);
        assert_eq!(read(unusual), None);
    }
}
