//! `inverse_jacobian`: the sum of column times control. The columns are parameters, as signs differ between sensors.
//!
//! The rolling entries (wx of y, wy of x) need opposite signs. With equal signs, as eq. 5 of the paper prints them, the
//! contact is lost.

use tactflow_runtime::node::{Components, Describe, In, Inputs, Map, Mistakes, Node, Out, Outputs, Param, Setup, Tick};
use tactflow_runtime::signal::{Features, Twist};

/// Turns the control of each feature into a motion of the sensor.
///
/// The twist is the sum of column times control over the features, in their order: the matrix J_s^-1 of eq. 5 of the
/// paper, with one column for each feature. All signs of a task are in these columns. The columns of the example are
/// right for z out of the pad toward the object, a right-handed frame, an angle alpha from +x toward +y and
/// e = setpoint - measured. The column of alpha is then `[0, 0, 0, 0, 0, -1]`.
///
/// The first two columns slide the pad and also roll it, by 20 rad for each metre; with 1 instead of 20 it hardly
/// rolls. The rolling entries (wy of x, wx of y) have opposite signs. With equal signs, as the paper prints them, the
/// contact is lost. A wrong sign makes the error grow at once, so test the signs of a new sensor one at a time, and
/// delete the other components with a `projector`.
///
/// A feature that is absent contributes nothing. A `projector` behind this node selects the components that are used.
///
/// ```toml
/// [nodes.jacobian]
/// type = "inverse_jacobian"
/// in.control = "pid.control"
/// #                    vx  vy  vz   wx   wy  wz
/// columns.x        = [ -1,  0,  0,   0, -20,  0 ]   # [1, rad per m]
/// columns.y        = [  0, -1,  0,  20,   0,  0 ]
/// columns.pressure = [  0,  0,  1,   0,   0,  0 ]   # [m per N per tactel]
/// ```
#[derive(Describe)]
pub struct InverseJacobian {
    /// One for each feature, in their order.
    columns: Box<[Twist]>,
}

/// Parameters of `inverse_jacobian`.
#[derive(Debug, Clone, Param)]
pub struct Params {
    /// Column of each feature, `[vx, vy, vz, wx, wy, wz]`, for one unit of the feature.
    #[param(unit = "m/_, rad/_", live)]
    columns: Map<[f64; 6]>,
}

/// What `inverse_jacobian` reads.
#[derive(Inputs)]
pub struct Inputs<'a> {
    /// Control of each feature.
    #[port(unit = "_/s", frame = "A")]
    control: In<'a, Features>,
}

/// What `inverse_jacobian` writes.
#[derive(Outputs)]
pub struct Outputs {
    /// Twist that reduces the errors.
    #[port(frame = "A")]
    twist: Out<Twist>,
}

impl Node for InverseJacobian {
    type Params = Params;
    type Inputs<'a> = Inputs<'a>;
    type Outputs = Outputs;
    type State = ();

    fn new(params: Params, setup: &mut Setup<Self>) -> Result<Self, Mistakes> {
        let columns = params.columns.in_order("columns", setup.inputs.control.names())?;
        Ok(Self { columns: columns.into_iter().map(|column| Twist((*column).into())).collect() })
    }

    fn uses(&self, wanted: &[Components]) -> Vec<Components> {
        let is_used = |column: &Twist| (0..6).any(|i| column.0[i] != 0.0 && wanted[0].has(i));
        vec![Components::of(self.columns.len(), |i| is_used(&self.columns[i]))]
    }

