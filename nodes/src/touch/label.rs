//! `label`: the connected regions of a mask, and the one that is the contact (paper section III, after its ref. 21).
//!
//! The contact is the largest region by area that is large and strong enough; of two that are equal, the one met first
//! in raster order. A noisy empty pad has a "region" in almost every frame, so absence needs a least area and force.
//!
//! A row is a few words of bits. Adding the lowest set bit carries through the lowest run of ones, which cuts a run out
//! in four operations; runs that touch in neighbouring rows are joined by union-find. A parent is never after its
//! child, so one pass in raster order numbers the regions, and the links live in the field that the numbers then take.

use std::ops::Range;

use tactflow_runtime::node::{Count, Mistake, Mistakes, Node, Param, Reader, Setup, Tick, Value, Written, read_leaf};
use tactflow_runtime::signal::{Grid, Image, Mask, Region, RegionsShape, Run};
use tactflow_runtime::{inputs, outputs, params};

use super::on_one_array;

params! {
    /// How many neighbours a tactel has: 4 (edges) or 8 (corners too).
    neighbours: Neighbours = Neighbours::Eight,
    /// Least area of a contact [tactels].
    min_area: Count = Count(1),
    /// Least sum over a contact [unit of the image].
    min_force: f64 = 0.0,
}

inputs! {
    /// The image that forces are summed from.
    image: Image["U", "A"],
    /// The tactels that may be in contact.
    mask: Mask["A"],
}

outputs! {
    /// The contact R: the largest region with at least the least area and force; absent when there is none.
    region: Mask["A"],
    /// All regions of the mask, in the order of their first tactels, with their sums [unit of the image].
    regions: Regions["U", "A"],
    /// Whether there is a contact.
    present: Flag,
}

/// Which tactels are neighbours.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Neighbours {
    /// Those with a common edge.
    Four,
    /// Those with a common corner too.
    Eight,
}

impl Param for Neighbours {
    const EXPECTS: &'static str = "4 or 8";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        match read_leaf::<u64>(value, reader, Self::EXPECTS)? {
            4 => Some(Self::Four),
            8 => Some(Self::Eight),
            _ => {
                reader.wrong_type(value, Self::EXPECTS);
                None
            }
        }
    }

    fn written(&self) -> Option<Written> {
        Some(match self {
            Self::Four => 4.into(),
            Self::Eight => 8.into(),
        })
    }
}

/// What makes tactels neighbours, and a region a contact.
pub struct Label {
    /// How many columns past its ends a run touches runs of the next row.
    reach: u32,
    min_area: usize,
    min_force: f64,
}

impl Node for Label {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    const NAME: &'static str = "label";
    const SUMMARY: &'static str = "the connected regions of a mask, and the one that is the contact";

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let (image, mask) = (&setup.inputs.image, &setup.inputs.mask);
        on_one_array(image, "mask", mask)?;
        if !is_countable(mask) {
            let message =
                format!("an array of {} by {} can have more than 65535 runs of tactels", mask.rows, mask.cols);
            return Err(Mistake::input("mask", message).help("label a part of it").into());
        }
        let reach = match params.neighbours {
            Neighbours::Four => 0,
            Neighbours::Eight => 1,
        };
        setup.outputs.region = mask.clone();
        setup.outputs.regions = RegionsShape { grid: mask.clone(), unit: image.unit };
        Ok(Self { reach, min_area: *params.min_area, min_force: params.min_force })
    }

    fn state(&self) {}

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let (runs, regions) = out.regions.write().parts_mut();
        trace(&inputs.mask, self.reach, runs);
        number(&inputs.image, runs, regions);
        let contact = contact(regions, self.min_area, self.min_force);
        out.present.set(contact.is_some());
        if let Some(contact) = contact {
            paint(runs, contact, out.region.write());
        }
    }
}

/// Whether every run and every region of the array has a number of 16 bits.
fn is_countable(grid: &Grid) -> bool {
    grid.rows.max(grid.cols) <= 65535 && grid.rows * grid.cols.div_ceil(2) <= 65535
}

/// Lists the runs in raster order. Until [`number`], the `region` of each is its parent among the runs: itself, or one
/// before it.
pub fn trace(mask: &Mask, reach: u32, runs: &mut Vec<Run>) {
    runs.clear();
    let mut above = 0..0;
    for i in 0..mask.rows() {
        let first = runs.len();
        cut(mask.row(i), i as u16, runs);
        if !above.is_empty() {
            join(runs, above, first, reach);
        }
        above = first..runs.len();
    }
}

/// Cuts a row into runs.
fn cut(words: &[u64], row: u16, runs: &mut Vec<Run>) {
    for (k, word) in words.iter().enumerate() {
        let mut rest = *word;
        while rest != 0 {
            let low = rest & rest.wrapping_neg();
            let run = rest & !rest.wrapping_add(low);
            let start = (64 * k as u32 + low.trailing_zeros()) as u16;
            let end = start + run.count_ones() as u16;
            rest ^= run;
            match runs.last_mut() {
                // It goes on over the border of two words.
                Some(last) if k > 0 && last.row == row && last.end == start => last.end = end,
                _ => runs.push(Run { row, start, end, region: runs.len() as u16 }),
            }
        }
    }
}

