//! `select_region`: one of the regions that `label` has found, by its rank.
//!
//! Regions are ordered by area, by force or by distance from a point, and the one of the given rank is taken; of two
//! that are equal, the one that comes first in raster order. One such node a contact holds several contacts apart.

use tactflow_runtime::node::{At, Count, Mistake, Mistakes, Node, Setup, Tick};
use tactflow_runtime::signal::{Grid, Region};
use tactflow_runtime::source::Code;
use tactflow_runtime::{inputs, outputs, params, state};

use super::label::{away, middles, middles_of, paint};

words! {
    /// What regions are ordered by.
    By {
        /// The largest comes first.
        Area = "area",
        /// The strongest comes first.
        Force = "force",
        /// The nearest comes first.
        Distance = "distance",
    }
}

params! {
    /// What comes first: by "area" the largest, by "force" the strongest, by "distance" the nearest to `point`.
    by: By = By::Area,
    /// Which one to take: 1 is the first, 2 the second.
    rank: Count = Count(1),
    /// The place that distances are counted from, `[x, y]` from the pad's middle, for `by = "distance"` [m].
    point: Option<[f64; 2]>,
    /// Least area of a region to be counted at all [tactels].
    min_area: Count = Count(1),
    /// Least sum over a region to be counted at all [unit of the image].
    min_force: f64 = 0.0,
}

inputs! {
    /// All regions, as `label` lists them.
    regions: Regions["U", "A"],
}

outputs! {
    /// The region of that rank; absent when there are fewer.
    region: Mask["A"],
    /// Whether there is one.
    present: Flag,
}

state! {
    /// Room for the middle of each region.
    middles: Vec<[f64; 2]>,
}

/// The order, and which one is taken.
pub struct SelectRegion {
    order: Order,
    rank: usize,
    min_area: usize,
    min_force: f64,
    grid: Grid,
}

enum Order {
    Area,
    Force,
    Distance([f64; 2]),
}

impl tactflow_runtime::node::Describe for SelectRegion {
    const NAME: &'static str = "select_region";
    const SUMMARY: &'static str = "takes one of several contacts: the n-th largest, strongest, or nearest to a point";
    const DOC: &'static str = "`label` lists all regions of a mask; this takes one of them, for `moments` and the \
        others that want a region. One such node a contact, all on one `label`, gives each its own features.\n\n\
        Regions with less than `min_area` tactels or less than `min_force` are not counted. The others are ordered by \
        area (the largest first), by force (the strongest first) or by the distance of their middle, the mean place \
        of their tactels, from `point` (the nearest first), and the one of that `rank` is taken. A tie goes to the \
        region that comes first, row by row.\n\n\
        Without a region of that rank, `region` is absent and `present` is not set.\n\n\
        There is no memory in it: two contacts of about the same area change their ranks from frame to frame. \
        Where contacts stay in their places, `by = \"distance\"` keeps them apart while all of them are there: when \
        one is lifted, the nearest to its `point` is another one. A second contact that must be there is that of \
        `rank = 2`. A single contact is followed by `choose = \"nearest\"` of `label`.";
    const EXAMPLE: &'static str = r#"
[nodes.select_region]
type = "select_region"
in.regions = "label.regions"
by = "distance"                     # the first one counted from `point`
point = [0.02, 0.0]                 # [m]
min_area = 4                        # [tactels]
"#;
}

impl Node for SelectRegion {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let order = match (params.by, params.point) {
            (By::Area, None) => Order::Area,
            (By::Force, None) => Order::Force,
            (By::Distance, Some(point)) => Order::Distance(point),
            (By::Distance, None) => {
                let message = "`by = \"distance\"` needs a `point` that distances are counted from";
                let mistake = Mistake::new(Code::MissingKey, At::Param("by".into()), message);
                return Err(mistake.help("give `point = [x, y]`, from the pad's middle [m]").into());
            }
            (By::Area | By::Force, Some(_)) => {
                let mistake = Mistake::key("point", "`point` means nothing without `by = \"distance\"`");
                return Err(mistake.help("say `by = \"distance\"`, or leave it out").into());
            }
        };
        let grid = setup.inputs.regions.grid.clone();
        setup.outputs.region = grid.clone();
        Ok(Self { order, rank: *params.rank, min_area: *params.min_area, min_force: params.min_force, grid })
    }

    fn state(&self) -> State {
        State { middles: middles_of(&self.grid) }
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let (list, runs) = (inputs.regions.list(), inputs.regions.runs());
        let chosen = match self.order {
            Order::Area => self.choose(list, |i| -f64::from(list[i].area)),
            Order::Force => self.choose(list, |i| -list[i].force),
            Order::Distance(point) => {
                let middles = middles(&self.grid, runs, list, &mut state.middles);
                self.choose(list, |i| away(middles[i], point))
            }
        };
        out.present.set(chosen.is_some());
        if let Some(chosen) = chosen {
            paint(runs, chosen, out.region.write());
        }
    }
}

impl SelectRegion {
    /// The region of the rank when those with the least key come first.
    fn choose(&self, list: &[Region], key: impl Fn(usize) -> f64) -> Option<usize> {
        let counts = |region: &Region| region.area as usize >= self.min_area && region.force >= self.min_force;
        let mut last: Option<(f64, usize)> = None;
        for _ in 0..self.rank {
            let mut first: Option<(f64, usize)> = None;
            for i in (0..list.len()).filter(|i| counts(&list[*i])) {
                let place = (key(i), i);
                if last.is_none_or(|last| place > last) && first.is_none_or(|first| place < first) {
                    first = Some(place);
                }
            }
            last = Some(first?);
        }
        last.map(|(_, i)| i)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Flag, Mask, Regions, RegionsShape, Run, Unit};

