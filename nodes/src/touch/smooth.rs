//! `smooth`: the mean of the newest samples of a feature (paper section V: of force and orientation, over ten).
//!
//! An axis has no arithmetic mean, as 89 and -89 degrees are neighbours: the mean is taken of (cos 2a, sin 2a), and
//! halved by one arctangent. Axes that cancel each other have no mean; then there is none.
//!
//! The window is a number of samples, or a time that ends with the stamp of the newest. It is summed anew in each step,
//! from its oldest sample to its newest: no drift, and what has left the window leaves no trace.

use tactflow_runtime::node::{Count, Mistake, Mistakes, Node, Positive, Setup, Tick};
use tactflow_runtime::signal::Stamp;
use tactflow_runtime::{inputs, outputs, params, state};

use crate::motion::axis::{doubled, halved};

params! {
    /// Number of samples in the mean, and of fewer, as long as there are fewer; 10 if no window is given [samples].
    window: Option<Count>,
    /// The samples of this time before the newest are in the mean, instead of a number of them [ms].
    window_ms: Option<Positive>,
}

inputs! {
    /// Any feature.
    value: Scalar["U", "A"],
}

outputs! {
    /// Its mean over the window; absent for axes that cancel each other.
    value: Scalar["U", "A"],
}

state! {
    /// The newest samples in a ring; of an axis cosine and sine of its double, else the value and zero.
    ring: Vec<[f64; 2]>,
    /// When each of them was taken [ns]; empty for a window of so many samples.
    times: Vec<i64>,
    /// Device that took them.
    device: u16,
    /// Where the next sample goes.
    next: usize,
    /// Number of samples in the window.
    count: usize,
}

/// Samples in the window if none is given, as in the paper.
const WINDOW: usize = 10;
/// Most samples in a window of time.
const MOST: f64 = 100_000.0;

/// The window, and whether the feature is an axis.
pub struct Smooth {
    /// Most samples in the window.
    room: usize,
    /// Its length [ns]; none if it is a number of samples.
    time: Option<i64>,
    is_axial: bool,
}

impl tactflow_runtime::node::Describe for Smooth {
    const NAME: &'static str = "smooth";
    const SUMMARY: &'static str = "smooths a feature: the mean over the newest samples, or over a time";
    const DOC: &'static str = "The mean of the last samples (a moving average), as the paper takes it of force and orientation over ten \
        (section V). Of fewer, as long as there are fewer. Each sample counts once, however long it is held.\n\n\
        **The window** is a number of samples, `window`, or a time, `window_ms`; not both. A time means the same at \
        every rate: the samples that are less than `window_ms` older than the newest count, by their stamps, however \
        irregularly they come, so 40 ms are ten samples at 250 Hz. The newest always counts, so a window shorter \
        than the time between two samples lets them pass as they are. There is room for twice as many samples as come at \
        the graph's nominal rate; if more come, the oldest are left out and the window is shorter. Times of two \
        devices are never compared: when another device took the sample, the window starts anew.\n\n\
        **Axes.** The direction of a line (`rad mod pi`) has no arithmetic mean, as 89° and -89° are neighbours. The mean \
        is taken of (cos 2a, sin 2a) instead: over ten samples near 90° with 3° of noise it is off by 0.65°, the \
        arithmetic mean by 72°. Axes that cancel each other have no mean: the output is absent.\n\n\
        **Lag.** The mean is as old as the middle of the window, half of `window_ms`, though its stamp is that of the \
        newest sample. A `one_pole` with half of that time for a constant has the same lag and leaves the same noise; a \
        `median` takes out single wrong samples.\n\n\
        Absence makes the output absent. The window is kept through a flicker and forgotten after `reset_after_ms`.";
    const EXAMPLE: &'static str = r#"
[nodes.smooth]
type = "smooth"
in.value = "moments.pressure"
window_ms = 40                      # ten frames at 250 Hz [ms]
"#;
}

