//! `hough`: the line through a contact by the Hough transform (paper section III, its ref. 7, Duda and Hart 1972).
//!
//! Offsets are counted from the mean position of the region, so that a shift by a tactel changes no vote. With an offset
//! step below the pitch, whole rows would vote for one offset and none for the next, and the transform would find the rows
//! of the pad.

use std::f64::consts::PI;

use tactflow_runtime::node::{Describe, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::{Image, ImageShape, Mask, Scalar};

use super::moments::{Inputs, Weighing, Weight, image_shape};
use crate::motion::axis::half_angle;

/// Finds the line through a contact by the Hough transform: direction and offset.
///
/// A tactel at (x, y) lies on every line of direction a whose offset is r = y cos a - x sin a (Duda and Hart 1972; paper
/// section III and Fig. 4). For each direction the tactels vote for their offsets. A vote is the tactel's `weight` as in
/// `moments`, shared between the two nearest offsets. The paper takes the highest single vote; on a bar that is several
/// tactels wide that is the diagonal, the longest line in it. This node takes the direction with the highest sum of
/// squared votes, the one across which the contact is thinnest, refined by a parabola through the peak and its two
/// neighbours.
///
/// **Prefer `moments`.** On bars of 8 to 14 by 2 to 3 tactels with 2 % noise the error of the angle is 0.9° here, 0.3° with
/// `moments` and 0.2° with `weight = "excess"` of `moments`, in a fraction of the time. The Hough transform is for lines
/// with gaps and with other prints beside them: wire `region` to the whole mask of `binarize`, where `moments` averages
/// over all prints (error 4.3° against 0.3°).
///
/// A larger number of `angles` is not better: the parabola then goes through three directions close to the peak, where the
/// lattice of the tactels dominates. 180 instead of 36 increase the error to 1.4° and take five times as long.
///
/// `strength` is 1 - lowest / highest score over all directions: 0 for a round contact, about 1 - width / length for a
/// bar. Below `min_strength`, `orientation` and `offset` are absent, as they are without a region.
///
/// `offset` is the distance of the line from the middle of the pad. It is positive on the side of the direction turned by
/// +90°, from +x toward +y, so it changes sign where the direction wraps from pi/2 to -pi/2.
///
/// ```toml
/// [nodes.hough]
/// type = "hough"
/// in.image = "calibrate.image"
/// in.region = "label.region"
/// min_strength = 0.3                  # below this the contact is not a line [1]
/// ```
#[derive(Describe)]
#[describe(name = "hough")]
pub struct Hough {
    shape: ImageShape,
    /// Sine and cosine of each direction.
    directions: Box<[(f64, f64)]>,
    offset_step: f64,
    min_strength: f64,
    weighing: Weighing,
}

/// Parameters of `hough`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Number of directions, evenly over half a turn.
    #[param(range = 8..=1_000_000, default = 36)]
    angles: usize,
    /// Distance between two offsets, at least the pitch of the pad; without it, the pitch.
    #[param(unit = "m", above = 0.0)]
    offset_step: Option<f64>,
    /// Smallest strength of a line.
    #[param(unit = "1", range = 0.0..=1.0, default = 0.3)]
    min_strength: f64,
    /// Weight of each tactel: its value, its excess over `threshold`, or 1.
    #[param(default = Weight::Force)]
    weight: Weight,
    /// Zero of the excess, for `weight = "excess"`: the threshold of `binarize`, or its `release` if it has one.
    #[param(unit = "U")]
    threshold: Option<f64>,
}

/// What `hough` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Direction of the line from +x toward +y, in (-pi/2, pi/2]; absent if there is no line.
    #[port(unit = "rad mod pi", frame = "A")]
    orientation: Out<Scalar>,
    /// Distance of the line from the middle of the pad, positive on the side of the direction turned by +90°; absent if
    /// there is no line.
    #[port(unit = "m", frame = "A")]
    offset: Out<Scalar>,
    /// How clear the line is, from 0 (all directions are equal) to 1; absent if the sum of the weights is 0.
    #[port(unit = "1", frame = "A")]
    strength: Out<Scalar>,
}

/// What `hough` remembers: buffers of a step.
#[derive(State)]
pub struct State {
    /// Position from the mean position of the region [m], and weight, of each of its tactels.
    tactels: Vec<[f64; 3]>,
    /// Votes for each offset, of one direction.
    votes: Vec<f64>,
    /// Sum of the squared votes of each direction.
    scores: Vec<f64>,
}

