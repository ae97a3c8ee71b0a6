//! `pid`: a PID controller on every feature, each on its own (paper eq. 3, the matrices K_P, K_I, K_D).
//!
//! A held component stays as it is. An absent one contributes nothing and resets only itself, and only when it has been
//! away for long: a frame of flicker does not wipe an integral.

mod braked;
mod law;

use tactflow_runtime::node::{
    At, Components, Describe, In, Inputs, Map, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick,
};
use tactflow_runtime::signal::{Feature, Features, Freshness, Unit};
use tactflow_runtime::source::Code;

use crate::usual::FIRST_GAIN;

use law::{Law, Memory};

/// A PID controller on every feature, for force and position control.
///
/// u = kp e + I + kd de/dt, where I is the sum of ki e dt: eq. 3 of the paper, for each feature by itself. Time is the
/// time between the stamps of the samples, so a gain means the same at 100 Hz and at 1 kHz. The paper sums without
/// time: its K_I is ki times the period, and its K_D is kd over the period.
///
/// kp in 1/s is how fast an error is reduced: 2.0 takes half a second. Under velocity control soft foam integrates
/// already, so ki is for creep and for objects that move. The integral grows only while the error is `within`, never
/// exceeds `bound`, and does not grow outward while the control is at its `limit`.
///
/// `rise` bounds how fast the control grows; it falls at once. A compliant arm that sets off with a jump swings, also along
/// directions in which nothing is commanded. So the control begins at what `rise` gives it in 20 ms, and grows from there.
/// An error e is reduced later than without it, by at most about kp e / (2 `rise`). Errors of less than `rise` · 20 ms / kp
/// are answered at once, and so is noise of that size. A `gain_schedule` behind this node multiplies the `rise` too.
///
/// `brake_above` is for dry friction along the pad. It holds a contact until the arm is bent far enough. Then the contact
/// slides faster than kp e, and a soft arm can carry it beyond the setpoint. The speed of the contact is the rate of the
/// error, behind a low-pass filter of 30 ms. Where it exceeds kp e by more than `brake_above`, a fifth of what is beyond
/// that is subtracted from the control. If the contact slides away from the setpoint, its whole speed counts. The rate
/// begins at zero, also after a gap. A step of the setpoint is a rate too: it gives a push of at most a fifth of the step.
///
/// A repeated sample is neither integrated nor differentiated, and neither is the first one after a gap longer than the
/// graph's `max_gap_ms`. A feature that is absent contributes nothing; its integral and its control survive flicker and
/// are reset when the feature is absent for the graph's `reset_after_ms`. kd amplifies noise: smooth the feature first,
/// or leave it 0.
///
/// A feature that nothing uses, because a projector deletes everything it contributes, is frozen: its control is
/// absent, and it starts afresh in a mode that selects it.
///
/// ```toml
/// [nodes.pid]
/// type = "pid"
/// in.error = "error.error"
/// gains.x = { kp = 2.0, rise = 0.2 }          # [1/s, m/s2]
/// gains.y = { kp = 2.0, brake_above = 0.01 }  # [1/s, m/s]
/// gains.pressure = { kp = 0.2, ki = 0.06, within = 0.02 }   # integrates only near the target
/// ```
#[derive(Describe)]
pub struct Pid {
    /// The control law of each feature.
    laws: Box<[Law]>,
}

/// Parameters of `pid`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Gains of each feature.
    #[param(live, tunable)]
    gains: Map<Gains>,
}

/// Part of the error that one period corrects, from which on the loop diverges: e := (1 - kp T) e [1].
const MAX_STABLE_STEP: f64 = 2.0;
/// A small error, in the unit of any feature: what a `rise` must answer as fast as kp says.
const SMALL_ERROR: f64 = 0.001;
/// Smallest gain that is worth a name instead of a larger `rise` [1/s].
const LEAST_KP: f64 = 1.0;
/// An error within the noise of each feature [E].
const TINY_ERROR: f64 = 0.0001;

/// Gains of one feature.
#[derive(Debug, Clone, Param)]
struct Gains {
    /// Proportional gain.
    #[param(unit = "1/s", default = 0.0)]
    kp: f64,
    /// Integral gain.
    #[param(unit = "1/s2", default = 0.0)]
    ki: f64,
    /// Derivative gain.
    #[param(unit = "1", default = 0.0)]
    kd: f64,
    /// Largest error at which the integral grows; without it, it always grows.
    #[param(unit = "E", above = 0.0)]
    within: Option<f64>,
    /// Bound on the integral's part of the control.
    #[param(unit = "E/s", above = 0.0, default = 1.0)]
    bound: f64,
    /// Bound on the whole control; without it, the control has no bound.
    #[param(unit = "E/s", above = 0.0)]
    limit: Option<f64>,
    /// Bound on how fast the control grows away from zero; without it, it grows at once.
    #[param(unit = "E/s2", above = 0.0)]
    rise: Option<f64>,
    /// By how much a contact may slide faster than kp e before it is braked; without it, it is never braked.
    #[param(unit = "E/s", above = 0.0)]
    brake_above: Option<f64>,
}

