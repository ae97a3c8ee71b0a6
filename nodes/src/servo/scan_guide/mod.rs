//! The distance that the sensor has moved is summed along its own axes, u along the strokes and v across them:
//!
//! ```text
//! (u, v) += R' (p - p_last)          p, R the position and the axes of the sensor in the base
//! ```
//!
//! On a curved surface this is the distance along the surface. The scan is centred on its start. With n strokes of length
//! L and steps of width B, the sensor moves across to v = -(n - 1) B / 2, along to u = -L / 2, and then makes n strokes
//! between u = -L / 2 and L / 2 with a step across by B between two strokes.
//!
//! A leg ends early at the edge of the object: where the contact has fallen back on the pad, against the motion, or where
//! the sensor makes no progress.

use tactflow_runtime::node::{Absence, Describe, In, Inputs, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::{Flag, Pose, Scalar, Twist};

use crate::motion::travel::{Odometer, Stall};

/// Guides a sensor to and fro over a surface, stroke beside stroke.
///
/// The guidance of section V-E of the paper: while the servoing keeps the contact, V_ext slides the sensor along one of
/// its axes, steps across, and comes back. Wire it to a `twist_adder`.
///
/// **The way** is the distance that the sensor moves over the surface, not a time: each step of `in.pose` is turned into
/// the frame of the sensor and summed, u along the strokes and v across them. An arm that lags or is held therefore skips
/// nothing. The scan is centred on its start: the sensor moves across by half of the width, along by half of `stroke_m`,
/// and then makes `strokes` strokes between u = ±`stroke_m`/2, each `step_m` beside the last.
///
/// **Edges.** Where the object ends, the contact stays behind on the pad. A leg ends when the contact is more than
/// `edge_m` behind the middle of the pad, against the motion, for 40 ms; this needs `in.x` and `in.y`. A leg also ends
/// when the sensor moves less than a fifth of the distance at its speed within 2 s: a controller that keeps the contact
/// in the middle stops it at an edge. The scan then continues with the next leg. A step across that moves less than half
/// of its width is the end of the surface, and of the scan.
///
/// **One scan** begins with the contact, when a mode sets a speed, and when a mode sets another axis. To scan across and
/// along, use two modes that set `axis`, each with `go` or `done = { when = "scan.done" }`. A scan is abandoned when the
/// gate is not set for `reset_after_ms`, or at a speed of 0. Flicker of the gate only pauses it.
///
/// The twist is as old as the gate, so it ends with the contact and when the pad stops sending images. Guidance along a
/// component that the projector controls leaves an offset of v / kp on the pad.
///
/// ```toml
/// [nodes.scan]                        # five strokes along the pad's x, 1 cm apart, while there is a contact
/// type = "scan_guide"
/// in.gate = "label.present"
/// in.pose = "state.sensor_pose"
/// in.x = "moments.x"
/// in.y = "moments.y"
/// speed_m_per_s = 0.01
/// axis = "x"
/// strokes = 5
/// stroke_m = 0.06
/// step_m = 0.01
/// ```
#[derive(Describe)]
#[describe(name = "scan_guide")]
pub struct ScanGuide {
    speed: f64,
    axis: Axis,
    strokes: usize,
    stroke: f64,
    step: f64,
    edge: f64,
}

/// Parameters of `scan_guide`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Speed of the sensor. At 0 there is no scan.
    #[param(unit = "m/s", range = 0.0.., default = 0.0, live)]
    speed_m_per_s: f64,
    /// Axis of the sensor along which the strokes go.
    #[param(default = Axis::X, live)]
    axis: Axis,
    /// Number of strokes.
    #[param(unit = "1", range = 1..=1_000_000, default = 1, live)]
    strokes: usize,
    /// Length of a stroke.
    #[param(unit = "m", above = 0.0, live)]
    stroke_m: f64,
    /// Width of the step between two strokes.
    #[param(unit = "m", above = 0.0, live)]
    step_m: f64,
    /// A leg ends where the contact is further than this behind the middle of the pad: the edge of the object.
    #[param(unit = "m", above = 0.0, default = 0.02)]
    edge_m: f64,
}

