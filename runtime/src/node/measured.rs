//! Numbers that a file writes with a unit: their value in the unit of the parameter, and their mistakes.

use std::borrow::Cow;
use std::ops::Range;

use super::mistake::{At, Mistake};
use super::param_spec::{Contents, Written};
use super::reader::{Measured, Param, Reader};
use crate::signal::{Measure, MeasureError, Unit, UnitSize};
use crate::source::{Code, Item, Key, Value, quoted, suggest_name};

impl Reader<'_> {
    /// Returns the value in the unit of the current field if it is a text such as `40 mm`, and any other value as it
    /// is. Returns `None` after a mistake.
    pub(super) fn in_declared_unit<'v>(&mut self, value: &'v Value) -> Option<Cow<'v, Value>> {
        let Some(text) = value.as_str() else { return Some(Cow::Borrowed(value)) };
        let known = self.unit_size();
        let measure = match Measure::parse(text) {
            Ok(measure) => measure,
            Err(MeasureError::NoNumber | MeasureError::NoUnit) => return Some(Cow::Borrowed(value)),
            Err(error) => return self.refuse(error_mistake(text, &error, known.as_ref(), &value.span)),
        };
        let Some((size, unit)) = known else {
            let has_mistake = self.unit.is_some_and(|unit| self.units.has_mistake(unit));
            let mistake = || self.unknown_feature().unwrap_or_else(|| self.unknown_unit(&measure, &value.span));
            return if has_mistake { None } else { self.refuse(mistake()) };
        };
        match measure.to(&size) {
            Some(number) => Some(Cow::Owned(Value { item: written_item(number), span: value.span.clone() })),
            None => self.refuse(mismatch(&measure, &size, &unit, &value.span)),
        }
    }

    /// Adds the mistake that `value` is not the `expected` number, and returns `None`.
    pub(super) fn wrong_number<T>(&mut self, value: &Value, expected: &str) -> Option<T> {
        let Some(text) = value.as_str() else { return self.wrong_type(value, expected) };
        let message = match Measure::parse(text) {
            Ok(_) => format!("expected {expected}, found `{text}`"),
            Err(_) => format!("expected {expected}, found {}", value.described()),
        };
        let mistake = Mistake::new(Code::BadValue, At::Span(value.span.clone()), message);
        let is_number = Measure::parse(text) == Err(MeasureError::NoUnit);
        self.refuse(if is_number { mistake.help(format!("write `{}`", text.trim())) } else { mistake })
    }

    fn refuse<T>(&mut self, mistake: Mistake) -> Option<T> {
        self.mistakes.push(mistake);
        None
    }

    /// Returns the size and the text of the unit of the current field, or of the current entry of a list, if it is
    /// known.
    fn unit_size(&self) -> Option<(UnitSize, String)> {
        let unit = self.unit_of_entry()?;
        self.units.resolve(unit, self.component.as_ref().map(|key| &*key.name))
    }

    /// The entry is for a feature that the node does not have, so its unit cannot be known either.
    fn unknown_feature(&self) -> Option<Mistake> {
        let (Key { name, span }, known) = (self.component.as_ref()?, self.units.names());
        let is_unknown = !known.is_empty() && !known.contains(&&**name);
        let message = format!("no feature is called `{name}`");
        let mistake = Mistake::new(Code::UnknownKey, At::Span(span.clone()), message);
        is_unknown.then(|| mistake.suggest(name, known.into_iter(), "features"))
    }

    /// The unit of a number is not known, so it cannot have another.
    fn unknown_unit(&self, measure: &Measure, span: &Range<usize>) -> Mistake {
        let (message, help) = match self.unit {
            None => {
                let message = format!("expected a number without a unit, found `{} {}`", measure.number, measure.unit);
                (message, format!("write `{}`", measure.number))
            }
            Some(unit) => {
                let unit = self.unit_of_entry().unwrap_or(unit);
                let message = format!("the unit of this number [{unit}] is not known here, so it cannot be converted");
                (message, "write a plain number".to_owned())
            }
        };
        Mistake::new(Code::BadValue, At::Span(span.clone()), message).help(help)
    }
}

