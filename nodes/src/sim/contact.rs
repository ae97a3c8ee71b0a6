//! The foam against the objects: how deep each point of the pad is pressed in, and what that does to the pad.
//!
//! Every tactel of 5 mm has 5 by 5 points or more, no more than 1 mm apart, each the end of a column of foam. The depth of a
//! column is found by a ray through it, from the plate outward. Its force f acts along the pad's z; the object's
//! surface, of normal n, is without friction at such a point, so the pad feels f n / |n_z|: the gradient of the energy of
//! the columns, and no more work comes out than went in.
//!
//! Friction acts at each tactel as a bristle: the foam shears until the friction gives way, mu N, with mu falling from
//! rest to motion over a millimetre a second (Stribeck). That is stick and slip.
//!
//! What is far from every object is culled, by blocks of 4 by 4 tactels, then by tactels.

use parry3d_f64::math::{Mat3, Pose3, Vec3};
use tactflow_runtime::signal::ImageShape;

use super::foam::{self, Column, Foam};
use super::object::Object;

/// Speed over which friction falls from that at rest to that in motion [m/s].
const STRIBECK: f64 = 0.001;
/// Tactels along a block.
const BLOCK: usize = 4;
/// Least part of a normal that faces the pad: columns do not see what is steeper.
const STEEPEST: f64 = 0.1;

/// Where the pad is and how it moves, in the base.
#[derive(Debug, Clone, Copy)]
pub struct Motion {
    /// Pose of the sensor's frame.
    pub pose: Pose3,
    /// Velocity of its origin [m/s].
    pub linear: Vec3,
    /// [rad/s]
    pub angular: Vec3,
}

/// What acts on a body: a force, and a moment about some point.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Wrench {
    /// [N]
    pub force: Vec3,
    /// [N m]
    pub moment: Vec3,
}

/// The pad's foam in contact.
pub struct Contact {
    shape: ImageShape,
    /// Points along a side of a tactel.
    fine: usize,
    foam: Foam,
    column: Column,
    /// Stiffness against shear of a tactel [N/m].
    shear: f64,
    /// The points of all tactels that touch something, in a fixed order.
    touching: Vec<Touch>,
    tactels: Vec<Tactel>,
    /// Places of the points along x and along y [m].
    xs: Vec<f64>,
    ys: Vec<f64>,
    /// Which of `touching` each point is.
    slots: Vec<u32>,
    /// Tactels of a row that may touch an object.
    near: Vec<usize>,
    /// How each object moves over the pad.
    slides: Vec<Slide>,
    /// What acts on the pad at its origin, in the base.
    wrench: Wrench,
}

/// A point that touches something.
#[derive(Debug, Clone, Copy)]
pub struct Touch {
    /// Row and column of the point in the grid of points.
    pub point: [usize; 2],
    /// Force along the pad's z [N].
    pub force: f64,
    /// Indentation [m].
    pub depth: f64,
    /// Normal of the object there, out of it, in the pad's frame.
    pub normal: Vec3,
    object: usize,
    tactel: usize,
}

/// How an object moves over the pad: the velocity of its point at the pad's origin, and its turn, in the pad's frame.
#[derive(Debug, Clone, Copy)]
struct Slide {
    linear: Vec3,
    angular: Vec3,
}

impl Slide {
    fn of(object: &Object, pad: &Motion) -> Self {
        let local = |v: Vec3| pad.pose.inverse_transform_vector(v);
        let linear = object.velocity_at(pad.pose.translation) - pad.linear;
        Self { linear: local(linear), angular: local(object.spin() - pad.angular) }
    }

    fn at(&self, place: Vec3) -> Vec3 {
        self.linear + self.angular.cross(place)
    }
}

/// A tactel's friction.
#[derive(Debug, Clone, Copy, Default)]
struct Tactel {
    normal: f64,
    object: usize,
    /// Shear of the foam along the pad's x and y [m].
    shear: [f64; 2],
    /// Force on the pad along its x and y [N].
    friction: [f64; 2],
}

const NONE: u32 = u32::MAX;

impl Contact {
    /// A pad that touches nothing, felt at points that are `apart` at most [m], with room for so many objects.
    #[must_use]
    pub fn new(shape: ImageShape, foam: Foam, apart: f64, objects: usize) -> Self {
        let side = shape.pitch[0].max(shape.pitch[1]);
        let fine = (side / apart - 1e-9).ceil().max(1.0) as usize;
        let area = shape.pitch[0] * shape.pitch[1];
        let points = fine * fine;
        let along = |point: usize| (point as f64 + 0.5) / fine as f64 - 0.5;
        Self {
            fine,
            column: Column::new(&foam, area / points as f64),
            shear: *foam.shear * area / foam::AREA,
            touching: Vec::with_capacity(shape.tactels() * points),
            tactels: vec![Tactel::default(); shape.tactels()],
            slots: vec![NONE; shape.tactels() * points],
            xs: (0..shape.cols * fine).map(|point| shape.x(along(point))).collect(),
            ys: (0..shape.rows * fine).map(|point| shape.y(along(point))).collect(),
            near: Vec::with_capacity(shape.cols),
            slides: Vec::with_capacity(objects),
            wrench: Wrench::default(),
            shape,
            foam,
        }
    }

