//! e is the eccentricity of the contact, h a heading, and l the length of two legs at right angles, each at 45° to the
//! heading:
//!
//! ```text
//! seek    u = d1 = R(pi/4) h, then d2 = R(-pi/4) h, for l each        m1, m2: slopes of e over the distance along d1, d2
//!         g = m1 d1 + m2 d2                                            h <- g / |g|    if |g| l >= least_rise
//! follow  u = s (cos alpha, sin alpha), s = ±1 such that u u_last >= 0    while e is above the bound
//! V_ext = speed (u, 0, 0, 0, 0)
//! ```
//!
//! A slope is that of the least-squares line through all samples of its leg, which averages the noise of e. Distances
//! are measured along the axes of the sensor, by its pose: R' (p - p_last).

use std::f64::consts::FRAC_1_SQRT_2;

use tactflow_runtime::node::{Describe, In, Inputs, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::{Flag, Pose, Scalar, Twist};

use crate::motion::travel::{Odometer, Stall};

/// Guides a sensor toward where the contact gets narrower, and then along the ridge.
///
/// The next step that the conclusion of the paper announces: guidance that is computed from touch. The shape of the
/// contact depends on the curvature of the surface: on a flat or round place the contact is round, on a ridge it is a
/// line. e is the eccentricity of the contact.
///
/// **Seek.** The sensor moves along two legs of `leg_m` at right angles, the first at 45° to the left of its heading and
/// the second at 45° to the right. m1 and m2 are the slopes of e over the legs, each of the line that fits all samples
/// best. The gradient is g = m1 d1 + m2 d2, and the next heading is g / |g|. If e changes by less than `least_rise` over
/// a leg, the heading is kept, so over an even surface the search goes straight on from `heading_rad`. Where the sensor
/// makes no progress, it turns round.
///
/// **Follow.** Above `on_above` the contact is a ridge, until e falls below `off_below`; `on_ridge` is for the condition
/// of a mode. The sensor moves along the orientation of the contact. Of the two directions along a line it takes the one
/// nearer to its last, so the direction never turns by more than a right angle from one sample to the next. Without an
/// orientation it keeps the last direction. Where the ridge ends, it seeks again.
///
/// The output is V_ext alone. Keep the contact in the middle and under pressure with `pid` and `projector`: with all
/// components of P while the sensor seeks, and without the component along the ridge while it follows. Without an
/// eccentricity the motion is absent, and it is as old as the eccentricity. After `reset_after_ms` without a contact the
/// search starts afresh.
///
/// A gradient needs an e that depends on the place. If noise hides the slope, use longer legs. Three tactels are a good
/// length, because the foam spreads the contact by one.
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
#[describe(name = "ridge_guide")]
pub struct RidgeGuide {
    speed: f64,
    heading: [f64; 2],
    leg: f64,
    least_rise: f64,
    bounds: [f64; 2],
}

/// Parameters of `ridge_guide`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Speed of the sensor. At 0 there is no motion, and the search starts afresh.
    #[param(unit = "m/s", range = 0.0.., default = 0.0, live)]
    speed_m_per_s: f64,
    /// First heading, from the sensor's +x toward +y.
    #[param(unit = "rad", default = 0.0)]
    heading_rad: f64,
    /// Length of each of the two legs that a gradient is computed from.
    #[param(unit = "m", above = 0.0, default = 0.01)]
    leg_m: f64,
    /// Smallest change of the eccentricity over a leg that changes the heading.
    #[param(unit = "1", range = 0.0..=1.0, default = 0.02)]
    least_rise: f64,
    /// Above this eccentricity the contact is a ridge.
    #[param(unit = "1", range = 0.0..=1.0, default = 0.95)]
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
    #[port(unit = "rad mod pi", frame = "A")]
    orientation: Option<In<'a, Scalar>>,
    /// Pose of the sensor in the base, to measure distances.
    #[port(frame = "A", reference = "B", sampled)]
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

/// What `ridge_guide` remembers.
#[derive(State)]
pub struct State {
    odometer: Odometer,
    /// Heading of the search, a unit vector.
    heading: [f64; 2],
    /// Slope over the first leg, during the second [1/m].
    first: Option<f64>,
    /// The current leg.
    leg: Leg,
    stall: Stall,
    /// Direction along the ridge, on a ridge.
    along: Option<[f64; 2]>,
    /// Rise over one leg, from the last two legs [1].
    rise: f64,
}

impl Node for RidgeGuide {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let (on, off) = (params.on_above, params.off_below);
        if off >= on {
            let message = format!("`off_below` is {off}, not less than `on_above`, which is {on}");
            let help = "a ridge begins above `on_above` and ends below `off_below`";
            return Err(Mistake::param("off_below", message).help(help).into());
        }
        let (sine, cosine) = libm::sincos(params.heading_rad);
        Ok(Self {
            speed: params.speed_m_per_s,
            heading: [cosine, sine],
            leg: params.leg_m,
            least_rise: params.least_rise,
            bounds: [on, off],
        })
    }

    fn state(&self) -> State {
        State {
            odometer: Odometer::default(),
            heading: self.heading,
            first: None,
            leg: Leg::default(),
            stall: Stall::default(),
            along: None,
            rise: 0.0,
        }
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let narrow = *inputs.eccentricity;
        if self.speed <= 0.0 {
            *state = self.state();
            out.on_ridge.set(narrow > self.bounds[0]);
            out.rise.set(0.0);
            return;
        }
        let line = inputs.orientation.map(|angle| {
            let (sine, cosine) = libm::sincos(*angle);
            [cosine, sine]
        });
        let direction = match self.ridge(narrow, line, state) {
            Some(along) => along,
            None => self.seek(narrow, &inputs.pose, tick, state),
        };
        out.twist.set(Twist([self.speed * direction[0], self.speed * direction[1], 0.0, 0.0, 0.0, 0.0].into()));
        out.on_ridge.set(state.along.is_some());
        out.rise.set(state.rise);
    }
}