/// The text is no number with a unit. `known` is the unit that is expected, with its text.
fn error_mistake(text: &str, error: &MeasureError, known: Option<&(UnitSize, String)>, span: &Range<usize>) -> Mistake {
    let MeasureError::UnknownUnit { number, unit } = error else {
        return Mistake::new(
            Code::BadValue,
            At::Span(span.clone()),
            format!("expected a finite number, found `{text}`"),
        );
    };
    let mistake = Mistake::new(Code::BadValue, At::Span(span.clone()), format!("there is no unit `{unit}`"));
    let size = known.map(|(size, _)| size);
    let usual: Vec<&str> = size.map_or_else(UnitSize::all_usual_units, |size| size.usual_units().collect());
    let close = close_unit(unit, &usual);
    let others: Vec<&str> = usual.iter().copied().filter(|unit| close.as_deref() != Some(unit)).collect();
    let dimension = size.and_then(UnitSize::dimension);
    let instead = close.as_ref().map(|close| Box::new((text.to_owned(), format!("{number} {close}"))));
    let help = match (close, dimension) {
        (Some(close), Some(_)) if !others.is_empty() => {
            format!("did you mean `\"{number} {close}\"`? Other units here: {}", quoted(&others))
        }
        (Some(close), _) => format!("did you mean `\"{number} {close}\"`?"),
        (None, Some(name)) => format!("units of {name}: {}", quoted(&others)),
        (None, None) => match known {
            Some((_, unit)) => format!("write for example `\"{number} {unit}\"`"),
            None => "write a plain number".to_owned(),
        },
    };
    Mistake { instead, ..mistake.help(help) }
}

/// Returns a number as a file would have it: whole numbers without a decimal point.
fn written_item(number: f64) -> Item {
    const MAX_WHOLE: f64 = 9_007_199_254_740_992.0;
    let is_whole = number.fract() == 0.0 && number.abs() < MAX_WHOLE && !(number == 0.0 && number.is_sign_negative());
    if is_whole { Item::Integer(number as i64) } else { Item::Float(number) }
}

/// Returns the unit among `usual` that a misspelt one means.
fn close_unit(unit: &str, usual: &[&str]) -> Option<String> {
    let words: Vec<String> = unit
        .split_inclusive(['/', ' '])
        .map(|part| {
            let word = part.trim_end_matches(['/', ' ']);
            part.replacen(word, meant_unit(word).unwrap_or(word), 1)
        })
        .collect();
    let spelt = words.concat();
    let is_usual = |known: &&&str| **known == spelt || known.to_lowercase() == unit.to_lowercase();
    // Of two units that are equally close, the one of the same length is meant.
    let mut known = usual.to_vec();
    known.sort_by_key(|known| known.len().abs_diff(unit.len()));
    let close = usual.iter().find(is_usual).copied().or_else(|| suggest_name(unit, known.into_iter()));
    close.map(str::to_owned)
}

/// Returns the unit of a word such as `degrees`.
fn meant_unit(word: &str) -> Option<&'static str> {
    const WORDS: [(&str, &str); 12] = [
        ("°", "deg"),
        ("degree", "deg"),
        ("radian", "rad"),
        ("metre", "m"),
        ("meter", "m"),
        ("millimetre", "mm"),
        ("millimeter", "mm"),
        ("newton", "N"),
        ("second", "s"),
        ("sec", "s"),
        ("msec", "ms"),
        ("percent", "%"),
    ];
    let lower = word.to_lowercase();
    let singular = lower.strip_suffix('s').unwrap_or(&lower);
    WORDS.iter().find(|(word, _)| *word == singular).map(|(_, unit)| *unit)
}

