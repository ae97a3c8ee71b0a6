//! The joints of an arm, with the limits that the inputs and the parameters state.

use tactflow_runtime::node::{At, Mistake, Mistakes};
use tactflow_runtime::signal::{Joint, JointsShape};
use tactflow_runtime::source::Code;

use super::Params;

/// Returns the joints with the narrowest of the limits that the inputs and the parameters state.
///
/// # Errors
/// The inputs have different joints, or nothing states the acceleration or the speed of a joint.
pub(super) fn joints(
    params: &Params,
    velocity: &JointsShape,
    position: &JointsShape,
    equilibrium: &JointsShape,
) -> Result<Vec<Joint>, Mistakes> {
    let names = |shape: &JointsShape| shape.joints.iter().map(|joint| joint.name.clone()).collect::<Vec<_>>();
    for (input, shape) in [("position", position), ("equilibrium", equilibrium)] {
        if names(shape) != names(velocity) {
            let message = format!("`{input}` has the joints {:?}, but `velocity` {:?}", names(shape), names(velocity));
            return Err(Mistake::input(input, message).help("wire them to the same arm").into());
        }
    }
    let acceleration = params.acceleration.unwrap_or(f64::INFINITY);
    let joints: Vec<Joint> = velocity
        .joints
        .iter()
        .zip(&position.joints)
        .map(|(wanted, has)| Joint {
            name: has.name.clone(),
            lower: has.lower.max(wanted.lower),
            upper: has.upper.min(wanted.upper),
            speed: has.speed.min(wanted.speed) * params.speed,
            acceleration: has.acceleration.min(wanted.acceleration).min(acceleration),
            start: has.start,
        })
        .collect();
    if let Some(joint) = joints.iter().find(|joint| !joint.acceleration.is_finite()) {
        let message = format!("the arm states no maximum acceleration of joint `{}`", joint.name);
        let mistake = Mistake::new(Code::MissingKey, At::Node, message);
        return Err(mistake.help("add `acceleration = 5.0`, in rad/s²").into());
    }
    if let Some(joint) = joints.iter().find(|joint| !joint.speed.is_finite()) {
        let message = format!("the arm states no maximum speed of joint `{}`", joint.name);
        let help = "add the speed of the joint to the model of the arm";
        return Err(Mistake::input("position", message).help(help).into());
    }
    Ok(joints)
}
