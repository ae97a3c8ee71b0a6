//! `scan_guide`: slides a sensor to and fro over a surface that nobody knows: generated motion (paper section V-E).
//!
//! Where the sensor has gone is added up along its own axes, u along the strokes and v aside:
//!
//! ```text
//! (u, v) += R' (p - p_last)          p, R the sensor's place and axes in the base
//! ```
//!
//! On a curved surface this is the way over the surface. The scan is centred where it begins. With n strokes of length L
//! and steps of width B it goes aside to v = -(n - 1) B / 2, along to u = -L / 2, and then n strokes between u = -L / 2
//! and L / 2, with a step aside by B between two of them.
//!
//! A leg ends sooner at the edge of the object: where the contact has fallen back on the pad against the way, or where
//! the sensor gets no further.

use tactflow_runtime::node::{Count, Mistakes, Node, NonNegative, Positive, Setup, Tick};
use tactflow_runtime::signal::Twist;
use tactflow_runtime::{inputs, outputs, params, state};

use crate::motion::travel::{Odometer, Stall};

words! {
    /// An axis of the sensor.
    Axis {
        /// Its x.
        X = "x",
        /// Its y.
        Y = "y",
    }
}

params! {
    /// How fast; at 0 there is no scan [m/s].
    live speed_m_per_s: NonNegative = NonNegative(0.0),
    /// Axis of the sensor that the strokes go along: "x" or "y".
    live axis: Axis = Axis::X,
    /// Number of strokes [1].
    live strokes: Count = Count(1),
    /// Length of a stroke [m].
    live stroke_m: Positive,
    /// Width of the step between two strokes [m].
    live step_m: Positive,
    /// A leg ends where the contact is further than this behind the pad's middle: there the object ends [m].
    edge_m: Positive = Positive(0.02),
}

inputs! {
    /// What must be set for the motion to go on: the contact.
    gate: Flag,
    /// Pose of the sensor in the base, which the way is measured by [m].
    pose: Sampled<Pose["A", "B"]>,
    /// Centre of the contact along the sensor's x, to find edges by [m].
    x: Option<Scalar["m", "A"]>,
    /// Centre of the contact along the sensor's y, to find edges by [m].
    y: Option<Scalar["m", "A"]>,
}

outputs! {
    /// The motion along a stroke or aside [m/s, rad/s]; absent without a scan, and when it is done.
    twist: Twist["A"],
    /// Whether all strokes are done, or the surface has ended aside.
    done: Flag,
    /// How much of the strokes is done, from 0 to 1 [1].
    progress: Scalar["1", "A"],
}

state! {
    /// The scan that goes on, if one does.
    scan: Option<Scan>,
    /// When the gate shut, if it did [ns].
    shut_at: Option<i64>,
}

/// A scan that goes on.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Scan {
    axis: Axis,
    odometer: Odometer,
    /// Way along the strokes and aside from where it began [m].
    at: [f64; 2],
    /// Number of the leg: 0 aside to the first row, 1 to its beginning, then strokes (even) and steps aside (odd).
    number: usize,
    /// None when it is done.
    leg: Option<Leg>,
    stall: Stall,
    /// Since when the contact has been behind the pad's middle by too much [ns].
    edge_since: Option<i64>,
}

/// A straight piece of the way.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Leg {
    /// 0 along the strokes, 1 aside.
    side: usize,
    from: f64,
    to: f64,
}

/// How long the contact has to be behind for an edge: one image with another contact in it is none [ns].
const EDGE_FOR: i64 = 40_000_000;
/// Number of the leg that is the first stroke.
const FIRST_STROKE: usize = 2;

/// What is scanned.
pub struct ScanGuide {
    speed: f64,
    axis: Axis,
    strokes: usize,
    stroke: f64,
    step: f64,
    edge: f64,
}

