//! `ridge_guide`: guidance that is computed from touch (the paper's conclusion): toward where the contact gets narrower,
//! and then along the ridge.
//!
//! With e the eccentricity of the contact, h a heading and two legs of length l at right angles, half a right angle to
//! either side of it:
//!
//! ```text
//! seek    u = d1 = R(pi/4) h, then d2 = R(-pi/4) h, for l each        m1, m2: slopes of e over the way along d1 and d2
//!         g = m1 d1 + m2 d2                                            h <- g / |g|    if |g| l >= least_rise
//! follow  u = s (cos alpha, sin alpha), s = ±1 such that u u_last >= 0    while e is above the bound
//! V_ext = speed (u, 0, 0, 0, 0)
//! ```
//!
//! A slope is that of the least-squares line through all samples of its leg, so the noise of e counts with its mean. The
//! way is the sensor's own, by its pose: R' (p - p_last).

use std::f64::consts::FRAC_1_SQRT_2;

use tactflow_runtime::node::{Mistake, Mistakes, Node, NonNegative, Positive, Ratio, Setup, Tick};
use tactflow_runtime::signal::{Pose, Twist};
use tactflow_runtime::{inputs, outputs, params, state};

use crate::motion::travel::{Odometer, Stall};

params! {
    /// How fast; at 0 there is no motion, and what was found is forgotten [m/s].
    live speed_m_per_s: NonNegative = NonNegative(0.0),
    /// Where it seeks first, from the sensor's +x toward +y [rad].
    heading_rad: f64 = 0.0,
    /// Length of each of the two legs that a gradient is taken from [m].
    leg_m: Positive = Positive(0.01),
    /// Least change of the eccentricity over a leg that says where to go; below it the heading is kept [1].
    least_rise: Ratio = Ratio(0.02),
    /// Above this eccentricity the contact is a ridge [1].
    on_above: Ratio = Ratio(0.95),
    /// Below this it is none any more [1].
    off_below: Ratio = Ratio(0.9),
}

inputs! {
    /// How narrow the contact is, from 0 (round) to 1 (a line): `eccentricity`, or the anisotropy of `moments`.
    eccentricity: Scalar["1", "A"],
    /// Direction of the contact's long axis [rad].
    orientation: Trigger<Scalar["rad mod pi", "A"]>,
    /// Pose of the sensor in the base, which the way is measured by [m].
    pose: Sampled<Pose["A", "B"]>,
}

outputs! {
    /// The motion over the surface [m/s, rad/s]; absent without a contact, and at a speed of 0.
    twist: Twist["A"],
    /// Whether the contact is a ridge.
    on_ridge: Flag,
    /// How much the eccentricity rises over a leg up the slope, by the last two legs; to choose `least_rise` by [1].
    rise: Scalar["1", "A"],
}

state! {
    /// The steps of the sensor.
    odometer: Odometer,
    /// Where the search heads.
    heading: [f64; 2],
    /// The slope over the first leg, while the second is gone [1/m].
    first: Option<f64>,
    /// The leg that is gone.
    leg: Leg,
    /// Whether that leg gets any longer.
    stall: Stall,
    /// Direction along the ridge, while there is one.
    along: Option<[f64; 2]>,
    /// The rise over a leg, by the last two.
    rise: f64,
}

/// How it seeks, and what a ridge is.
pub struct RidgeGuide {
    speed: f64,
    heading: [f64; 2],
    leg: f64,
    least_rise: f64,
    bounds: [f64; 2],
}

