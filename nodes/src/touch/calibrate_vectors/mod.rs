//! `calibrate_vectors`: from the readings of a pad with three axes to forces.
//!
//! The frames at rest are two halves of h1 and h2 frames. Let m1 and m2 be the means of a value in the halves, and v the
//! median of the variances of all values of its axis. The zero is (m1 + m2) / 2. The value is steady if |m2 - m1| is at most
//! 6 sqrt(v / h1 + v / h2).

use tactflow_runtime::node::{
    Describe, In, Inputs, Limits, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick, refuse_any,
};
use tactflow_runtime::signal::{Flag, ImageShape, Unit, VectorImage, VectorImageShape};

use super::common::halves::{FREE, Halves, upper_median};

/// Converts the readings of a pad with three axes to forces [N]: `force = gain (value - zero)`, along x, y and z.
///
/// **At rest.** The first `rest_frames` frames show the zero of each axis of each tactel, while nothing may touch the pad.
/// Until they are over, the output is absent. The frames are repeated once if a value is not steady, or if more than one in
/// fifty values of an axis never change while others do: such an axis is dead, and would hide a force. The second failure
/// ends the task, and the fault names the tactel. With `may_repeat`, values that never change are accepted.
///
/// A touch that does not change cannot be seen: wire the image of the pad to `calibrate`, whose self-test compares the zeros
/// with those of the calibration.
///
/// The operator takes the zeros anew with the word `tare`, while the task is halted. It is refused while a reading is off
/// its zero by more than eight times the noise. The zeros outlast an absence, and a pad that was lost and comes back: it
/// may be in contact.
///
/// ```toml
/// [nodes.calibrate_vectors]
/// type = "calibrate_vectors"
/// in.vectors = "pad.vectors"
/// gain = { from = "pad.vector_gain" } # [N per raw, along x, y and z]
/// rest_frames = 20                    # 80 ms of a pad with 250 frames per second
/// ```
#[derive(Describe)]
pub struct CalibrateVectors {
    params: Params,
    shape: ImageShape,
}

/// Parameters of `calibrate_vectors`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Force per reading along x, y and z; a negative number turns an axis around.
    #[param(unit = "N/U")]
    gain: [f64; 3],
    /// Number of frames at rest, at least 16; 0 if the zeros are 0.
    #[param(range = 0..=1_000_000, default = 40)]
    rest_frames: usize,
    /// Whether sound values may never change at rest, as in a pad without noise.
    #[param(default = false)]
    may_repeat: bool,
}

/// What `calibrate_vectors` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The vector image as measured.
    #[port(unit = "U", frame = "A", quantity = "three_axis_image")]
    vectors: Option<In<'a, VectorImage>>,
}

/// What `calibrate_vectors` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The force on each tactel.
    #[port(unit = "N", frame = "A", quantity = "three_axis_image")]
    vectors: Out<VectorImage>,
    /// Whether the pad did not rest; absent before the end of the frames at rest.
    failed: Out<Flag>,
}

/// What `calibrate_vectors` remembers.
#[derive(State)]
pub struct State {
    rest: Rest,
    /// The zero of each axis of each tactel [unit of the input].
    zeros: Vec<f32>,
    /// Noise of an axis at rest, as the rms over all tactels and axes [unit of the input].
    noise: f64,
}

/// Where the frames at rest are.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
enum Phase {
    Resting {
        frames: usize,
        is_second: bool,
    },
    #[default]
    Passed,
    Failed(Flaw),
}

/// Why a pad does not rest: a value, by its index among the values of all tactels.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Flaw {
    /// It is not steady.
    Unsteady(usize),
    /// It never changes, and so do too many of its axis.
    Dead(usize),
}

/// The frames at rest.
#[derive(Debug, State)]
struct Rest {
    phase: Phase,
    /// First reading of each axis.
    first: Vec<f32>,
    /// For each axis and each half: the sum and the sum of squares, of the difference from the first reading.
    sums: Vec<[[f64; 2]; 2]>,
    /// Variances of one axis, for their median.
    sorted: Vec<f64>,
}

/// One in so many values of an axis may be dead.
const DEAD_FRACTION: usize = 50;
/// Smallest number of frames at rest, if there are any.
const MIN_FRAMES: usize = 16;