    /// Points along a side of a tactel.
    #[must_use]
    pub const fn fine(&self) -> usize {
        self.fine
    }

    /// The points that touch something.
    #[must_use]
    pub fn touching(&self) -> &[Touch] {
        &self.touching
    }

    /// What acts on the pad at its origin, in the base, as of the last step.
    #[must_use]
    pub const fn wrench(&self) -> Wrench {
        self.wrench
    }

    /// Force of friction on the pad, along its x and y, as of the last step [N].
    #[must_use]
    pub fn friction(&self) -> [f64; 2] {
        self.tactels.iter().fold([0.0; 2], |sum, tactel| [sum[0] + tactel.friction[0], sum[1] + tactel.friction[1]])
    }

    /// Force along the pad's z, positive when it is pressed, as of the last step [N].
    #[must_use]
    pub fn normal(&self) -> f64 {
        self.touching.iter().map(|touch| touch.force).sum()
    }

    /// Place of a point in the pad's plane, by its row and column in the grid of points [m].
    #[must_use]
    pub fn place(&self, point: [usize; 2]) -> [f64; 2] {
        [self.xs[point[1]], self.ys[point[0]]]
    }

    /// Goes on by `dt` [s]. `loads` gets the force on each object, in the base [N].
    pub fn step(&mut self, dt: f64, pad: &Motion, objects: &[Object], loads: &mut [Vec3]) {
        for touch in self.touching.drain(..) {
            self.slots[touch.point[0] * self.xs.len() + touch.point[1]] = NONE;
        }
        self.slides.clear();
        self.slides.extend(objects.iter().map(|object| Slide::of(object, pad)));
        for (index, object) in objects.iter().enumerate() {
            self.find(pad, index, object);
        }
        // Each object's points come row after row; the sums want them all so.
        if !self.touching.is_sorted_by_key(|touch| touch.point) {
            self.touching.sort_unstable_by_key(|touch| touch.point);
        }
        loads.fill(Vec3::ZERO);
        let mut wrench = Wrench::default();
        self.press(objects, &mut wrench, loads);
        self.rub(dt, &mut wrench, loads);
        // From the pad's frame to the base's.
        let turn = pad.pose.rotation;
        self.wrench = Wrench { force: turn * wrench.force, moment: turn * wrench.moment };
        loads.iter_mut().for_each(|load| *load = turn * *load);
    }

    /// Finds the points that an object touches.
    fn find(&mut self, pad: &Motion, index: usize, object: &Object) {
        let thickness = *self.foam.thickness;
        let local = |v: Vec3| object.pose.rotation.inverse() * (pad.pose.rotation * v);
        let ray = Rays {
            to_pad: Mat3::from_quat(pad.pose.rotation.inverse() * object.pose.rotation),
            origin: object.pose.inverse_transform_point(pad.pose.translation) - local(Vec3::Z) * thickness,
            axes: [local(Vec3::X), local(Vec3::Y), local(Vec3::Z)],
            thickness,
        };
        let (rows, cols) = (self.shape.rows, self.shape.cols);
        for first in (0..rows).step_by(BLOCK) {
            let last = (first + BLOCK).min(rows);
            let blocks = (0..cols).step_by(BLOCK).map(|j| (j, (j + BLOCK).min(cols)));
            let is_near = |(j, end): &(usize, usize)| !ray.is_clear(object, &self.shape, [first, *j], [last, *end]);
            let columns =
                blocks.filter(is_near).fold(0..0, |all, (j, end)| if all.is_empty() { j..end } else { all.start..end });
            for i in first..last {
                let clear = |j: &usize| !ray.is_clear(object, &self.shape, [i, *j], [i + 1, j + 1]);
                self.near.clear();
                self.near.extend(columns.clone().filter(clear));
                self.find_in_row(i, &ray, index, object);
            }
        }
    }

    /// Finds the points of a row of tactels that an object touches, among those that are near.
    fn find_in_row(&mut self, row: usize, ray: &Rays, index: usize, object: &Object) {
        let (fine, width) = (self.fine, self.xs.len());
        for y in row * fine..(row + 1) * fine {
            let from = ray.origin + ray.axes[1] * self.ys[y];
            for &near in &self.near {
                let tactel = row * self.shape.cols + near;
                for x in near * fine..(near + 1) * fine {
                    let origin = from + ray.axes[0] * self.xs[x];
                    let Some(hit) = object.shape.cast(origin, ray.axes[2], ray.thickness) else { continue };
                    let depth = ray.thickness - hit.time;
                    let normal = ray.to_pad * hit.normal;
                    let touch = Touch { point: [y, x], force: 0.0, depth, normal, object: index, tactel };
                    let slot = &mut self.slots[y * width + x];
                    if *slot == NONE {
                        *slot = self.touching.len() as u32;
                        self.touching.push(touch);
                    } else if self.touching[*slot as usize].depth < depth {
                        self.touching[*slot as usize] = touch;
                    }
                }
            }
        }
    }

