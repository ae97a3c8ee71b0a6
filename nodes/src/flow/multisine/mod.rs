//! `multisine`: a periodic sum of sines with a small peak, for the identification of a frequency response.

mod wave;

use tactflow_runtime::node::{
    Describe, In, Inputs, Mistake, Mistakes, Motion, Node, Out, Outputs, Param, Setup, State, Tick,
};
use tactflow_runtime::signal::{Flag, Scalar, ScalarShape, Unit};

use wave::Wave;

/// Generates a test signal that contains all frequencies of a band at once, as equal sines.
///
/// x(t) = A / C Σ sin(2 pi n t / T + φ_n), over all multiples n / T from `min_frequency` to `max_frequency`, with the
/// period T. The response to it, over whole periods and after the first one, is the frequency response of the system
/// at these frequencies without leakage: no window is needed. The spread between the periods is the noise. A chirp
/// shows one frequency after the other, with leakage at its ends.
///
/// The phases are those of Schroeder (IEEE Trans. Information Theory 16, 1970), φ_n = -pi k (k - 1) / N for the k-th of
/// N sines. With them the peak is about 1.7 times the standard deviation, where that of equal phases is sqrt(2 N)
/// times. The peak never exceeds `amplitude`: C is a bound on the peak of the sum between its samples too. Each of the
/// sines has the amplitude A / C.
///
/// The signal begins at one of its zeros and ends there after `periods`, so it does not jump. Then it is 0, and `done`
/// is set. Friction hides a small signal: repeat with a larger amplitude until two of them agree.
///
/// There is a new value in each tick, for the time of the tick. Without a gate the signal begins with the run. With a
/// gate it begins when the gate opens, and is absent while the gate is not set or is absent. The period must be a
/// multiple of the period of the graph, so that each one has the same samples.
///
/// ```toml
/// [nodes.multisine]                   # in and out with 0.5 to 12 Hz at once, during a contact
/// type = "multisine"
/// in.gate = "label.present"
/// unit = "m/s"
/// amplitude = 0.004                   # [m/s]
/// period = 4.0                        # a resolution of 0.25 Hz [s]
/// min_frequency = 0.5                 # [Hz]
/// max_frequency = 12.0                # [Hz]
/// periods = 5
/// ```
#[derive(Describe)]
#[describe(every_tick)]
pub struct Multisine {
    wave: Wave,
    amplitude: f64,
    /// Duration [s]; infinite if not given.
    duration: f64,
    is_gated: bool,
}

/// Parameters of `multisine`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Unit of the signal.
    unit: Unit,
    /// Frame of the signal; if not given, the inputs that read it decide.
    frame: Option<String>,
    /// Bound on the signal.
    #[param(unit = "$unit", range = 0.0.., default = 1.0, live)]
    amplitude: f64,
    /// Period, whose inverse is the distance between two frequencies.
    #[param(unit = "s", above = 0.0)]
    period: f64,
    /// Smallest frequency.
    #[param(unit = "Hz", above = 0.0)]
    min_frequency: f64,
    /// Largest frequency.
    #[param(unit = "Hz", above = 0.0)]
    max_frequency: f64,
    /// Number of periods; unlimited if not given.
    #[param(unit = "1", range = 1..=1_000_000)]
    periods: Option<usize>,
}

/// What `multisine` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The signal runs while this is set, and begins again each time; without a wire it always runs.
    #[port(optional)]
    gate: Option<In<'a, Flag>>,
}

/// What `multisine` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The signal; absent while the gate is not set or is absent.
    #[port(unit = "_", frame = "$frame")]
    value: Out<Scalar>,
    /// Whether all periods are over; absent while the gate is not set or is absent.
    done: Out<Flag>,
}

/// What `multisine` remembers.
#[derive(State)]
pub struct State {
    /// Time at which the gate opened, if it is open [ns].
    opened: Option<i64>,
}

/// Largest number of sines: a step adds them up.
const MAX_SINES: usize = 200;
/// Difference of the period from a multiple of the graph's period that counts as rounding, in periods of the graph [1].
const ROUNDING: f64 = 1e-6;

impl Node for Multisine {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let (first, count) = harmonics(&params, setup.period)?;
        if params.amplitude == 0.0 {
            setup.motion = Motion::Still;
        }
        setup.outputs.value = ScalarShape::of(params.unit);
        Ok(Self {
            wave: Wave::new(first, count, params.period),
            amplitude: params.amplitude,
            duration: params.periods.map_or(f64::INFINITY, |periods| periods as f64 * params.period),
            is_gated: setup.inputs.gate.is_some(),
        })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let origin = if !self.is_gated {
            0
        } else if inputs.gate.is_some_and(|gate| *gate) {
            *state.opened.get_or_insert(tick.now)
        } else {
            state.opened = None;
            return;
        };
        let time = tick.now.saturating_sub(origin) as f64 * 1e-9;
        let is_over = time >= self.duration;
        out.value.set(if is_over { 0.0 } else { self.amplitude * self.wave.at(time) });
        out.done.set(is_over);
    }
}

/// Returns the first multiple of the inverse of the period, and the number of sines. `step` is the period of the graph
/// [s].
fn harmonics(params: &Params, step: f64) -> Result<(usize, usize), Mistakes> {
    let Params { period, min_frequency: min, max_frequency: max, .. } = *params;
    let steps = period / step;
    if (steps - steps.round()).abs() > ROUNDING || steps < 1.0 {
        let message = format!("the period is {steps:.3} times that of the graph, {} ms", step * 1e3);
        let help = format!("write a multiple of it, for example `period = {}`", steps.round().max(1.0) * step);
        return Err(Mistake::param("period", message).help(help).into());
    }
    if max > 0.5 / step {
        let message = format!("`max_frequency` is above half of the graph's rate: the maximum is {} Hz", 0.5 / step);
        return Err(Mistake::param("max_frequency", message).into());
    }
    // A multiple that rounding puts beside the band is in it.
    let (first, last) = ((min * period - ROUNDING).ceil().max(1.0), (max * period + ROUNDING).floor());
    let count = last - first + 1.0;
    if count < 1.0 {
        let message =
            format!("no multiple of {} Hz, the inverse of the period, is from {min} to {max} Hz", 1.0 / period);
        return Err(Mistake::param("max_frequency", message).help("write a longer `period` or a wider band").into());
    }
    if count > MAX_SINES as f64 {
        let message = format!("the band has {count} multiples of {} Hz; the maximum is {MAX_SINES}", 1.0 / period);
        return Err(Mistake::param("period", message).help("write a shorter `period` or a narrower band").into());
    }
    Ok((first as usize, count as usize))
}

#[cfg(test)]
mod tests;
