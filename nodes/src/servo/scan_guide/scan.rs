//! A scan in progress: where it is, and the legs that it consists of.
//!
//! The distance that the sensor has moved is summed in its own plane, u along the strokes and v across them:
//!
//! ```text
//! (u, v) += (a, b)' R' (p - p_last)  p, R the position and the axes of the sensor in the base
//! ```
//!
//! b is the direction of the normal of the rows' planes in the plane of the sensor, and a is at right angles to it: along
//! a, the sensor stays in its plane. On a curved surface this is the distance along the surface. The scan is centred on its start. With n strokes of
//! length L and steps of width B, the sensor moves across to v = -(n - 1) B / 2, along to u = -L / 2, and then makes n
//! strokes between u = -L / 2 and L / 2 with a step across by B between two strokes.
//!
//! A leg ends early at the edge of the object: where the contact has fallen back on the pad, against the motion, or
//! where the sensor makes no progress. With a largest tilt it also ends where the surface is too steep.

use tactflow_runtime::node::Tick;

use super::{Params, StrokeAxis};
use crate::motion::travel::{Inclination, Odometer, Planes, Stall};

/// A scan in progress.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Scan {
    pub(super) axis: StrokeAxis,
    pub(super) odometer: Odometer,
    pub(super) inclination: Inclination,
    pub(super) planes: Planes,
    /// Position along the strokes and across, from the start [m].
    at: [f64; 2],
    /// Number of the leg: 0 across to the first row, 1 to its beginning, then strokes (even) and steps across (odd).
    number: usize,
    /// `None` when the scan is done.
    pub(super) leg: Option<Leg>,
    stall: Stall,
    /// Since when the contact has been too far behind the middle of the pad [ns].
    edge_since: Option<i64>,
    /// The inclination at the start of the leg [rad].
    start_tilt: Option<f64>,
    /// Whether the surface was flat enough somewhere on this leg.
    was_flat: bool,
    /// Whether a stroke has been on a surface that is flat enough.
    has_scanned: bool,
}

/// What a sensor has done since the last sample, along the strokes and across.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moved {
    /// Its step [m].
    pub(super) step: [f64; 2],
    /// Its inclination to where the scan began [rad].
    pub(super) tilt: f64,
    /// Where the contact is on the pad [m], if that is known.
    pub(super) contact: Option<[f64; 2]>,
}

/// A straight part of the scan, with its ends [m].
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Leg {
    /// 0 along the strokes, 1 across.
    side: usize,
    from: f64,
    to: f64,
}

/// Time for which the contact must be behind at an edge, so that one image with another contact is not an edge [ns].
const EDGE_NS: i64 = 40_000_000;
/// Smallest fraction of the speed [1].
const MIN_PACE: f64 = 0.25;
/// Number of the leg that is the first stroke.
const FIRST_STROKE: usize = 2;

impl Scan {
    /// Returns a scan at its start.
    pub(super) fn new(params: &Params) -> Self {
        let number = usize::from(params.strokes == 1);
        Self {
            axis: params.axis,
            odometer: Odometer::default(),
            inclination: Inclination::default(),
            planes: Planes::default(),
            at: [0.0; 2],
            number,
            leg: Leg::new(params, number, [0.0; 2]),
            stall: Stall::default(),
            edge_since: None,
            start_tilt: None,
            was_flat: false,
            has_scanned: false,
        }
    }

    /// Adds a step, and begins the next leg where this one ends.
    pub(super) fn advance(&mut self, params: &Params, moved: Moved, tick: &Tick) {
        let Some(leg) = self.leg else { return };
        let Moved { step, tilt, contact } = moved;
        for (at, step) in self.at.iter_mut().zip(step) {
            *at += step;
        }
        let at = self.at[leg.side];
        let is_at_end = (leg.to - at) * leg.sign() <= 0.0;
        let is_edge = self.is_edge(contact.is_some_and(|at| at[leg.side] * leg.sign() < -params.edge_m), tick);
        let way = (at - leg.from) * leg.sign();
        let is_steep = self.is_steep(params, leg, way, tilt);
        let is_stuck = self.stall.is_stuck(way, params.speed_m_per_s * self.pace(params, contact), tick);
        if !is_at_end && !is_edge && !is_steep && !is_stuck {
            return;
        }
        self.leg = if self.is_surface_end(params, leg) { None } else { Leg::new(params, self.number + 1, self.at) };
        self.number += 1;
        (self.stall, self.edge_since, self.start_tilt, self.was_flat) = Default::default();
    }

