//! `stiffness_estimate`: how much a feature changes per metre that the sensor moves along its z.
//!
//! A straight line through the samples (z, p) whose weights decay with their age t as exp(-t / T): recursive least
//! squares with forgetting, with an unknown offset, so that only the changes dp and dz count. Means and central sums
//! are updated with each sample (West, Communications of the ACM 22, 1979), which cancels nothing far from the origin:
//!
//! ```text
//! W = λ W + 1     d = (z, p) - mean     mean += d / W     S = λ S + (1 - 1/W) d d'     λ = exp(-dt / T)
//! ```
//!
//! The slope is S_zp / S_zz, the excitation sqrt(S_zz / W), and the correlation S_zp / sqrt(S_zz S_pp).

use nalgebra::Vector3;
use tactflow_runtime::node::{Describe, In, Inputs, Interval, Mistakes, Node, Out, Outputs, Param, Setup, State, Tick};
use tactflow_runtime::signal::{Flag, Pose, Scalar};

/// Estimates how stiff a contact is: the change of a feature per metre of travel along the sensor's z.
///
/// A gain is best for one stiffness: the same motion changes the pressure of a stiff object more than that of a soft
/// one, and so the gain of the whole loop is larger. This node measures it while the sensor moves, for a
/// `gain_schedule`.
///
/// The slope dp/dz is that of a least-squares line through the newest samples, whose weights decay with the time
/// `memory_s`. z is the travel of the sensor along its own z since the contact. `ratio` is the slope divided by
/// `nominal`, the slope for which the gains were chosen: 1 is as stiff, 5 is five times as stiff.
///
/// **Validity.** Without motion there is nothing to learn. An estimate is `valid` if the standard deviation of the
/// travel is at least `min_travel_m`, the correlation of feature and travel is at least `min_correlation`, and the
/// slope is positive. `ratio` stays at the last valid estimate, and is absent until there is one. After the graph's
/// `reset_after_ms` without the feature or the pose, the estimate begins afresh.
///
/// The pose is measured, so the slope is that of object and foam. A compliant arm gives way too: there the gain of the
/// loop changes less than `ratio`. Wire an unfiltered feature: a filter delays it against the travel, and makes the
/// object look softer. A small `multisine` along z excites a contact that rests. Friction hides small motions: choose
/// `min_travel_m` well above the travel in which the foam sticks.
///
/// ```toml
/// [nodes.stiffness_estimate]
/// type = "stiffness_estimate"
/// in.value = "moments.pressure"
/// in.pose = "state.sensor_pose"
/// nominal = 10.0                      # 0.01 N per tactel for each mm [N per tactel per m]
/// ```
#[derive(Describe)]
pub struct StiffnessEstimate {
    params: Params,
}

/// Parameters of `stiffness_estimate`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Slope at which `ratio` is 1.
    #[param(unit = "U/m", above = 0.0)]
    nominal: f64,
    /// Time in which the weight of a sample decays to 37 %.
    #[param(unit = "s", above = 0.0, default = 2.0)]
    memory_s: f64,
    /// Smallest standard deviation of the travel.
    #[param(unit = "m", above = 0.0, default = 0.0002)]
    min_travel_m: f64,
    /// Smallest correlation of the feature and the travel.
    #[param(unit = "1", range = 0.0..=1.0, default = 0.9)]
    min_correlation: f64,
}

/// What `stiffness_estimate` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// A feature that grows with the travel, such as the pressure or the force.
    #[port(unit = "U", frame = "A")]
    value: In<'a, Scalar>,
    /// Pose of the sensor in the base.
    #[port(frame = "A", reference = "B", quantity = "sensor_pose", sampled)]
    pose: In<'a, Pose>,
}

/// What `stiffness_estimate` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// The last valid slope over `nominal`; absent until there is one.
    #[port(unit = "1", frame = "A", quantity = "stiffness")]
    ratio: Out<Scalar>,
    /// Whether the samples determine the slope.
    valid: Out<Flag>,
}

/// What `stiffness_estimate` remembers.
#[derive(State)]
pub struct State {
    line: Line,
    /// Position of the sensor in the base at the last sample [m].
    position: Option<Vector3<f64>>,
    /// Since the last sample.
    interval: Interval,
    /// The last valid ratio.
    ratio: Option<f64>,
}

/// A straight line through samples with decaying weights.
#[derive(Debug, Clone, Copy, Default)]
struct Line {
    /// Sum of the weights.
    weight: f64,
    /// Mean of travel [m] and value, from the newest travel.
    mean: [f64; 2],
    /// Central sums: travel by travel, travel by value, value by value.
    sums: [f64; 3],
}

