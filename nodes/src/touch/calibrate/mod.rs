//! `calibrate`: from the readings of a pad to forces, with a curve and a zero for each tactel.
//!
//! The zero is part of the state, as a tare changes it: a reset restores the calibrated zero.

mod curves;
mod findings;
mod frames;
mod repair;
mod rest;
mod sinking;
mod sums;
mod tactel_curves;
mod tare;

use tactflow_runtime::node::{
    Absence, At, Describe, FilePath, In, Inputs, Limits, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, State,
    Tick, collect_both,
};
use tactflow_runtime::signal::{Flag, Image, ImageShape, Scalar, Unit};
use tactflow_runtime::source::Code;

use curves::{CurveParams, PerTactel};
use frames::{Frame, FrameRules, Frames};
use repair::repair;
use rest::{Rest, RestTest, Verdict};
use sinking::Sinking;
use tactel_curves::TactelCurves;
use tare::{Averages, Rules};

use super::common::halves::FREE;

/// Converts the reading of each tactel to a force, by a line or by the curves of a calibration file.
///
/// Every tactel of a foam sensor has its own zero and its own squashed (saturating) curve (paper section III, fig. 1).
/// This node inverts them: `force = curve(value - offset)`, tactel by tactel.
///
/// Without a `file` the curve is a straight line, `(value - offset) * gain`, which has no upper end and continues below
/// zero. From an image in kPa to `unit = "N"` the default of `gain` is the area of a tactel, from the pitch. A `file` that `tactflow calibrate` has made from a log with a reference force contains, for s = value -
/// offset, a line, a squashed curve, `gain s / (1 - squash s)`, or straight lines between knots. Squashed curves and
/// knots have no force below zero, and end at the largest force of the calibration. The file must be for this pad: its
/// size and the unit of its readings are checked. A `dead` tactel is always 0. Tactels that have died since the
/// calibration can be added to those of the file.
///
/// With `device = { from = "pad.calibration" }` a task takes all of that from the device of the pad, so it works with
/// any pad. If any of `offset`, `gain`, `unit` and `file` is set beside `device`, it replaces all four of the device.
/// Dead tactels add up.
///
/// **Frames.** With `in.sum` and `in.peak`, wired to the `tactile_source` of the image, frames that are no measurement
/// are dropped before any mean, and both images are absent for that time: the motion stops. A frame with a reading above
/// `max_reading` is dropped, and one whose sum changes by more than `max_rise`. The frame after that one counts, so that
/// an impact costs one frame. If `max_rise` is not given, this node learns it during a contact: eight times the range of
/// the sum. A value counts for this range if three frames in a row reach it, and the range counts from twice the noise of
/// a tactel times their number on. Before, or without noise, no frame is dropped because of its sum. A pad whose
/// self-test saw noise never sends one image three times in a row: then the images are absent, and after 25 such frames
/// the task ends with a fault. A pad that repeats its readings at rest may repeat them. A pad whose zero sinks hides a force: with a self-test and a `tare_bound`, the task ends with
/// a fault if more than a quarter of the live readings are below their zeros by more than the bound, in three looks that
/// are 8 frames apart.
///
/// **Tare.** The zero of foam drifts. When `in.tare` becomes set, the mean of the next `tare_window` frames becomes the
/// zero of each tactel; with `tare_at_start` the mean of the first frames does. A pad is only tared while nothing
/// touches it: wire `in.present` to a `label` after this node, set a `tare_bound`, or both. Do not wire it to a
/// `contact_debounce`, which reports a contact some frames late. A contact during the window, or in the frame before
/// it, cancels the tare, and so does a single tactel that is off by more than the bound: then all old zeros stay.
/// Between two tares nothing changes: a long contact does not become the new zero. A repeated frame counts once. When
/// the image is absent for the graph's `reset_after_ms`, the zero from before all tares is restored.
///
/// **Self-test.** With `rest_frames`, the first frames show whether the pad works, while nothing may touch it. Until it
/// has passed, both images are absent, so no limiter that reads them lets anything move. A part of a task takes the
/// number from its pad: `{ from = "pad.rest_frames", optional = true }`.
///
/// - A tactel is bad if its reading never changes (dead at 0, or stuck), if its noise is more than eight times the
///   median of the pad, or if it drifts: the means of both halves of the test differ by six standard deviations. In a
///   pad that repeats its readings in more than half of the frames, no tactel counts as bad. At most `max_bad` tactels
///   may be bad, and none may be at a side of another.
/// - With a `tare_bound`, the mean of each sound tactel becomes its zero. A reading that changes and whose mean is
///   farther than the bound from the calibrated zero is a fault. If one is below, or more than half of the pad is above,
///   the calibration does not fit the pad; otherwise something touches it.
///
/// A test that fails is repeated once. The second failure ends the task, and the fault names the tactels. `image` keeps
/// the readings of bad tactels, with the zero that they had at rest: limiters read it. In `repaired`, a bad tactel is
/// the mean of the live ones at its four sides: features read it. No tactel becomes bad after the test, so a pin that
/// presses on one tactel for long is felt. A pad that was lost and comes back, where the bench says `reconnect`, is
/// tested again, with the calibrated zeros.
///
/// The operator takes the zeros anew with the word `tare`, while the task is halted: the self-test is repeated. It is
/// refused while a reading is off its zero by more than eight times the noise, because something may touch the pad. A
/// touch during the self-test ends the task, as at the start.
///
/// ```toml
/// [nodes.calibrate]
/// type = "calibrate"
/// in.image = "source.image"
/// device = { from = "pad.calibration" }   # or `file = "pad.toml"`, from `tactflow calibrate`
/// rest_frames = 40                    # the self-test; without it, the image is there at once
/// in.present = "label.present"
/// tare_at_start = true                # the next 50 frames are the zero, if nothing touches the pad
/// ```
#[derive(Describe)]
pub struct Calibrate {
    /// The calibrated zero of each tactel.
    offset: Vec<f32>,
    curves: TactelCurves,
    /// `None` if nothing tares.
    rules: Option<Rules>,
    /// `None` without a self-test.
    test: Option<RestTest>,
    /// `None` without the sum and the peak of the readings.
    frames: Option<FrameRules>,
    /// Unit of the readings.
    unit: Unit,
}

