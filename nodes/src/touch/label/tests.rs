//! `label` against pictures, a flood fill, and a simple tracker.

use tactflow_runtime::harness::{NodeRig, places};
use tactflow_runtime::node::At;
use tactflow_runtime::signal::ImageShape;

use super::*;
use tactflow_runtime::random::Random;

fn rig(params: &str, rows: usize, cols: usize) -> Result<NodeRig, Mistakes> {
    let image = ImageShape { rows, cols, pitch: [0.005, 0.004], ..ImageShape::default() };
    NodeRig::new::<Label>(params, &[("mask", Grid::from(&image).into()), ("image", image.into())])
}

fn show(rig: &mut NodeRig, image: &Image, mask: &Mask) {
    rig.set("image", image.clone());
    rig.set("mask", mask.clone());
    rig.step();
}

/// A picture: `.` is off, a digit is a tactel of that value.
fn picture(rows: &[&str]) -> (Image, Mask) {
    let cols = rows[0].len();
    let (mut image, mut mask) = (Image::zeros(rows.len(), cols), Mask::empty(rows.len(), cols));
    for (at, value) in rows.concat().bytes().enumerate().filter(|(_, byte)| *byte != b'.') {
        image.cells_mut()[at] = f32::from(value - b'0');
        mask.insert(at / cols, at % cols);
    }
    (image, mask)
}

