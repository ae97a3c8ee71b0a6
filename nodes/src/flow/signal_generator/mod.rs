//! `signal_generator`: a step, a ramp, a sine or a chirp over time, for identification.

mod waveform;

use tactflow_runtime::node::{
    At, Describe, In, Inputs, Mistake, Mistakes, Motion, Node, Out, Outputs, Param, Setup, State, Tick, refuse_any,
};
use tactflow_runtime::signal::{Flag, Scalar, ScalarShape, Unit};
use tactflow_runtime::source::Code;

pub use waveform::Waveform;

/// Generates a test signal: a step, a ramp, a sine or a chirp.
///
/// The output is a known scalar, so the response to it identifies the system behind it: `step` shows rise times and
/// delays, `ramp` creep and thresholds, `sine` gain and phase at one frequency, and `chirp` those of a whole band. Wire
/// it to a component of `compose_twist` to move one axis, or to `feature_error` to move the reference of a controller.
///
/// With t the time since `start`, T = `duration` and A = `amplitude`: a step is A, a ramp is A t / T and then A, a sine
/// is A sin(2 pi f t), a chirp is A sin(2 pi (f t + (f_end - f) t^2 / (2 T))). `offset` is added to all of them, and is
/// the value before the start and, except for a ramp, after the end. The phase of a chirp is the integral of its
/// frequency, so the chirp ends at `end_frequency`.
///
/// There is a new value in each tick, for the time of the tick. Without a gate the time is that of the graph. With a
/// gate it is the time since the gate opened, and the output is absent while the gate is not set or is absent. A gate
/// that flickers restarts the signal: wire `contact_debounce.present`.
///
/// Generated motion never becomes too old: when a sensor falls silent, only a gate stops it. A frequency above half of
/// the graph's rate is refused, because sampling would turn it into another one.
///
/// ```toml
/// [nodes.signal_generator]            # in and out with a rising frequency, during a contact
/// type = "signal_generator"
/// in.gate = "label.present"
/// form = "chirp"
/// unit = "m/s"
/// amplitude = 0.005                   # [m/s]
/// frequency = 0.2                     # [Hz]
/// end_frequency = 10.0                # [Hz]
/// duration = 20.0                     # [s]
/// ```
#[derive(Describe)]
#[describe(every_tick)]
pub struct SignalGenerator {
    params: Params,
    /// Start [ns].
    start: i64,
    /// Duration [s]; infinite if not given.
    duration: f64,
    /// Frequencies at the start and at the end [Hz].
    frequencies: [f64; 2],
    is_gated: bool,
}

/// Parameters of `signal_generator`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Form of the signal.
    form: Waveform,
    /// Unit of the signal.
    unit: Unit,
    /// Frame of the signal; if not given, the inputs that read it decide.
    frame: Option<String>,
    /// Height of a step, end of a ramp, or peak of a sine or a chirp, relative to the offset.
    #[param(unit = "$unit", default = 1.0, live)]
    amplitude: f64,
    /// Offset that is added to the signal; the value before the start and after the end.
    #[param(unit = "$unit", default = 0.0, live)]
    offset: f64,
    /// Start: the time of the graph, or the time since the gate opened.
    #[param(unit = "s", range = 0.0.., default = 0.0)]
    start: f64,
    /// Duration; unlimited if not given. A ramp and a chirp need it.
    #[param(unit = "s", above = 0.0)]
    duration: Option<f64>,
    /// Frequency of a sine, or of a chirp at its start.
    #[param(unit = "Hz", above = 0.0)]
    frequency: Option<f64>,
    /// Frequency of a chirp at its end.
    #[param(unit = "Hz", above = 0.0)]
    end_frequency: Option<f64>,
}

/// What `signal_generator` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// The signal runs while this is set, and starts again each time; without a wire it always runs.
    #[port(optional)]
    gate: Option<In<'a, Flag>>,
}

/// What `signal_generator` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The signal; absent while the gate is not set or is absent.
    #[port(unit = "_", frame = "$frame")]
    value: Out<Scalar>,
}

/// What `signal_generator` remembers.
#[derive(State)]
pub struct State {
    /// Time at which the gate opened, if it is open [ns].
    opened: Option<i64>,
}

