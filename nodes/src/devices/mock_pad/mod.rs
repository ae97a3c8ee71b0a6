//! `mock_pad`: a simulated pad with scripted presses and faults.
//!
//! The samples of a press at the tactels are scaled so that they sum to its force over an infinite array. So the sum is
//! exact while the press is on the pad, and falls smoothly to zero as it slides off.

mod glitch;
mod press;

use tactflow_runtime::device::{Commands, Description, Device, DeviceError, Driver, Opened, Output, Samples, Stepped};
use tactflow_runtime::node::{Describe, Mistake, Mistakes, Param, refuse_any};
use tactflow_runtime::signal::{Image, ImageShape, Unit, VectorImage};

use super::{nanos, pad, period_of};
use crate::arm::mount::Mount;

pub use glitch::{Glitch, GlitchKind};
pub use press::Press;

/// Parameters of `mock_pad`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Number of rows.
    #[param(range = 1..=1_000_000, default = 16)]
    rows: usize,
    /// Number of columns.
    #[param(range = 1..=1_000_000, default = 16)]
    cols: usize,
    /// Distance between the centres of neighbouring tactels, along x and along y.
    #[param(unit = "m", above = 0.0, default = 0.005)]
    pitch: f64,
    /// Unit of a tactel's value.
    #[param(default = Unit::NEWTON)]
    unit: Unit,
    /// Frames per second.
    #[param(unit = "1/s", range = 0.001..=1e6, default = 250.0)]
    rate_hz: f64,
    /// Duration of the frames; unlimited if not given.
    #[param(unit = "s", above = 0.0)]
    for_s: Option<f64>,
    /// Presses on the pad.
    #[param(default = vec![])]
    press: Vec<Press>,
    /// Faults of the pad.
    #[param(default = vec![])]
    glitch: Vec<Glitch>,
    /// Noise threshold that the pad states as a fact.
    #[param(unit = "$unit", range = 0.0.., default = 0.015)]
    threshold: f64,
    /// Unit of pressure that the pad states as a fact, per tactel: p = 1 in the paper.
    #[param(unit = "$unit", above = 0.0, default = 0.1)]
    pressure: f64,
    /// Pose of the pad on the tip of its arm, stated as a fact.
    #[param(default = Mount::NONE)]
    mount: Mount,
}

/// Maximum number of tactels of a pad.
const MAX_TACTELS: usize = 1 << 22;

/// A simulated pad with scripted presses of points and bars, and with scripted faults.
///
/// Each `press` is a smooth bump of force, (1 - d²/r²)² at distance d from a point or a bar. It appears, moves and
/// disappears on a schedule. Its tactels sum to its `force` while it is on the pad, and it slides off smoothly. If a press
/// has a `drag`, the pad has three axes, and the drag is spread as the force. Foam,
/// noise and hysteresis are not simulated: use the pad to try out a graph and for tests whose result is known, not to
/// tune gains.
///
/// A `glitch` is a fault that lasts for a while: `repeat` repeats the last frame, `freeze` repeats it as if it were
/// new, `silence` gives no frame, `nan` makes one tactel not a number, `back` gives stamps that lie in the past. With
/// `unplug` the device fails, and it stays failed also after `for_s`. Try a graph with each of them.
///
/// It states the facts `dead` (no tactel is), `threshold`, `pressure`, `calibration` (its values are forces already)
/// and `mount`; with three axes also `vector_gain`, which is 1.
///
/// ```toml
/// [roles]
/// pad = "three_axis_pad"              # or "tactile_pad", for a press without a drag
///
/// [bind]
/// pad = "pad"
///
/// [devices.pad]
/// type = "mock_pad"                   # 16 by 16 tactels, 5 mm apart, in N, 250 frames a second
/// for_s = 4.0                         # [s]
/// press = [
///     { from_s = 0.5, to_s = 3.5, at = [-0.010, 0.005], speed = [0.004, 0.0], force = 4.0, drag = [0.6, 0.0] },   # [s, s, m, m/s, N, N]
/// ]
/// ```
#[derive(Debug, Describe)]
pub struct MockPad {
    image: Output<Image>,
    /// The vector image of a pad with three axes.
    vectors: Option<Output<VectorImage>>,
    /// The newest image.
    cells: Vec<f32>,
    /// The newest vector image; empty for a pad with one axis.
    vector_cells: Vec<[f32; 3]>,
    shape: ImageShape,
    presses: Vec<Press>,
    glitches: Vec<Glitch>,
    period: i64,
    frames: i64,
    next: i64,
    served: Option<i64>,
}

/// A frame to serve.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Due {
    /// Frame whose values it has.
    frame: i64,
    stamp: i64,
    sequence: u64,
    is_nan: bool,
}

impl Device for MockPad {
    type Params = Params;

