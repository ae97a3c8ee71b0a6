//! `scan_guide`: strokes to and fro over a surface.

mod scan;

use tactflow_runtime::node::{Absence, Describe, In, Inputs, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::{Flag, Pose, Scalar, Twist};

use crate::usual::{USUAL_LENGTH_M, USUAL_M_PER_S};
use scan::{Moved, Scan};

/// Moves a sensor back and forth over a surface, in parallel strokes.
///
/// The guidance of section V-E of the paper: while the servoing keeps the contact, V_ext slides the sensor along one of
/// its axes, steps across, and comes back. Wire it to a `twist_adder`.
///
/// **Rows.** The strokes are parallel: each lies in a plane of the base, and the planes stand across the sensor's axis at
/// the start. So rows stay apart on a curved surface, also if the sensor turns about its normal meanwhile.
///
/// **Distance.** The scan follows the distance that the sensor moves over the surface, not a time: each step of
/// `in.pose` is summed in the plane of the sensor, u along the strokes and v across them. An arm that lags or is held
/// therefore skips nothing. The scan is centred on its start: the sensor moves across by half of the width,
/// along by half of `stroke_m`, and then makes `strokes` strokes between u = ±`stroke_m`/2, each `step_m` beside the
/// last.
///
/// **Edges.** Where the object ends, the contact stays behind on the pad. A leg ends when the contact is more than
/// `edge_m` behind the middle of the pad, against the motion, for 40 ms; this needs `in.x` and `in.y`. A leg also ends
/// when the sensor moves less than a fifth of the distance at its speed within 2 s: a controller that keeps the contact
/// in the middle stops it at an edge. The scan then continues with the next leg. A step across that moves less than
/// half of its width is the end of the surface, and of the scan.
///
/// **Pace.** The guide waits for the contact. While the contact is behind the middle of the pad, the sensor moves more
/// slowly: with half the speed if it is behind by half of `edge_m`, and with a quarter of the speed at least. So the
/// controllers that roll and slide the sensor keep up where the surface curves much. This needs `in.x` and `in.y`.
///
/// **A cap.** With `max_tilt_rad`, a leg along the strokes also ends where the sensor is inclined by more than this to
/// where the scan began. So strokes are as long as the surface is flat enough: `stroke_m` and `strokes` are then upper
/// bounds. The first leg across ends there too, and the scan ends after a stroke that nowhere was flat enough.
///
/// **One scan** begins with the contact, when a mode sets a speed, and when a mode sets another axis. To scan across
/// and along, use two modes that set `axis`, each with `go` or `done = { when = "scan.done" }`. A scan is abandoned
/// when the gate is not set for `abandon_after_ms`, or at a speed of 0. Flicker of the gate only pauses it.
///
/// **A lost contact.** A mode that finds the contact again, at any speed but 0, continues the scan within
/// `abandon_after_ms`. The leg goes on where the contact is found. After a loss of `reset_after_ms`, the time in which it
/// must make progress begins anew.
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
pub struct ScanGuide {
    params: Params,
}

/// Parameters of `scan_guide`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Speed of the sensor. At 0 there is no scan.
    #[param(unit = "m/s", range = 0.0.., usual = ..=USUAL_M_PER_S, default = 0.0, live)]
    speed_m_per_s: f64,
    /// Axis of the sensor along which the strokes go.
    #[param(default = StrokeAxis::X, live)]
    axis: StrokeAxis,
    /// Number of strokes.
    #[param(unit = "1", range = 1..=1_000_000, default = 1, live)]
    strokes: usize,
    /// Length of a stroke.
    #[param(unit = "m", above = 0.0, usual = ..=USUAL_LENGTH_M, live)]
    stroke_m: f64,
    /// Width of the step between two strokes.
    #[param(unit = "m", above = 0.0, usual = ..=USUAL_LENGTH_M, live)]
    step_m: f64,
    /// A leg ends where the contact is further than this behind the middle of the pad: the edge of the object.
    #[param(unit = "m", above = 0.0, usual = ..=USUAL_LENGTH_M, default = 0.02)]
    edge_m: f64,
    /// A stroke ends where the sensor is inclined by more than this to where the scan began. Without it, none does.
    #[param(unit = "rad", range = 0.01..=1.5)]
    max_tilt_rad: Option<f64>,
    /// Time without the gate after which a scan is abandoned; the `reset_after_ms` of the graph if not given.
    #[param(unit = "ms", above = 0.0)]
    abandon_after_ms: Option<f64>,
}

