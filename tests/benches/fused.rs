//! The whole tick of `graphs/finger_press.toml` fused by hand: the same arithmetic in one function, without a graph.
//!
//! It calls the nodes' own kernels and keeps everything else in locals; it has no freshness, no marks, no units and no
//! modes, and it would have to be written again for the next task.

use std::hint::black_box;
use std::path::Path;

use nalgebra::Vector3;
use tactflow_nodes::arm::chain::Chain;
use tactflow_nodes::arm::{damped, joint_limits, model, mount::Mount, null_space};
use tactflow_nodes::limits::{blind_limit, bumpless, contact_limit, joint_limit, lost_contact, workspace_limit};
use tactflow_nodes::motion::adjoint::adjoint;
use tactflow_nodes::motion::axis::{half_angle, wrap_axial};
use tactflow_nodes::motion::bounds::{approach_twist, scale_twist};
use tactflow_nodes::servo::integral::integrate;
use tactflow_nodes::touch::{binarize::binarize, label, moments, tactile_source::sum_and_peak};
use tactflow_runtime::node::{FilePath, Tick};
use tactflow_runtime::signal::{Grid, Image, ImageShape, Joint, Mask, Pose, Regions, Signal, Twist};

const WINDOW: usize = 3;
const COLUMNS: [[f64; 6]; 4] = [
    [-1.0, 0.0, 0.0, 0.0, -20.0, 0.0],
    [0.0, -1.0, 0.0, 20.0, 0.0, 0.0],
    [0.0, 0.0, 0.0005, 0.0, 0.0, 0.0],
    [0.0, 0.0, 0.0, 0.0, 0.0, -1.0],
];
/// The control law of each feature.
struct Law {
    kp: f64,
    ki: f64,
    kd: f64,
    within: f64,
    bound: f64,
    limit: f64,
}

const P: Law = Law { kp: 0.5, ki: 0.0, kd: 0.0, within: f64::INFINITY, bound: 1.0, limit: f64::INFINITY };
const LAWS: [Law; 4] = [P, P, Law { ki: 0.1, within: 10.0, bound: 5.0, ..P }, P];
const BLIND: blind_limit::Bounds = blind_limit::Bounds { time: 20.0, way: 0.1, linear: 1.0, angular: 10.0 };
const LOSS: lost_contact::Times = lost_contact::Times { debounce: 20_000_000, wait: 500_000_000 };
const MANNER: lost_contact::Manner = lost_contact::Manner { retreat: 0.02, search: 0.005, half: [0.01778; 2] };
/// The way of an approach at 10 mm/s that goes on for two periods and brakes with 1 m/s², which raw ceilings leave [m].
const WAY: f64 = 0.01 * 0.2 + 0.01 * 0.01 / 2.0;
const CEILINGS: [contact_limit::Ceiling; 2] = [ceiling(2000.0), ceiling(240.0)];
const POSTURE: [f64; 7] = [0.0, 0.5, 0.0, -1.3, 0.0, 1.3, 0.0];

const fn ceiling(load: f64) -> contact_limit::Ceiling {
    contact_limit::Ceiling { load, stiffness: load / WAY, deceleration: 1.0, approach: f64::INFINITY }
}

/// The controller and everything it remembers.
pub(crate) struct Fused {
    shape: ImageShape,
    offset: Box<[f32]>,
    alive: Box<[f32]>,
    image: Image,
    /// What the features are computed from; the recording has no bad tactels to fill.
    repaired: Image,
    mask: Mask,
    region: Mask,
    regions: Regions,
    pressures: Ring,
    axes: Ring,
    /// What a graph file sets is read at run time here too.
    laws: [Law; 4],
    inverse: [[f64; 6]; 4],
    integrals: [f64; 4],
    errors: [f64; 4],
    chain: Chain,
    joints: Vec<Joint>,
    columns: Vec<Twist>,
    at_sensor: [[f64; 6]; 7],
    rows: [null_space::Row; 7],
    smooth: [Twist; 2],
    reached: Twist,
    course: lost_contact::Course,
    corners: [Vector3<f64>; 4],
    budget: blind_limit::Budget,
    /// The load of the pad with its falls low-passed, over 0.1 s.
    held: contact_limit::PadLoad,
    /// Speed of the fastest corner of the pad [m/s].
    speed: f64,
    /// Time of this tick, and of the last contact if it lasts [ns].
    now: i64,
    contact_at: Option<i64>,
    limited: joint_limit::Limiter,
    following: joint_limit::Following,
    /// Whether a joint does not follow its commands. Read off by the bench.
    pub(crate) is_stuck: bool,
    /// Read off by the bench, so that nothing is optimised away.
    pub(crate) sum: f64,
    pub(crate) peak: f64,
}

