//! `pid`: a PID controller on every feature, each on its own (paper eq. 3, the matrices K_P, K_I, K_D).
//!
//! u = kp e + I + kd de/dt, with I the sum of ki e dt. Time is that between the stamps of a component's samples, so a
//! gain means the same at 100 Hz and at 1 kHz, and one sample is never integrated twice; the paper sums without dt, so
//! its KI is ki times the period and its KD is kd over the period. The integral is kept in units of the control, so a
//! change of ki makes no jump; it runs only near the target (`within`), is bounded, and does not grow outwards while
//! the output is at its limit. The error of a line's direction is differenced modulo pi.
//!
//! A held component stays as it is. An absent one contributes nothing and resets only itself, and only when it has been
//! away for long: a frame of flicker does not wipe an integral.

use tactflow_runtime::node::{Components, Interval, Map, Mistakes, Node, Positive, Setup, Tick};
use tactflow_runtime::signal::{Freshness, Unit};
use tactflow_runtime::{inputs, outputs, params, state};

use super::integral::integrate;
use crate::motion::axis::wrap_axial;

params! { Gains:
    /// Proportional gain [1/s].
    kp: f64 = 0.0,
    /// Integral gain [1/s²].
    ki: f64 = 0.0,
    /// Derivative gain [1].
    kd: f64 = 0.0,
    /// Integrates only while the error is at most this; always when not given [the feature's unit].
    within: Option<Positive>,
    /// Bound on the integral's part of the control [the feature's unit per second].
    bound: Positive = Positive(1.0),
    /// Bound on the whole control; none when not given [the feature's unit per second].
    limit: Option<Positive>,
}

params! {
    /// Gains of each feature.
    live gains: Map<Gains>,
}

inputs! {
    /// Error of each feature [any unit].
    error: Features["_", "A"],
}

outputs! {
    /// Control of each feature [the feature's unit per second].
    control: Features["_/s", "A"],
}

state! {
    /// What is remembered of each feature.
    memories: Vec<Memory>,
    /// Time of the last step [ns].
    stepped: i64,
}

/// What is remembered of one feature.
#[derive(Debug, Clone, Copy, Default)]
pub struct Memory {
    /// The integral's part of the control [the feature's unit per second].
    integral: f64,
    /// Error of the last sample [the feature's unit].
    error: f64,
    interval: Interval,
    /// When it went away, if it did [ns].
    lost_at: Option<i64>,
}

/// The control law of each feature.
pub struct Pid {
    laws: Box<[Law]>,
}

struct Law {
    kp: f64,
    ki: f64,
    kd: f64,
    within: f64,
    bound: f64,
    limit: f64,
    is_axial: bool,
    /// Whether anything reads its control; otherwise it is frozen.
    is_wanted: bool,
}

impl Node for Pid {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    const NAME: &'static str = "pid";
    const SUMMARY: &'static str = "a PID controller on every feature, for force and position control";
    const DOC: &'static str = "u = kp e + I + kd de/dt with I the sum of ki e dt: the paper's eq. 3, each feature \
        by itself. Time is that between the stamps of the samples, so a gain means the same at 100 Hz and at 1 \
        kHz. The paper sums without time: its K_I is ki times the period, its K_D is kd over the period.\n\n\
        kp in 1/s says how fast an error is worked off: 2.0 takes half a second. Under velocity control soft foam \
        integrates already, so ki is there for creep and for objects that move. It gathers only while the error is \
        `within`, never grows beyond `bound`, and does not grow outward while the control is at its `limit`.\n\n\
        A repeated sample is neither integrated nor differentiated. A feature that is absent contributes nothing; \
        its integral is kept through flicker, and forgotten when it stays away for the graph's `reset_after_ms`. \
        kd amplifies noise: smooth the feature first, or leave it 0.\n\n\
        A feature that nothing uses, since a projector deletes all that it gives, is frozen: its control is absent, \
        and it starts afresh in a mode that selects it.";
    const EXAMPLE: &'static str = r#"
[nodes.pid]
type = "pid"
in.error = "error.error"
gains.x = { kp = 2.0 }              # [1/s]
gains.y = { kp = 2.0 }
gains.pressure = { kp = 0.2, ki = 0.06, within = 0.02 }   # integrates only near the target
"#;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let shape = &setup.inputs.error;
        let names = shape.features.iter().map(|feature| feature.name.as_str());
        let gains = params.gains.in_order("gains", names)?;
        let laws = gains.into_iter().zip(&shape.features).map(|(gains, feature)| Law::new(gains, feature.unit));
        let laws = laws.collect();
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
        let control = out.control.write();
        let parts = self.laws.iter().zip(&mut state.memories).zip(inputs.error.components());
        for (i, ((law, memory), component)) in parts.enumerate() {
            if !law.is_wanted {
                control.lose(i, tick.index);
                *memory = Memory::default();
                continue;
            }
            match (component.freshness(tick.index), component.get()) {
                (Freshness::New, Some(error)) => {
                    memory.came_back(tick);
                    let dt = memory.interval.step(component.stamp(), tick);
                    control.set(i, law.control(error, dt, tick.max_gap, memory), tick.index, component.stamp());
                }
                (_, Some(_)) => {}
                (freshness, None) => {
                    // Absent without having been seen to go: all went at once, and the node was not stepped then.
                    let went = if freshness == Freshness::Lost { tick.now } else { state.stepped };
                    memory.lost_at.get_or_insert(went);
                    control.lose(i, tick.index);
                }
            }
        }
        state.stepped = tick.now;
    }
}

impl Memory {
    /// Decides, now that the feature is there, whether it was away for so long that it starts afresh.
    fn came_back(&mut self, tick: &Tick) {
        if let Some(lost_at) = self.lost_at {
            self.lost_at = None;
            if tick.now - lost_at >= tick.reset_after {
                *self = Self::default();
            }
        }
    }
}

impl Law {
    fn new(gains: &Gains, unit: Unit) -> Self {
        let or_none = |bound: Option<Positive>| bound.map_or(f64::INFINITY, |bound| *bound);
        Self {
            kp: gains.kp,
            ki: gains.ki,
            kd: gains.kd,
            within: or_none(gains.within),
            bound: *gains.bound,
            limit: or_none(gains.limit),
            is_axial: unit.is_axial(),
            is_wanted: true,
        }
    }

    /// The control for an error that came `dt` [s] after the last one. What came after a gap tells no slope: its time
    /// is cut at `max_gap` [s], and the error would seem to have jumped.
    fn control(&self, error: f64, dt: f64, max_gap: f64, memory: &mut Memory) -> f64 {
        let change = error - memory.error;
        let change = if self.is_axial { wrap_axial(change) } else { change };
        let slope = if dt > 0.0 && dt < max_gap { change / dt } else { 0.0 };
        let others = self.kp * error + self.kd * slope;
        let growth = if error.abs() <= self.within { self.ki * error * dt } else { 0.0 };
        memory.integral = integrate(memory.integral, growth, self.bound, others, self.limit);
        memory.error = error;
        (others + memory.integral).clamp(-self.limit, self.limit)
    }
}

#[cfg(test)]
mod tests;
