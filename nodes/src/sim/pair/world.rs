//! The physics of the cell: two arms with a pad each, and a free object between them, stepped together.
//!
//! A step computes all forces from the same state, first those of the left pad, then of the right pad, then of the
//! table. Then it moves the object and the arms.

use parry3d_f64::math::{Pose3, Vec3};
use tactflow_runtime::signal::ImageShape;

use super::body::Body;
use super::table::Table;
use crate::sim::contact::{BodyMotion, Contact};
use crate::sim::foam::Foam;
use crate::sim::imprint::{Forces, Imprint};
use crate::sim::joints::SimArm;
use crate::sim::wrench::Wrench;

/// An arm with its pad, on a base in the cell.
pub struct ArmAndPad {
    /// Pose of the arm's base in the cell.
    base: Pose3,
    /// The arm, in its base.
    pub(super) arm: SimArm,
    pub(super) contact: Contact,
    imprint: Imprint,
    /// Force on the object, which the contact states and nothing reads: the wrench on the pad has it too.
    load: [Wrench; 1],
}

impl ArmAndPad {
    /// Returns an arm on its `base` in the cell, with points of its pad at most `apart` [m] apart.
    #[must_use]
    pub fn new(base: Pose3, arm: SimArm, shape: &ImageShape, foam: Foam, apart: f64) -> Self {
        let spread = foam.spread;
        let contact = Contact::new(shape.clone(), foam, apart, 1).with_damped_shear();
        let imprint = Imprint::new(shape, contact.fine, spread);
        Self { base, arm, contact, imprint, load: [Wrench::default()] }
    }

    /// Returns pose and velocity of the pad in the cell.
    #[must_use]
    pub fn pad(&self) -> BodyMotion {
        let BodyMotion { pose, linear, angular } = self.arm.motion();
        let turn = self.base.rotation;
        BodyMotion { pose: self.base * pose, linear: turn * linear, angular: turn * angular }
    }

    /// Returns the noise-free forces on the tactels.
    pub fn forces(&mut self) -> &Forces {
        self.imprint.take(&self.contact);
        &self.imprint.forces
    }

    /// Computes the contact with the object, and returns the wrench on the object about its centre.
    fn press(&mut self, dt: f64, body: &Body) -> Wrench {
        let pad = self.pad();
        self.contact.step(dt, &pad, std::slice::from_ref(&body.object), &mut self.load);
        let Wrench { force, moment } = self.contact.wrench;
        let arm = pad.pose.translation - body.object.pose.translation;
        Wrench { force: -force, moment: -(moment + arm.cross(force)) }
    }

    /// Moves the arm under the wrench on its pad.
    fn step(&mut self, dt: f64, velocity: &[f64]) {
        let back = self.base.rotation.inverse();
        let Wrench { force, moment } = self.contact.wrench;
        self.arm.step(dt, velocity, &Wrench { force: back * force, moment: back * moment });
    }
}

/// The cell: left and right arm, object and table.
pub struct PairWorld {
    pub(super) sides: [ArmAndPad; 2],
    pub(super) body: Body,
    pub(super) table: Table,
    /// Simulated time [s].
    time: f64,
    /// Longest step [s].
    max_step: f64,
}

impl PairWorld {
    /// Returns a cell at time 0, with steps of at most `max_step` [s].
    #[must_use]
    pub const fn new(sides: [ArmAndPad; 2], body: Body, table: Table, max_step: f64) -> Self {
        Self { sides, body, table, time: 0.0, max_step }
    }

    /// Advances to `time` [s], with the equilibrium of each arm's joints moving at its velocity [rad/s].
    pub fn advance(&mut self, time: f64, velocity: [&[f64]; 2]) {
        let steps = ((time - self.time) / self.max_step - 1e-9).ceil().max(1.0);
        let dt = (time - self.time) / steps;
        for _ in 0..steps as u64 {
            self.step(dt, velocity);
        }
        self.time = time;
    }

    fn step(&mut self, dt: f64, velocity: [&[f64]; 2]) {
        let [left, right] = &mut self.sides;
        let loads = [left.press(dt, &self.body), right.press(dt, &self.body), self.table.step(dt, &self.body)];
        let force = loads.iter().map(|load| load.force).sum();
        let moment = loads.iter().map(|load| load.moment).sum();
        self.body.step(dt, &Wrench { force, moment });
        for (side, velocity) in self.sides.iter_mut().zip(velocity) {
            side.step(dt, velocity);
        }
    }

    /// Returns whether both pads press on the object and the table does not bear it.
    #[must_use]
    pub fn is_held(&self) -> bool {
        self.table.force == 0.0 && self.sides.iter().all(|side| side.contact.normal() > 0.0)
    }

    /// Returns whether all positions are finite and plausible, so that the simulation is stable.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        // An object that nothing holds may fall for a long time.
        let is_near = |place: Vec3, reach: f64| place.is_finite() && place.length() < reach;
        let mut pads = self.sides.iter().map(|side| side.pad().pose.translation);
        pads.all(|place| is_near(place, 1e3)) && is_near(self.body.object.pose.translation, 1e9)
    }

    /// Returns the energy that is stored in motion, height, springs, foam and friction [J].
    #[cfg(test)]
    pub(super) fn energy(&self) -> f64 {
        let object = std::slice::from_ref(&self.body.object);
        let sides = self.sides.iter().map(|side| side.arm.energy() + side.contact.energy(object));
        sides.sum::<f64>() + self.body.energy() + self.table.energy(&self.body)
    }
}
