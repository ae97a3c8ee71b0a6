//! The two recordings of plates: many contacts at once, and a vendor's own centre of force.

use std::fs;
use std::io::Read;

use tactflow_nodes::recordings::{Hints, Recording, read};
use tactflow_nodes::touch::label::{number, trace};
use tactflow_runtime::signal::{Image, ImageShape, Mask, Unit};
use tactflow_tests::workspace;

fn recording(name: &str) -> Recording {
    let bytes = fs::read(workspace().join("graphs/recordings/pawlabeling").join(name)).unwrap();
    let recording = read(&bytes, name, &Hints::default()).unwrap();
    assert!(recording.is_sound());
    recording
}

/// The number of regions, by a flood fill from each cell.
fn regions(cells: &[f32], threshold: f32, has_corners: bool, cols: usize) -> usize {
    let rows = cells.len() / cols;
    let mut is_left: Vec<bool> = cells.iter().map(|cell| *cell > threshold).collect();
    let mut count = 0;
    let mut open = Vec::new();
    for start in 0..cells.len() {
        if !is_left[start] {
            continue;
        }
        count += 1;
        open.push(start);
        while let Some(at) = open.pop() {
            if !std::mem::take(&mut is_left[at]) {
                continue;
            }
            let (row, col) = (at / cols, at % cols);
            for i in row.saturating_sub(1)..(row + 2).min(rows) {
                for j in col.saturating_sub(1)..(col + 2).min(cols) {
                    if has_corners || i == row || j == col {
                        open.push(i * cols + j);
                    }
                }
            }
        }
    }
    count
}

#[test]
fn the_regions_of_a_walking_dog_are_those_of_a_flood_fill() {
    let recording = recording("dog1_sel_1.zip");
    let ImageShape { rows, cols, pitch, unit } = recording.shape;
    assert_eq!((rows, cols, pitch, unit), (256, 63, [0.005_08, 0.007_62], Unit::NEWTON));
    assert_eq!((recording.format, recording.frames.len()), ("footscan", 249));
    assert!((1.0 / recording.period - 126.0).abs() < 0.01, "{}", recording.period);
    let (mut image, mut mask) = (Image::zeros(rows, cols), Mask::empty(rows, cols));
    let (mut runs, mut found, mut most, mut differ) = (vec![], vec![], 0, 0);
    for (index, threshold) in (0..recording.frames.len()).flat_map(|index| [(index, 0.0), (index, 1.0)]) {
        recording.show(index, image.cells_mut());
        mask.clear();
        for (i, _) in image.cells().iter().enumerate().filter(|(_, cell)| **cell > threshold) {
            mask.insert(i / cols, i % cols);
        }
        let counts = [(0, false), (1, true)].map(|(reach, has_corners)| {
            trace(&mask, reach, &mut runs);
            number(&image, &mut runs, &mut found);
            assert_eq!(found.len(), regions(image.cells(), threshold, has_corners, cols), "frame {index}");
            found.len()
        });
        most = most.max(counts[0]);
        differ += usize::from(counts[0] != counts[1]);
    }
    assert!(most >= 7 && differ > 60, "{most}, {differ}");
}

#[test]
fn the_centre_of_gravity_on_a_treadmill_is_the_vendors_centre_of_force() {
    let recording = recording("zebris_gait.zip");
    let ImageShape { rows, cols, pitch, unit } = recording.shape;
    assert_eq!((rows, cols, unit.to_string()), (56, 128, "kPa".into()));
    assert_eq!((recording.format, recording.frames.len(), recording.period), ("zebris", 1472, 0.01));
    let said = said(cols);
    assert_eq!(said.len(), 1472);
    // The file rounds the sides of a cell, 25.4 / 3 mm, to 8.47 and 8.46 mm; a kPa on a m² is 1000 N.
    let newtons = 1e3 * pitch[0] * pitch[1];
    let (mut worst, mut compared) = ([0.0_f64; 3], 0);
    let mut image = Image::zeros(rows, cols);
    for (index, (centre, force)) in said.iter().enumerate() {
        recording.show(index, image.cells_mut());
        let (mut sum, mut x, mut y) = (0.0, 0.0, 0.0);
        for (i, cell) in image.cells().iter().enumerate() {
            let cell = f64::from(*cell);
            sum += cell;
            x += cell * ((i % cols) as f64 + 1.0);
            y += cell * ((i / cols) as f64 + 1.0);
        }
        assert_eq!(recording.frames[index].time, 10_000_000 * index as i64);
        worst[0] = worst[0].max((x / sum - centre[0]).abs());
        worst[1] = worst[1].max((y / sum - centre[1]).abs());
        if *force > 0.0 {
            compared += 1;
            worst[2] = worst[2].max((sum * newtons / force - 1.0).abs());
        }
    }
    // A centre of force is a cell.
    assert!(worst[0] < 0.5 + 1e-5 && worst[1] < 0.5 + 1e-5, "{worst:?}");
    assert!(compared == 1304 && worst[2] < 4e-4, "{compared}, {worst:?}");
}

/// What the file says of each frame: the centre of force [cells], and the sum of both feet [N], 0 where a foot is not
/// there from its first to its last frame.
fn said(cols: usize) -> Vec<([f64; 2], f64)> {
    let bytes = fs::read(workspace().join("graphs/recordings/pawlabeling/zebris_gait.zip")).unwrap();
    // The archive has one member, whose header ends with two names of these lengths.
    let [name, extra] = [26, 28].map(|at| usize::from(u16::from_le_bytes([bytes[at], bytes[at + 1]])));
    let mut unpacked = Vec::new();
    flate2::read::DeflateDecoder::new(&bytes[30 + name + extra..]).read_to_end(&mut unpacked).unwrap();
    let text = String::from_utf8_lossy(&unpacked);
    let number = |text: &str| text.parse::<f64>().unwrap();
    let table = text.lines().skip_while(|line| !line.starts_with("Calibr")).skip(2);
    let forces = table.map_while(|line| line.split('\t').nth(4)).map(number);
    let centres = text.lines().filter_map(|line| line.strip_prefix("Center of force\t(x")?.strip_suffix(')'));
    let centres = centres.map(|centre| {
        let (x, y) = centre.split_once(",y").unwrap();
        assert!(number(x) <= cols as f64);
        [number(x), number(y)]
    });
    centres.zip(forces).collect()
}