/// An axis of the sensor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Param)]
enum StrokeAxis {
    /// Its x.
    X,
    /// Its y.
    Y,
}

impl StrokeAxis {
    /// Returns the direction across the strokes in the sensor's x and y, where the scan begins.
    const fn across(self) -> [f64; 2] {
        match self {
            Self::X => [0.0, 1.0],
            Self::Y => [1.0, 0.0],
        }
    }

    /// Returns the direction along the strokes for one across them.
    const fn along(self, [x, y]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::X => [y, -x],
            Self::Y => [-y, x],
        }
    }
}

/// What `scan_guide` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The scan continues while this is set: the contact.
    gate: In<'a, Flag>,
    /// Pose of the sensor in the base, to measure distances.
    #[port(frame = "A", reference = "B", quantity = "sensor_pose", sampled)]
    pose: In<'a, Pose>,
    /// Centre of the contact along the sensor's x, to find edges. Without a wire it counts as 0.
    #[port(unit = "m", frame = "A", quantity = "x", optional, sampled)]
    x: Option<In<'a, Scalar>>,
    /// Centre of the contact along the sensor's y, to find edges. Without a wire it counts as 0.
    #[port(unit = "m", frame = "A", quantity = "y", optional, sampled)]
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

impl Node for ScanGuide {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        setup.outputs.progress.range = [0.0, 1.0];
        Ok(Self { params })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let Params { speed_m_per_s: speed, axis, .. } = self.params;
        let patience = self.params.abandon_after_ms.map_or(tick.reset_after, |time| (time * 1e6) as i64);
        let is_over = state.absence.is_longer(patience, *inputs.gate, tick);
        if state.absence.is_long(*inputs.gate, tick)
            && let Some(scan) = &mut state.scan
        {
            scan.contact_is_lost();
        }
        if is_over || speed <= 0.0 || state.scan.is_some_and(|scan| scan.axis != axis) {
            state.scan = None;
        }
        if *inputs.gate && speed > 0.0 {
            let scan = state.scan.get_or_insert_with(|| Scan::new(&self.params));
            let across = scan.planes.across(&inputs.pose, axis.across());
            let along = axis.along(across);
            let turned = |at: [f64; 2]| [along, across].map(|side| side[0] * at[0] + side[1] * at[1]);
            let moved = Moved {
                step: turned(scan.odometer.step(&inputs.pose)),
                tilt: scan.inclination.of(&inputs.pose),
                contact: (inputs.x.is_some() || inputs.y.is_some())
                    .then(|| turned([&inputs.x, &inputs.y].map(|at| at.as_ref().map_or(0.0, |at| **at)))),
            };
            scan.advance(&self.params, moved, tick);
            if let Some(leg) = scan.leg {
                let [u, v] = leg.velocity(speed * scan.pace(&self.params, moved.contact));
                let [x, y] = [0, 1].map(|i| along[i] * u + across[i] * v);
                out.twist.set(Twist([x, y, 0.0, 0.0, 0.0, 0.0].into()));
            }
        }
        out.done.set(state.scan.is_some_and(|scan| scan.leg.is_none()));
        out.progress.set(state.scan.map_or(0.0, |scan| scan.progress(self.params.strokes)));
    }
}

#[cfg(test)]
mod tests;
