//! Numbers that a file writes with a unit: their value in the unit of the parameter, and their mistakes.

use std::borrow::Cow;
use std::ops::Range;

use super::mistake::{At, Mistake};
use super::param_spec::{Contents, Written};
use super::reader::{Measured, Param, Reader};
use crate::signal::{Measure, MeasureError, Unit, UnitSize};
use crate::source::{Code, Item, Value, quoted, suggest_name};

impl Reader<'_> {
    /// Returns the value in the unit of the current field if it is a text such as `40 mm`, and any other value as it
    /// is. Returns `None` after a mistake.
    pub(super) fn in_declared_unit<'v>(&mut self, value: &'v Value) -> Option<Cow<'v, Value>> {
        let Some(text) = value.as_str() else { return Some(Cow::Borrowed(value)) };
        let known = self.unit_size();
        let usual = known.as_ref().map(|(size, _)| size);
        let measure = match Measure::parse(text) {
            Ok(measure) => measure,
            Err(MeasureError::NoNumber | MeasureError::NoUnit) => return Some(Cow::Borrowed(value)),
            Err(error) => return self.refuse(error_mistake(text, &error, usual, &value.span)),
        };
        let Some((size, unit)) = known else {
            return if self.units.is_incomplete() {
                None
            } else {
                self.refuse(self.unknown_unit(&measure, &value.span))
            };
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
        self.units.resolve(unit, self.component.as_deref())
    }

    /// The unit of a number is not known, so it cannot have another.
    fn unknown_unit(&self, measure: &Measure, span: &Range<usize>) -> Mistake {
        let (message, help) = match self.unit {
            None => {
                let message = format!("expected a number without a unit, found `{} {}`", measure.number, measure.unit);
                (message, format!("write `{}`", measure.number))
            }
            Some(unit) => {
                let message = format!("the unit of this number [{unit}] is not known here, so it cannot be converted");
                (message, "write a plain number".to_owned())
            }
        };
        Mistake::new(Code::BadValue, At::Span(span.clone()), message).help(help)
    }
}

/// The text is no number with a unit. `size` is that of the unit that is expected, if it is known.
fn error_mistake(text: &str, error: &MeasureError, size: Option<&UnitSize>, span: &Range<usize>) -> Mistake {
    let MeasureError::UnknownUnit { number, unit } = error else {
        return Mistake::new(
            Code::BadValue,
            At::Span(span.clone()),
            format!("expected a finite number, found `{text}`"),
        );
    };
    let mistake = Mistake::new(Code::BadValue, At::Span(span.clone()), format!("there is no unit `{unit}`"));
    let usual: Vec<&str> = size.map_or_else(UnitSize::all_usual_units, |size| size.usual_units().collect());
    let close = close_unit(unit, &usual);
    let others: Vec<&str> = usual.iter().copied().filter(|unit| close.as_deref() != Some(unit)).collect();
    let dimension = size.and_then(UnitSize::dimension);
    mistake.help(match (close, dimension) {
        (Some(close), Some(_)) if !others.is_empty() => {
            format!("did you mean `\"{number} {close}\"`? Other units here: {}", quoted(&others))
        }
        (Some(close), _) => format!("did you mean `\"{number} {close}\"`?"),
        (None, Some(name)) => format!("units of {name}: {}", quoted(&others)),
        (None, None) => "write a plain number".to_owned(),
    })
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
        let size = UnitSize::of(unit);
        let measure = Measure::parse(&text).map_err(|error| error_mistake(&text, &error, Some(&size), &self.span))?;
        let wrong = || mismatch(&measure, &size, &unit.to_string(), &self.span);
        self.number = measure.to(&size).ok_or_else(wrong)?;
        if !self.number.is_finite() {
            return Err(error_mistake(&text, &MeasureError::NotFinite, None, &self.span));
        }
        measured.push((self.span.clone(), written_item(self.number)));
        Ok(())
    }
}