impl Line {
    /// Adds a sample that is `travel` [m] after the last one; all older weights decay by the factor `decay`.
    fn add(&mut self, travel: f64, value: f64, decay: f64) {
        // The travel counts from the newest sample, so it never becomes too large for its differences.
        self.mean[0] -= travel;
        self.weight = decay * self.weight + 1.0;
        let (z, p) = (-self.mean[0], value - self.mean[1]);
        self.mean[0] += z / self.weight;
        self.mean[1] += p / self.weight;
        let part = 1.0 - 1.0 / self.weight;
        for (sum, product) in self.sums.iter_mut().zip([z * z, z * p, p * p]) {
            *sum = decay * *sum + part * product;
        }
    }

    /// Returns the line with one sample more, without any travel.
    fn with(mut self, value: f64) -> Self {
        self.add(0.0, value, 1.0);
        self
    }

    /// Whether all sums are finite: a sample that is not a number would stay in them.
    fn is_finite(&self) -> bool {
        self.mean.iter().chain(&self.sums).all(|sum| sum.is_finite())
    }

    /// Returns the slope, or `None` if the samples do not determine it.
    fn slope(&self, min_travel: f64, min_correlation: f64) -> Option<f64> {
        let [zz, zp, pp] = self.sums;
        let is_excited = zz >= min_travel * min_travel * self.weight;
        let is_correlated = zp > 0.0 && zp * zp >= min_correlation * min_correlation * zz * pp;
        (self.weight > 0.0 && is_excited && is_correlated).then(|| zp / zz)
    }
}

impl Node for StiffnessEstimate {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = State;

