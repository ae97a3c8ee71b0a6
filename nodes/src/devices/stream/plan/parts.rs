//! Frames in parts.

use tactflow_runtime::node::{At, Mistake, Mistakes};
use tactflow_runtime::source::Code;

use super::order::Shape;
use super::params::{Framing, Params};
use crate::devices::stream::decoding::parts::{PartNumber, Parts};

pub(crate) fn parts(params: &Params, shape: &Shape, mistakes: &mut Mistakes) -> Option<Parts> {
    let parts = params.parts.as_ref()?;
    let before = mistakes.len();
    let mut wrong = |key: &str, message: String, help: &str| {
        mistakes.push(Mistake::param(format!("parts.{key}"), message).help(help));
    };
    let (values, total) = (parts.values, shape.values());
    if total % values != 0 || values >= total {
        let message = format!("a frame of {total} values has no whole number of parts with {values} values");
        wrong("values", message, "write the number of values in one part");
        return None;
    }
    let count = total / values;
    let first = parts.first as u64;
    let number = match (parts.index, parts.start) {
        (Some(place), None) => Some(PartNumber::Index { place, first }),
        (None, Some(place)) => Some(PartNumber::Start { place }),
        (Some(_), Some(_)) => {
            wrong("start", "`index` and `start` exclude each other".into(), "keep the one that the pad sends");
            None
        }
        (None, None) => {
            let message = "a part needs `index`, its number, or `start`, the index of its first value";
            let mistake = Mistake::new(Code::MissingKey, At::Param("parts".into()), message);
            mistakes.push(mistake.help("write `index = { offset = 4, cell = \"u8\" }`"));
            return None;
        }
    };
    let last = parts.completes.map_or(Some(count - 1), |number| number.checked_sub(parts.first));
    if last.is_none_or(|last| last >= count) {
        let message = format!("`completes` is no part: they are {} to {}", parts.first, parts.first + count - 1);
        wrong("completes", message, "leave it out if the last part completes a frame");
    }
    if let Some(lengths) = &parts.lengths {
        let help = "write the number of bytes of each part, with its mark, from the first part on";
        if lengths.len() != count {
            wrong("lengths", format!("`lengths` has {} numbers, and a frame has {count} parts", lengths.len()), help);
        } else if params.frame != Framing::Sync || parts.index.is_none() {
            wrong("lengths", "parts of different lengths need `frame = \"sync\"` and `index`".into(), help);
        } else if params.length.is_some() {
            wrong("lengths", "`length` and `lengths` exclude each other".into(), "leave out `length`");
        }
    }
    (mistakes.len() == before).then_some(())?;
    Some(Parts::new(number?, count, values, last?))
}
