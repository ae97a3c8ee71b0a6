//! Tactels that are compared with a threshold, packed into the words of a mask.

use tactflow_runtime::signal::Mask;
use wide::f32x8;

/// Tactels that are compared at once.
const BLOCK: usize = 8;

/// Makes the mask the cells above the threshold.
pub fn binarize(cells: &[f32], threshold: f32, mask: &mut Mask) {
    for_each_word(cells, mask, |_, tactels| pack(tactels, threshold));
}

/// Makes each word of the mask what `pack` makes of its number and its at most 64 tactels.
#[inline]
pub(super) fn for_each_word(cells: &[f32], mask: &mut Mask, mut pack: impl FnMut(usize, &[f32]) -> u64) {
    // An array without columns has no words either.
    let (cols, stride) = (mask.cols().max(1), mask.stride().max(1));
    let rows = cells.chunks_exact(cols);
    let mut at = 0;
    for (words, row) in mask.words_mut().chunks_exact_mut(stride).zip(rows) {
        for (word, tactels) in words.iter_mut().zip(row.chunks(64)) {
            *word = pack(at, tactels);
            at += 1;
        }
    }
}

/// Returns a word whose bit j is set if tactel j of at most 64 is above the threshold.
pub(super) fn pack(tactels: &[f32], threshold: f32) -> u64 {
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
