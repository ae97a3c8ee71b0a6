//! The questions of `teach`, and what the answers become.

use nalgebra::Vector3;
use toml_edit::{Array, Value};

use super::super::guided::vectors::three;
use super::super::guided::{GuidedCell, Left, StillPosture, TomlFile, joint_numbers, numbers};
use super::Step;
use super::plane::{FreeSide, fit};
use super::site::Site;
use super::workspace::Workspace;

/// Largest distance of a touched point from its plane without a warning [m].
const MAX_FLAT_M: f64 = 0.003;

/// What a person answers to a question.
enum Answer {
    /// A still posture was measured.
    Posture(StillPosture),
    /// The list of points is complete.
    Done,
    Skip,
}

/// What was taught.
#[derive(Debug, Default)]
pub(super) struct Taught {
    home: Option<Vec<f64>>,
    start: Option<Vec<f64>>,
    workspace: Option<Workspace>,
    planes: Option<Planes>,
}

/// Planes that were taught.
#[derive(Debug)]
struct Planes {
    /// The new rows of `keep_out`.
    rows: Vec<[f64; 4]>,
    /// Whether the rows that the bench states stay.
    keeps: bool,
}

impl Taught {
    /// Sets what was taught in a bench file.
    ///
    /// # Errors
    /// If a section of the file cannot be changed.
    pub(super) fn write_into(&self, mut file: TomlFile, site: &Site) -> Result<TomlFile, String> {
        let device = ["devices", site.arm.bound.device.as_str()];
        for (key, joints) in [("home", &self.home), ("start", &self.start)] {
            joints
                .as_ref()
                .map_or(Ok(()), |joints| file.set(&device, key, joint_numbers(joints, site.arm.joints(), 4)))?;
        }
        let limits: Vec<&str> = site.limits.iter().map(String::as_str).collect();
        if let Some(Workspace { min, max }) = self.workspace {
            file.set(&limits, "workspace_min_m", numbers(&min, 4))?;
            file.set(&limits, "workspace_max_m", numbers(&max, 4))?;
        }
        if let Some(Planes { rows, keeps }) = &self.planes {
            let rows: Array = rows.iter().map(|row| Value::Array(numbers(row, 6))).collect();
            match keeps {
                true => file.extend(&limits, "keep_out", rows)?,
                false => file.set(&limits, "keep_out", rows)?,
            }
        }
        Ok(file)
    }
}

/// A dialogue with the person who guides the arm.
pub(super) struct Dialogue<'d, 's> {
    cell: &'d mut GuidedCell<'s>,
    site: &'d Site,
    /// Room of the box around the points [m].
    margin: f64,
    /// Distance by which a plane is moved to the free side [m].
    clearance: f64,
    taught: Taught,
}

impl<'d, 's> Dialogue<'d, 's> {
    pub(super) fn new(cell: &'d mut GuidedCell<'s>, site: &'d Site, [margin, clearance]: [f64; 2]) -> Self {
        Self { cell, site, margin, clearance, taught: Taught::default() }
    }

    /// Asks for all steps.
    ///
    /// # Errors
    /// If the dialogue ends first.
    pub(super) fn teach(&mut self, steps: &[Step]) -> Result<Taught, Left> {
        self.say(&format!(
            "Nothing is sent to `{}`. Guide it by hand: gravity compensation or freedrive.\nPoints are those of {}.",
            self.site.arm.bound.role, self.site.point
        ));
        if self.site.pads_of_one_arm > 1 {
            self.say(
                "The bench has several pads. A task with two pads on this arm keeps only the origin of its first pad in the \
                 workspace and before the planes: touch with that pad.",
            );
        }
        for step in steps {
            match step {
                Step::Home => {
                    self.taught.home = self.posture("home: guide the arm to the posture that it prefers")?;
                }
                Step::Start => {
                    self.taught.start = self.posture("start: guide the arm to the posture from which runs begin")?;
                }
                Step::Workspace => self.taught.workspace = self.workspace()?,
                Step::KeepOut => self.taught.planes = self.planes()?,
            }
        }
        self.warn_of_postures();
        Ok(std::mem::take(&mut self.taught))
    }

