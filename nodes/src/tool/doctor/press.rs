//! `doctor --press`: asks for the corners of each pad, and names an axis that is flipped or swapped. Nothing moves.

use std::path::Path;
use std::time::Instant;

use nalgebra::IsometryMatrix3;
use tactflow_runtime::cli::{FAULTED, INTERRUPTED, Shell, clap, duration};
use tactflow_runtime::signal::{Image, ImageShape, Shape};

use super::pad::Noise;
use super::remedy::{Described, OnArm, judge};
use super::symmetry::CORNERS;
use super::touch::{Event, Feeler, Touch};
use super::{Finding, Severity, place, print};
use crate::arm::mount::Mount;
use crate::tool::guided::vectors::three;
use crate::tool::guided::{BoundRole, CellPort, GuidedArm, GuidedCell, Left, mount};

/// Time that a pad has for its first image [s].
const FIRST_IMAGE_S: f64 = 10.0;

#[derive(Debug, clap::Args)]
pub(super) struct PressArgs {
    /// Then ask for the four corners of each pad, one after the other, and name an axis that is flipped or swapped
    #[arg(long)]
    press: bool,
    /// With --press: role of the arm that carries the pads, if the bench binds several
    #[arg(long, value_name = "ROLE", requires = "press")]
    arm: Option<String>,
    /// With --press: how long to wait for each corner
    #[arg(long, value_name = "TIME", value_parser = duration, default_value = "60s", requires = "press")]
    patience: f64,
}

/// A pad of the cell.
struct Pad {
    bound: BoundRole,
    port: CellPort<Image>,
    shape: ImageShape,
    /// Its pose on the tip of the arm, if it states one.
    mount: Option<Mount>,
    noise: Noise,
    writes: u64,
    /// When its first image came.
    first: Option<Instant>,
}

/// The cell with the arm that carries the pads.
struct Dialogue<'s> {
    cell: GuidedCell<'s>,
    arm: Option<GuidedArm>,
    /// Time to wait for each corner [s].
    patience: f64,
}

impl PressArgs {
    /// Asks for the corners of all pads of a bench, if it is wanted. The noise is measured for `watched` seconds first.
    ///
    /// # Errors
    /// The exit code, if the dialogue cannot begin or is interrupted. Why is printed.
    pub(super) fn examine(
        &self,
        shell: &Shell,
        bench: &Path,
        watched: f64,
        devices: &[Described],
    ) -> Result<Severity, u8> {
        if !self.press {
            return Ok(Severity::Fine);
        }
        let cell = GuidedCell::open(shell, bench)?;
        let arm = GuidedArm::find(&cell, self.arm.as_deref());
        let arm = arm.map(Some).or_else(|why| self.arm.as_ref().map_or(Ok(None), |_| Err(shell.refuse(why))))?;
        let mut dialogue = Dialogue { cell, arm, patience: self.patience };
        dialogue.examine(watched, devices).map_err(|left| match left {
            Left::Interrupted => {
                shell.say("interrupted");
                INTERRUPTED
            }
            Left::InputEnded => FAULTED,
            Left::Failed(why) => {
                shell.error(why);
                FAULTED
            }
        })
    }
}

