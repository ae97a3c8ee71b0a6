//! `ridge_guide`: the search for a ridge, and the way along it.

mod search;
mod slope;

use tactflow_runtime::node::{Describe, In, Inputs, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Flag, Pose, Scalar, Twist};

use crate::usual::{USUAL_LENGTH_M, USUAL_M_PER_S, USUAL_RAD};
use search::Search;

/// Guides a sensor toward where the contact gets narrower, and then along the ridge.
///
/// The next step that the conclusion of the paper announces: guidance that is computed from touch. The shape of the
/// contact depends on the curvature of the surface: on a flat or round place the contact is round, on a ridge it is a
/// line. e is the eccentricity of the contact.
///
/// **Seek.** The sensor moves along two legs of `leg_m` at right angles, the first at 45° to the left of its heading
/// and the second at 45° to the right. m1 and m2 are the slopes of e over the legs, each of the line that fits all
/// samples best. The gradient is g = m1 d1 + m2 d2, and the next heading is g / |g|. If e changes by less than
/// `least_rise` over a leg, the heading is kept, so over an even surface the search goes straight on from
/// `heading_rad`. Where the sensor makes no progress, it turns round.
///
/// **Follow.** Above `on_above` the contact is a ridge, until e falls below `off_below`; `on_ridge` is for the
/// condition of a mode. The sensor moves along the orientation of the contact. Of the two directions along a line it
/// takes the one nearer to its last, so the direction never turns by more than a right angle from one sample to the
/// next. Without an orientation it keeps the last direction. Where the ridge ends, it seeks again.
///
/// The output is V_ext alone. Keep the contact in the middle and under pressure with `pid` and `projector`: with all
/// components of P while the sensor seeks, and without the component along the ridge while it follows. Without an
/// eccentricity the motion is absent, and it is as old as the eccentricity. After `reset_after_ms` without a contact
/// the search starts afresh.
///
/// A gradient needs an e that depends on the place. If noise hides the slope, use longer legs. Three tactels are a good
/// length, because the foam spreads the contact by one.
///
/// A pad shows no more of a ridge than its own length, so the eccentricity of a line depends on the pad: a rod of 20 mm
/// has 0.98 on a pad of 80 mm and 0.81 on one of 24 mm. A task for any pad uses lower bounds, such as `on_above = 0.75`.
///
/// ```toml
/// [nodes.ridge]
/// type = "ridge_guide"
/// in.eccentricity = "eccentricity.eccentricity"
/// in.orientation = "moments.orientation"
/// in.pose = "state.sensor_pose"
/// speed_m_per_s = 0.01
/// leg_m = 0.015                       # three tactels
/// ```
#[derive(Describe)]
pub struct RidgeGuide {
    params: Params,
}

/// Parameters of `ridge_guide`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Speed of the sensor. At 0 there is no motion, and the search starts afresh.
    #[param(unit = "m/s", range = 0.0.., usual = ..=USUAL_M_PER_S, default = 0.0, live)]
    speed_m_per_s: f64,
    /// First heading, from the sensor's +x toward +y.
    #[param(unit = "rad", usual = -USUAL_RAD..=USUAL_RAD, default = 0.0)]
    heading_rad: f64,
    /// Length of each of the two legs that a gradient is computed from.
    #[param(unit = "m", above = 0.0, usual = ..=USUAL_LENGTH_M, default = 0.01)]
    leg_m: f64,
    /// Smallest change of the eccentricity over a leg that changes the heading.
    #[param(unit = "1", range = 0.0..=1.0, default = 0.02)]
    least_rise: f64,
    /// Above this eccentricity the contact is a ridge.
    #[param(unit = "1", range = 0.0..=1.0, usual = ..=0.98, default = 0.95)]
    on_above: f64,
    /// Below this eccentricity the contact is no longer a ridge.
    #[param(unit = "1", range = 0.0..=1.0, default = 0.9)]
    off_below: f64,
}

/// What `ridge_guide` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Eccentricity of the contact, from 0 (round) to 1 (a line): from `eccentricity`, or the anisotropy of `moments`.
    #[port(unit = "1", frame = "A")]
    eccentricity: In<'a, Scalar>,
    /// Direction of the long axis of the contact.
    #[port(unit = "rad mod pi", frame = "A", quantity = "orientation")]
    orientation: Option<In<'a, Scalar>>,
    /// Pose of the sensor in the base, to measure distances.
    #[port(frame = "A", reference = "B", quantity = "sensor_pose", sampled)]
    pose: In<'a, Pose>,
}

/// What `ridge_guide` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The motion over the surface; absent without a contact, and at a speed of 0.
    #[port(frame = "A")]
    twist: Out<Twist>,
    /// Whether the contact is a ridge.
    on_ridge: Out<Flag>,
    /// Rise of the eccentricity over one leg along the gradient of the last two legs; helps to choose `least_rise`.
    #[port(unit = "1", frame = "A")]
    rise: Out<Scalar>,
}

impl Node for RidgeGuide {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = Search;

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let (on, off) = (params.on_above, params.off_below);
        if off >= on {
            let message = format!("`off_below` is {off}, but it must be less than `on_above`, which is {on}");
            let help = "a ridge begins above `on_above` and ends below `off_below`";
            return Err(Mistake::param("off_below", message).help(help).into());
        }
        Ok(Self { params })
    }

    fn state(&self) -> Search {
        Search::new(unit(self.params.heading_rad))
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, search: &mut Search) {
        let (narrow, speed) = (*inputs.eccentricity, self.params.speed_m_per_s);
        if speed <= 0.0 {
            *search = self.state();
            out.on_ridge.set(narrow > self.params.on_above);
            out.rise.set(0.0);
            return;
        }
        let line = inputs.orientation.map(|angle| unit(*angle));
        let [x, y] = match search.follow(&self.params, narrow, line) {
            Some(along) => along,
            None => search.seek(&self.params, narrow, &inputs.pose, tick),
        };
        out.twist.set(Twist([speed * x, speed * y, 0.0, 0.0, 0.0, 0.0].into()));
        out.on_ridge.set(search.along.is_some());
        out.rise.set(search.rise);
    }
}

/// Returns the unit vector at an angle [rad].
fn unit(angle: f64) -> [f64; 2] {
    let (sine, cosine) = libm::sincos(angle);
    [cosine, sine]
}

#[cfg(test)]
mod tests;
