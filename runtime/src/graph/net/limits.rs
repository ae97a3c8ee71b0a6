//! The limits that hold for a node: those of the task, the bench, the robots and the command line, intersected.

use std::collections::BTreeSet;

use super::Net;
use super::wire::CommandWire;
use crate::device::RoleType;
use crate::graph::plan::{PortRef, Producer};
use crate::graph::syntax::{LimitOwner, LimitSection};
use crate::node::{NodeSpec, Spanned};
use crate::signal::{Measure, UnitSize};
use crate::source::{Item, Value};

/// A node on the path of a command that passes a motion on.
pub(crate) struct PathNode<'a> {
    pub(crate) node: usize,
    pub(crate) spec: &'a NodeSpec,
    /// The source of its motion, and the text that names it.
    pub(crate) source: PortRef,
    pub(crate) word: &'a Spanned<String>,
}

impl<'a> Net<'a> {
    /// Follows the motion of a command backwards through the nodes that pass it on, the last one first. Returns `None`
    /// if a wire is missing.
    pub(crate) fn motion_path<'n>(&'n self, wire: &'n CommandWire) -> Option<Vec<PathNode<'n>>> {
        let (mut at, mut path, mut passed) = (wire.source, Vec::new(), BTreeSet::new());
        while let Producer::Node(node) = at.producer {
            let spec = self.spec(node)?;
            let Some(through) = spec.limits.through else { break };
            let input = spec.inputs.iter().position(|input| input.name == through)?;
            let wire = self.wires[node].iter().find(|wire| wire.input == input)?;
            let (source, word) = (wire.source, wire.origin.inner.as_ref().unwrap_or(&wire.origin.word));
            if !passed.insert(node) {
                return None;
            }
            path.push(PathNode { node, spec, source, word });
            at = source;
        }
        Some(path)
    }

    /// Returns for each node the arms whose motion passes through it, or those of its task if it is a part.
    pub(super) fn find_arms(&self) -> Vec<Vec<usize>> {
        let mut arms = vec![Vec::new(); self.nodes.len()];
        for wire in self.commands.iter().filter(|wire| !wire.is_report) {
            for stop in self.motion_path(wire).into_iter().flatten() {
                arms[stop.node].push(wire.role);
            }
        }
        for (node, own) in arms.iter_mut().enumerate().filter(|(_, own)| own.is_empty()) {
            // Elsewhere in a part that is a task, the limits of its own arms hold.
            let task = self.flat.scopes[self.flat.nodes[node].scope].task;
            let roles = self.flat.tasks[task].roles.iter().copied();
            own.extend(roles.filter(|role| task > 0 && self.is_arm(*role)));
        }
        arms
    }

    /// Returns the arms whose motion passes through a node.
    pub(crate) fn arms_of(&self, node: usize) -> &[usize] {
        &self.arms[node]
    }

    /// Returns whether the commands of an arm must pass one of its limits. A limit that sensors ask for holds only if the
    /// arm carries such a sensor, or if nothing states which arm does.
    pub(crate) fn needs_limit(&self, arm: usize, limit: &str) -> bool {
        let asks = |role: &RoleType| role.arm_limits.iter().any(|own| own == limit);
        let is_on = |role: &usize| match self.carrier(*role) {
            Some(carrier) => carrier == arm,
            None => self.flat.carriers.get(self.name(Producer::Role(*role))).is_none(),
        };
        let mut sensors = (0..self.roles.len()).filter(|role| self.roles[*role].is_some_and(asks));
        !self.catalogue.roles().iter().any(asks) || sensors.any(|role| is_on(&role))
    }