impl tactflow_runtime::node::Describe for ScanGuide {
    const NAME: &'static str = "scan_guide";
    const SUMMARY: &'static str = "guides a sensor to and fro over a surface, stroke beside stroke";
    const DOC: &'static str = "The guidance of the paper's section V-E: while the servoing keeps the contact, V_ext slides \
        the sensor along one of its axes, steps aside, and comes back. Wire it to a `twist_adder`.\n\n\
        **The way** is that of the sensor over the surface, not a time: each step of `in.pose` is turned into the \
        sensor's frame and added up, u along the strokes and v aside. So an arm that lags or is held leaves nothing \
        out. The scan is centred where it begins: it goes aside by half of the width, along by half of `stroke_m`, and \
        then `strokes` times to and fro between u = ±`stroke_m`/2, each `step_m` beside the last.\n\n\
        **Edges.** Where the object ends the contact stays behind on the pad. A leg ends when the contact is more \
        than `edge_m` behind the pad's middle, against the way, for 40 ms; this needs `in.x` and `in.y`. It also ends \
        when in 2 s the sensor gets no further than a fifth of what its speed promises, whatever holds it: a \
        controller that keeps the contact in the middle does so at an edge. The scan turns, and goes on with the next \
        leg. A step aside that gains less than half of its width is the end of the surface, and of the scan.\n\n\
        **One scan** begins with the contact, when a mode gives a speed, and when a mode sets another axis: so across \
        and along are two modes that set `axis`, each with `go` or `done = { when = \"scan.done\" }`. It is given up when \
        the gate has been shut for `reset_after_ms`, or with a speed of 0; a flicker only halts it.\n\n\
        The twist is as old as the gate, so it ends with the contact and when the pad falls silent. Guidance along a \
        component that the projector controls leaves an offset of v / kp on the pad.";
    const EXAMPLE: &'static str = r#"
[nodes.scan]                        # five strokes along the pad's x, 1 cm apart, while there is a contact
type = "scan_guide"
in.gate = "label.present"
in.pose = "state.sensor_pose"
in.x = "moments.x"
in.y = "moments.y"
speed_m_per_s = 0.01
axis = "x"
strokes = 5
stroke_m = 0.06
step_m = 0.01
"#;
}

impl Node for ScanGuide {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.outputs.progress.range = [0.0, 1.0];
        Ok(Self {
            speed: *params.speed_m_per_s,
            axis: params.axis,
            strokes: *params.strokes,
            stroke: *params.stroke_m,
            step: *params.step_m,
            edge: *params.edge_m,
        })
    }

    fn state(&self) -> State {
        State { scan: None, shut_at: None }
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let is_over = state.is_over(*inputs.gate, tick);
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

impl State {
    /// Whether the contact has been away for long enough to begin anew.
    fn is_over(&mut self, gate: bool, tick: &Tick) -> bool {
        if gate {
            self.shut_at = None;
        } else if tick.now - *self.shut_at.get_or_insert(tick.now) >= tick.reset_after {
            return true;
        }
        false
    }
}

impl ScanGuide {
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

    /// Along the sensor's x and y in; along the strokes and aside out.
    fn to_scan<T>(&self, [x, y]: [T; 2]) -> [T; 2] {
        match self.axis {
            Axis::X => [x, y],
            Axis::Y => [y, x],
        }
    }

    /// The leg of that number if it begins at `at`; none behind the last stroke.
    fn leg(&self, number: usize, [u, v]: [f64; 2]) -> Option<Leg> {
        let half = 0.5 * self.stroke;
        let is_stroke = number > 0 && (number == 1 || number.is_multiple_of(2));
        if number > 2 * self.strokes {
            return None;
        }
        Some(match number {
            0 => Leg { side: 1, from: v, to: -0.5 * (self.strokes - 1) as f64 * self.step },
            // Strokes go forth and back by turns; the beginning of the first row is behind.
            _ if is_stroke => Leg { side: 0, from: u, to: if number % 4 == 2 { half } else { -half } },
            _ => Leg { side: 1, from: v, to: v + self.step },
        })
    }

    /// Goes on by a step, and on to the next leg where this one ends.
    fn advance(&self, scan: &mut Scan, step: [f64; 2], contact: [Option<f64>; 2], tick: &Tick) {
        let Some(leg) = scan.leg else { return };
        for (at, step) in scan.at.iter_mut().zip(step) {
            *at += step;
        }
        let at = scan.at[leg.side];
        let is_there = (leg.to - at) * leg.sign() <= 0.0;
        let is_edge = scan.is_edge(contact[leg.side].is_some_and(|place| place * leg.sign() < -self.edge), tick);
        if !is_there && !is_edge && !scan.stall.is_stuck((at - leg.from) * leg.sign(), self.speed, tick) {
            return;
        }
        let is_end_aside = scan.number > FIRST_STROKE && leg.side == 1 && (at - leg.from) < 0.5 * self.step;
        scan.number += 1;
        scan.leg = if is_end_aside { None } else { self.leg(scan.number, scan.at) };
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
        // Before a step aside, the strokes up to it are done.
        let done = scan.number.div_ceil(2) - 1;
        let share = if leg.side == 0 { leg.share(scan.at[0]) } else { 0.0 };
        ((done as f64 + share) / self.strokes as f64).clamp(0.0, 1.0)
    }
}

impl Scan {
    /// Whether the contact has been behind for long enough.
    fn is_edge(&mut self, is_behind: bool, tick: &Tick) -> bool {
        if !is_behind {
            self.edge_since = None;
            return false;
        }
        tick.now - *self.edge_since.get_or_insert(tick.now) >= EDGE_FOR
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
