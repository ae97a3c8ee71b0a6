//! `select_region`: one of the regions that `label` has found, by its rank.

use tactflow_runtime::node::{
    At, Describe, In, Inputs, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick,
};
use tactflow_runtime::signal::{Flag, Grid, Mask, Regions};
use tactflow_runtime::source::Code;

use super::label::{centroid_buffer, centroids, distance_squared, paint, ranked};
use crate::usual::{USUAL_CONTACT_N, unusual_force};

/// Selects one of several contacts: the n-th largest, strongest, or nearest to a point.
///
/// `label` lists all regions of a mask. This node selects one of them, for `moments` and the other nodes that measure a
/// region. With one `select_region` for each contact, all on one `label`, each contact has its own features.
///
/// Regions with less than `min_area` tactels or less than `min_force` are left out. The others are ordered by area (the
/// largest first), by force (the strongest first) or by the distance of their centroid, the mean position of their
/// tactels, from `point` (the nearest first). Equal regions are ordered row by row. The node selects the region of that
/// `rank`. If there is none, `region` is absent and `present` is not set.
///
/// The node has no memory: two contacts of about the same area swap their ranks from frame to frame. If the contacts
/// stay in their places, `by = "distance"` separates them while all of them are present; when one is lifted, another
/// one is the nearest to its `point`. To require a second contact, use `present` of a `select_region` with `rank = 2`.
/// To follow a single contact, use `choose = "nearest"` of `label`.
///
/// ```toml
/// [nodes.select_region]
/// type = "select_region"
/// in.regions = "label.regions"
/// by = "distance"                     # the nearest to `point`
/// point = [0.02, 0.0]                 # [m]
/// min_area = 4                        # [tactels]
/// ```
#[derive(Describe)]
pub struct SelectRegion {
    params: Params,
    grid: Grid,
}

/// Parameters of `select_region`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Order of the regions.
    #[param(default = By::Area)]
    by: By,
    /// Rank of the selected region: 1 is the first, 2 the second.
    #[param(range = 1..=1_000_000, default = 1)]
    rank: usize,
    /// Position `[x, y]` from the middle of the pad, for `by = "distance"`.
    #[param(unit = "m")]
    point: Option<[f64; 2]>,
    /// Smallest area of a region that counts.
    #[param(unit = "tactel", range = 1..=1_000_000, default = 1)]
    min_area: usize,
    /// Smallest force of a region that counts, the sum over its tactels.
    #[param(unit = "U", default = 0.0)]
    min_force: f64,
}

/// Order of the regions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
enum By {
    /// The largest first.
    Area,
    /// The strongest first.
    Force,
    /// The nearest to `point` first.
    Distance,
}

/// What `select_region` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// All regions, as `label` lists them.
    #[port(unit = "U", frame = "A")]
    regions: In<'a, Regions>,
}

/// What `select_region` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The region of the rank; absent if there are fewer.
    #[port(frame = "A")]
    region: Out<Mask>,
    /// Whether there is a region of the rank.
    present: Out<Flag>,
}

/// What `select_region` remembers: a buffer of a step.
#[derive(State)]
pub struct State {
    /// Centroid of each region [m].
    centroids: Vec<[f64; 2]>,
}