    fn open(params: Params) -> Result<Opened, Mistakes> {
        let mut mistakes = Mistakes::new();
        if params.rows * params.cols > MAX_TACTELS {
            let message = format!("{} by {} tactels are more than {MAX_TACTELS}", params.rows, params.cols);
            mistakes.push(Mistake::param("rows", message));
        }
        let wrong = params.press.iter().filter_map(|press| press.mistake(params.pitch));
        mistakes.extend(wrong.map(|message| Mistake::param("press", message)));
        let period = period_of(params.rate_hz);
        refuse_any(mistakes)?;
        let shape = ImageShape { rows: params.rows, cols: params.cols, pitch: [params.pitch; 2], unit: params.unit };
        let mut description = Description::every(period as f64 * 1e-9);
        // The values are forces already.
        let calibration = toml::Table::from_iter([("gain".to_owned(), 1.0.into())]);
        let mut facts = pad::facts(params.threshold, params.pressure, params.unit, calibration);
        facts.push(pad::mount(&params.mount));
        let (image, vectors) = if params.press.iter().any(Press::has_drag) {
            facts.push(("vector_gain".into(), vec![1.0; 3].into()));
            let (image, vectors) = pad::fill_three_axes(description.fills(pad::THREE_AXES), shape.clone(), facts);
            (image, Some(vectors))
        } else {
            (pad::fill(description.fills(pad::ROLE), shape.clone(), facts), None)
        };
        let vector_cells = vec![[0.0; 3]; if vectors.is_some() { shape.tactels() } else { 0 }];
        let pad = Self { vectors, vector_cells, ..Self::new(image, shape, period, params) };
        Ok(Opened { description, driver: Driver::Stepped(Box::new(pad)) })
    }
}

/// Returns the first frame at a `time` or later [ns].
fn frame_from(time: i64, period: i64) -> i64 {
    time / period + i64::from(time % period != 0)
}

impl MockPad {
    fn new(image: Output<Image>, shape: ImageShape, period: i64, params: Params) -> Self {
        let frames = frame_from(params.for_s.map_or(i64::MAX, nanos), period);
        let mut pad = Self {
            image,
            vectors: None,
            cells: vec![0.0; shape.tactels()],
            vector_cells: Vec::new(),
            shape,
            presses: params.press,
            glitches: params.glitch,
            period,
            frames,
            next: 0,
            served: None,
        };
        pad.next = pad.after_silence(0);
        pad
    }

    fn glitch(&self, frame: i64) -> Option<&Glitch> {
        let time = frame.saturating_mul(self.period);
        self.glitches.iter().find(|glitch| glitch.time().contains(&time))
    }

    fn silence(&self, frame: i64) -> Option<&Glitch> {
        self.glitch(frame).filter(|glitch| glitch.kind == GlitchKind::Silence)
    }

    /// Returns the first frame from `frame` on that is not in a silence.
    fn after_silence(&self, mut frame: i64) -> i64 {
        while let Some(silence) = self.silence(frame).filter(|_| frame < self.frames) {
            frame = frame_from(silence.time().end, self.period).max(frame + 1);
        }
        frame
    }

    /// Returns the newest frame up to `now` [ns] that was not served yet, or `None`. It skips the frames before that
    /// one.
    fn due(&mut self, now: i64) -> Option<Due> {
        if now < 0 {
            return None;
        }
        let mut frame = (now / self.period).min(self.frames - 1);
        while let Some(silence) = self.silence(frame).filter(|_| frame >= self.next) {
            frame = ((silence.time().start - 1).div_euclid(self.period)).min(frame - 1);
        }
        if frame < self.next {
            return None;
        }
        self.next = self.after_silence(frame + 1);
        let time = frame * self.period;
        let plain = |frame: i64| Due { frame, stamp: frame * self.period, sequence: frame as u64 + 1, is_nan: false };
        match self.glitch(frame).map(|glitch| (glitch.kind, glitch.time().start)) {
            // The last frame once more. Before the first frame there is nothing to repeat.
            Some((GlitchKind::Repeat, _)) => self.served.map(plain),
            // A stuck sensor. Before the first frame it is stuck with this one.
            Some((GlitchKind::Freeze, _)) => {
                let stuck = *self.served.get_or_insert(frame);
                Some(Due { frame: stuck, ..plain(frame) })
            }
            Some((GlitchKind::Nan, _)) => Some(Due { is_nan: true, ..plain(frame) }),
            // The clock runs back from the start of the glitch, so every stamp lies before the last good one.
            Some((GlitchKind::Back, start)) => {
                Some(Due { stamp: start - (time - start) - 2 * self.period, ..plain(frame) })
            }
            // An unplugged pad has failed in `exchange` before this.
            Some((GlitchKind::Silence | GlitchKind::Unplug, _)) | None => {
                self.served = Some(frame);
                Some(plain(frame))
            }
        }
    }

    fn render(&mut self, due: Due) {
        let Self { cells, vector_cells, .. } = self;
        cells.fill(0.0);
        vector_cells.fill([0.0; 3]);
        let seconds = (due.frame * self.period) as f64 * 1e-9;
        for press in &self.presses {
            press.add(&self.shape, seconds, cells, vector_cells);
        }
        let middle = cells.len() / 2;
        if due.is_nan {
            cells[middle] = f32::NAN;
            vector_cells.get_mut(middle).into_iter().for_each(|cell| cell[2] = f32::NAN);
        }
    }
}

impl Stepped for MockPad {
    fn next(&self) -> Option<i64> {
        (self.next < self.frames).then(|| self.next.saturating_mul(self.period))
    }

    fn end(&self) -> Option<i64> {
        (self.frames < i64::MAX / self.period).then(|| (self.frames - 1) * self.period)
    }

    fn exchange(&mut self, now: i64, _: &Commands, samples: &mut Samples) -> Result<(), DeviceError> {
        if self.glitches.iter().any(|glitch| glitch.kind == GlitchKind::Unplug && now >= glitch.time().start) {
            return Err(DeviceError("a `glitch` with `unplug` disconnected it".into()));
        }
        if let Some(due) = self.due(now) {
            self.render(due);
            samples.write(self.image, due.stamp, due.sequence).cells_mut().copy_from_slice(&self.cells);
            if let Some(vectors) = self.vectors {
                samples.write(vectors, due.stamp, due.sequence).cells_mut().copy_from_slice(&self.vector_cells);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
