//! `stiffness_estimate`: how much a feature changes per metre of travel along the sensor's z, measured or commanded.

mod line;
mod travel;

use tactflow_runtime::node::{
    At, Describe, In, Inputs, Interval, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick,
};
use tactflow_runtime::signal::{Flag, Jacobian, Joints, Pose, Scalar};
use tactflow_runtime::source::Code;

use line::Line;
use travel::Travel;

/// How much farther than commanded an arm may have moved; farther, it swings [1].
const FARTHER: f64 = 1.2;

/// Estimates how stiff a contact is: the change of a feature per metre of travel along the sensor's z.
///
/// A gain is best for one stiffness: the same motion changes the pressure of a stiff object more than that of a soft
/// one, and so the gain of the whole loop is larger. This node measures it while the sensor moves, for a
/// `gain_schedule`.
///
/// The slope dp/dz is that of a least-squares line through the newest samples, whose weights decay with the time
/// `memory_s`. z is the travel of the sensor along its own z since the contact. `ratio` is the slope divided by
/// `nominal`, the slope for which the gains were chosen: 1 is as stiff, 5 is five times as stiff.
///
/// **Validity.** Without motion there is nothing to learn. An estimate is `valid` if the standard deviation of the
/// travel is at least `min_travel_m`, the correlation of feature and travel is at least `min_correlation`, and the
/// slope is positive. `ratio` stays at the last valid estimate, and is absent until there is one. After the graph's
/// `reset_after_ms` without the feature or the pose, the estimate begins afresh.
///
/// **Which travel.** With `pose` alone, z is the measured travel, and the slope is that of object and foam. A compliant
/// arm gives way too. For the gain of a loop its spring counts as well: wire `jacobian` and `equilibrium`, and z is the
/// travel that was commanded, n · J dq with the changes dq of the equilibrium and the normal n of the pad.
///
/// An arm that swings is not where it was commanded to be, and a press looks too stiff during the first half of a swing.
/// Wire `deflection` of `arm_spring` too. While it is known, z is the travel that the arm would have at rest: the measured
/// travel, and the deflection of the arm's spring.
///
/// **Lag.** Filters delay the feature against the travel, and make the object look softer. `lag_ms` delays the travel as
/// a low-pass filter does: add up the delays of the filters and the latency. For a commanded travel, `arm_lag_ms` comes
/// on top, the delay of the arm, which is 2 ζ / ω for a resonance. With too much lag, the object looks too stiff at first,
/// which is safe.
///
/// **An object that moves.** The object must rest while the sensor moves. One that moves by itself changes the feature
/// without any travel, and an arm that swings after a bounce moves farther than commanded. So unless `pose` alone is
/// wired, an estimate is valid only if the arm has moved in the same direction, and at most a fifth farther. Where a
/// stiff arm hides the motion of an object, the last estimate stays until the sensor has moved again.
///
/// A small `multisine` along z excites a contact that rests. Friction hides small motions: choose `min_travel_m` well
/// above the travel in which foam and joints stick.
///
/// ```toml
/// [nodes.stiffness_estimate]
/// type = "stiffness_estimate"
/// in.value = "moving_average.value"
/// in.pose = "state.sensor_pose"
/// in.jacobian = "state.jacobian"
/// in.equilibrium = "arm.equilibrium"
/// in.deflection = "arm_spring.deflection"
/// nominal = 10.0                      # 0.01 N per tactel for each mm [N per tactel per m]
/// lag_ms = 20
/// arm_lag_ms = 50
/// ```
#[derive(Describe)]
pub struct StiffnessEstimate {
    params: Params,
    /// Number of joints of the commanded travel; 0 for the measured one.
    joints: usize,
}

/// Parameters of `stiffness_estimate`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Slope at which `ratio` is 1.
    #[param(unit = "U/m", above = 0.0)]
    nominal: f64,
    /// Time in which the weight of a sample decays to 37 %.
    #[param(unit = "s", above = 0.0, default = 2.0)]
    memory_s: f64,
    /// Smallest standard deviation of the travel.
    #[param(unit = "m", above = 0.0, default = 0.0002)]
    min_travel_m: f64,
    /// Smallest correlation of the feature and the travel.
    #[param(unit = "1", range = 0.0..=1.0, default = 0.9)]
    min_correlation: f64,
    /// Delay of the feature against the travel, without that of the arm.
    #[param(unit = "ms", range = 0.0.., default = 0.0)]
    lag_ms: f64,
    /// Delay of the arm against the commanded travel. It does not count while `deflection` is known.
    #[param(unit = "ms", range = 0.0.., default = 0.0)]
    arm_lag_ms: f64,
}