    use super::*;

    fn rig(params: &str) -> Result<NodeRig, Mistakes> {
        let grid = Grid { rows: 3, cols: 24, pitch: [0.005, 0.004] };
        NodeRig::new::<SelectRegion>(params, &[("regions", RegionsShape { grid, unit: Unit::NEWTON }.into())])
    }

    /// Regions of one run each, in the middle row: first column, tactels, force.
    fn show(rig: &mut NodeRig, regions: &[(u16, u16, f64)]) -> Option<Mask> {
        let mut all = Regions::with_room(3, 24);
        let (runs, list) = all.parts_mut();
        for (i, (start, area, force)) in regions.iter().enumerate() {
            runs.push(Run { row: 1, start: *start, end: start + area, region: i as u16 });
            list.push(Region { area: u32::from(*area), force: *force });
        }
        rig.set("regions", all);
        rig.step();
        let region = rig.get::<Mask>("region").cloned();
        assert_eq!(rig.get::<Flag>("present"), Some(&region.is_some()));
        region
    }

    /// First column and number of tactels of a mask.
    fn extent(mask: &Mask) -> (u16, u16) {
        assert_eq!(mask.row(1)[0].count_ones() as usize, mask.count());
        (mask.row(1)[0].trailing_zeros() as u16, mask.count() as u16)
    }

    #[test]
    fn the_region_of_a_rank_is_taken() {
        // columns 0..2, 4..8, 10..12, 20..23
        let four = [(0, 2, 5.0), (4, 4, 1.0), (10, 2, 9.0), (20, 3, 5.0)];
        let cases = [
            ("", Some(4)),
            ("by = \"area\"\nrank = 2", Some(20)),
            ("rank = 3", Some(0)),
            ("rank = 4", Some(10)),
            ("rank = 5", None),
            ("rank = 2\nmin_force = 5.5", None),
            ("rank = 2\nmin_force = 5.0", Some(0)),
            ("rank = 2\nmin_area = 3", Some(20)),
            ("by = \"force\"", Some(10)),
            ("by = \"force\"\nrank = 2", Some(0)),
            ("by = \"force\"\nrank = 3", Some(20)),
            ("by = \"distance\"\npoint = [0.0, 0.0]", Some(10)),
            ("by = \"distance\"\npoint = [1.0, 0.0]", Some(20)),
            ("by = \"distance\"\npoint = [1.0, 0.0]\nrank = 4", Some(0)),
            ("by = \"distance\"\npoint = [-0.03, 0.4]\nmin_area = 3", Some(4)),
            // 0.5 mm on either side of the middle between two
            ("by = \"distance\"\npoint = [-0.0005, 0.0]\nmin_force = 5.0\nmin_area = 1\nrank = 2", Some(20)),
        ];
        for (params, column) in cases {
            let found = show(&mut rig(params).unwrap(), &four);
            assert_eq!(found.map(|mask| extent(&mask).0), column, "{params}");
        }
        assert_eq!(show(&mut rig("").unwrap(), &[]), None);
    }

    #[test]
    fn what_is_refused() {
        let cases = [
            ("by = \"distance\"", At::Param("by".into())),
            ("point = [0.0, 0.0]", At::Key("point".into())),
            ("by = \"force\"\npoint = [0.0, 0.0]", At::Key("point".into())),
        ];
        for (params, at) in cases {
            assert_eq!(rig(params).err().unwrap()[0].at, at, "{params}");
        }
        for bad in ["by = \"size\"", "rank = 0", "by = \"distance\"\npoint = [1, 2, 3]", "min_area = 0"] {
            assert!(rig(bad).is_err(), "{bad}");
        }
    }

    proptest! {
        #[test]
        fn ranks_are_those_of_a_stable_sort(
            areas in prop::collection::vec((1..4u16, 0..5u8), 0..6),
            rank in 1..8usize,
            by in 0..3usize,
            x in -0.06..0.06f64,
        ) {
            // Four columns for each, so that no two touch.
            let regions: Vec<(u16, u16, f64)> =
                areas.iter().enumerate().map(|(i, (area, force))| (4 * i as u16, *area, f64::from(*force))).collect();
            let middle = |(start, area, _): &(u16, u16, f64)| {
                (f64::from(*start) + (f64::from(*area) - 1.0) / 2.0 - 11.5) * 0.005
            };
            let mut sorted = regions.clone();
            match by {
                0 => sorted.sort_by_key(|region| std::cmp::Reverse(region.1)),
                1 => sorted.sort_by(|a, b| b.2.total_cmp(&a.2)),
                _ => sorted.sort_by(|a, b| (middle(a) - x).abs().total_cmp(&(middle(b) - x).abs())),
            }
            let by = ["by = \"area\"".into(), "by = \"force\"".into(), format!("by = \"distance\"\npoint = [{x:?}, 0.0]")][by].clone();
            let found = show(&mut rig(&format!("rank = {rank}\n{by}")).unwrap(), &regions);
            let expected = sorted.get(rank - 1).map(|region| (region.0, region.1));
            prop_assert_eq!(found.map(|mask| extent(&mask)), expected);
        }
    }
}
