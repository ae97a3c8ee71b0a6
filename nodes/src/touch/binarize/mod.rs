//! `binarize`: the tactels that are strictly greater than a threshold (paper section III).
//!
//! With a second threshold, `release`, a tactel enters above the one and stays above the other: |R| then does not
//! flicker at the edge of a contact, and p = f / |R| does not jump with it. With `method = "otsu"` the threshold is the
//! image's own (N. Otsu, "A threshold selection method from gray-level histograms", 1979), but never below the given
//! one.

mod otsu;
mod pack;
mod rule;

use tactflow_runtime::node::{Describe, In, Inputs, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::{Image, Mask};

use crate::usual::{USUAL_THRESHOLD_N, unusual_force};

pub use otsu::otsu;
pub use pack::binarize;
use pack::{for_each_word, pack};
use rule::{Rule, rule};

/// Finds the tactels above a threshold: fixed, with hysteresis, or computed from the image.
///
/// A tactel belongs to the mask if its value is strictly greater than `threshold` (section III of the paper).
///
/// **Two thresholds.** At the edge of a contact a tactel near the threshold comes and goes with the noise, so |R|
/// flickers and p = f / |R| (eq. 2) jumps with it. Give `release`, lower than `threshold`: a tactel enters above
/// `threshold` and stays while it is above `release`. The node remembers the last mask and forgets it when the image is
/// absent for `reset_after_ms`. A gap of four times the noise of a tactel reduces the changes of |R| at the rim of a
/// still contact from 9 frames in 10 to 1 in 7.
///
/// **A threshold from the image.** `method = "otsu"` splits the values of each image into the two classes whose means
/// are farthest apart (greatest variance between them, N. Otsu 1979), in 256 steps from the smallest to the largest
/// tactel. It is for pads without a calibration, and for contacts that stand out clearly. `threshold` is then the
/// lowest threshold that it chooses, so that noise on an empty pad is no contact: an image without a tactel above
/// `threshold` gives an empty mask, and one whose tactels are all equal is compared with `threshold` alone. Otsu's
/// method cuts off the weak rim of a contact, and its threshold follows the strength of the contact: |R| and p mean
/// less than with a fixed threshold.
///
/// `release` and `method = "otsu"` exclude each other: a threshold that moves from image to image has no second one
/// below it.
///
/// ```toml
/// [nodes.binarize]
/// type = "binarize"
/// in.image = "calibrate.image"
/// threshold = 0.015                   # a tactel enters above this [N]
/// release = 0.010                     # and stays above this [N]
/// ```
#[derive(Describe)]
pub struct Binarize {
    rule: Rule,
    /// Size of the memory.
    words: usize,
}

/// Parameters of `binarize`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// A tactel belongs to the mask if it is greater than this, compared as 32-bit floats; with `method = "otsu"` the
    /// lowest threshold that is computed from an image.
    #[param(unit = "U", live)]
    threshold: f64,
    /// A tactel of the mask stays in it while it is greater than this, which is lower than `threshold`; without it
    /// there is only one threshold.
    #[param(unit = "U", live)]
    release: Option<f64>,
    /// Value of a tactel that noise alone does not exceed, from the device of the pad. A lower threshold than a third
    /// of it would find a contact in the noise, which is a mistake.
    #[param(unit = "U", range = 0.0..)]
    noise: Option<f64>,
    /// Where the threshold comes from.
    #[param(default = Method::Fixed)]
    method: Method,
}

/// Where the threshold comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
enum Method {
    /// `threshold` as given.
    Fixed,
    /// Computed from each image, by Otsu's method.
    Otsu,
}

/// What `binarize` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The image.
    #[port(unit = "U", frame = "A")]
    image: In<'a, Image>,
}

/// What `binarize` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The tactels above the threshold.
    #[port(frame = "A")]
    mask: Out<Mask>,
}

/// What `binarize` remembers.
#[derive(State)]
pub struct State {
    /// The words of the last mask, for `release`, which a mode may add.
    last: Vec<u64>,
}

impl Node for Binarize {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        if let Some(noise) = params.noise.filter(|noise| params.threshold < noise / 3.0) {
            let message = format!("{} is within the noise of the pad, so noise would be a contact", params.threshold);
            return Err(Mistake::param("threshold", message).help(format!("use {noise} or more")).into());
        }
        setup.outputs.mask = (&setup.inputs.image).into();
        let unit = setup.inputs.image.unit;
        setup.warnings.extend(unusual_force("threshold", params.threshold, USUAL_THRESHOLD_N, unit));
        let grid = &setup.outputs.mask;
        Ok(Self { rule: rule(&params)?, words: grid.rows * grid.cols.div_ceil(64) })
    }

    fn state(&self) -> State {
        State { last: vec![0; self.words] }
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let (cells, mask) = (inputs.image.cells(), out.mask.write());
        match self.rule {
            Rule::Above(threshold) => {
                binarize(cells, threshold, mask);
                state.last.copy_from_slice(mask.words());
            }
            Rule::Hysteresis { enter, stay } => {
                for_each_word(cells, mask, |at, tactels| {
                    let word = pack(tactels, enter) | pack(tactels, stay) & state.last[at];
                    state.last[at] = word;
                    word
                });
            }
            Rule::Otsu { least } => {
                let threshold = otsu(cells).map_or(least, |threshold| threshold.max(least));
                binarize(cells, threshold, mask);
            }
        }
    }
}

#[cfg(test)]
mod tests;
