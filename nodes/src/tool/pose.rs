//! `tactflow pose`: where the model of an arm puts its tip and the sensor on it.

use std::fmt::Write;
use std::path::PathBuf;

use nalgebra::{IsometryMatrix3, Vector3};
use tactflow_runtime::cli::Shell;
use tactflow_runtime::cli::clap::{self, Parser};
use tactflow_runtime::graph::{BenchDevice, OpenBench, open_bench};
use tactflow_runtime::signal::{Image, Joint, Joints, Twist};

use super::guided::vectors::three;
use super::guided::{BoundRole, bound_role, chain, choose, mount};
use crate::arm::chain::Chain;
use crate::motion::pose::{rotation_vector, rpy_of};

/// Print where the model of an arm puts its tip and the pad on it
#[derive(Parser)]
#[command(name = "pose")]
#[command(
    after_help = "Compare it with what the pendant of the robot shows for the same posture, before anything moves. It connects to
nothing.

Examples:
  tactflow pose cell.toml                                   at `home` of the arm
  tactflow pose cell.toml --at '[0, -1.57, -1.57, 0, 1.57, 0]'
  tactflow pose cell.toml --at '[0, -90, -90, 0, 90, 0]' --degrees

Exit codes: 0 success; 2 the bench does not load, or has no such arm."
)]
pub(super) struct PoseArgs {
    /// Bench file
    bench: PathBuf,
    /// Role of the arm, if the bench binds several
    #[arg(long, value_name = "ROLE")]
    arm: Option<String>,
    /// Positions of the joints in the order of the model [rad; m if prismatic]; `home` if not given
    #[arg(long, value_name = "LIST", value_parser = list, allow_hyphen_values = true)]
    at: Option<Posture>,
    /// The positions are in degrees
    #[arg(long, requires = "at")]
    degrees: bool,
}

/// The positions of the joints as they are given.
#[derive(Debug, Clone)]
struct Posture(Vec<f64>);

/// Parses a list of numbers: a parser for arguments.
fn list(text: &str) -> Result<Posture, String> {
    let inner = text.trim().trim_start_matches('[').trim_end_matches(']');
    let number = |word: &str| word.trim().parse().ok().filter(|number: &f64| number.is_finite());
    let numbers = inner.split(',').map(|word| number(word).ok_or_else(|| format!("`{}` is no number", word.trim())));
    Ok(Posture(numbers.collect::<Result<_, _>>()?))
}

pub(super) fn run(args: PoseArgs, shell: &Shell) -> Result<u8, u8> {
    let bench = open_bench(shell.catalogue(), &args.bench).map_err(|report| shell.reject(&report))?;
    let text = describe(&args, shell, &bench).map_err(|message| shell.refuse(message))?;
    shell.say(&text);
    Ok(0)
}

fn describe(args: &PoseArgs, shell: &Shell, bench: &OpenBench) -> Result<String, String> {
    let (bound, device) = arm(args, bench)?;
    let description = &device.opened.description;
    let chain = chain(shell.catalogue(), description, &bound)?;
    let joints = chain.joints();
    let home = description.fact_on(bound.side.as_deref(), "velocity_arm", "home");
    let home: Option<Vec<f64>> = home.and_then(|home| home.clone().try_into().ok());
    let (posture, origin) = match &args.at {
        Some(Posture(at)) => (in_radians(at, args.degrees, joints)?, "the given posture"),
        None => (home.ok_or("the arm has no `home`: name a posture with `--at`")?, "`home`"),
    };
    let mut text = format!("{}: device `{}` at {origin}\n", bound.role, bound.device);
    for (i, (joint, q)) in joints.iter().zip(&posture).enumerate() {
        let Joint { name, lower, upper, speed, .. } = joint;
        let outside = if (lower..=upper).contains(&q) { "" } else { "  outside of its range" };
        let _ = writeln!(
            text,
            "  {} {name}: {q:.4} (range {lower:.4} to {upper:.4}, speed {speed:.4}; rad, or m if prismatic){outside}",
            i + 1
        );
    }
    let tip = pose(&chain, &posture);
    text += &line("tip", &tip);
    for (role, mount) in mounts(bench, &bound) {
        text += &line(&format!("sensor of `{role}`"), &(tip * mount));
    }
    Ok(text.trim_end().to_owned())
}

/// Returns the arm of the role that is asked for, or the only one.
fn arm<'b>(args: &PoseArgs, bench: &'b OpenBench) -> Result<(BoundRole, &'b BenchDevice), String> {
    let arm = |(role, word): &(String, String)| {
        let bound = bound_role(role.clone(), word);
        let device = bench.devices.iter().find(|device| device.name == bound.device)?;
        device.opened.description.output_on::<Joints>(bound.side.as_deref(), "position")?;
        Some((bound, device))
    };
    let arms: Vec<_> = bench.bind.iter().filter_map(arm).collect();
    if arms.is_empty() {
        return Err("the bench binds no arm".into());
    }
    choose(arms, "an arm", args.arm.as_deref(), "--arm")
}

/// Returns the mounts of all pads, each with its role; all of them, because only a task says on which arm a pad is.
fn mounts(bench: &OpenBench, arm: &BoundRole) -> Vec<(String, IsometryMatrix3<f64>)> {
    let mount = |(role, word): &(String, String)| {
        let bound = bound_role(role.clone(), word);
        let device = bench.devices.iter().find(|device| device.name == bound.device)?;
        let is_other_side = bound.device == arm.device && bound.side != arm.side;
        device.opened.description.output_on::<Image>(bound.side.as_deref(), "image").filter(|_| !is_other_side)?;
        Some((role.clone(), mount::stated(&device.opened.description, bound.side.as_deref())?.pose()))
    };
    bench.bind.iter().filter_map(mount).collect()
}

/// Returns the positions in rad, one for each joint.
fn in_radians(at: &[f64], is_degrees: bool, joints: &[Joint]) -> Result<Vec<f64>, String> {
    if at.len() != joints.len() {
        return Err(format!("`--at` has {} positions, but the arm has {} joints", at.len(), joints.len()));
    }
    Ok(at.iter().map(|q| if is_degrees { q.to_radians() } else { *q }).collect())
}

/// Returns the pose of the end of a chain in the base [m].
fn pose(chain: &Chain, posture: &[f64]) -> IsometryMatrix3<f64> {
    chain.forward(posture, &mut vec![Twist::default(); posture.len()]).0
}

/// Describes a pose in the base.
fn line(what: &str, pose: &IsometryMatrix3<f64>) -> String {
    let at = pose.translation.vector;
    let turn = rotation_vector(&pose.rotation);
    let axis = |axis: Vector3<f64>| three(&(pose.rotation * axis), 3);
    format!(
        "{what} in the base: xyz {} m, rpy {} rad, rotation vector {} rad; its x points to {}, its z to {}\n",
        three(&at, 4),
        three(&rpy_of(&pose.rotation).into(), 4),
        three(&turn, 4),
        axis(Vector3::x()),
        axis(Vector3::z())
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_is_read_with_and_without_brackets() {
        assert_eq!(list("[0, -1.5,2]").expect("numbers").0, [0.0, -1.5, 2.0]);
        assert_eq!(list("1,2").expect("numbers").0, [1.0, 2.0]);
        assert_eq!(list("[1, x]").expect_err("a letter"), "`x` is no number");
        assert!(list("[1, inf]").is_err());
    }
}
