//! The table of the fault matrix, from the file `table.toml`.

use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

/// A phase of a run in which a fault strikes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub enum Phase {
    /// Half-way from the first motion to the first contact.
    #[serde(rename = "approach")]
    Approach,
    /// 0.1 s after the first contact.
    #[serde(rename = "first touch")]
    FirstTouch,
    /// In contact, with the sensor slower than 2 mm/s.
    #[serde(rename = "steady")]
    Steady,
    /// In contact, with the sensor faster than 3 mm/s along the pad.
    #[serde(rename = "sliding")]
    Sliding,
    /// While a limiter reduces the motion.
    #[serde(rename = "at a limit")]
    AtALimit,
    /// From the tick in which the operator sends `stop`.
    #[serde(rename = "ramping")]
    Ramping,
}

impl Phase {
    /// All phases.
    pub const ALL: [Self; 6] =
        [Self::Approach, Self::FirstTouch, Self::Steady, Self::Sliding, Self::AtALimit, Self::Ramping];

    /// Returns its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        ["approach", "first touch", "steady", "sliding", "at a limit", "ramping"][self as usize]
    }
}

/// What has come of a run with a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Fate {
    /// The task goes on.
    #[serde(rename = "holds")]
    Holds,
    /// The pad is without the contact that it has in the run without the fault.
    #[serde(rename = "loses contact")]
    Loses,
    /// The commands are held at zero, and the cause is named.
    #[serde(rename = "halts")]
    Halts,
    /// The run has ended with a named fault.
    #[serde(rename = "fails")]
    Fails,
}

impl Fate {
    /// Returns its name.
    #[must_use]
    pub const fn name(self) -> &'static str {
        ["holds", "loses contact", "halts", "fails"][self as usize]
    }
}

/// What a fault adds to the force ceiling, for a physical reason.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
enum Allowance {
    /// The pad reads this fraction of the force, so the ceiling is that much higher.
    OverGain,
    /// A hand moves the arm with this force: its spring and its mass then throw the pad at the object.
    Throw,
    /// The object moves at this speed: its hit is the speed times the root of stiffness and mass.
    Hit,
}

/// One row: a fault that grows.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Row {
    pub(super) name: String,
    /// The word of `[[inject]]`.
    pub(super) fault: String,
    #[serde(default)]
    keys: String,
    grow: String,
    #[serde(default)]
    of_largest: bool,
    along: Option<[f64; 3]>,
    /// How long the fault is there [s]; to the end of the run if not given.
    lasts_s: Option<f64>,
    pub(super) severities: Vec<f64>,
    pub(super) unit: String,
    approach: Vec<Fate>,
    contact: Vec<Fate>,
    allowance: Option<Allowance>,
    why: String,
}

/// The table.
#[derive(Deserialize)]
pub(super) struct Table {
    /// The name of the port of the true force on a pad.
    pub(super) true_force: String,
    #[serde(rename = "row")]
    pub(super) rows: Vec<Row>,
}

pub(super) static TABLE: LazyLock<Table> =
    LazyLock::new(|| toml::from_str(include_str!("table.toml")).expect("a test reads the same file"));

/// What the moving mass of an arm adds to the force of a touch after the command has stopped [N]: the largest speed at
/// which the contact limit lets a stiff arm touch, 12.6 mm/s, times [`HIT_N_S_PER_M`].
const TOUCH_N: f64 = 6.0;
/// The root of stiffness and mass, of 77 kN/m of foam under the whole pad and of 3 kg [N s/m].
const HIT_N_S_PER_M: f64 = 480.0;
/// How much larger a hit is than the push behind it [1]. A push F that begins or ends at once lets an arm of stiffness k and
/// mass m swing by F / k about its rest, and one that does both by at most twice that. Such a swing throws the pad with
/// 2 F / √(k m), and a foam of stiffness c stops it with √(c m) of that: 2 √(c / k) = 10.13, of 3 kN/m and of 77 kN/m.
const THROW: f64 = 10.2;

impl Row {
    /// Returns what may come of the smallest severity in a phase.
    pub(super) fn expected(&self, phase: Phase) -> Vec<Fate> {
        match phase {
            Phase::Approach => self.approach.clone(),
            Phase::FirstTouch | Phase::Steady | Phase::Sliding => self.contact.clone(),
            // A limit can act before the touch and after it.
            Phase::AtALimit => {
                let more = self.approach.iter().filter(|fate| !self.contact.contains(fate));
                self.contact.iter().chain(more).copied().collect()
            }
            Phase::Ramping => vec![Fate::Halts, Fate::Fails],
        }
    }