/// Parameters of `calibrate`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Reading of an unloaded tactel: a number for all, or a list of rows; 0 without it.
    #[param(unit = "U")]
    offset: Option<PerTactel>,
    /// Slope of the line, in units of the output per unit of the input: a number for all, or a list of rows. Without it
    /// the slope is 1, or the area of a tactel from kPa to N. Another change of unit needs it.
    #[param(unit = "1")]
    gain: Option<PerTactel>,
    /// Unit of the calibrated image; without it, the unit of the input.
    unit: Option<String>,
    /// Tactels that measure nothing, as `[row, column]` from 0; they are added to those of the device.
    #[param(default = Vec::new())]
    dead: Vec<[usize; 2]>,
    /// A calibration file with a curve for each tactel, instead of `offset`, `gain` and `unit`.
    file: Option<FilePath>,
    /// The calibration of the device: `{ from = "pad.calibration" }`. Any of `offset`, `gain`, `unit` and `file` beside
    /// it replaces all four of the device.
    device: Option<CurveParams>,
    /// Number of frames whose mean is the new zero.
    #[param(range = 1..=1_000_000, default = 50)]
    tare_window: usize,
    /// Largest difference between the new and the calibrated zero of a tactel, in a tare and in the self-test; without
    /// it, any difference is accepted, and the self-test leaves the zeros as they are.
    #[param(unit = "U", above = 0.0)]
    tare_bound: Option<f64>,
    /// Whether to tare with the first frames.
    #[param(default = false)]
    tare_at_start: bool,
    /// Number of frames of the self-test at the start, at least 8; 0 for none.
    #[param(range = 0..=1_000_000, default = 0)]
    rest_frames: usize,
    /// Largest number of bad tactels that the self-test accepts; one in fifty if not given.
    max_bad: Option<usize>,
    /// Largest possible reading; a frame with a greater one is dropped.
    #[param(unit = "U")]
    max_reading: Option<f64>,
    /// Largest possible change of the sum from frame to frame; a frame that changes by more is dropped, and the next one
    /// counts. If it is not given, it is learned during a contact: eight times the range of the sum.
    #[param(unit = "U", above = 0.0)]
    max_rise: Option<f64>,
}

/// [`FREE`] for a pad without noise, as a fraction of its `tare_bound`.
const MIN_FREE: f64 = 0.1;

/// What `calibrate` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The image as measured.
    #[port(unit = "U", frame = "A", quantity = "Q")]
    image: Option<In<'a, Image>>,
    /// Tares each time that it becomes set; keep it set for at least a frame of the pad.
    #[port(optional, sampled)]
    tare: Option<In<'a, Flag>>,
    /// Whether something touches the pad: `present` of a `label` after this node. A frame with a contact cancels a
    /// tare.
    #[port(quantity = "contact", optional, delayed)]
    present: Option<In<'a, Flag>>,
    /// Sum of the readings: `sum` of the `tactile_source` of the image.
    #[port(unit = "U", frame = "A", quantity = "sum", optional, sampled)]
    sum: Option<In<'a, Scalar>>,
    /// Largest reading: `peak` of the `tactile_source` of the image.
    #[port(unit = "U", frame = "A", quantity = "peak", optional, sampled)]
    peak: Option<In<'a, Scalar>>,
}