    /// The forces of the columns, in the pad's frame.
    fn press(&mut self, objects: &[Object], wrench: &mut Wrench, loads: &mut [Vec3]) {
        let parts = self.parts();
        self.tactels.iter_mut().for_each(|tactel| tactel.normal = 0.0);
        for touch in &mut self.touching {
            let place = Vec3::new(self.xs[touch.point[1]], self.ys[touch.point[0]], -touch.depth);
            let facing = (-touch.normal.z).max(STEEPEST);
            let rate = touch.normal.dot(self.slides[touch.object].at(place)) / facing;
            touch.force = self.column.force(touch.depth, rate, objects[touch.object].softness * parts);
            let push = touch.normal * (touch.force / facing);
            wrench.force += push;
            wrench.moment += place.cross(push);
            loads[touch.object] -= push;
            let tactel = &mut self.tactels[touch.tactel];
            tactel.normal += touch.force;
            tactel.object = touch.object;
        }
    }

    /// How many points make a tactel of 5 mm by 5 mm: under a point alone an object is softer by that.
    fn parts(&self) -> f64 {
        (self.fine * self.fine) as f64 * foam::AREA / (self.shape.pitch[0] * self.shape.pitch[1])
    }

    /// The forces of the bristles, in the pad's frame.
    fn rub(&mut self, dt: f64, wrench: &mut Wrench, loads: &mut [Vec3]) {
        let cols = self.shape.cols;
        for (index, tactel) in self.tactels.iter_mut().enumerate() {
            if tactel.normal == 0.0 {
                (tactel.shear, tactel.friction) = ([0.0; 2], [0.0; 2]);
                continue;
            }
            let place = Vec3::new(self.shape.x((index % cols) as f64), self.shape.y((index / cols) as f64), 0.0);
            let slide = -self.slides[tactel.object].at(place);
            tactel.rub(dt, [slide.x, slide.y], self.shear, &self.foam);
            let push = Vec3::new(tactel.friction[0], tactel.friction[1], 0.0);
            wrench.force += push;
            wrench.moment += place.cross(push);
            loads[tactel.object] -= push;
        }
    }

    /// The energy that foam, objects and bristles store [J].
    #[cfg(test)]
    pub(super) fn energy(&self, objects: &[Object]) -> f64 {
        let softness = |touch: &Touch| objects[touch.object].softness * self.parts();
        let columns: f64 = self.touching.iter().map(|touch| self.column.energy(touch.depth, softness(touch))).sum();
        let bristles = self.tactels.iter().map(|t| self.shear / 2.0 * (t.shear[0].powi(2) + t.shear[1].powi(2)));
        columns + bristles.sum::<f64>()
    }
}

impl Tactel {
    /// Shears the foam with `velocity` of the pad over the object, until the friction gives way.
    fn rub(&mut self, dt: f64, velocity: [f64; 2], stiffness: f64, foam: &Foam) {
        let speed = norm(velocity) / STRIBECK;
        let (still, sliding) = (*foam.static_friction, *foam.sliding_friction);
        let most = (sliding + (still - sliding) / (1.0 + speed * speed)) * self.normal;
        self.shear = [self.shear[0] + velocity[0] * dt, self.shear[1] + velocity[1] * dt];
        let force = stiffness * norm(self.shear);
        if force > most {
            let share = most / force;
            self.shear = [self.shear[0] * share, self.shear[1] * share];
        }
        self.friction = [-stiffness * self.shear[0], -stiffness * self.shear[1]];
    }
}

/// The rays of all columns, in the frame of an object.
struct Rays {
    /// Of the column in the pad's middle, at the plate.
    origin: Vec3,
    /// The pad's.
    axes: [Vec3; 3],
    thickness: f64,
    /// From the object's frame to the pad's.
    to_pad: Mat3,
}

impl Rays {
    fn from(&self, x: f64, y: f64) -> Vec3 {
        self.origin + self.axes[0] * x + self.axes[1] * y
    }

    /// Whether an object is clear of all columns of the tactels from `first` to before `last`.
    fn is_clear(&self, object: &Object, shape: &ImageShape, first: [usize; 2], last: [usize; 2]) -> bool {
        let middle = |axis: usize| (first[axis] + last[axis] - 1) as f64 / 2.0;
        let centre = self.from(shape.x(middle(1)), shape.y(middle(0))) + self.axes[2] * (self.thickness / 2.0);
        let (wide, high) = ((last[1] - first[1]) as f64 * shape.pitch[0], (last[0] - first[0]) as f64 * shape.pitch[1]);
        let reach = (wide * wide + high * high + self.thickness * self.thickness).sqrt() / 2.0;
        object.shape.clearance(centre) > reach
    }
}

fn norm([x, y]: [f64; 2]) -> f64 {
    (x * x + y * y).sqrt()
}
