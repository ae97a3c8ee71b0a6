//! `feature_error`: setpoint minus measurement, for every feature (paper eq. 3, the vector Δf).
//!
//! e = setpoint - measured for every feature alike: signs live only in the columns of `inverse_jacobian`. The error of
//! a line's direction is wrapped into (-pi/2, pi/2]. Each component is as fresh and as old as its own input.

use tactflow_runtime::node::{At, Map, Mistake, Mistakes, Node, Setup, Tick};
use tactflow_runtime::signal::{Feature, FeaturesShape, ScalarShape};
use tactflow_runtime::source::Code;
use tactflow_runtime::{inputs, outputs, params};

use crate::motion::axis::wrap_axial;

params! {
    /// Target of each feature [the feature's unit].
    live setpoint: Map<f64>,
    /// Features without which there is no error at all; without any other, only its own component is absent.
    requires: Vec<String> = Vec::new(),
}

inputs! {
    /// The measured features, each under the name it has from here on [any unit].
    feature: Many<Scalar["_", "A"]>,
}

outputs! {
    /// Error of each feature, in the order of the wires [the feature's unit].
    error: Features["_", "A"],
}

/// Target of each feature, and which features the others need.
pub struct FeatureError {
    targets: Box<[Target]>,
    required: Box<[usize]>,
}

struct Target {
    setpoint: f64,
    is_axial: bool,
}

impl tactflow_runtime::node::Describe for FeatureError {
    const NAME: &'static str = "feature_error";
    const SUMMARY: &'static str = "sets the targets of a task: setpoint minus measurement, for every feature";
    const DOC: &'static str = "The vector Δf of the paper's eq. 3: e = setpoint - measured, for every feature that \
        is wired, under the name it is wired by. The same names come back in `pid` and `inverse_jacobian`, in this \
        order; a name that is missing there does not load.\n\n\
        The sign is the same for every feature: which way the sensor moves is said by the columns of \
        `inverse_jacobian` and nowhere else. A setpoint has the unit of its feature. The error of a line's \
        direction is wrapped into (-pi/2, pi/2], since a line looks the same after half a turn.\n\n\
        Each component is as fresh as its own input. A feature that is absent, such as the direction of a round \
        patch, leaves the others alone; list it in `requires` if there shall be no error at all without it.";
    const EXAMPLE: &'static str = r#"
[nodes.error]
type = "feature_error"
in.x = "moments.x"
in.y = "moments.y"
in.pressure = "smooth.value"
setpoint = { x = 0.0, y = 0.0, pressure = 0.1 }   # [m, m, N per tactel]
"#;
}

impl Node for FeatureError {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let wires = &setup.inputs.feature;
        if wires.is_empty() {
            let mistake = Mistake::new(Code::MissingInput, At::Node, "no feature is wired");
            return Err(mistake.help("wire each under its name: `in.x = \"touch.x\"`").into());
        }
        let names = || wires.iter().map(|(name, _)| name.as_str());
        let setpoints = params.setpoint.in_order("setpoint", names());
        let required = indices(&params.requires, names());
        let (setpoints, required) = match (setpoints, required) {
            (Ok(setpoints), Ok(required)) => (setpoints, required),
            (setpoints, required) => {
                return Err([setpoints.err(), required.err()].into_iter().flatten().flatten().collect());
            }
        };
        let target = |(setpoint, (_, shape)): (&f64, &(String, ScalarShape))| Target {
            setpoint: *setpoint,
            is_axial: shape.unit.is_axial(),
        };
        let targets = setpoints.into_iter().zip(wires).map(target).collect();
        let feature = |(name, shape): &(String, ScalarShape)| Feature { name: name.clone(), unit: shape.unit };
        setup.outputs.error = FeaturesShape { features: wires.iter().map(feature).collect() };
        Ok(Self { targets, required })
    }

    fn state(&self) {}

    fn step(&self, tick: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let is_complete = self.required.iter().all(|i| inputs.feature.get(*i).is_some());
        let error = out.error.write();
        for (i, (target, measured)) in self.targets.iter().zip(inputs.feature.iter()).enumerate() {
            let Some(measured) = measured.filter(|_| is_complete) else {
                error.lose(i, tick.index);
                continue;
            };
            // A held input sets its component too when that was away for want of a required feature. It is no second
            // sample: it brings the stamp it had, and from one stamp to the same one no time passes (`Interval`).
            if measured.is_new() || error.components()[i].get().is_none() {
                error.set(i, difference(target, *measured), tick.index, measured.stamp());
            }
        }
    }
}

