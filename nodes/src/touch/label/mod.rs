//! `label`: the connected regions of a mask, and the region that is the contact (paper section III, after its ref. 21).

mod centroids;
mod choice;
mod neighbours;
mod runs;

use tactflow_runtime::node::{
    Absence, At, Describe, In, Inputs, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick,
};
use tactflow_runtime::signal::{Flag, Grid, Image, Mask, Region, Regions, RegionsShape, Run};
use tactflow_runtime::source::Code;

use crate::touch::common::check_same_array;
use crate::usual::{USUAL_CONTACT_N, unusual_force};
use neighbours::Neighbours;

pub use centroids::{centroid_buffer, centroids};
pub use choice::{contact, distance_squared, nearest, ranked};
pub use runs::{number, paint, trace};

/// Finds the connected regions of a mask, and the region that is the contact.
///
/// Neighbouring tactels of the mask form a region (connected components, paper section III). The contact R is the
/// largest region; `regions` lists all of them, for `select_region`. Of two equal regions the one that comes first, row
/// by row, is the contact.
///
/// **Absence.** A noisy pad has a region in almost every frame, even if nothing touches it: in 99.96 % of the frames
/// with white noise of 0.08 and a threshold of 0.15 units. So a contact has at least `min_area` tactels and at least
/// `min_force`. Without a contact, `region` is absent, `present` is not set, and all features of the contact are
/// absent. On such an empty pad a region of six tactels occurs once in 4000 frames.
///
/// **Two contacts.** With `choose = "largest"` the contact is chosen in each frame: a second, larger touch takes over
/// at once, and two of the same size alternate. With `choose = "nearest"` the contact is the region whose centroid (the
/// mean position of its tactels) is nearest to that of the last contact, however large the others are. The first
/// contact is the largest region, and so is the one after an absence of `reset_after_ms`; a shorter absence keeps the
/// position. If the contact is lifted while another region is present, that region is the contact from the next frame
/// on. To track several contacts, use one `select_region` for each.
///
/// **Neighbours.** With 8, two tactels with a common corner are in one region; with 4 they are not. On a recording with
/// several contacts the numbers of regions differ in 39 % of the frames.
///
/// ```toml
/// [nodes.label]
/// type = "label"
/// in.image = "calibrate.image"
/// in.mask = "binarize.mask"
/// min_area = 4                        # [tactels]
/// min_force = 0.1                     # [N]
/// ```
#[derive(Describe)]
pub struct Label {
    /// How many columns beyond its ends a run touches runs of the next row.
    reach: u32,
    params: Params,
    grid: Grid,
}

/// Parameters of `label`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Number of neighbours of a tactel: 4 (common edges) or 8 (also common corners).
    #[param(default = Neighbours::EIGHT)]
    neighbours: Neighbours,
    /// Smallest area of a contact.
    #[param(unit = "tactel", range = 1..=1_000_000, default = 1, live)]
    min_area: usize,
    /// Smallest force of a contact, the sum over its tactels.
    #[param(unit = "U", default = 0.0, live)]
    min_force: f64,
    /// Which of the regions with `min_area` and `min_force` is the contact.
    #[param(default = Choose::Largest)]
    choose: Choose,
}

/// Which region is the contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
enum Choose {
    /// The largest.
    Largest,
    /// The nearest to the last contact; the largest if there was none.
    Nearest,
}

/// What `label` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The image with the values of the tactels.
    #[port(unit = "U", frame = "A")]
    image: In<'a, Image>,
    /// The tactels that may be in contact.
    #[port(frame = "A")]
    mask: In<'a, Mask>,
}

/// What `label` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The tactels of the contact, R; absent if there is no contact.
    #[port(frame = "A")]
    region: Out<Mask>,
    /// All regions of the mask, in the order of their first tactels, with their areas and forces.
    #[port(unit = "U", frame = "A")]
    regions: Out<Regions>,
    /// Whether there is a contact.
    #[port(quantity = "contact")]
    present: Out<Flag>,
}

/// What `label` remembers.
#[derive(State)]
pub struct State {
    /// Centroid of the last contact [m].
    last: Option<[f64; 2]>,
    /// Absence of the contact.
    absence: Absence,
    /// Buffer for the centroid of each region.
    centroids: Vec<[f64; 2]>,
}

impl Node for Label {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let (image, mask) = (&setup.inputs.image, &setup.inputs.mask);
        check_same_array(image, "mask", mask)?;
        if !runs::is_countable(mask) {
            let message = format!(
                "an array of {} by {} tactels is too large: a mask on it can have more than 65535 runs of tactels",
                mask.rows, mask.cols
            );
            return Err(Mistake::input("mask", message).help("use a pad with fewer tactels").into());
        }
        let reach = u32::from(params.neighbours == Neighbours::EIGHT);
        setup.warnings.extend(unusual_force("min_force", params.min_force, USUAL_CONTACT_N, image.unit));
        setup.warnings.extend(unreachable_area(params.min_area, image.tactels()));
        let grid = mask.clone();
        setup.outputs.regions = RegionsShape { grid: grid.clone(), unit: image.unit };
        setup.outputs.region = grid.clone();
        Ok(Self { reach, params, grid })
    }

    fn state(&self) -> State {
        State { last: None, absence: Absence::default(), centroids: centroid_buffer(&self.grid) }
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let (runs, regions) = out.regions.write().parts_mut();
        trace(&inputs.mask, self.reach, runs);
        number(&inputs.image, runs, regions);
        let largest = contact(regions, self.params.min_area, self.params.min_force);
        let contact = match self.params.choose {
            Choose::Largest => largest,
            Choose::Nearest => self.track(largest, tick, runs, regions, state),
        };
        out.present.set(contact.is_some());
        if let Some(contact) = contact {
            paint(runs, contact, out.region.write());
        }
    }
}

impl Label {
    /// Returns the region that is nearest to the last contact, or `largest` if there was none.
    fn track(
        &self,
        largest: Option<usize>,
        tick: &Tick,
        runs: &[Run],
        regions: &[Region],
        state: &mut State,
    ) -> Option<usize> {
        let Some(largest) = largest else {
            state.absence.begin(tick.now);
            return None;
        };
        if state.absence.end(tick) {
            state.last = None;
        }
        let centroids = centroids(&self.grid, runs, regions, &mut state.centroids);
        let Params { min_area, min_force, .. } = self.params;
        let nearest = state.last.and_then(|last| nearest(regions, centroids, last, min_area, min_force));
        let contact = nearest.unwrap_or(largest);
        state.last = Some(centroids[contact]);
        Some(contact)
    }
}

/// Returns the warning about a minimum area that is larger than the pad, so that there is never a contact.
fn unreachable_area(min_area: usize, tactels: usize) -> Option<Mistake> {
    let message = format!("`min_area` is {min_area} tactels, but the pad has {tactels}: no contact is that large");
    let warning = Mistake::new(Code::UnusualValue, At::Param("min_area".into()), message);
    (min_area > tactels).then(|| warning.help("write the tactels that a small contact has, for example `4`"))
}

#[cfg(test)]
mod tests;