/// What `calibrate` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The calibrated image, in `unit`.
    #[port(unit = "_", frame = "A", quantity = "Q")]
    image: Out<Image>,
    /// The same image, with the bad tactels filled from the live ones at their sides. Limiters do not accept it.
    #[port(unit = "_", frame = "A", quantity = "repaired_image")]
    repaired: Out<Image>,
    /// Whether the self-test has failed; absent before its end.
    failed: Out<Flag>,
    /// Number of bad tactels that the self-test has found.
    #[port(unit = "tactel", frame = "A")]
    bad: Out<Scalar>,
    /// Median noise of a tactel at rest: the standard deviation of its readings, without the lowest and the highest one
    /// of each half of the test.
    #[port(unit = "U", frame = "A")]
    noise: Out<Scalar>,
    /// Largest difference between the zero at rest and the calibrated zero of a sound tactel.
    #[port(unit = "U", frame = "A")]
    shift: Out<Scalar>,
}

/// What `calibrate` remembers.
#[derive(State)]
pub struct State {
    /// The zero of each tactel, in the unit of the input.
    offset: Vec<f32>,
    /// The frames of the next zero.
    averages: Averages,
    /// The self-test. It outlasts an absence of the image: an arm that is in contact cannot repeat it.
    rest: Rest,
    /// What was seen of the frames.
    frames: Frames,
    /// What was seen of a zero that sinks.
    sinking: Sinking,
    absence: Absence,
}

impl Node for Calibrate {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    const LIMITS: Limits = Limits { fails: Some("failed"), ..Limits::NONE };

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let image = setup.inputs.image.clone().expect("the check of a graph reports an input without a wire");
        let rules = Rules::new(&params, &setup.inputs);
        let test = RestTest::new(params.rest_frames, params.tare_bound, params.max_bad, &image);
        let frames = FrameRules::new(&params, &setup.inputs);
        let Params { offset, gain, unit, dead, file, device, .. } = params;
        let (own, device) = (CurveParams { offset, gain, unit, dead, file }, device.unwrap_or_default());
        let dead = collect_both(own.dead("", &image), device.dead("device.", &image));
        let curves = if own.has_curves() { own.curves("", &image) } else { device.curves("device.", &image) };
        let tests = collect_both(test.map_err(Mistakes::from), frames.map_err(Mistakes::from));
        let rules = collect_both(rules, tests);
        let (((rules, (test, frames)), (dead, others)), (mut offset, mut curves, unit)) =
            collect_both(collect_both(rules, dead), curves)?;
        for i in dead.into_iter().chain(others) {
            offset[i] = 0.0;
            curves.disable(i);
        }
        if (0..offset.len()).all(|i| curves.is_dead(i)) {
            let message = "every tactel is dead or has a gain of 0, so the calibrated image is always zero";
            return Err(Mistake::new(Code::BadValue, At::Node, message).help("check `gain` and `dead`").into());
        }
        let readings = image.unit;
        setup.outputs.image = ImageShape { unit, ..image };
        setup.outputs.repaired = setup.outputs.image.clone();
        Ok(Self { offset, curves, rules, test, frames, unit: readings })
    }

    fn state(&self) -> State {
        let averages = self.rules.as_ref().map_or_else(Averages::default, |rules| rules.averages(self.offset.len()));
        let rest = self.test.as_ref().map_or_else(|| Rest::passed(&self.offset), |test| test.begin(&self.offset));
        State {
            offset: self.offset.clone(),
            averages,
            rest,
            frames: Frames::default(),
            sinking: Sinking::default(),
            absence: Absence::default(),
        }
    }

    fn found(&self, state: &State) -> Option<String> {
        let test = self.test.as_ref().map(|test| findings::describe(test, &self.unit.to_string(), &state.rest));
        let dropped = match state.frames.dropped {
            0 => None,
            1 => Some("1 frame dropped as garbage".to_owned()),
            more => Some(format!("{more} frames dropped as garbage")),
        };
        test.into_iter().chain(dropped).reduce(|test, dropped| format!("{test}; {dropped}"))
    }

    fn returned(&self, state: &mut State) {
        let Some(test) = &self.test else { return };
        test.restart(&self.offset, &mut state.rest);
        state.frames.forget();
        self.rules.iter().for_each(|rules| rules.restart(&mut state.averages));
    }

    fn can_tare(&self, inputs: Inputs<'_>, state: &State) -> Option<Result<(), String>> {
        self.test.as_ref().map(|test| self.is_free(test, &inputs, state))
    }

    fn tare(&self, state: &mut State) {
        self.returned(state);
        state.sinking = Sinking::default();
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        out.failed.keep();
        out.bad.keep();
        out.noise.keep();
        out.shift.keep();
        let Some(image) = &inputs.image else { return state.absence.begin(tick.now) };
        if state.absence.end(tick) {
            state.offset.copy_from_slice(&state.rest.zeros);
            self.rules.iter().for_each(|rules| rules.restart(&mut state.averages));
        }
        let frame = match &self.frames {
            Some(rules) if image.is_new() => rules.judge(&inputs, &state.rest, &mut state.frames),
            _ => Frame::Good,
        };
        let counts = image.is_new() && frame == Frame::Good && state.rest.verdict == Verdict::Passed;
        let bound = self.test.as_ref().and_then(|test| test.bound).filter(|_| counts);
        let is_dead = |i: usize| self.curves.is_dead(i);
        let has_sunk = bound.is_some_and(|bound| state.sinking.look(image.cells(), &state.offset, bound, is_dead));
        let late = if frame == Frame::Stuck { Some(Verdict::Stuck) } else { has_sunk.then_some(Verdict::Sunk) };
        if let Some(verdict) = late.filter(|_| state.rest.verdict == Verdict::Passed) {
            state.rest.verdict = verdict;
            out.failed.set(true);
        }
        if frame != Frame::Good || state.rest.verdict != Verdict::Passed && !self.passes(image, out, state) {
            return;
        }
        if let Some(rules) = &self.rules {
            rules.step(image, &inputs, &self.offset, &self.curves, state);
        }
        // The loss of the command also wakes the node: without a new frame there is no new image.
        if image.is_new() {
            let forces = out.image.write().cells_mut();
            self.curves.apply(image.cells(), &state.offset, forces);
            let repaired = out.repaired.write().cells_mut();
            repaired.copy_from_slice(forces);
            repair(&state.rest.bad, repaired);
        } else {
            out.image.keep();
            out.repaired.keep();
        }
    }
}

