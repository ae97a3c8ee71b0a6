//! `contact_limit`: ceilings on the force of the whole image and on its highest tactel. They bar the way in alone.
//!
//! At a point (x, y) of the pad, with z out of it toward the object, the pad goes toward the object at the speed
//! vz + wx y - wy x. For the force that point is the centre of gravity of the whole image, for the peak the highest
//! tactel. From `begin` of a ceiling on that speed is limited, to zero at the ceiling and above, linearly; what is too
//! much is taken off vz, so a roll goes on about the contact, and the way out is always free.
//!
//! It reads the whole image and no chosen region: an object at the rim presses as hard as one in the middle. Without a
//! fresh image there is no motion.

use tactflow_runtime::node::{Limits, Mistake, Mistakes, Node, Positive, Ratio, Setup, Tick};
use tactflow_runtime::signal::{Image, ImageShape, ScalarShape, Stamp, Twist, Unit};
use tactflow_runtime::{inputs, outputs, params, state};

use crate::motion::bounds::countable;

params! {
    /// Ceiling of the whole image's sum [unit of the image].
    force: Positive,
    /// Ceiling of a single tactel [unit of the image].
    peak: Positive,
    /// Share of a ceiling from which on the way in is slowed down; 1 bars it only at the ceiling [1].
    begin: Ratio = Ratio(0.5),
    /// Greatest speed of the way in at `begin` [m/s].
    approach_m_per_s: Positive,
    /// Greatest age of the image; five periods of the graph unless given [ms].
    max_age_ms: Option<Positive>,
}

inputs! {
    /// Twist of the sensor's origin, in the sensor's frame [m/s, rad/s].
    twist: Twist["A"],
    /// The whole image, calibrated.
    image: Sampled<Image["U", "A"]>,
}

outputs! {
    /// The same motion, but for what goes too far in [m/s, rad/s].
    twist: Twist["A"],
    /// Share of the way in that the ceiling of the sum lets pass [1].
    force: Scalar["1"],
    /// Share of the way in that the ceiling of a tactel lets pass [1].
    peak: Scalar["1"],
}

state! {
    /// Stamp of the image that was summed up, if one was.
    stamp: Option<Stamp>,
    /// What it says.
    load: Load,
}

/// What presses on the pad.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Load {
    /// Sum of what presses [unit of the image].
    pub sum: f64,
    /// Its centre [m].
    pub centre: [f64; 2],
    /// The highest tactel [unit of the image].
    pub peak: f64,
    /// Its place [m].
    pub place: [f64; 2],
}

/// The ceilings and the pad.
pub struct ContactLimit {
    shape: ImageShape,
    force: f64,
    peak: f64,
    begin: f64,
    approach: f64,
    max_age: i64,
}

impl tactflow_runtime::node::Describe for ContactLimit {
    const NAME: &'static str = "contact_limit";
    const SUMMARY: &'static str = "bars the way into an object when the force or a single tactel is at its ceiling";
    const DOC: &'static str = "Two ceilings: `force` on the sum of the whole image and `peak` on its highest tactel. From \
        `begin` of a ceiling on the way in is slowed down, and at the ceiling it is barred; the way out is always free, \
        and a roll goes on about the contact. What counts is the speed at the contact, vz + wx y - wy x with z out of \
        the pad, at the centre of gravity for the force and at the highest tactel for the peak.\n\n\
        It reads the whole image, since what presses beside the chosen region presses too. When the image is older \
        than `max_age_ms` there is no motion: a blind sensor does not move. Negative tactels do not count.\n\n\
        It does not foresee what a stiff object adds while the motion brakes: about the stiffness times the way of a \
        stop. Against hard objects take a lower `begin` or a smaller `approach_m_per_s`.\n\n\
        The ceilings are in the unit of the image; on pressures the sum is no force.";
    const EXAMPLE: &'static str = r#"
[nodes.contact_limit]
type = "contact_limit"
in.twist = "bumpless.twist"
in.image = "calibrate.image"
force = 15.0                        # [N]
peak = 3.0                          # [N]
approach_m_per_s = 0.05
"#;
    const EVERY_TICK: bool = true;
}