/// The unit measures something else than the one that is expected.
fn mismatch(measure: &Measure, size: &UnitSize, unit: &str, span: &Range<usize>) -> Mistake {
    let has = measure.size().dimension().map_or_else(String::new, |name| format!(", {name}"));
    let takes = size.dimension().unwrap_or("a number");
    let message = format!("expected {takes} [{unit}], found `{} {}`{has}", measure.number, measure.unit);
    let near = ["/s", "/s2", "/tactel"].map(|more| format!("{}{more}", measure.unit));
    let near =
        near.iter().filter(|_| !has.is_empty()).find(|unit| UnitSize::parse(unit).is_some_and(|near| near.fits(size)));
    let help = match near.map_or(unit.trim_end_matches(" mod pi"), |near| near) {
        "1" => format!("write a plain number, such as `{}`", measure.number),
        unit => format!("write for example `\"{} {unit}\"`", measure.number),
    };
    Mistake::new(Code::UnitMismatch, At::Span(span.clone()), message).help(help)
}

/// A number whose unit is known only after reading: plain, or with a unit.
#[derive(Debug, Clone)]
pub(crate) struct Amount {
    /// The number as it was written, and in the unit of the parameter after [`settle`](Self::settle).
    pub(crate) number: f64,
    /// The text of the number and its unit.
    text: Option<String>,
    span: Range<usize>,
}

impl Param for Amount {
    const EXPECTS: &'static str = f64::EXPECTS;
    const CONTENTS: Contents = Contents::NUMBER;

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        let span = value.span.clone();
        let text = value.as_str().unwrap_or_default();
        let plain = match Measure::parse(text) {
            Ok(Measure { number, .. }) | Err(MeasureError::UnknownUnit { number, .. }) => number.replace('_', ""),
            Err(error @ MeasureError::NotFinite) => return reader.refuse(error_mistake(text, &error, None, &span)),
            Err(_) => return Some(Self { number: f64::read(value, reader)?, text: None, span }),
        };
        let plain = Value { item: Item::Float(plain.parse().unwrap_or(f64::NAN)), span: span.clone() };
        Some(Self { number: f64::read(&plain, reader)?, text: Some(text.to_owned()), span })
    }

    fn written(&self) -> Option<Written> {
        Some(self.number.into())
    }
}

impl Amount {
    /// Whether the number is not yet in the unit of the parameter.
    pub(crate) const fn has_unit(&self) -> bool {
        self.text.is_some()
    }

