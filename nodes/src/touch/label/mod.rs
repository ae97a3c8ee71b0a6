//! `label`: the connected regions of a mask, and the one that is the contact (paper section III, after its ref. 21).
//!
//! The contact is the largest region by area that is large and strong enough, or the one of these that is nearest to
//! where the contact was; of two that are equal, the one met first in raster order. A noisy empty pad has a "region" in
//! almost every frame, so absence needs a least area and force.
//!
//! A row is a few words of bits. Adding the lowest set bit carries through the lowest run of ones, which cuts a run out
//! in four operations; runs that touch in neighbouring rows are joined by union-find. A parent is never after its
//! child, so one pass in raster order numbers the regions, and the links live in the field that the numbers then take.

mod nearest;

use std::ops::Range;

use tactflow_runtime::node::{Count, Mistake, Mistakes, Node, Param, Reader, Setup, Tick, Written, read_leaf};
use tactflow_runtime::signal::{Grid, Image, Mask, Region, RegionsShape, Run};
use tactflow_runtime::source::Value;
use tactflow_runtime::{inputs, outputs, params, state};

use super::on_one_array;

pub use nearest::{away, middles, middles_of, nearest};

words! {
    /// Which region is the contact.
    Choose {
        /// The largest.
        Largest = "largest",
        /// The nearest to the last contact; the largest if there was none.
        Nearest = "nearest",
    }
}

params! {
    /// How many neighbours a tactel has: 4 (edges) or 8 (corners too).
    neighbours: Neighbours = Neighbours::Eight,
    /// Least area of a contact [tactels].
    live min_area: Count = Count(1),
    /// Least sum over a contact [unit of the image].
    live min_force: f64 = 0.0,
    /// Which of those regions is the contact: the "largest", or the "nearest" to where the contact was last.
    choose: Choose = Choose::Largest,
}

inputs! {
    /// The image that forces are summed from.
    image: Image["U", "A"],
    /// The tactels that may be in contact.
    mask: Mask["A"],
}

outputs! {
    /// The contact R: a region with at least the least area and force; absent when there is none.
    region: Mask["A"],
    /// All regions of the mask, in the order of their first tactels, with their sums [unit of the image].
    regions: Regions["U", "A"],
    /// Whether there is a contact.
    present: Flag,
}

state! {
    /// Middle of the last contact [m]; none before the first, and after one that was lost for long.
    last: Option<[f64; 2]>,
    /// When there was a contact no more [ns].
    lost_at: Option<i64>,
    /// Room for the middle of each region.
    middles: Vec<[f64; 2]>,
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
    choose: Choose,
    grid: Grid,
}

impl tactflow_runtime::node::Describe for Label {
    const NAME: &'static str = "label";
    const SUMMARY: &'static str = "finds the connected regions of a mask, and the one that is the contact";
    const DOC: &'static str = "Tactels of the mask that are neighbours make a region (connected components, paper \
        section III). The contact R is the largest one; `regions` lists all of them, for `select_region`.\n\n\
        **Absence.** A noisy pad has a region in almost every frame, even when nothing touches it: 99.96 % at white noise \
        of 0.08 and a threshold of 0.15 units. So a contact has at least `min_area` tactels and at least `min_force`; \
        without one, `region` is absent, `present` is not set, and all features of the contact are absent. Six tactels \
        are found on such an empty pad once in 4000 frames.\n\n\
        **Two contacts.** With `choose = \"largest\"` the contact is chosen anew in each frame; a second, larger touch \
        takes it over at once, and two of one size take turns. With `choose = \"nearest\"` the contact is the region \
        whose middle (the mean place of its tactels) is nearest to that of the last contact, however large the others \
        are. It is the largest when there was no contact, or when there has been none for `reset_after_ms`; a shorter \
        gap keeps the place. When the contact is lifted while another region is there, that one is the contact from the \
        next frame on: to hold several contacts apart, take a `select_region` for each.\n\n\
        **Neighbours.** With 8, two tactels that touch at a corner are one region, with 4 they are two: on a real \
        recording with several contacts the counts differ in 39 % of the frames. A tie goes to the region that comes \
        first, row by row.";
    const EXAMPLE: &'static str = r#"
[nodes.label]
type = "label"
in.image = "calibrate.image"
in.mask = "binarize.mask"
min_area = 4                        # [tactels]
min_force = 0.1                     # [N]
"#;
}

impl Node for Label {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

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
        Ok(Self {
            reach,
            min_area: *params.min_area,
            min_force: params.min_force,
            choose: params.choose,
            grid: mask.clone(),
        })
    }

    fn state(&self) -> State {
        State { last: None, lost_at: None, middles: middles_of(&self.grid) }
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let (runs, regions) = out.regions.write().parts_mut();
        trace(&inputs.mask, self.reach, runs);
        number(&inputs.image, runs, regions);
        let contact = match self.choose {
            Choose::Largest => contact(regions, self.min_area, self.min_force),
            Choose::Nearest => self.nearest(tick, runs, regions, state),
        };
        out.present.set(contact.is_some());
        if let Some(contact) = contact {
            paint(runs, contact, out.region.write());
        }
    }
}

impl Label {
    /// The contact next to the last one.
    fn nearest(&self, tick: &Tick, runs: &[Run], regions: &[Region], state: &mut State) -> Option<usize> {
        if state.lost_at.is_some_and(|lost_at| tick.now - lost_at >= tick.reset_after) {
            state.last = None;
        }
        let middles = middles(&self.grid, runs, regions, &mut state.middles);
        let contact = match state.last {
            None => contact(regions, self.min_area, self.min_force),
            Some(last) => nearest(regions, middles, last, self.min_area, self.min_force),
        };
        match contact {
            Some(contact) => (state.last, state.lost_at) = (Some(middles[contact]), None),
            None => state.lost_at = state.lost_at.or(Some(tick.now)),
        }
        contact
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
mod tests;