    fn say(&self, text: &str) {
        self.cell.shell().say(text);
    }

    /// Asks until the answer is one of those that the question names. `can_end` is whether `done` is one.
    fn answer(&mut self, question: &str, can_end: bool) -> Result<Answer, Left> {
        loop {
            let line = self.cell.ask(question)?;
            match line.as_str() {
                "" => match self.site.arm.still(self.cell, |_| {})? {
                    Ok(posture) => return Ok(Answer::Posture(posture)),
                    Err(why) => self.say(&format!("  not measured: {why}")),
                },
                "s" => return Ok(Answer::Skip),
                "done" if can_end => return Ok(Answer::Done),
                other => {
                    let done = if can_end { ", `done` ends the list" } else { "" };
                    self.say(&format!("  `{other}` is no answer here: Enter measures, `s` skips{done}"));
                }
            }
        }
    }

    /// Asks for a posture, and returns its joints.
    fn posture(&mut self, what: &str) -> Result<Option<Vec<f64>>, Left> {
        let answer = self.answer(&format!("\n{what}. Enter measures, `s` skips:"), false)?;
        let Answer::Posture(posture) = answer else { return Ok(None) };
        self.say_point(&self.site.point_of(&posture.tip));
        Ok(Some(posture.joints))
    }

    fn say_point(&self, point: &Vector3<f64>) {
        self.say(&format!("  measured, at {} m", three(point, 4)));
    }

    /// Asks for points until `close` makes something of them. Returns `None` if the step is skipped.
    fn points<T>(
        &mut self,
        question: &str,
        close: impl Fn(&[Vector3<f64>]) -> Result<T, String>,
    ) -> Result<Option<T>, Left> {
        let mut points = Vec::new();
        loop {
            match self.answer(&format!("{question} Point {}:", points.len() + 1), true)? {
                Answer::Posture(posture) => {
                    let point = self.site.point_of(&posture.tip);
                    self.say_point(&point);
                    points.push(point);
                }
                Answer::Skip => return Ok(None),
                Answer::Done => match close(&points) {
                    Ok(made) => return Ok(Some(made)),
                    Err(why) => self.say(&format!("  {why}")),
                },
            }
        }
    }

    fn workspace(&mut self) -> Result<Option<Workspace>, Left> {
        let margin = self.margin;
        let question = "\nworkspace: visit corners and bounds of it, two points or more. Enter adds a point, `done` ends, \
                        `s` skips.";
        let found = self.points(question, |points| Workspace::around(points, margin))?;
        if let Some(found @ Workspace { min, max }) = found {
            let size: Vec<String> = (0..3).map(|axis| format!("{:.0}", (max[axis] - min[axis]) * 1e3)).collect();
            self.say(&format!("  the box is {} mm", size.join(" x ")));
            let narrowed = self.site.general.as_ref().map(|limits| found.narrowed_by(limits)).unwrap_or_default();
            narrowed.iter().for_each(|text| self.say(&format!("warning: {text}")));
        }
        Ok(found)
    }

    /// Asks for planes until one is skipped.
    fn planes(&mut self) -> Result<Option<Planes>, Left> {
        let mut rows = Vec::new();
        loop {
            let question = format!(
                "\nkeep-out plane {}: touch it in three points or more, far apart. Enter adds a point, `done` ends the \
                 plane, `s` ends the planes.",
                rows.len() + 1
            );
            let Some(fit) = self.points(&question, fit)? else { break };
            self.say(&format!("  the largest distance of a point from the plane is {:.1} mm", fit.residual * 1e3));
            if fit.residual > MAX_FLAT_M {
                self.say("  warning: the points are not in one plane: is the surface flat, and did the same point of the pad touch it?");
            }
            if let Some(side) = self.free_side(|point| fit.facing(point))? {
                rows.push(side.row(self.clearance));
            }
        }
        if rows.is_empty() {
            return Ok(None);
        }
        let keeps = self.keeps_rows()?;
        Ok(Some(Planes { rows, keeps }))
    }

