//! Contact between the foam and the objects: the indentation of each point of the pad, and the resulting forces.
//!
//! A tactel of 5 mm has at least 5 by 5 points, at most 1 mm apart, and each point is the end of a column of foam. The
//! depth of a column is found by casting a ray through it, from the plate outward. Its force f acts along the pad's z.
//! The surface of the object, with normal n, is frictionless at such a point, so the force on the pad is f n / |n_z|.
//! This is the gradient of the energy of the columns, so the contact does not create energy.
//!
//! Friction acts at each tactel as a bristle: the foam shears until the friction force reaches mu N. The coefficient mu
//! falls from its static to its sliding value over 1 mm/s (Stribeck), which gives stick and slip.
//!
//! Blocks of 4 by 4 tactels, and then single tactels, that are far from every object are skipped.

use parry3d_f64::math::{Mat3, Pose3, Vec2, Vec3};
use tactflow_runtime::signal::ImageShape;

use super::bristle::BristleShear;
use super::foam::{self, Foam, FoamColumn};
use super::object::Object;
use super::wrench::Wrench;

/// Speed over which friction falls from its static to its sliding value [m/s].
const STRIBECK_SPEED: f64 = 0.001;
/// Number of tactels along a side of a block.
const BLOCK_TACTELS: usize = 4;
/// Smallest component of a normal toward the pad that is used; a steeper surface counts as this steep [1].
const MIN_FACING: f64 = 0.1;

/// Pose and velocity of a body in the base.
#[derive(Debug, Clone, Copy)]
pub struct BodyMotion {
    /// Pose of its frame.
    pub pose: Pose3,
    /// Velocity of its origin [m/s].
    pub linear: Vec3,
    /// Angular velocity [rad/s].
    pub angular: Vec3,
}

/// The foam of the pad in contact with objects.
pub struct Contact {
    shape: ImageShape,
    /// Number of points along a side of a tactel.
    pub(super) fine: usize,
    foam: Foam,
    column: FoamColumn,
    /// Shear stiffness of a tactel [N/m].
    shear: f64,
    /// Shear damping of a tactel [N s/m].
    shear_damping: f64,
    /// The points that touch an object, in raster order.
    pub(super) touching: Vec<Touch>,
    tactels: Vec<Bristle>,
    /// Coordinates of the points along x and along y [m].
    xs: Vec<f64>,
    ys: Vec<f64>,
    /// Index of each point in `touching`.
    slots: Vec<u32>,
    /// Tactels of the current row that may touch an object.
    near: Vec<usize>,
    /// Motion of each object relative to the pad.
    slides: Vec<Slide>,
    /// Wrench on the pad about its origin, in the base, as of the last step.
    pub(super) wrench: Wrench,
}

/// A point of the pad that touches an object.
#[derive(Debug, Clone, Copy)]
pub struct Touch {
    /// Row and column of the point in the grid of points.
    pub point: [usize; 2],
    /// Force along the pad's z [N].
    pub force: f64,
    /// Indentation [m].
    pub depth: f64,
    /// Outward normal of the object at the point, in the pad's frame.
    pub normal: Vec3,
    object: usize,
    tactel: usize,
}

/// Motion of an object relative to the pad, in the pad's frame: linear at the pad's origin, and angular.
#[derive(Debug, Clone, Copy)]
struct Slide {
    linear: Vec3,
    angular: Vec3,
}

impl Slide {
    fn of(object: &Object, pad: &BodyMotion) -> Self {
        let local = |v: Vec3| pad.pose.inverse_transform_vector(v);
        let linear = object.velocity_at(pad.pose.translation) - pad.linear;
        Self { linear: local(linear), angular: local(object.spin() - pad.angular) }
    }

    fn at(&self, place: Vec3) -> Vec3 {
        self.linear + self.angular.cross(place)
    }
}

/// The friction at a tactel.
#[derive(Debug, Clone, Copy, Default)]
struct Bristle {
    normal: f64,
    object: usize,
    /// Shear of the foam along the pad's x and y [m].
    shear: BristleShear,
    /// Force on the pad along its x and y [N].
    friction: Vec2,
}

/// Marks a point that touches nothing.
const NO_SLOT: u32 = u32::MAX;