/// An axis of the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
enum Axis {
    /// Its x.
    X,
    /// Its y.
    Y,
}

/// What `scan_guide` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The scan continues while this is set: the contact.
    gate: In<'a, Flag>,
    /// Pose of the sensor in the base, to measure distances.
    #[port(frame = "A", reference = "B", sampled)]
    pose: In<'a, Pose>,
    /// Centre of the contact along the sensor's x, to find edges.
    #[port(unit = "m", frame = "A", optional, sampled)]
    x: Option<In<'a, Scalar>>,
    /// Centre of the contact along the sensor's y, to find edges.
    #[port(unit = "m", frame = "A", optional, sampled)]
    y: Option<In<'a, Scalar>>,
}

/// What `scan_guide` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The motion along a stroke or across; absent without a scan, and when the scan is done.
    #[port(frame = "A")]
    twist: Out<Twist>,
    /// Whether all strokes are done, or a step across has reached the end of the surface.
    done: Out<Flag>,
    /// Fraction of the strokes that is done, from 0 to 1.
    #[port(unit = "1", frame = "A")]
    progress: Out<Scalar>,
}

/// What `scan_guide` remembers.
#[derive(State)]
pub struct State {
    /// The scan in progress.
    scan: Option<Scan>,
    /// Of the contact.
    absence: Absence,
}

/// A scan in progress.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Scan {
    axis: Axis,
    odometer: Odometer,
    /// Position along the strokes and across, from the start [m].
    at: [f64; 2],
    /// Number of the leg: 0 across to the first row, 1 to its beginning, then strokes (even) and steps across (odd).
    number: usize,
    /// `None` when the scan is done.
    leg: Option<Leg>,
    stall: Stall,
    /// Since when the contact has been too far behind the middle of the pad [ns].
    edge_since: Option<i64>,
}

/// A straight part of the scan, with its ends [m].
#[derive(Debug, Clone, Copy, PartialEq)]
struct Leg {
    /// 0 along the strokes, 1 across.
    side: usize,
    from: f64,
    to: f64,
}

/// Time for which the contact must be behind at an edge, so that one image with another contact is not an edge [ns].
const EDGE_NS: i64 = 40_000_000;
/// Number of the leg that is the first stroke.
const FIRST_STROKE: usize = 2;

impl Node for ScanGuide {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.outputs.progress.range = [0.0, 1.0];
        Ok(Self {
            speed: params.speed_m_per_s,
            axis: params.axis,
            strokes: params.strokes,
            stroke: params.stroke_m,
            step: params.step_m,
            edge: params.edge_m,
        })
    }

    fn state(&self) -> State {
        State { scan: None, absence: Absence::default() }
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let is_over = state.absence.is_long(*inputs.gate, tick);
        if is_over || self.speed <= 0.0 || state.scan.is_some_and(|scan| scan.axis != self.axis) {
            state.scan = None;
        }
        if *inputs.gate && self.speed > 0.0 {
            let contact = [inputs.x.map(|x| *x), inputs.y.map(|y| *y)];
            let scan = state.scan.get_or_insert_with(|| self.begin());
            let step = scan.odometer.step(&inputs.pose);
            self.advance(scan, self.to_scan(step), self.to_scan(contact), tick);
            if let Some(leg) = scan.leg {
                out.twist.set(self.twist(leg));
            }
        }
        out.done.set(state.scan.is_some_and(|scan| scan.leg.is_none()));
        out.progress.set(state.scan.map_or(0.0, |scan| self.progress(&scan)));
    }
}

