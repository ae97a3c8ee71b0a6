//! The tactels of a region, their votes for the offsets of a line, and the peak of the scores.
//!
//! Offsets are counted from the mean position of the region, so that a shift by a tactel changes no vote. With an
//! offset step below the pitch, whole rows would vote for one offset and none for the next, and the transform would
//! find the rows of the pad.

use tactflow_runtime::signal::ImageShape;

use crate::touch::moments::{Inputs, Weighing};

/// Returns the mean position of the region from the middle of the pad [m], and its tactels relative to it, each with
/// its weight, or `None` if the region is empty.
pub(super) fn collect<'t>(
    shape: &ImageShape,
    weighing: Weighing,
    Inputs { image, region }: &Inputs<'_>,
    tactels: &'t mut [[f64; 3]],
) -> Option<([f64; 2], &'t [[f64; 3]])> {
    let (mut count, mut centre) = (0, [0.0; 2]);
    for i in 0..region.rows() {
        for (k, word) in region.row(i).iter().enumerate() {
            let mut rest = *word;
            while rest != 0 {
                let j = 64 * k + rest.trailing_zeros() as usize;
                rest &= rest - 1;
                let [x, y] = [shape.x(j as f64), shape.y(i as f64)];
                tactels[count] = [x, y, weighing.weight(image.row(i)[j].into())];
                centre = [centre[0] + x, centre[1] + y];
                count += 1;
            }
        }
    }
    if count == 0 {
        return None;
    }
    let [x, y] = centre.map(|sum| sum / count as f64);
    let tactels = &mut tactels[..count];
    for tactel in tactels.iter_mut() {
        *tactel = [tactel[0] - x, tactel[1] - y, tactel[2]];
    }
    Some(([x, y], tactels))
}

/// Collects the votes of the tactels for one direction, for offsets that are `step` [m] apart. Returns the mean of the
/// offsets [m], weighted by their squared votes, and the sum of the squared votes.
pub(super) fn vote(tactels: &[[f64; 3]], (sine, cosine): (f64, f64), step: f64, votes: &mut [f64]) -> (f64, f64) {
    votes.fill(0.0);
    let middle = votes.len() / 2;
    for [x, y, weight] in tactels {
        let position = (y * cosine - x * sine) / step + middle as f64;
        let (at, rest) = (position as usize, position - position.floor());
        votes[at] += weight * (1.0 - rest);
        votes[at + 1] += weight * rest;
    }
    let (mut moment, mut sum) = (0.0, 0.0);
    for (k, vote) in votes.iter().enumerate() {
        moment += vote * vote * (k as f64 - middle as f64);
        sum += vote * vote;
    }
    (if sum > 0.0 { moment / sum * step } else { 0.0 }, sum)
}

/// Returns the index of the highest score, the first one of equals, and the shift from it to the peak of the parabola
/// through it and its neighbours.
pub(super) fn peak(scores: &[f64]) -> (usize, f64) {
    let best = (1..scores.len()).fold(0, |best, k| if scores[k] > scores[best] { k } else { best });
    let [before, after] = [scores.len() - 1, 1].map(|step| scores[(best + step) % scores.len()]);
    let bend = before - 2.0 * scores[best] + after;
    (best, if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 })
}
