//! Errors of features: setpoint minus measured, component by component.

use std::f64::consts::{FRAC_PI_2, PI};

use proptest::prelude::*;
use tactflow_runtime::harness::{NodeRig, places};
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
fn the_error_has_the_names_units_and_order_of_the_wires() {
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
        let setpoint = Setpoint { value: setpoint, is_axial: true };
        let error = setpoint.error(measured);
        prop_assert!(-FRAC_PI_2 < error && error <= FRAC_PI_2);
        prop_assert!(libm::sin(measured + error - setpoint.value).abs() < 1e-14);
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
fn without_a_required_feature_the_whole_error_is_absent() {
    let mut rig = rig(&format!("{SETPOINT}\nrequires = [\"force\"]")).unwrap();
    rig.set("y", 0.25);
    rig.set("alpha", 0.25);
    rig.step();
    assert_eq!(errors(&rig), [None; 3], "the required feature was never present");
    rig.set("force", 0.25);
    rig.step();
    assert_eq!(errors(&rig), [Some(-0.25), Some(0.25), Some(1.25)]);
    rig.lose("force");
    rig.step();
    assert_eq!(errors(&rig), [None; 3]);
    rig.set("alpha", 0.5);
    rig.step();
    assert_eq!(errors(&rig), [None; 3], "a new sample, but the required feature is absent");
    rig.set("force", 0.5);
    rig.step();
    assert_eq!(errors(&rig), [Some(-0.25), Some(0.0), Some(1.0)]);
    let stamps = [0, 1, 2].map(|i| rig.get::<Features>("error").unwrap().components()[i].stamp().nanos);
    assert_eq!(stamps, [0, 3_000_000, 4_000_000], "the held inputs keep their stamps");
    rig.lose("y");
    rig.step();
    assert_eq!(errors(&rig), [None, Some(0.0), Some(1.0)], "a feature that is not required is lost alone");
}

#[test]
fn a_component_that_returns_is_not_integrated_twice() {
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
fn a_name_that_does_not_match_is_a_mistake() {
    let key = |name: &str| (Code::UnknownKey, At::Key(name.into()));
    let missing = (Code::MissingKey, At::Key("setpoint".into()));
    let required = |params: &str| {
        let at = params.find("\"z\"").unwrap();
        (Code::BadValue, At::Span(at..at + 3))
    };
    let (one, two) =
        ("setpoint = { y = 0, alpha = 0, force = 1 }", "setpoint = { y = 0, alpha = 0, force = 1, z = 0 }");
    let (one, two) = (format!("{one}\nrequires = [\"force\", \"z\"]"), format!("{two}\nrequires = [\"z\"]"));
    let cases = [
        ("setpoint = { y = 0, alpha = 0 }", vec![missing]),
        ("setpoint = { y = 0, alpha = 0, force = 1, z = 0 }", vec![key("setpoint.z")]),
        ("setpoint = { y = 0, alpha = 0, f = 1 }", vec![key("setpoint.f")]),
        (&one, vec![required(&one)]),
        (&two, vec![key("setpoint.z"), required(&two)]),
    ];
    for (params, expected) in cases {
        let mistakes = rig(params).err().unwrap();
        let found: Vec<_> = mistakes.into_iter().map(|mistake| (mistake.code, mistake.at)).collect();
        assert_eq!(found, expected, "{params}");
    }
    let mistakes = NodeRig::new::<FeatureError>("setpoint = {}", &[]).err().unwrap();
    assert_eq!((mistakes.len(), mistakes[0].code, &mistakes[0].at), (1, Code::MissingInput, &At::Node));
}

#[test]
fn a_setpoint_that_a_feature_never_has_is_warned_of() {
    let scalar = |unit| ScalarShape::of(unit);
    let wires = [
        ("x", scalar(Unit::METRE).within(-0.04, 0.04).into()),
        ("alpha", scalar(Unit::AXIAL).into()),
        ("pressure", scalar(Unit::NEWTON.per_tactel()).into()),
        ("force", scalar(Unit::NEWTON).into()),
        ("raw", scalar(Unit::RAW).into()),
    ];
    let cases: [(&str, &[&str]); 6] = [
        ("x = 0.04, alpha = 1.5708, pressure = 0.1, force = 15, raw = 4000", &[]),
        ("x = -0.02, alpha = -3.1416, pressure = 0, force = 0, raw = -1", &[]),
        ("x = 5.0, alpha = 0, pressure = 0, force = 0, raw = 0", &["unusual-value: `setpoint.x`"]),
        ("x = 0, alpha = 90, pressure = 0, force = 0, raw = 0", &["unusual-value: `setpoint.alpha`"]),
        ("x = 0, alpha = 0, pressure = 100, force = 0, raw = 0", &["unusual-value: `setpoint.pressure`"]),
        ("x = 0, alpha = 0, pressure = 0, force = 15000, raw = 0", &["unusual-value: `setpoint.force`"]),
    ];
    for (setpoint, expected) in cases {
        let params = format!("setpoint = {{ {setpoint} }}");
        assert_eq!(places(&params, &NodeRig::new::<FeatureError>(&params, &wires)), expected, "{setpoint}");
    }
}
