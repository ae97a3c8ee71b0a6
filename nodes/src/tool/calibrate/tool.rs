//! `tactflow calibrate tool`: the mass and the centre of mass of the tool, from the force sensor of a still arm.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;
use tactflow_runtime::cli::clap::{self, Args};
use tactflow_runtime::cli::{FAULTED, Shell};
use tactflow_runtime::graph::open_bench;
use tactflow_runtime::signal::{Features, FeaturesShape, Joints, Shape};

use super::average::Average;
use super::payload::{check_flange, payload};
use crate::calibration::tool_weight::{
    MIN_POSTURES, MIN_SPREAD, WeightFit, WeightPosture, WeightUnfit, fit, next_side, side_down,
};
use crate::motion::weight::{GRAVITY, weight};
use crate::tool::guided::vectors::three;
use crate::tool::guided::{BoundRole, CellPort, GuidedArm, GuidedCell, Left, TomlFile, numbers};

/// Weigh the tool: hold the arm still in four postures
#[derive(Args)]
#[command(
    after_help = "The arm is guided by hand, and nothing is sent to it. In each posture another side of the tool is down, and nothing \
touches the tool. The result is the mass and the centre of mass, the constant offset of the sensor, and the residual. \
After a typed `yes`, `tool_mass` and `tool_com` of the device are written into the bench. If the controller subtracts \
the weight itself, the result is what to correct in its payload, and nothing is written.

Examples:
  tactflow calibrate tool cell.toml
  tactflow calibrate tool cell.toml --sensor wrist

Exit codes: 0 success; 1 a device failed, or the measurement cannot be right; 2 the bench cannot be used."
)]
pub(super) struct ToolArgs {
    /// Bench file
    bench: PathBuf,
    /// Role of the force sensor, if the bench binds several
    #[arg(long, value_name = "ROLE")]
    sensor: Option<String>,
    /// Role of the arm that carries the sensor; by default the arm of the same device
    #[arg(long, value_name = "ROLE")]
    arm: Option<String>,
}

/// Minimum number of wrenches in a posture.
const MIN_SAMPLES: u32 = 5;
/// Residual of the force above which the measurement is doubtful, as a part of the weight [1].
const DOUBTFUL_PART: f64 = 0.2;

/// A force sensor on an arm.
struct Sensor {
    bound: BoundRole,
    wrench: CellPort<Features>,
    arm: GuidedArm,
    /// Mass [kg] and centre [m] of the weight that the device subtracts, or `None` if the controller does it.
    subtracted: Option<(f64, Vector3<f64>)>,
    /// Link of the tip, in whose frame the centre is.
    tip: String,
}

pub(super) fn run(args: &ToolArgs, shell: &Shell) -> Result<u8, u8> {
    let mut cell = GuidedCell::open(shell, &args.bench)?;
    let found = Sensor::find(&cell, args).and_then(|sensor| Ok((sensor, TomlFile::read(&args.bench)?)));
    let (sensor, mut bench) = found.map_err(|why| shell.refuse(why))?;
    let done = sensor.weigh(&mut cell).and_then(|found| conclude(&mut cell, &sensor, &found, &mut bench));
    done.map_err(|left| left.report(shell))
}

impl Sensor {
    fn find(cell: &GuidedCell<'_>, args: &ToolArgs) -> Result<Self, String> {
        let sensor = args.sensor.as_deref();
        let (bound, wrench) = cell.role::<Features>("wrench", "a force sensor", sensor, "--sensor")?;
        let description = cell.device(wrench).description();
        if !matches!(description.shape_of(wrench.output()), Shape::Features(shape) if has_six(shape)) {
            return Err(format!("`wrench` of device `{}` is not a force and a torque", bound.device));
        }
        let fact = |name: &str| description.fact_on(bound.side.as_deref(), "force_sensor", name);
        let mass = fact("tool_mass").and_then(toml::Value::as_float);
        let centre = fact("tool_com").and_then(|centre| centre.clone().try_into::<[f64; 3]>().ok());
        let subtracted = mass.zip(centre.map(Vector3::from));
        let is_own = cell.port::<Joints>(&bound, "position").is_some();
        let own = is_own.then_some(&*bound.role);
        let arm = GuidedArm::find(cell, args.arm.as_deref().or(own))?;
        let carrier = cell.device(arm.position).description();
        let tip = carrier.fact_on(arm.bound.side.as_deref(), "velocity_arm", "tip").and_then(toml::Value::as_str);
        let tip = tip.unwrap_or("the tip").to_owned();
        if subtracted.is_none() {
            check_flange(&params(cell, &args.bench, &arm.bound.device)?, &arm.bound.device, &tip)?;
        }
        Ok(Self { bound, wrench, arm, subtracted, tip })
    }

    /// Asks for postures until they are enough.
    fn weigh(&self, cell: &mut GuidedCell<'_>) -> Result<WeightFit, Left> {
        let shell = cell.shell();
        shell.say(
            "Guide the arm by hand; nothing is sent to it. Nothing may touch the tool.\n\
             Enter measures, `again` drops the last posture, `done` ends.",
        );
        let mut postures: Vec<WeightPosture> = Vec::new();
        loop {
            let fitted = fit(&postures);
            shell.say(&progress(&fitted, postures.len()));
            let (next, side) = (postures.len() + 1, next_side(&postures));
            let end = if fitted.is_ok() { ", or write `done`" } else { "" };
            let question =
                format!("Posture {next}: turn the tool so that the {side} side of its tip is down, press Enter{end}:");
            match (cell.ask(&question)?.as_str(), fitted) {
                ("", _) => match self.measure(cell)? {
                    Ok(posture) => {
                        shell.say(&described(&posture));
                        postures.push(posture);
                    }
                    Err(why) => shell.say(&format!("  not measured: {why}")),
                },
                ("again", _) => drop(postures.pop()),
                ("done", Ok(found)) => return Ok(found),
                ("done", Err(_)) => shell.say("  the postures do not determine the weight yet"),
                (other, _) => shell.say(&format!("  `{other}` is no answer: press Enter, or write `again` or `done`")),
            }
        }
    }