    /// Returns the sections whose limits hold for one of some arms: for any arm of the graph if there is none.
    pub(crate) fn limit_sections(&self, arms: &[usize]) -> impl Iterator<Item = &'a LimitSection> {
        let all = || (0..self.roles.len()).filter(|role| self.is_arm(*role)).collect();
        let arms: Vec<usize> = if arms.is_empty() { all() } else { arms.to_vec() };
        let holds = move |section: &&LimitSection| arms.is_empty() || arms.iter().any(|arm| self.holds(section, *arm));
        self.flat.limits.iter().filter(holds)
    }

    /// Returns whether the limits of a section hold for an arm.
    fn holds(&self, section: &LimitSection, arm: usize) -> bool {
        let name = self.name(Producer::Role(arm));
        let binding = |role: &str| self.flat.bench.as_ref()?.bind.get(role);
        let word = |role: &str| binding(role).map(|binding| &binding.word.value);
        match (&section.owner, &section.role) {
            (LimitOwner::Robot(robot), _) => binding(name).is_some_and(|binding| binding.device() == robot),
            // A task may call an arm of the bench by another name.
            (LimitOwner::Bench, Some(role)) if self.flat.roles.position(&role.name).is_none() => {
                word(name).is_some_and(|own| word(&role.name) == Some(own))
            }
            (LimitOwner::Task, _) if section.task > 0 && !self.flat.tasks[section.task].roles.contains(&arm) => false,
            (_, role) => role.as_ref().is_none_or(|role| role.name == name),
        }
    }

    /// Returns the tightest value of a limit that holds for one of some arms, or `None` if nobody states it.
    pub(crate) fn limit(&self, arms: &[usize], name: &str) -> Option<Value> {
        let values = self.limit_sections(arms).filter_map(|section| section.table.get(name));
        values.cloned().reduce(|one, other| tighter(name, one, other))
    }

    /// Returns the tightest limit on the speed of an arm, or `None` if nobody states one [m/s].
    pub(crate) fn speed_limit(&self, arm: usize) -> Option<f64> {
        let arms = [arm];
        let entries = self.limit_sections(&arms).flat_map(|section| &section.table.entries);
        let speeds = entries.filter(|(key, _)| unit_of_limit(&key.name) == Some("m/s"));
        speeds.filter_map(|(key, value)| numbers(&key.name, value)).flatten().reduce(f64::min)
    }

    /// Returns whether the sections contradict each other about a limit, so that it has no value.
    pub(crate) fn contradicts(&self, arms: &[usize], name: &str) -> bool {
        let mut values = self.limit_sections(arms).filter_map(|section| section.table.get(name));
        let first = values.next().map(form);
        values.any(|value| Some(form(value)) != first) || self.excludes_all(arms, name)
    }

    /// Returns whether the bounds of which a limit is one exclude each other, although no section alone is wrong.
    pub(crate) fn excludes_all(&self, arms: &[usize], name: &str) -> bool {
        let Some(twin) = twin(name) else { return false };
        let is_min = is_lower_bound(name);
        let (Some(own), Some(other)) = (self.limit(arms, name), self.limit(arms, &twin)) else { return false };
        let (min, max) = if is_min { (own, other) } else { (other, own) };
        let is_empty = |min: &Value, max: &Value| {
            let numbers = |value: &Value| numbers(name, value);
            numbers(min).zip(numbers(max)).is_some_and(|(min, max)| min.iter().zip(&max).any(|(min, max)| min > max))
        };
        let pairs = self.limit_sections(arms).filter_map(|section| {
            let [low, high] = if is_min { [name, &twin] } else { [&twin, name] };
            Some((section.table.get(low)?, section.table.get(high)?))
        });
        is_empty(&min, &max) && !pairs.into_iter().any(|(min, max)| is_empty(min, max))
    }
}

/// The form of the value of a limit. All sections state a limit in the same form.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Form {
    /// A single value.
    One,
    /// A list of so many values, such as a corner of a box.
    Entries(usize),
    /// Any number of lists, such as planes. Each of them is a limit of its own.
    Rows,
}

impl Form {
    /// Returns the form in words.
    pub(crate) fn in_words(self) -> String {
        match self {
            Self::One => "one value".to_owned(),
            Self::Entries(count) => format!("{count} values"),
            Self::Rows => "a list of lists".to_owned(),
        }
    }
}

/// Returns the form of the value of a limit.
pub(crate) fn form(value: &Value) -> Form {
    let is_list = |item: &Value| matches!(item.item, Item::Array(_));
    match &value.item {
        Item::Array(items) if items.is_empty() || items.iter().any(is_list) => Form::Rows,
        Item::Array(items) => Form::Entries(items.len()),
        _ => Form::One,
    }
}

/// Returns whether a value is looser than a bound of the limit `name`: in any of its entries, or because it lacks a row.
pub(crate) fn is_looser(name: &str, value: &Value, bound: &Value) -> bool {
    if let (Item::Array(rows), Item::Array(bounds)) = (&value.item, &bound.item)
        && [form(value), form(bound)] == [Form::Rows; 2]
    {
        return bounds.iter().any(|bound| !has_row(name, rows, bound));
    }
    let (Some(values), Some(bounds)) = (numbers(name, value), numbers(name, bound)) else { return false };
    let is_looser = |(value, bound): (&f64, &f64)| if is_lower_bound(name) { value < bound } else { value > bound };
    values.iter().zip(&bounds).any(is_looser)
}

