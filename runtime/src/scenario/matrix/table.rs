//! The table of the fault matrix: what strikes, how hard, and what must come of it. It is written before any run, and
//! nothing in it is measured.

use serde::Serialize;

/// A phase of a run in which a fault strikes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// Half-way from the first motion to the first contact.
    Approach,
    /// 0.1 s after the first contact.
    FirstTouch,
    /// In contact, with the sensor slower than 2 mm/s.
    Steady,
    /// In contact, with the sensor faster than 3 mm/s along the pad.
    Sliding,
    /// While a limiter reduces the motion.
    AtALimit,
    /// From the tick in which the operator sends `stop`.
    Ramping,
}

impl Phase {
    /// Returns all phases.
    pub const ALL: [Self; 6] =
        [Self::Approach, Self::FirstTouch, Self::Steady, Self::Sliding, Self::AtALimit, Self::Ramping];

    /// Returns its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        ["approach", "first touch", "steady", "sliding", "at a limit", "ramping"][self as usize]
    }
}

/// What has come of a run with a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Fate {
    /// The task goes on.
    Holds,
    /// The pad is without the contact that it has in the run without the fault.
    Loses,
    /// The commands are held at zero, and the cause is named.
    Halts,
    /// The run has ended with a named fault.
    Fails,
}

impl Fate {
    /// Returns its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        ["holds", "loses contact", "halts", "fails"][self as usize]
    }
}

