//! When the zero is taken anew, and from which frames.
//!
//! Whether a frame shows a contact is known only after it has gone down the graph, so each frame of the window is judged
//! when the next one comes, the last one too: the zero changes with the frame after the window.

use tactflow_runtime::node::{At, Mistake, Mistakes};
use tactflow_runtime::source::Code;

use super::lines::Lines;
use super::{InputShapes, Inputs, Params, State};

/// When the zero is taken anew.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Rules {
    window: usize,
    bound: f32,
    is_at_start: bool,
    /// Whether a wire says if something touches the pad.
    is_watched: bool,
}

/// The frames of a new zero so far.
#[derive(Debug, Default)]
pub struct Averages {
    /// Sum of each tactel's readings; empty where nothing ever tares.
    sums: Vec<f64>,
    /// Number of frames in the sums, while a zero is being taken.
    frames: Option<usize>,
    /// Whether the command has been seen.
    was_asked: bool,
}

impl Clone for Averages {
    fn clone(&self) -> Self {
        Self { sums: self.sums.clone(), ..*self }
    }

    fn clone_from(&mut self, from: &Self) {
        self.sums.clone_from(&from.sums);
        (self.frames, self.was_asked) = (from.frames, from.was_asked);
    }
}

impl Averages {
    fn begin(&mut self) {
        self.sums.fill(0.0);
        self.frames = Some(0);
    }

    fn add(&mut self, cells: &[f32]) {
        if let Some(frames) = &mut self.frames {
            *frames += 1;
            self.sums.iter_mut().zip(cells).for_each(|(sum, cell)| *sum += f64::from(*cell));
        }
    }
}

impl Rules {
    /// The rules, if anything tares; it is a mistake if nothing says whether the pad is unloaded.
    pub(super) fn new(params: &Params, inputs: &InputShapes<'_>, mistakes: &mut Mistakes) -> Option<Self> {
        let is_at_start = params.tare_at_start;
        if inputs.tare.is_none() && !is_at_start {
            return None;
        }
        let is_watched = inputs.present.is_some();
        if !is_watched && params.tare_bound.is_none() {
            let at = if is_at_start { At::Param("tare_at_start".into()) } else { At::Input("tare".into()) };
            let message = "a pad is tared while nothing touches it, and nothing here says whether something does";
            let help = "wire `in.present` to the `present` of the `label` behind, or give a `tare_bound`";
            mistakes.push(Mistake::new(Code::MissingInput, at, message).help(help));
        }
        let bound = params.tare_bound.map_or(f32::INFINITY, |bound| *bound as f32);
        Some(Self { window: *params.tare_window, bound, is_at_start, is_watched })
    }

    /// What is remembered at first of an array of that many tactels.
    pub(super) fn fresh(&self, tactels: usize) -> Averages {
        Averages { sums: vec![0.0; tactels], frames: self.is_at_start.then_some(0), was_asked: false }
    }

    /// Looks at the command and at the last frame, and takes the new one into the mean.
    pub(super) fn step(&self, inputs: &Inputs<'_>, calibrated: &[f32], lines: &Lines, state: &mut State) {
        let is_asked = inputs.tare.is_some_and(|tare| *tare);
        let averages = &mut state.averages;
        if !inputs.image.is_new() {
            averages.was_asked &= is_asked;
            return;
        }
        // Of the last frame; not known before there was one.
        let is_touched = if self.is_watched { inputs.present.map(|present| *present) } else { Some(false) };
        match averages.frames {
            Some(1..) if is_touched != Some(false) => averages.frames = None,
            Some(frames) if frames == self.window => {
                self.apply(frames, &averages.sums, calibrated, lines, &mut state.offset);
                averages.frames = None;
            }
            _ => {}
        }
        if is_asked && !averages.was_asked && is_touched == Some(false) {
            averages.begin();
        }
        // A command before the first frame has been looked at waits for it.
        averages.was_asked = is_asked && (averages.was_asked || is_touched.is_some());
        averages.add(inputs.image.cells());
    }

    /// Makes the means the zeros, unless one of them is too far off.
    fn apply(&self, frames: usize, sums: &[f64], calibrated: &[f32], lines: &Lines, offset: &mut [f32]) {
        let mean = |i: usize| (sums[i] / frames as f64) as f32;
        let is_near = |i: usize| (mean(i) - calibrated[i]).abs() <= self.bound;
        let live = || (0..sums.len()).filter(|i| !lines.is_dead(*i));
        if live().all(is_near) {
            live().for_each(|i| offset[i] = mean(i));
        }
    }
}