/// The last samples of a feature.
#[derive(Default)]
struct Ring {
    samples: [[f64; 2]; WINDOW],
    next: usize,
    count: usize,
}

impl Ring {
    fn mean(&mut self, sample: [f64; 2]) -> [f64; 2] {
        self.samples[self.next] = sample;
        self.next = (self.next + 1) % WINDOW;
        self.count = (self.count + 1).min(WINDOW);
        let start = if self.count < WINDOW { 0 } else { self.next };
        let (newer, older) = self.samples[..self.count].split_at(start);
        let sum = older.iter().chain(newer).fold([0.0; 2], |[a, b], s| [a + s[0], b + s[1]]);
        sum.map(|sum| sum / self.count as f64)
    }
}

impl Fused {
    /// The task of the graph on that array, with dead tactels, and the arm of that model.
    pub(crate) fn new(shape: ImageShape, dead: &[usize], urdf: &Path) -> Self {
        let file = FilePath { path: urdf.into(), span: 0..0, builtin: None };
        let mount = Mount { xyz: [0.0, 0.0, 0.03], rpy: [0.0; 3] };
        let chain = model::load(&file, "lwr_7_link", &mount).unwrap_or_else(|mistakes| panic!("{mistakes:?}"));
        let grid = Grid::from(&shape);
        let (rows, cols) = (shape.rows, shape.cols);
        Self {
            offset: vec![0.0; rows * cols].into(),
            alive: (0..rows * cols).map(|at| if dead.contains(&at) { 0.0 } else { 1.0 }).collect(),
            image: Image::zeros(rows, cols),
            repaired: Image::zeros(rows, cols),
            mask: Mask::allocate(&grid),
            region: Mask::allocate(&grid),
            regions: Regions::with_room(rows, cols),
            pressures: Ring::default(),
            axes: Ring::default(),
            laws: black_box(LAWS),
            inverse: black_box(COLUMNS),
            integrals: [0.0; 4],
            errors: [0.0; 4],
            // What the graph's limit and the arm agree on.
            joints: chain.joints().iter().map(|joint| Joint { acceleration: 5.0, ..joint.clone() }).collect(),
            chain,
            columns: vec![Twist::default(); 7],
            at_sensor: [[0.0; 6]; 7],
            rows: [[0.0; 8]; 7],
            smooth: [Twist::default(); 2],
            reached: Twist::default(),
            course: lost_contact::Course::default(),
            corners: blind_limit::corners(&shape),
            budget: blind_limit::Budget::default(),
            held: contact_limit::PadLoad::default(),
            speed: 0.0,
            now: 0,
            contact_at: None,
            limited: joint_limit::Limiter::new(7),
            following: joint_limit::Following::new(7),
            is_stuck: false,
            sum: 0.0,
            peak: 0.0,
            shape,
        }
    }

    /// Forgets what a contact that was lost for long had built up.
    pub(crate) fn reset(&mut self) {
        (self.pressures, self.axes, self.integrals) = (Ring::default(), Ring::default(), [0.0; 4]);
    }

    /// Forgets the axes only: the patch was round for long.
    pub(crate) fn reset_axes(&mut self) {
        self.axes = Ring::default();
    }

