//! `contact_limit`: only the motion into the object is limited.
//!
//! At the point (x, y) of the pad, with z pointing out of the pad toward the object, the pad approaches the object at
//! vz + wx y - wy x. The point is the centre of gravity of the whole image for `force`, and the highest tactel for
//! `peak`. The excess is subtracted from vz: a roll then goes on about the contact.

use tactflow_runtime::node::{
    Describe, In, Inputs, Limits, Mistake, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick,
};
use tactflow_runtime::signal::{Image, ImageShape, Scalar, Stamp, Twist};

use super::{fraction, max_age};
use crate::motion::bounds::countable;

/// Stops the motion into an object when the force or a single tactel reaches its ceiling.
///
/// There are two ceilings: `force` for the sum of the whole image, and `peak` for its highest tactel. From the fraction
/// `begin` of a ceiling on the approach is slowed down linearly, and at the ceiling it is zero. The way out is always
/// free, and a roll goes on about the contact. The approach is the speed at the contact, vz + wx y - wy x with z pointing
/// out of the pad: at the centre of gravity for `force`, and at the highest tactel for `peak`.
///
/// It reads the whole image, because an object outside the selected region presses on the pad too. Negative tactels do
/// not count. When the image is older than `max_age_ms` the output is absent: a blind sensor does not move.
///
/// It does not predict the force that a stiff object adds while the motion brakes, which is about the stiffness times
/// the braking distance. For hard objects use a lower `begin` or a lower `approach_m_per_s`.
///
/// The ceilings are in the unit of the image. For an image of pressures the sum is not a force.
///
/// ```toml
/// [nodes.contact_limit]
/// type = "contact_limit"
/// in.twist = "bumpless.twist"
/// in.image = "calibrate.image"
/// force = 15.0                        # [N]
/// peak = 3.0                          # [N]
/// approach_m_per_s = 0.05
/// ```
#[derive(Describe)]
#[describe(name = "contact_limit", every_tick)]
pub struct ContactLimit {
    shape: ImageShape,
    force: f64,
    peak: f64,
    begin: f64,
    approach: f64,
    /// Maximum age of the image [ns].
    max_age: i64,
}

/// Parameters of `contact_limit`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Ceiling of the sum of the whole image.
    #[param(unit = "U", above = 0.0)]
    force: f64,
    /// Ceiling of a single tactel.
    #[param(unit = "U", above = 0.0)]
    peak: f64,
    /// Fraction of a ceiling at which the approach begins to slow down; with 1 it stops at the ceiling at once.
    #[param(unit = "1", range = 0.0..=1.0, default = 0.5)]
    begin: f64,
    /// Maximum speed of the approach at `begin`.
    #[param(unit = "m/s", above = 0.0)]
    approach_m_per_s: f64,
    /// Maximum age of the image; five periods of the graph if not given.
    #[param(unit = "ms", above = 0.0)]
    max_age_ms: Option<f64>,
}

/// What `contact_limit` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Twist of the sensor's origin, in the sensor's frame.
    #[port(frame = "A")]
    twist: In<'a, Twist>,
    /// The whole calibrated image.
    #[port(unit = "U", frame = "A", sampled)]
    image: In<'a, Image>,
}

/// What `contact_limit` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The same motion with a limited approach.
    #[port(frame = "A")]
    twist: Out<Twist>,
    /// Fraction of the approach that passes under the ceiling of the sum.
    #[port(unit = "1", frame = "_")]
    force: Out<Scalar>,
    /// Fraction of the approach that passes under the ceiling of a tactel.
    #[port(unit = "1", frame = "_")]
    peak: Out<Scalar>,
}

/// What `contact_limit` remembers.
#[derive(State)]
pub struct State {
    /// Stamp of the image that `load` was computed from, if there was one.
    stamp: Option<Stamp>,
    /// Load of that image.
    load: Load,
}

/// The load on the pad.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Load {
    /// Sum of the tactels [unit of the image].
    pub sum: f64,
    /// Centre of gravity of the tactels [m].
    pub centre: [f64; 2],
    /// Value of the highest tactel [unit of the image].
    pub peak: f64,
    /// Position of the highest tactel [m].
    pub place: [f64; 2],
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
        if params.peak > params.force {
            let message = "`peak` is greater than `force`, which a single tactel cannot reach";
            return Err(Mistake::param("peak", message).help("let `peak` be at most `force`").into());
        }
        (setup.outputs.force, setup.outputs.peak) = (fraction(), fraction());
        Ok(Self {
            shape: setup.inputs.image.clone(),
            force: params.force,
            peak: params.peak,
            begin: params.begin,
            approach: params.approach_m_per_s,
            max_age: max_age(params.max_age_ms, setup.period),
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
            state.stamp = Some(stamp);
            state.load = load(&self.shape, &inputs.image, [self.begin * self.force, self.begin * self.peak]);
        }
        let (load, mut twist) = (&state.load, countable(&inputs.twist));
        let force = bar(&mut twist, load.centre, load.sum / self.force, self.begin, self.approach);
        let peak = bar(&mut twist, load.place, load.peak / self.peak, self.begin, self.approach);
        out.twist.set(twist);
        // A NaN in the image makes the fraction NaN, which ends the run.
        out.force.set(force + 0.0 * load.sum);
        out.peak.set(peak + 0.0 * load.peak);
    }
}

/// Limits the approach at a point whose load is `times` its ceiling. Returns the fraction of the approach that passes.
///
/// The allowed speed falls linearly from `approach` [m/s], at the fraction `begin` of the ceiling, to 0 at the ceiling.
pub fn bar(twist: &mut Twist, [x, y]: [f64; 2], times: f64, begin: f64, approach: f64) -> f64 {
    if times < begin || times <= 0.0 {
        return 1.0;
    }
    let allowed = if times < 1.0 { approach * (1.0 - times) / (1.0 - begin) } else { 0.0 };
    let [_, _, vz, wx, wy, _] = twist.0.into();
    let speed = vz + wx * y - wy * x;
    if speed <= allowed {
        return 1.0;
    }
    twist.0[2] -= speed - allowed;
    allowed / speed
}

/// Returns the load of an image; its sum is NaN if a tactel is.
///
/// The positions are computed only if the sum and the peak are at least those in `from`, and are 0 otherwise.
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

/// Returns the load of a tactel, 0 if it is negative. Unlike `max`, it keeps a NaN.
fn pressed(cell: f32) -> f64 {
    f64::from(if cell < 0.0 { 0.0 } else { cell })
}

/// Returns the sum and the maximum of the tactels, in eight lanes and a fixed order: the same bits on every machine.
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
