//! The control law of a twist: what each component answers, and with which gain.

use nalgebra::Matrix6;
use serde::Serialize;
use tactflow_runtime::graph::OutlinedBlock;

use super::contacts::Contact;
use super::digits::to_three_digits;
use super::filters::{Filter, smoothing, way};
use super::mount::Turn;
use super::nodes::{Nodes, source};
use super::schedule::Schedule;

/// A usual step of a place [m] and of an angle [rad].
const PLACE_STEP: f64 = 5e-3;
const ANGLE_STEP: f64 = 0.05;

/// What a twist is made of.
#[derive(Debug, Default, Serialize)]
pub(crate) struct Law {
    pub(crate) features: Vec<Feature>,
    /// Constant motions.
    pub(crate) constants: Vec<Constant>,
    /// Other nodes that move the arm, which this command does not know in numbers.
    pub(crate) guidance: Vec<Guidance>,
}

/// A feature that is controlled.
#[derive(Debug, Clone, Default, Serialize)]
pub(crate) struct Feature {
    pub(crate) name: String,
    /// Speed of each component for one unit of control, after the projectors.
    pub(crate) column: [f64; 6],
    pub(crate) kp: f64,
    pub(crate) ki: f64,
    pub(crate) kd: f64,
    /// By how much its control may grow in a second [unit of the feature per s²].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) rise: Option<f64>,
    /// Speed beyond that of its control from which on it is braked [unit of the feature per s].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) brake_above: Option<f64>,
    /// Largest control [unit of the feature per s].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) limit: Option<f64>,
    /// Largest error that the integral counts [unit of the feature].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) within: Option<f64>,
    /// The port that is measured, before its filters.
    pub(crate) measured: Option<String>,
    pub(crate) setpoint: Option<f64>,
    /// The node that turns its control into a twist.
    #[serde(skip)]
    pub(crate) jacobian: String,
    /// Its controller.
    #[serde(skip)]
    pub(crate) pid: Option<String>,
    /// The node that compares it with its setpoint.
    #[serde(skip)]
    pub(crate) compared: Option<String>,
    /// Nominal time between two samples of its error [s].
    #[serde(skip)]
    pub(crate) period_s: f64,
    /// Time from its measurement until the sample arrives, as far as its device states it [s].
    #[serde(skip)]
    pub(crate) latency_s: f64,
    /// Filters from the measurement to the motion.
    pub(crate) filters: Vec<Filter>,
    /// By how much less the sides of switches smooth that are not followed [s].
    #[serde(skip)]
    pub(crate) spared_s: f64,
    /// The flags without which it moves nothing.
    #[serde(skip)]
    pub(crate) gates: Vec<String>,
    /// What turns its column.
    #[serde(skip)]
    pub(crate) turn: Option<Turn>,
    /// What mounts and projectors make of the column that is written.
    #[serde(skip)]
    pub(crate) way: Matrix6<f64>,
    /// The switches that it passes, with the number of the side, where the selection is not known.
    #[serde(skip)]
    pub(crate) sides: Vec<(String, usize)>,
    /// What multiplies all three gains, depending on the contact.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub(crate) schedules: Vec<Schedule>,
    /// What else moves the arm by the same measurement, or presses by another one: its loop adds to this one.
    #[serde(skip)]
    pub(crate) beside: Vec<Self>,
}

/// A constant twist, after the projectors.
#[derive(Debug, Serialize)]
pub(crate) struct Constant {
    pub(crate) node: String,
    pub(crate) twist: [f64; 6],
    /// Whether every gate and switch on its way is open, whatever the pad feels.
    #[serde(skip)]
    pub(crate) is_open: bool,
    /// Whether every gate and switch on its way is open during a contact.
    #[serde(skip)]
    pub(crate) is_open_in_contact: bool,
}

/// A node that moves the arm by a law of its own.
#[derive(Debug, Serialize)]
pub(crate) struct Guidance {
    pub(crate) port: String,
    #[serde(rename = "type")]
    pub(crate) kind: String,
    /// Components that the projectors behind it pass.
    pub(crate) passes: [bool; 6],
    /// Whether every gate and switch on its way is open, whatever the pad feels.
    #[serde(skip)]
    pub(crate) is_open: bool,
}

impl Guidance {
    /// Returns the name of the node.
    pub(crate) fn node(&self) -> &str {
        self.port.rsplit_once('.').map_or(&*self.port, |(node, _)| node)
    }
}

impl Law {
    /// Returns whether anything moves a component.
    pub(crate) fn moves(&self, i: usize) -> bool {
        self.features.iter().any(|feature| feature.column[i] != 0.0 && feature.has_gain())
            || self.constants.iter().any(|constant| constant.twist[i] != 0.0)
            || self.guidance.iter().any(|guidance| guidance.passes[i])
    }
}