impl Node for SelectRegion {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        match (params.by, params.point) {
            (By::Distance, None) => {
                let message = "`by = \"distance\"` needs a `point`";
                let mistake = Mistake::new(Code::MissingKey, At::Param("by".into()), message);
                return Err(mistake.help("write `point = [x, y]`, in metres from the middle of the pad").into());
            }
            (By::Area | By::Force, Some(_)) => {
                let mistake = Mistake::key("point", "`point` has no effect without `by = \"distance\"`");
                return Err(mistake.help("write `by = \"distance\"`, or leave `point` out").into());
            }
            _ => {}
        }
        let unit = setup.inputs.regions.unit;
        setup.warnings.extend(unusual_force("min_force", params.min_force, USUAL_CONTACT_N, unit));
        let grid = setup.inputs.regions.grid.clone();
        setup.outputs.region = grid.clone();
        Ok(Self { params, grid })
    }

    fn state(&self) -> State {
        State { centroids: centroid_buffer(&self.grid) }
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let (list, runs) = (inputs.regions.list(), inputs.regions.runs());
        let Params { by, rank, point, min_area, min_force } = self.params;
        let counts = |i: &usize| list[*i].area as usize >= min_area && list[*i].force >= min_force;
        let counted = (0..list.len()).filter(counts);
        let chosen = match (point, by) {
            (None, By::Force) => ranked(rank, counted, |i| -list[i].force),
            (None, _) => ranked(rank, counted, |i| -f64::from(list[i].area)),
            (Some(point), _) => {
                let centroids = centroids(&self.grid, runs, list, &mut state.centroids);
                ranked(rank, counted, |i| distance_squared(centroids[i], point))
            }
        };
        out.present.set(chosen.is_some());
        if let Some(chosen) = chosen {
            paint(runs, chosen, out.region.write());
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tactflow_runtime::harness::{NodeRig, places};
    use tactflow_runtime::signal::{Region, RegionsShape, Run, Unit};

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

    /// Returns the first column and the number of tactels of a mask.
    fn extent(mask: &Mask) -> (u16, u16) {
        assert_eq!(mask.row(1)[0].count_ones() as usize, mask.count());
        (mask.row(1)[0].trailing_zeros() as u16, mask.count() as u16)
    }

    #[test]
    fn it_selects_the_region_of_the_rank() {
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
    fn wrong_parameters_are_refused() {
        let cases = [
            ("by = \"distance\"", At::Param("by".into())),
            ("point = [0.0, 0.0]", At::Key("point".into())),
            ("by = \"force\"\npoint = [0.0, 0.0]", At::Key("point".into())),
        ];
        for (params, at) in cases {
            assert_eq!(rig(params).err().unwrap()[0].at, at, "{params}");
        }
        for (bad, place) in [
            ("by = \"size\"", "bad-value: `\"size\"`"),
            ("rank = 0", "bad-value: `0`"),
            ("by = \"distance\"\npoint = [1, 2, 3]", "bad-value: `[1, 2, 3]`"),
            ("min_area = 0", "bad-value: `0`"),
        ] {
            assert_eq!(places(bad, &rig(bad)), [place], "{bad}");
        }
    }

    proptest! {
        #[test]
        fn the_order_is_that_of_a_stable_sort(
            areas in prop::collection::vec((1..4u16, 0..5u8), 0..6),
            rank in 1..8usize,
            by in 0..3usize,
            x in -0.06..0.06f64,
        ) {
            // Four columns for each, so that no two touch.
            let regions: Vec<(u16, u16, f64)> =
                areas.iter().enumerate().map(|(i, (area, force))| (4 * i as u16, *area, f64::from(*force))).collect();
            let centroid = |(start, area, _): &(u16, u16, f64)| {
                (f64::from(*start) + (f64::from(*area) - 1.0) / 2.0 - 11.5) * 0.005
            };
            let mut sorted = regions.clone();
            match by {
                0 => sorted.sort_by_key(|region| std::cmp::Reverse(region.1)),
                1 => sorted.sort_by(|a, b| b.2.total_cmp(&a.2)),
                _ => sorted.sort_by(|a, b| (centroid(a) - x).abs().total_cmp(&(centroid(b) - x).abs())),
            }
            let by = ["by = \"area\"".into(), "by = \"force\"".into(), format!("by = \"distance\"\npoint = [{x:?}, 0.0]")][by].clone();
            let found = show(&mut rig(&format!("rank = {rank}\n{by}")).unwrap(), &regions);
            let expected = sorted.get(rank - 1).map(|region| (region.0, region.1));
            prop_assert_eq!(found.map(|mask| extent(&mask)), expected);
        }
    }
}
