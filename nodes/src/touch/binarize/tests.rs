//! `binarize` tactel by tactel, against naive references.

use proptest::prelude::*;
use tactflow_runtime::harness::{FedRole, GraphRig, NodeRig, places};
use tactflow_runtime::node::At;
use tactflow_runtime::signal::{Image, ImageShape, Mask, Unit};

use super::*;
use tactflow_runtime::random::Random;

fn rig(params: &str, rows: usize, cols: usize) -> Result<NodeRig, Mistakes> {
    let shape = ImageShape { rows, cols, pitch: [0.005; 2], unit: Unit::NEWTON };
    NodeRig::new::<Binarize>(params, &[("image", shape.into())])
}

fn show(rig: &mut NodeRig, cols: usize, cells: &[f32]) -> Mask {
    rig.set("image", Image::from_cells(cols, cells));
    rig.step();
    rig.get::<Mask>("mask").unwrap().clone()
}

fn run(threshold: f64, cols: usize, cells: &[f32]) -> Mask {
    show(&mut rig(&format!("threshold = {threshold:?}"), cells.len() / cols, cols).unwrap(), cols, cells)
}

/// The mask of the tactels for which `is_in` holds.
fn mask_of(cols: usize, cells: &[f32], is_in: impl Fn(usize, f32) -> bool) -> Mask {
    let mut mask = Mask::empty(cells.len() / cols, cols);
    for (at, _) in cells.iter().enumerate().filter(|(at, value)| is_in(*at, **value)) {
        mask.insert(at / cols, at % cols);
    }
    mask
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
fn what_is_refused() {
    let too_large = "1e39 is too large: a tactel is a 32-bit float";
    let cases = [
        ("threshold = 1e39", At::Param("threshold".into()), too_large),
        ("threshold = 1\nrelease = -1e39", At::Param("release".into()), "-1e39 is too large"),
        ("threshold = 1\nrelease = 1.0", At::Param("release".into()), "`release` is not lower than `threshold`"),
        ("threshold = 1\nrelease = 2", At::Param("release".into()), "`release` is not lower than `threshold`"),
        (
            "threshold = 1\nrelease = 0.5\nmethod = \"otsu\"",
            At::Key("release".into()),
            "`release` cannot be used with `method = \"otsu\"`",
        ),
    ];
    for (params, at, message) in cases {
        let mistakes = rig(params, 1, 1).err().unwrap();
        assert_eq!((mistakes.len(), &mistakes[0].at), (1, &at), "{params}");
        assert!(mistakes[0].message.starts_with(message), "{params}: {}", mistakes[0].message);
    }
    assert_eq!(rig("threshold = 1e39\nrelease = 1e40", 1, 1).err().unwrap().len(), 2);
    for (bad, place) in [
        ("threshold = nan", "bad-value: `nan`"),
        ("threshold = \"1\"", "bad-value: `\"1\"`"),
        ("", "missing-key: `the node`"),
        ("method = \"otsu\"", "missing-key: `the node`"),
        ("threshold = 1\nmethod = 1", "bad-value: `1`"),
    ] {
        assert_eq!(places(bad, &rig(bad, 1, 1)), [place], "{bad}");
    }
    let word = rig("threshold = 1\nmethod = \"otus\"", 1, 1).err().unwrap();
    assert_eq!(word[0].message, "expected one of `fixed`, `otsu`, found the string \"otus\"");
}

#[test]
fn a_tactel_enters_above_the_one_threshold_and_stays_above_the_other() {
    let mut rig = rig("threshold = 2\nrelease = 1", 1, 1).unwrap();
    let course = [(1.5, false), (2.0, false), (2.1, true), (1.5, true), (1.1, true), (1.0, false), (1.5, false)];
    for (value, is_in) in course {
        assert_eq!(show(&mut rig, 1, &[value]).count() == 1, is_in, "{value}");
    }
    show(&mut rig, 1, &[3.0]);
    rig.lose("image");
    rig.step();
    assert_eq!(show(&mut rig, 1, &[1.5]).count(), 1, "a frame of flicker forgets nothing");
    rig.lose("image");
    rig.step_ms(20.0);
    rig.step();
    assert_eq!(show(&mut rig, 1, &[1.5]).count(), 0, "a lasting absence does");
}

#[test]
fn hysteresis_takes_the_flicker_out_of_a_contact() {
    // A cone whose rim passes through the threshold, with 2 % noise: how often |R| changes in 500 frames.
    let flicker = |params: &str| {
        let mut rig = rig(params, 16, 16).unwrap();
        let mut random = Random::new(5, 0);
        let areas: Vec<usize> = (0..500)
            .map(|_| {
                let cells: Vec<f32> = (0..256)
                    .map(|at: usize| {
                        let noise = random.normal();
                        let away = ((at / 16) as f64 - 7.3).hypot((at % 16) as f64 - 7.6);
                        ((1.0 - away / 8.0).max(0.0) + 0.02 * noise) as f32
                    })
                    .collect();
                show(&mut rig, 16, &cells).count()
            })
            .collect();
        areas.windows(2).filter(|pair| pair[0] != pair[1]).count()
    };
    let (one, two) = (flicker("threshold = 0.15"), flicker("threshold = 0.15\nrelease = 0.07"));
    assert!(one > 400 && two < 80, "|R| changes {one} times with one threshold, {two} times with two");
}

#[test]
fn otsu_splits_between_two_classes_and_never_below_the_floor() {
    // least threshold, cells, how many tactels are above
    let cases: [(f64, &[f32], usize); 10] = [
        (0.1, &[0.0; 8], 0),
        (0.1, &[0.09, 0.01, 0.02, 0.1], 0),
        (0.1, &[5.0; 8], 8),
        (5.0, &[5.0; 8], 0),
        (0.1, &[0.0, 0.0, 0.1, 4.0, 5.0], 2),
        (4.5, &[0.0, 0.0, 0.1, 4.0, 5.0], 1),
        (-1.0, &[-0.5, -0.5, 0.0], 1),
        (0.0, &[0.0, f32::MAX, -f32::MAX], 1),
        (0.0, &[0.0, 1e-45], 1),
        // Both splits are as good: the lower one is taken.
        (-1.0, &[2.0, 0.0, 1.0], 2),
    ];
    for (least, cells, count) in cases {
        let mut rig = rig(&format!("threshold = {least:?}\nmethod = \"otsu\""), 1, cells.len()).unwrap();
        assert_eq!(show(&mut rig, cells.len(), cells).count(), count, "{least}: {cells:?}");
    }
}

/// Variance between two classes, from the values themselves; none if one is empty.
fn between(cells: &[f32], is_above: impl Fn(f64) -> bool) -> Option<f64> {
    let mean = |upper: bool| {
        let values = cells.iter().map(|value| f64::from(*value));
        let class: Vec<f64> = values.filter(|value| is_above(*value) == upper).collect();
        (!class.is_empty()).then(|| (class.len() as f64, class.iter().sum::<f64>() / class.len() as f64))
    };
    let ((n, low), (m, high)) = (mean(false)?, mean(true)?);
    Some(n * m * (high - low) * (high - low))
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
        let expected = mask_of(cols, &cells, |_, value| value > threshold as f32);
        prop_assert_eq!((mask, rows), (expected.clone(), expected.rows()));
    }

    #[test]
    fn hysteresis_is_that_of_each_tactel(
        (cols, frames) in (1..4usize, 1..150usize).prop_flat_map(|(rows, cols)| {
            (Just(cols), prop::collection::vec(prop::collection::vec(-1.0..1.0f32, rows * cols), 1..8))
        }),
        threshold in -0.5..0.5f64,
        gap in 0.01..0.5f64,
    ) {
        let params = format!("threshold = {threshold:?}\nrelease = {:?}", threshold - gap);
        let mut rig = rig(&params, frames[0].len() / cols, cols).unwrap();
        let mut is_in = vec![false; frames[0].len()];
        for cells in frames {
            for (is_in, value) in is_in.iter_mut().zip(&cells) {
                *is_in = *value > if *is_in { (threshold - gap) as f32 } else { threshold as f32 };
            }
            let expected = mask_of(cols, &cells, |at, _| is_in[at]);
            prop_assert_eq!(show(&mut rig, cols, &cells), expected.clone());
            rig.step();
            prop_assert_eq!(rig.get::<Mask>("mask"), Some(&expected), "a held image changes nothing");
        }
    }

    #[test]
    fn otsu_has_the_greatest_variance_between_the_classes(
        weak in prop::collection::vec(-0.1..0.3f32, 1..200),
        strong in prop::collection::vec(0.2..4.0f32, 0..60),
    ) {
        let cells = [weak, strong].concat();
        let threshold = otsu(&cells).map(f64::from);
        let least = cells.iter().copied().fold(f32::INFINITY, f32::min).into();
        let greatest = f64::from(cells.iter().copied().fold(f32::NEG_INFINITY, f32::max));
        prop_assert_eq!(threshold.is_some(), greatest > least);
        let Some(threshold) = threshold else { return Ok(()) };
        let found = between(&cells, |value| value > threshold).unwrap();
        // Every split at one of 255 even steps.
        let step = |value: f64| (value - least) / (greatest - least) * 255.0;
        let splits = (1..256).filter_map(|k| between(&cells, |value| step(value) >= f64::from(k)));
        let best = splits.fold(0.0, f64::max);
        prop_assert!((found - best).abs() <= 1e-9 * best, "{found} against {best}");
        // And hardly worse than the best split between any two values.
        let splits = cells.iter().filter_map(|split| between(&cells, |value| value > f64::from(*split)));
        let finest = splits.fold(0.0, f64::max);
        prop_assert!(found >= 0.97 * finest, "{found} against {finest}");
    }
}

