//! The names of joints, which tell whether two vectors are of one arm.

use tactflow_runtime::node::{Mistake, Mistakes};
use tactflow_runtime::signal::JointsShape;

/// Returns the names of the joints, from the base to the tip.
pub(super) fn names(shape: &JointsShape) -> Vec<&str> {
    shape.joints.iter().map(|joint| joint.name.as_str()).collect()
}

/// Checks that the joints of the wire are those of the model. The mistake marks `position`.
pub(super) fn check_joints(wire: &JointsShape, model: &JointsShape) -> Result<(), Mistakes> {
    let (wire, model) = (names(wire), names(model));
    let message = match wire.iter().zip(&model).find(|(wire, model)| wire != model) {
        _ if wire.len() != model.len() => {
            format!("the wire has {} joints, but the model has {} up to the tip", wire.len(), model.len())
        }
        Some((wire, model)) => format!("the wire has joint `{wire}` where the model has `{model}`"),
        None => return Ok(()),
    };
    let help = format!("the model's joints are `{}`", model.join("`, `"));
    Err(Mistake::input("position", message).help(help).into())
}
