//! The units that the letters in the declarations of parameters stand for: of the wires, or of another parameter.

use super::param_spec::ParamSpec;
use super::pattern::{UnitPattern, unit_pattern};
use super::ports::PortSpec;
use crate::signal::{Shape, Unit, UnitSize};
use crate::source::{Table, Value};

/// What is known of the units of a block while its parameters are read.
#[derive(Debug, Clone, Copy, Default)]
pub struct KnownUnits<'a> {
    inputs: &'a [PortSpec],
    /// For each input, the names and shapes of its wires.
    wires: &'a [Vec<(String, Shape)>],
    params: Option<&'a Table>,
    specs: &'a [ParamSpec],
    /// Whether wires are missing because of mistakes that have their own diagnostics.
    is_incomplete: bool,
}

impl<'a> KnownUnits<'a> {
    /// No letter stands for a unit.
    pub const NONE: Self = Self { inputs: &[], wires: &[], params: None, specs: &[], is_incomplete: false };

    /// The units in the parameters of a block.
    #[must_use]
    pub fn of_params(params: &'a Value, specs: &'a [ParamSpec]) -> Self {
        Self { params: params.as_table(), specs, ..Self::NONE }
    }

    /// Adds the units on the wires of a node. If wires are missing because of mistakes, the units that follow from them
    /// are no further mistakes.
    #[must_use]
    pub const fn with_wires(
        self,
        inputs: &'a [PortSpec],
        wires: &'a [Vec<(String, Shape)>],
        is_incomplete: bool,
    ) -> Self {
        Self { inputs, wires, is_incomplete, ..self }
    }

    /// Returns the names of the features on the wires, and of the wires whose name the author of the graph chooses.
    pub(super) fn names(&self) -> Vec<&'a str> {
        let inputs = self.inputs.iter().zip(self.wires);
        let names = inputs.flat_map(|(input, wires)| {
            wires.iter().flat_map(|(name, shape)| match shape {
                Shape::Features(features) => features.features.iter().map(|feature| &*feature.name).collect(),
                _ if input.need.is_many => vec![&**name],
                _ => Vec::new(),
            })
        });
        names.collect()
    }

    /// Whether a declared unit is not known because of a mistake that has its own diagnostic.
    pub(super) fn has_mistake(&self, declared: &str) -> bool {
        let Some(param) = declared.strip_prefix('$') else { return self.is_incomplete };
        let is_given = self.params.is_some_and(|table| table.get(param).is_some());
        is_given || self.specs.iter().any(|spec| spec.name == param && !spec.is_optional)
    }

    /// Returns the size of a declared unit and its text with the letters replaced, or `None` if a letter stands for no
    /// unit. `component` is the name of the entry that the parameter is for.
    pub(super) fn resolve(&self, declared: &str, component: Option<&str>) -> Option<(UnitSize, String)> {
        if let Some(param) = declared.strip_prefix('$') {
            let unit = self.param(param)?;
            return Some((UnitSize::of(unit), unit.to_string()));
        }
        let size = UnitSize::parse_with(declared, &|symbol| self.letter(symbol, component))?;
        let mut is_divisor = false;
        let symbols = declared.split_inclusive(['/', ' ']).map(|part| {
            let symbol = part.trim_end_matches(['/', ' ', '2', '3']);
            let is_divided = std::mem::replace(&mut is_divisor, part.ends_with('/'));
            let Some(unit) = self.letter(symbol, component) else { return part.to_owned() };
            // Divided by `N m` is `m/N/m`: behind a slash, each factor needs its own.
            let unit = if is_divided { unit.to_string().replace(' ', "/") } else { unit.to_string() };
            part.replacen(symbol, &unit, 1)
        });
        Some((size, symbols.collect()))
    }

    /// Returns the unit that a parameter holds, or its default.
    fn param(&self, name: &str) -> Option<Unit> {
        let given = self.params.and_then(|table| table.get(name));
        let default = || self.specs.iter().find(|spec| spec.name == name)?.default.as_deref()?.split('"').nth(1);
        given.map_or_else(default, Value::as_str)?.parse().ok()
    }

    /// Returns the unit that an input binds to a letter or to `_`.
    fn letter(&self, symbol: &str, component: Option<&str>) -> Option<Unit> {
        let is_letter = matches!(symbol.as_bytes(), [b'A'..=b'Z' | b'_']);
        let mut units = self.inputs.iter().zip(self.wires).filter(|_| is_letter).flat_map(|(input, wires)| {
            let pattern = unit_pattern(input);
            let wires = wires.iter().filter(move |(name, _)| {
                // Wires with names of their own may differ in their unit, unless a letter unifies them.
                symbol != "_" || !input.need.is_many || component == Some(name)
            });
            wires.flat_map(move |(_, shape)| units_of(shape, component)).filter_map(move |unit| match pattern? {
                UnitPattern::Any => (symbol == "_").then_some(unit),
                UnitPattern::AnyRate => (symbol == "_").then_some(without(unit, true, false)?),
                UnitPattern::Variable { name, per_tactel, per_second } => {
                    symbol.starts_with(name).then_some(without(unit, per_second, per_tactel)?)
                }
                UnitPattern::Known(_) => None,
            })
        });
        let first = units.next()?;
        units.all(|unit| unit == first).then_some(first)
    }
}

/// Returns the unit of a shape, or those of its features: of one if it has the name of the `component`.
fn units_of(shape: &Shape, component: Option<&str>) -> Vec<Unit> {
    let Shape::Features(features) = shape else { return shape.unit().into_iter().collect() };
    let named = features.features.iter().find(|feature| component == Some(&feature.name));
    match (named, component) {
        (Some(feature), _) => vec![feature.unit],
        (None, Some(_)) => Vec::new(),
        (None, None) => features.features.iter().map(|feature| feature.unit).collect(),
    }
}

/// Returns the unit without one `/s` and without `/tactel`.
fn without(unit: Unit, per_second: bool, per_tactel: bool) -> Option<Unit> {
    let has_both = (!per_second || unit.per_second > 0) && (!per_tactel || unit.per_tactel);
    has_both.then(|| Unit {
        per_second: unit.per_second - u8::from(per_second),
        per_tactel: unit.per_tactel && !per_tactel,
        ..unit
    })
}