impl Dialogue<'_> {
    fn examine(&mut self, watched: f64, devices: &[Described]) -> Result<Severity, Left> {
        let shell = self.cell.shell();
        let mut pads = pads(&self.cell);
        if pads.is_empty() {
            return Ok(print(shell, "corners", &[Finding::warning("this bench has no live pad that can be pressed")]));
        }
        shell.say(&format!("\nDo not touch the pads: their noise is measured for {watched} s"));
        self.measure_noise(&mut pads, watched)?;
        let mut worst = Severity::Fine;
        for pad in &pads {
            let finding = match (pad.shape.rows.min(pad.shape.cols), pad.noise.quiet()) {
                (0 | 1, _) => Finding::warning("it has a single row or column, so it has no four corners"),
                (_, None) => Finding::problem("it sends too few images to know its noise: use `--for 30s`"),
                (_, Some((unloaded, threshold))) => {
                    let feeler = Feeler::new(pad.shape.clone(), unloaded.to_vec(), threshold);
                    let device = devices.iter().find(|device| device.name == pad.bound.device);
                    let on_arm = self.on_arm(pad);
                    let touched = self.corners(pad, on_arm.as_ref(), feeler)?;
                    // The arm may have been guided meanwhile.
                    let on_arm = on_arm.map(|before| self.on_arm(pad).unwrap_or(before));
                    match (touched, device) {
                        (Ok(touches), Some(device)) => judge(device, on_arm.as_ref(), &pad.shape, &touches),
                        (Err(why), _) => Finding::problem(why),
                        (Ok(_), None) => continue,
                    }
                }
            };
            worst = worst.max(print(shell, &format!("{}: the corners", pad.bound.role), &[finding]));
        }
        Ok(worst)
    }

    /// Measures the noise of all pads, for `watched` seconds from the first image of each.
    fn measure_noise(&mut self, pads: &mut [Pad], watched: f64) -> Result<(), Left> {
        let done = self.cell.watch(FIRST_IMAGE_S + watched, |cell| {
            pads.iter_mut().for_each(|pad| pad.add_noise(cell));
            let is_done = |pad: &Pad| pad.first.is_some_and(|first| first.elapsed().as_secs_f64() >= watched);
            pads.iter().all(is_done).then_some(())
        });
        done.map(drop)
    }

    /// Asks for the corners of a pad, in the base if it is on an arm. The inner error says why there are none.
    fn corners(
        &mut self,
        pad: &Pad,
        on_arm: Option<&OnArm>,
        mut feeler: Feeler,
    ) -> Result<Result<[Touch; 4], String>, Left> {
        let shell = self.cell.shell();
        shell.say(&self.introduction(pad, on_arm));
        let mut touches = Vec::new();
        for corner in CORNERS {
            let pose = self.pose(pad).filter(|_| on_arm.is_some());
            if on_arm.is_some() && pose.is_none() {
                return Ok(Err(
                    "the arm sends no position any more, so its corners have no place in the base".to_owned()
                ));
            }
            shell.say(&format!("press {}{}", self.name(corner, pose.as_ref()), at(corner, pad, pose.as_ref())));
            let event = self.next_event(pad, &mut feeler)?;
            let Some(Event::Touched(touch)) = event else { return Ok(Err(self.nobody(pad, &feeler))) };
            let [x, y] = touch.spot.centre;
            let felt = [x, y].map(f64::signum);
            let is_right = felt == corner;
            let what =
                if is_right { "as asked".to_owned() } else { format!("that is {}", self.name(felt, pose.as_ref())) };
            shell.say(&format!("  felt at x {:.1} mm, y {:.1} mm of the pad: {what}; release it", x * 1e3, y * 1e3));
            touches.push(touch);
            if self.next_event(pad, &mut feeler)?.is_none() {
                return Ok(Err(format!("it was not released within {} s", self.patience)));
            }
        }
        Ok(touches.try_into().map_err(|_| "there are not four touches".to_owned()))
    }

    /// Says how the corners of a pad are named.
    fn introduction(&self, pad: &Pad, on_arm: Option<&OnArm>) -> String {
        let role = &pad.bound.role;
        if on_arm.is_some() {
            return format!("\nThe corners of `{role}`. Release the pad after each one.");
        }
        let silent = self.arm.as_ref().filter(|_| pad.mount.is_some()).map_or_else(String::new, |arm| {
            format!(" `{}` sends no position, so they are named in the frame of the pad.", arm.bound.role)
        });
        format!(
            "\nThe corners of `{role}`.{silent} Look at the pad from outside, so that z points to you, x to the right and y up. \
             Release the pad after each one."
        )
    }

    /// Returns the mount of a pad and where it faces now, if its corners can be named in the base.
    fn on_arm(&self, pad: &Pad) -> Option<OnArm> {
        let (pose, arm) = (self.pose(pad)?, self.arm.as_ref()?);
        let facing = format!("{} of the base of `{}`", place::facing(&pose), arm.bound.role);
        Some(OnArm { mount: pad.mount.clone()?, facing })
    }

    /// Waits for a touch or a release. Returns `None` if there is none in time.
    fn next_event(&mut self, pad: &Pad, feeler: &mut Feeler) -> Result<Option<Event>, Left> {
        let (mut writes, begin) = (self.cell.writes(pad.port), Instant::now());
        self.cell.watch(self.patience, |cell| {
            let now = cell.writes(pad.port);
            let image = cell.read(pad.port).filter(|_| now > writes)?;
            writes = now;
            feeler.add(image, begin.elapsed().as_secs_f64())
        })
    }

    /// Says why no touch was felt.
    fn nobody(&self, pad: &Pad, feeler: &Feeler) -> String {
        let (unit, threshold) = (pad.shape.unit, feeler.threshold());
        if self.cell.read(pad.port).is_none() {
            return "it sends no images any more".to_owned();
        }
        let text = format!("no touch above {threshold:.4} {unit} was felt within {} s", self.patience);
        match -feeler.lowest > threshold.max(f64::MIN_POSITIVE) {
            true => {
                let lowest = -feeler.lowest;
                format!(
                    "{text}, but readings fell by up to {lowest:.4} {unit}: if they fall with the force, write `scale` with \
                     `invert_full` in the description"
                )
            }
            false => format!("{text}: press harder, or check that this is the pad of `{}`", pad.bound.role),
        }
    }

    /// Returns the pose of a pad in the base of its arm, if both are known.
    fn pose(&self, pad: &Pad) -> Option<IsometryMatrix3<f64>> {
        let arm = self.arm.as_ref()?;
        Some(arm.tip(&self.cell.read(arm.position)?.0) * pad.mount.as_ref()?.pose())
    }

    fn name(&self, corner: [f64; 2], pose: Option<&IsometryMatrix3<f64>>) -> String {
        match (pose, &self.arm) {
            (Some(pose), Some(arm)) => format!("{} of the base of `{}`", place::in_base(corner, pose), arm.bound.role),
            _ => place::of_pad(corner),
        }
    }
}