impl Node for Hough {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let shape = image_shape(&setup.inputs)?;
        let mut mistakes = Mistakes::new();
        let pitch = shape.pitch[0].max(shape.pitch[1]);
        let offset_step = params.offset_step.unwrap_or(pitch);
        if pitch <= 0.0 {
            mistakes.push(Mistake::input("image", "`hough` needs a pad with a pitch"));
        } else if offset_step < pitch {
            let message = format!("`offset_step` is smaller than the pitch, {pitch} m");
            mistakes.push(Mistake::param("offset_step", message).help("leave it out for the pitch"));
        }
        let weighing = Weighing::new(params.weight, params.threshold).unwrap_or_else(|others| {
            mistakes.extend(others);
            Weighing::Force
        });
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        let direction = |k: usize| libm::sincos(k as f64 * PI / params.angles as f64);
        let directions = (0..params.angles).map(direction).collect();
        Ok(Self { shape, directions, offset_step, min_strength: params.min_strength, weighing })
    }

    fn state(&self) -> State {
        let offsets = 2 * (diagonal(&self.shape) / self.offset_step).ceil() as usize + 4;
        State {
            tactels: vec![[0.0; 3]; self.shape.tactels()],
            votes: vec![0.0; offsets],
            scores: vec![0.0; self.directions.len()],
        }
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let State { tactels, votes, scores } = state;
        let Some((centre, tactels)) = self.collect(&inputs.image, &inputs.region, tactels) else { return };
        for (score, direction) in scores.iter_mut().zip(&self.directions) {
            *score = self.vote(tactels, *direction, votes).1;
        }
        let least = scores.iter().copied().fold(f64::INFINITY, f64::min);
        let (best, shift) = peak(scores);
        if scores[best] <= 0.0 {
            return;
        }
        let strength = 1.0 - least / scores[best];
        out.strength.set(strength);
        if strength > 0.0 && strength >= self.min_strength {
            let (sine, cosine) = libm::sincos((best as f64 + shift) * PI / scores.len() as f64);
            let (offset, _) = self.vote(tactels, (sine, cosine), votes);
            out.orientation.set(half_angle(2.0 * sine * cosine, cosine * cosine - sine * sine));
            let side = if cosine > 0.0 { 1.0 } else { -1.0 };
            out.offset.set(side * (offset + centre[1] * cosine - centre[0] * sine));
        }
    }
}

impl Hough {
    /// Returns the mean position of the region from the middle of the pad [m], and its tactels relative to it, each with
    /// its weight, or `None` if the region is empty.
    fn collect<'t>(
        &self,
        image: &Image,
        region: &Mask,
        tactels: &'t mut [[f64; 3]],
    ) -> Option<([f64; 2], &'t [[f64; 3]])> {
        let (mut count, mut centre) = (0, [0.0; 2]);
        for i in 0..region.rows() {
            for (k, word) in region.row(i).iter().enumerate() {
                let mut rest = *word;
                while rest != 0 {
                    let j = 64 * k + rest.trailing_zeros() as usize;
                    rest &= rest - 1;
                    let [x, y] = [self.shape.x(j as f64), self.shape.y(i as f64)];
                    tactels[count] = [x, y, self.weighing.weight(image.row(i)[j].into())];
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

    /// Collects the votes of the tactels for one direction. Returns the mean of the offsets [m], weighted by their squared
    /// votes, and the sum of the squared votes.
    fn vote(&self, tactels: &[[f64; 3]], (sine, cosine): (f64, f64), votes: &mut [f64]) -> (f64, f64) {
        votes.fill(0.0);
        let middle = votes.len() / 2;
        for [x, y, weight] in tactels {
            let position = (y * cosine - x * sine) / self.offset_step + middle as f64;
            let (at, rest) = (position as usize, position - position.floor());
            votes[at] += weight * (1.0 - rest);
            votes[at + 1] += weight * rest;
        }
        let (mut moment, mut sum) = (0.0, 0.0);
        for (k, vote) in votes.iter().enumerate() {
            moment += vote * vote * (k as f64 - middle as f64);
            sum += vote * vote;
        }
        (if sum > 0.0 { moment / sum * self.offset_step } else { 0.0 }, sum)
    }
}

/// Returns the diagonal of a pad [m].
fn diagonal(shape: &ImageShape) -> f64 {
    libm::hypot(shape.cols as f64 * shape.pitch[0], shape.rows as f64 * shape.pitch[1])
}

/// Returns the index of the highest score, the first one of equals, and the shift from it to the peak of the parabola
/// through it and its neighbours.
fn peak(scores: &[f64]) -> (usize, f64) {
    let best = (1..scores.len()).fold(0, |best, k| if scores[k] > scores[best] { k } else { best });
    let [before, after] = [scores.len() - 1, 1].map(|step| scores[(best + step) % scores.len()]);
    let bend = before - 2.0 * scores[best] + after;
    (best, if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 })
}

#[cfg(test)]
mod tests;