/// Returns whether a list of rows contains a row.
fn has_row(name: &str, rows: &[Value], row: &Value) -> bool {
    let is_same = |own: &Value| own == row || numbers(name, own).is_some_and(|own| numbers(name, row) == Some(own));
    rows.iter().any(is_same)
}

/// Returns the rows of both lists, each once: of rows, all hold together.
fn all_rows(name: &str, mut ones: Vec<Value>, others: Vec<Value>) -> Item {
    for row in others {
        if !has_row(name, &ones, &row) {
            ones.push(row);
        }
    }
    Item::Array(ones)
}

/// Returns the tighter one of two values of a limit, entry by entry, or the rows of both. A value that is no number is
/// returned, so that it is reported.
fn tighter(name: &str, one: Value, other: Value) -> Value {
    let is_of_rows = [form(&one), form(&other)] == [Form::Rows; 2];
    let (one, other) = match (one, other) {
        (Value { item: Item::Array(ones), span }, Value { item: Item::Array(others), .. }) if is_of_rows => {
            return Value { item: all_rows(name, ones, others), span };
        }
        pair => pair,
    };
    if numbers(name, &one).is_none() {
        return one;
    }
    if numbers(name, &other).is_none() || is_looser(name, &one, &other) && !is_looser(name, &other, &one) {
        return other;
    }
    match (one.item, other.item) {
        (Item::Array(ones), Item::Array(others)) if ones.len() == others.len() => {
            let items = ones.into_iter().zip(others).map(|(one, other)| tighter(name, one, other));
            Value { item: Item::Array(items.collect()), span: one.span }
        }
        (item, _) => Value { item, span: one.span },
    }
}

/// Returns the finite numbers of a limit in the unit of its name, or `None` if it has others.
pub(super) fn numbers(name: &str, value: &Value) -> Option<Vec<f64>> {
    match &value.item {
        Item::Integer(number) => Some(vec![*number as f64]),
        Item::Float(number) => number.is_finite().then(|| vec![*number]),
        Item::String(text) => {
            let unit = unit_of_limit(name).and_then(UnitSize::parse)?;
            Measure::parse(text).ok()?.to(&unit).filter(|number| number.is_finite()).map(|number| vec![number])
        }
        Item::Array(items) => {
            items.iter().map(|item| numbers(name, item)).collect::<Option<Vec<_>>>().map(|n| n.concat())
        }
        _ => None,
    }
}

/// Returns whether a limit is a lower bound, so that the greater of two values is the tighter one.
pub(crate) fn is_lower_bound(name: &str) -> bool {
    name.split('_').any(|word| word == "min")
}

/// Returns the name of the upper bound that belongs to a lower one, and the other way round.
pub(crate) fn twin(name: &str) -> Option<String> {
    let swap = |word| match word {
        "min" => "max",
        "max" => "min",
        other => other,
    };
    let swapped: Vec<&str> = name.split('_').map(swap).collect();
    Some(swapped.join("_")).filter(|twin| twin != name)
}

