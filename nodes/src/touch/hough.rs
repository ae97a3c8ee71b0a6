//! `hough`: the line through a contact by the Hough transform (paper section III, its ref. 7, Duda and Hart 1972).
//!
//! A tactel at (x, y) lies on every line of direction a whose offset is r = y cos a - x sin a. For each direction the
//! tactels vote for their offsets, each with its weight, shared between the two nearest. The paper takes the greatest
//! vote; on a bar that is several tactels wide that is its diagonal, for nothing is longer. Here the direction is that
//! with the greatest sum of squared votes, the one across which the contact is thinnest, with a parabola through the
//! peak and its neighbours.
//!
//! Offsets are counted from the mean place of the region, so that a shift by a tactel changes no vote. A step below the
//! pitch would let whole rows vote for one offset and none for the next, and the rows of the pad would win.

use std::f64::consts::PI;

use tactflow_runtime::node::{Count, Mistake, Mistakes, Node, Positive, Ratio, Setup, Tick};
use tactflow_runtime::signal::{Image, ImageShape, Mask};
use tactflow_runtime::{inputs, outputs, params, state};

use super::moments::{Weighing, Weight};
use super::on_one_array;
use crate::motion::axis::half_angle;

params! {
    /// Number of directions that are tried, evenly over half a turn: at least 8 [1].
    angles: Count = Count(36),
    /// Distance between two offsets that are voted for: at least the pitch of the pad, which it is if not given [m].
    offset_step: Option<Positive>,
    /// Below this strength there is no line [1].
    min_strength: Ratio = Ratio(0.3),
    /// What a tactel's vote counts: its "force", its "excess" above `threshold`, or the same as all others ("area").
    weight: Weight = Weight::Force,
    /// Where the excess begins, for `weight = "excess"`: that of the `binarize` [unit of the image].
    threshold: Option<f64>,
}

inputs! {
    /// The image that forces are taken from.
    image: Image["U", "A"],
    /// The tactels of the contact, R.
    region: Mask["A"],
}

outputs! {
    /// Direction of the line from +x toward +y, in (-pi/2, pi/2] [rad]; absent if there is none.
    orientation: Scalar["rad mod pi", "A"],
    /// Distance of the line from the pad's middle, positive on the side that is a quarter turn from its direction,
    /// from +x toward +y [m]; absent if there is no line.
    offset: Scalar["m", "A"],
    /// How clear the line is, from 0 (no direction is better than another) to 1 [1]; absent without any votes.
    strength: Scalar["1", "A"],
}

state! {
    /// Place from the mean place [m], and weight, of each tactel of the region.
    tactels: Vec<[f64; 3]>,
    /// Votes for each offset, of one direction.
    votes: Vec<f64>,
    /// Sum of the squared votes of each direction.
    scores: Vec<f64>,
}

/// Fewest directions for a peak with two neighbours.
const LEAST_ANGLES: usize = 8;

/// The directions, and what is a line.
pub struct Hough {
    shape: ImageShape,
    /// Sine and cosine of each direction.
    directions: Box<[(f64, f64)]>,
    offset_step: f64,
    min_strength: f64,
    weighing: Weighing,
}

impl tactflow_runtime::node::Describe for Hough {
    const NAME: &'static str = "hough";
    const SUMMARY: &'static str = "finds the line through a contact by the Hough transform: direction and offset";
    const DOC: &'static str = "Every tactel votes for all lines through it: for a direction a, for the offset \
        r = y cos a - x sin a (Duda and Hart 1972; paper section III and Fig. 4). The votes count the tactel's `weight` as in \
        `moments`, and are shared between the two nearest offsets. Taking the greatest single vote, as a plain \
        transform does, finds the diagonal of a bar that is several tactels wide: nothing in it is longer. So the \
        direction is that with the greatest sum of squared votes, the one across which the contact is \
        thinnest, refined by a parabola through the peak and its two neighbours.\n\n\
        **Take `moments` first.** On bars of 8 to 14 by 2 to 3 tactels with 2 % noise the angle's error is 0.9° here, \
        0.3° with moments and 0.2° with their `weight = \"excess\"`, for a small part of the time. The Hough transform \
        is for lines with gaps and with other prints beside them: wire `region` to the whole mask of `binarize`, where \
        moments mix everything (4.3° against 0.3°).\n\n\
        More `angles` are not better: the parabola is then drawn through three directions close to the peak, where the \
        lattice of the tactels shows. 180 instead of 36 make the error 1.4° and take five times as long.\n\n\
        `strength` is 1 - least / greatest score over all directions: 0 for what is round, about 1 - width / length for \
        a bar. Below `min_strength`, `orientation` and `offset` are absent, as they are without a region.\n\n\
        `offset` is the distance of the line from the pad's middle, on the side toward which +x turns to +y by a \
        quarter turn from the direction; it changes its sign where the direction goes from pi/2 to -pi/2.";
    const EXAMPLE: &'static str = r#"
[nodes.hough]
type = "hough"
in.image = "calibrate.image"
in.region = "label.region"
min_strength = 0.3                  # below this it is no line [1]
"#;
}

