//! Whether the controller follows commands, from what it reports.

use super::wire::Report;

const STATES: [&str; 3] = ["off", "monitor", "command"];
const QUALITIES: [&str; 4] = ["unacceptable", "bad", "ok", "perfect"];
const CONTROLS: [&str; 4] =
    ["another mode", "position control", "Cartesian impedance control", "joint impedance control"];

const MONITOR: u16 = 1;
const COMMAND: u16 = 2;
const OK: u16 = 2;
const POSITION: u16 = 1;
const JOINT_IMPEDANCE: u16 = 3;

/// Range of the time between two measurements [s].
const SAMPLE_TIME_S: std::ops::RangeInclusive<f64> = 0.0005..=0.2;

/// Whether the controller takes positions from the driver. At any other time the driver mirrors its posture.
pub(super) fn takes_positions(report: &Report) -> bool {
    report.state == COMMAND && report.power != 0
}

/// Whether the flags of an answer may change.
pub(super) fn accepts_flags(report: &Report) -> bool {
    report.state == MONITOR
}

/// Whether the session is in the state command, with or without drives.
pub(super) fn is_in_command(report: &Report) -> bool {
    report.state == COMMAND
}

/// Returns the time between two measurements, or 0 if the controller states none that FRI can have [s].
pub(super) fn sample_time(report: &Report) -> f64 {
    if SAMPLE_TIME_S.contains(&report.sample_time) { report.sample_time } else { 0.0 }
}

/// Returns why the arm must not move; `None` if it may. `sets_impedance` is whether the driver sets the stiffness or the
/// damping.
pub(super) fn obstacle(report: &Report, sets_impedance: bool) -> Option<String> {
    let controls: &[u16] = if sets_impedance { &[JOINT_IMPEDANCE] } else { &[POSITION, JOINT_IMPEDANCE] };
    if report.error != 0 {
        return Some(format!(
            "the controller reports the error bits {:#06x}: acknowledge them on the panel",
            report.error
        ));
    }
    if report.power == 0 {
        return Some("its drives are off: release the emergency stop and press the enabling switch".into());
    }
    if report.state != COMMAND {
        let state = name(&STATES, report.state);
        return Some(format!("its FRI session is in the state {state}: let the KRL program run up to `friStart`"));
    }
    if report.quality < OK {
        let quality = name(&QUALITIES, report.quality);
        return Some(format!(
            "the quality of its connection is {quality}: check the network and the load of this machine"
        ));
    }
    if !controls.contains(&report.control) {
        let (control, wanted) = (name(&CONTROLS, report.control), name(&CONTROLS, controls[0]));
        let or = if sets_impedance { "" } else { " or joint impedance control (3)" };
        return Some(format!("it is in {control}: let the KRL program select {wanted}{or}"));
    }
    if sample_time(report) == 0.0 {
        return Some(format!("it states a sample time of {} s: open FRI with 1 to 100 ms", report.sample_time));
    }
    None
}

/// Returns the name of a number with the number.
fn name(names: &[&str], number: u16) -> String {
    format!("{} ({number})", names.get(usize::from(number)).unwrap_or(&"unknown"))
}

#[cfg(test)]
mod tests {
    use super::super::wire::tests::datagram;
    use super::*;

    /// A report with the sample time [s], and with state, quality, power, control and error.
    fn report(sample_time: f32, words: [u16; 5]) -> Report {
        let words: Vec<(usize, u16)> = [144, 146, 180, 182, 184].into_iter().zip(words).collect();
        Report::decode(&datagram(&[(148, &[sample_time])], &words)).unwrap()
    }

    #[test]
    fn the_arm_moves_only_if_everything_is_legal() {
        let cases: [([u16; 5], bool, Option<&str>); 13] = [
            ([2, 3, 0x7f, 1, 0], false, None),
            ([2, 2, 0x7f, 3, 0], false, None),
            ([2, 2, 1, 3, 0], true, None),
            (
                [2, 3, 0x7f, 1, 0],
                true,
                Some("it is in position control (1): let the KRL program select joint impedance"),
            ),
            ([2, 3, 0x7f, 2, 0], false, Some("it is in Cartesian impedance control (2)")),
            ([2, 3, 0x7f, 0, 0], false, Some("select position control (1) or joint impedance control (3)")),
            ([2, 3, 0x7f, 9, 0], false, Some("it is in unknown (9)")),
            ([1, 3, 0x7f, 1, 0], false, Some("its FRI session is in the state monitor (1)")),
            ([0, 3, 0x7f, 1, 0], false, Some("its FRI session is in the state off (0)")),
            ([2, 1, 0x7f, 1, 0], false, Some("the quality of its connection is bad (1)")),
            ([2, 0, 0x7f, 1, 0], false, Some("unacceptable (0)")),
            ([2, 3, 0, 1, 0], false, Some("its drives are off")),
            ([2, 3, 0x7f, 1, 0x12], false, Some("the error bits 0x0012")),
        ];
        for (words, sets_impedance, expected) in cases {
            let found = obstacle(&report(0.004, words), sets_impedance);
            match expected {
                Some(part) => assert!(found.as_ref().is_some_and(|found| found.contains(part)), "{words:?}: {found:?}"),
                None => assert_eq!(found, None, "{words:?}"),
            }
        }
        for sample_time in [0.0, -0.004, 0.3] {
            let report = report(sample_time, [2, 3, 0x7f, 1, 0]);
            assert!(obstacle(&report, false).is_some() && super::sample_time(&report) == 0.0, "{sample_time} s");
        }
    }

    #[test]
    fn positions_are_taken_in_the_state_command_with_the_drives_on() {
        for (state, power, takes) in [(2, 0x7f, true), (2, 1, true), (2, 0, false), (1, 0x7f, false), (3, 0x7f, false)]
        {
            assert_eq!(takes_positions(&report(0.004, [state, 3, power, 1, 0])), takes, "{state}, {power}");
        }
    }
}
