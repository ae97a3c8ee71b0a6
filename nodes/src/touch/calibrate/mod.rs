//! `calibrate`: from the readings of a pad to forces, with a curve and a zero for each tactel.
//!
//! The zero is part of the state, as a tare changes it: a reset restores the calibrated zero.

mod curves;
mod tactel_curves;
mod tare;

use tactflow_runtime::node::{
    At, Describe, FilePath, In, Inputs, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick, collect_both,
};
use tactflow_runtime::signal::{Flag, Image, ImageShape};
use tactflow_runtime::source::Code;

use curves::{CurveParams, PerTactel};
use tactel_curves::TactelCurves;
use tare::{Averages, Rules};

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
/// **Tare.** The zero of foam drifts. When `in.tare` becomes set, the mean of the next `tare_window` frames becomes the
/// zero of each tactel; with `tare_at_start` the mean of the first frames does. A pad is only tared while nothing
/// touches it: wire `in.present` to a `label` after this node, set a `tare_bound`, or both. Do not wire it to a
/// `contact_debounce`, which reports a contact some frames late. A contact during the window, or in the frame before
/// it, cancels the tare, and so does a single tactel that is off by more than the bound: then all old zeros stay.
/// Between two tares nothing changes: a long contact does not become the new zero. A repeated frame counts once. When
/// the image is absent for the graph's `reset_after_ms`, the calibrated zero is restored.
///
/// ```toml
/// [nodes.calibrate]
/// type = "calibrate"
/// in.image = "source.image"
/// device = { from = "pad.calibration" }   # or `file = "pad.toml"`, from `tactflow calibrate`
/// in.present = "label.present"
/// tare_at_start = true                # the first 50 frames are the zero, if nothing touches the pad
/// ```
#[derive(Describe)]
pub struct Calibrate {
    /// The calibrated zero of each tactel.
    offset: Vec<f32>,
    curves: TactelCurves,
    /// `None` if nothing tares.
    rules: Option<Rules>,
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
    /// Largest difference between the new and the calibrated zero of a tactel; without it, any difference is accepted.
    #[param(unit = "U", above = 0.0)]
    tare_bound: Option<f64>,
    /// Whether to tare with the first frames.
    #[param(default = false)]
    tare_at_start: bool,
}

/// What `calibrate` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The image as measured.
    #[port(unit = "U", frame = "A", quantity = "Q")]
    image: In<'a, Image>,
    /// Tares each time that it becomes set; keep it set for at least a frame of the pad.
    #[port(optional, sampled)]
    tare: Option<In<'a, Flag>>,
    /// Whether something touches the pad: `present` of a `label` after this node. A frame with a contact cancels a
    /// tare.
    #[port(quantity = "contact", optional, delayed)]
    present: Option<In<'a, Flag>>,
}

/// What `calibrate` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The calibrated image, in `unit`.
    #[port(unit = "_", frame = "A", quantity = "Q")]
    image: Out<Image>,
}

/// What `calibrate` remembers.
#[derive(State)]
pub struct State {
    /// The zero of each tactel, in the unit of the input.
    offset: Vec<f32>,
    /// The frames of the next zero.
    averages: Averages,
}

impl Node for Calibrate {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let image = setup.inputs.image.clone();
        let rules = Rules::new(&params, &setup.inputs);
        let Params { offset, gain, unit, dead, file, device, .. } = params;
        let (own, device) = (CurveParams { offset, gain, unit, dead, file }, device.unwrap_or_default());
        let dead = collect_both(own.dead("", &image), device.dead("device.", &image));
        let curves = if own.has_curves() { own.curves("", &image) } else { device.curves("device.", &image) };
        let ((rules, (dead, others)), (mut offset, mut curves, unit)) =
            collect_both(collect_both(rules, dead), curves)?;
        for i in dead.into_iter().chain(others) {
            offset[i] = 0.0;
            curves.disable(i);
        }
        if (0..offset.len()).all(|i| curves.is_dead(i)) {
            let message = "every tactel is dead or has a gain of 0, so the calibrated image is always zero";
            return Err(Mistake::new(Code::BadValue, At::Node, message).help("check `gain` and `dead`").into());
        }
        setup.outputs.image = ImageShape { unit, ..image };
        Ok(Self { offset, curves, rules })
    }

    fn state(&self) -> State {
        let averages = self.rules.as_ref().map_or_else(Averages::default, |rules| rules.averages(self.offset.len()));
        State { offset: self.offset.clone(), averages }
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        if let Some(rules) = &self.rules {
            rules.step(&inputs, &self.offset, &self.curves, state);
        }
        // The loss of the command also wakes the node: without a new frame there is no new image.
        if inputs.image.is_new() {
            self.curves.apply(inputs.image.cells(), &state.offset, out.image.write().cells_mut());
        } else {
            out.image.keep();
        }
    }
}

#[cfg(test)]
mod tests;