impl Node for SignalGenerator {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        check(&params, setup.period)?;
        if params.amplitude == 0.0 && params.offset == 0.0 {
            setup.motion = Motion::Still;
        }
        setup.outputs.value = ScalarShape::of(params.unit);
        let first = params.frequency.unwrap_or(0.0);
        Ok(Self {
            start: (params.start * 1e9) as i64,
            duration: params.duration.unwrap_or(f64::INFINITY),
            frequencies: [first, params.end_frequency.unwrap_or(first)],
            is_gated: setup.inputs.gate.is_some(),
            params,
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
        let nanos = tick.now.saturating_sub(origin).saturating_sub(self.start);
        let Params { form, amplitude, offset, .. } = self.params;
        out.value.set(offset + amplitude * form.at(nanos as f64 * 1e-9, self.duration, self.frequencies));
    }
}

/// Returns a mistake for each parameter that the form needs but lacks, or has but does not use.
fn check(params: &Params, period: f64) -> Result<(), Mistakes> {
    let (form, _) = Waveform::CONTENTS.words[params.form as usize];
    let waves = matches!(params.form, Waveform::Sine | Waveform::Chirp);
    let ends = matches!(params.form, Waveform::Ramp | Waveform::Chirp);
    let is_chirp = params.form == Waveform::Chirp;
    let table = [
        // Name, and whether it is given, needed, unused.
        ("duration", params.duration.is_some(), ends, false),
        ("frequency", params.frequency.is_some(), waves, !waves),
        ("end_frequency", params.end_frequency.is_some(), is_chirp, !is_chirp),
    ];
    let mut mistakes = Mistakes::new();
    for (name, is_given, is_needed, is_unused) in table {
        if is_needed && !is_given {
            mistakes.push(Mistake::new(Code::MissingKey, At::Node, format!("`{name}` is missing: a {form} needs it")));
        } else if is_given && is_unused {
            mistakes.push(Mistake::key(name, format!("a {form} does not use `{name}`: remove it")));
        }
    }
    let max = 0.5 / period;
    for (name, frequency) in [("frequency", params.frequency), ("end_frequency", params.end_frequency)] {
        if frequency.is_some_and(|frequency| frequency > max) && mistakes.is_empty() {
            let message = format!("`{name}` is above half of the graph's rate: the maximum is {max} Hz");
            mistakes.push(Mistake::param(name, message));
        }
    }
    refuse_any(mistakes)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{FlagShape, Freshness, Scalar};

    use std::f64::consts::TAU;

    use super::waveform::turns;
    use super::*;

    fn rig(params: &str) -> Result<NodeRig, Mistakes> {
        NodeRig::new::<SignalGenerator>(&format!("unit = 'm/s'\n{params}"), &[])
    }

    /// The signal at a time [s].
    fn at(params: &str, time: f64) -> f64 {
        let mut rig = rig(params).unwrap();
        rig.tick.now = (time * 1e9).round() as i64;
        rig.step();
        *rig.get::<Scalar>("value").unwrap()
    }

    #[test]
    fn every_form_before_during_and_after_the_signal() {
        let step = "form = 'step'\namplitude = 2.0\noffset = 1.0\nstart = 0.5\nduration = 1.0";
        let ramp = "form = 'ramp'\namplitude = -2.0\noffset = 1.0\nstart = 0.5\nduration = 1.0";
        let sine = "form = 'sine'\namplitude = 2.0\nfrequency = 1.0\nstart = 0.5\nduration = 1.5";
        let endless = "form = 'sine'\nfrequency = 0.25";
        let cases = [
            (step, 0.499, 1.0),
            (step, 0.5, 3.0),
            (step, 1.499, 3.0),
            (step, 1.5, 1.0),
            (ramp, 0.2, 1.0),
            (ramp, 0.5, 1.0),
            (ramp, 1.0, 0.0),
            (ramp, 1.5, -1.0),
            (ramp, 9.0, -1.0),
            (sine, 0.4, 0.0),
            (sine, 0.75, 2.0),
            (sine, 1.25, -2.0),
            (sine, 1.75, 2.0),
            (sine, 2.0, 0.0),
            (endless, 1.0, 1.0),
            (endless, 3.0, -1.0),
            // Five weeks later the phase is still exact.
            (endless, 3_024_001.0, 1.0),
        ];
        for (params, time, expected) in cases {
            assert!((at(params, time) - expected).abs() < 1e-9, "{params} at {time}: {}", at(params, time));
        }
    }

    /// Phase of a chirp by the trapezoidal rule over its frequency, which is exact for a straight line except for
    /// rounding.
    fn integrated([first, last]: [f64; 2], duration: f64, time: f64) -> f64 {
        let count = 2000;
        let frequency = |t: f64| first + (last - first) * t / duration;
        let step = time / f64::from(count);
        (0..count).map(|i| 0.5 * step * (frequency(f64::from(i) * step) + frequency(f64::from(i + 1) * step))).sum()
    }

    proptest! {
        #[test]
        fn the_phase_of_a_chirp_is_the_integral_of_its_frequency(
            first in 0.1..100.0_f64, last in 0.1..100.0_f64, duration in 0.1..30.0_f64, share in 0.0..0.999_f64,
        ) {
            let time = (share * duration * 1e9).round() * 1e-9;
            let params = format!(
                "form = 'chirp'\nfrequency = {first:?}\nend_frequency = {last:?}\nduration = {duration:?}"
            );
            let expected = (TAU * integrated([first, last], duration, time)).sin();
            prop_assert!((at(&params, time) - expected).abs() < 1e-7);
        }

        #[test]
        fn the_signal_stays_between_its_peaks(time in -1.0..100.0_f64) {
            prop_assert!(Waveform::Chirp.at(time, 50.0, [1.0, 7.0]).abs() <= 1.0);
        }
    }

    #[test]
    fn a_chirp_ends_at_its_end_frequency() {
        let slope = (turns([2.0, 8.0], 4.0, 4.0) - turns([2.0, 8.0], 4.0, 4.0 - 1e-6)) / 1e-6;
        assert!((slope - 8.0).abs() < 1e-5, "{slope}");
    }

    #[test]
    fn a_gate_starts_and_ends_the_signal() {
        let params = "unit = 'N'\nform = 'ramp'\nduration = 0.01\nstart = 0.002";
        let mut rig = NodeRig::new::<SignalGenerator>(params, &[("gate", FlagShape.into())]).unwrap();
        let mut step = |gate: Option<Option<bool>>| {
            match gate {
                Some(Some(gate)) => rig.set("gate", gate),
                Some(None) => rig.lose("gate"),
                None => {}
            }
            rig.step_ms(4.0);
            (rig.freshness("value"), rig.get::<Scalar>("value").map(|value| (value * 10.0).round()))
        };
        let steps = [
            ("no gate yet", None, Freshness::Absent, None),
            ("the gate opens", Some(Some(true)), Freshness::New, Some(0.0)),
            ("a held gate stays open", None, Freshness::New, Some(2.0)),
            ("the signal goes on", None, Freshness::New, Some(6.0)),
            ("the gate shuts", Some(Some(false)), Freshness::Lost, None),
            ("shut", None, Freshness::Absent, None),
            ("the signal starts again", Some(Some(true)), Freshness::New, Some(0.0)),
            ("it goes on", None, Freshness::New, Some(2.0)),
            ("the gate is lost", Some(None), Freshness::Lost, None),
            ("it starts again after the loss", Some(Some(true)), Freshness::New, Some(0.0)),
        ];
        for (what, gate, freshness, value) in steps {
            assert_eq!(step(gate), (freshness, value), "{what}");
        }
    }

    #[test]
    fn without_a_gate_the_value_is_new_and_timeless_in_every_tick() {
        let mut rig = rig("form = 'step'").unwrap();
        assert_eq!(rig.shape("value"), &ScalarShape::of(Unit::METRE.per_second()).into());
        for _ in 0..3 {
            rig.step();
            assert_eq!((rig.freshness("value"), rig.get::<Scalar>("value")), (Freshness::New, Some(&1.0)));
            assert!(rig.mark("value").stamp().is_timeless());
        }
    }

    #[test]
    fn missing_and_unused_parameters_are_errors() {
        let cases: [(&str, &[&str]); 8] = [
            ("form = 'square'", &["expected one of `step`, `ramp`, `sine`, `chirp`, found the string \"square\""]),
            ("form = 'ramp'", &["`duration` is missing: a ramp needs it"]),
            ("form = 'sine'", &["`frequency` is missing: a sine needs it"]),
            ("form = 'chirp'\nduration = 1.0\nfrequency = 1.0", &["`end_frequency` is missing: a chirp needs it"]),
            ("form = 'step'\nfrequency = 1.0", &["a step does not use `frequency`: remove it"]),
            (
                "form = 'sine'\nfrequency = 1.0\nend_frequency = 2.0",
                &["a sine does not use `end_frequency`: remove it"],
            ),
            (
                "form = 'sine'\nfrequency = 501.0",
                &["`frequency` is above half of the graph's rate: the maximum is 500 Hz"],
            ),
            ("form = 'step'\nstart = -1.0", &["expected a number, 0 or more [s], found -1"]),
        ];
        for (params, expected) in cases {
            let mistakes = rig(params).err().unwrap();
            let messages: Vec<&str> = mistakes.iter().map(|mistake| mistake.message.as_str()).collect();
            assert_eq!(messages, expected, "{params}");
        }
    }
}