    /// One tick: the recording's cells, the arm's joints and its equilibrium in, joint velocities out. `dt` is the time
    /// between the last two samples of the contact [s], `tick` that between the ticks. Tells whether there is a contact
    /// and an axis.
    pub(crate) fn tick(
        &mut self,
        cells: &[f32],
        arm: [&[f64]; 2],
        dt: f64,
        tick: f64,
        out: &mut [f64; 7],
    ) -> (bool, bool) {
        (self.sum, self.peak) = sum_and_peak(cells);
        let lines = self.offset.iter().zip(&self.alive);
        for ((to, from), (offset, gain)) in self.image.cells_mut().iter_mut().zip(cells).zip(lines) {
            *to = (from - offset) * gain;
        }
        self.repaired.cells_mut().copy_from_slice(self.image.cells());
        binarize(self.repaired.cells(), 3.0, &mut self.mask);
        let (runs, regions) = self.regions.parts_mut();
        label::trace(&self.mask, 1, runs);
        label::number(&self.repaired, runs, regions);
        let contact = label::contact(regions, 6, 100.0);
        self.now += (tick * 1e9) as i64;
        self.contact_at = contact.map(|_| self.now);
        let pose = self.chain.forward(arm[0], &mut self.columns);
        let (mut wanted, mut has_axis) = (None, false);
        if let Some(contact) = contact {
            label::paint(runs, contact, &mut self.region);
            let (twist, axis) = self.servo(dt);
            (wanted, has_axis) = (Some(twist), axis);
        }
        let tick = Tick { dt: tick, max_gap: 0.5, ..Tick::first() };
        let mut velocity = [0.0; 7];
        let moves = self.limit(wanted, &pose, &tick).map(|twist| self.solve(&twist, &pose, arm, &mut velocity));
        let wanted = moves.map(|()| &velocity[..]);
        self.is_stuck = self.following.note(&tick, self.limited.velocities(), arm[1]);
        self.limited.limit(&self.joints, 0.6, &tick, wanted, arm[0], arm[1]);
        out.copy_from_slice(self.limited.velocities());
        (contact.is_some(), has_axis)
    }

    /// The limits of the sensor's twist.
    fn limit(&mut self, wanted: Option<Twist>, pose: &Pose, tick: &Tick) -> Option<Twist> {
        let (dt, [last, offset]) = (tick.dt.min(tick.max_gap), &mut self.smooth);
        let half = [0.5 * 1.0 * dt, 0.5 * 10.0 * dt];
        let mut target = wanted.unwrap_or_default();
        target.0 *= scale_twist(&target, 0.05, 0.8);
        let mut twist = bumpless::smooth(&target, last, offset, half);
        let is_there = wanted.is_some() || *offset != Twist::default();
        let phase = self.course.next(self.now, self.contact_at.is_some(), false, &LOSS);
        if is_there {
            twist = lost_contact::allowed(&twist, phase, &MANNER);
            self.contact(&mut twist, tick);
            let (velocity, place) = (pose.0.rotation * twist.linear(), pose.0.translation.vector);
            let corners = [[-0.8, -0.4, 0.1], [-0.3, 0.4, 0.7]];
            twist.0 *= workspace_limit::scale(&velocity, &place, corners, 1.0, 2.0 * tick.max_gap);
            twist.0 *= self.blind(&twist, tick);
            twist.0 *= scale_twist(&twist, 0.05, 0.8);
        } else {
            self.blind(&Twist::default(), tick);
            twist = Twist::default();
        }
        approach_twist(&mut self.reached, &twist, dt, 10.0 * dt);
        (is_there || self.reached != Twist::default()).then_some(self.reached)
    }

    /// The ceilings of the sum and of a tactel, in raw readings.
    fn contact(&mut self, twist: &mut Twist, tick: &Tick) {
        let load = contact_limit::load(&self.image);
        self.held = load.held(self.held, 0.5);
        let (shape, image) = (&self.shape, &self.image);
        let half = [shape.cols as f64 * shape.pitch[0] / 2.0, shape.rows as f64 * shape.pitch[1] / 2.0];
        let delay = 2.0 * tick.dt.max(0.1);
        let [force, peak] = CEILINGS;
        let touches = load.peak > 3.0;
        contact_limit::bar(twist, half, force.allowed_speed(self.held.sum, delay), || {
            touches.then(|| contact_limit::centre(shape, image))
        });
        contact_limit::bar(twist, half, peak.allowed_speed(self.held.peak, delay), || {
            touches.then(|| contact_limit::highest(shape, image, load.peak))
        });
    }

