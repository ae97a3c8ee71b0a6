//! `image_window`: the part of a region that is in a box.
//!
//! A tactel counts as a point: it is in the box if its centre is. Centres on the border are inside, to within
//! a millionth of the pitch, so that rounding does not decide.

use std::ops::Range;

use tactflow_runtime::node::{Describe, In, Inputs, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Flag, Grid, Mask, Scalar};

/// Restricts a contact to a box on the pad, such as its middle rows.
///
/// The moments of a long edge or of a curved cable depend on where the line leaves the pad: a line that leaves at a
/// corner has its centre of gravity beside it, and the axis of an arc is that of its chord. Within a box about the
/// middle, a line leaves the box where the box ends, and an arc is almost straight. Wire `region` of this node to the
/// `moments` of position and orientation, and that of `label` to the `moments` of force.
///
/// The output is the set of the tactels of `in.region` whose centre is at most half of `size` from the middle of the
/// box, along x and along y. The middle is `centre`, from the middle of the pad. With `in.x` and `in.y` the box follows
/// a point, such as the centre of gravity of the whole contact, and `centre` is added to it.
///
/// The box has whole tactels: one that follows a point changes by a row or a column at a time. If no tactel of the
/// region is in the box, `region` is absent and `present` is not set. Both are absent while the region or a wired
/// coordinate is.
///
/// ```toml
/// [nodes.image_window]                # the middle 30 mm of a line along y
/// type = "image_window"
/// in.region = "label.region"
/// size = [0.2, 0.03]                  # along x and y [m]
/// ```
#[derive(Describe)]
pub struct ImageWindow {
    grid: Grid,
    params: Params,
}

/// Parameters of `image_window`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Size of the box along the sensor's x and y.
    #[param(unit = "m", above = 0.0, live)]
    size: [f64; 2],
    /// Middle of the box along x and y, from the middle of the pad, or from the wired point.
    #[param(unit = "m", default = [0.0; 2], live)]
    centre: [f64; 2],
}

/// What `image_window` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The tactels of the contact.
    #[port(frame = "A")]
    region: In<'a, Mask>,
    /// Point that the box follows along the sensor's x, from the middle of the pad.
    #[port(unit = "m", frame = "A", quantity = "x", present_if_wired)]
    x: Option<In<'a, Scalar>>,
    /// Point that the box follows along the sensor's y, from the middle of the pad.
    #[port(unit = "m", frame = "A", quantity = "y", present_if_wired)]
    y: Option<In<'a, Scalar>>,
}

/// What `image_window` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The tactels in the box; absent if there are none.
    #[port(frame = "A")]
    region: Out<Mask>,
    /// Whether there are any.
    present: Out<Flag>,
}

/// Distance beyond the border at which a tactel is still in the box, as a fraction of the pitch [1].
const MARGIN: f64 = 1e-6;

impl Node for ImageWindow {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let grid = setup.inputs.region.clone();
        setup.outputs.region = grid.clone();
        let this = Self { grid, params };
        let is_fixed = setup.inputs.x.is_none() && setup.inputs.y.is_none();
        if is_fixed && this.window([0.0; 2]).iter().any(Range::is_empty) {
            let [x, y] = [this.grid.cols as f64 * this.grid.pitch[0], this.grid.rows as f64 * this.grid.pitch[1]];
            let mistake = Mistake::param("size", "no tactel of the pad is in the box");
            return Err(mistake.help(format!("the pad is {x} by {y} m, and `centre` counts from its middle")).into());
        }
        Ok(this)
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let [cols, rows] = self.window([inputs.x, inputs.y].map(|at| at.map_or(0.0, |at| *at)));
        let is_in = |i: usize, k: usize| if rows.contains(&i) { word(&cols, k) } else { 0 };
        let region = &inputs.region;
        let stride = region.stride();
        let cut = |at: usize| region.words()[at] & is_in(at / stride, at % stride);
        let is_present = (0..region.words().len()).any(|at| cut(at) != 0);
        out.present.set(is_present);
        if is_present {
            out.region.write().words_mut().iter_mut().enumerate().for_each(|(at, word)| *word = cut(at));
        }
    }
}

impl ImageWindow {
    /// Returns the columns and the rows of the box about a point [m].
    fn window(&self, point: [f64; 2]) -> [Range<usize>; 2] {
        let counts = [self.grid.cols, self.grid.rows];
        [0, 1].map(|k| {
            let middle = point[k] + self.params.centre[k];
            within(counts[k], middle / self.grid.pitch[k], 0.5 * self.params.size[k] / self.grid.pitch[k])
        })
    }
}

/// Returns which of `count` tactels are at most `half` from `middle`; both in tactels, from the middle of the row. None
/// is near what is not a number.
fn within(count: usize, middle: f64, half: f64) -> Range<usize> {
    let (middle, half) = (middle + 0.5 * (count as f64 - 1.0), half + MARGIN);
    // A number that is negative or not a number becomes 0, and one that is too large the largest.
    let (start, end) = ((middle - half).ceil() as usize, ((middle + half).floor() + 1.0) as usize);
    start.min(count)..end.min(count)
}

