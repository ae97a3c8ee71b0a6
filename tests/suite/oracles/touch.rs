//! The finger press frame by frame: the vendor's sums, a naive flood fill and naive moments.

use std::fs;

use tactflow_runtime::graph::Request;
use tactflow_runtime::signal::{Flag, Image, Mask, Regions, Scalar};
use tactflow_tests::workspace;

use crate::course::{get, shipped, watch};

const ROWS: usize = 28;
const COLS: usize = 28;
/// Distance between two sensels [m].
const PITCH: f64 = 0.00127;
/// `NOISE_THRESHOLD` of the recording.
const THRESHOLD: f64 = 3.0;
/// What `graphs/finger_press.toml` asks of a contact.
const MIN_AREA: usize = 6;
const MIN_FORCE: f64 = 100.0;

/// A frame as the vendor's software wrote it: its own sum, and its cells; what does not exist is 0.
struct Frame {
    sum: f64,
    cells: Vec<f64>,
}

fn frames() -> Vec<Frame> {
    let text = fs::read_to_string(workspace().join("graphs/recordings/pressuRe/iscan_test.csv")).unwrap();
    let blocks = text.split("\nFrame ").skip(1);
    let frame = |block: &str| {
        let mut lines = block.lines();
        let sum = lines.next().unwrap().rsplit(',').next().unwrap().parse().unwrap();
        let cells = lines.take(ROWS).flat_map(|line| line.split(',')).map(|cell| cell.parse().unwrap_or(0.0));
        Frame { sum, cells: cells.collect() }
    };
    blocks.map(frame).collect()
}

/// A region of the naive flood fill: its tactels, in any order.
type Naive = Vec<(usize, usize)>;

/// The regions above the threshold, in the order of their first tactels.
fn flood_fill(cells: &[f64], has_corners: bool) -> Vec<Naive> {
    let mut is_left: Vec<bool> = cells.iter().map(|value| *value > THRESHOLD).collect();
    let mut regions = Vec::new();
    for at in 0..cells.len() {
        if !is_left[at] {
            continue;
        }
        is_left[at] = false;
        let (mut region, mut next) = (Vec::new(), vec![(at / COLS, at % COLS)]);
        while let Some((i, j)) = next.pop() {
            region.push((i, j));
            for (a, b) in (0..ROWS).flat_map(|a| (0..COLS).map(move |b| (a, b))) {
                let (down, right) = (a.abs_diff(i), b.abs_diff(j));
                let is_neighbour = if has_corners { down.max(right) == 1 } else { down + right == 1 };
                if is_neighbour && is_left[a * COLS + b] {
                    is_left[a * COLS + b] = false;
                    next.push((a, b));
                }
            }
        }
        regions.push(region);
    }
    regions
}

fn force(cells: &[f64], region: &Naive) -> f64 {
    region.iter().map(|(i, j)| cells[i * COLS + j]).sum()
}

/// The largest region that is a contact; of two that are equal, the first.
fn contact<'r>(cells: &[f64], regions: &'r [Naive]) -> Option<&'r Naive> {
    let fits = |region: &&Naive| region.len() >= MIN_AREA && force(cells, region) >= MIN_FORCE;
    regions.iter().filter(fits).rev().max_by_key(|region| region.len())
}

/// The finger press, labelled with 4 or 8 neighbours.
fn press(neighbours: u8) -> Request {
    shipped("finger_press.toml").set(format!("parts.touch.set.label.neighbours={neighbours}"))
}

#[test]
fn our_sum_is_the_vendors_on_every_frame() {
    let frames = frames();
    let mut sums = Vec::new();
    watch(&shipped("finger_press.toml"), |engine| {
        let cells = get::<Image>(engine, "touch.source.image").unwrap().cells();
        let expected = &frames[sums.len()].cells;
        assert!(cells.iter().zip(expected).all(|(cell, expected)| f64::from(*cell) == *expected));
        sums.push(*get::<Scalar>(engine, "touch.source.sum").unwrap());
    });
    assert_eq!((frames.len(), sums), (309, frames.iter().map(|frame| frame.sum).collect()));
}

