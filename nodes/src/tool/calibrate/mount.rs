//! `tactflow calibrate mount`: where a pad is on the arm, from one point that it touches in several postures.

use std::path::PathBuf;

use nalgebra::IsometryMatrix3;
use tactflow_runtime::cli::clap::{self, Args};
use tactflow_runtime::cli::{FAULTED, Shell};
use tactflow_runtime::signal::{Image, Shape};
use toml_edit::{InlineTable, Value};

use super::average::Average;
use super::contact::Unloaded;
use super::mount_text::{described, facing, progress, report};
use crate::arm::mount::Mount;
use crate::calibration::pad_mount::{MountFit, MountPosture, fit, outlier};
use crate::motion::pose::rpy_of;
use crate::tool::guided::{BoundRole, CellPort, GuidedArm, GuidedCell, Left, TomlFile, mount, numbers};

/// Measure where a pad is on the arm: touch one fixed point in four postures
#[derive(Args)]
#[command(
    after_help = "The arm is guided by hand, and nothing is sent to it. Fix a pin with a round tip on the table, and touch it lightly with \
the pad: near each corner, with the tool tilted another way each time. The result is the mount with its residual. \
After a typed `yes`, `mount` of the pad is written into the bench.

Examples:
  tactflow calibrate mount cell.toml
  tactflow calibrate mount cell.toml --pad left_pad --arm left_arm

Exit codes: 0 success; 1 a device failed, or z of the pad points away from that of the bench; 2 the bench cannot be used."
)]
pub(super) struct MountArgs {
    /// Bench file
    bench: PathBuf,
    /// Role of the pad, if the bench binds several
    #[arg(long, value_name = "ROLE")]
    pad: Option<String>,
    /// Role of the arm that carries the pad, if the bench binds several
    #[arg(long, value_name = "ROLE")]
    arm: Option<String>,
}

/// Time over which the unloaded pad is averaged [s].
const UNLOADED_S: f64 = 1.0;
/// Minimum number of frames without a load.
const MIN_UNLOADED: u32 = 20;
/// Minimum number of frames of a contact.
const MIN_SAMPLES: u32 = 5;
/// Places to touch, in turn.
const PLACES: [&str; 5] =
    ["its +x +y corner", "its -x +y corner", "its -x -y corner", "its +x -y corner", "its middle"];

/// A pad on an arm.
struct Pad {
    bound: BoundRole,
    image: CellPort<Image>,
    arm: GuidedArm,
    /// The mount that the bench states.
    present: Mount,
}

pub(super) fn run(args: &MountArgs, shell: &Shell) -> Result<u8, u8> {
    let mut cell = GuidedCell::open(shell, &args.bench)?;
    let found = Pad::find(&cell, args).and_then(|pad| Ok((pad, TomlFile::read(&args.bench)?)));
    let (pad, mut bench) = found.map_err(|why| shell.refuse(why))?;
    let done = pad.touch(&mut cell).and_then(|found| pad.conclude(&mut cell, &found, &mut bench));
    done.map_err(|left| left.report(shell))
}

impl Pad {
    fn find(cell: &GuidedCell<'_>, args: &MountArgs) -> Result<Self, String> {
        let (bound, image) = cell.role::<Image>("image", "a pad", args.pad.as_deref(), "--pad")?;
        let description = cell.device(image).description();
        let present = mount::stated(description, bound.side.as_deref()).unwrap_or(Mount::NONE);
        let arm = GuidedArm::find(cell, args.arm.as_deref())?;
        Ok(Self { bound, image, arm, present })
    }