#[test]
fn a_mode_that_adds_a_release_goes_on_from_the_mask_before_it() {
    let graph = r#"
        graph = { clock = "pad", start = "one" }
        roles.pad = "tactile_pad"
        nodes.binarize = { type = "binarize", in.image = "pad.image", threshold = 1.0 }
        [modes.one]
        go = { to = "two", after_ms = 20 }
        [modes.two]
        set.binarize.release = 0.5
        go = { to = "one", after_ms = 20 }
    "#;
    let shape = ImageShape { rows: 1, cols: 3, pitch: [0.005; 2], unit: Unit::NEWTON };
    let pad = FedRole::new("pad", "tactile_pad", 10.0).output("image", shape);
    let mut rig = GraphRig::new(crate::catalogue(), graph, vec![pad]).unwrap_or_else(|r| panic!("{}", r.render(false)));
    // The first tactel is left between both thresholds, the second enters late, the third enters once and goes.
    let frames = [
        ([2.0, 0.7, 2.0], "one", 0b101),
        ([0.7, 0.7, 0.1], "one", 0b000),
        ([2.0, 0.7, 0.1], "one", 0b001),
        ([0.7, 0.7, 0.7], "two", 0b001),
        ([0.7, 2.0, 0.7], "two", 0b011),
        ([0.7, 0.7, 0.7], "one", 0b000),
        ([0.7, 0.7, 2.0], "one", 0b100),
        ([0.7, 0.7, 0.7], "two", 0b100),
    ];
    for (i, (cells, mode, words)) in frames.into_iter().enumerate() {
        let ms = 10.0 * i as f64;
        rig.feed("pad.image", ms, Image::from_cells(3, &cells));
        let before = rig.engine.mode().map(str::to_owned);
        rig.tick(ms).unwrap();
        assert_eq!(rig.get::<Mask>("binarize.mask").unwrap().words(), [words], "{i}, in {before:?}");
        assert_eq!(before.as_deref(), Some(mode), "{i}");
    }
}
