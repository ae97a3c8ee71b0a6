//! The contacts that a bench declares: how features answer the motion of the sensor.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

/// What the arm touches: one entry of `contacts` in `[facts.ARM]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Contact {
    /// Name of the object, for messages.
    pub(crate) object: String,
    /// Time from a command to the image that shows its effect, without the period of the samples and without filters
    /// [ms].
    #[serde(default)]
    pub(crate) latency_ms: f64,
    /// The features, by the name of the port that measures them.
    #[serde(flatten)]
    pub(crate) features: BTreeMap<String, Answer>,
}

/// How one feature answers the commanded motion of the sensor.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Answer {
    /// Change of the feature for each metre along x, y and z of the sensor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) vx: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) vy: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) vz: Option<f64>,
    /// Change of the feature for each radian about x, y and z of the sensor.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) wx: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) wy: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) wz: Option<f64>,
    /// Resonance of arm and contact along this motion [Hz]; a rigid arm has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) resonance_hz: Option<f64>,
    /// Damping of the resonance, as a fraction of the critical one [1].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) damping_ratio: Option<f64>,
    /// Latency of this feature, instead of that of the contact [ms].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) latency_ms: Option<f64>,
    /// How far the sensor moves after a turn until the feature of a contact that sticks follows [m] or [rad].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) play: Option<f64>,
    /// What was measured in place of resonance and latency: frequency [Hz], answer as a multiple of that to a slow motion
    /// [1], and its phase [deg].
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) response: Vec<[f64; 3]>,
}

/// Damping of a resonance that a bench states without one: that of the paper's arm [1].
const USUAL_DAMPING: f64 = 0.2;
/// Largest frequency of a response [Hz].
const MAX_HZ: f64 = 1000.0;

impl Answer {
    /// Returns what geometry alone says of a feature: a place moves against the sensor, and so does an angle about its
    /// normal. `None` if the object decides.
    pub(crate) fn of_geometry(feature: &str) -> Option<Self> {
        match feature {
            "x" => Some(Self { vx: Some(-1.0), ..Self::default() }),
            "y" => Some(Self { vy: Some(-1.0), ..Self::default() }),
            "orientation" | "angle" => Some(Self { wz: Some(-1.0), ..Self::default() }),
            _ => None,
        }
    }

    /// Returns whether it says how the feature follows in time: by a resonance, a latency or a response.
    pub(crate) const fn states_dynamics(&self) -> bool {
        self.resonance_hz.is_some() || self.latency_ms.is_some() || !self.response.is_empty()
    }

    /// Returns the change of the feature along each component of a twist, as far as it is stated.
    pub(crate) const fn entries(&self) -> [Option<f64>; 6] {
        [self.vx, self.vy, self.vz, self.wx, self.wy, self.wz]
    }

    /// States the change of the feature along one component.
    pub(crate) fn set_entry(&mut self, component: usize, change: f64) {
        let Self { vx, vy, vz, wx, wy, wz, .. } = self;
        *[vx, vy, vz, wx, wy, wz][component] = Some(change);
    }

    /// Returns the change of the feature for each unit of a twist.
    pub(crate) fn row(&self) -> [f64; 6] {
        self.entries().map(Option::unwrap_or_default)
    }

    /// Returns the change of the feature for one unit of a column.
    pub(crate) fn along(&self, column: &[f64; 6]) -> f64 {
        self.row().iter().zip(column).map(|(answer, entry)| answer * entry).sum()
    }

    /// Returns the circular frequency [rad/s] and the damping ratio of the resonance.
    pub(crate) fn resonance(&self) -> Option<(f64, f64)> {
        let damping = self.damping_ratio.unwrap_or(USUAL_DAMPING);
        self.resonance_hz.map(|hz| (2.0 * std::f64::consts::PI * hz, damping))
    }

    /// Returns by how much the feature answers late at most: by its latency, or at a frequency of its response [ms].
    ///
    /// Frequencies below 1 Hz count if there are no others: an error of 1 deg in their phase is one of more than 2.7 ms.
    pub(crate) fn lag_ms(&self) -> Option<f64> {
        let is_fast = |[hz, ..]: &[f64; 3]| *hz >= 1.0;
        let has_fast = self.response.iter().any(is_fast);
        let counted = self.response.iter().filter(|point| is_fast(point) || !has_fast);
        let late = counted.map(|[hz, _, phase]| -phase / (360.0 * hz) * 1e3);
        self.latency_ms.into_iter().chain(late).reduce(f64::max).map(|lag| (10.0 * lag).round() / 10.0)
    }

