//! Frames that are no measurement: garbage, and an image that the sensor repeats.
//!
//! The sum and the peak of the whole image stand for it, as `tactile_source` has computed them already: no pass over the
//! tactels is needed. With noise, two images with the same sum and the same peak are the same image, except by a chance
//! of about one in a hundred.

use tactflow_runtime::node::{At, Mistake, State};
use tactflow_runtime::source::Code;

use super::rest::{Rest, Verdict};
use super::sums::Sums;
use super::{Inputs, InputsShapes, Params};

/// Number of frames in a row with one image from which on a pad with noise counts as blind: its image is absent.
const BLIND: u32 = 3;
/// Number of frames in a row with one image from which on it is stuck: the task ends.
const STUCK: u32 = 25;
/// Without a `max_rise`: a jump by that many times the range of the sums so far is garbage [1].
const LEAP: f64 = 8.0;
/// The range of the sums from which on it counts, as a multiple of the noise of a tactel times their number: that of a
/// contact. Noise that all tactels share, and zeros that drift, stay below it [1].
const FELT: f64 = 2.0;

/// Which frames are dropped.
#[derive(Debug, Clone, Copy)]
pub(super) struct FrameRules {
    /// Largest reading [unit of the input].
    max_reading: f64,
    /// Largest change of the sum from frame to frame [unit of the input]; `None` if it is learned.
    max_rise: Option<f64>,
}

/// What was seen of the frames so far.
#[derive(Debug, State)]
pub(super) struct Frames {
    /// Sum and peak of the last frame that counted.
    last: Option<[f64; 2]>,
    /// Number of frames in a row with them.
    repeats: u32,
    /// The sums after the self-test.
    sums: Sums,
    /// Whether the frame before was dropped because of its sum.
    was_odd: bool,
    /// Number of frames that were dropped.
    pub(super) dropped: u64,
}

/// What a frame is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Frame {
    Good,
    /// No measurement, or the same image again too often: nothing is known.
    Blind,
    /// The same image for so long that the sensor is stuck.
    Stuck,
}

impl Frames {
    /// Forgets the last frame. The number of frames that were dropped stays.
    pub(super) fn forget(&mut self) {
        *self = Self { dropped: self.dropped, ..Self::default() };
    }
}

impl FrameRules {
    /// Returns the rules, or `None` if no sum and no peak is wired.
    pub(super) fn new(params: &Params, inputs: &InputsShapes) -> Result<Option<Self>, Mistake> {
        let given = [("max_reading", params.max_reading), ("max_rise", params.max_rise)];
        if inputs.sum.is_some() && inputs.peak.is_some() {
            let max_reading = params.max_reading.unwrap_or(f64::INFINITY);
            return Ok(Some(Self { max_reading, max_rise: params.max_rise }));
        }
        let unfit = given.into_iter().find(|(_, value)| value.is_some());
        unfit.map_or(Ok(None), |(name, _)| {
            let message = format!("`{name}` needs `in.sum` and `in.peak`");
            let mistake = Mistake::new(Code::MissingInput, At::Param(name.into()), message);
            Err(mistake.help("wire them to `sum` and `peak` of the `tactile_source` before this node"))
        })
    }

    /// Judges a new frame of a pad that has passed the test `rest`, or is in it.
    ///
    /// A frame whose sum jumps is dropped, and one that follows it counts: an impact costs one frame.
    pub(super) fn judge(self, inputs: &Inputs<'_>, rest: &Rest, frames: &mut Frames) -> Frame {
        let (Some(sum), Some(peak)) = (&inputs.sum, &inputs.peak) else { return Frame::Good };
        let now = [**sum, **peak];
        let most = self.max_rise.unwrap_or_else(|| learned(inputs, rest, frames));
        let jumps = frames.last.is_some_and(|[last, _]| (now[0] - last).abs() > most);
        let is_odd = jumps && !frames.was_odd;
        if is_odd || now[1] > self.max_reading {
            (frames.was_odd, frames.dropped) = (is_odd, frames.dropped + 1);
            return Frame::Blind;
        }
        frames.repeats = if frames.last == Some(now) { frames.repeats + 1 } else { 1 };
        (frames.last, frames.was_odd) = (Some(now), false);
        if rest.verdict == Verdict::Passed {
            frames.sums.add(now[0]);
        }
        match frames.repeats {
            STUCK.. if rest.has_noise && rest.verdict == Verdict::Passed => Frame::Stuck,
            BLIND.. if rest.has_noise => Frame::Blind,
            _ => Frame::Good,
        }
    }
}

