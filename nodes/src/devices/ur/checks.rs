//! What must hold before the robot gets its first velocity.

use nalgebra::Rotation3;

use super::geometry;
use super::recipe::{JOINTS, State};
use crate::devices::start::{StartCheck, StartReport};

/// The checks before the first velocity.
#[derive(Debug, Clone)]
pub(super) struct Checks {
    pub(super) start: StartCheck,
    /// For each joint of the controller, its place in the model.
    pub(super) order: [usize; JOINTS],
    /// From the base of the controller to the root of the model.
    pub(super) base: Rotation3<f64>,
    /// Pose of the tool centre point in the flange, for a controller that does not report it.
    pub(super) tcp_offset: Option<[f64; 6]>,
    /// Mass of the tool and by how much the payload of the controller may differ from it [kg].
    pub(super) tool_mass: Option<[f64; 2]>,
}

impl Checks {
    /// Checks the state of a still robot. `is_first` is whether no velocity has moved it in this run.
    ///
    /// # Errors
    /// What is wrong, and what to correct.
    pub(super) fn check(&self, state: &State, is_first: bool) -> Result<(), String> {
        self.check_payload(state)?;
        let [measured, commanded] = [state.q, state.target_q].map(|q| in_order(&self.order, &q));
        let offset = state.tcp_offset.or(self.tcp_offset);
        let tip = geometry::flange(&self.base, state.tcp_pose, offset.unwrap_or_default());
        let tip = Some(tip);
        let report =
            StartReport { measured: &measured, commanded: &commanded, target: &commanded, held: None, tip, is_first };
        self.start.check(&report).map_err(|error| match offset {
            Some(_) => error.0,
            None => format!("{}. The robot does not report its TCP offset: write it as `tcp_offset`", error.0),
        })
    }

    fn check_payload(&self, state: &State) -> Result<(), String> {
        let Some([mass, bound]) = self.tool_mass else { return Ok(()) };
        let Some(payload) = state.payload else {
            return Err("the robot does not report its payload: check it on the pendant, and remove `tool_mass`".into());
        };
        if (payload - mass).abs() <= bound {
            return Ok(());
        }
        Err(format!(
            "the payload of the robot is {payload:.3} kg, but `tool_mass` is {mass:.3} kg: set the payload on the pendant"
        ))
    }
}

/// Returns values of the joints in the order of the model, from those in the order of the controller.
pub(super) fn in_order(order: &[usize; JOINTS], values: &[f64; JOINTS]) -> [f64; JOINTS] {
    let mut ordered = [0.0; JOINTS];
    for (place, value) in order.iter().zip(values) {
        ordered[*place] = *value;
    }
    ordered
}

/// Returns values of the joints in the order of the controller, from those in the order of the model.
pub(super) fn of_controller(order: &[usize; JOINTS], values: &[f64]) -> [f64; JOINTS] {
    order.map(|place| values.get(place).copied().unwrap_or_default())
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use tactflow_runtime::node::FilePath;

    use super::super::recipe::{Output, Recipe};
    use super::*;
    use crate::arm::model::load;
    use crate::arm::mount::Mount;
    use crate::devices::start::StartBounds;

    const ORDER: [usize; JOINTS] = [0, 1, 2, 3, 4, 5];

    fn checks() -> Checks {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../graphs/robots/ur5e.urdf").into();
        let chain = load(&FilePath { path, span: 0..0, builtin: None }, "tool0", &Mount::NONE).unwrap();
        let start = StartCheck::new(chain, StartBounds::default(), None);
        Checks { start, order: ORDER, base: geometry::base(0.0), tcp_offset: None, tool_mass: None }
    }

    /// The arm lies stretched along -x, and the flange looks along -y (the sums of the lengths of its maker's table).
    fn stretched() -> State {
        let recipe = Recipe::read(&[Output::RobotMode], b"\x01INT32").unwrap();
        let pose = [-0.8172, -0.2329, 0.0628, PI / 2.0, 0.0, 0.0];
        State { tcp_pose: pose, ..recipe.state(&[1, 0, 0, 0, 7]).unwrap() }
    }

    #[test]
    fn the_pose_of_the_robot_is_compared_with_the_model() {
        assert_eq!(checks().check(&stretched(), true), Ok(()));
        let mut moved = stretched();
        moved.tcp_pose[2] += 0.003;
        let why = checks().check(&moved, true).unwrap_err();
        assert!(why.contains("3.0 mm") && why.ends_with("write it as `tcp_offset`"), "{why}");
        moved.tcp_offset = Some([0.0; 6]);
        assert!(checks().check(&moved, true).unwrap_err().ends_with("set on the controller"));
        // A tool of 0.1 m along the z of the flange, which is -y of the base.
        let mut tool = stretched();
        tool.tcp_pose[1] -= 0.1;
        assert!(checks().check(&tool, true).is_err());
        tool.tcp_offset = Some([0.0, 0.0, 0.1, 0.0, 0.0, 0.0]);
        assert_eq!(checks().check(&tool, true), Ok(()));
        let known = Checks { tcp_offset: tool.tcp_offset.take(), ..checks() };
        assert_eq!(known.check(&tool, true), Ok(()));
    }

    #[test]
    fn a_base_that_is_turned_needs_its_yaw() {
        let mut turned = stretched();
        // The controller of an arm whose model is turned by half a turn reports x and y with the other sign. A half turn
        // about z after a quarter turn about x is a half turn about the axis between y and z.
        let axis = PI * 0.5f64.sqrt();
        turned.tcp_pose = [0.8172, 0.2329, 0.0628, 0.0, axis, axis];
        assert!(checks().check(&turned, true).is_err());
        assert_eq!(Checks { base: geometry::base(PI), ..checks() }.check(&turned, true), Ok(()));
    }

    #[test]
    fn the_payload_must_be_that_of_the_tool() {
        let checks = Checks { tool_mass: Some([0.5, 0.1]), ..checks() };
        assert!(checks.check(&stretched(), true).unwrap_err().contains("does not report its payload"));
        for (payload, is_right) in [(0.5, true), (0.59, true), (0.61, false), (0.0, false)] {
            let found = checks.check(&State { payload: Some(payload), ..stretched() }, true);
            assert_eq!(found.is_ok(), is_right, "{found:?}");
        }
    }

    #[test]
    fn joints_change_their_order_and_back() {
        let order = [2, 0, 1, 5, 4, 3];
        let ordered = in_order(&order, &[10.0, 11.0, 12.0, 13.0, 14.0, 15.0]);
        assert_eq!(ordered, [11.0, 12.0, 10.0, 15.0, 14.0, 13.0]);
        assert_eq!(of_controller(&order, &ordered), [10.0, 11.0, 12.0, 13.0, 14.0, 15.0]);
    }
}
