//! `signal_generator`: a step, a ramp, a sine or a chirp over time, to find out how something answers.
//!
//! With t the time since `start`, and T the duration:
//!
//! ```text
//! step   offset + A                        for 0 <= t < T
//! ramp   offset + A t / T                  and A from T on
//! sine   offset + A sin(2 pi f t)          for 0 <= t < T
//! chirp  offset + A sin(2 pi (f t + (f_end - f) t^2 / (2 T)))
//! ```
//!
//! and the offset alone before and after. The phase of a chirp is the integral of its frequency, which goes from f to
//! f_end in a straight line; f t with a frequency that grows would sweep twice as far. Phases are counted in turns and
//! cut to one turn before the sine, so a long run loses nothing. Time is that of the tick: a late tick shows the value of
//! its own time.

use std::f64::consts::TAU;

use tactflow_runtime::node::{
    At, Mistake, Mistakes, Node, NonNegative, Param, Positive, Reader, Setup, Tick, read_leaf,
};
use tactflow_runtime::signal::{ScalarShape, Unit};
use tactflow_runtime::source::Code;
use tactflow_runtime::source::Value;
use tactflow_runtime::{inputs, outputs, params, state};

/// The course of a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// There at once.
    Step,
    /// In a straight line.
    Ramp,
    /// One frequency.
    Sine,
    /// One frequency after the other.
    Chirp,
}

const FORMS: [(&str, Form); 4] =
    [("step", Form::Step), ("ramp", Form::Ramp), ("sine", Form::Sine), ("chirp", Form::Chirp)];

impl Param for Form {
    const EXPECTS: &'static str = "`step`, `ramp`, `sine` or `chirp`";

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let name: String = read_leaf(value, reader, Self::EXPECTS)?;
        let found = FORMS.iter().find(|(form, _)| *form == name).map(|(_, form)| *form);
        if found.is_none() {
            reader.wrong_type(value, Self::EXPECTS);
        }
        found
    }
}

params! {
    /// What it looks like: `step`, `ramp`, `sine` or `chirp`.
    form: Form,
    /// Unit of the signal.
    unit: Unit,
    /// Frame of the signal, if it has one; what it is wired to decides when this is not said.
    frame: Option<String>,
    /// Height of a step, end of a ramp, peak of a sine or a chirp, all over the offset [`unit`].
    live amplitude: f64 = 1.0,
    /// What it is before and after, and what the rest is added to [`unit`].
    live offset: f64 = 0.0,
    /// When it starts: the graph's time, or the time since the gate opened [s].
    start: NonNegative = NonNegative(0.0),
    /// How long it lasts; for ever unless given. A ramp and a chirp need it [s].
    duration: Option<Positive>,
    /// Frequency of a sine, and the one that a chirp starts with [Hz].
    frequency: Option<Positive>,
    /// Frequency that a chirp ends with [Hz].
    end_frequency: Option<Positive>,
}

inputs! {
    /// What must be set for the signal to go on, from its start each time; without this wire it always does.
    gate: Trigger<Flag>,
}

outputs! {
    /// The signal; absent while the gate is shut [`unit`].
    value: Scalar["_", "$frame"],
}

state! {
    /// When the gate opened, if it is open [ns].
    opened: Option<i64>,
}

/// The signal.
pub struct SignalGenerator {
    form: Form,
    amplitude: f64,
    offset: f64,
    /// When it starts [ns].
    start: i64,
    /// How long it lasts [s]; infinite for ever.
    duration: f64,
    /// Turns per second at its start and at its end [Hz].
    frequencies: [f64; 2],
    is_gated: bool,
}