impl tactflow_runtime::node::Describe for RidgeGuide {
    const NAME: &'static str = "ridge_guide";
    const SUMMARY: &'static str = "guides a sensor toward where the contact gets narrower, and then along the ridge";
    const DOC: &'static str = "The step that the paper's conclusion announces: guidance that is computed from touch. \
        The contact tells the curvature of the surface: on a flat or round place it is round, on a ridge it is a \
        line. e is the eccentricity.\n\n\
        **Seek.** The sensor goes two legs of `leg_m` at right angles, the first 45° to the left of its heading and the \
        second 45° to the right. The slope of e over each is that of the straight line that fits all its samples best, m1 \
        and m2, so g = m1 d1 + m2 d2 is the gradient, and the next heading is g / |g|. If e changed by less than \
        `least_rise` a leg, there is nothing to go by and the heading is kept: over an even surface the search goes \
        straight on, from `heading_rad`. Where the sensor gets no further, it turns round.\n\n\
        **Follow.** Above `on_above` the contact is a ridge, until it falls below `off_below`: `on_ridge`, for a mode's \
        condition. The motion goes along the contact's orientation. Of the two ways along a line it keeps to the one \
        that it is on: the direction never turns by more than a right angle from one sample to the next. Without an \
        orientation the last direction holds. Where the ridge ends, it seeks again.\n\n\
        It adds V_ext alone: keep the contact in the middle and under pressure with `pid` and `projector`, with the \
        whole of P while it seeks, and without the row along the ridge while it follows. The eccentricity is the gate: \
        without a contact there is none, and the motion is as old as it. After `reset_after_ms` the search begins \
        anew.\n\n\
        e must differ with the place for a gradient: where a slope is lost in the noise, give longer legs. Three \
        tactels are a good leg, as the foam spreads the contact by one.";
    const EXAMPLE: &'static str = r#"
[nodes.ridge]
type = "ridge_guide"
in.eccentricity = "eccentricity.eccentricity"
in.orientation = "moments.orientation"
in.pose = "state.sensor_pose"
speed_m_per_s = 0.01
leg_m = 0.015                       # three tactels
"#;
}

impl Node for RidgeGuide {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let mut mistakes = Mistakes::new();
        if setup.inputs.orientation.is_none() {
            mistakes.push(crate::unwired(
                <Self as tactflow_runtime::node::Describe>::NAME,
                "orientation",
                "a scalar",
                "moments.orientation",
            ));
        }
        let (on, off) = (*params.on_above, *params.off_below);
        if off >= on {
            let message = format!("a ridge would end below {off}, though it only begins above {on}");
            mistakes.push(Mistake::param("off_below", message).help("`off_below` is less than `on_above`"));
        }
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        let (sine, cosine) = libm::sincos(params.heading_rad);
        Ok(Self {
            speed: *params.speed_m_per_s,
            heading: [cosine, sine],
            leg: *params.leg_m,
            least_rise: *params.least_rise,
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
    /// Which way along the ridge, if the contact is one.
    fn ridge(&self, narrow: f64, line: Option<[f64; 2]>, state: &mut State) -> Option<[f64; 2]> {
        let [on, off] = self.bounds;
        let last = match state.along {
            Some(along) if narrow < off => {
                // Where the ridge ends, the search goes on the same way.
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

    /// Which way to seek, after one more sample.
    fn seek(&self, narrow: f64, pose: &Pose, tick: &Tick, state: &mut State) -> [f64; 2] {
        let step = state.odometer.step(pose);
        state.leg.add(dot(step, state.direction()), narrow);
        if state.leg.way >= self.leg {
            self.turn(state);
        } else if state.stall.is_stuck(state.leg.way, self.speed, tick) {
            let back = state.heading.map(|part| -part);
            *state = State { heading: back, odometer: state.odometer, ..self.state() };
        }
        state.direction()
    }

    /// A leg is over: the other one, or the next heading.
    fn turn(&self, state: &mut State) {
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
    /// The direction of the present leg.
    fn direction(&self) -> [f64; 2] {
        turned(self.heading, if self.first.is_none() { 1.0 } else { -1.0 })
    }
}

/// What is gathered on a leg: sums for the straight line of e over the way.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
struct Leg {
    /// Way along it [m].
    way: f64,
    count: f64,
    /// Means of the way and of e so far, and the sums of their products about these.
    mean: [f64; 2],
    spread: f64,
    common: f64,
}

impl Leg {
    fn add(&mut self, step: f64, narrow: f64) {
        self.way += step;
        self.count += 1.0;
        let off = [self.way - self.mean[0], narrow - self.mean[1]];
        self.mean = [self.mean[0] + off[0] / self.count, self.mean[1] + off[1] / self.count];
        self.spread += off[0] * (self.way - self.mean[0]);
        self.common += off[1] * (self.way - self.mean[0]);
    }

    /// Slope of the line that fits best [1/m]; 0 if there is no way to tell it from.
    fn slope(&self) -> f64 {
        let slope = self.common / self.spread;
        if slope.is_finite() { slope } else { 0.0 }
    }
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Half a right angle to the left (`side` 1) or to the right (-1).
fn turned([x, y]: [f64; 2], side: f64) -> [f64; 2] {
    [FRAC_1_SQRT_2 * (x - side * y), FRAC_1_SQRT_2 * (side * x + y)]
}

#[cfg(test)]
mod tests;