/// What `stiffness_estimate` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// A feature that grows with the travel, such as the pressure or the force.
    #[port(unit = "U", frame = "A")]
    value: In<'a, Scalar>,
    /// Pose of the sensor in the base.
    #[port(frame = "A", reference = "B", quantity = "sensor_pose", sampled)]
    pose: In<'a, Pose>,
    /// Spatial Jacobian of the sensor in the base, for the commanded travel.
    #[port(frame = "B", robot = "R", optional, sampled)]
    jacobian: Option<In<'a, Jacobian>>,
    /// Posture that the commands have moved the arm to, for the commanded travel.
    #[port(unit = "rad", robot = "R", quantity = "equilibrium", optional, sampled)]
    equilibrium: Option<In<'a, Joints>>,
    /// How far the force bends the spring of the arm, of `arm_spring`.
    #[port(unit = "m", frame = "A", quantity = "deflection", optional, sampled)]
    deflection: Option<In<'a, Scalar>>,
}

/// What `stiffness_estimate` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The last valid slope over `nominal`; absent until there is one.
    #[port(unit = "1", frame = "A", quantity = "stiffness")]
    ratio: Out<Scalar>,
    /// Whether the samples determine the slope.
    valid: Out<Flag>,
}

/// What `stiffness_estimate` remembers.
#[derive(State)]
pub struct State {
    line: Line,
    travel: Travel,
    /// The feature over the measured travel, where the commanded one counts.
    measured_line: Line,
    measured_travel: Travel,
    /// Whether the last travel was that of an arm at rest.
    is_at_rest: bool,
    /// Since the last sample.
    interval: Interval,
    /// The last valid ratio.
    ratio: Option<f64>,
}

impl State {
    /// Begins afresh.
    fn begin(&mut self, line: Line) {
        (self.line, self.measured_line) = (line, line);
        self.travel.drop_lag();
        self.measured_travel.drop_lag();
    }
}

impl Node for StiffnessEstimate {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let wired =
            [("jacobian", setup.inputs.jacobian.is_some()), ("equilibrium", setup.inputs.equilibrium.is_some())];
        if let [(missing, false), (other, true)] | [(other, true), (missing, false)] = wired {
            let message = format!("the commanded travel needs `{missing}` beside `{other}`");
            let help = format!("wire `in.{missing}` too, or remove `in.{other}` for the measured travel");
            return Err(Mistake::new(Code::MissingInput, At::Node, message).help(help).into());
        }
        if setup.inputs.deflection.is_some() && setup.inputs.equilibrium.is_none() {
            let message = "`deflection` needs `jacobian` and `equilibrium`, for the times at which it is not known";
            let help = "wire `in.jacobian` and `in.equilibrium` too, or remove `in.deflection` for the measured travel";
            return Err(Mistake::new(Code::MissingInput, At::Node, message).help(help).into());
        }
        let joints = setup.inputs.equilibrium.as_ref().map_or(0, |shape| shape.joints.len());
        Ok(Self { params, joints })
    }

    fn state(&self) -> State {
        State {
            line: Line::default(),
            travel: Travel::new(self.joints),
            measured_line: Line::default(),
            measured_travel: Travel::new(0),
            is_at_rest: false,
            interval: Interval::default(),
            ratio: None,
        }
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let value = *inputs.value;
        let measured = state.measured_travel.measured(&inputs.pose);
        let commanded = match inputs.jacobian.zip(inputs.equilibrium) {
            Some((jacobian, equilibrium)) => state.travel.commanded(&inputs.pose, &jacobian, &equilibrium),
            // Wired, and absent at this moment: what was commanded is not known.
            None if self.joints > 0 => {
                state.travel.forget();
                None
            }
            None => measured,
        };
        let spring = inputs.deflection.map(|deflection| *deflection);
        let at_rest = state.travel.at_rest(measured, spring);
        if std::mem::replace(&mut state.is_at_rest, spring.is_some()) != spring.is_some() {
            // Another travel, with another lag.
            state.begin(Line::default());
        }
        let moved = if spring.is_some() { at_rest } else { commanded };
        match moved.zip(measured).zip(state.interval.step(&inputs.value, tick)) {
            Some(((moved, measured), dt)) => {
                let decay = libm::exp(-dt / self.params.memory_s);
                let arm = if spring.is_some() || self.joints == 0 { 0.0 } else { self.params.arm_lag_ms };
                let lag = (self.params.lag_ms + arm) * 1e-3;
                state.line.add(state.travel.lagging(moved, dt, lag), value, decay);
                state.measured_line.add(state.measured_travel.lagging(measured, dt, lag), value, decay);
            }
            None => state.begin(Line::default().with(value)),
        }
        if !(state.line.is_finite() && state.measured_line.is_finite()) {
            state.begin(Line::default());
        }
        let slope = state.line.slope(self.params.min_travel_m, self.params.min_correlation);
        // An arm that gives way moves less far than commanded, so the feature grows more with the measured travel.
        let follows =
            |slope: &f64| state.measured_line.slope(0.0, 0.0).is_some_and(|measured| *slope < FARTHER * measured);
        let slope = slope.filter(|slope| self.joints == 0 || follows(slope));
        let ratio = slope.map(|slope| slope / self.params.nominal).filter(|ratio| ratio.is_finite());
        state.ratio = ratio.or(state.ratio);
        out.valid.set(ratio.is_some());
        if let Some(ratio) = state.ratio {
            out.ratio.set(ratio);
        }
    }
}

#[cfg(test)]
mod tests;