    fn new(params: Params, _: &mut Setup<Self>) -> Result<Self, Mistakes> {
        Ok(Self { params })
    }

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, state: &mut State) {
        let (pose, value) = (&inputs.pose.0, *inputs.value);
        let position = pose.translation.vector;
        let last = state.position.replace(position);
        match (last, state.interval.step(&inputs.value, tick)) {
            (Some(last), Some(dt)) => {
                let travel = pose.rotation.inverse_transform_vector(&(position - last)).z;
                state.line.add(travel, value, libm::exp(-dt / self.params.memory_s));
            }
            _ => state.line = Line::default().with(value),
        }
        if !state.line.is_finite() {
            state.line = Line::default();
        }
        let slope = state.line.slope(self.params.min_travel_m, self.params.min_correlation);
        let ratio = slope.map(|slope| slope / self.params.nominal).filter(|ratio| ratio.is_finite());
        state.ratio = ratio.or(state.ratio);
        out.valid.set(ratio.is_some());
        if let Some(ratio) = state.ratio {
            out.ratio.set(ratio);
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{IsometryMatrix3, Matrix2, Rotation3, Translation3, Vector2};
    use proptest::prelude::*;
    use tactflow_runtime::harness::{NodeRig, places};
    use tactflow_runtime::random::Random;
    use tactflow_runtime::signal::{Freshness, PoseShape, ScalarShape, Unit};

    use super::*;

    const NOMINAL: &str = "nominal = 10.0\nmemory_s = 0.5\nmin_travel_m = 0.0003";

    fn built(params: &str) -> Result<NodeRig, Mistakes> {
        let value = ScalarShape::of(Unit::NEWTON.per_tactel()).into();
        NodeRig::new::<StiffnessEstimate>(params, &[("value", value), ("pose", PoseShape::default().into())])
    }

    /// The pose of a sensor that is turned and that has moved along its z [m].
    fn pose(z: f64) -> Pose {
        let turn = Rotation3::from_euler_angles(0.4, -0.7, 1.1);
        let place = Vector3::new(0.5, -0.2, 0.3) + turn * Vector3::new(0.001, 0.002, z);
        Pose(IsometryMatrix3::from_parts(Translation3::from(place), turn))
    }

    fn show(rig: &mut NodeRig, z: f64, value: f64) -> (Option<f64>, bool) {
        rig.set("pose", pose(z));
        rig.set("value", value);
        rig.step_ms(4.0);
        (rig.get::<Scalar>("ratio").copied(), *rig.get::<Flag>("valid").unwrap())
    }

    /// The travel of a test signal of 2 Hz [m].
    fn sine(i: u32) -> f64 {
        0.001 * libm::sin(0.004 * 2.0 * std::f64::consts::TAU * f64::from(i))
    }

    #[test]
    fn a_spring_has_its_stiffness_wherever_it_begins() {
        for (stiffness, offset) in [(10.0, 0.0), (50.0, 0.3), (2.0, -7.0)] {
            let mut rig = built(NOMINAL).unwrap();
            let shown = (0..300).map(|i| show(&mut rig, 0.02 + sine(i), offset + stiffness * sine(i)));
            let (ratio, is_valid) = shown.last().unwrap();
            assert!(is_valid && (ratio.unwrap() - 0.1 * stiffness).abs() < 1e-9, "{stiffness}: {ratio:?}");
        }
    }

    proptest! {
        #[test]
        fn it_is_the_least_squares_line_with_decaying_weights(seed in 0..1000u64, count in 20..200usize) {
            let mut random = Random::new(seed, 0);
            let samples: Vec<[f64; 2]> = (0..count)
                .map(|_| [random.uniform(-1.0, 1.0), random.uniform(-0.3, 0.3)])
                .map(|[z, noise]| [0.002 * z, 0.02 * z + 0.02 * noise + 0.4])
                .collect();
            let params = "nominal = 10.0\nmemory_s = 0.1\nmin_travel_m = 1e-9\nmin_correlation = 0.0";
            let mut rig = built(params).unwrap();
            let ratio = samples.iter().map(|[z, value]| show(&mut rig, *z, *value)).last().unwrap().0;
            // The normal equations of value = a + b z, in metres and in millimetres.
            let (mut normal, mut right) = (Matrix2::zeros(), Vector2::zeros());
            for (i, [z, value]) in samples.iter().enumerate() {
                let weight = libm::exp(-0.04 * (count - 1 - i) as f64);
                let row = Vector2::new(1.0, 1e3 * z);
                normal += row * row.transpose() * weight;
                right += row * (*value * weight);
            }
            let slope = normal.lu().solve(&right).unwrap()[1] * 1e3;
            prop_assert!((ratio.unwrap() - slope / 10.0).abs() < 1e-6, "{:?} of {}", ratio, slope / 10.0);
        }
    }

    #[test]
    fn it_is_valid_only_with_enough_motion_that_the_feature_follows() {
        let mut random = Random::new(5, 0);
        let mut noise = move |size: f64| random.uniform(-size, size);
        let mut rig = built(NOMINAL).unwrap();
        assert!((0..200).all(|i| show(&mut rig, 0.1 * sine(i), 1.0 * sine(i)) == (None, false)), "hardly any motion");
        let found: Vec<_> = (0..300).map(|i| show(&mut rig, sine(i), 10.0 * sine(i) + noise(0.001))).collect();
        let (ratio, is_valid) = found[299];
        assert!(is_valid && (ratio.unwrap() - 1.0).abs() < 0.02, "{ratio:?}");
        let kept: Vec<_> = (0..2000).map(|_| show(&mut rig, 0.0, noise(0.001))).collect();
        let (last, is_valid) = kept[1999];
        assert!(!is_valid && (last.unwrap() - 1.0).abs() < 0.3, "it stays at the last valid one: {last:?}");
        for unrelated in [|_: f64, n: f64| n, |z: f64, _: f64| -10.0 * z] {
            let mut rig = built(NOMINAL).unwrap();
            let shown = (0..300).map(|i| show(&mut rig, sine(i), unrelated(sine(i), noise(0.05))));
            assert_eq!(shown.last(), Some((None, false)));
        }
    }

    #[test]
    fn another_object_is_found_within_the_memory() {
        let mut rig = built(NOMINAL).unwrap();
        (0..500).for_each(|i| {
            show(&mut rig, sine(i), 10.0 * sine(i));
        });
        let stiffer = (500..1250).map(|i| show(&mut rig, sine(i), 50.0 * sine(i))).last().unwrap();
        assert!((stiffer.0.unwrap() - 5.0).abs() < 0.05, "{stiffer:?}");
    }

    #[test]
    fn what_is_not_a_number_does_not_stay_and_a_long_absence_begins_afresh() {
        let mut rig = built(NOMINAL).unwrap();
        (0..300).for_each(|i| {
            show(&mut rig, sine(i), 10.0 * sine(i));
        });
        let (ratio, is_valid) = show(&mut rig, 0.0, f64::NAN);
        assert!(!is_valid && (ratio.unwrap() - 1.0).abs() < 1e-9);
        assert!(!show(&mut rig, f64::NAN, 0.0).1);
        let found = (0..300).map(|i| show(&mut rig, sine(i), 20.0 * sine(i))).last().unwrap();
        assert!((found.0.unwrap() - 2.0).abs() < 1e-9 && found.1);
        rig.lose("value");
        rig.step_ms(30.0);
        assert_eq!(rig.freshness("ratio"), Freshness::Lost);
        rig.step();
        assert_eq!(show(&mut rig, 0.0, 0.0), (None, false));
    }

    #[test]
    fn wrong_parameters_are_refused() {
        for (bad, place) in [
            ("", "missing-key: `the node`"),
            ("nominal = 0", "bad-value: `0`"),
            ("nominal = 1\nmin_correlation = 1.5", "bad-value: `1.5`"),
        ] {
            assert_eq!(places(bad, &built(bad)), [place], "{bad}");
        }
    }
}