impl Contact {
    /// Returns a pad that touches nothing, with points at most `apart` [m] apart and with room for `objects` objects.
    #[must_use]
    pub fn new(shape: ImageShape, foam: Foam, apart: f64, objects: usize) -> Self {
        let side = shape.pitch[0].max(shape.pitch[1]);
        let fine = (side / apart - 1e-9).ceil().max(1.0) as usize;
        let area = shape.pitch[0] * shape.pitch[1];
        let points = fine * fine;
        let along = |point: usize| (point as f64 + 0.5) / fine as f64 - 0.5;
        Self {
            fine,
            column: FoamColumn::new(&foam, area / points as f64),
            shear: foam.shear * area / foam::REFERENCE_AREA,
            shear_damping: 0.0,
            touching: Vec::with_capacity(shape.tactels() * points),
            tactels: vec![Bristle::default(); shape.tactels()],
            slots: vec![NO_SLOT; shape.tactels() * points],
            xs: (0..shape.cols * fine).map(|point| shape.x(along(point))).collect(),
            ys: (0..shape.rows * fine).map(|point| shape.y(along(point))).collect(),
            near: Vec::with_capacity(shape.cols),
            slides: Vec::with_capacity(objects),
            wrench: Wrench::default(),
            shape,
            foam,
        }
    }

    /// Damps the shear of the foam with the time constant of its compression, damping over stiffness.
    ///
    /// An object that only the pads hold would otherwise oscillate on the shear of the foam for ever.
    #[must_use]
    pub fn with_damped_shear(self) -> Self {
        Self { shear_damping: self.shear * self.foam.damping / self.foam.stiffness, ..self }
    }

    /// Returns the friction force on the pad along its x and y, as of the last step [N].
    #[must_use]
    pub fn friction(&self) -> Vec2 {
        self.tactels.iter().map(|tactel| tactel.friction).sum()
    }

    /// Returns the share of a point in the friction of its tactel, along the pad's x and y [N]: that of its force.
    #[must_use]
    pub fn friction_at(&self, touch: &Touch) -> Vec2 {
        let tactel = &self.tactels[touch.tactel];
        if tactel.normal > 0.0 { tactel.friction * (touch.force / tactel.normal) } else { Vec2::ZERO }
    }

    /// Returns the force along the pad's z, positive when the pad is pressed, as of the last step [N].
    #[must_use]
    pub fn normal(&self) -> f64 {
        self.touching.iter().map(|touch| touch.force).sum()
    }

    /// Returns the position of a point in the plane of the pad, from its row and column in the grid of points [m].
    #[must_use]
    pub fn place(&self, [row, col]: [usize; 2]) -> Vec2 {
        Vec2::new(self.xs[col], self.ys[row])
    }

    /// Advances by `dt` [s]. Writes to `loads` the force on each object and its moment about the origin of the pad, in the
    /// base.
    pub fn step(&mut self, dt: f64, pad: &BodyMotion, objects: &[Object], loads: &mut [Wrench]) {
        for touch in self.touching.drain(..) {
            self.slots[touch.point[0] * self.xs.len() + touch.point[1]] = NO_SLOT;
        }
        self.slides.clear();
        self.slides.extend(objects.iter().map(|object| Slide::of(object, pad)));
        for (index, object) in objects.iter().enumerate().filter(|(_, object)| !object.is_gone) {
            self.find(pad, index, object);
        }
        // The points are in raster order per object, and the sums need raster order over all objects.
        if !self.touching.is_sorted_by_key(|touch| touch.point) {
            self.touching.sort_unstable_by_key(|touch| touch.point);
        }
        loads.fill(Wrench::default());
        let mut wrench = Wrench::default();
        self.press(objects, &mut wrench, loads);
        self.rub(dt, &mut wrench, loads);
        // From the frame of the pad to the base.
        let turn = pad.pose.rotation;
        let in_base = |wrench: Wrench| Wrench { force: turn * wrench.force, moment: turn * wrench.moment };
        self.wrench = in_base(wrench);
        loads.iter_mut().for_each(|load| *load = in_base(*load));
    }