impl tactflow_runtime::node::Describe for SignalGenerator {
    const NAME: &'static str = "signal_generator";
    const SUMMARY: &'static str = "a test signal for identification: a step, a ramp, a sine or a chirp";
    const DOC: &'static str = "Gives a scalar that is known at every moment, so that the answer to it tells what \
        lies between: `step` for rise times and delays, `ramp` for creep and thresholds, `sine` for gain and phase \
        at one frequency, `chirp` for a whole band. Wire it to a component of `twist_of` to move one axis, or to \
        `feature_error` to lead a controller.\n\n\
        With t the time since `start` and T = `duration`: a step is A, a ramp A t / T and then A, a sine A sin(2 \
        pi f t), a chirp A sin(2 pi (f t + (f_end - f) t^2 / (2 T))). All stand on `offset`, which is what there \
        is before the start and, but for a ramp, after the end. A chirp's phase is the integral of its frequency, \
        so it does end at `end_frequency`.\n\n\
        It makes a new value in each tick, at the time of the tick. Without a gate time is the graph's. With one \
        it counts from the moment the gate opens, and while the gate is shut or absent there is no value; a gate \
        that flickers starts the signal again, so take `contact_debounce.present`.\n\n\
        Generated motion is timeless: nothing but a gate stops it when a sensor falls silent. A frequency above \
        half of the graph's rate is refused, as it would come out as another one.";
    const EXAMPLE: &'static str = r#"
[nodes.signal_generator]            # in and out, faster and faster, while there is a contact
type = "signal_generator"
in.gate = "label.present"
form = "chirp"
unit = "m/s"
amplitude = 0.005                   # [m/s]
frequency = 0.2                     # [Hz]
end_frequency = 10.0                # [Hz]
duration = 20.0                     # [s]
"#;
    const EVERY_TICK: bool = true;
}

impl Node for SignalGenerator {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let mistakes = check(&params, setup.period);
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        setup.is_still = params.amplitude == 0.0 && params.offset == 0.0;
        setup.outputs.value = ScalarShape::of(params.unit);
        let first = params.frequency.map_or(0.0, |frequency| *frequency);
        Ok(Self {
            form: params.form,
            amplitude: params.amplitude,
            offset: params.offset,
            start: (*params.start * 1e9) as i64,
            duration: params.duration.map_or(f64::INFINITY, |duration| *duration),
            frequencies: [first, params.end_frequency.map_or(first, |frequency| *frequency)],
            is_gated: setup.inputs.gate.is_some(),
        })
    }

    fn state(&self) -> State {
        State { opened: None }
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
        out.value.set(self.at(nanos as f64 * 1e-9));
    }
}

impl SignalGenerator {
    /// The signal `time` [s] after its start.
    fn at(&self, time: f64) -> f64 {
        let is_over = time >= self.duration;
        let part = match self.form {
            _ if time < 0.0 => 0.0,
            Form::Ramp => (time / self.duration).min(1.0),
            _ if is_over => 0.0,
            Form::Step => 1.0,
            Form::Sine | Form::Chirp => {
                let turns = turns(self.frequencies, self.duration, time);
                libm::sin(TAU * (turns - turns.floor()))
            }
        };
        self.offset + self.amplitude * part
    }
}

/// How many turns there were after `time` [s], with a frequency that goes from the first to the last in a straight line
/// over `duration` [s].
fn turns([first, last]: [f64; 2], duration: f64, time: f64) -> f64 {
    (first + (last - first) * (0.5 * time / duration)) * time
}