impl Feature {
    /// Returns whether the feature has any gain.
    pub(crate) fn has_gain(&self) -> bool {
        [self.kp, self.ki, self.kd].iter().any(|gain| *gain != 0.0)
    }

    /// Returns whether the feature moves anything.
    pub(crate) fn moves(&self) -> bool {
        self.has_gain() && self.column.iter().any(|entry| *entry != 0.0)
    }

    /// Returns whether it presses, and moves the sensor in no other way.
    pub(crate) fn presses_alone(&self) -> bool {
        (0..6).all(|i| (self.column[i] != 0.0) == (i == 2))
    }

    /// Returns what adds to its loop over these contacts: of another measurement, only what one of them states.
    pub(crate) fn added<'f>(&'f self, contacts: &'f [Contact]) -> impl Iterator<Item = &'f Self> {
        let is_stated =
            |other: &Self| contacts.iter().any(|contact| other.quantity().and_then(|it| contact.answer(it)).is_some());
        self.beside.iter().filter(move |other| other.measured == self.measured || is_stated(other))
    }

    /// Returns the name of what is measured, as a bench states it.
    pub(crate) fn quantity(&self) -> Option<&str> {
        self.measured.as_ref()?.rsplit('.').next()
    }

    /// Returns the smallest and the largest value of what is measured, where its node states them.
    pub(crate) fn range(&self, nodes: &Nodes<'_>) -> Option<[f64; 2]> {
        nodes.output(self.measured.as_deref()?)?.range
    }

    /// Returns the unit of a place or an angle; `None` for any other quantity.
    pub(crate) fn unit(&self) -> Option<&'static str> {
        match self.quantity()? {
            "x" | "y" => Some("m"),
            "orientation" | "angle" => Some("rad"),
            _ => None,
        }
    }

    /// Returns a usual step of its setpoint [m] or [rad]; `None` for what is no place and no angle.
    pub(crate) fn usual_step(&self) -> Option<f64> {
        Some(if self.unit()? == "m" { PLACE_STEP } else { ANGLE_STEP })
    }

    /// Returns a value of this feature with its unit where that is known, of a place in mm.
    pub(crate) fn in_units(&self, value: f64) -> String {
        match self.unit() {
            Some("m") => format!("{} mm", to_three_digits(1e3 * value)),
            Some(unit) => format!("{} {unit}", to_three_digits(value)),
            None => to_three_digits(value).to_string(),
        }
    }

    /// Returns the node that turns its control into a twist, and its name there.
    pub(crate) fn id(&self) -> (&str, &str) {
        (&self.jacobian, &self.name)
    }

    /// Returns the port of its error; `None` if nothing compares it with a setpoint.
    pub(crate) fn error_port(&self) -> Option<String> {
        self.compared.as_ref().map(|node| format!("{node}.error.{}", self.name))
    }

    /// Returns whether a port, as a mode of its task calls it, is its error.
    pub(crate) fn is_error(&self, port: &str) -> bool {
        let error = self.error_port();
        let rest = error.as_ref().and_then(|error| error.strip_suffix(port));
        rest.is_some_and(|part| part.is_empty() || part.ends_with('.'))
    }

    /// Returns whether both are controlled by the same gains of the same `pid`.
    pub(crate) fn has_gains_of(&self, other: &Self) -> bool {
        self.pid == other.pid && self.name == other.name
    }

    /// Returns whether both pass the same filters, gates, schedules and sides of switches.
    pub(super) fn takes_the_way_of(&self, other: &Self) -> bool {
        let filters = |one: &Self| one.filters.iter().map(|filter| filter.node.clone()).collect::<Vec<_>>();
        let schedules = |one: &Self| one.schedules.iter().map(|schedule| schedule.node.clone()).collect::<Vec<_>>();
        filters(self) == filters(other)
            && schedules(self) == schedules(other)
            && (&self.gates, &self.sides) == (&other.gates, &other.sides)
    }

    /// Returns whether both are the same control.
    pub(super) fn is_same_control(&self, other: &Self) -> bool {
        self.has_gains_of(other) && self.takes_the_way_of(other)
    }

    /// Returns whether another feature moves the arm by the same measurement at the same time, or presses by another one.
    pub(super) fn is_beside(&self, nodes: &Nodes<'_>, other: &Self) -> bool {
        let is_other_side = |(switch, side): &(String, usize)| {
            self.sides.iter().any(|(own, own_side)| own == switch && own_side != side)
        };
        let closes = |gate: &String| nodes.is_set(gate) == Some(false);
        // Two gates that are not the same may open at different times.
        let own_gate = |one: &Self, two: &Self| one.gates.iter().any(|gate| !two.gates.contains(gate));
        other.moves()
            && other.measured.is_some()
            && (other.measured == self.measured || self.presses_alone() && other.presses_alone())
            && !other.sides.iter().any(is_other_side)
            && !other.gates.iter().any(closes)
            && !(own_gate(self, other) && own_gate(other, self))
    }

    /// Returns whether it moves the arm whenever it is present: every gate and switch on its way is open during a contact.
    pub(crate) fn is_open_in_contact(&self, nodes: &Nodes<'_>) -> bool {
        self.sides.is_empty() && self.gates.iter().all(|gate| nodes.is_open_in_contact(gate))
    }

    /// Returns the largest factor on its gains, or 1 if its schedules only make them smaller [1].
    pub(crate) fn largest_schedule(&self) -> f64 {
        self.schedules.iter().map(|schedule| schedule.max.max(1.0)).product()
    }

    /// Returns the delay of the filters that smooth it [s].
    pub(crate) fn smoothing(&self) -> f64 {
        smoothing(&self.filters)
    }

    /// Returns the same for the sides of its switches that smooth least [s].
    pub(crate) fn least_smoothing(&self) -> f64 {
        self.smoothing() - self.spared_s
    }

    /// Returns the delay of all filters [s].
    pub(crate) fn delay(&self) -> f64 {
        self.filters.iter().map(|filter| filter.delay_s).sum()
    }
}