impl ScanGuide {
    /// Returns a scan at its start.
    fn begin(&self) -> Scan {
        let number = usize::from(self.strokes == 1);
        Scan {
            axis: self.axis,
            odometer: Odometer::default(),
            at: [0.0; 2],
            number,
            leg: self.leg(number, [0.0; 2]),
            stall: Stall::default(),
            edge_since: None,
        }
    }

    /// Exchanges x and y of the sensor with along and across the strokes, either way.
    fn to_scan<T>(&self, [x, y]: [T; 2]) -> [T; 2] {
        match self.axis {
            Axis::X => [x, y],
            Axis::Y => [y, x],
        }
    }

    /// Returns the leg of that number, which begins at (u, v), or `None` after the last stroke.
    fn leg(&self, number: usize, [u, v]: [f64; 2]) -> Option<Leg> {
        let half = 0.5 * self.stroke;
        let is_stroke = number > 0 && (number == 1 || number.is_multiple_of(2));
        if number > 2 * self.strokes {
            return None;
        }
        Some(match number {
            0 => Leg { side: 1, from: v, to: -0.5 * (self.strokes - 1) as f64 * self.step },
            // Strokes alternate in direction; the first row begins at -u.
            _ if is_stroke => Leg { side: 0, from: u, to: if number % 4 == 2 { half } else { -half } },
            _ => Leg { side: 1, from: v, to: v + self.step },
        })
    }

    /// Adds a step, and begins the next leg where this one ends.
    fn advance(&self, scan: &mut Scan, step: [f64; 2], contact: [Option<f64>; 2], tick: &Tick) {
        let Some(leg) = scan.leg else { return };
        for (at, step) in scan.at.iter_mut().zip(step) {
            *at += step;
        }
        let at = scan.at[leg.side];
        let is_at_end = (leg.to - at) * leg.sign() <= 0.0;
        let is_edge = scan.is_edge(contact[leg.side].is_some_and(|place| place * leg.sign() < -self.edge), tick);
        if !is_at_end && !is_edge && !scan.stall.is_stuck((at - leg.from) * leg.sign(), self.speed, tick) {
            return;
        }
        let is_surface_end = scan.number > FIRST_STROKE && leg.side == 1 && (at - leg.from) < 0.5 * self.step;
        scan.number += 1;
        scan.leg = if is_surface_end { None } else { self.leg(scan.number, scan.at) };
        (scan.stall, scan.edge_since) = (Stall::default(), None);
    }

    fn twist(&self, leg: Leg) -> Twist {
        let speed = leg.sign() * self.speed;
        let [x, y] = self.to_scan(if leg.side == 0 { [speed, 0.0] } else { [0.0, speed] });
        Twist([x, y, 0.0, 0.0, 0.0, 0.0].into())
    }

    fn progress(&self, scan: &Scan) -> f64 {
        let Some(leg) = scan.leg else { return 1.0 };
        if scan.number < FIRST_STROKE {
            return 0.0;
        }
        // In a step across, the strokes before it are done.
        let done = scan.number.div_ceil(2) - 1;
        let share = if leg.side == 0 { leg.share(scan.at[0]) } else { 0.0 };
        ((done as f64 + share) / self.strokes as f64).clamp(0.0, 1.0)
    }
}

impl Scan {
    /// Returns whether the contact has been behind for long enough.
    fn is_edge(&mut self, is_behind: bool, tick: &Tick) -> bool {
        if !is_behind {
            self.edge_since = None;
            return false;
        }
        tick.now - *self.edge_since.get_or_insert(tick.now) >= EDGE_NS
    }
}

impl Leg {
    fn sign(self) -> f64 {
        if self.to >= self.from { 1.0 } else { -1.0 }
    }

    fn share(self, at: f64) -> f64 {
        let length = self.to - self.from;
        if length == 0.0 { 1.0 } else { ((at - self.from) / length).clamp(0.0, 1.0) }
    }
}

#[cfg(test)]
mod tests;