    fn check(&self, feature: &str) -> Result<(), String> {
        if let Some(point) = wrong_point(&self.response).map(|i| self.response[i]) {
            return Err(format!(
                "`response` of `{feature}` has the point {point:?}: write [Hz, multiple, deg] for frequencies from low to high, \
                 such as [4.0, 1.5, -30], with a multiple greater than 0"
            ));
        }
        let positive = [("resonance_hz", self.resonance_hz), ("damping_ratio", self.damping_ratio)];
        let bad =
            positive.into_iter().find(|(_, value)| value.is_some_and(|value| !(value > 0.0 && value.is_finite())));
        let negative = |value: &f64| !(*value >= 0.0 && value.is_finite());
        if let Some(play) = self.play.filter(negative) {
            return Err(format!("`play` of `{feature}` is {play}: write 0 or more, in m or rad"));
        }
        let late = self.latency_ms.filter(negative);
        match (bad, late) {
            (Some((key, Some(value))), _) => {
                Err(format!("`{key}` of `{feature}` is {value}: write a number greater than 0"))
            }
            (_, Some(latency)) => Err(format!("`latency_ms` of `{feature}` is {latency} ms: write 0 or more")),
            _ if self.row().iter().any(|entry| !entry.is_finite()) => Err(format!("`{feature}` has no finite answer")),
            _ => Ok(()),
        }
    }
}

/// Returns the number of the wrong point of a response: the first one that is none or that comes before a slower one, or
/// the one before it if the others are right without that.
pub(crate) fn wrong_point(points: &[[f64; 3]]) -> Option<usize> {
    let first = first_bad(points.iter())?;
    let is_alone = |i: &usize| first_bad(points[..*i].iter().chain(&points[i + 1..])).is_none();
    Some(first.checked_sub(1).filter(is_alone).unwrap_or(first))
}

/// Returns the number of the first point of a response that is none, or that comes before a slower one.
fn first_bad<'a>(mut points: impl Iterator<Item = &'a [f64; 3]>) -> Option<usize> {
    let mut last = 0.0;
    points.position(|[hz, multiple, phase]| {
        let is_good = *hz > last && *hz <= MAX_HZ && *multiple > 0.0 && multiple.is_finite() && phase.is_finite();
        last = *hz;
        !is_good
    })
}

impl Contact {
    /// Returns a contact of which nothing is measured.
    pub(crate) const fn unmeasured(object: String) -> Self {
        Self { object, latency_ms: 0.0, features: BTreeMap::new() }
    }

    /// Returns the contact with no object, where geometry alone says how features answer.
    pub(crate) const fn by_geometry() -> Self {
        Self::unmeasured(String::new())
    }

    /// Returns the name of the object; `None` where geometry alone says how features answer.
    pub(crate) fn name(&self) -> Option<&str> {
        Some(&*self.object).filter(|object| !object.is_empty())
    }

    /// Returns whether geometry alone says how a feature answers: the bench states neither a resonance nor a latency nor a
    /// response of it. The latency of the contact still counts.
    pub(crate) fn is_by_geometry(&self, feature: &str) -> bool {
        let stated = self.features.get(feature);
        !stated.is_some_and(Answer::states_dynamics) && Answer::of_geometry(feature).is_some()
    }

    /// Returns how a feature answers: as the bench says, or else by geometry.
    pub(crate) fn answer(&self, feature: &str) -> Option<Answer> {
        self.features.get(feature).cloned().or_else(|| Answer::of_geometry(feature))
    }

    /// Returns the time from a command to the image of its effect that the bench states for a feature, without the period of
    /// the samples and without filters [s].
    pub(crate) fn stated_latency_s(&self, feature: &str) -> f64 {
        let own = self.features.get(feature).and_then(|answer| answer.latency_ms);
        1e-3 * own.unwrap_or(self.latency_ms)
    }

    /// Returns the same time as far as it is known: where nothing was measured of this feature that contains the latency of
    /// its pad, it is at least that, `of_pad` [s].
    pub(crate) fn latency_s(&self, feature: &str, of_pad: f64) -> f64 {
        let contains = |answer: &Answer| answer.latency_ms.is_some() || !answer.response.is_empty();
        let stated = self.stated_latency_s(feature);
        if self.features.get(feature).is_some_and(contains) { stated } else { stated.max(of_pad) }
    }

    fn check(&self) -> Result<(), String> {
        if !(self.latency_ms >= 0.0 && self.latency_ms.is_finite()) {
            return Err(format!("`latency_ms` is {} ms: write 0 or more", self.latency_ms));
        }
        self.features.iter().try_for_each(|(feature, answer)| answer.check(feature))
    }
}

