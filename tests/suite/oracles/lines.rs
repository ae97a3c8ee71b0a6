//! Lines on a rendered pad: the angle and the place that were drawn against those that are found.
//!
//! A bar is drawn at sub-points of a millimetre, spread by 3 mm of foam, and summed per tactel; then there is noise.

use std::f64::consts::PI;

use libm::erf;
use tactflow_nodes::touch::binarize::binarize;
use tactflow_nodes::touch::hough::Hough;
use tactflow_nodes::touch::label::{contact, number, paint, trace};
use tactflow_nodes::touch::moments::Moments;
use tactflow_runtime::harness::NodeRig;
use tactflow_runtime::node::Node;
use tactflow_runtime::random::Random;
use tactflow_runtime::signal::{Grid, Image, ImageShape, Mask, Regions, Scalar, Unit};

const SIZE: usize = 16;
const PITCH: f64 = 0.005;

/// A bar: length and width, direction and place [m, rad].
#[derive(Debug, Clone, Copy)]
struct Bar {
    length: f64,
    width: f64,
    angle: f64,
    x: f64,
    y: f64,
}

/// Spread of the foam [m].
const FOAM: f64 = 0.003;
/// Sub-points along the side of a tactel.
const POINTS: usize = 5;

impl Bar {
    /// The force at a place: the bar's 1 inside and 0 outside, spread by the foam.
    fn at(&self, x: f64, y: f64) -> f64 {
        let (sine, cosine) = libm::sincos(self.angle);
        let (x, y) = (x - self.x, y - self.y);
        let (along, across) = (cosine * x + sine * y, cosine * y - sine * x);
        let inside = |half: f64, at: f64| {
            let scale = FOAM * std::f64::consts::SQRT_2;
            0.5 * (erf((half - at) / scale) + erf((half + at) / scale))
        };
        inside(0.5 * self.length, along) * inside(0.5 * self.width, across)
    }

    fn image(&self, noise: f64, random: &mut Random) -> Image {
        let mut image = Image::zeros(SIZE, SIZE);
        for (at, cell) in image.cells_mut().iter_mut().enumerate() {
            let corner = |k: usize| (k as f64 - SIZE as f64 / 2.0) * PITCH;
            let step = |k: usize| (k as f64 + 0.5) / POINTS as f64 * PITCH;
            let mut sum = 0.0;
            for (a, b) in (0..POINTS).flat_map(|a| (0..POINTS).map(move |b| (a, b))) {
                sum += self.at(corner(at % SIZE) + step(b), corner(at / SIZE) + step(a));
            }
            *cell = (sum / (POINTS * POINTS) as f64) as f32;
        }
        for cell in image.cells_mut() {
            *cell += (noise * random.normal()) as f32;
        }
        image
    }
}

/// The contact: the largest region above the threshold.
fn region(image: &Image, threshold: f32) -> Mask {
    let (mut mask, mut region, mut all) =
        (Mask::empty(SIZE, SIZE), Mask::empty(SIZE, SIZE), Regions::with_room(SIZE, SIZE));
    binarize(image.cells(), threshold, &mut mask);
    let (runs, list) = all.parts_mut();
    trace(&mask, 1, runs);
    number(image, runs, list);
    paint(runs, contact(list, 1, 0.0).unwrap(), &mut region);
    region
}

fn rig<N: Node>(params: &str) -> NodeRig {
    let shape = ImageShape { rows: SIZE, cols: SIZE, pitch: [PITCH; 2], unit: Unit::NEWTON };
    NodeRig::new::<N>(params, &[("region", Grid::from(&shape).into()), ("image", shape.into())]).unwrap()
}

/// Shows an image and a region, and reads outputs.
fn show<const N: usize>(rig: &mut NodeRig, image: &Image, region: &Mask, outputs: [&str; N]) -> [Option<f64>; N] {
    rig.set("image", image.clone());
    rig.set("region", region.clone());
    rig.step();
    outputs.map(|output| rig.get::<Scalar>(output).copied())
}

/// Difference of two directions of lines [degrees].
fn turned(found: f64, drawn: f64) -> f64 {
    let off = found - drawn;
    (off - PI * (off / PI).round()).to_degrees()
}