/// What a form needs and has not, and what it has and does not need.
fn check(params: &Params, period: f64) -> Mistakes {
    let form = FORMS.iter().find(|(_, form)| *form == params.form).map_or("", |(name, _)| name);
    let waves = matches!(params.form, Form::Sine | Form::Chirp);
    let ends = matches!(params.form, Form::Ramp | Form::Chirp);
    let is_chirp = params.form == Form::Chirp;
    let table = [
        // Name, whether it is given, whether it is needed, whether it is of no use.
        ("duration", params.duration.is_some(), ends, false),
        ("frequency", params.frequency.is_some(), waves, !waves),
        ("end_frequency", params.end_frequency.is_some(), is_chirp, !is_chirp),
    ];
    let mut mistakes = Mistakes::new();
    for (name, is_given, is_needed, is_useless) in table {
        if is_needed && !is_given {
            mistakes.push(Mistake::new(Code::MissingKey, At::Node, format!("`{name}` is missing: a {form} needs it")));
        } else if is_given && is_useless {
            mistakes.push(Mistake::key(name, format!("a {form} has no `{name}`")));
        }
    }
    let most = 0.5 / period;
    for (name, frequency) in [("frequency", params.frequency), ("end_frequency", params.end_frequency)] {
        if frequency.is_some_and(|frequency| *frequency > most) && mistakes.is_empty() {
            let message = format!("`{name}` is above half of the graph's rate: {most} Hz at most");
            mistakes.push(Mistake::param(name, message));
        }
    }
    mistakes
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{FlagShape, Freshness, Scalar};

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
    fn every_form_before_while_and_after() {
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
            // Five weeks later it is still on the beat.
            (endless, 3_024_001.0, 1.0),
        ];
        for (params, time, expected) in cases {
            assert!((at(params, time) - expected).abs() < 1e-9, "{params} at {time}: {}", at(params, time));
        }
    }

    /// Turns of a chirp by the trapezoidal rule over its frequency, which is exact for a straight line but for rounding.
    fn summed([first, last]: [f64; 2], duration: f64, time: f64) -> f64 {
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
            let expected = (TAU * summed([first, last], duration, time)).sin();
            prop_assert!((at(&params, time) - expected).abs() < 1e-7);
        }

        #[test]
        fn it_stays_between_its_peaks(time in -1.0..100.0_f64, offset in -1.0..1.0_f64) {
            let signal = SignalGenerator {
                form: Form::Chirp, amplitude: 2.0, offset, start: 0, duration: 50.0,
                frequencies: [1.0, 7.0], is_gated: false,
            };
            prop_assert!((signal.at(time) - offset).abs() <= 2.0);
        }
    }

    #[test]
    fn the_frequency_at_the_end_of_a_chirp_is_the_one_that_was_asked_for() {
        let slope = (turns([2.0, 8.0], 4.0, 4.0) - turns([2.0, 8.0], 4.0, 4.0 - 1e-6)) / 1e-6;
        assert!((slope - 8.0).abs() < 1e-5, "{slope}");
    }

    #[test]
    fn a_gate_starts_it_and_ends_it() {
        let params = "unit = 'N'\nform = 'ramp'\nduration = 0.01\nstart = 0.002";
        let mut rig = NodeRig::new::<SignalGenerator>(params, &[("gate", FlagShape.into())]).unwrap();
        let mut show = |gate: Option<Option<bool>>| {
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
            ("it opens", Some(Some(true)), Freshness::New, Some(0.0)),
            ("a held gate is open", None, Freshness::New, Some(2.0)),
            ("and goes on", None, Freshness::New, Some(6.0)),
            ("it shuts", Some(Some(false)), Freshness::Lost, None),
            ("shut", None, Freshness::Absent, None),
            ("from the start", Some(Some(true)), Freshness::New, Some(0.0)),
            ("on", None, Freshness::New, Some(2.0)),
            ("the gate goes", Some(None), Freshness::Lost, None),
            ("from the start again", Some(Some(true)), Freshness::New, Some(0.0)),
        ];
        for (what, gate, freshness, value) in steps {
            assert_eq!(show(gate), (freshness, value), "{what}");
        }
    }

    #[test]
    fn without_a_gate_it_is_new_and_timeless_in_every_tick() {
        let mut rig = rig("form = 'step'").unwrap();
        assert_eq!(rig.shape("value"), &ScalarShape::of(Unit::METRE.per_second()).into());
        for _ in 0..3 {
            rig.step();
            assert_eq!((rig.freshness("value"), rig.get::<Scalar>("value")), (Freshness::New, Some(&1.0)));
            assert!(rig.mark("value").stamp().is_timeless());
        }
    }

    #[test]
    fn what_a_form_needs_and_what_it_has_no_use_for() {
        let cases: [(&str, &[&str]); 8] = [
            ("form = 'square'", &["expected `step`, `ramp`, `sine` or `chirp`, found the string \"square\""]),
            ("form = 'ramp'", &["`duration` is missing: a ramp needs it"]),
            ("form = 'sine'", &["`frequency` is missing: a sine needs it"]),
            ("form = 'chirp'\nduration = 1.0\nfrequency = 1.0", &["`end_frequency` is missing: a chirp needs it"]),
            ("form = 'step'\nfrequency = 1.0", &["a step has no `frequency`"]),
            ("form = 'sine'\nfrequency = 1.0\nend_frequency = 2.0", &["a sine has no `end_frequency`"]),
            ("form = 'sine'\nfrequency = 501.0", &["`frequency` is above half of the graph's rate: 500 Hz at most"]),
            ("form = 'step'\nstart = -1.0", &["expected a number, 0 or more, found -1"]),
        ];
        for (params, expected) in cases {
            let mistakes = rig(params).err().unwrap();
            let messages: Vec<&str> = mistakes.iter().map(|mistake| mistake.message.as_str()).collect();
            assert_eq!(messages, expected, "{params}");
        }
    }
}