impl Node for Smooth {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let is_axial = setup.inputs.value.unit.is_axial();
        setup.outputs.value.range = setup.inputs.value.range;
        let (room, time) = match (params.window, params.window_ms) {
            (window, None) => (window.map_or(WINDOW, |window| *window), None),
            (None, Some(ms)) => {
                let samples = *ms * 1e-3 / setup.period;
                if samples > MOST {
                    let message = format!("{} ms hold more than {MOST} samples at the graph's rate", *ms);
                    return Err(Mistake::param("window_ms", message)
                        .help("take a `one_pole`, which needs no room")
                        .into());
                }
                (2 * samples.ceil() as usize + 1, Some((*ms * 1e6).round() as i64))
            }
            (Some(_), Some(_)) => {
                let mistake = Mistake::key("window_ms", "a window is a number of samples or a time, not both");
                return Err(mistake.help("leave out `window` or `window_ms`").into());
            }
        };
        Ok(Self { room, time, is_axial })
    }

    fn state(&self) -> State {
        let times = if self.time.is_some() { vec![0; self.room] } else { Vec::new() };
        State { ring: vec![[0.0; 2]; self.room], times, device: u16::MAX, next: 0, count: 0 }
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let value = *inputs.value;
        if let Some(time) = self.time {
            state.stamp(inputs.value.stamp(), tick.now, time);
        }
        if !self.is_axial {
            state.push([value, 0.0]);
            out.value.set(state.mean()[0]);
            return;
        }
        state.push(doubled(value));
        if let Some(mean) = halved(state.mean()) {
            out.value.set(mean);
        }
    }
}

impl State {
    fn push(&mut self, sample: [f64; 2]) {
        self.ring[self.next] = sample;
        self.next = if self.next + 1 < self.ring.len() { self.next + 1 } else { 0 };
        self.count = (self.count + 1).min(self.ring.len());
    }

    /// Notes when the sample that comes next was taken, and lets go of those that are `time` [ns] older or more.
    fn stamp(&mut self, stamp: Stamp, now: i64, time: i64) {
        if stamp.device != self.device {
            (self.device, self.count) = (stamp.device, 0);
        }
        // The place of the oldest is taken by the newest, if there is no other.
        self.count = self.count.min(self.ring.len() - 1);
        let nanos = if stamp.is_timeless() { now } else { stamp.nanos };
        self.times[self.next] = nanos;
        while self.count > 0 && nanos.saturating_sub(self.times[self.oldest()]) >= time {
            self.count -= 1;
        }
    }

    /// Where the oldest sample of the window is, or the next one if it is empty.
    fn oldest(&self) -> usize {
        if self.next >= self.count { self.next - self.count } else { self.next + self.ring.len() - self.count }
    }

    fn mean(&self) -> [f64; 2] {
        let oldest = self.oldest();
        let end = (oldest + self.count).min(self.ring.len());
        let (older, newer) = (&self.ring[oldest..end], &self.ring[..self.count - (end - oldest)]);
        let count = self.count as f64;
        let sum = add_up(older, newer, |sample| sample);
        if sum[0].is_finite() {
            return sum.map(|sum| sum / count);
        }
        // Samples so large that their sum is none.
        add_up(older, newer, |sample| sample / count).map(|mean| mean.clamp(f64::MIN, f64::MAX))
    }
}