impl Node for CalibrateVectors {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    const LIMITS: Limits = Limits { fails: Some("failed"), ..Limits::NONE };

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let vectors = setup.inputs.vectors.clone();
        let VectorImageShape(shape) = vectors.expect("the check of a graph reports an input without a wire");
        let mut mistakes = Mistakes::new();
        if params.gain.contains(&0.0) {
            mistakes.push(Mistake::param("gain", "an axis with a gain of 0 measures nothing"));
        }
        if (1..MIN_FRAMES).contains(&params.rest_frames) {
            let message = format!("{} frames are too few to see whether the pad rests", params.rest_frames);
            let mistake = Mistake::param("rest_frames", message);
            mistakes.push(mistake.help(format!("at least {MIN_FRAMES} frames, or 0 if the zeros are 0")));
        }
        refuse_any(mistakes)?;
        setup.outputs.vectors = VectorImageShape(ImageShape { unit: Unit::NEWTON, ..shape.clone() });
        Ok(Self { params, shape })
    }

    fn state(&self) -> State {
        let values = 3 * self.shape.tactels();
        let phase = if self.params.rest_frames == 0 { Phase::Passed } else { Phase::FIRST };
        let sorted = Vec::with_capacity(self.shape.tactels());
        let rest = Rest { phase, first: vec![0.0; values], sums: vec![[[0.0; 2]; 2]; values], sorted };
        State { rest, zeros: vec![0.0; values], noise: 0.0 }
    }

    fn found(&self, state: &State) -> Option<String> {
        match state.rest.phase {
            Phase::Failed(flaw) => Some(self.describe(flaw)),
            Phase::Passed if self.params.rest_frames > 0 => {
                Some(format!("the pad rested with a noise of {:.3} {} along an axis", state.noise, self.shape.unit))
            }
            _ => None,
        }
    }

    fn can_tare(&self, inputs: Inputs<'_>, state: &State) -> Option<Result<(), String>> {
        (self.params.rest_frames > 0).then(|| self.is_free(&inputs, state))
    }

    fn tare(&self, state: &mut State) {
        state.rest.phase = Phase::FIRST;
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        out.failed.keep();
        // The zeros outlast an absence: a pad that is in contact cannot rest again.
        let Some(vectors) = inputs.vectors else { return };
        let values = vectors.cells().as_flattened();
        if matches!(state.rest.phase, Phase::Resting { .. }) && vectors.is_new() {
            self.rest(values, state);
            match state.rest.phase {
                Phase::Resting { .. } => {}
                Phase::Passed => out.failed.set(false),
                Phase::Failed(_) => out.failed.set(true),
            }
        }
        if state.rest.phase != Phase::Passed {
            return;
        }
        if !vectors.is_new() {
            return out.vectors.keep();
        }
        let forces = out.vectors.write().cells_mut().as_flattened_mut();
        let gain = self.params.gain.map(|gain| gain as f32);
        for (i, ((force, value), zero)) in forces.iter_mut().zip(values).zip(&state.zeros).enumerate() {
            *force = gain[i % 3] * (value - zero);
        }
    }
}

impl Phase {
    const FIRST: Self = Self::Resting { frames: 0, is_second: false };
}

impl CalibrateVectors {
    /// Adds a frame at rest, and judges them all after the last one.
    #[cold]
    fn rest(&self, values: &[f32], state: &mut State) {
        let State { rest, zeros, noise } = state;
        let Phase::Resting { frames, is_second } = rest.phase else { return };
        if frames == 0 {
            rest.first.copy_from_slice(values);
            rest.sums.fill([[0.0; 2]; 2]);
        }
        let half = self.halves().half(frames);
        for ((sums, value), first) in rest.sums.iter_mut().zip(values).zip(&rest.first) {
            let difference = f64::from(value - first);
            sums[half][0] += difference;
            sums[half][1] += difference * difference;
        }
        if frames + 1 < self.params.rest_frames {
            rest.phase = Phase::Resting { frames: frames + 1, is_second };
            return;
        }
        rest.phase = match self.flaw(rest) {
            None => Phase::Passed,
            Some(_) if !is_second => Phase::Resting { frames: 0, is_second: true },
            Some(flaw) => Phase::Failed(flaw),
        };
        if rest.phase == Phase::Passed {
            let mut variance = 0.0;
            for ((zero, first), sums) in zeros.iter_mut().zip(&rest.first).zip(&rest.sums) {
                let [[m1, v1], [m2, v2]] = self.judged(sums);
                *zero = (f64::from(*first) + 0.5 * (m1 + m2)) as f32;
                variance += 0.5 * (v1 + v2);
            }
            *noise = (variance / zeros.len() as f64).sqrt();
        }
    }