    fn step(&self, _: &Tick, inputs: Inputs<'_>, out: &mut Outputs, (): &mut ()) {
        let mut sum = Twist::default();
        for (column, control) in self.columns.iter().zip(inputs.control.iter()) {
            if let Some(control) = control {
                sum.0 += column.0 * *control;
            }
        }
        out.twist.set(sum);
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector3;
    use proptest::prelude::*;
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::node::At;
    use tactflow_runtime::signal::{Feature, Features, FeaturesShape, Stamp, Unit};
    use tactflow_runtime::source::Code;

    use super::*;

    const COLUMNS: &str = "
        columns.alpha    = [  0,  0, 0,  0,   0, -1 ]
        columns.pressure = [  0,  0, 1,  0,   0,  0 ]
        columns.x        = [ -1,  0, 0,  0, -20,  0 ]
        columns.y        = [  0, -1, 0, 20,   0,  0 ]";

    fn rig(params: &str) -> Result<NodeRig, Mistakes> {
        let units = [("x", Unit::METRE), ("y", Unit::METRE), ("pressure", Unit::NEWTON), ("alpha", Unit::AXIAL)];
        let features = units.map(|(name, unit)| Feature { name: name.into(), unit: unit.per_second() });
        NodeRig::new::<InverseJacobian>(params, &[("control", FeaturesShape { features: features.into() }.into())])
    }

    fn control(rig: &mut NodeRig, values: [Option<f64>; 4]) {
        let stamp = Stamp { nanos: rig.tick.now, device: 0 };
        let tick = rig.tick.index;
        rig.edit("control", stamp, |control: &mut Features| {
            for (i, value) in values.into_iter().enumerate() {
                match value {
                    Some(value) => control.set(i, value, tick, stamp),
                    None => control.lose(i, tick),
                }
            }
        });
        rig.step();
    }

    #[test]
    fn the_sum_is_over_the_features_that_are_present() {
        let cases: [([Option<f64>; 4], [f64; 6]); 6] = [
            ([Some(1.0), None, None, None], [-1.0, 0.0, 0.0, 0.0, -20.0, 0.0]),
            ([None, Some(1.0), None, None], [0.0, -1.0, 0.0, 20.0, 0.0, 0.0]),
            ([None, None, Some(1.0), None], [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]),
            ([None, None, None, Some(1.0)], [0.0, 0.0, 0.0, 0.0, 0.0, -1.0]),
            ([Some(2.0), Some(3.0), Some(4.0), Some(5.0)], [-2.0, -3.0, 4.0, 60.0, -40.0, -5.0]),
            ([Some(2.0), None, Some(4.0), None], [-2.0, 0.0, 4.0, 0.0, -40.0, 0.0]),
        ];
        let mut rig = rig(COLUMNS).unwrap();
        for (values, twist) in cases {
            control(&mut rig, values);
            assert_eq!(rig.get::<Twist>("twist"), Some(&Twist(twist.into())), "{values:?}");
        }
        control(&mut rig, [None; 4]);
        assert_eq!(rig.get::<Twist>("twist"), None, "nothing to reduce is no twist");
    }

    #[test]
    fn a_feature_is_used_if_its_column_has_a_wanted_component() {
        let columns = [[-1.0, 0.0, 0.0, 0.0, -20.0, 0.0], [0.0, 0.0, 1.0, 0.0, 0.0, 0.0]];
        let jacobian = InverseJacobian { columns: columns.map(|column| Twist(column.into())).into() };
        // vx, vy, vz, wx, wy, wz; of the features x and pressure.
        let cases = [([0; 6], [0, 0]), ([1, 0, 0, 0, 0, 0], [1, 0]), ([0, 0, 0, 0, 1, 0], [1, 0]), ([1; 6], [1, 1])];
        for (wanted, used) in cases.into_iter().chain([([0, 1, 1, 1, 0, 1], [0, 1])]) {
            let wanted = Components::of(6, |i| wanted[i] == 1);
            assert_eq!(jacobian.uses(&[wanted]), [Components::of(2, |i| used[i] == 1)], "{wanted:?}");
        }
    }

    proptest! {
        #[test]
        fn the_sensor_slides_toward_the_contact_and_rolls_away_from_it(x in -0.04..0.04, y in -0.04..0.04) {
            prop_assume!(x * x + y * y > 1e-8);
            let mut rig = rig(COLUMNS).unwrap();
            control(&mut rig, [Some(0.0 - x), Some(0.0 - y), None, None]);
            let twist = *rig.get::<Twist>("twist").unwrap();
            let contact = Vector3::new(x, y, 0.0);
            prop_assert!(twist.linear().dot(&contact) > 0.0);
            // z points toward the object: where it touches the pad gives way, so the contact wanders to the middle.
            prop_assert!(twist.angular().cross(&contact).z < 0.0);
        }
    }

    #[test]
    fn columns_and_features_must_agree() {
        let cases = [
            (
                COLUMNS.replace("columns.pressure", "columns.force"),
                vec![(Code::UnknownKey, At::Key("columns.force".into()))],
            ),
            (COLUMNS.replace("columns.y ", "# "), vec![(Code::MissingKey, At::Key("columns".into()))]),
            (
                format!("{COLUMNS}\ncolumns.z = [0, 0, 1, 0, 0, 0]"),
                vec![(Code::UnknownKey, At::Key("columns.z".into()))],
            ),
        ];
        for (text, expected) in cases {
            let mistakes = rig(&text).err().unwrap();
            let found: Vec<_> = mistakes.into_iter().map(|mistake| (mistake.code, mistake.at)).collect();
            assert_eq!(found, expected, "{text}");
        }
        for bad in ["[0, 0, 1, 0, 0]", "[0, 0, 1, 0, 0, 0, 0]", "1.0", "[0, 0, 1, 0, 0, nan]"] {
            let text = COLUMNS.replace("[  0,  0, 1,  0,   0,  0 ]", bad);
            let mistakes = rig(&text).err().unwrap();
            assert_eq!((mistakes.len(), mistakes[0].code), (1, Code::BadValue), "{bad}");
        }
    }
}
