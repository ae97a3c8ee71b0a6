//! `binarize`: the tactels that are strictly greater than a threshold (paper section III).

use tactflow_runtime::node::{Mistake, Mistakes, Node, Setup, Tick};
use tactflow_runtime::signal::Mask;
use tactflow_runtime::{inputs, outputs, params};
use wide::f32x8;

params! {
    /// A tactel belongs to the mask if it is greater than this, compared at the image's 32 bits [unit of the image].
    threshold: f64,
}

inputs! {
    /// The image.
    image: Image["U", "A"],
}

outputs! {
    /// The tactels above the threshold.
    mask: Mask["A"],
}

/// Tactels that are compared at once.
const BLOCK: usize = 8;

/// The threshold.
pub struct Binarize {
    threshold: f32,
}

impl Node for Binarize {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    const NAME: &'static str = "binarize";
    const SUMMARY: &'static str = "the tactels above a threshold";

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let threshold = params.threshold as f32;
        if !threshold.is_finite() {
            let message = format!("{:e} is too large for a tactel: images are of 32-bit floats", params.threshold);
            return Err(Mistake::param("threshold", message).into());
        }
        setup.outputs.mask = (&setup.inputs.image).into();
        Ok(Self { threshold })
    }

    fn state(&self) {}

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        binarize(inputs.image.cells(), self.threshold, out.mask.write());
    }
}

/// Makes the mask the cells above the threshold.
pub fn binarize(cells: &[f32], threshold: f32, mask: &mut Mask) {
    // An array without columns has no words either.
    let (cols, stride) = (mask.cols().max(1), mask.stride().max(1));
    let rows = cells.chunks_exact(cols);
    for (words, row) in mask.words_mut().chunks_exact_mut(stride).zip(rows) {
        for (word, tactels) in words.iter_mut().zip(row.chunks(64)) {
            *word = pack(tactels, threshold);
        }
    }
}

/// Bit j tells whether tactel j of at most 64 is above the threshold.
fn pack(tactels: &[f32], threshold: f32) -> u64 {
    let (blocks, rest) = tactels.as_chunks::<BLOCK>();
    let mut word = 0;
    for (k, block) in blocks.iter().enumerate() {
        word |= pack_block(block, threshold) << (BLOCK * k);
    }
    if rest.is_empty() {
        return word;
    }
    // The last block laps over the one before: its bits there are the same.
    match tactels.last_chunk::<BLOCK>() {
        Some(block) => word | pack_block(block, threshold) << (tactels.len() - BLOCK),
        None => rest.iter().rev().fold(0, |word, value| word << 1 | u64::from(*value > threshold)),
    }
}

/// Compares all lanes at once and gathers their signs.
fn pack_block(block: &[f32; BLOCK], threshold: f32) -> u64 {
    u64::from(f32x8::new(*block).simd_gt(f32x8::splat(threshold)).to_bitmask())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Image, ImageShape, Mask, Unit};

    use super::*;

    fn run(threshold: f64, cols: usize, cells: &[f32]) -> Mask {
        let shape = ImageShape { rows: cells.len() / cols, cols, pitch: [0.005; 2], unit: Unit::NEWTON };
        let mut rig =
            NodeRig::new::<Binarize>(&format!("threshold = {threshold:?}"), &[("image", shape.into())]).unwrap();
        rig.set("image", Image::from_cells(cols, cells));
        rig.step();
        rig.get::<Mask>("mask").unwrap().clone()
    }

    #[test]
    fn the_threshold_itself_is_not_above_it() {
        for threshold in [0.0, 0.15, 1.0, -2.5, 4095.0] {
            let at = threshold as f32;
            for zeros in [0, 16, 17] {
                let cells = [vec![at; zeros], vec![at, at.next_up(), at.next_down()]].concat();
                let mask = run(threshold, cells.len(), &cells);
                assert_eq!(mask.words(), [0b010 << zeros], "{threshold}");
            }
        }
    }

    #[test]
    fn a_threshold_that_no_tactel_can_have_is_refused() {
        let shape = ImageShape { rows: 1, cols: 1, ..ImageShape::default() };
        for bad in ["threshold = 1e39", "threshold = nan", "threshold = \"1\"", ""] {
            assert!(NodeRig::new::<Binarize>(bad, &[("image", shape.clone().into())]).is_err(), "{bad}");
        }
    }

    fn images() -> impl Strategy<Value = (usize, Vec<f32>)> {
        let cells = |(rows, cols)| (Just(cols), prop::collection::vec(-1.0..1.0f32, rows * cols));
        (1..6usize, 1..200usize).prop_flat_map(cells)
    }

    proptest! {
        #[test]
        fn every_tactel_is_compared((cols, cells) in images(), threshold in -1.0..1.0f64) {
            let rows = cells.len() / cols;
            let mask = run(threshold, cols, &cells);
            let mut expected = Mask::empty(rows, cols);
            for (at, _) in cells.iter().enumerate().filter(|(_, value)| **value > threshold as f32) {
                expected.insert(at / cols, at % cols);
            }
            prop_assert_eq!(mask, expected);
        }
    }
}