    /// Returns the mean and the variance of a value in both halves.
    fn judged(&self, sums: &[[f64; 2]; 2]) -> [[f64; 2]; 2] {
        let Halves(frames) = self.halves();
        [0, 1].map(|half| {
            let count = frames[half] as f64;
            let mean = sums[half][0] / count;
            [mean, (sums[half][1] / count - mean * mean).max(0.0)]
        })
    }

    /// Returns what is wrong with the frames at rest.
    fn flaw(&self, rest: &mut Rest) -> Option<Flaw> {
        let variance = |sums: &[[f64; 2]; 2]| self.judged(sums).iter().map(|[_, v]| 0.5 * v).sum::<f64>();
        let medians: [f64; 3] = std::array::from_fn(|axis| {
            rest.sorted.clear();
            rest.sorted.extend(rest.sums.iter().skip(axis).step_by(3).map(variance));
            upper_median(&mut rest.sorted)
        });
        let most = medians.map(|median| self.halves().largest_drift(median));
        let is_unsteady = |(i, sums): (usize, &[[f64; 2]; 2])| {
            let [[m1, _], [m2, _]] = self.judged(sums);
            (m2 - m1).abs() > most[i % 3]
        };
        if let Some(value) = rest.sums.iter().enumerate().position(is_unsteady) {
            return Some(Flaw::Unsteady(value));
        }
        // In a pad that mostly repeats its readings, one that repeats them may be sound.
        if self.params.may_repeat || medians == [0.0; 3] {
            return None;
        }
        let is_constant = |sums: &[[f64; 2]; 2]| *sums == [[0.0; 2]; 2];
        (0..3).find_map(|axis| {
            let constant = || (axis..rest.sums.len()).step_by(3).filter(|i| is_constant(&rest.sums[*i]));
            (constant().count() > self.shape.tactels().div_ceil(DEAD_FRACTION))
                .then(|| constant().next().map(Flaw::Dead))?
        })
    }

    /// Describes why the pad does not rest.
    fn describe(&self, flaw: Flaw) -> String {
        let frames = self.params.rest_frames;
        let place = |value: usize| {
            let (tactel, axis) = (value / 3, ["x", "y", "z"][value % 3]);
            format!("{axis} of row {}, column {}", tactel / self.shape.cols, tactel % self.shape.cols)
        };
        match flaw {
            Flaw::Unsteady(value) => format!(
                "the pad did not rest: {} changed within {frames} frames; start again while nothing touches the pad",
                place(value)
            ),
            Flaw::Dead(value) => format!(
                "an axis is dead: {} and others of this axis never changed in {frames} frames; mend the pad, or write \
                 `may_repeat = true` if it has no noise at rest",
                place(value)
            ),
        }
    }

    /// Returns the halves of the rest.
    const fn halves(&self) -> Halves {
        Halves::of(self.params.rest_frames)
    }

    /// Checks that nothing touches the pad: no reading is off its zero by more than noise.
    fn is_free(&self, inputs: &Inputs<'_>, state: &State) -> Result<(), String> {
        if state.rest.phase != Phase::Passed {
            return Err("the frames at rest are not over".into());
        }
        let vectors = inputs.vectors.as_ref().ok_or("the pad sends no vector image")?;
        let values = vectors.cells().as_flattened();
        let off = values.iter().zip(&state.zeros).map(|(value, zero)| f64::from(value - zero).abs());
        let (most, near) = (off.fold(0.0, f64::max), FREE * state.noise);
        if most <= near {
            return Ok(());
        }
        let unit = self.shape.unit;
        Err(format!(
            "something touches the pad, or its zero has drifted too far: an axis is off by {most:.1} {unit}, and {near:.1} \
             {unit} is allowed; free the pad, or start the run again"
        ))
    }
}

#[cfg(test)]
mod tests;