/// Returns the bits of word `k` of a row that are in the columns.
fn word(cols: &Range<usize>, k: usize) -> u64 {
    let below = |end: usize| match end.saturating_sub(64 * k) {
        bits @ 0..64 => (1 << bits) - 1,
        _ => u64::MAX,
    };
    below(cols.end) & !below(cols.start)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tactflow_runtime::harness::{NodeRig, places};
    use tactflow_runtime::random::Random;
    use tactflow_runtime::signal::{Freshness, ScalarShape, Unit};

    use super::*;

    const PITCH: [f64; 2] = [0.005, 0.004];

    fn built(params: &str, rows: usize, cols: usize, is_wired: bool) -> Result<NodeRig, Mistakes> {
        let mut wires = vec![("region", Grid { rows, cols, pitch: PITCH }.into())];
        if is_wired {
            wires.extend(["x", "y"].map(|name| (name, ScalarShape::of(Unit::METRE).into())));
        }
        NodeRig::new::<ImageWindow>(params, &wires)
    }

    fn full(rows: usize, cols: usize) -> Mask {
        let mut mask = Mask::empty(rows, cols);
        (0..rows * cols).for_each(|at| mask.insert(at / cols, at % cols));
        mask
    }

    #[test]
    fn the_middle_rows_and_columns() {
        // size, centre, and the rows and columns that are left of 8 by 6
        let cases = [
            ("size = [1, 0.008]", 3..5, 0..6),
            ("size = [1, 0.0119]", 3..5, 0..6),
            ("size = [1, 0.012]", 2..6, 0..6),
            ("size = [0.005, 0.004]\ncentre = [0.0025, 0.002]", 4..5, 3..4),
            ("size = [0.01, 1]\ncentre = [-0.0125, 0]", 0..8, 0..2),
            ("size = [0.02, 0.02]\ncentre = [0.0125, 0.014]", 5..8, 3..6),
        ];
        for (params, rows, cols) in cases {
            let mut rig = built(params, 8, 6, false).unwrap();
            rig.set("region", full(8, 6));
            rig.step();
            let region = rig.get::<Mask>("region").unwrap();
            for (i, j) in (0..8).flat_map(|i| (0..6).map(move |j| (i, j))) {
                assert_eq!(region.contains(i, j), rows.contains(&i) && cols.contains(&j), "{params}: {i}, {j}");
            }
        }
    }

    proptest! {
        #[test]
        fn it_is_what_a_distance_says(
            seed in 0..1000u64, cols in 1..150usize,
            size in prop::array::uniform2(0.003..0.4f64), at in prop::array::uniform2(-0.2..0.2f64),
        ) {
            let (mut random, mut region) = (Random::new(seed, 0), Mask::empty(9, cols));
            for (i, j) in (0..9).flat_map(|i| (0..cols).map(move |j| (i, j))) {
                if random.uniform(0.0, 1.0) < 0.5 {
                    region.insert(i, j);
                }
            }
            let mut rig = built(&format!("size = {size:?}\ncentre = [0.01, -0.002]"), 9, cols, true).unwrap();
            rig.set("region", region.clone());
            rig.set("x", at[0] - 0.01);
            rig.set("y", at[1] + 0.002);
            rig.step();
            let distance = |index: usize, count: usize, k: usize| {
                ((index as f64 - 0.5 * (count as f64 - 1.0)) * PITCH[k] - at[k]).abs()
            };
            let is_in = |i: usize, j: usize| {
                region.contains(i, j) && distance(j, cols, 0) <= 0.5 * size[0] && distance(i, 9, 1) <= 0.5 * size[1]
            };
            let mut expected = Mask::empty(9, cols);
            for (i, j) in (0..9).flat_map(|i| (0..cols).map(move |j| (i, j))).filter(|(i, j)| is_in(*i, *j)) {
                expected.insert(i, j);
            }
            prop_assert_eq!(rig.get::<Flag>("present"), Some(&(expected.count() > 0)));
            prop_assert_eq!(rig.get::<Mask>("region"), Some(&expected).filter(|mask| mask.count() > 0));
        }
    }

    #[test]
    fn without_a_point_or_with_one_that_is_no_number_there_is_nothing() {
        let mut rig = built("size = [0.02, 0.02]", 8, 6, true).unwrap();
        rig.set("region", full(8, 6));
        rig.set("x", 0.0);
        rig.step();
        assert_eq!(rig.get::<Flag>("present"), None, "y has not come yet");
        for (y, expected) in [(0.0, Some(true)), (f64::NAN, Some(false)), (1.0, Some(false))] {
            rig.set("y", y);
            rig.step();
            assert_eq!(
                (rig.get::<Flag>("present").copied(), rig.get::<Mask>("region").is_some()),
                (expected, y == 0.0)
            );
        }
        rig.lose("region");
        rig.step();
        assert_eq!(rig.freshness("present"), Freshness::Lost);
    }

    #[test]
    fn a_box_without_tactels_is_refused() {
        let cases = [
            ("size = [0.01, 0.01]\ncentre = [0.1, 0]", "bad-value: `size`"),
            ("size = [0.01, 0.003]", "bad-value: `size`"),
            ("size = [0.01, 0]", "bad-value: `0`"),
            ("size = [0.01]", "bad-value: `[0.01]`"),
        ];
        for (bad, place) in cases {
            assert_eq!(places(bad, &built(bad, 8, 6, false)), [place], "{bad}");
        }
        assert!(built("size = [0.01, 0.003]", 8, 6, true).is_ok(), "a box that moves can have tactels elsewhere");
    }
}