/// What the severity of a fault is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Severity {
    /// The value of a key.
    Key(&'static str),
    /// The value of a key, times the largest reading of the run without a fault.
    OfLargest(&'static str),
    /// The length of a vector with this direction.
    Along(&'static str, [f64; 3]),
    /// The number of cells.
    Cells,
    /// The number of joints.
    Joints,
    /// There is only one.
    None,
}

/// What a fault adds to the force ceiling, for a physical reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Allowance {
    None,
    /// The pad reads this fraction of the force, so the ceiling is that much higher.
    OverGain,
    /// A hand presses with this force.
    Force,
    /// The object moves at this speed: its hit is the speed times the root of stiffness and mass.
    Hit,
}

/// One row: a fault that grows.
#[derive(Debug)]
pub(super) struct Row {
    pub(super) name: &'static str,
    /// The word of `[[inject]]`.
    pub(super) fault: &'static str,
    /// Further keys of `[[inject]]`; `LARGEST` stands for the largest reading of the run without a fault.
    pub(super) keys: &'static str,
    /// How long the fault is there [s].
    pub(super) lasts_s: f64,
    pub(super) severity: Severity,
    pub(super) unit: &'static str,
    /// From the smallest on.
    pub(super) severities: &'static [f64],
    /// What may come of the smallest severity: in the approach, and in contact. After `stop`, the arm rests.
    pub(super) expected: [&'static [Fate]; 2],
    pub(super) allowance: Allowance,
    pub(super) why: &'static str,
}

const HOLDS: &[Fate] = &[Fate::Holds];
const LOSES: &[Fate] = &[Fate::Loses];
const STOPS: &[Fate] = &[Fate::Halts, Fate::Fails];
const HOLDS_OR_LOSES: &[Fate] = &[Fate::Holds, Fate::Loses];

/// Largest speed with which the contact limit lets a stiff arm touch [m/s], times the root of the stiffness of the foam
/// and the mass of the arm, 77 kN/m and 3 kg: what the moving mass adds to the force after the command has stopped [N].
pub(super) const TOUCH_N: f64 = 6.0;
/// The root of that stiffness and that mass [N s/m].
pub(super) const HIT_N_S_PER_M: f64 = 480.0;

const fn row(
    name: &'static str,
    fault: [&'static str; 2],
    severity: Severity,
    unit: &'static str,
    severities: &'static [f64],
    expected: [&'static [Fate]; 2],
    why: &'static str,
) -> Row {
    let [fault, keys] = fault;
    Row { name, fault, keys, lasts_s: 0.0, severity, unit, severities, expected, allowance: Allowance::None, why }
}

impl Row {
    const fn allows(self, allowance: Allowance) -> Self {
        Self { allowance, ..self }
    }

    const fn lasts(self, lasts_s: f64) -> Self {
        Self { lasts_s, ..self }
    }
}

use Severity::{Along, Cells, Joints, Key, OfLargest};

const DELAYS: &[f64] = &[8.0, 20.0, 50.0, 100.0, 200.0];
const FORCES: &[f64] = &[2.0, 5.0, 10.0, 20.0];
const SPEEDS: &[f64] = &[0.005, 0.01, 0.02, 0.05];
const BOTH: [&[Fate]; 2] = [HOLDS, HOLDS];

/// The rows.
pub(super) const ROWS: &[Row] = &[
    row(
        "dropped frames",
        ["missing", ""],
        Key("rate"),
        "of the frames",
        &[0.02, 0.1, 0.3, 0.6, 1.0],
        BOTH,
        "single frames do not count",
    ),
    row(
        "repeated frames",
        ["repeat", ""],
        Key("rate"),
        "of the frames",
        &[0.05, 0.2, 0.5, 1.0],
        BOTH,
        "single frames do not count",
    ),
    row(
        "delayed frames",
        ["late", ""],
        Key("delay_ms"),
        "ms",
        DELAYS,
        BOTH,
        "two periods of the pad are within the age that each node takes",
    ),
    row(
        "jitter",
        ["jitter", ""],
        Key("delay_ms"),
        "ms",
        DELAYS,
        BOTH,
        "two periods of the pad are within the age that each node takes",
    ),
    row(
        "garbage",
        ["garbage", "reading = LARGEST"],
        Key("frames"),
        "frames",
        &[1.0, 2.0, 3.0, 10.0, 50.0],
        BOTH,
        "one frame is not believed",
    ),
    row(
        "not a number",
        ["nan", "cells = 1"],
        Key("frames"),
        "frames",
        &[1.0, 5.0, 50.0],
        [STOPS, STOPS],
        "such a sample is a fault of its role",
    ),
    row(
        "dead cells",
        ["dead", ""],
        Cells,
        "cells",
        &[3.0, 8.0, 16.0, 64.0],
        BOTH,
        "the foam spreads a load over the neighbours",
    ),
    row(
        "stuck cell",
        ["stuck", "cells = 1"],
        OfLargest("reading"),
        "of the largest reading",
        &[0.5, 1.0, 2.0, 10.0],
        [HOLDS_OR_LOSES, HOLDS],
        "a ceiling must feel a pin, so the way in is barred from some reading on",
    ),
    row(
        "spikes",
        ["spike", "cells = 1\nrate = 0.02"],
        OfLargest("reading"),
        "of the largest reading",
        &[0.5, 1.0, 2.0, 10.0],
        BOTH,
        "one frame is not believed",
    ),
    row(
        "gain too low",
        ["gain", ""],
        Key("factor"),
        "of the reading",
        &[0.8, 0.5, 0.2, 0.05],
        BOTH,
        "the pad reads less, so the ceiling is higher",
    )
    .allows(Allowance::OverGain),
    row(
        "gain too high",
        ["gain", ""],
        Key("factor"),
        "of the reading",
        &[1.25, 2.0, 5.0, 20.0],
        BOTH,
        "the arm presses less",
    ),
    row(
        "drift up",
        ["drift", ""],
        OfLargest("reading_per_s"),
        "of the largest reading per s",
        &[0.01, 0.05, 0.2, 1.0],
        [HOLDS_OR_LOSES, HOLDS],
        "the arm presses less, until the way in is barred",
    ),
    row(
        "drift down",
        ["drift", ""],
        OfLargest("reading_per_s"),
        "of the largest reading per s",
        &[-0.01, -0.05, -0.2, -1.0],
        BOTH,
        "the arm presses more, until the pad feels nothing",
    ),
    row("swapped cells", ["swapped", ""], Cells, "cells", &[2.0, 8.0, 32.0, 64.0], BOTH, "the sum is the same"),
    row(
        "lost commands",
        ["lost", ""],
        Key("frames"),
        "commands",
        &[1.0, 5.0, 12.0, 25.0],
        BOTH,
        "the device goes on as before",
    ),
    row(
        "lagging commands",
        ["lag", ""],
        Key("delay_ms"),
        "ms",
        &[4.0, 12.0, 25.0, 50.0, 100.0],
        BOTH,
        "one period is within the phase margin of each loop",
    ),
    row(
        "joint stops",
        ["joint_stop", ""],
        Joints,
        "joints",
        &[1.0, 2.0, 4.0, 16.0],
        [HOLDS_OR_LOSES, HOLDS_OR_LOSES],
        "the pad turns, and its limits hold as before",
    ),
    row("hand presses", ["push", ""], Along("push_n", [0.0, 0.0, 1.0]), "N", FORCES, BOTH, "the hand adds its force")
        .allows(Allowance::Force)
        .lasts(0.5),
    row(
        "hand pulls",
        ["push", ""],
        Along("push_n", [0.0, 0.0, -1.0]),
        "N",
        FORCES,
        [HOLDS, HOLDS_OR_LOSES],
        "the spring of the arm gives way",
    )
    .lasts(0.5),
    row(
        "hand pushes aside",
        ["push", ""],
        Along("push_n", [1.0, 0.0, 0.0]),
        "N",
        FORCES,
        [HOLDS, HOLDS_OR_LOSES],
        "the spring of the arm gives way",
    )
    .lasts(0.5),
    row("object gone", ["gone", ""], Severity::None, "", &[1.0], [LOSES, LOSES], "there is nothing to touch"),
    row(
        "object stiff",
        ["stiff", ""],
        Key("factor"),
        "of the stiffness",
        &[2.0, 5.0, 20.0, 100.0],
        BOTH,
        "the foam of the pad stays soft",
    ),
    row(
        "object moves away",
        ["moving", ""],
        Along("velocity_m_per_s", [0.0, 0.0, 1.0]),
        "m/s",
        SPEEDS,
        [HOLDS_OR_LOSES, HOLDS_OR_LOSES],
        "the arm follows, or has lost the contact",
    )
    .lasts(0.3),
    row(
        "object moves on",
        ["moving", ""],
        Along("velocity_m_per_s", [0.0, 0.0, -1.0]),
        "m/s",
        SPEEDS,
        BOTH,
        "its hit adds to the force",
    )
    .allows(Allowance::Hit)
    .lasts(0.3),
    row(
        "object moves aside",
        ["moving", ""],
        Along("velocity_m_per_s", [1.0, 0.0, 0.0]),
        "m/s",
        SPEEDS,
        [HOLDS_OR_LOSES, HOLDS_OR_LOSES],
        "the arm follows, or has lost the contact",
    )
    .lasts(0.3),
];

impl Row {
    /// Returns what may come of the smallest severity in a phase.
    pub(super) fn expected(&self, phase: Phase) -> Vec<Fate> {
        match phase {
            Phase::Approach => self.expected[0].to_vec(),
            // A pad that has just touched may bounce, and the contact at a limit may be anywhere in a run.
            Phase::FirstTouch | Phase::Steady | Phase::Sliding | Phase::AtALimit => self.expected[1].to_vec(),
            Phase::Ramping => vec![Fate::Halts, Fate::Fails],
        }
    }

    /// Returns the largest true force [N] that a fault of that severity may cause under a ceiling.
    pub(super) fn bound(&self, severity: f64, ceiling: f64) -> f64 {
        TOUCH_N
            + match self.allowance {
                Allowance::None => ceiling,
                Allowance::OverGain => ceiling / severity,
                Allowance::Force => ceiling + severity,
                Allowance::Hit => ceiling + severity * HIT_N_S_PER_M,
            }
    }

    /// Returns the entry `[[inject]]` of that severity for a role, from a time on [s].
    pub(super) fn entry(
        &self,
        severity: f64,
        role: &str,
        at: f64,
        largest: f64,
        joints: &[String],
        cells: usize,
    ) -> String {
        let keys = self.keys.replace("LARGEST", &format!("{largest:?}"));
        let grown = match self.severity {
            Key("frames") => format!("frames = {severity}"),
            Key(key) => format!("{key} = {severity:?}"),
            OfLargest(key) => format!("{key} = {:?}", severity * largest),
            Along(key, axis) => format!("{key} = {:?}", axis.map(|part| part * severity)),
            Cells => format!("cells = {}", (severity as usize).min(cells)),
            Joints => format!("joints = {:?}", chosen(joints, severity as usize)),
            Severity::None => String::new(),
        };
        let until = if self.lasts_s > 0.0 { format!("to_s = {:?}", at + self.lasts_s) } else { String::new() };
        let head = format!("role = {role:?}\nfault = {:?}\nfrom_s = {at:?}", self.fault);
        let lines = [head, until, keys, grown].into_iter().filter(|line| !line.is_empty());
        format!("[[inject]]\n{}\n", lines.collect::<Vec<_>>().join("\n"))
    }

    /// Whether the fault spoils commands, or disturbs the world.
    pub(super) fn is_of_commands(&self) -> bool {
        matches!(self.fault, "lost" | "lag" | "joint_stop")
    }

    /// See [`is_of_commands`](Self::is_of_commands).
    pub(super) fn is_of_world(&self) -> bool {
        matches!(self.fault, "push" | "gone" | "stiff" | "moving")
    }

    /// Returns the cells of the row in the table of the documentation.
    pub(super) fn described(&self) -> [String; 6] {
        let fates = |fates: &[Fate]| fates.iter().map(|fate| fate.name()).collect::<Vec<_>>().join(" or ");
        let grown: Vec<String> = self.severities.iter().map(f64::to_string).collect();
        let force = match self.allowance {
            Allowance::None => "ceiling + 6 N",
            Allowance::OverGain => "ceiling / gain + 6 N",
            Allowance::Force => "ceiling + 6 N + the push",
            Allowance::Hit => "ceiling + 6 N + 480 N s/m times the speed",
        };
        let grown = if self.unit.is_empty() { "-".to_owned() } else { format!("{} {}", grown.join(", "), self.unit) };
        let [approach, contact] = self.expected.map(fates);
        [self.name.to_owned(), grown, approach, contact, force.to_owned(), self.why.to_owned()]
    }
}

/// Returns so many joints, spread from the base to the tip.
fn chosen(joints: &[String], count: usize) -> Vec<&str> {
    let count = count.min(joints.len());
    (0..count).map(|i| joints[(2 * i + 1) * joints.len() / (2 * count)].as_str()).collect()
}

/// Returns the rows of the table in the documentation: the fault, its severities, what is expected in the approach and in
/// contact, the bound of the force, and why.
#[must_use]
pub fn described() -> Vec<[String; 6]> {
    ROWS.iter().map(Row::described).collect()
}
