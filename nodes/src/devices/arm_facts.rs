//! What every arm states of itself.

use std::borrow::Cow;

use tactflow_runtime::node::{FilePath, Mistake, Mistakes};
use tactflow_runtime::signal::Joint;

use crate::arm::mount::Mount;

/// Whether an arm can start at these positions [rad; m for a prismatic joint].
///
/// # Errors
/// What is wrong with the parameter `start`.
pub(crate) fn check_start(joints: &[Joint], start: &[f64]) -> Result<(), Mistakes> {
    if start.len() != joints.len() {
        let message = format!("`start` has {} entries, but the arm has {} joints", start.len(), joints.len());
        return Err(Mistake::param("start", message).into());
    }
    let outside = joints.iter().zip(start).filter(|(joint, q)| !(joint.lower..=joint.upper).contains(*q));
    let mistakes: Mistakes = outside
        .map(|(Joint { name, lower, upper, .. }, q)| {
            let message = format!("joint `{name}` cannot start at {q}: it goes from {lower:.4} to {upper:.4}");
            Mistake::param("start", message)
        })
        .collect();
    if mistakes.is_empty() { Ok(()) } else { Err(mistakes) }
}

/// What `arm_state` wants to know.
///
/// # Errors
/// If the path of the model is not UTF-8 or cannot be made absolute.
pub(crate) fn facts(
    urdf: &FilePath,
    tip: &str,
    mount: &Mount,
) -> Result<Vec<(Cow<'static, str>, toml::Value)>, Mistakes> {
    let path = fact_of("urdf", urdf)?;
    let list = |numbers: [f64; 3]| toml::Value::from(numbers.to_vec());
    let mount = [("xyz".into(), list(mount.xyz)), ("rpy".into(), list(mount.rpy))];
    let mount = toml::Value::Table(mount.into_iter().collect());
    Ok(vec![("urdf".into(), path.into()), ("tip".into(), tip.into()), ("mount".into(), mount)])
}

/// A file as a fact, for a graph that may stand in another folder: its absolute path; `param` is where it is named.
///
/// # Errors
/// If the path is not UTF-8 or cannot be made absolute.
pub(crate) fn fact_of(param: &str, file: &FilePath) -> Result<String, Mistakes> {
    let path = match file.builtin {
        Some(_) => file.path.clone(),
        None => std::path::absolute(&file.path).map_err(|error| Mistake::unreadable(file, &error))?,
    };
    path.into_os_string()
        .into_string()
        .map_err(|_| Mistake::param(param, format!("the path of `{param}` is not UTF-8 text")).into())
}