    /// Measures a posture. The wrench is that of the whole tool, with the weight that the device subtracts.
    fn measure(&self, cell: &mut GuidedCell<'_>) -> Result<Result<WeightPosture, String>, Left> {
        let mut average = Average::of(cell, self.wrench, 6);
        let still = self.arm.still(cell, |cell| average.look(cell))?;
        Ok(still.and_then(|still| {
            let means = average.means("the force sensor", MIN_SAMPLES)?;
            let tip = still.tip.rotation;
            let (mass, centre) = self.subtracted.unwrap_or_default();
            let added = weight(mass, &centre, &tip);
            Ok(WeightPosture { tip, wrench: std::array::from_fn(|i| means[i] + added[i]) })
        }))
    }
}

/// Returns the parameters of a device of a bench, with those of its robot file.
fn params(cell: &GuidedCell<'_>, bench: &Path, device: &str) -> Result<toml::Table, String> {
    let bench = open_bench(cell.shell().catalogue(), bench).map_err(|report| report.render(false))?;
    let device = bench.devices.into_iter().find(|found| found.name == device);
    Ok(device.map(|device| device.params).unwrap_or_default())
}

fn has_six(shape: &FeaturesShape) -> bool {
    shape.names().count() == 6
}

/// Describes a posture that was measured.
fn described(posture: &WeightPosture) -> String {
    let (side, angle) = side_down(&posture.tip);
    let [fx, fy, fz, ..] = posture.wrench;
    format!("  {side} is down within {:.0}°; the force is {fx:.2} {fy:.2} {fz:.2} N", angle.to_degrees())
}

/// Describes how well the weight is known now.
fn progress(fitted: &Result<WeightFit, WeightUnfit>, count: usize) -> String {
    match fitted {
        Ok(found) => lines_of(found),
        Err(WeightUnfit::Few) => format!("{count} of at least {MIN_POSTURES} postures"),
        Err(WeightUnfit::Alike { spread }) => format!(
            "the postures are too alike: the direction down varies by {spread:.2} across the tool, and {MIN_SPREAD} is needed; \
             turn another side of the tool down"
        ),
    }
}

fn lines_of(found: &WeightFit) -> String {
    let [centre, deviation] = [found.centre, found.centre_deviation].map(|vector| three(&(vector * 1e3), 1));
    format!(
        "mass {:.3} kg ± {:.3}, centre {centre} mm ± {deviation}, residual {:.2} N and {:.3} N m",
        found.mass, found.mass_deviation, found.force_residual, found.torque_residual
    )
}

/// Prints the result, and writes it after a typed `yes`. Returns the exit code.
fn conclude(cell: &mut GuidedCell<'_>, sensor: &Sensor, found: &WeightFit, bench: &mut TomlFile) -> Result<u8, Left> {
    let shell = cell.shell();
    let [fx, fy, fz, tx, ty, tz] = found.offset;
    shell.say(&format!(
        "\nconstant offset of the sensor: [{fx:.2}, {fy:.2}, {fz:.2}] N, [{tx:.3}, {ty:.3}, {tz:.3}] N m; nothing subtracts it, \
         see docs/calibration.md"
    ));
    let weight = found.mass.abs() * GRAVITY;
    if !found.is_significant() {
        shell.say(&format!(
            "the mass of {:.3} kg is within its noise of ± {:.3} kg; nothing is written",
            found.mass, found.mass_deviation
        ));
        return Ok(0);
    }
    if found.force_residual > DOUBTFUL_PART * weight {
        shell.warning(format_args!(
            "the residual of {:.2} N is large for a weight of {weight:.2} N: did something touch the tool, or is z of the base not \
             vertical?",
            found.force_residual
        ));
    }
    match sensor.subtracted {
        None => payload(cell, found, &sensor.tip),
        Some(_) if found.mass < 0.0 => {
            shell.error(format_args!(
                "the mass is {:.3} kg: either the force sensor has the wrong sign, or the load that is set on the controller is \
                 heavier than what the arm carries; nothing is written",
                found.mass
            ));
            Ok(FAULTED)
        }
        Some((mass, centre)) => {
            shell.say(&format!("the bench has mass {mass:.3} kg, centre {} mm", three(&(centre * 1e3), 1)));
            write(cell, &sensor.bound, found, bench)
        }
    }
}

fn write(cell: &mut GuidedCell<'_>, bound: &BoundRole, found: &WeightFit, bench: &mut TomlFile) -> Result<u8, Left> {
    let section = ["devices", bound.device.as_str()];
    let mass = (found.mass * 1e4).round() / 1e4;
    let set = bench
        .set(&section, "tool_mass", mass)
        .and_then(|()| bench.set(&section, "tool_com", numbers(found.centre.as_slice(), 4)));
    match set {
        Ok(()) => cell.write_after_yes(bench),
        Err(message) => Ok(cell.shell().refuse(message)),
    }
}
