//! `calibrate_vectors` at rest, after an absence and after a tare.

use tactflow_runtime::harness::NodeRig;
use tactflow_runtime::random::Random;

use super::*;

fn rig(params: &str) -> Result<NodeRig, Mistakes> {
    let shape = ImageShape { rows: 2, cols: 3, pitch: [0.005; 2], unit: Unit::RAW };
    NodeRig::new::<CalibrateVectors>(params, &[("vectors", VectorImageShape(shape).into())])
}

fn show(rig: &mut NodeRig, value: impl Fn(usize) -> f64) {
    let mut image = VectorImage::zeros(2, 3);
    image.cells_mut().as_flattened_mut().iter_mut().enumerate().for_each(|(i, cell)| *cell = value(i) as f32);
    rig.set("vectors", image);
    rig.step();
}

#[test]
fn the_mean_at_rest_is_the_zero_and_the_gain_makes_forces() {
    let mut rig = rig("gain = [0.001, -0.002, 0.003]\nrest_frames = 20").unwrap();
    for frame in 0..20 {
        assert!(rig.get::<VectorImage>("vectors").is_none(), "{frame}");
        // Noise that cancels in pairs, so that the mean is exact.
        let sign = if frame % 2 == 0 { 1.0 } else { -1.0 };
        show(&mut rig, |i| 100.0 * i as f64 + 2.0 * sign);
    }
    assert_eq!(rig.get::<bool>("failed").copied(), Some(false));
    show(&mut rig, |i| 100.0 * i as f64 + 50.0);
    let image = rig.get::<VectorImage>("vectors").unwrap();
    for cell in image.cells() {
        for (force, wanted) in cell.iter().zip([0.05, -0.1, 0.15]) {
            assert!((force - wanted).abs() < 1e-6, "{cell:?}");
        }
    }
}

#[test]
fn a_pad_that_moves_rests_again_and_fails_the_second_time() {
    let mut rig = rig("gain = [1.0, 1.0, 1.0]\nrest_frames = 16").unwrap();
    let mut random = Random::new(3, 0);
    let mut run = |rig: &mut NodeRig, drift: f64, frames: usize| {
        for frame in 0..frames {
            let noise: Vec<f64> = (0..18).map(|_| random.normal()).collect();
            show(rig, |i| noise[i] + if i == 13 { drift * frame as f64 } else { 0.0 });
        }
    };
    run(&mut rig, 10.0, 16);
    assert!(rig.get::<VectorImage>("vectors").is_none() && rig.get::<bool>("failed").is_none(), "once more");
    run(&mut rig, 0.0, 16);
    assert!(rig.get::<VectorImage>("vectors").is_some());
    let mut rig = self::rig("gain = [1.0, 1.0, 1.0]\nrest_frames = 16").unwrap();
    run(&mut rig, 10.0, 32);
    assert_eq!(rig.get::<bool>("failed").copied(), Some(true));
    let found = rig.found().unwrap();
    assert!(found.contains("y of row 1, column 1 changed within 16 frames"), "{found}");
    run(&mut rig, 0.0, 20);
    assert!(rig.get::<VectorImage>("vectors").is_none(), "a pad that failed stays absent");
}

/// Rests with white noise of 2 raw, about these zeros.
fn rested(params: &str, zero: impl Fn(usize) -> f64) -> NodeRig {
    let mut rig = rig(params).unwrap();
    let mut random = Random::new(8, 0);
    for _ in 0..40 {
        let noise: Vec<f64> = (0..18).map(|_| 2.0 * random.normal()).collect();
        show(&mut rig, |i| zero(i) + noise[i]);
    }
    rig
}