/// Returns the place of a corner in the base, as text.
fn at(corner: [f64; 2], pad: &Pad, pose: Option<&IsometryMatrix3<f64>>) -> String {
    pose.map_or_else(String::new, |pose| {
        format!(", at {} m", three(&place::point(place::corner(corner, &pad.shape), pose).into(), 3))
    })
}

/// Returns the live pads that the bench binds.
fn pads(cell: &GuidedCell<'_>) -> Vec<Pad> {
    let mut pads: Vec<Pad> = Vec::new();
    for bound in cell.bound() {
        let Some(port) = cell.port::<Image>(bound, "image") else { continue };
        let description = cell.device(port).description();
        let output = description.output_on::<Image>(bound.side.as_deref(), "image");
        let Some(Shape::Image(shape)) = output.map(|output| description.shape_of(output)) else { continue };
        let is_known = |pad: &Pad| (&pad.bound.device, &pad.bound.side) == (&bound.device, &bound.side);
        if pads.iter().any(is_known) {
            continue;
        }
        let mount = mount::stated(description, bound.side.as_deref());
        let noise = Noise::new(shape.clone());
        let (bound, shape) = (bound.clone(), shape.clone());
        pads.push(Pad { bound, port, shape, mount, noise, writes: 0, first: None });
    }
    pads
}

impl Pad {
    fn add_noise(&mut self, cell: &GuidedCell<'_>) {
        let writes = cell.writes(self.port);
        let Some(image) = cell.read(self.port).filter(|_| writes > self.writes) else { return };
        self.writes = writes;
        self.first.get_or_insert_with(Instant::now);
        self.noise.add(image);
    }
}
