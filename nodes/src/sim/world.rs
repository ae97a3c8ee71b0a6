//! The physics of the simulated bench: an arm with a pad, and objects, stepped together.

use parry3d_f64::math::{Rot3, Vec3};
use tactflow_runtime::device::Disturbance;
use tactflow_runtime::signal::ImageShape;

use super::contact::Contact;
use super::foam::Foam;
use super::housing::Housing;
use super::imprint::{Forces, Imprint};
use super::joints::SimArm;
use super::object::Object;
use super::survey::{Measured, Survey, measure};
use super::wrench::Wrench;

/// The arm, the pad and the objects.
pub struct World {
    pub(super) arm: SimArm,
    pub(super) objects: Vec<Object>,
    pub(super) contact: Contact,
    housing: Option<Housing>,
    /// Wrench on the pad and its housing about the origin of the pad, in the base, as of the last step.
    wrench: Wrench,
    pub(super) imprint: Imprint,
    pub(super) shape: ImageShape,
    /// Axes of the sensor at the start, in the base.
    axes: Rot3,
    /// Force of a hand on the sensor, in the base [N].
    push: Vec3,
    /// Force on each object, and its moment about the centre of the object, in the base.
    loads: Vec<Wrench>,
    /// Simulated time [s].
    time: f64,
    /// Longest step [s].
    max_step: f64,
    /// Index and survey of the first object that is not infinite.
    survey: Option<(usize, Survey)>,
    /// Whether the imprint is older than the contact.
    is_stale: bool,
}

impl World {
    /// Returns a world at time 0, with points of the pad at most `apart` [m] apart and steps of at most `max_step` [s].
    #[must_use]
    pub fn new(arm: SimArm, objects: Vec<Object>, shape: ImageShape, foam: Foam, apart: f64, max_step: f64) -> Self {
        let spread = foam.spread;
        let contact = Contact::new(shape.clone(), foam, apart, objects.len());
        let imprint = Imprint::new(&shape, contact.fine, spread);
        let loads = vec![Wrench::default(); objects.len()];
        let from = arm.motion().pose;
        let survey = objects.iter().enumerate().find_map(|(i, object)| Some((i, Survey::new(object, from)?)));
        Self {
            survey,
            arm,
            objects,
            contact,
            housing: None,
            wrench: Wrench::default(),
            imprint,
            shape,
            axes: from.rotation,
            push: Vec3::ZERO,
            loads,
            time: 0.0,
            max_step,
            is_stale: true,
        }
    }

    /// Computes the friction on each tactel too, if the pad `has_drag`.
    #[must_use]
    pub fn with_drag(self, has_drag: bool) -> Self {
        if has_drag { Self { imprint: self.imprint.with_drag(), ..self } } else { self }
    }

    /// Adds the housing of the pad.
    #[must_use]
    pub fn with_housing(self, housing: Option<Housing>) -> Self {
        Self { housing, ..self }
    }

    /// Returns the force and the torque on the pad, its housing and a hand at the sensor about the origin of the pad, in
    /// its axes [N, N m].
    #[must_use]
    pub fn wrench(&self) -> [f64; 6] {
        let pose = self.arm.motion().pose;
        let [force, moment] = [self.wrench.force, self.wrench.moment].map(|v| pose.inverse_transform_vector(v));
        [force.x, force.y, force.z, moment.x, moment.y, moment.z]
    }

    /// Advances to `time` [s], with the equilibrium of the joints moving at `velocity` [rad/s].
    pub fn advance(&mut self, time: f64, velocity: &[f64]) {
        let steps = ((time - self.time) / self.max_step - 1e-9).ceil().max(1.0);
        let (begin, dt) = (self.time, (time - self.time) / steps);
        for step in 1..=steps as u64 {
            let now = begin + dt * step as f64;
            for (object, load) in self.objects.iter_mut().zip(&self.loads) {
                object.step(now, dt, load);
            }
            let pad = self.arm.motion();
            self.contact.step(dt, &pad, &self.objects, &mut self.loads);
            self.wrench = self.contact.wrench;
            if let Some(housing) = &self.housing {
                housing.press(&pad, &self.objects, &mut self.wrench, &mut self.loads);
            }
            for (object, load) in self.objects.iter().zip(&mut self.loads) {
                *load = load.about(pad.pose.translation - object.pose.translation);
            }
            self.wrench.force += self.push;
            self.arm.step(dt, velocity, &self.wrench);
        }
        self.time = time;
        self.is_stale = true;
    }

    /// Disturbs the world from now on.
    pub fn disturb(&mut self, disturbance: &Disturbance) {
        let Disturbance { push, velocity, stiffness, is_gone } = *disturbance;
        self.push = self.axes * Vec3::from(push);
        let velocity = self.axes * Vec3::from(velocity);
        self.objects.iter_mut().for_each(|object| object.disturb(velocity, stiffness, is_gone));
    }

    /// Returns whether all positions are finite and plausible, so that the simulation is stable.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let is_near = |place: Vec3| place.is_finite() && place.length() < 1e3;
        is_near(self.arm.motion().pose.translation)
            && self.objects.iter().all(|object| is_near(object.sag) && is_near(object.tilt))
    }

    /// Returns the noise-free forces on the tactels.
    pub fn forces(&mut self) -> &Forces {
        if std::mem::take(&mut self.is_stale) {
            self.imprint.take(&self.contact);
        }
        &self.imprint.forces
    }

    /// Returns the errors of a `point` in the base that the graph reports, and counts it for the coverage.
    pub fn measure(&mut self, point: Vec3) -> Option<Measured> {
        if let Some((object, survey)) = &mut self.survey {
            survey.add(&self.objects[*object], point);
        }
        measure(&self.objects, self.arm.motion().pose, point)
    }

    /// Returns the fraction of the surface that has been touched, or `None` if every object is infinite.
    #[must_use]
    pub fn coverage(&self) -> Option<f64> {
        self.survey.as_ref().map(|(_, survey)| survey.coverage())
    }

    /// Returns the energy that is stored in motion, springs, foam and friction [J].
    #[cfg(test)]
    pub(super) fn energy(&self) -> f64 {
        let objects: f64 = self.objects.iter().map(Object::energy).sum();
        self.arm.energy() + self.contact.energy(&self.objects) + objects
    }
}