impl Node for Hough {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let shape = setup.inputs.image.clone();
        on_one_array(&shape, "region", &setup.inputs.region)?;
        let mut mistakes = Mistakes::new();
        let count = *params.angles;
        if count < LEAST_ANGLES {
            mistakes.push(Mistake::param("angles", format!("a peak needs at least {LEAST_ANGLES} directions")));
        }
        let pitch = shape.pitch[0].max(shape.pitch[1]);
        let offset_step = params.offset_step.map_or(pitch, |step| *step);
        if pitch <= 0.0 {
            mistakes.push(Mistake::input("image", "a pad without a pitch has no lines"));
        } else if offset_step < pitch {
            let message = format!("`offset_step` is smaller than the pitch, {pitch} m: the rows of the pad would win");
            mistakes.push(Mistake::param("offset_step", message).help("leave it out to take the pitch"));
        }
        let weighing = Weighing::new(params.weight, params.threshold).unwrap_or_else(|wrong| {
            mistakes.extend(wrong);
            Weighing::Force
        });
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        let direction = |k: usize| libm::sincos(k as f64 * PI / count as f64);
        let directions = (0..count).map(direction).collect();
        Ok(Self { shape, directions, offset_step, min_strength: *params.min_strength, weighing })
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
    /// The mean place of the region from the pad's middle, and its tactels from there; nothing of an empty region.
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