#[test]
fn a_dead_axis_does_not_pass() {
    // z of every tactel never changes.
    let dead = |params: &str| {
        let mut rig = rig(params).unwrap();
        let mut random = Random::new(8, 0);
        for _ in 0..80 {
            let noise: Vec<f64> = (0..18).map(|_| random.normal()).collect();
            show(&mut rig, |i| if i % 3 == 2 { 7.0 } else { noise[i] });
        }
        rig
    };
    let rig = dead("gain = [1.0, 1.0, 1.0]");
    assert_eq!(rig.get::<bool>("failed").copied(), Some(true));
    let found = rig.found().unwrap();
    assert!(found.contains("an axis is dead: z of row 0, column 0 and others"), "{found}");
    assert!(dead("gain = [1.0, 1.0, 1.0]\nmay_repeat = true").get::<VectorImage>("vectors").is_some());
}

#[test]
fn sound_pads_rest_at_the_first_attempt() {
    // White noise on a pad with many values, in the shortest rest.
    let shape = ImageShape { rows: 64, cols: 64, pitch: [0.005; 2], unit: Unit::RAW };
    for seed in 0..10 {
        let inputs = [("vectors", VectorImageShape(shape.clone()).into())];
        let mut rig = NodeRig::new::<CalibrateVectors>("gain = [1.0, 1.0, 1.0]\nrest_frames = 16", &inputs).unwrap();
        let mut random = Random::new(seed, 0);
        for _ in 0..16 {
            let mut image = VectorImage::zeros(64, 64);
            image.cells_mut().as_flattened_mut().iter_mut().for_each(|value| *value = random.normal() as f32);
            rig.set("vectors", image);
            rig.step();
        }
        assert_eq!(rig.get::<bool>("failed").copied(), Some(false), "seed {seed}");
    }
}

#[test]
fn the_zeros_outlast_an_absence_and_a_tare_takes_them_anew() {
    let mut rig = rested("gain = [1.0, 1.0, 1.0]", |_| 100.0);
    let force = |rig: &mut NodeRig, value: f64| {
        show(rig, |_| value);
        rig.get::<VectorImage>("vectors").map(|image| image.cells()[2][1])
    };
    let near = |found: Option<f32>, wanted: f32| found.is_some_and(|found| (found - wanted).abs() < 1.5);
    assert!(near(force(&mut rig, 150.0), 50.0));
    rig.lose("vectors");
    for _ in 0..500 {
        rig.step();
    }
    assert!(rig.get::<VectorImage>("vectors").is_none());
    assert!(near(force(&mut rig, 150.0), 50.0), "a pad in contact cannot rest again");
    // It is refused while something touches the pad.
    let refused = rig.can_tare().unwrap().unwrap_err();
    assert!(refused.contains("something touches the pad") && refused.contains("50."), "{refused}");
    assert!(near(force(&mut rig, 105.0), 5.0));
    assert_eq!(rig.can_tare(), Some(Ok(())));
    rig.tare();
    assert_eq!(force(&mut rig, 105.0), None, "it rests");
    let mut random = Random::new(9, 0);
    for _ in 0..39 {
        let noise: Vec<f64> = (0..18).map(|_| 2.0 * random.normal()).collect();
        show(&mut rig, |i| 105.0 + noise[i]);
    }
    assert!(near(force(&mut rig, 105.0), 0.0));
}

#[test]
fn without_frames_at_rest_the_zeros_are_zero() {
    let mut rig = rig("gain = [2.0, 2.0, 2.0]\nrest_frames = 0").unwrap();
    show(&mut rig, |_| 3.0);
    assert_eq!(rig.get::<VectorImage>("vectors").unwrap().cells(), [[6.0; 3]; 6]);
}

#[test]
fn wrong_numbers_are_refused() {
    for (params, at) in
        [("gain = [1.0, 0.0, 1.0]", "gain"), ("gain = [1.0, 1.0, 1.0]\nrest_frames = 15", "rest_frames")]
    {
        let mistakes = rig(params).err().unwrap();
        assert_eq!(mistakes[0].at, tactflow_runtime::node::At::Param(at.into()), "{params}");
    }
}