impl Gains {
    /// Returns the warning about gains that do not reduce the error of a feature with one sample in each `period` [s].
    fn warning(&self, feature: &Feature, period: f64) -> Option<Mistake> {
        let name = &feature.name;
        let warn = |code, gain: &str, message: String| {
            Some(Mistake::new(code, At::Param(format!("gains.{name}.{gain}")), message))
        };
        let negative = [("kp", self.kp), ("ki", self.ki), ("kd", self.kd)].into_iter().find(|(_, value)| *value < 0.0);
        if let Some((gain, value)) = negative {
            let message = format!("the gain `{gain}` of `{name}` is {value}: it turns the motion of its column around");
            let help = format!("write `{gain} = {}`, and check that the column of `{name}` reduces its error", -value);
            return Some(warn(Code::UnusualGain, gain, message)?.help(help));
        }
        // A feature without any gain rests. Whether another mode gives it one is not known here.
        if self.kp == 0.0 && (self.ki > 0.0 || self.kd > 0.0) {
            let why = match self.ki > 0.0 {
                true => "the integral alone corrects the error, and swings",
                false => "the derivative alone corrects no error that stays",
            };
            let message = format!("the gain `kp` of `{name}` is 0 1/s: {why}");
            let help = format!("write a gain greater than 0, or remove the wire of `{name}` to stop controlling it");
            return Some(warn(Code::UnusualGain, "kp", message)?.help(help));
        }
        if let Some(rise) = self.rise.filter(|rise| *rise < self.kp * self.kp * SMALL_ERROR) {
            let (unit, time) = (feature.unit, self.kp * SMALL_ERROR / rise);
            let message = format!(
                "the control of `{name}` grows by {rise} {unit}/s in a second: it takes {time:.1} s to answer an error of \
                 {SMALL_ERROR} {unit}"
            );
            let most = libm::floor(10.0 * libm::sqrt(rise / (10.0 * SMALL_ERROR))) / 10.0;
            let help = match self.kp > FIRST_GAIN && most >= LEAST_KP {
                true => format!(
                    "write `kp = {most:.1}` or less, which this `rise` can follow. An arm without springs in its joints \
                     needs no `rise`"
                ),
                false => format!("write `rise = {:.2}` or more, or remove it", 10.0 * self.kp * self.kp * SMALL_ERROR),
            };
            return Some(warn(Code::UnusualGain, "rise", message)?.help(help));
        }
        if let Some(limit) = self.limit.filter(|limit| *limit < self.kp * TINY_ERROR) {
            let (unit, error) = (feature.unit, limit / self.kp);
            let message = format!(
                "the control of `{name}` is at its limit of {limit} {unit}/s from an error of {error:.1e} {unit} on: noise \
                 alone decides in which direction it moves"
            );
            let help = format!("write `limit = {:.1e}` or more, or remove it", 10.0 * self.kp * SMALL_ERROR);
            return Some(warn(Code::UnusualGain, "limit", message)?.help(help));
        }
        let (step, max) = (self.kp * period, MAX_STABLE_STEP / period);
        if step < MAX_STABLE_STEP {
            return None;
        }
        let message = format!(
            "the gain `kp` of `{name}` is {} 1/s, so one period of {} ms corrects {step:.1} times the error, and the loop \
             diverges",
            self.kp,
            (period * 1e6).round() / 1e3
        );
        let help = format!("write far less than {max:.0} 1/s, for example `kp = {}`", (max / 100.0).max(0.1));
        Some(warn(Code::UnstableGain, "kp", message)?.help(help))
    }
}

/// What `pid` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Error of each feature.
    #[port(unit = "E", frame = "A")]
    error: In<'a, Features>,
}

/// What `pid` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Control of each feature.
    #[port(unit = "E/s", frame = "A")]
    control: Out<Features>,
}

/// What `pid` remembers.
#[derive(State)]
pub struct State {
    /// For each feature.
    memories: Vec<Memory>,
    /// Time of the last step [ns].
    stepped: i64,
}

impl Node for Pid {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let shape = &setup.inputs.error;
        let gains = params.gains.in_order("gains", shape.names())?;
        let warnings =
            gains.iter().zip(&shape.features).filter_map(|(gains, feature)| gains.warning(feature, setup.period));
        setup.warnings.extend(warnings);
        let laws =
            gains.into_iter().zip(&shape.features).map(|(gains, feature)| Law::new(gains, feature.unit)).collect();
        setup.outputs.control = shape.map_units(Unit::per_second);
        Ok(Self { laws })
    }

    fn state(&self) -> State {
        State { memories: vec![Memory::default(); self.laws.len()], stepped: 0 }
    }

    fn uses(&self, wanted: &[Components]) -> Vec<Components> {
        wanted.into()
    }

    fn want(&mut self, wanted: &[Components]) -> bool {
        self.laws.iter_mut().enumerate().for_each(|(i, law)| law.is_wanted = wanted[0].has(i));
        true
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        for (i, (law, memory)) in self.laws.iter().zip(&mut state.memories).enumerate() {
            if !law.is_wanted {
                out.control.lose(i);
                *memory = Memory::default();
                continue;
            }
            match inputs.error.get(i) {
                Some(error) if error.is_new() => {
                    if memory.absence.end(tick) {
                        *memory = Memory::default();
                    }
                    let dt = memory.interval.step(&error, tick);
                    out.control.set_from(i, law.control(*error, dt, memory), &error);
                }
                Some(_) => {}
                None => {
                    // Absent without a loss: all features were lost at once, and the node was not stepped then.
                    let is_lost = inputs.error.freshness(i) == Freshness::Lost;
                    memory.absence.begin(if is_lost { tick.now } else { state.stepped });
                    out.control.lose(i);
                }
            }
        }
        state.stepped = tick.now;
    }
}

#[cfg(test)]
mod tests;