    /// The fraction of a motion that the budgets without a contact let pass.
    fn blind(&mut self, twist: &Twist, tick: &Tick) -> f64 {
        let motion = blind_limit::Motion::of(twist, &self.corners, &BLIND);
        self.budget.touch([self.contact_at, None], false);
        self.budget.spend(self.speed, tick.dt);
        let scale = self.budget.scale(&motion, &BLIND, 0.0, 2.0 * tick.max_gap);
        self.speed = scale * motion.speed;
        scale
    }

    /// From a twist of the sensor to joint velocities.
    fn solve(&mut self, twist: &Twist, Pose(pose): &Pose, [q, equilibrium]: [&[f64]; 2], out: &mut [f64; 7]) {
        let spatial = adjoint(&Pose(*pose), twist);
        let r = pose.rotation.matrix();
        let p = pose.translation.vector;
        let at_sensor = |twist: &Twist| {
            let [vx, vy, vz, wx, wy, wz] = twist.0.into();
            let v = [vx + wy * p.z - wz * p.y, vy + wz * p.x - wx * p.z, vz + wx * p.y - wy * p.x];
            let w = [wx, wy, wz];
            let turned = |a: [f64; 3], i: usize| r[(0, i)] * a[0] + r[(1, i)] * a[1] + r[(2, i)] * a[2];
            [turned(v, 0), turned(v, 1), turned(v, 2), turned(w, 0), turned(w, 1), turned(w, 2)]
        };
        for (to, column) in self.at_sensor.iter_mut().zip(&self.columns) {
            *to = at_sensor(column);
        }
        let nearness = damped::solve(&self.at_sensor, &at_sensor(&spatial), 0.02, out);
        let mut drift: [f64; 7] = std::array::from_fn(|i| 0.5 * (POSTURE[i] - q[i]));
        null_space::project(&self.at_sensor, &mut self.rows, &mut drift);
        let places = q.iter().zip(equilibrium).map(|(q, equilibrium)| [*q, *equilibrium]);
        let is_within = joint_limits::add_within(&self.joints, places, 0.2, out, &drift);
        assert!(is_within && nearness.damping == 0.0, "the task stays far from limits and singularities");
    }

    /// From the region to the twist of the sensor (eqs. 1-3 and 5).
    fn servo(&mut self, dt: f64) -> (Twist, bool) {
        let sums = moments::Weighing::Force.add_up(&self.repaired, &self.region);
        let pressure = self.pressures.mean([sums.force / sums.area, 0.0])[0];
        let (j, i) = (sums.x / sums.force, sums.y / sums.force);
        let (x, y) = (self.shape.x(sums.first[1] + j), self.shape.y(sums.first[0] + i));
        let orientation = moments::ellipse(&sums, self.shape.pitch).orientation(0.1);
        let mut errors = [0.0 - x, 0.0 - y, 40.0 - pressure, 0.0];
        if let Some(angle) = orientation {
            let (sine, cosine) = libm::sincos(2.0 * angle);
            let [cosine, sine] = self.axes.mean([cosine, sine]);
            errors[3] = wrap_axial(0.0 - half_angle(sine, cosine));
        }
        let mut twist = Twist::default();
        for (i, (error, law)) in
            errors.into_iter().zip(&self.laws).enumerate().take(3 + usize::from(orientation.is_some()))
        {
            let change = error - self.errors[i];
            let slope = if dt > 0.0 { (if i == 3 { wrap_axial(change) } else { change }) / dt } else { 0.0 };
            let others = law.kp * error + law.kd * slope;
            let growth = if error.abs() <= law.within { law.ki * error * dt } else { 0.0 };
            self.integrals[i] = integrate(self.integrals[i], growth, law.bound, others, law.limit);
            self.errors[i] = error;
            let control = (others + self.integrals[i]).clamp(-law.limit, law.limit);
            for (sum, entry) in twist.0.iter_mut().zip(&self.inverse[i]) {
                *sum += entry * control;
            }
        }
        (twist.0[3], twist.0[4]) = (0.0, 0.0);
        twist.0[1] += 0.005;
        (twist, orientation.is_some())
    }
}
