//! A parameter that is one number for all joints, or a list with one for each.

use tactflow_runtime::node::{Bounds, Contents, Param, Reader, Written};
use tactflow_runtime::source::{Item, Value};

/// One number for all joints, or one for each from the base to the tip.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum PerJoint {
    All(f64),
    Each(Vec<f64>),
}

impl Param for PerJoint {
    const EXPECTS: &'static str = "a number, or a list with a number for each joint";
    const CONTENTS: Contents = Contents::NUMBER;

    fn read(value: &Value, reader: &mut Reader<'_>) -> Option<Self> {
        match &value.item {
            Item::Array(_) => Vec::<f64>::read(value, reader).map(Self::Each),
            _ => f64::read(value, reader).map(Self::All),
        }
    }

    fn takes(bounds: Option<&Bounds>) -> String {
        format!("{}, or a list with one for each joint", f64::takes(bounds))
    }

    fn written(&self) -> Option<Written> {
        match self {
            Self::All(number) => number.written(),
            Self::Each(numbers) => numbers.written(),
        }
    }
}

impl PerJoint {
    /// Returns the value of each joint.
    ///
    /// # Errors
    /// A message, if the list has another length.
    pub(crate) fn joints(&self, count: usize) -> Result<Vec<f64>, String> {
        match self {
            Self::All(number) => Ok(vec![*number; count]),
            Self::Each(numbers) if numbers.len() == count => Ok(numbers.clone()),
            Self::Each(numbers) => {
                Err(format!("the list has {} entries, but the arm has {count} joints", numbers.len()))
            }
        }
    }
}
