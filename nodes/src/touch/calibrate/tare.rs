//! Tare: when the zero changes, and from which frames.
//!
//! `present` is known only after a frame has passed the nodes behind, so each frame of the window is checked when the
//! next one arrives, also the last one: the zero changes with the frame after the window.

use tactflow_runtime::node::{At, In, Mistake, Mistakes};
use tactflow_runtime::signal::Image;
use tactflow_runtime::source::Code;

use super::tactel_curves::TactelCurves;
use super::{Inputs, InputsShapes, Params, State};

/// When the zero changes.
#[derive(Debug)]
pub(super) struct Rules {
    window: usize,
    bound: f32,
    is_at_start: bool,
    /// Whether `in.present` is wired.
    is_watched: bool,
}

/// The frames of the next zero so far.
#[derive(Debug, State)]
pub(super) struct Averages {
    /// Sum of each tactel's readings; empty if nothing tares.
    sums: Vec<f64>,
    /// Number of frames in the sums, during a tare.
    frames: Option<usize>,
    /// Whether the last frame has seen the command.
    was_commanded: bool,
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
    /// Returns the rules, or `None` if nothing tares. It is a mistake if nothing detects a touched pad.
    pub(super) fn new(params: &Params, inputs: &InputsShapes) -> Result<Option<Self>, Mistakes> {
        let is_at_start = params.tare_at_start;
        if inputs.tare.is_none() && !is_at_start {
            return Ok(None);
        }
        let is_watched = inputs.present.is_some();
        if !is_watched && params.tare_bound.is_none() {
            let at = if is_at_start { At::Param("tare_at_start".into()) } else { At::Input("tare".into()) };
            let message = "a tare needs `in.present` or `tare_bound`, which detect a touched pad";
            let help = "wire `in.present` to `present` of a `label` after this node, or add a `tare_bound`";
            return Err(Mistake::new(Code::MissingInput, at, message).help(help).into());
        }
        let bound = params.tare_bound.map_or(f32::INFINITY, |bound| bound as f32);
        Ok(Some(Self { window: params.tare_window, bound, is_at_start, is_watched }))
    }

    /// Returns the first state for an array of that many tactels.
    pub(super) fn averages(&self, tactels: usize) -> Averages {
        Averages { sums: vec![0.0; tactels], frames: self.is_at_start.then_some(0), was_commanded: false }
    }

    /// Forgets the frames so far, and starts as at first.
    pub(super) fn restart(&self, averages: &mut Averages) {
        averages.sums.fill(0.0);
        (averages.frames, averages.was_commanded) = (self.is_at_start.then_some(0), false);
    }

    /// Checks the command and the last frame, and adds the new frame to the mean.
    pub(super) fn step(
        &self,
        image: &In<'_, Image>,
        inputs: &Inputs<'_>,
        calibrated: &[f32],
        curves: &TactelCurves,
        state: &mut State,
    ) {
        let is_commanded = inputs.tare.is_some_and(|tare| *tare);
        let averages = &mut state.averages;
        if !image.is_new() {
            averages.was_commanded &= is_commanded;
            return;
        }
        // Whether the last frame shows a contact; `None` before the first frame.
        let is_touched = if self.is_watched { inputs.present.map(|present| *present) } else { Some(false) };
        match averages.frames {
            Some(1..) if is_touched != Some(false) => averages.frames = None,
            Some(frames) if frames == self.window => {
                self.apply(frames, &averages.sums, calibrated, curves, &mut state.offset);
                averages.frames = None;
            }
            _ => {}
        }
        if is_commanded && !averages.was_commanded && is_touched == Some(false) {
            averages.begin();
        }
        // A command waits until it is known whether something touches the pad.
        averages.was_commanded = is_commanded && (averages.was_commanded || is_touched.is_some());
        averages.add(image.cells());
    }

    /// Sets the zeros to the means, unless one of them is too far from the calibrated zero.
    fn apply(&self, frames: usize, sums: &[f64], calibrated: &[f32], curves: &TactelCurves, offset: &mut [f32]) {
        let mean = |i: usize| (sums[i] / frames as f64) as f32;
        let is_near = |i: usize| (mean(i) - calibrated[i]).abs() <= self.bound;
        let live = || (0..sums.len()).filter(|i| !curves.is_dead(*i));
        if live().all(is_near) {
            live().for_each(|i| offset[i] = mean(i));
        }
    }
}