    /// Records that the contact is lost. What the sensor does not move meanwhile is no stall.
    pub(super) fn contact_is_lost(&mut self) {
        (self.stall, self.edge_since) = Default::default();
    }

    /// Returns the fraction of the speed at which the contact keeps up.
    pub(super) fn pace(&self, params: &Params, contact: Option<[f64; 2]>) -> f64 {
        let (Some(leg), Some(at)) = (self.leg, contact) else { return 1.0 };
        (1.0 + at[leg.side] * leg.sign() / params.edge_m).clamp(MIN_PACE, 1.0)
    }

    /// Returns whether a leg ends because the surface is too steep. A leg that begins on a steep surface ends only where
    /// it has become steeper, and not within two steps: the sensor still rolls on after the turn. A step across is short,
    /// and leads to a row that may be flatter.
    fn is_steep(&mut self, params: &Params, leg: Leg, way: f64, tilt: f64) -> bool {
        let Some(max) = params.max_tilt_rad.filter(|_| leg.side == 0 || self.number == 0) else { return false };
        let start = *self.start_tilt.get_or_insert(tilt);
        self.was_flat |= tilt <= max;
        tilt > max && (self.was_flat || tilt > start && way > 2.0 * params.step_m)
    }

    /// Returns whether the surface ends with a leg: a step across that got nowhere, or a stroke that was too steep
    /// everywhere, after one that was not.
    fn is_surface_end(&mut self, params: &Params, leg: Leg) -> bool {
        if leg.side == 1 {
            return self.number > FIRST_STROKE && self.at[1] - leg.from < 0.5 * params.step_m;
        }
        let (is_flat, had_scanned) = (params.max_tilt_rad.is_none() || self.was_flat, self.has_scanned);
        self.has_scanned |= is_flat && self.number >= FIRST_STROKE;
        had_scanned && !is_flat
    }

    /// Returns whether the contact has been behind for long enough.
    fn is_edge(&mut self, is_behind: bool, tick: &Tick) -> bool {
        if !is_behind {
            self.edge_since = None;
            return false;
        }
        tick.now - *self.edge_since.get_or_insert(tick.now) >= EDGE_NS
    }

    /// Returns the fraction of the strokes that is done.
    pub(super) fn progress(&self, strokes: usize) -> f64 {
        let Some(leg) = self.leg else { return 1.0 };
        if self.number < FIRST_STROKE {
            return 0.0;
        }
        // In a step across, the strokes before it are done.
        let done = self.number.div_ceil(2) - 1;
        let share = if leg.side == 0 { leg.share(self.at[0]) } else { 0.0 };
        ((done as f64 + share) / strokes as f64).clamp(0.0, 1.0)
    }
}

impl Leg {
    /// Returns the leg of that number, which begins at (u, v), or `None` after the last stroke.
    fn new(params: &Params, number: usize, [u, v]: [f64; 2]) -> Option<Self> {
        let half = 0.5 * params.stroke_m;
        let is_stroke = number == 1 || number.is_multiple_of(2);
        (number <= 2 * params.strokes).then(|| match number {
            0 => Self { side: 1, from: v, to: -0.5 * (params.strokes - 1) as f64 * params.step_m },
            // Strokes alternate in direction; the first row begins at -u.
            _ if is_stroke => Self { side: 0, from: u, to: if number % 4 == 2 { half } else { -half } },
            _ => Self { side: 1, from: v, to: v + params.step_m },
        })
    }

    fn sign(self) -> f64 {
        if self.to >= self.from { 1.0 } else { -1.0 }
    }

    /// Returns the velocity along the strokes and across at a speed.
    pub(super) fn velocity(self, speed: f64) -> [f64; 2] {
        let speed = self.sign() * speed;
        if self.side == 0 { [speed, 0.0] } else { [0.0, speed] }
    }

    fn share(self, at: f64) -> f64 {
        let length = self.to - self.from;
        if length == 0.0 { 1.0 } else { ((at - self.from) / length).clamp(0.0, 1.0) }
    }
}
