//! Where the gains of a feature stand, and the settings that change them.

use tactflow_runtime::graph::OutlinedMode;

use crate::tool::control::law::Feature;

/// Returns the settings that give a feature other gains in a mode.
pub(super) fn gains(feature: &Feature, mode: &OutlinedMode, gains: [f64; 3]) -> Vec<String> {
    let Some(pid) = &feature.pid else { return Vec::new() };
    let keys = ["kp", "ki", "kd"].into_iter().zip([feature.kp, feature.ki, feature.kd]).zip(gains);
    let changed = keys.filter(|((_, old), new)| old != new);
    changed.map(|((key, _), gain)| format!("{}={gain:?}", gain_key(pid, &feature.name, key, mode))).collect()
}

/// Returns where a gain stands: in the mode, if the mode sets it, or else in its node.
pub(super) fn gain_key(pid: &str, feature: &str, key: &str, mode: &OutlinedMode) -> String {
    let of_mode = format!("set.{pid}.gains.{feature}.{key}");
    match mode.settings.iter().any(|setting| setting.path == of_mode) {
        true => format!("modes.{}.{of_mode}", mode.name),
        false => format!("nodes.{pid}.gains.{feature}.{key}"),
    }
}