#[test]
fn regions_are_those_of_a_flood_fill_on_every_frame() {
    let frames = frames();
    let mut counts = Vec::new();
    for neighbours in [4, 8] {
        let mut tick = 0;
        watch(&press(neighbours), |engine| {
            let cells = &frames[tick].cells;
            let expected = flood_fill(cells, neighbours == 8);
            let found = get::<Regions>(engine, "touch.label.regions").unwrap();
            let told: Vec<(usize, f64)> =
                found.list().iter().map(|region| (region.area as usize, region.force)).collect();
            let naive: Vec<(usize, f64)> = expected.iter().map(|region| (region.len(), force(cells, region))).collect();
            assert_eq!(told, naive, "{neighbours} neighbours, frame {}", tick + 1);
            assert_eq!(members(found), sorted(&expected), "{neighbours} neighbours, frame {}", tick + 1);
            counts.push(naive.len());
            tick += 1;
        });
        assert_eq!(tick, frames.len());
    }
    let (four, eight) = counts.split_at(frames.len());
    let differ = four.iter().zip(eight).filter(|(four, eight)| four > eight).count();
    assert!(differ > 40, "corners matter in {differ} frames of this recording");
}

/// The tactels of each region of a list of runs.
fn members(regions: &Regions) -> Vec<Naive> {
    let mut members = vec![Vec::new(); regions.list().len()];
    for run in regions.runs() {
        members[usize::from(run.region)].extend((run.start..run.end).map(|j| (usize::from(run.row), usize::from(j))));
    }
    members
}

fn sorted(regions: &[Naive]) -> Vec<Naive> {
    let mut regions = regions.to_vec();
    regions.iter_mut().for_each(|region| region.sort_unstable());
    regions
}

#[test]
fn the_contact_and_its_moments_are_the_naive_ones_on_every_frame() {
    let frames = frames();
    let (mut tick, mut contacts) = (0, 0);
    watch(&press(8), |engine| {
        let cells = &frames[tick].cells;
        tick += 1;
        let regions = flood_fill(cells, true);
        let expected = contact(cells, &regions);
        assert_eq!(get::<Flag>(engine, "touch.label.present"), Some(&expected.is_some()), "frame {tick}");
        let found = get::<Mask>(engine, "touch.label.region");
        assert_eq!(found.is_some(), expected.is_some(), "frame {tick}");
        let scalar = |name: &str| get::<Scalar>(engine, &format!("touch.moments.{name}")).copied();
        let (Some(expected), Some(found)) = (expected, found) else {
            assert_eq!(scalar("force"), None, "frame {tick}");
            return;
        };
        contacts += 1;
        assert_eq!(found.count(), expected.len(), "frame {tick}");
        assert!(expected.iter().all(|(i, j)| found.contains(*i, *j)), "frame {tick}");
        let force = force(cells, expected);
        let mean = |weight: &dyn Fn(f64, f64) -> f64| {
            let sum = |(i, j): &(usize, usize)| cells[i * COLS + j] * weight(*i as f64, *j as f64);
            expected.iter().map(sum).sum::<f64>() / force
        };
        let (row, col) = (mean(&|i, _| i), mean(&|_, j| j));
        let (yy, xx, xy) =
            (mean(&|i, _| (i - row).powi(2)), mean(&|_, j| (j - col).powi(2)), mean(&|i, j| (i - row) * (j - col)));
        let spread = ((xx - yy).powi(2) + 4.0 * xy * xy).sqrt() / (xx + yy);
        let naive = [
            ("force", force),
            ("area", expected.len() as f64),
            ("pressure", force / expected.len() as f64),
            ("x", (col - 13.5) * PITCH),
            ("y", (row - 13.5) * PITCH),
            ("anisotropy", spread),
        ];
        for (name, naive) in naive {
            let ours = scalar(name).unwrap();
            assert!((ours - naive).abs() <= 1e-10 * naive.abs().max(PITCH), "frame {tick}: {name} {ours}, not {naive}");
        }
        let angle = 0.5 * (2.0 * xy).atan2(xx - yy);
        let ours = scalar("orientation");
        assert_eq!(ours.is_some(), spread >= 0.1, "frame {tick}");
        assert!(ours.is_none_or(|ours| (ours - angle).sin().abs() < 1e-9), "frame {tick}: {ours:?}, not {angle}");
    });
    assert!(tick == 309 && (200..309).contains(&contacts), "{contacts} contacts in {tick} frames");
}