    /// Converts the number to the unit of the parameter.
    ///
    /// # Errors
    /// If the number has a unit, and it is that of something else, or `unit` is not known.
    pub(crate) fn settle(&mut self, unit: Option<Unit>, measured: &mut Measured) -> Result<(), Mistake> {
        let Some(text) = self.text.take() else { return Ok(()) };
        let Some(unit) = unit else {
            let message = "the unit of this number is not known here, so it cannot be converted";
            let mistake = Mistake::new(Code::BadValue, At::Span(self.span.clone()), message);
            return Err(mistake.help("write a plain number"));
        };
        let known = (UnitSize::of(unit), unit.to_string());
        let measure = Measure::parse(&text).map_err(|error| error_mistake(&text, &error, Some(&known), &self.span))?;
        self.number = measure.to(&known.0).ok_or_else(|| mismatch(&measure, &known.0, &known.1, &self.span))?;
        if !self.number.is_finite() {
            return Err(error_mistake(&text, &MeasureError::NotFinite, None, &self.span));
        }
        measured.push((self.span.clone(), written_item(self.number)));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use proptest::prelude::*;

    use crate::node::{KnownUnits, Map, Param, PortSpec, Reader};
    use crate::signal::{FeaturesShape, ImageShape, Kind, Shape, Unit};
    use crate::source::{SourceMap, parse_table};

    /// Parameters in units that follow from the wires.
    #[derive(Debug, Clone, Param)]
    #[param(inputs = "Inputs")]
    struct Params {
        /// In the unit of the image.
        #[param(unit = "U", above = 0.0)]
        threshold: Option<f64>,
        /// In products of it.
        #[param(unit = "N s/U")]
        product: Option<f64>,
        /// In the unit of each feature, without `/s`.
        #[param(unit = "m/_, rad/_")]
        columns: Option<Map<[f64; 2]>>,
        /// A number of samples.
        #[param(unit = "sample")]
        window: Option<u64>,
        /// Not a number.
        name: Option<String>,
    }

    #[allow(non_upper_case_globals, reason = "the derive looks for the letters under this name")]
    const Inputs: crate::node::Letters = crate::node::Letters::of(["U", "", ""], true);

    fn inputs() -> [PortSpec; 2] {
        let image = PortSpec::new("image", "", Kind::Image, &["U"]);
        [image, PortSpec::new("control", "", Kind::Features, &["_/s"])]
    }

    /// Returns the parameters, or the first message; an empty one if there is none.
    fn read(text: &str, unit: Option<Unit>, is_incomplete: bool) -> Result<Params, String> {
        let mut sources = SourceMap::default();
        let table = parse_table(sources.add_file(Path::new("x.toml"), text)).unwrap();
        let image = |unit| ("image".to_owned(), Shape::from(ImageShape { unit, ..ImageShape::default() }));
        let features = FeaturesShape::new([("x", Unit::METRE.per_second()), ("a", Unit::AXIAL.per_second())]);
        let wires = [unit.map(image).into_iter().collect(), vec![("control".to_owned(), Shape::from(features))]];
        let inputs = inputs();
        let units = KnownUnits::NONE.with_wires(&inputs, &wires, is_incomplete);
        let mut reader = Reader::new(&sources).with_units(units);
        let params = Params::read(&table, &mut reader);
        params.ok_or_else(|| reader.mistakes.first().map_or_else(String::new, |mistake| mistake.message.clone()))
    }

    #[test]
    fn letters_stand_for_the_units_of_the_wires() {
        let good = |text: &str, unit| read(text, Some(unit), false).unwrap();
        assert_eq!(good("threshold = '15 mN'", Unit::NEWTON).threshold, Some(0.015));
        assert_eq!(good("threshold = '15 raw'", Unit::RAW).threshold, Some(15.0));
        assert_eq!(good("product = '3 N ms/raw'", Unit::RAW).product, Some(0.003));
        assert_eq!(good("product = '3 ms'", Unit::NEWTON).product, Some(0.003));
        assert_eq!(good("columns.x = ['2 mm/m', '1 rad/cm']", Unit::RAW).columns.unwrap().0["x"], [0.002, 100.0]);
        assert_eq!(good("columns.a = ['2 mm/rad', 1]", Unit::RAW).columns.unwrap().0["a"], [0.002, 1.0]);
        assert_eq!(good("window = '5 sample'", Unit::RAW).window, Some(5));
        assert_eq!(good("name = '5 sample'", Unit::RAW).name.as_deref(), Some("5 sample"), "no number");
    }

    #[test]
    fn a_unit_that_is_not_known_is_a_mistake_unless_wires_have_one() {
        let unknown = "the unit of this number [U] is not known here, so it cannot be converted";
        assert_eq!(read("threshold = '15 mN'", None, false).unwrap_err(), unknown);
        assert_eq!(read("threshold = '15 mN'", None, true).unwrap_err(), "");
        assert_eq!(read("threshold = 0.015", None, false).unwrap().threshold, Some(0.015));
        let other = "expected a raw reading [raw], found `15 mN`, a force";
        assert_eq!(read("threshold = '15 mN'", Some(Unit::RAW), false).unwrap_err(), other);
        let strange = read("columns.y = ['1 m/m', 0]", Some(Unit::RAW), false).unwrap_err();
        assert_eq!(strange, "no feature is called `y`");
    }

    proptest! {
        #[test]
        fn every_text_is_a_number_or_has_a_message(text in "-?[0-9]{0,3}[.e]?[0-9]{0,3} ?\\PC{0,8}") {
            let text = toml::Value::from(text).to_string();
            for table in ["threshold = ", "product = ", "window = "].map(|key| format!("{key}{text}")) {
                let read = read(&table, Some(Unit::NEWTON), false);
                prop_assert!(read.is_ok() || read.is_err_and(|message| !message.is_empty()), "{}", table);
            }
        }
    }
}
