//! The simulated bench as physics: an arm that carries a pad, and objects, stepped together.

use parry3d_f64::math::{Pose3, Vec3};
use tactflow_runtime::signal::ImageShape;

use super::contact::{Contact, Motion};
use super::imprint::Imprint;
use super::joints::Arm;
use super::object::Object;
use super::survey::{Measured, Survey, measure};
use super::truth::Truth;

/// Everything that has mass, gives way or is touched.
pub struct World {
    pub(super) arm: Arm,
    pub(super) objects: Vec<Object>,
    pub(super) contact: Contact,
    imprint: Imprint,
    shape: ImageShape,
    /// Force on each object [N].
    loads: Vec<Vec3>,
    /// [s]
    time: f64,
    /// Longest step [s].
    longest: f64,
    /// What has been measured of the first object that has an end.
    survey: Option<(usize, Survey)>,
    /// Whether the imprint is of an earlier time.
    is_old: bool,
}

impl World {
    /// A world at time 0, with steps of at most `longest` [s].
    #[must_use]
    pub fn new(
        arm: Arm,
        objects: Vec<Object>,
        contact: Contact,
        imprint: Imprint,
        shape: ImageShape,
        longest: f64,
    ) -> Self {
        let loads = vec![Vec3::ZERO; objects.len()];
        let from = start(&arm);
        let surveys = objects.iter().enumerate().filter_map(|(i, object)| Some((i, Survey::new(object, from)?)));
        let survey = surveys.take(1).next();
        Self { survey, arm, objects, contact, imprint, shape, loads, time: 0.0, longest, is_old: true }
    }

    /// Goes on to `time` [s] with the joints' equilibrium moving at `velocity` [rad/s].
    pub fn advance(&mut self, time: f64, velocity: &[f64]) {
        let steps = ((time - self.time) / self.longest - 1e-9).ceil().max(1.0);
        let (begin, dt) = (self.time, (time - self.time) / steps);
        for step in 1..=steps as u64 {
            let now = begin + dt * step as f64;
            for (object, load) in self.objects.iter_mut().zip(&self.loads) {
                object.step(now, dt, *load);
            }
            self.contact.step(dt, &self.arm.motion(), &self.objects, &mut self.loads);
            self.arm.step(dt, velocity, &self.contact.wrench());
        }
        self.time = time;
        self.is_old = true;
    }

    /// Whether everything is still somewhere.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let is_near = |place: Vec3| place.is_finite() && place.length() < 1e3;
        is_near(self.pad().pose.translation) && self.objects.iter().all(|object| is_near(object.sag()))
    }

    /// Where the pad is and how it moves.
    #[must_use]
    pub fn pad(&self) -> Motion {
        self.arm.motion()
    }

    /// The clean image [N].
    pub fn image(&mut self) -> &[f64] {
        if std::mem::take(&mut self.is_old) {
            self.imprint.take(self.contact.touching());
        }
        self.imprint.forces()
    }

    /// What is true now; tactels count from `threshold` [N].
    pub fn truth(&mut self, threshold: f64) -> Truth {
        self.image();
        let pad = self.pad();
        Truth::of(&pad, &self.contact, &self.objects, &self.shape, self.imprint.forces(), threshold)
    }

    /// What a point in the base that the graph has measured is worth; it counts for the coverage.
    pub fn measure(&mut self, point: Vec3) -> Option<Measured> {
        if let Some((object, survey)) = &mut self.survey {
            survey.add(&self.objects[*object], point);
        }
        measure(&self.objects, self.pad().pose, point)
    }

    /// Share of the surface that has been measured; none if the object has no end.
    #[must_use]
    pub fn coverage(&self) -> Option<f64> {
        self.survey.as_ref().map(|(_, survey)| survey.coverage())
    }

    /// The energy that is stored in motion, springs, foam and friction [J].
    #[cfg(test)]
    pub(super) fn energy(&self) -> f64 {
        let objects: f64 = self.objects.iter().map(Object::energy).sum();
        self.arm.energy() + self.contact.energy(&self.objects) + objects
    }
}

/// Whether a spring and a damper are resolved by steps of `dt` [s]: `stiffness` [1/s²] and `damping` [1/s] are by the
/// mass. A step of the speed first and the place then is stable while d²k + 2 d c < 4; what adds the foam is left half.
#[must_use]
pub fn is_resolved(stiffness: f64, damping: f64, dt: f64) -> bool {
    dt * dt * stiffness + 2.0 * dt * damping <= 2.0
}

/// The pose that a sensor has in the base.
#[must_use]
pub fn start(arm: &Arm) -> Pose3 {
    super::joints::pose3(&arm.pose)
}