    /// Returns the plane with its free side: that of home, or else of the start, or else of a posture that is asked for.
    /// A posture of the robot file was not chosen for this cell, so it shows no side.
    fn free_side(&mut self, facing: impl Fn(&Vector3<f64>) -> Option<FreeSide>) -> Result<Option<FreeSide>, Left> {
        let [home, start] = self.site.is_stated;
        let home = self.taught.home.clone().or_else(|| self.site.home.clone().filter(|_| home));
        let start = self.taught.start.clone().or_else(|| self.site.start.clone().filter(|_| start));
        for (name, joints) in [("home", home), ("the start", start)] {
            let side = joints.and_then(|joints| facing(&self.site.point_at(&joints)));
            if let Some(side) = side {
                self.say(&format!("  the side of {name} is free: {} of the base", side.direction()));
                return Ok(Some(side));
            }
        }
        loop {
            let question =
                "  guide the arm to the free side, 10 mm or more from the plane. Enter measures, `s` drops the plane:";
            let Answer::Posture(posture) = self.answer(question, false)? else { return Ok(None) };
            match facing(&self.site.point_of(&posture.tip)) {
                Some(side) => {
                    self.say(&format!("  this side is free: {} of the base", side.direction()));
                    return Ok(Some(side));
                }
                None => self.say("  this is nearer than 10 mm to the plane"),
            }
        }
    }

    /// Asks whether the planes that the bench states stay.
    fn keeps_rows(&mut self) -> Result<bool, Left> {
        let count = self.site.rows.len();
        let general =
            self.site.general.as_ref().and_then(|limits| limits.get("keep_out")?.as_array()).map_or(0, Vec::len);
        if general > 0 {
            self.say(&format!(
                "\n`keep_out` of `[limits]` has rows for all arms: {general}. They stay, also after `replace`."
            ));
        }
        if count == 0 {
            return Ok(true);
        }
        loop {
            let question = format!("\n`keep_out` of the bench has rows already: {count}. Type `keep` or `replace`:");
            match self.cell.ask(&question)?.as_str() {
                "keep" => return Ok(true),
                "replace" => return Ok(false),
                _ => {}
            }
        }
    }

    fn known_home(&self) -> Option<Vec<f64>> {
        self.taught.home.clone().or_else(|| self.site.home.clone())
    }

    fn known_start(&self) -> Option<Vec<f64>> {
        self.taught.start.clone().or_else(|| self.site.start.clone())
    }

    /// Warns if home or the start is outside of what was taught.
    fn warn_of_postures(&self) {
        for (name, joints) in [("home", self.known_home()), ("start", self.known_start())] {
            let Some(point) = joints.map(|joints| self.site.point_at(&joints)) else { continue };
            if let Some(why) = self.taught.workspace.and_then(|workspace| workspace.outside(&point)) {
                self.say(&format!("warning: `{name}` is outside of the workspace: {why}"));
            }
            for row in self.all_rows() {
                let height = FreeSide::of_row(row).height(&point);
                if height < 0.0 {
                    self.say(&format!("warning: `{name}` is {:.1} mm behind the plane {row:.4?}", -height * 1e3));
                }
            }
        }
    }

    /// Returns the rows of `keep_out` that hold for this arm, if planes were taught.
    fn all_rows(&self) -> Vec<[f64; 4]> {
        let Some(Planes { rows, keeps }) = &self.taught.planes else { return Vec::new() };
        let kept = self.site.rows.iter().filter(|_| *keeps);
        kept.chain(rows).copied().collect()
    }
}