/// Returns the largest change of the sum that the contact so far explains. Without noise, or before a contact, nothing is
/// known.
fn learned(inputs: &Inputs<'_>, rest: &Rest, frames: &Frames) -> f64 {
    let tactels = inputs.image.as_ref().map_or(0, |image| image.cells().len());
    let (range, noise) = (frames.sums.range(), rest.noise * tactels as f64);
    if noise > 0.0 && range >= FELT * noise { LEAP * range } else { f64::INFINITY }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::{NodeRig, places};
    use tactflow_runtime::signal::{Image, ImageShape, ScalarShape, Shape, Unit};

    use super::super::Calibrate;

    /// Readings of four tactels at rest, which alternate.
    const REST: [[f32; 4]; 2] = [[99.0, 101.0, 99.0, 102.0], [101.0, 99.0, 101.0, 99.0]];

    fn make(params: &str, is_wired: bool) -> Result<NodeRig, tactflow_runtime::node::Mistakes> {
        let image: Shape = ImageShape { rows: 2, cols: 2, pitch: [0.005; 2], unit: Unit::RAW }.into();
        let raw = || Shape::from(ScalarShape::of(Unit::RAW));
        let wires = [("image", image), ("sum", raw()), ("peak", raw())];
        let wires = if is_wired { &wires[..] } else { &wires[..1] };
        NodeRig::new::<Calibrate>(&format!("offset = 100.0\n{params}"), wires)
    }

    /// Shows a frame. Returns whether there is an image.
    fn show(rig: &mut NodeRig, cells: [f32; 4]) -> bool {
        rig.set("image", Image::from_cells(2, &cells));
        rig.set("sum", cells.iter().map(|cell| f64::from(*cell)).sum::<f64>());
        rig.set("peak", cells.iter().copied().map(f64::from).fold(f64::MIN, f64::max));
        rig.step_ms(4.0);
        rig.get::<Image>("image").is_some()
    }

    /// A pad with noise after its self-test, and whether the next frame at rest is an even one.
    fn tested() -> NodeRig {
        let mut rig = make("rest_frames = 8\nmax_reading = 4095.0\nmax_rise = 500.0", true).unwrap();
        let shown: Vec<bool> = (0..8).map(|i| show(&mut rig, REST[i % 2])).collect();
        assert_eq!(shown, [false, false, false, false, false, false, false, true], "the image of the last frame");
        rig
    }

    #[test]
    fn garbage_is_dropped_and_an_impact_costs_one_frame() {
        let mut rig = tested();
        assert!(!show(&mut rig, [4000.0; 4]), "the sum jumps");
        assert!(show(&mut rig, REST[1]), "what follows is as before");
        assert!(!show(&mut rig, [100.0, 5000.0, 100.0, 100.0]) && !show(&mut rig, [5000.0; 4]), "no reading");
        assert!(show(&mut rig, REST[0]));
        let hit = [[300.0, 300.0, 300.0, 300.0], [320.0, 300.0, 300.0, 300.0]];
        assert!(!show(&mut rig, hit[0]) && show(&mut rig, hit[1]), "a hit");
        assert_eq!(rig.get::<Image>("image").unwrap().cells(), [220.0, 200.0, 200.0, 200.0]);
        assert!(rig.found().unwrap().ends_with("; 4 frames dropped as garbage"), "{:?}", rig.found());
    }

    #[test]
    fn garbage_does_not_change_a_zero() {
        let mut rig = make("rest_frames = 8\ntare_bound = 50.0\nmax_reading = 4095.0\nmax_rise = 500.0", true).unwrap();
        for i in 0..4 {
            show(&mut rig, REST[i % 2]);
        }
        assert!(!show(&mut rig, [4095.0; 4]) && !show(&mut rig, [9000.0; 4]));
        let shown: Vec<bool> = (0..4).map(|i| show(&mut rig, REST[i % 2])).collect();
        assert_eq!(shown, [false, false, false, true], "the garbage is no frame of the test");
        assert!((rig.get::<f64>("shift").unwrap() - 0.5).abs() < 1e-6, "{:?}", rig.get::<f64>("shift"));
    }

    #[test]
    fn a_pad_with_noise_that_repeats_its_image_is_blind_and_then_stuck() {
        let mut rig = tested();
        let shown: Vec<bool> = (0..24).map(|_| show(&mut rig, REST[0])).collect();
        assert!(shown[0] && shown[1] && !shown[2..].iter().any(|is_shown| *is_shown), "{shown:?}");
        assert_eq!(rig.get::<bool>("failed"), Some(&false));
        assert!(show(&mut rig, REST[1]), "it was not stuck yet");
        for _ in 0..25 {
            show(&mut rig, REST[0]);
        }
        assert_eq!(rig.get::<bool>("failed"), Some(&true));
        assert!(rig.found().unwrap().contains("repeats its image bit for bit"), "{:?}", rig.found());
        assert!(!show(&mut rig, REST[1]), "it stays out of use");
    }

    #[test]
    fn a_coarse_pad_may_repeat_its_image() {
        let mut rig = make("rest_frames = 8", true).unwrap();
        for _ in 0..8 {
            show(&mut rig, [100.0; 4]);
        }
        assert!((0..100).all(|_| show(&mut rig, [100.0; 4])));
        let mut untested = make("", true).unwrap();
        assert!((0..100).all(|_| show(&mut untested, [100.0; 4])));
    }

    /// A pad without bounds after its self-test, pressed by 80: three sums in a row have been 401 or less, and 480 or more.
    fn pressed() -> NodeRig {
        let mut rig = make("rest_frames = 8", true).unwrap();
        (0..8).for_each(|i| _ = show(&mut rig, REST[i % 2]));
        assert!([401.0, 400.0, 401.0, 480.0, 481.0, 480.0, 481.0].into_iter().all(|sum| show(&mut rig, cells(sum))));
        rig
    }

    /// Four readings with this sum.
    fn cells(sum: f32) -> [f32; 4] {
        [sum / 4.0; 4]
    }

    #[test]
    fn without_a_bound_a_jump_by_eight_times_the_range_of_a_contact_is_garbage() {
        let mut rig = pressed();
        assert!(show(&mut rig, cells(481.0 + 632.0)) && show(&mut rig, cells(481.0)), "eight times 79");
        assert!(show(&mut rig, cells(482.0)) && show(&mut rig, cells(481.0)), "the range is 80");
        assert!(!show(&mut rig, cells(481.0 + 641.0)) && show(&mut rig, cells(481.0)), "more than eight times 80");
        assert!(!show(&mut rig, cells(-200.0)) && show(&mut rig, cells(480.0)), "downwards");
        assert!(!show(&mut rig, cells(2000.0)) && show(&mut rig, cells(2001.0)), "a blow costs one frame");
        assert!(rig.found().unwrap().ends_with("; 3 frames dropped as garbage"), "{:?}", rig.found());
    }

    #[test]
    fn without_a_bound_a_first_touch_is_no_garbage() {
        let mut rig = make("rest_frames = 8", true).unwrap();
        (0..8).for_each(|i| _ = show(&mut rig, REST[i % 2]));
        assert!(show(&mut rig, cells(4000.0)) && show(&mut rig, cells(8000.0)) && show(&mut rig, cells(30_000.0)));
    }

    #[test]
    fn garbage_does_not_change_the_bound_that_is_learned() {
        let mut rig = pressed();
        for sum in [480.0, 481.0, 480.0] {
            assert!(!show(&mut rig, cells(4000.0)) && show(&mut rig, cells(sum)), "single frames");
        }
        for _ in 0..2 {
            let pair = [4000.0, 4000.0, 481.0, 480.0].map(|sum| show(&mut rig, cells(sum)));
            assert_eq!(pair, [false, true, false, true], "the second one counts, and so the one after it jumps");
        }
        assert!(!show(&mut rig, cells(1200.0)) && show(&mut rig, cells(480.0)));
    }

    #[test]
    fn two_frames_of_garbage_before_a_contact_do_not_change_the_bound_that_is_learned() {
        let mut rig = make("rest_frames = 8", true).unwrap();
        (0..8).for_each(|i| _ = show(&mut rig, REST[i % 2]));
        let sums = [401.0, 4000.0, 4001.0, 400.0, 401.0, 400.0, 480.0, 481.0, 480.0];
        assert!(sums.into_iter().all(|sum| show(&mut rig, cells(sum))), "nothing is known before the contact");
        assert!(!show(&mut rig, cells(4000.0)) && show(&mut rig, cells(480.0)));
    }

    #[test]
    fn garbage_in_the_self_test_does_not_change_the_bound_that_is_learned() {
        let mut rig = make("rest_frames = 8", true).unwrap();
        for i in 0..8 {
            show(&mut rig, if i % 4 == 1 { cells(16_000.0) } else { REST[i % 2] });
        }
        assert!([401.0, 400.0, 401.0, 480.0, 481.0, 480.0].into_iter().all(|sum| show(&mut rig, cells(sum))));
        assert!(!show(&mut rig, cells(4000.0)) && show(&mut rig, cells(480.0)));
    }

    #[test]
    fn a_pad_without_noise_learns_no_bound() {
        let mut rig = make("rest_frames = 8", true).unwrap();
        (0..8).for_each(|_| _ = show(&mut rig, [100.0; 4]));
        assert!([480.0, 481.0, 482.0, 4000.0, 480.0].into_iter().all(|sum| show(&mut rig, cells(sum))));
    }

    #[test]
    fn bounds_without_the_sum_and_the_peak_are_refused() {
        for (name, value) in [("max_rise", "5.0"), ("max_reading", "4095.0")] {
            let params = format!("{name} = {value}");
            assert_eq!(places(&params, &make(&params, false)), [format!("missing-input: `{name}`")]);
        }
    }
}
