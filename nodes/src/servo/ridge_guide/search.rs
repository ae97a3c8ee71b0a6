//! The search for a ridge, and the way along it.
//!
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

use tactflow_runtime::node::{State, Tick};
use tactflow_runtime::signal::Pose;

use super::Params;
use super::slope::Slope;
use crate::motion::travel::{Odometer, Stall};

/// What `ridge_guide` remembers.
#[derive(State)]
pub struct Search {
    odometer: Odometer,
    /// Heading of the search, a unit vector.
    heading: [f64; 2],
    /// Slope over the first leg, during the second [1/m].
    first: Option<f64>,
    /// The current leg.
    leg: Slope,
    stall: Stall,
    /// Direction along the ridge, on a ridge.
    pub(super) along: Option<[f64; 2]>,
    /// Rise over one leg, from the last two legs [1].
    pub(super) rise: f64,
}

impl Search {
    /// Returns a search that begins with this heading.
    pub(super) fn new(heading: [f64; 2]) -> Self {
        Self { heading, ..Self::default() }
    }

    /// Returns the direction along the ridge, or `None` if the contact is not a ridge.
    pub(super) fn follow(&mut self, params: &Params, narrow: f64, line: Option<[f64; 2]>) -> Option<[f64; 2]> {
        let last = match self.along {
            Some(along) if narrow < params.off_below => {
                // Where the ridge ends, the search continues in the same direction.
                *self = Self::new(along);
                return None;
            }
            Some(along) => along,
            None if narrow > params.on_above && line.is_some() => self.direction(),
            None => return None,
        };
        let along = line.map_or(last, |line| if dot(line, last) < 0.0 { line.map(|part| -part) } else { line });
        self.along = Some(along);
        self.along
    }

    /// Adds a sample to the leg and returns the direction of the search.
    pub(super) fn seek(&mut self, params: &Params, narrow: f64, pose: &Pose, tick: &Tick) -> [f64; 2] {
        let step = self.odometer.step(pose);
        self.leg.add(dot(step, self.direction()), narrow);
        if self.leg.way >= params.leg_m {
            self.end_leg(params);
        } else if self.stall.is_stuck(self.leg.way, params.speed_m_per_s, tick) {
            let back = self.heading.map(|part| -part);
            *self = Self { odometer: self.odometer, ..Self::new(back) };
        }
        self.direction()
    }

    /// Ends a leg: begins the second one, or computes the next heading.
    fn end_leg(&mut self, params: &Params) {
        let slope = std::mem::take(&mut self.leg).slope();
        self.stall = Stall::default();
        let Some(first) = self.first.take() else {
            self.first = Some(slope);
            return;
        };
        let (one, two) = (turned(self.heading, 1.0), turned(self.heading, -1.0));
        let gradient = [first * one[0] + slope * two[0], first * one[1] + slope * two[1]];
        let steepness = dot(gradient, gradient).sqrt();
        let rise = steepness * params.leg_m;
        if !rise.is_finite() {
            return;
        }
        self.rise = rise;
        if rise >= params.least_rise && steepness > 0.0 {
            self.heading = gradient.map(|part| part / steepness);
        }
    }

    /// Returns the direction of the current leg.
    fn direction(&self) -> [f64; 2] {
        turned(self.heading, if self.first.is_none() { 1.0 } else { -1.0 })
    }
}

fn dot(a: [f64; 2], b: [f64; 2]) -> f64 {
    a[0] * b[0] + a[1] * b[1]
}

/// Turns a vector by 45° to the left (`side` 1) or to the right (-1).
fn turned([x, y]: [f64; 2], side: f64) -> [f64; 2] {
    [FRAC_1_SQRT_2 * (x - side * y), FRAC_1_SQRT_2 * (side * x + y)]
}