impl RidgeGuide {
    /// Returns the direction along the ridge, or `None` if the contact is not a ridge.
    fn ridge(&self, narrow: f64, line: Option<[f64; 2]>, state: &mut State) -> Option<[f64; 2]> {
        let [on, off] = self.bounds;
        let last = match state.along {
            Some(along) if narrow < off => {
                // Where the ridge ends, the search continues in the same direction.
                *state = State { heading: along, ..self.state() };
                return None;
            }
            Some(along) => along,
            None if narrow > on && line.is_some() => state.direction(),
            None => return None,
        };
        let along = line.map_or(last, |line| if dot(line, last) < 0.0 { line.map(|part| -part) } else { line });
        state.along = Some(along);
        state.along
    }

    /// Adds a sample to the leg and returns the direction of the search.
    fn seek(&self, narrow: f64, pose: &Pose, tick: &Tick, state: &mut State) -> [f64; 2] {
        let step = state.odometer.step(pose);
        state.leg.add(dot(step, state.direction()), narrow);
        if state.leg.way >= self.leg {
            self.end_leg(state);
        } else if state.stall.is_stuck(state.leg.way, self.speed, tick) {
            let back = state.heading.map(|part| -part);
            *state = State { heading: back, odometer: state.odometer, ..self.state() };
        }
        state.direction()
    }

    /// Ends a leg: begins the second one, or computes the next heading.
    fn end_leg(&self, state: &mut State) {
        let slope = state.leg.slope();
        state.stall = Stall::default();
        state.leg = Leg::default();
        let Some(first) = state.first.take() else {
            state.first = Some(slope);
            return;
        };
        let (one, two) = (turned(state.heading, 1.0), turned(state.heading, -1.0));
        let gradient = [first * one[0] + slope * two[0], first * one[1] + slope * two[1]];
        let steepness = dot(gradient, gradient).sqrt();
        let rise = steepness * self.leg;
        if !rise.is_finite() {
            return;
        }
        state.rise = rise;
        if rise >= self.least_rise && steepness > 0.0 {
            state.heading = gradient.map(|part| part / steepness);
        }
    }
}

impl State {
    /// Returns the direction of the current leg.
    fn direction(&self) -> [f64; 2] {
        turned(self.heading, if self.first.is_none() { 1.0 } else { -1.0 })
    }
}

/// The samples of a leg: running sums for the least-squares line of e over the distance.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Leg {
    /// Distance along the leg [m].
    way: f64,
    count: f64,
    /// Means of the distance and of e so far; the sums of their products are about these means.
    mean: [f64; 2],
    spread: f64,
    common: f64,
}

impl Leg {
    /// Adds a sample of e after a `step` [m].
    fn add(&mut self, step: f64, narrow: f64) {
        self.way += step;
        self.count += 1.0;
        let off = [self.way - self.mean[0], narrow - self.mean[1]];
        self.mean = [self.mean[0] + off[0] / self.count, self.mean[1] + off[1] / self.count];
        self.spread += off[0] * (self.way - self.mean[0]);
        self.common += off[1] * (self.way - self.mean[0]);
    }

    /// Returns the slope of the line that fits best [1/m]; 0 without a distance.
    fn slope(&self) -> f64 {
        let slope = self.common / self.spread;
        if slope.is_finite() { slope } else { 0.0 }
    }
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Turns a vector by 45° to the left (`side` 1) or to the right (-1).
fn turned([x, y]: [f64; 2], side: f64) -> [f64; 2] {
    [FRAC_1_SQRT_2 * (x - side * y), FRAC_1_SQRT_2 * (side * x + y)]
}

#[cfg(test)]
mod tests;