    /// Returns the largest true force [N] that a fault of that severity may cause under a ceiling.
    pub(super) fn bound(&self, severity: f64, ceiling: f64) -> f64 {
        let allowed = match self.allowance {
            None => ceiling,
            Some(Allowance::OverGain) => ceiling / severity,
            Some(Allowance::Throw) => ceiling + severity * THROW,
            Some(Allowance::Hit) => ceiling + severity * HIT_N_S_PER_M,
        };
        allowed + TOUCH_N
    }

    /// Returns the entry `[[inject]]` of that severity for a role, from `at` [s] on.
    pub(super) fn entry(
        &self,
        severity: f64,
        [role, at]: [&str; 2],
        largest: f64,
        joints: &[String],
        cells: usize,
    ) -> String {
        let value = match (self.grow.as_str(), self.along) {
            ("frames", _) => format!("{severity}"),
            ("cells", _) => format!("{}", (severity as usize).min(cells)),
            ("joints", _) => format!("{:?}", chosen(joints, severity as usize)),
            (_, Some(axis)) => format!("{:?}", axis.map(|part| part * severity)),
            _ if self.of_largest => format!("{:?}", severity * largest),
            _ => format!("{severity:?}"),
        };
        let mut lines = vec![format!("role = {role:?}\nfault = {:?}\nfrom_s = {at}", self.fault)];
        lines.extend(self.lasts_s.map(|lasts| format!("to_s = {:.3}", at.parse::<f64>().unwrap_or(0.0) + lasts)));
        lines.extend((!self.keys.is_empty()).then(|| self.keys.replace("LARGEST", &format!("{largest:?}"))));
        lines.extend((!self.grow.is_empty()).then(|| format!("{} = {value}", self.grow)));
        format!("[[inject]]\n{}\n", lines.join("\n"))
    }

    /// Whether the fault spoils commands.
    pub(super) fn is_of_commands(&self) -> bool {
        matches!(self.fault.as_str(), "lost" | "lag" | "joint_stop")
    }

    /// Whether the fault disturbs the world.
    pub(super) fn is_of_world(&self) -> bool {
        matches!(self.fault.as_str(), "push" | "gone" | "stiff" | "moving")
    }

    /// Returns by how much later an image may show what has happened [s].
    pub(super) fn delay(&self, severity: f64) -> f64 {
        if matches!(self.fault.as_str(), "late" | "jitter") { severity * 1e-3 } else { 0.0 }
    }

    /// Returns the row as the documentation shows it.
    fn described(&self) -> [String; 6] {
        let fates = |fates: &[Fate]| fates.iter().map(|fate| fate.name()).collect::<Vec<_>>().join(" or ");
        let grown: Vec<String> = self.severities.iter().map(f64::to_string).collect();
        let grown = if self.unit.is_empty() { "-".to_owned() } else { format!("{} {}", grown.join(", "), self.unit) };
        let force = match self.allowance {
            None => "ceiling + 6 N",
            Some(Allowance::OverGain) => "ceiling / gain + 6 N",
            Some(Allowance::Throw) => "ceiling + 6 N + 10.2 times the push",
            Some(Allowance::Hit) => "ceiling + 6 N + 480 N s/m of the speed",
        };
        [self.name.clone(), grown, fates(&self.approach), fates(&self.contact), force.to_owned(), self.why.clone()]
    }
}

/// Returns so many joints, spread from the base to the tip.
fn chosen(joints: &[String], count: usize) -> Vec<&str> {
    let count = count.min(joints.len());
    (0..count).map(|i| joints[(2 * i + 1) * joints.len() / (2 * count)].as_str()).collect()
}

/// Returns the rows as the documentation shows them: the fault, its severities, what is expected in the approach and in
/// contact, the bound of the force, and why.
#[must_use]
pub fn described() -> Vec<[String; 6]> {
    TABLE.rows.iter().map(Row::described).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn severities_grow_away_from_no_fault_and_each_row_has_another_name() {
        for (i, row) in TABLE.rows.iter().enumerate() {
            let steps: Vec<f64> = row.severities.windows(2).map(|pair| pair[1] - pair[0]).collect();
            assert!(steps.iter().all(|step| step * steps[0] > 0.0), "{}", row.name);
            assert!(TABLE.rows[..i].iter().all(|other| other.name != row.name), "{}", row.name);
        }
    }

    #[test]
    fn joints_are_spread() {
        let joints = ["a", "b", "c", "d", "e", "f", "g"].map(str::to_owned);
        assert_eq!(chosen(&joints, 1), ["d"]);
        assert_eq!(chosen(&joints, 2), ["b", "f"]);
        assert_eq!(chosen(&joints, 16), ["a", "b", "c", "d", "e", "f", "g"]);
    }
}