fn root_mean_square(errors: &[f64]) -> f64 {
    (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt()
}

/// A bar at every half degree, of a length and a width between bounds [tactels], with 2 % noise; and its image.
fn bars(length: [f64; 2], width: [f64; 2]) -> Vec<(Bar, Image)> {
    let mut random = Random::new(7, 0);
    let bar = |k: u32| {
        let bar = Bar {
            length: random.uniform(length[0], length[1]) * PITCH,
            width: random.uniform(width[0], width[1]) * PITCH,
            angle: (0.5 * (f64::from(k) + random.uniform(0.0, 1.0)) - 90.0).to_radians(),
            x: random.uniform(-0.5, 0.5) * PITCH,
            y: random.uniform(-0.5, 0.5) * PITCH,
        };
        let image = bar.image(0.02, &mut random);
        (bar, image)
    };
    (0..360).map(bar).collect()
}

/// Error of the direction over all bars [degrees]; every one has a direction.
fn angle_error(bars: &[(Bar, Image)], threshold: f32, rig: &mut NodeRig) -> f64 {
    let error = |(bar, image): &(Bar, Image)| {
        let [angle] = show(rig, image, &region(image, threshold), ["orientation"]);
        turned(angle.unwrap(), bar.angle)
    };
    root_mean_square(&bars.iter().map(error).collect::<Vec<_>>())
}

#[test]
fn moments_find_the_direction_of_a_bar() {
    // length [tactels], threshold as part of the greatest force, bounds on the error by force and by excess [degrees]
    let cases = [
        ([8.0, 14.0], 0.1, 0.4, 0.22),
        ([8.0, 14.0], 0.15, 0.42, 0.25),
        ([6.0, 8.0], 0.1, 0.76, 0.48),
        ([6.0, 8.0], 0.15, 1.0, 0.53),
    ];
    for (length, threshold, by_force, by_excess) in cases {
        let bars = bars(length, [2.0, 3.0]);
        let mut excess = rig::<Moments>(&format!("weight = \"excess\"\nthreshold = {threshold}"));
        let force = angle_error(&bars, threshold, &mut rig::<Moments>(""));
        let excess = angle_error(&bars, threshold, &mut excess);
        let what = format!("{length:?}, threshold {threshold}: {force:.3} by force, {excess:.3} by excess");
        assert!(force < by_force && excess < by_excess && excess < 0.7 * force, "{what}");
    }
}

#[test]
fn the_hough_transform_finds_the_direction_and_the_place_of_a_bar() {
    let bars = bars([8.0, 14.0], [2.0, 3.0]);
    for (params, bound) in [("", 1.0), ("weight = \"excess\"\nthreshold = 0.1", 1.1), ("angles = 180", 1.5)] {
        let error = angle_error(&bars, 0.1, &mut rig::<Hough>(params));
        assert!(error < bound, "{error:.3} degrees with {params:?}");
    }
    let mut rig = rig::<Hough>("");
    let offset = |(bar, image): &(Bar, Image)| {
        let [angle, offset] = show(&mut rig, image, &region(image, 0.1), ["orientation", "offset"]).map(Option::unwrap);
        // Of the drawn line, named by the direction that was found.
        let side = if turned(angle, bar.angle).abs() < 45.0 && (angle - bar.angle).abs() < 1.0 { 1.0 } else { -1.0 };
        let (sine, cosine) = libm::sincos(bar.angle);
        1e3 * (offset - side * (bar.y * cosine - bar.x * sine))
    };
    let error = root_mean_square(&bars.iter().map(offset).collect::<Vec<_>>());
    assert!(error < 0.1, "{error:.3} mm off");
}

/// The direction of the plain Hough transform: that of the greatest vote.
fn greatest_vote(image: &Image, region: &Mask) -> f64 {
    let middle = (SIZE as f64 - 1.0) / 2.0;
    let tactels = (0..SIZE * SIZE).map(|at| (at / SIZE, at % SIZE)).filter(|(i, j)| region.contains(*i, *j));
    let tactels: Vec<_> =
        tactels.map(|(i, j)| (j as f64 - middle, i as f64 - middle, f64::from(image.row(i)[j]))).collect();
    let vote = |degrees: i32| {
        let (sine, cosine) = libm::sincos(f64::from(degrees).to_radians());
        let mut votes = [0.0; 60];
        for (x, y, weight) in &tactels {
            votes[(y * cosine - x * sine + 30.0).round() as usize] += weight;
        }
        votes.into_iter().fold(0.0, f64::max)
    };
    f64::from((0..180).max_by(|a, b| vote(*a).total_cmp(&vote(*b))).unwrap()).to_radians()
}

#[test]
fn the_greatest_vote_is_the_diagonal_of_a_bar() {
    let errors = bars([8.0, 14.0], [2.5, 3.0]).into_iter().map(|(bar, image)| {
        let region = region(&image, 0.1);
        turned(greatest_vote(&image, &region), bar.angle)
    });
    let error = root_mean_square(&errors.collect::<Vec<_>>());
    assert!(error > 5.0, "{error:.3} degrees: then there is no need for squares");
}

#[test]
fn a_line_with_a_gap_and_a_print_beside_it_is_for_the_hough_transform() {
    let mut random = Random::new(5, 0);
    let (mut hough, mut moments) = (rig::<Hough>(""), rig::<Moments>(""));
    let mut errors = [Vec::new(), Vec::new()];
    for k in 0..90 {
        let angle = f64::from(2 * k - 89).to_radians();
        let (sine, cosine) = libm::sincos(angle);
        let at = |along: f64, across: f64, length: f64| Bar {
            length: length * PITCH,
            width: 1.5 * PITCH,
            angle,
            x: (along * cosine - across * sine) * PITCH,
            y: (along * sine + across * cosine) * PITCH,
        };
        let parts = [at(-3.8, 0.0, 5.0), at(3.8, 0.0, 5.0), at(2.0, 4.5, 1.5)];
        let mut image = Image::zeros(SIZE, SIZE);
        for part in parts {
            let part = part.image(0.01, &mut random);
            image.cells_mut().iter_mut().zip(part.cells()).for_each(|(sum, cell)| *sum += cell);
        }
        // All tactels of the mask, not only those of the largest region.
        let mut mask = Mask::empty(SIZE, SIZE);
        binarize(image.cells(), 0.1, &mut mask);
        for (rig, errors) in [&mut hough, &mut moments].into_iter().zip(&mut errors) {
            let [found] = show(rig, &image, &mask, ["orientation"]);
            errors.push(turned(found.unwrap(), angle));
        }
    }
    let [hough, moments] = errors.map(|errors| root_mean_square(&errors));
    assert!(hough < 0.6 && moments > 3.0, "{hough:.2} degrees, moments {moments:.2}");
}

#[test]
fn the_centre_of_gravity_is_where_the_print_is() {
    // A print of 2 mm, as in Fig. 2 of the paper, and larger ones [m]; bounds on the error by force, excess and area [mm].
    for (size, bounds) in [(0.002, [0.2, 0.13, 0.9]), (0.01, [0.16, 0.12, 0.6]), (0.02, [0.13, 0.09, 0.55])] {
        let thresholds = ["", "weight = \"excess\"\nthreshold = 0.1", "weight = \"area\""];
        let mut errors = [0.0; 3];
        for (params, error) in thresholds.into_iter().zip(&mut errors) {
            let (mut random, mut rig) = (Random::new(9, 0), rig::<Moments>(params));
            let mut off = Vec::new();
            for _ in 0..300 {
                let [x, y] = [0, 1].map(|_| random.uniform(-1.5, 1.5) * PITCH);
                let bar = Bar { length: size, width: size, angle: random.uniform(0.0, 1.0), x, y };
                let mut image = bar.image(0.0, &mut random);
                let greatest = image.cells().iter().copied().fold(0.0, f32::max);
                image.cells_mut().iter_mut().for_each(|cell| *cell /= greatest);
                image.cells_mut().iter_mut().for_each(|cell| *cell += (0.02 * random.normal()) as f32);
                let found = show(&mut rig, &image, &region(&image, 0.1), ["x", "y"]).map(Option::unwrap);
                off.extend([1e3 * (found[0] - x), 1e3 * (found[1] - y)]);
            }
            *error = root_mean_square(&off);
        }
        assert!(errors.iter().zip(&bounds).all(|(error, bound)| error < bound), "{size} m: {errors:?} mm");
    }
}