    /// Finds the points that touch an object.
    fn find(&mut self, pad: &BodyMotion, index: usize, object: &Object) {
        let thickness = self.foam.thickness;
        let local = |v: Vec3| object.pose.rotation.inverse() * (pad.pose.rotation * v);
        let ray = Rays {
            to_pad: Mat3::from_quat(pad.pose.rotation.inverse() * object.pose.rotation),
            origin: object.pose.inverse_transform_point(pad.pose.translation) - local(Vec3::Z) * thickness,
            axes: [local(Vec3::X), local(Vec3::Y), local(Vec3::Z)],
            thickness,
        };
        let (rows, cols) = (self.shape.rows, self.shape.cols);
        for first in (0..rows).step_by(BLOCK_TACTELS) {
            let last = (first + BLOCK_TACTELS).min(rows);
            let blocks = (0..cols).step_by(BLOCK_TACTELS).map(|j| (j, (j + BLOCK_TACTELS).min(cols)));
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

    /// Finds the points of a row of tactels that touch an object, among the tactels that are near it.
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
                    if *slot == NO_SLOT {
                        *slot = self.touching.len() as u32;
                        self.touching.push(touch);
                    } else if self.touching[*slot as usize].depth < depth {
                        self.touching[*slot as usize] = touch;
                    }
                }
            }
        }
    }

    /// Adds the forces of the columns, in the pad's frame.
    fn press(&mut self, objects: &[Object], wrench: &mut Wrench, loads: &mut [Wrench]) {
        let parts = self.parts();
        self.tactels.iter_mut().for_each(|tactel| tactel.normal = 0.0);
        for touch in &mut self.touching {
            let place = Vec3::new(self.xs[touch.point[1]], self.ys[touch.point[0]], -touch.depth);
            let facing = (-touch.normal.z).max(MIN_FACING);
            let rate = touch.normal.dot(self.slides[touch.object].at(place)) / facing;
            touch.force = self.column.force(touch.depth, rate, objects[touch.object].softness * parts);
            let push = touch.normal * (touch.force / facing);
            wrench.push(place, push);
            loads[touch.object].push(place, -push);
            let tactel = &mut self.tactels[touch.tactel];
            tactel.normal += touch.force;
            tactel.object = touch.object;
        }
    }

    /// Returns the number of points per tactel of 5 mm by 5 mm: under a single point an object is softer by this
    /// factor.
    fn parts(&self) -> f64 {
        (self.fine * self.fine) as f64 * foam::REFERENCE_AREA / (self.shape.pitch[0] * self.shape.pitch[1])
    }

    /// Adds the forces of the bristles, in the pad's frame.
    fn rub(&mut self, dt: f64, wrench: &mut Wrench, loads: &mut [Wrench]) {
        let cols = self.shape.cols;
        for (index, tactel) in self.tactels.iter_mut().enumerate() {
            if tactel.normal == 0.0 {
                (tactel.shear, tactel.friction) = (BristleShear::default(), Vec2::ZERO);
                continue;
            }
            let place = Vec3::new(self.shape.x((index % cols) as f64), self.shape.y((index / cols) as f64), 0.0);
            let slide = -self.slides[tactel.object].at(place);
            tactel.rub(dt, slide.truncate(), [self.shear, self.shear_damping], &self.foam);
            let push = tactel.friction.extend(0.0);
            wrench.push(place, push);
            loads[tactel.object].push(place, -push);
        }
    }

    /// Returns the energy that foam, objects and bristles store [J].
    #[cfg(test)]
    pub(super) fn energy(&self, objects: &[Object]) -> f64 {
        let softness = |touch: &Touch| objects[touch.object].softness * self.parts();
        let columns: f64 = self.touching.iter().map(|touch| self.column.energy(touch.depth, softness(touch))).sum();
        let bristles = self.tactels.iter().map(|t| t.shear.energy(self.shear));
        columns + bristles.sum::<f64>()
    }
}

impl Bristle {
    /// Shears the foam by the `velocity` of the pad relative to the object [m/s], up to the friction limit.
    fn rub(&mut self, dt: f64, velocity: Vec2, spring: [f64; 2], foam: &Foam) {
        let speed = velocity.length() / STRIBECK_SPEED;
        let (still, sliding) = (foam.static_friction, foam.sliding_friction);
        let max_force = (sliding + (still - sliding) / (1.0 + speed * speed)) * self.normal;
        self.friction = self.shear.rub(dt, velocity, spring, max_force);
    }
}

/// The rays through all columns, in the frame of an object.
struct Rays {
    /// Origin of the ray in the middle of the pad, at the plate.
    origin: Vec3,
    /// Axes of the pad.
    axes: [Vec3; 3],
    thickness: f64,
    /// Rotation from the frame of the object to the frame of the pad.
    to_pad: Mat3,
}

impl Rays {
    fn from(&self, x: f64, y: f64) -> Vec3 {
        self.origin + self.axes[0] * x + self.axes[1] * y
    }

    /// Returns whether an object is clear of all columns of the tactels from `first` to before `last`, as row and
    /// column.
    fn is_clear(&self, object: &Object, shape: &ImageShape, first: [usize; 2], last: [usize; 2]) -> bool {
        let middle = |axis: usize| (first[axis] + last[axis] - 1) as f64 / 2.0;
        let centre = self.from(shape.x(middle(1)), shape.y(middle(0))) + self.axes[2] * (self.thickness / 2.0);
        let (wide, high) = ((last[1] - first[1]) as f64 * shape.pitch[0], (last[0] - first[0]) as f64 * shape.pitch[1]);
        object.shape.clearance(centre) > Vec3::new(wide, high, self.thickness).length() / 2.0
    }
}