/// Returns the contacts that the bench of a graph declares for an arm.
///
/// # Errors
/// If the fact has another form.
pub(crate) fn contacts(facts: &[(String, toml::Value)], arm: &str) -> Result<Vec<Contact>, String> {
    let name = format!("{arm}.contacts");
    let Some((_, value)) = facts.iter().find(|(fact, _)| *fact == name) else { return Ok(Vec::new()) };
    let wrong = |why: String| {
        let example =
            r#"contacts = [{ object = "ball", pressure = { vz = 12.0, resonance_hz = 5.0, damping_ratio = 0.2 } }]"#;
        let why = why.trim_end();
        format!("`contacts` in `[facts.{arm}]` of the bench: {why}\nwrite, for example, `{example}`")
    };
    if value.is_table() {
        return Err(format!(
            "`contacts` is one table here: write `[[facts.{arm}.contacts]]` with two brackets, once for each object"
        ));
    }
    let contacts: Vec<Contact> = value.clone().try_into().map_err(|error: toml::de::Error| wrong(error.to_string()))?;
    for contact in &contacts {
        contact.check().map_err(|why| wrong(format!("{}: {why}", contact.object)))?;
    }
    Ok(contacts)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<Contact>, String> {
        let table: toml::Table = toml::from_str(text).unwrap();
        contacts(&[("arm.contacts".into(), table["contacts"].clone())], "arm")
    }

    #[test]
    fn a_contact_states_what_geometry_does_not() {
        let read =
            read(r#"contacts = [{ object = "ball", latency_ms = 4, pressure = { vz = 12.0, resonance_hz = 5.0 } }]"#);
        let ball = &read.unwrap()[0];
        assert_eq!(ball.answer("pressure").unwrap().row(), [0.0, 0.0, 12.0, 0.0, 0.0, 0.0]);
        let (circular, damping) = ball.answer("pressure").unwrap().resonance().unwrap();
        assert!((circular - 31.4159).abs() < 1e-3 && damping == 0.2);
        assert_eq!(ball.answer("y").unwrap().row(), [0.0, -1.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(ball.answer("force"), None);
        assert_eq!(contacts(&[], "arm"), Ok(Vec::new()));
    }

    #[test]
    fn the_latency_of_a_pad_counts_unless_something_measured_contains_it() {
        let read = read(
            r#"contacts = [{ object = "ball", latency_ms = 4, x = { resonance_hz = 5.0 }, y = { vy = -1.0, latency_ms = 0 },
            pressure = { vz = 5.0, response = [[1.0, 1.0, -9.0]] } }]"#,
        );
        let ball = &read.unwrap()[0];
        let found = ["x", "y", "pressure", "angle"].map(|feature| ball.latency_s(feature, 0.08));
        assert_eq!(found, [0.08, 0.0, 0.004, 0.08]);
        assert_eq!(ball.latency_s("x", 0.0), 0.004);
    }

    #[test]
    fn the_lag_of_a_response_is_that_of_its_fast_frequencies() {
        let lag = |response: &[[f64; 3]], latency_ms: Option<f64>| {
            Answer { response: response.to_vec(), latency_ms, ..Answer::default() }.lag_ms()
        };
        assert_eq!(lag(&[[0.5, 1.0, -9.0], [1.0, 1.0, -9.0], [5.0, 1.0, -36.0]], None), Some(25.0));
        assert_eq!(lag(&[[0.5, 1.0, -9.0]], Some(30.0)), Some(50.0), "nothing else is known");
        assert_eq!(lag(&[[5.0, 1.0, -36.0]], Some(30.0)), Some(30.0));
        assert_eq!(lag(&[], None), None);
    }

    #[test]
    fn what_is_no_contact_is_refused_with_an_example_that_works() {
        for (text, why) in [
            ("contacts = 3", "invalid type"),
            (r#"contacts = [{ object = "ball", pressure = { vz = 1.0, mass = 2.0 } }]"#, "unknown field `mass`"),
            (
                r#"contacts = [{ object = "ball", pressure = { vz = 1.0, resonance_hz = 0.0 } }]"#,
                "`resonance_hz` of `pressure` is 0",
            ),
            (
                r#"contacts = [{ object = "ball", x = { vx = -1.0, response = [[2.0, 1.0, 0], [1.0, 1.0, 0]] } }]"#,
                "frequencies from low to high",
            ),
            (
                r#"contacts = [{ object = "ball", x = { vx = -1.0, response = [[2.0, 0.0, 0]] } }]"#,
                "has the point [2.0, 0.0, 0.0]",
            ),
            (r#"contacts = [{ object = "ball", x = { vx = -1.0, response = [[2.0, 1.0]] } }]"#, "length"),
            (r#"contacts = [{ object = "ball", latency_ms = -1.0 }]"#, "`latency_ms` is -1"),
            (r#"contacts = [{ object = "ball", x = { vx = -1.0, play = -0.001 } }]"#, "`play` of `x` is -0.001"),
            (r#"contacts = [{ object = "ball", pressure = { vz = nan } }]"#, "no finite answer"),
        ] {
            let message = read(text).unwrap_err();
            assert!(message.contains(why), "{text}: {message}");
            let example = message.rsplit_once("for example, `").unwrap().1.trim_end_matches('`');
            assert!(read(example).is_ok(), "{example}");
        }
    }
}