/// Returns the setpoint of a feature in a node that compares it.
pub(crate) fn setpoint(nodes: &Nodes<'_>, compared: &str, feature: &str) -> Option<f64> {
    let node = nodes.node(compared)?;
    let one = nodes.number(node, &format!("setpoint.{feature}"));
    one.or_else(|| nodes.value(node, "setpoint")?.value.as_table()?.get(feature)?.read())
}

/// Follows a feature from its column back to its measurement.
pub(super) fn feature<'a>(nodes: &Nodes<'a>, jacobian: &'a OutlinedBlock, name: String, column: [f64; 6]) -> Feature {
    let before = |node: &'a OutlinedBlock, input: &str, kind: &str| {
        source(node, input).and_then(|port| nodes.writer(port)).filter(|writer| writer.kind.text == kind)
    };
    let next = |node: &&'a OutlinedBlock| before(node, "control", "gain_schedule");
    let scheduled: Vec<_> = std::iter::successors(next(&jacobian), next).collect();
    let pid = before(scheduled.last().copied().unwrap_or(jacobian), "control", "pid");
    let number = |which: &str| pid.and_then(|pid| nodes.number(pid, &format!("gains.{name}.{which}")));
    let behind = pid.map(|pid| before(pid, "error", "deadband").unwrap_or(pid));
    let error = behind.and_then(|node| before(node, "error", "feature_error"));
    let setpoint = error.and_then(|error| setpoint(nodes, &error.name, &name));
    let port = error.and_then(|error| source(error, &name));
    // A role that measures the feature itself has no node; the slowest feature beside it decides then.
    let writer = error.zip(port).map(|(error, port)| nodes.writer(port).unwrap_or(error));
    let [period_s, latency_s] = writer.map_or([nodes.period(), 0.0], |node| [node.sample_s, node.latency_s]);
    let way = port.map(|port| way(nodes, port));
    let measured = way.as_ref().map(|way| way.measured.clone());
    let spared_s = way.as_ref().map_or(0.0, |way| way.spared_s);
    let (filters, gates) = way.map(|way| (way.filters, way.gates)).unwrap_or_default();
    let (sides, turn, way_of_column) = (Vec::new(), None, Matrix6::zeros());
    let [kp, ki, kd] = ["kp", "ki", "kd"].map(|which| number(which).unwrap_or(0.0));
    let [rise, brake_above, limit, within] = ["rise", "brake_above", "limit", "within"].map(number);
    let compared = error.map(|error| error.name.clone());
    let pid = pid.map(|pid| pid.name.clone());
    let schedules = scheduled.into_iter().filter_map(|node| Schedule::of(nodes, node, &name, measured.as_deref()));
    let schedules = schedules.collect();
    let (jacobian, beside) = (jacobian.name.clone(), Vec::new());
    Feature {
        column,
        kp,
        ki,
        kd,
        rise,
        brake_above,
        limit,
        within,
        measured,
        setpoint,
        period_s,
        latency_s,
        filters,
        spared_s,
        gates,
        turn,
        way: way_of_column,
        sides,
        schedules,
        name,
        jacobian,
        pid,
        compared,
        beside,
    }
}