/// Sums of both parts of the ring.
fn add_up(older: &[[f64; 2]], newer: &[[f64; 2]], scaled: impl Fn(f64) -> f64) -> [f64; 2] {
    let mut sum = [0.0; 2];
    for samples in [older, newer] {
        for [a, b] in samples {
            sum = [sum[0] + scaled(*a), sum[1] + scaled(*b)];
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::node::At;
    use tactflow_runtime::signal::{Freshness, Scalar, ScalarShape, Unit};

    use super::*;

    fn rig(window: usize, unit: Unit) -> NodeRig {
        let params = format!("window = {window}");
        NodeRig::new::<Smooth>(&params, &[("value", ScalarShape::of(unit).into())]).unwrap()
    }

    fn show(rig: &mut NodeRig, value: f64) -> Option<f64> {
        rig.set("value", value);
        rig.step();
        rig.get::<Scalar>("value").copied()
    }

    #[test]
    fn the_mean_is_of_as_many_as_there_are() {
        let mut rig = rig(3, Unit::NEWTON);
        for (value, mean) in [(3.0, 3.0), (5.0, 4.0), (-2.0, 2.0), (3.0, 2.0), (8.0, 3.0), (1e300, 1e300 / 3.0)] {
            assert_eq!(show(&mut rig, value), Some(mean), "{value}");
        }
        for (value, mean) in [(1.0, 1e300 / 3.0), (1.0, 1e300 / 3.0), (4.0, 2.0)] {
            assert_eq!(show(&mut rig, value), Some(mean), "what has left leaves no trace");
        }
    }

    #[test]
    fn the_mean_of_axes_is_an_axis() {
        let cases: [(&[f64], Option<f64>); 8] = [
            (&[30.0], Some(30.0)),
            (&[89.0, -89.0], Some(90.0)),
            (&[80.0, -70.0], Some(-85.0)),
            (&[10.0, -10.0], Some(0.0)),
            (&[-90.0, 90.0], Some(90.0)),
            (&[45.0, -45.0], None),
            (&[0.0, 60.0, -60.0], None),
            (&[0.0, 90.0, 20.0], Some(20.0)),
        ];
        for (degrees, mean) in cases {
            let mut rig = rig(10, Unit::AXIAL);
            let last = degrees.iter().map(|angle| show(&mut rig, angle.to_radians())).last().unwrap();
            let near = |(a, b): (f64, f64)| (a.to_degrees() - b).abs() < 1e-12;
            assert!(last.zip(mean).map_or(last == mean, near), "{degrees:?}: {last:?}");
        }
        let mut turning = rig(2, Unit::RADIAN);
        show(&mut turning, 3.0);
        assert_eq!(show(&mut turning, -3.0), Some(0.0), "only an axis is wrapped");
    }

    #[test]
    fn a_held_value_counts_once_and_a_flicker_forgets_nothing() {
        let mut rig = rig(4, Unit::NEWTON);
        show(&mut rig, 1.0);
        rig.step();
        assert_eq!((rig.get::<Scalar>("value"), rig.freshness("value")), (Some(&1.0), Freshness::Held));
        assert_eq!(show(&mut rig, 3.0), Some(2.0));
        rig.lose("value");
        rig.step();
        assert_eq!(rig.get::<Scalar>("value"), None);
        assert_eq!(show(&mut rig, 5.0), Some(3.0));
        rig.lose("value");
        rig.step_ms(20.0);
        rig.step();
        assert_eq!(show(&mut rig, 7.0), Some(7.0), "a lasting absence does");
    }

    fn built(params: &str) -> Result<NodeRig, Mistakes> {
        NodeRig::new::<Smooth>(params, &[("value", ScalarShape::of(Unit::NEWTON).into())])
    }

    #[test]
    fn windows_that_are_none_are_refused() {
        for bad in ["window = 0", "window_ms = 0", "window_ms = -1.0", "window = 2.5", "window_ms = \"40 ms\""] {
            assert!(built(bad).is_err(), "{bad}");
        }
        let both = built("window = 10\nwindow_ms = 40").err().unwrap();
        assert_eq!(both[0].at, At::Key("window_ms".into()));
        assert_eq!(both[0].message, "a window is a number of samples or a time, not both");
        assert!(built("window_ms = 100000").is_ok(), "100000 samples of 1 ms");
        let long = built("window_ms = 100001").err().unwrap();
        assert_eq!(long[0].message, "100001 ms hold more than 100000 samples at the graph's rate");
    }

    #[test]
    fn without_a_word_the_window_is_ten_samples() {
        let mut rig = built("").unwrap();
        let last = (0..30).map(|k| show(&mut rig, f64::from(k))).last().unwrap();
        assert_eq!(last, Some(24.5));
    }

    /// The mean after each sample; each is a time [ms], a device and a value.
    fn timed(params: &str, samples: &[(f64, u16, f64)]) -> Vec<f64> {
        let mut rig = built(params).unwrap();
        let mean = |(ms, device, value): &(f64, u16, f64)| {
            let stamp = Stamp { nanos: (ms * 1e6) as i64, device: *device };
            rig.edit("value", stamp, |old: &mut Scalar| *old = *value);
            rig.step_ms(0.01);
            *rig.get::<Scalar>("value").unwrap()
        };
        samples.iter().map(mean).collect()
    }

    #[test]
    fn a_window_of_time_ends_with_the_newest_stamp() {
        let samples = [(0.0, 1, 1.0), (4.0, 1, 3.0), (8.0, 1, 5.0), (11.9, 1, 7.0), (12.0, 1, 9.0), (100.0, 1, 2.0)];
        let means = timed("window_ms = 8", &samples);
        assert_eq!(means, [1.0, 2.0, 4.0, 5.0, 7.0, 2.0], "the one of 8 ms ago is out");
        assert_eq!(timed("window_ms = 0.5", &samples), [1.0, 3.0, 5.0, 7.0, 8.0, 2.0]);
        let devices = [(0.0, 1, 1.0), (1.0, 1, 3.0), (2.0, 2, 8.0), (3.0, 2, 4.0)];
        assert_eq!(timed("window_ms = 50", &devices), [1.0, 2.0, 8.0, 6.0], "times of two devices");
        let back = [(5.0, 1, 1.0), (4.0, 1, 3.0), (20.0, 1, 8.0)];
        assert_eq!(timed("window_ms = 10", &back), [1.0, 2.0, 8.0]);
    }

    #[test]
    fn more_samples_than_there_is_room_for_make_the_window_shorter() {
        // 5 ms at the rig's 1 ms a tick: room for eleven.
        let samples: Vec<_> = (0..100).map(|k| (0.1 * f64::from(k), 1, f64::from(k))).collect();
        assert_eq!(timed("window_ms = 5", &samples).last(), Some(&94.0), "the mean of 89 to 99");
    }

    #[test]
    fn the_mean_of_what_is_finite_is_finite() {
        let mut rig = rig(3, Unit::NEWTON);
        let last = (0..3).map(|_| show(&mut rig, f64::MAX)).last().unwrap();
        assert!((last.unwrap() / f64::MAX - 1.0).abs() < 1e-15);
    }

    proptest! {
        #[test]
        fn only_the_window_matters(values in prop::collection::vec(-1e3..1e3f64, 1..60), window in 1..12usize) {
            let mut rig = rig(window, Unit::NEWTON);
            for last in 0..values.len() {
                let newest = &values[(last + 1).saturating_sub(window)..=last];
                let mean = newest.iter().fold(0.0, |sum, value| sum + value) / newest.len() as f64;
                prop_assert_eq!(show(&mut rig, values[last]), Some(mean));
            }
        }

        #[test]
        fn only_the_samples_of_the_time_matter(
            steps in prop::collection::vec((1..30_000u32, -1e3..1e3f64), 1..60),
            window_us in 1..40_000u32,
        ) {
            let mut now = 0;
            let samples: Vec<(i64, f64)> = steps.iter().map(|(us, value)| {
                now += i64::from(*us);
                (now, *value)
            }).collect();
            let params = format!("window_ms = {}", f64::from(window_us) / 1e3);
            let mut rig = built(&params).unwrap();
            let room = 2 * (f64::from(window_us) / 1e3).ceil() as usize + 1;
            for (i, (now, value)) in samples.iter().enumerate() {
                let stamp = Stamp { nanos: now * 1000, device: 0 };
                rig.edit("value", stamp, |old: &mut Scalar| *old = *value);
                rig.step();
                let counting: Vec<f64> = samples[..=i]
                    .iter()
                    .filter(|(then, _)| now - then < i64::from(window_us))
                    .map(|(_, value)| *value)
                    .collect();
                let newest = &counting[counting.len().saturating_sub(room)..];
                let mean = newest.iter().fold(0.0, |sum, value| sum + value) / newest.len() as f64;
                prop_assert_eq!(rig.get::<Scalar>("value"), Some(&mean));
                rig.step();
                prop_assert_eq!(rig.get::<Scalar>("value"), Some(&mean), "what is held counts once");
            }
        }

        #[test]
        fn turning_every_axis_turns_the_mean(axes in prop::collection::vec(-0.5..0.5f64, 1..10), turn in -10.0..10.0f64) {
            let mean = |turn: f64| {
                let mut rig = rig(10, Unit::AXIAL);
                axes.iter().map(|axis| show(&mut rig, axis + turn)).last().unwrap().unwrap()
            };
            let turned = mean(turn) - mean(0.0) - turn;
            prop_assert!(libm::sin(turned).abs() < 1e-12, "off by {turned}");
        }
    }
}