/// Joins the runs from `first` on with those of the row above that they touch.
fn join(runs: &mut [Run], above: Range<usize>, first: usize, reach: u32) {
    let mut left = above.start;
    for id in first..runs.len() {
        let (start, end) = (u32::from(runs[id].start), u32::from(runs[id].end));
        while left < above.end && u32::from(runs[left].end) + reach <= start {
            left += 1;
        }
        let mut other = left;
        while other < above.end && u32::from(runs[other].start) < end + reach {
            let (a, b) = (root(runs, other), root(runs, id));
            runs[a.max(b)].region = a.min(b) as u16;
            other += 1;
        }
    }
}

/// The first run of a run's tree; halves the way there.
fn root(runs: &mut [Run], mut id: usize) -> usize {
    loop {
        let parent = usize::from(runs[id].region);
        if parent == id {
            return id;
        }
        let grandparent = runs[parent].region;
        runs[id].region = grandparent;
        id = usize::from(grandparent);
    }
}

/// Numbers the regions in the order of their first runs, and adds up their areas and forces in raster order.
pub fn number(image: &Image, runs: &mut [Run], regions: &mut Vec<Region>) {
    regions.clear();
    for id in 0..runs.len() {
        let Run { row, start, end, region: parent } = runs[id];
        if usize::from(parent) == id {
            runs[id].region = regions.len() as u16;
            regions.push(Region::default());
        } else {
            runs[id].region = runs[usize::from(parent)].region;
        }
        let values = &image.row(row.into())[usize::from(start)..usize::from(end)];
        let region = &mut regions[usize::from(runs[id].region)];
        region.area += u32::from(end - start);
        region.force += values.iter().fold(0.0, |sum, value| sum + f64::from(*value));
    }
}

/// The first of the largest regions that are large and strong enough.
#[must_use]
pub fn contact(regions: &[Region], min_area: usize, min_force: f64) -> Option<usize> {
    let mut largest = None;
    let mut area = 0;
    for (i, region) in regions.iter().enumerate() {
        if region.area > area && region.area as usize >= min_area && region.force >= min_force {
            (largest, area) = (Some(i), region.area);
        }
    }
    largest
}

/// Makes the mask the tactels of one region.
pub fn paint(runs: &[Run], region: usize, mask: &mut Mask) {
    mask.clear();
    let stride = mask.stride();
    let words = mask.words_mut();
    for run in runs.iter().filter(|run| usize::from(run.region) == region) {
        let (start, end) = (usize::from(run.start), usize::from(run.end));
        let first = usize::from(run.row) * stride;
        let touched = &mut words[first + start / 64..first + end.div_ceil(64)];
        for (word, at) in touched.iter_mut().zip((start / 64 * 64..).step_by(64)) {
            *word |= (u64::MAX << start.saturating_sub(at)) & (u64::MAX >> (at + 64).saturating_sub(end));
        }
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::node::At;
    use tactflow_runtime::signal::{Flag, ImageShape, Regions};

    use super::super::uniform;
    use super::*;

    fn rig(params: &str, rows: usize, cols: usize) -> Result<NodeRig, Mistakes> {
        let image = ImageShape { rows, cols, ..ImageShape::default() };
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
    fn the_contact_is_the_first_of_the_largest_that_are_enough() {
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
    fn a_run_goes_on_over_the_border_of_two_words_but_not_into_the_next_row() {
        // the tactels of two rows of 130, and how many runs they make
        let cases: [(&[(usize, usize)], usize); 4] = [
            (&[(0, 63), (1, 64)], 2),
            (&[(0, 63), (0, 64)], 1),
            (&[(0, 127), (1, 128)], 2),
            (&[(0, 127), (0, 129)], 2),
        ];
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
    fn what_is_refused() {
        for bad in ["neighbours = 6", "min_area = 0", "min_area = -1", "min_force = \"1\"", "neighbors = 4"] {
            assert!(rig(bad, 4, 4).is_err(), "{bad}");
        }
        for (rows, cols, fits) in
            [(256, 63, true), (1, 65535, true), (65535, 1, true), (65535, 2, true), (255, 513, true)]
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

    /// The oracle: a flood fill from each tactel in raster order, tactel by tactel.
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

    /// The tactels of region `region`, from the runs; checks that no tactel is in two runs.
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

    /// Shows a random mask of whole values to the rig and compares everything with the flood fill.
    fn compare(
        rig: &mut NodeRig,
        (rows, cols, neighbours): (usize, usize, u64),
        mut uniform: impl FnMut() -> f64,
        percent: u32,
    ) {
        let (mut image, mut mask) = (Image::zeros(rows, cols), Mask::empty(rows, cols));
        for at in 0..rows * cols {
            image.cells_mut()[at] = (uniform() * 4096.0).floor() as f32;
            if uniform() * 100.0 < f64::from(percent) {
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
        let enough = expected.iter().filter(|(_, region)| region.area >= 2 && region.force >= 5000.0);
        let largest = enough.rev().max_by_key(|(_, region)| region.area).map(|(tactels, _)| tactels);
        assert_eq!(rig.get::<Mask>("region"), largest, "{mask:?}");
        assert_eq!(rig.get::<Flag>("present"), Some(&largest.is_some()));
    }

    #[test]
    fn regions_agree_with_a_flood_fill() {
        let mut uniform = uniform(1);
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
                    compare(&mut rig, (rows, cols, neighbours), &mut uniform, 5 + round % 19 * 5);
                }
            }
        }
    }
}