impl Node for ContactLimit {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    // The image and its age move on while a motion is held.
    const LIMITS: Limits =
        Limits { through: Some("twist"), holds: &["force", "peak"], breaks: &["workspace", "speed", "acceleration"] };

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        if *params.peak > *params.force {
            let message = "no tactel reaches a `peak` that is greater than the `force` of all";
            return Err(Mistake::param("peak", message).help("let `peak` be at most `force`").into());
        }
        let share = ScalarShape::of(Unit::ONE).within(0.0, 1.0);
        (setup.outputs.force, setup.outputs.peak) = (share.clone(), share);
        let max_age = params.max_age_ms.map_or(5.0 * setup.period, |age| *age * 1e-3);
        Ok(Self {
            shape: setup.inputs.image.clone(),
            force: *params.force,
            peak: *params.peak,
            begin: *params.begin,
            approach: *params.approach_m_per_s,
            max_age: (max_age * 1e9) as i64,
        })
    }

    fn state(&self) -> State {
        State { stamp: None, load: Load::default() }
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let stamp = inputs.image.stamp();
        if stamp.age(tick.now) > self.max_age {
            return;
        }
        if inputs.image.is_new() || state.stamp != Some(stamp) {
            (state.stamp, state.load) =
                (Some(stamp), load(&self.shape, &inputs.image, [self.begin * self.force, self.begin * self.peak]));
        }
        let (load, mut twist) = (&state.load, countable(&inputs.twist));
        let force = bar(&mut twist, load.centre, load.sum / self.force, self.begin, self.approach);
        let peak = bar(&mut twist, load.place, load.peak / self.peak, self.begin, self.approach);
        out.twist.set(twist);
        // What is no number in the image is none here either, and ends the run.
        out.force.set(force + 0.0 * load.sum);
        out.peak.set(peak + 0.0 * load.peak);
    }
}

/// Limits the way in at a point that bears so many `times` its ceiling, to at most `approach` [m/s] where it begins; the
/// share of it that passes.
pub fn bar(twist: &mut Twist, [x, y]: [f64; 2], times: f64, begin: f64, approach: f64) -> f64 {
    if times < begin || times <= 0.0 {
        return 1.0;
    }
    let allowed = if times < 1.0 { approach * (1.0 - times) / (1.0 - begin) } else { 0.0 };
    let [_, _, vz, wx, wy, _] = twist.0.into();
    let way_in = vz + wx * y - wy * x;
    if way_in <= allowed {
        return 1.0;
    }
    twist.0[2] -= way_in - allowed;
    allowed / way_in
}

/// Sums an image up. What is no number makes the sum none. The places are worked out only of what is at least as much as
/// `from`: a sum, and a peak.
#[must_use]
pub fn load(shape: &ImageShape, image: &Image, from: [f64; 2]) -> Load {
    let (sum, peak) = weigh(image.cells());
    let mut load = Load { sum, peak, ..Load::default() };
    let rows = || image.cells().chunks(shape.cols).enumerate();
    if sum >= from[0] && sum > 0.0 {
        let mut moments = [0.0; 2];
        for (i, row) in rows() {
            let (mut force, mut moment) = (0.0, 0.0);
            for (j, cell) in row.iter().enumerate() {
                let value = pressed(*cell);
                force += value;
                moment += value * shape.x(j as f64);
            }
            moments = [moments[0] + moment, moments[1] + force * shape.y(i as f64)];
        }
        load.centre = moments.map(|moment| moment / sum);
    }
    if peak >= from[1] && peak > 0.0 {
        let highest = |(i, row): (usize, &[f32])| Some((i, row.iter().position(|cell| f64::from(*cell) == peak)?));
        let place = rows().find_map(highest).map(|(i, j)| [shape.x(j as f64), shape.y(i as f64)]);
        load.place = place.unwrap_or_default();
    }
    load
}

/// What a tactel bears. Not `max`, which takes what is no number for nothing.
fn pressed(cell: f32) -> f64 {
    f64::from(if cell < 0.0 { 0.0 } else { cell })
}

/// Sum and greatest of what the tactels bear, in eight lanes and a fixed order: the same bits on every machine.
fn weigh(cells: &[f32]) -> (f64, f64) {
    let (mut sums, mut peaks) = ([0.0_f64; 8], [0.0_f32; 8]);
    let mut add = |lane: usize, cell: f32| {
        sums[lane] += pressed(cell);
        peaks[lane] = if cell > peaks[lane] { cell } else { peaks[lane] };
    };
    let (chunks, rest) = cells.as_chunks::<8>();
    for chunk in chunks {
        for (lane, cell) in chunk.iter().enumerate() {
            add(lane, *cell);
        }
    }
    for (lane, cell) in rest.iter().enumerate() {
        add(lane, *cell);
    }
    let peak = peaks.into_iter().fold(0.0, |a: f32, b| if b > a { b } else { a });
    (sums.into_iter().sum(), f64::from(peak))
}
