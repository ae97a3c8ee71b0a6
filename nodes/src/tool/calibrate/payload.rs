//! What to correct in the payload of a controller that subtracts the weight of the tool itself.

use nalgebra::Vector3;

use crate::calibration::tool_weight::WeightFit;
use crate::tool::guided::vectors::three;
use crate::tool::guided::{GuidedCell, Left};

/// Checks that the frame of the tip is that of the flange, in which a controller expects the centre of its payload.
///
/// # Errors
/// If the device names another link as its `flange`.
pub(super) fn check_flange(params: &toml::Table, device: &str, tip: &str) -> Result<(), String> {
    match params.get("flange").and_then(toml::Value::as_str) {
        Some(flange) if flange != tip => Err(format!(
            "the controller expects the centre of the payload in the frame of the flange `{flange}`, but the tip of device \
             `{device}` is `{tip}`: write `tip = \"{flange}\"` into a copy of the bench, and weigh the tool with it"
        )),
        _ => Ok(()),
    }
}

/// Prints what to correct in the payload of a controller that subtracts the weight itself. `tip` is the link of the tip,
/// which is the flange. Returns the exit code.
pub(super) fn payload(cell: &mut GuidedCell<'_>, found: &WeightFit, tip: &str) -> Result<u8, Left> {
    let shell = cell.shell();
    let (by, side) = (found.mass.abs(), if found.mass > 0.0 { "less" } else { "more" });
    shell.say(&format!(
        "the controller subtracts {by:.3} kg {side} than the tool weighs, at {} mm in the frame of the flange `{tip}`",
        three(&(found.centre * 1e3), 1)
    ));
    let question = format!(
        "Which payload is set on the robot? Write its mass [kg] and its centre x y z in the frame of the flange `{tip}` [mm], \
         such as `0.35 0 0 40`, or press Enter to end:"
    );
    loop {
        let answer = cell.ask(&question)?;
        if answer.is_empty() {
            return Ok(0);
        }
        match corrected(&answer, found) {
            Ok((mass, centre)) => {
                shell.say(&format!(
                    "set the payload to {mass:.3} kg with its centre at {} mm in the frame of the flange `{tip}`, and \
                     `tool_mass = {mass:.3}` in the bench if it has one",
                    three(&(centre * 1e3), 1)
                ));
                return Ok(0);
            }
            Err(why) => shell.say(&format!("  {why}")),
        }
    }
}

/// Returns the mass [kg] and the centre [m] of the payload that was set, with the weight that it lacks.
fn corrected(payload: &str, lacking: &WeightFit) -> Result<(f64, Vector3<f64>), String> {
    let four = || {
        let parts: Vec<f64> = payload.split_whitespace().map(|part| part.parse().ok()).collect::<Option<_>>()?;
        let four = <[f64; 4]>::try_from(parts).ok()?;
        (four[0] >= 0.0 && four.iter().all(|number| number.is_finite())).then_some(four)
    };
    let [mass, x, y, z] =
        four().ok_or_else(|| format!("`{payload}` is not a mass and three numbers, such as `0.35 0 0 40`"))?;
    let sum = mass + lacking.mass;
    if sum <= 0.0 {
        return Err(format!(
            "a payload of {mass} kg cannot be {:.3} kg too heavy: look at the robot again",
            -lacking.mass
        ));
    }
    Ok((sum, (Vector3::new(x, y, z) * (1e-3 * mass) + lacking.centre * lacking.mass) / sum))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(mass: f64, centre: [f64; 3]) -> WeightFit {
        WeightFit {
            mass,
            mass_deviation: 0.001,
            centre: centre.into(),
            centre_deviation: Vector3::zeros(),
            offset: [0.0; 6],
            force_residual: 0.0,
            torque_residual: 0.0,
        }
    }

    /// Two masses on a line, by hand: 1 kg at 0 and 1 kg at 0.1 m make 2 kg at 0.05 m.
    #[test]
    fn a_payload_is_corrected_by_what_it_lacks() {
        let (mass, centre) = corrected("1 0 0 0", &found(1.0, [0.0, 0.0, 0.1])).expect("two masses");
        assert!((mass - 2.0).abs() < 1e-12 && (centre - Vector3::new(0.0, 0.0, 0.05)).norm() < 1e-12);
        let (mass, centre) = corrected("2 0 0 50", &found(-1.0, [0.0, 0.0, 0.1])).expect("the way back");
        assert!((mass - 1.0).abs() < 1e-12 && centre.norm() < 1e-12);
    }

    #[test]
    fn a_tip_that_is_not_the_flange_is_refused() {
        let params = |text: &str| -> toml::Table { text.parse().expect("TOML") };
        assert!(check_flange(&params(""), "arm", "tool0").is_ok());
        assert!(check_flange(&params("flange = \"tool0\""), "arm", "tool0").is_ok());
        let message = check_flange(&params("flange = \"wrist_3_link\""), "arm", "tool0").expect_err("two links");
        assert!(message.contains("`wrist_3_link`, but the tip of device `arm` is `tool0`"), "{message}");
    }

    #[test]
    fn a_payload_that_cannot_be_is_refused() {
        for (payload, text) in
            [("1 2 3", "`1 2 3` is not"), ("-1 0 0 0", "`-1 0 0 0` is not"), ("0.5 0 0 0", "a payload of 0.5")]
        {
            let message = corrected(payload, &found(-0.7, [0.0; 3])).expect_err(text);
            assert!(message.starts_with(text), "{message}");
        }
    }
}