    /// Asks for postures until they are enough.
    fn touch(&self, cell: &mut GuidedCell<'_>) -> Result<MountFit, Left> {
        let (shell, present) = (cell.shell(), self.present.pose());
        shell.say(
            "Guide the arm by hand; nothing is sent to it. The point must not move between the postures.\n\
             Enter measures, `drop 3` drops posture 3, `done` ends.",
        );
        let unloaded = self.unloaded(cell)?;
        let mut touches: Vec<MountPosture> = Vec::new();
        loop {
            let fitted = fit(&touches, &present);
            let worst = fitted.as_ref().ok().and_then(|all| outlier(&touches, &present, all));
            shell.say(&progress(&fitted, touches.len(), worst));
            let (next, place) = (touches.len() + 1, PLACES[touches.len() % PLACES.len()]);
            let end = if fitted.is_ok() { ", or write `done`" } else { "" };
            let question = format!(
                "Posture {next}: tilt the tool another way, touch the point lightly with the pad near {place}, press Enter{end}:"
            );
            let answer = cell.ask(&question)?;
            match (answer.as_str(), fitted) {
                ("", _) => match self.measure(cell, &unloaded)? {
                    Ok((touch, tactels)) => {
                        shell.say(&described(&touch, tactels));
                        touches.push(touch);
                    }
                    Err(why) => shell.say(&format!("  not measured: {why}")),
                },
                ("done", Ok(found)) => return Ok(found),
                ("done", Err(_)) => shell.say("  the postures do not determine the mount yet"),
                (other, _) => match dropped(other, touches.len()) {
                    Some(index) => drop(touches.remove(index)),
                    None => shell.say(&format!("  `{other}` is no answer: press Enter, or write `drop 1` or `done`")),
                },
            }
        }
    }

    /// Measures the pad without a load.
    fn unloaded(&self, cell: &mut GuidedCell<'_>) -> Result<Unloaded, Left> {
        cell.ask("Take everything off the pad, and press Enter:")?;
        let Shape::Image(shape) = cell.device(self.image).description().shape_of(self.image.output()).clone() else {
            return Err(Left::Failed("the pad states no image".into()));
        };
        let mut average = Average::of(cell, self.image, shape.tactels());
        cell.watch(UNLOADED_S, |cell| {
            average.look(cell);
            None::<()>
        })?;
        let means = average.means("the pad", MIN_UNLOADED).map_err(Left::Failed)?.to_vec();
        Ok(Unloaded { shape, means, deviations: average.deviations() })
    }

    /// Measures a posture and its contact. Returns the number of its tactels too.
    fn measure(
        &self,
        cell: &mut GuidedCell<'_>,
        unloaded: &Unloaded,
    ) -> Result<Result<(MountPosture, usize), String>, Left> {
        let mut average = Average::of(cell, self.image, unloaded.means.len());
        let still = self.arm.still(cell, |cell| average.look(cell))?;
        Ok(still.and_then(|still| {
            let contact = unloaded.contact(average.means("the pad", MIN_SAMPLES)?)?;
            Ok((MountPosture { tip: still.tip, place: contact.place }, contact.tactels))
        }))
    }

    /// Prints the result, and writes it after a typed `yes`. Returns the exit code.
    fn conclude(&self, cell: &mut GuidedCell<'_>, found: &MountFit, bench: &mut TomlFile) -> Result<u8, Left> {
        let shell = cell.shell();
        shell.say(&format!("\n{}", report(found, &self.present.pose())));
        if found.turn_deviation.is_ok() && found.faces_away_from(&self.present.pose()) {
            shell.error(facing(&self.present.pose(), bench.path()));
            return Ok(FAULTED);
        }
        let mount = self.written(found);
        if self.bound.side.is_some() {
            shell.say(&format!(
                "mount = {mount}\nthe pads of device `{}` share one `mount`, so nothing is written",
                self.bound.device
            ));
            return Ok(0);
        }
        match bench.set(&["devices", &self.bound.device], "mount", mount) {
            Ok(()) => cell.write_after_yes(bench),
            Err(message) => Ok(shell.refuse(message)),
        }
    }

    /// Returns the value of the parameter `mount`. A rotation that was not measured stays as it is.
    fn written(&self, found: &MountFit) -> Value {
        let IsometryMatrix3 { translation, rotation } = &found.mount;
        let rpy = match &found.turn_deviation {
            Ok(_) => numbers(&rpy_of(rotation), 4),
            Err(_) => self.present.rpy.into_iter().collect(),
        };
        let entries = [("xyz", numbers(translation.vector.as_slice(), 5)), ("rpy", rpy)];
        entries.into_iter().map(|(key, list)| (key, Value::Array(list))).collect::<InlineTable>().into()
    }
}

/// Returns the index of the posture that an answer drops.
fn dropped(answer: &str, count: usize) -> Option<usize> {
    let number: usize = answer.strip_prefix("drop ")?.trim().parse().ok()?;
    (1..=count).contains(&number).then(|| number - 1)
}
