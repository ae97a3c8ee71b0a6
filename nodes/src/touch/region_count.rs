//! `region_count`: how many contacts there are.

use tactflow_runtime::node::{Describe, In, Inputs, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Regions, Scalar};

use crate::usual::{USUAL_CONTACT_N, unusual_force};

/// Counts the contacts: the regions that `label` lists, without those that are too small.
///
/// Regions with less than `min_area` tactels or less than `min_force` are not counted, as `select_region` leaves them
/// out. `count` is 0 on an untouched pad, and absent only while `regions` is.
///
/// Use it in a condition of a mode that depends on how many objects touch the pad. `select_region` with `rank = 2` selects
/// the second contact itself.
///
/// ```toml
/// [nodes.region_count]
/// type = "region_count"
/// in.regions = "label.regions"
/// min_area = 4                        # [tactels]
/// ```
#[derive(Describe)]
pub struct RegionCount {
    params: Params,
}

/// Parameters of `region_count`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Smallest area of a region that counts.
    #[param(unit = "tactel", range = 1..=1_000_000, default = 1)]
    min_area: usize,
    /// Smallest force of a region that counts, the sum over its tactels.
    #[param(unit = "U", default = 0.0)]
    min_force: f64,
}

/// What `region_count` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// All regions, as `label` lists them.
    #[port(unit = "U", frame = "A")]
    regions: In<'a, Regions>,
}

/// What `region_count` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Number of regions that count.
    #[port(unit = "1", frame = "A")]
    count: Out<Scalar>,
}

impl Node for RegionCount {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let unit = setup.inputs.regions.unit;
        setup.warnings.extend(unusual_force("min_force", params.min_force, USUAL_CONTACT_N, unit));
        Ok(Self { params })
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let Params { min_area, min_force } = self.params;
        let regions = inputs.regions.list().iter();
        let counted = regions.filter(|region| region.area as usize >= min_area && region.force >= min_force);
        out.count.set(counted.count() as f64);
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Grid, Region, RegionsShape, Unit};

    use super::*;

    #[test]
    fn regions_that_are_too_small_are_not_counted() {
        let regions = [(2, 5.0), (4, 1.0), (9, 0.2)];
        for (params, count) in [
            ("", 3.0),
            ("min_area = 4", 2.0),
            ("min_force = 1.0", 2.0),
            ("min_area = 4\nmin_force = 1.0", 1.0),
            ("min_area = 10", 0.0),
        ] {
            let grid = Grid { rows: 3, cols: 24, pitch: [0.005, 0.004] };
            let shape = RegionsShape { grid, unit: Unit::NEWTON };
            let mut rig = NodeRig::new::<RegionCount>(params, &[("regions", shape.into())]).unwrap();
            let mut all = Regions::with_room(3, 24);
            all.parts_mut().1.extend(regions.map(|(area, force)| Region { area, force }));
            rig.set("regions", all);
            rig.step();
            assert_eq!(rig.get::<Scalar>("count").copied(), Some(count), "{params}");
            rig.set("regions", Regions::with_room(3, 24));
            rig.step();
            assert_eq!(rig.get::<Scalar>("count").copied(), Some(0.0), "an untouched pad has no contact");
        }
    }
}