impl Calibrate {
    /// Checks that nothing touches the pad: no reading is off its zero by more than noise, and the self-test would accept
    /// it as the new zero.
    fn is_free(&self, test: &RestTest, inputs: &Inputs<'_>, state: &State) -> Result<(), String> {
        if state.rest.verdict != Verdict::Passed {
            return Err("the self-test of the pad is not over".into());
        }
        let bound = test.bound.ok_or("the pad has no `tare_bound`, so a touch cannot be distinguished from a drift")?;
        let image = inputs.image.as_ref().ok_or("the pad sends no image")?;
        let near = (FREE * state.rest.noise).max(MIN_FREE * bound).min(bound / 2.0);
        let off = |i: usize, zero: &[f32]| f64::from(image.cells()[i] - zero[i]).abs();
        let is_touched = |i: &usize| off(*i, &state.offset) > near || off(*i, &self.offset) > bound - near;
        let touched = (0..image.cells().len()).filter(|i| !self.curves.is_dead(*i)).filter(is_touched);
        let (count, most) = touched.fold((0, 0.0), |(count, most), i| (count + 1, off(i, &state.offset).max(most)));
        if count == 0 && inputs.present.is_none_or(|present| !*present) {
            return Ok(());
        }
        let unit = &self.unit;
        Err(format!(
            "something touches the pad, or its zero has drifted too far: {count} tactels are off by up to {most:.1} {unit}, \
             and {near:.1} {unit} is allowed; free the pad, or start the run again"
        ))
    }

    /// Adds a frame to the self-test, and writes what it has found once it is over. Returns whether the pad has passed.
    #[cold]
    fn passes(&self, image: &In<'_, Image>, out: &mut Outputs, state: &mut State) -> bool {
        let State { rest, offset, .. } = state;
        let Some(test) = self.test.as_ref().filter(|_| image.is_new() && rest.verdict == Verdict::Testing) else {
            return false;
        };
        if test.add(image.cells(), |i| self.curves.is_dead(i), rest) {
            out.failed.set(rest.verdict != Verdict::Passed);
            out.bad.set(rest.bad_count as f64);
            out.noise.set(rest.noise);
            out.shift.set(rest.shift);
            offset.copy_from_slice(&rest.zeros);
        }
        rest.verdict == Verdict::Passed
    }
}

#[cfg(test)]
mod tests;