/// Returns the unit that the name of a limit ends with: m/s2 for `linear_m_per_s2`. Of other units, such as that of
/// `gain_per_s`, it returns `None`.
pub(crate) fn unit_of_limit(name: &str) -> Option<&'static str> {
    const UNITS: [(&str, &str); 11] = [
        ("m_per_s2", "m/s2"),
        ("rad_per_s2", "rad/s2"),
        ("m_per_s", "m/s"),
        ("rad_per_s", "rad/s"),
        ("raw", "raw"),
        ("rad", "rad"),
        ("mm", "mm"),
        ("n_m", "N m"),
        ("m", "m"),
        ("n", "N"),
        ("s", "s"),
    ];
    let units = UNITS.iter().filter_map(|(end, unit)| Some((name.strip_suffix(end)?.strip_suffix('_')?, unit)));
    let mut whole = units.filter(|(rest, _)| rest.rsplit('_').next() != Some("per"));
    whole.next().map(|(_, unit)| *unit)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> Value {
        let table: toml::Table = format!("x = {text}").parse().expect("TOML");
        Value::from_toml(&table["x"], &(0..0))
    }

    #[test]
    fn the_name_of_a_limit_ends_with_its_unit() {
        let cases = [
            ("linear_m_per_s", Some("m/s")),
            ("joint_rad_per_s2", Some("rad/s2")),
            ("force_n", Some("N")),
            ("blind_s", Some("s")),
            ("wrench_n_m", Some("N m")),
            ("blind_mm", Some("mm")),
            ("workspace_min_m", Some("m")),
            ("gain_per_s", None),
            ("turn_rad_per_m", None),
            ("rate_n_per_s", None),
            ("window", None),
            ("m", None),
        ];
        for (name, unit) in cases {
            assert_eq!(unit_of_limit(name), unit, "{name}");
        }
    }

    #[test]
    fn of_two_values_the_tighter_one_holds_entry_by_entry() {
        let cases = [
            ("force_n", "15", "10.0", vec![10.0]),
            ("force_n", "'8000 mN'", "10", vec![8.0]),
            ("blind_mm", "100", "'5 cm'", vec![50.0]),
            ("workspace_min_m", "[-0.8, -0.4, 0.1]", "[-0.5, -0.6, '200 mm']", vec![-0.5, -0.4, 0.2]),
            ("workspace_max_m", "[-0.3, 0.4, 0.7]", "[-0.5, 0.6, 0.7]", vec![-0.5, 0.4, 0.7]),
        ];
        for (name, one, other, tightest) in cases {
            for (one, other) in [(one, other), (other, one)] {
                let held = tighter(name, value(one), value(other));
                assert_eq!(numbers(name, &held), Some(tightest.clone()), "{name}: {one} and {other}");
            }
        }
    }

    #[test]
    fn of_two_lists_of_rows_every_row_holds_once() {
        let cases = [
            ("[]", "[]", vec![]),
            ("[]", "[[0, 0, 1, 0.1]]", vec![[0.0, 0.0, 1.0, 0.1]]),
            ("[[0, 0, 1, 0.1]]", "[[0.0, 0.0, 1.0, 0.1]]", vec![[0.0, 0.0, 1.0, 0.1]]),
            ("[[0, 0, 1, 0.1]]", "[[0, 0, 1, 0.2]]", vec![[0.0, 0.0, 1.0, 0.1], [0.0, 0.0, 1.0, 0.2]]),
        ];
        for (one, other, mut all) in cases {
            for (one, other) in [(one, other), (other, one)] {
                let held = tighter("keep_out", value(one), value(other));
                let Item::Array(rows) = &held.item else { panic!("{held:?}") };
                assert_eq!(form(&held), Form::Rows);
                let mut held: Vec<_> = rows.iter().map(|row| numbers("keep_out", row).expect("numbers")).collect();
                held.sort_by(|one, other| one.partial_cmp(other).expect("finite"));
                all.sort_by(|one, other| one.partial_cmp(other).expect("finite"));
                assert_eq!(held, all, "{one} and {other}");
            }
        }
        // A row that is wrong stays, so that it is reported.
        let held = tighter("keep_out", value("[[0, 0, 1, 0.1]]"), value("[[0, 0, 1, 'far']]"));
        assert!(matches!(&held.item, Item::Array(rows) if rows.len() == 2), "{held:?}");
    }

    #[test]
    fn a_list_of_rows_is_looser_if_it_lacks_one() {
        let bound = value("[[0, 0, 1, 0.1], [1, 0, 0, '2 mm']]");
        assert!(!is_looser("keep_out", &bound.clone(), &bound));
        assert!(!is_looser("keep_out", &value("[[0, 0, 1, 0.2], [0.0, 0.0, 1.0, 0.1]]"), &value("[[0, 0, 1, 0.1]]")));
        assert!(is_looser("keep_out", &value("[[0, 0, 1, 0.1]]"), &bound));
        assert!(is_looser("keep_out", &value("[]"), &bound));
        assert!(!is_looser("keep_out", &value("[]"), &value("[]")));
    }

    #[test]
    fn a_value_that_is_no_number_is_never_lost() {
        for wrong in ["'15'", "nan", "true", "'3 m'", "{ a = 1 }"] {
            for (one, other) in [(wrong, "15"), ("15", wrong)] {
                let held = tighter("force_n", value(one), value(other));
                assert_eq!(numbers("force_n", &held), None, "{one} and {other}");
            }
        }
    }

    #[test]
    fn a_value_is_looser_if_one_entry_is() {
        assert!(is_looser("force_n", &value("15.1"), &value("15")));
        assert!(!is_looser("force_n", &value("15"), &value("15")));
        assert!(is_looser("workspace_min_m", &value("[0, -0.5, 0]"), &value("[0, -0.4, 0]")));
        assert!(!is_looser("workspace_min_m", &value("[0, -0.3, 0]"), &value("[0, -0.4, 0]")));
        assert_eq!(twin("workspace_min_m").as_deref(), Some("workspace_max_m"));
        assert_eq!(twin("force_n"), None);
    }
}
