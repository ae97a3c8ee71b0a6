//! Whether the robot may be moved: its modes, its safety and the state of its program.

use super::recipe::State;

/// `robot_mode` in which the brakes are released.
const RUNNING: i64 = 7;
/// `safety_mode` without a restriction.
const NORMAL: i64 = 1;
/// `safety_mode` with reduced limits.
const REDUCED: i64 = 2;
/// `runtime_state` without a program.
const STOPPED: i64 = 1;
/// `runtime_state` while a program runs.
const PLAYING: i64 = 2;
/// By how much the slider may be below its bound, because it is a rounded number.
const SLIDER_TOLERANCE: f64 = 1e-3;

/// What the bench allows.
#[derive(Debug, Clone, Copy)]
pub(super) struct Allowed {
    /// Whether the robot may move in the safety mode `reduced`.
    pub(super) reduced: bool,
    /// Lowest position of the speed slider, 0 to 1.
    pub(super) min_speed_fraction: f64,
}

impl Allowed {
    /// Returns why the robot must not be moved, or `None` if it may. The program is not looked at.
    pub(super) fn refusal(&self, state: &State) -> Option<String> {
        let safety = state.safety_mode;
        if safety != NORMAL && !(self.reduced && safety == REDUCED) {
            return Some(match safety {
                REDUCED => "the robot is in reduced mode: leave it, or write `allow_reduced = true`".to_owned(),
                _ => format!("the robot is in {} (safety_mode {safety})", safety_name(safety)),
            });
        }
        if state.robot_mode != RUNNING {
            let (mode, name) = (state.robot_mode, robot_name(state.robot_mode));
            return Some(format!("the robot is not running but {name} (robot_mode {mode}): release its brakes"));
        }
        if state.speed_fraction < self.min_speed_fraction - SLIDER_TOLERANCE {
            let [slider, least] = [state.speed_fraction, self.min_speed_fraction].map(|part| 100.0 * part);
            return Some(format!(
                "the speed slider is at {slider:.0} % and slows every motion: raise it to {least:.0} %"
            ));
        }
        None
    }
}

/// Whether a program runs.
pub(super) fn is_playing(state: &State) -> bool {
    state.runtime_state == PLAYING
}

/// Whether there is no program.
pub(super) fn is_stopped(state: &State) -> bool {
    state.runtime_state == STOPPED
}

/// Returns what the program does, as a word for messages.
pub(super) fn runtime_name(state: &State) -> &'static str {
    match state.runtime_state {
        0 => "stopping",
        STOPPED => "stopped",
        PLAYING => "playing",
        3 => "pausing",
        4 => "paused",
        5 => "resuming",
        _ => "in an unknown state",
    }
}

fn safety_name(mode: i64) -> &'static str {
    match mode {
        3 => "protective stop",
        4 => "recovery mode",
        5 => "safeguard stop",
        6 => "system emergency stop",
        7 => "robot emergency stop",
        8 => "safety violation",
        9 => "safety fault",
        10 => "validation of its joints",
        12 => "automatic mode safeguard stop",
        13 | 14 => "three-position enabling stop",
        _ => "an unknown safety mode",
    }
}

fn robot_name(mode: i64) -> &'static str {
    match mode {
        -1 => "without a controller",
        0 => "disconnected",
        1 => "waiting for the confirmation of its safety",
        2 => "booting",
        3 => "powered off",
        4 => "powered on",
        5 => "idle",
        6 => "in backdrive",
        8 => "updating its firmware",
        _ => "in an unknown mode",
    }
}

#[cfg(test)]
mod tests {
    use super::super::recipe::{Output, Recipe};
    use super::*;

    fn state(robot_mode: i64, safety_mode: i64, speed_fraction: f64) -> State {
        let recipe = Recipe::read(&[Output::RobotMode], b"\x01INT32").unwrap();
        let empty = recipe.state(&[1, 0, 0, 0, 0]).unwrap();
        State { robot_mode, safety_mode, speed_fraction, ..empty }
    }

    #[test]
    fn only_a_running_robot_with_normal_safety_may_be_moved() {
        let allowed = Allowed { reduced: false, min_speed_fraction: 1.0 };
        let cases = [
            (7, 1, 1.0, None),
            (7, 1, 0.9995, None),
            (7, 3, 1.0, Some("the robot is in protective stop (safety_mode 3)")),
            (7, 6, 1.0, Some("the robot is in system emergency stop (safety_mode 6)")),
            (3, 7, 1.0, Some("the robot is in robot emergency stop (safety_mode 7)")),
            (7, 99, 1.0, Some("the robot is in an unknown safety mode (safety_mode 99)")),
            (7, 2, 1.0, Some("the robot is in reduced mode: leave it, or write `allow_reduced = true`")),
            (5, 1, 1.0, Some("the robot is not running but idle (robot_mode 5): release its brakes")),
            (7, 1, 0.5, Some("the speed slider is at 50 % and slows every motion: raise it to 100 %")),
        ];
        for (robot, safety, slider, why) in cases {
            assert_eq!(allowed.refusal(&state(robot, safety, slider)).as_deref(), why);
        }
        let wide = Allowed { reduced: true, min_speed_fraction: 0.3 };
        assert_eq!(wide.refusal(&state(7, 2, 0.3)), None);
        for mode in [-1, 0, 1, 2, 3, 4, 5, 6, 8, 9] {
            assert!(wide.refusal(&state(mode, 1, 1.0)).is_some(), "{mode}");
        }
        for mode in [0, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 22, -1] {
            assert!(wide.refusal(&state(7, mode, 1.0)).is_some(), "{mode}");
        }
    }
}