#[test]
fn the_contact_is_the_first_of_the_largest_regions_with_the_smallest_area_and_force() {
    let two = ["11..1", "..1.1", "....9"];
    let ring = ["1111", "1..1", "1.11", "1..."];
    type Rows<'a> = &'a [&'a str];
    let cases: [(&str, Rows<'_>, Option<Rows<'_>>, usize); 14] = [
        ("", &["..", ".."], None, 0),
        ("", &["1"], Some(&["1"]), 1),
        ("", &two, Some(&["11...", "..1..", "....."]), 2),
        ("neighbours = 8", &two, Some(&["11...", "..1..", "....."]), 2),
        ("neighbours = 4", &two, Some(&["....1", "....1", "....1"]), 3),
        ("min_force = 3.0", &two, Some(&["11...", "..1..", "....."]), 2),
        ("min_force = 3.5", &two, Some(&["....1", "....1", "....1"]), 2),
        ("min_force = 11", &two, Some(&["....1", "....1", "....1"]), 2),
        ("min_force = 11.5", &two, None, 2),
        ("min_area = 3", &two, Some(&["11...", "..1..", "....."]), 2),
        ("min_area = 4", &two, None, 2),
        ("neighbours = 4", &ring, Some(&ring), 1),
        ("neighbours = 4", &["1.1", "1.1", "111"], Some(&["1.1", "1.1", "111"]), 1),
        ("neighbours = 4", &["1.", ".1"], Some(&["1.", ".."]), 2),
    ];
    for (params, rows, region, count) in cases {
        let (image, mask) = picture(rows);
        let mut rig = rig(params, mask.rows(), mask.cols()).unwrap();
        show(&mut rig, &image, &mask);
        let region = region.map(|rows| picture(rows).1);
        assert_eq!(rig.get::<Mask>("region"), region.as_ref(), "{params} {rows:?}");
        assert_eq!(rig.get::<Flag>("present"), Some(&region.is_some()), "{params} {rows:?}");
        assert_eq!(rig.get::<Regions>("regions").unwrap().list().len(), count, "{params} {rows:?}");
    }
}

#[test]
fn a_run_crosses_the_border_of_two_words_but_not_the_end_of_a_row() {
    // the tactels of two rows of 130, and how many runs they make
    let cases: [(&[(usize, usize)], usize); 4] =
        [(&[(0, 63), (1, 64)], 2), (&[(0, 63), (0, 64)], 1), (&[(0, 127), (1, 128)], 2), (&[(0, 127), (0, 129)], 2)];
    for (tactels, runs) in cases {
        let mut mask = Mask::empty(2, 130);
        tactels.iter().for_each(|(i, j)| mask.insert(*i, *j));
        let mut rig = rig("neighbours = 4", 2, 130).unwrap();
        show(&mut rig, &Image::zeros(2, 130), &mask);
        let regions = rig.get::<Regions>("regions").unwrap();
        assert_eq!((regions.runs().len(), regions.list().len()), (runs, runs), "{tactels:?}");
    }
}

#[test]
fn wrong_parameters_and_arrays_are_refused() {
    for (bad, place) in [
        ("choose = \"smallest\"", "bad-value: `\"smallest\"`"),
        ("choose = 1", "bad-value: `1`"),
        ("neighbours = 6", "bad-value: `6`"),
        ("min_area = 0", "bad-value: `0`"),
        ("min_area = -1", "bad-value: `-1`"),
        ("min_force = \"1\"", "bad-value: `\"1\"`"),
        ("neighbors = 4", "unknown-key: `neighbors`"),
    ] {
        assert_eq!(places(bad, &rig(bad, 4, 4)), [place], "{bad}");
    }
    for (rows, cols, fits) in [(256, 63, true), (1, 65535, true), (65535, 1, true), (65535, 2, true), (255, 513, true)]
    {
        assert_eq!(rig("", rows, cols).is_ok(), fits, "{rows} by {cols}");
    }
    for (rows, cols) in [(256, 512), (65536, 1), (1, 65536), (65535, 3)] {
        let mistakes = rig("", rows, cols).err().unwrap();
        assert_eq!(mistakes[0].at, At::Input("mask".into()), "{rows} by {cols}");
    }
    let image = ImageShape { rows: 4, cols: 5, ..ImageShape::default() };
    let mask = Grid { rows: 5, cols: 4, ..Grid::default() };
    let mistakes = NodeRig::new::<Label>("", &[("image", image.into()), ("mask", mask.into())]).err().unwrap();
    assert_eq!(mistakes[0].at, At::Input("mask".into()));
    assert_eq!(mistakes[0].message, "`mask` is 5 by 4 tactels, but `image` is 4 by 5");
}

/// Returns the regions by a flood fill from each tactel in raster order.
fn flood(image: &Image, mask: &Mask, neighbours: u64) -> Vec<(Mask, Region)> {
    let (rows, cols) = (mask.rows(), mask.cols());
    let mut seen = vec![false; rows * cols];
    let mut found = Vec::new();
    for at in 0..rows * cols {
        let mut open = vec![at];
        let (mut tactels, mut region) = (Mask::empty(rows, cols), Region::default());
        while let Some(at) = open.pop() {
            let (i, j) = (at / cols, at % cols);
            if seen[at] || !mask.contains(i, j) {
                continue;
            }
            seen[at] = true;
            tactels.insert(i, j);
            region.area += 1;
            region.force += f64::from(image.cells()[at]);
            for (di, dj) in (-1..=1).flat_map(|di| (-1..=1).map(move |dj| (di, dj))) {
                let (Some(i), Some(j)) = (i.checked_add_signed(di), j.checked_add_signed(dj)) else { continue };
                if i < rows && j < cols && (neighbours == 8 || di == 0 || dj == 0) {
                    open.push(i * cols + j);
                }
            }
        }
        if region.area > 0 {
            found.push((tactels, region));
        }
    }
    found
}

/// Returns the tactels of a region from its runs, and checks that no tactel is in two runs.
fn drawn(regions: &Regions, region: usize, rows: usize, cols: usize) -> Mask {
    let mut mask = Mask::empty(rows, cols);
    for run in regions.runs().iter().filter(|run| usize::from(run.region) == region) {
        for j in run.start..run.end {
            assert!(!mask.contains(run.row.into(), j.into()));
            mask.insert(run.row.into(), j.into());
        }
    }
    mask
}

/// Compares all outputs for a random mask and whole values with the flood fill.
fn compare(rig: &mut NodeRig, (rows, cols, neighbours): (usize, usize, u64), random: &mut Random, percent: u32) {
    let (mut image, mut mask) = (Image::zeros(rows, cols), Mask::empty(rows, cols));
    for at in 0..rows * cols {
        image.cells_mut()[at] = (random.uniform(0.0, 1.0) * 4096.0).floor() as f32;
        if random.uniform(0.0, 1.0) * 100.0 < f64::from(percent) {
            mask.insert(at / cols, at % cols);
        }
    }
    show(rig, &image, &mask);
    let expected = flood(&image, &mask, neighbours);
    let regions = rig.get::<Regions>("regions").unwrap();
    assert_eq!(regions.list(), expected.iter().map(|(_, region)| *region).collect::<Vec<_>>(), "{mask:?}");
    for (i, (tactels, _)) in expected.iter().enumerate() {
        assert_eq!(&drawn(regions, i, rows, cols), tactels, "region {i} of {mask:?}");
    }
    let candidates = expected.iter().filter(|(_, region)| region.area >= 2 && region.force >= 5000.0);
    let largest = candidates.rev().max_by_key(|(_, region)| region.area).map(|(tactels, _)| tactels);
    assert_eq!(rig.get::<Mask>("region"), largest, "{mask:?}");
    assert_eq!(rig.get::<Flag>("present"), Some(&largest.is_some()));
}

#[test]
fn regions_agree_with_a_flood_fill() {
    let mut random = Random::new(1, 0);
    let sizes = [
        (1, 1),
        (1, 2),
        (2, 1),
        (2, 2),
        (3, 5),
        (5, 3),
        (8, 8),
        (16, 16),
        (1, 64),
        (4, 63),
        (4, 64),
        (4, 65),
        (3, 127),
        (3, 128),
        (9, 130),
        (28, 28),
        (40, 3),
        (1, 200),
    ];
    for (rows, cols) in sizes {
        for neighbours in [4, 8] {
            let params = format!("neighbours = {neighbours}\nmin_area = 2\nmin_force = 5000");
            let mut rig = rig(&params, rows, cols).unwrap();
            for round in 0..95 {
                compare(&mut rig, (rows, cols, neighbours), &mut random, 5 + round % 19 * 5);
            }
        }
    }
}

/// A frame of a film: 16 by 20 tactels of 5 by 4 mm, with discs at places and with radii in tactels.
fn frame(discs: &[([f64; 2], f64)]) -> (Image, Mask) {
    let (mut image, mut mask) = (Image::zeros(16, 20), Mask::empty(16, 20));
    for (i, j) in (0..16).flat_map(|i| (0..20).map(move |j| (i, j))) {
        let is_in = |([x, y], radius): &([f64; 2], f64)| (j as f64 - x).hypot(i as f64 - y) <= *radius;
        if discs.iter().any(is_in) {
            image.cells_mut()[i * 20 + j] = 1.0;
            mask.insert(i, j);
        }
    }
    (image, mask)
}

/// Returns the centroid of the contact [tactels].
fn contact_at(rig: &NodeRig) -> Option<[f64; 2]> {
    rig.get::<Mask>("region").map(|region| centroid(region, [1.0, 1.0]))
}

/// Returns the mean column and row of a mask, times the pitch.
fn centroid(mask: &Mask, pitch: [f64; 2]) -> [f64; 2] {
    let tactels = (0..mask.rows()).flat_map(|i| (0..mask.cols()).map(move |j| (i, j)));
    let tactels: Vec<(usize, usize)> = tactels.filter(|(i, j)| mask.contains(*i, *j)).collect();
    let mean = |of: fn(&(usize, usize)) -> usize| tactels.iter().map(of).sum::<usize>() as f64 / tactels.len() as f64;
    [mean(|(_, j)| *j) * pitch[0], mean(|(i, _)| *i) * pitch[1]]
}

#[test]
fn a_larger_second_touch_takes_over_unless_the_nearest_is_chosen() {
    let (small, large) = (([4.0, 4.0], 1.0), ([14.0, 10.0], 3.0));
    for (params, stays) in [("", false), ("choose = \"largest\"", false), ("choose = \"nearest\"", true)] {
        let mut rig = rig(params, 16, 20).unwrap();
        let mut show = |discs: &[_]| {
            let (image, mask) = frame(discs);
            show(&mut rig, &image, &mask);
            contact_at(&rig)
        };
        assert_eq!(show(&[small]), Some([4.0, 4.0]), "{params}");
        assert_eq!(show(&[small, large]), Some(if stays { [4.0, 4.0] } else { [14.0, 10.0] }), "{params}");
        assert_eq!(show(&[large]), Some([14.0, 10.0]), "{params}: the remaining region is the contact");
        assert_eq!(show(&[small, large]), Some([14.0, 10.0]), "{params}: the contact stays");
    }
}

#[test]
fn the_position_of_a_contact_survives_flicker_but_not_a_long_absence() {
    let (small, large) = (([4.0, 4.0], 1.0), ([14.0, 10.0], 3.0));
    for (frames_without, expected) in [(1, [4.0, 4.0]), (4, [4.0, 4.0]), (5, [14.0, 10.0]), (20, [14.0, 10.0])] {
        let mut rig = rig("choose = \"nearest\"\nmin_area = 2", 16, 20).unwrap();
        let mut show = |discs: &[_]| {
            let (image, mask) = frame(discs);
            rig.set("image", image);
            rig.set("mask", mask);
            rig.step_ms(4.0);
            contact_at(&rig)
        };
        show(&[small]);
        for _ in 0..frames_without {
            assert_eq!(show(&[([9.0, 9.0], 0.5)]), None, "a single tactel is not a contact");
        }
        assert_eq!(show(&[small, large]), Some(expected), "after {frames_without} frames of 4 ms");
    }
    // The image itself may be lost too.
    let mut rig = rig("choose = \"nearest\"", 16, 20).unwrap();
    for (ms, expected) in [(1.0, [4.0, 4.0]), (20.0, [14.0, 10.0])] {
        let (image, mask) = frame(&[small]);
        show(&mut rig, &image, &mask);
        rig.lose("image");
        rig.step_ms(ms);
        rig.step();
        let (image, mask) = frame(&[small, large]);
        show(&mut rig, &image, &mask);
        assert_eq!(contact_at(&rig), Some(expected), "after {ms} ms");
        rig.lose("image");
        rig.step_ms(20.0);
        rig.step();
    }
}

#[test]
fn the_nearest_region_agrees_with_a_simple_tracker_on_random_films() {
    const PITCH: [f64; 2] = [0.005, 0.004];
    let shape = ImageShape { rows: 16, cols: 20, pitch: PITCH, ..ImageShape::default() };
    let mut random = Random::new(11, 0);
    let (mut ties, mut kept, mut frames) = (0, 0, 0);
    for _ in 0..60 {
        let wires = [("mask", Grid::from(&shape).into()), ("image", shape.clone().into())];
        let mut rig = NodeRig::new::<Label>("choose = \"nearest\"\nmin_area = 4", &wires).unwrap();
        let mut discs = [0, 1].map(|_| {
            ([random.uniform(0.0, 1.0) * 20.0, random.uniform(0.0, 1.0) * 16.0], 0.8 + 2.5 * random.uniform(0.0, 1.0))
        });
        let (mut last, mut lost) = (None::<[f64; 2]>, 0);
        for _ in 0..80 {
            for ([x, y], radius) in &mut discs {
                *x = (*x + 1.6 * (random.uniform(0.0, 1.0) - 0.5)).clamp(0.0, 19.0);
                *y = (*y + 1.6 * (random.uniform(0.0, 1.0) - 0.5)).clamp(0.0, 15.0);
                *radius = (*radius + random.uniform(0.0, 1.0) - 0.5).clamp(0.8, 3.5);
            }
            let shown = if random.uniform(0.0, 1.0) < 0.15 { 0 } else { 2 };
            let (image, mask) = frame(&discs[..shown]);
            rig.set("image", image.clone());
            rig.set("mask", mask.clone());
            rig.step_ms(8.0);
            if last.is_some() && lost >= 3 {
                last = None;
            }
            let regions: Vec<(Mask, Region)> =
                flood(&image, &mask, 8).into_iter().filter(|(_, region)| region.area >= 4).collect();
            let distance = |(mask, _): &(Mask, Region)| {
                let ([x, y], [a, b]) = (centroid(mask, PITCH), last.unwrap_or_default());
                (x - a).hypot(y - b)
            };
            let largest = regions.iter().rev().max_by_key(|(_, region)| region.area);
            let nearest = regions.iter().min_by(|a, b| distance(a).total_cmp(&distance(b)));
            let expected = if last.is_some() { nearest } else { largest };
            if regions.len() == 2 && (distance(&regions[0]) - distance(&regions[1])).abs() < 1e-9 {
                ties += 1;
                break;
            }
            assert_eq!(rig.get::<Mask>("region"), expected.map(|(mask, _)| mask));
            assert_eq!(rig.get::<Flag>("present"), Some(&expected.is_some()));
            kept += usize::from(expected.zip(largest).is_some_and(|(a, b)| a.0 != b.0));
            frames += 1;
            match expected {
                Some((mask, _)) => (last, lost) = (Some(centroid(mask, PITCH)), 0),
                None => lost += 1,
            }
        }
    }
    assert!(frames > 4000 && ties < 5 && kept > 400, "{frames} frames, {ties} ties, {kept} times not the largest");
}

#[test]
fn a_contact_larger_than_the_pad_is_warned_of() {
    assert_eq!(places("min_area = 17", &rig("min_area = 17", 4, 4)), ["unusual-value: `min_area`"]);
    assert!(places("min_area = 16", &rig("min_area = 16", 4, 4)).is_empty());
}
