//! The foam against the objects: how deep each point of the pad is pressed in, and what that does to the pad.
//!
//! Every tactel has 5 by 5 points or more, no more than 1 mm apart, each the end of a column of foam. The depth of a
//! column is found by a ray through it, from the plate outward. Its force f acts along the pad's z; the object's
//! surface, of normal n, is without friction at such a point, so the pad feels f n / |n_z|: the gradient of the energy of
//! the columns, and no more work comes out than went in.
//!
//! Friction acts at each tactel as a bristle: the foam shears until the friction gives way, mu N, with mu falling from
//! rest to motion over a millimetre a second (Stribeck). That is stick and slip.
//!
//! What is far from every object is culled, by blocks of 4 by 4 tactels, then by tactels.

use parry3d_f64::math::{Pose3, Vec3};
use tactflow_runtime::signal::ImageShape;

use super::foam::{Column, Foam};
use super::object::Object;

/// Greatest distance of two points [m].
const POINTS_APART: f64 = 0.001;
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
    object: usize,
    /// Of the object, in the base.
    normal: Vec3,
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

impl Touch {
    /// Normal of the object there, out of it, in the base.
    #[must_use]
    pub const fn normal(&self) -> Vec3 {
        self.normal
    }
}

const NONE: u32 = u32::MAX;

impl Contact {
    /// A pad that touches nothing.
    #[must_use]
    pub fn new(shape: ImageShape, foam: Foam) -> Self {
        let side = shape.pitch[0].max(shape.pitch[1]);
        let fine = (side / POINTS_APART - 1e-9).ceil().max(1.0) as usize;
        let area = shape.pitch[0] * shape.pitch[1];
        let points = fine * fine;
        let along = |point: usize| (point as f64 + 0.5) / fine as f64 - 0.5;
        Self {
            fine,
            column: Column::new(&foam, area / points as f64),
            shear: *foam.shear * area / (0.005 * 0.005),
            touching: Vec::new(),
            tactels: vec![Tactel::default(); shape.tactels()],
            slots: vec![NONE; shape.tactels() * points],
            xs: (0..shape.cols * fine).map(|point| shape.x(along(point))).collect(),
            ys: (0..shape.rows * fine).map(|point| shape.y(along(point))).collect(),
            near: Vec::with_capacity(shape.cols),
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
        for (index, object) in objects.iter().enumerate() {
            self.find(pad, index, object);
        }
        // Each object's points come row after row; the sums want them all so.
        if !self.touching.is_sorted_by_key(|touch| touch.point) {
            self.touching.sort_unstable_by_key(|touch| touch.point);
        }
        loads.fill(Vec3::ZERO);
        self.wrench = Wrench::default();
        self.press(pad, objects, loads);
        self.rub(dt, pad, objects, loads);
    }

    /// Finds the points that an object touches.
    fn find(&mut self, pad: &Motion, index: usize, object: &Object) {
        let thickness = *self.foam.thickness;
        let local = |v: Vec3| object.pose.rotation.inverse() * (pad.pose.rotation * v);
        let ray = Rays {
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
        let fine = self.fine;
        for y in row * fine..(row + 1) * fine {
            let from = ray.origin + ray.axes[1] * self.ys[y];
            for x in self.near.iter().flat_map(|j| j * fine..(j + 1) * fine) {
                let origin = from + ray.axes[0] * self.xs[x];
                let Some(hit) = object.shape.cast(origin, ray.axes[2], ray.thickness) else { continue };
                let depth = ray.thickness - hit.time;
                let touch = Touch {
                    point: [y, x],
                    force: 0.0,
                    depth,
                    object: index,
                    normal: object.pose.rotation * hit.normal,
                };
                let slot = &mut self.slots[y * self.xs.len() + x];
                if *slot == NONE {
                    *slot = self.touching.len() as u32;
                    self.touching.push(touch);
                } else if self.touching[*slot as usize].depth < depth {
                    self.touching[*slot as usize] = touch;
                }
            }
        }
    }

    /// The forces of the columns.
    fn press(&mut self, pad: &Motion, objects: &[Object], loads: &mut [Vec3]) {
        let z = pad.pose.rotation * Vec3::Z;
        let [x_axis, y_axis] = [pad.pose.rotation * Vec3::X, pad.pose.rotation * Vec3::Y];
        // A point's part of a tactel is softer by as much as it is smaller.
        let parts = (self.fine * self.fine) as f64 * (0.005 * 0.005) / (self.shape.pitch[0] * self.shape.pitch[1]);
        self.tactels.iter_mut().for_each(|tactel| tactel.normal = 0.0);
        for at in 0..self.touching.len() {
            let touch = self.touching[at];
            let [x, y] = self.place(touch.point);
            let arm = x_axis * x + y_axis * y - z * touch.depth;
            let object = &objects[touch.object];
            let relative = object.velocity_at(pad.pose.translation + arm) - (pad.linear + pad.angular.cross(arm));
            let facing = (-touch.normal.dot(z)).max(STEEPEST);
            let rate = touch.normal.dot(relative) / facing;
            let force = self.column.force(touch.depth, rate, object.softness * parts);
            let push = touch.normal * (force / facing);
            self.wrench.force += push;
            self.wrench.moment += arm.cross(push);
            loads[touch.object] -= push;
            self.touching[at].force = force;
            let tactel = &mut self.tactels[touch.point[0] / self.fine * self.shape.cols + touch.point[1] / self.fine];
            tactel.normal += force;
            tactel.object = touch.object;
        }
    }

    /// The forces of the bristles.
    fn rub(&mut self, dt: f64, pad: &Motion, objects: &[Object], loads: &mut [Vec3]) {
        let [x_axis, y_axis] = [pad.pose.rotation * Vec3::X, pad.pose.rotation * Vec3::Y];
        let cols = self.shape.cols;
        for (index, tactel) in self.tactels.iter_mut().enumerate() {
            if tactel.normal == 0.0 {
                (tactel.shear, tactel.friction) = ([0.0; 2], [0.0; 2]);
                continue;
            }
            let (x, y) = (self.shape.x((index % cols) as f64), self.shape.y((index / cols) as f64));
            let arm = x_axis * x + y_axis * y;
            let relative =
                pad.linear + pad.angular.cross(arm) - objects[tactel.object].velocity_at(pad.pose.translation + arm);
            let velocity = [relative.dot(x_axis), relative.dot(y_axis)];
            tactel.rub(dt, velocity, self.shear, &self.foam);
            let push = x_axis * tactel.friction[0] + y_axis * tactel.friction[1];
            self.wrench.force += push;
            self.wrench.moment += arm.cross(push);
            loads[tactel.object] -= push;
        }
    }

    /// The energy that foam, objects and bristles store [J].
    #[cfg(test)]
    pub(super) fn energy(&self, objects: &[Object]) -> f64 {
        let parts = (self.fine * self.fine) as f64;
        let softness = |touch: &Touch| objects[touch.object].softness * parts;
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