fn difference(target: &Target, measured: f64) -> f64 {
    let error = target.setpoint - measured;
    if target.is_axial { wrap_axial(error) } else { error }
}

/// Where each of `required` stands among `names`.
fn indices<'n>(required: &[String], names: impl Iterator<Item = &'n str> + Clone) -> Result<Box<[usize]>, Mistakes> {
    let listed = || names.clone().map(|name| format!("`{name}`")).collect::<Vec<_>>().join(", ");
    let unknown = |name: &String| {
        let mistake = Mistake::param("requires", format!("no feature is called `{name}`"));
        mistake.help(format!("the features here are {}", listed()))
    };
    let mistakes: Mistakes = required.iter().filter(|name| !names.clone().any(|n| n == *name)).map(unknown).collect();
    if mistakes.is_empty() {
        Ok(required.iter().filter_map(|name| names.clone().position(|n| n == name)).collect())
    } else {
        Err(mistakes)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Features, Freshness, Scalar, Shape, Stamp, Unit};

    use super::super::pid::Pid;
    use super::*;

    const WIRES: [(&str, Unit); 3] = [("y", Unit::METRE), ("alpha", Unit::AXIAL), ("force", Unit::NEWTON)];
    const SETPOINT: &str = "setpoint = { force = 1.5, alpha = 0.5, y = 0.0 }";

    fn rig(params: &str) -> Result<NodeRig, Mistakes> {
        let wires = WIRES.map(|(name, unit)| (name, Shape::from(ScalarShape::of(unit))));
        NodeRig::new::<FeatureError>(params, &wires)
    }

    fn errors(rig: &NodeRig) -> [Option<f64>; 3] {
        let absent = Features::absent(3);
        let error = rig.get::<Features>("error").unwrap_or(&absent);
        [0, 1, 2].map(|i| error.components()[i].get())
    }

    fn set_all(rig: &mut NodeRig) {
        for (name, _) in WIRES {
            rig.set(name, 0.25);
        }
    }

    #[test]
    fn the_error_has_the_names_the_units_and_the_order_of_the_wires() {
        let features = WIRES.map(|(name, unit)| Feature { name: name.into(), unit }).into();
        assert_eq!(rig(SETPOINT).unwrap().shape("error"), &Shape::from(FeaturesShape { features }));
    }

    #[test]
    fn setpoint_minus_measured() {
        let quarter = FRAC_PI_2;
        let cases: [([f64; 3], [f64; 3]); 5] = [
            ([0.0, 0.5, 1.5], [0.0, 0.0, 0.0]),
            ([0.01, 0.25, 1.0], [-0.01, 0.25, 0.5]),
            // An axis turned by a quarter is as far one way as the other; the error of a force is not wrapped.
            ([0.0, 0.5 - quarter, 101.5], [0.0, quarter, -100.0]),
            ([0.0, 0.5 + quarter, 0.0], [0.0, quarter, 1.5]),
            ([0.0, 0.5 - PI, 0.0], [0.0, 0.0, 1.5]),
        ];
        let mut rig = rig(SETPOINT).unwrap();
        for (measured, expected) in cases {
            for ((name, _), value) in WIRES.into_iter().zip(measured) {
                rig.set(name, value);
            }
            rig.step();
            for (error, expected) in errors(&rig).into_iter().zip(expected) {
                assert!((error.unwrap() - expected).abs() < 1e-15, "{measured:?}: {error:?}, not {expected}");
            }
        }
    }

    proptest! {
        #[test]
        fn an_axial_error_leads_to_the_line_of_the_setpoint(setpoint in -7.0_f64..7.0, measured in -7.0_f64..7.0) {
            let target = Target { setpoint, is_axial: true };
            let error = difference(&target, measured);
            prop_assert!(-FRAC_PI_2 < error && error <= FRAC_PI_2);
            prop_assert!(libm::sin(measured + error - setpoint).abs() < 1e-14);
        }
    }

    #[test]
    fn each_component_is_as_fresh_and_as_old_as_its_input() {
        let mut rig = rig(SETPOINT).unwrap();
        set_all(&mut rig);
        rig.step();
        rig.edit("alpha", Stamp { nanos: 400_000, device: 3 }, |alpha: &mut Scalar| *alpha = 0.0);
        rig.lose("force");
        rig.step();
        let error = rig.get::<Features>("error").unwrap().components();
        let tick = rig.tick.index - 1;
        assert_eq!([0, 1, 2].map(|i| error[i].freshness(tick)), [Freshness::Held, Freshness::New, Freshness::Lost]);
        assert_eq!((error[0].stamp().nanos, error[1].stamp()), (0, Stamp { nanos: 400_000, device: 3 }));
        for (name, _) in WIRES {
            rig.lose(name);
        }
        rig.step();
        assert_eq!((errors(&rig), rig.freshness("error")), ([None; 3], Freshness::Lost));
    }

    #[test]
    fn what_is_required_takes_the_others_with_it_and_brings_them_back() {
        let mut rig = rig(&format!("{SETPOINT}\nrequires = [\"force\"]")).unwrap();
        rig.set("y", 0.25);
        rig.set("alpha", 0.25);
        rig.step();
        assert_eq!(errors(&rig), [None; 3], "it was never there");
        rig.set("force", 0.25);
        rig.step();
        assert_eq!(errors(&rig), [Some(-0.25), Some(0.25), Some(1.25)]);
        rig.lose("force");
        rig.step();
        assert_eq!(errors(&rig), [None; 3]);
        rig.set("alpha", 0.5);
        rig.step();
        assert_eq!(errors(&rig), [None; 3], "something new, but not what is required");
        rig.set("force", 0.5);
        rig.step();
        assert_eq!(errors(&rig), [Some(-0.25), Some(0.0), Some(1.0)]);
        let stamps = [0, 1, 2].map(|i| rig.get::<Features>("error").unwrap().components()[i].stamp().nanos);
        assert_eq!(stamps, [0, 3_000_000, 4_000_000], "the held inputs keep their stamps");
        rig.lose("y");
        rig.step();
        assert_eq!(errors(&rig), [None, Some(0.0), Some(1.0)], "what is not required goes alone");
    }

    #[test]
    fn what_comes_back_is_not_integrated_twice() {
        let mut rig = rig(&format!("{SETPOINT}\nrequires = [\"force\"]")).unwrap();
        let gains = "gains = { y = { ki = 1.0 }, alpha = {}, force = {} }";
        let mut pid = NodeRig::new::<Pid>(gains, &[("error", rig.shape("error").clone())]).unwrap();
        for k in 0..=40 {
            // y comes every 4 ms, the force every 2 ms, and flickers just after a sample of y.
            if k % 4 == 0 {
                rig.set("y", -1.0);
            }
            match k % 4 {
                1 => rig.lose("force"),
                3 => rig.set("force", 1.0),
                _ => {}
            }
            if k == 0 {
                rig.set("force", 1.0);
            }
            rig.step();
            let tick = rig.tick.index - 1;
            match rig.get::<Features>("error") {
                Some(error) => pid.edit("error", rig.mark("error").stamp(), |e: &mut Features| e.clone_from(error)),
                None => pid.lose("error"),
            }
            assert_eq!(pid.tick.index, tick);
            pid.step();
        }
        let integral = pid.get::<Features>("control").unwrap().components()[0].get().unwrap();
        assert!((integral - 0.040).abs() < 1e-12, "1/s² for 40 ms at an error of 1: {integral}");
    }

    #[test]
    fn names_must_agree() {
        let key = |name: &str| (Code::UnknownKey, At::Key(name.into()));
        let missing = (Code::MissingKey, At::Key("setpoint".into()));
        let requires = (Code::BadValue, At::Param("requires".into()));
        let cases = [
            ("setpoint = { y = 0, alpha = 0 }", vec![missing]),
            ("setpoint = { y = 0, alpha = 0, force = 1, z = 0 }", vec![key("setpoint.z")]),
            ("setpoint = { y = 0, alpha = 0, f = 1 }", vec![key("setpoint.f")]),
            ("setpoint = { y = 0, alpha = 0, force = 1 }\nrequires = [\"force\", \"z\"]", vec![requires.clone()]),
            (
                "setpoint = { y = 0, alpha = 0, force = 1, z = 0 }\nrequires = [\"z\"]",
                vec![key("setpoint.z"), requires],
            ),
        ];
        for (params, expected) in cases {
            let mistakes = rig(params).err().unwrap();
            let found: Vec<_> = mistakes.into_iter().map(|mistake| (mistake.code, mistake.at)).collect();
            assert_eq!(found, expected, "{params}");
        }
        let mistakes = NodeRig::new::<FeatureError>("setpoint = {}", &[]).err().unwrap();
        assert_eq!((mistakes.len(), mistakes[0].code, &mistakes[0].at), (1, Code::MissingInput, &At::Node));
    }
}