    /// Lets the tactels vote for a direction. The mean of the offsets, each counted as its squared votes [m], and the
    /// sum of these.
    fn vote(&self, tactels: &[[f64; 3]], (sine, cosine): (f64, f64), votes: &mut [f64]) -> (f64, f64) {
        votes.fill(0.0);
        let middle = votes.len() / 2;
        for [x, y, weight] in tactels {
            let place = (y * cosine - x * sine) / self.offset_step + middle as f64;
            let (at, rest) = (place as usize, place - place.floor());
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

/// The longest way across a pad [m].
fn diagonal(shape: &ImageShape) -> f64 {
    libm::hypot(shape.cols as f64 * shape.pitch[0], shape.rows as f64 * shape.pitch[1])
}

/// The first of the greatest scores, and how far on the peak of the parabola through it and its neighbours lies.
fn peak(scores: &[f64]) -> (usize, f64) {
    let best = (1..scores.len()).fold(0, |best, k| if scores[k] > scores[best] { k } else { best });
    let [before, after] = [scores.len() - 1, 1].map(|step| scores[(best + step) % scores.len()]);
    let bend = before - 2.0 * scores[best] + after;
    (best, if bend < 0.0 { (0.5 * (before - after) / bend).clamp(-0.5, 0.5) } else { 0.0 })
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};

    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::node::At;
    use tactflow_runtime::signal::{Grid, Scalar, Shape, Unit};

    use super::*;
    use crate::random::Random;

    fn wires(rows: usize, cols: usize, pitch: [f64; 2]) -> [(&'static str, Shape); 2] {
        let image = ImageShape { rows, cols, pitch, unit: Unit::NEWTON };
        [("region", Grid::from(&image).into()), ("image", image.into())]
    }

    /// Direction, offset and strength of the tactels that a function gives a positive value, on 16 by 16.
    fn run(params: &str, pitch: [f64; 2], value: impl Fn(f64, f64) -> f64) -> [Option<f64>; 3] {
        let mut rig = NodeRig::new::<Hough>(params, &wires(16, 16, pitch)).unwrap();
        let (mut image, mut region) = (Image::zeros(16, 16), Mask::empty(16, 16));
        for (i, j) in (0..16).flat_map(|i| (0..16).map(move |j| (i, j))) {
            let value = value(j as f64, i as f64);
            image.cells_mut()[16 * i + j] = value as f32;
            if value > 0.0 {
                region.insert(i, j);
            }
        }
        rig.set("image", image);
        rig.set("region", region);
        rig.step();
        ["orientation", "offset", "strength"].map(|output| rig.get::<Scalar>(output).copied())
    }

    fn is(holds: bool) -> f64 {
        f64::from(u8::from(holds))
    }

    #[test]
    fn rows_columns_and_diagonals_are_exact() {
        type Value<'a> = &'a dyn Fn(f64, f64) -> f64;
        let cases: [(&str, Value<'_>, f64, f64); 6] = [
            ("a row", &|_, y| is(y == 10.0), 0.0, 0.0125),
            ("a row below the middle", &|x, y| is(y == 3.0 && x > 4.0), 0.0, -0.0225),
            ("two rows", &|_, y| is(y == 10.0 || y == 11.0), 0.0, 0.015),
            ("a column", &|x, _| is(x == 10.0), FRAC_PI_2, -0.0125),
            ("a diagonal", &|x, y| is(y == x), FRAC_PI_4, 0.0),
            ("the other, beside the middle", &|x, y| is(x + y == 19.0), -FRAC_PI_4, 0.02 / 2.0_f64.sqrt()),
        ];
        for (what, value, angle, offset) in cases {
            let [found, away, strength] = run("", [0.005; 2], value);
            assert!((found.unwrap() - angle).abs() < 1e-12, "{what}: {found:?}");
            assert!((away.unwrap() - offset).abs() < 1e-12, "{what}: {away:?}");
            assert!(strength.unwrap() > 0.7, "{what}: {strength:?}");
        }
    }

    #[test]
    fn lines_of_one_tactel_are_found_at_any_angle_and_pitch() {
        for pitch in [[0.005; 2], [0.004, 0.006]] {
            let mut squares = 0.0;
            for degrees in (-89..=90).step_by(7) {
                let (sine, cosine) = libm::sincos(f64::from(degrees).to_radians());
                let away = |x: f64, y: f64| ((y - 7.8) * pitch[1] * cosine - (x - 7.1) * pitch[0] * sine).abs();
                let [found, offset, _] = run("", pitch, |x, y| (1.0 - away(x, y) / 0.006).max(0.0));
                let off = found.unwrap() - f64::from(degrees).to_radians();
                squares += libm::sin(off) * libm::sin(off) / 26.0;
                assert!(libm::sin(off).abs() < 0.045, "{degrees} degrees, pitch {pitch:?}: {found:?}");
                let drawn = 0.3 * pitch[1] * cosine + 0.4 * pitch[0] * sine;
                let side = if libm::cos(off) > 0.0 { 1.0 } else { -1.0 };
                assert!(
                    (side * offset.unwrap() - drawn).abs() < 3e-4,
                    "{degrees} degrees, pitch {pitch:?}: {offset:?}"
                );
            }
            // Rows and columns of the pad attract such a line a little.
            assert!(squares.sqrt().to_degrees() < 0.7, "{} degrees, pitch {pitch:?}", squares.sqrt().to_degrees());
        }
    }

    #[test]
    fn a_shift_by_a_tactel_changes_the_offset_only() {
        let mut random = Random::new(4, 0);
        let values: Vec<f64> = (0..256).map(|_| random.uniform(0.0, 1.0)).collect();
        let at = |di: f64, dj: f64| {
            run("min_strength = 0", [0.005, 0.004], |x, y| {
                let (x, y) = (x - dj, y - di);
                let is_in = (1.0..11.0).contains(&x) && (0.5 * x - y + 2.0).abs() < 1.5;
                if is_in { values[(16.0 * y + x) as usize] } else { 0.0 }
            })
            .map(Option::unwrap)
        };
        let [angle, offset, strength] = at(0.0, 0.0);
        for (di, dj) in [(1.0, 0.0), (0.0, 1.0), (4.0, 3.0)] {
            let [shifted, away, strong] = at(di, dj);
            assert!((shifted - angle).abs() < 1e-9 && (strong - strength).abs() < 1e-9, "{di}, {dj}");
            let way = di * 0.004 * libm::cos(angle) - dj * 0.005 * libm::sin(angle);
            assert!((away - offset - way).abs() < 1e-9, "{di}, {dj}: {away}");
        }
    }

    #[test]
    fn what_is_no_line_has_none() {
        let disc = |x: f64, y: f64| is(libm::hypot(x - 7.3, y - 7.8) < 4.0);
        let [angle, offset, strength] = run("", [0.005; 2], disc);
        assert_eq!((angle, offset), (None, None));
        assert!(strength.unwrap() < 0.3, "{strength:?}");
        assert_eq!(run("", [0.005; 2], |_, _| 0.0), [None; 3]);
        let tactel = run("min_strength = 0", [0.005; 2], |x, y| is(x == 3.0 && y == 4.0));
        assert_eq!(tactel, [None, None, Some(0.0)], "all directions are as good");
        let faint = run("weight = \"excess\"\nthreshold = 2.0", [0.005; 2], |x, y| is(x == y));
        assert_eq!(faint, [None; 3], "nobody votes");
        // 3 by 6: half as wide as long
        let bar = |x: f64, y: f64| is((4.0..10.0).contains(&x) && (6.0..9.0).contains(&y));
        for (params, has_line) in [("min_strength = 0.35", true), ("min_strength = 0.55", false)] {
            let [angle, _, strength] = run(params, [0.005; 2], bar);
            assert_eq!(angle.is_some(), has_line, "{params}: {strength:?}");
        }
    }

    #[test]
    fn what_is_refused() {
        let cases = [
            ("angles = 7", At::Param("angles".into())),
            ("offset_step = 0.0049", At::Param("offset_step".into())),
            ("weight = \"excess\"", At::Param("weight".into())),
            ("threshold = 1.0", At::Key("threshold".into())),
        ];
        for (params, at) in cases {
            let mistakes = NodeRig::new::<Hough>(params, &wires(4, 4, [0.005, 0.004])).err().unwrap();
            assert_eq!((mistakes.len(), &mistakes[0].at), (1, &at), "{params}");
        }
        let flat = NodeRig::new::<Hough>("", &wires(4, 4, [0.0; 2])).err().unwrap();
        assert_eq!(flat[0].at, At::Input("image".into()));
        for bad in ["angles = 0", "offset_step = 0", "min_strength = 1.1"] {
            assert!(NodeRig::new::<Hough>(bad, &wires(4, 4, [0.005; 2])).is_err(), "{bad}");
        }
    }
}
