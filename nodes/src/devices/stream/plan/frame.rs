//! The framing: mark, length and checksum, and the place of the values between them.

use tactflow_runtime::node::{At, Mistake, Mistakes};
use tactflow_runtime::source::Code;

use super::bounds::{MAX_LENGTH, MAX_WORD};
use super::order::{Shape, plausible};
use super::params::{Framing, Params};
use super::text::{bytes_of, is_bare_hex};
use super::useless;
use crate::devices::link::Address;
use crate::devices::stream::decoding::decoder::{Decoder, Layout, Place};
use crate::devices::stream::decoding::parts::Parts;
use crate::devices::stream::framing::Framer;
use crate::devices::stream::framing::check::{Check, Sum, names};
use crate::devices::stream::framing::lines::Lines;
use crate::devices::stream::framing::marked::Marked;
use crate::devices::stream::framing::messages::Messages;
use crate::devices::stream::framing::packets::{Coding, Packets};
use crate::devices::stream::framing::replies::Replies;
use crate::devices::stream::framing::rule::{Length, Rule};

/// What finds frames and reads them.
pub(crate) struct Frame {
    pub(crate) framer: Framer,
    pub(crate) decoder: Decoder,
}

pub(crate) fn frame(
    params: &Params,
    shape: &Shape,
    parts: Option<&Parts>,
    address: Option<&Address>,
    mistakes: &mut Mistakes,
) -> Option<Frame> {
    let before = mistakes.len();
    check_keys(params, address, mistakes);
    let mark = mark(params, mistakes);
    let sum = sum(params, mistakes);
    let bits = bits(params, mistakes);
    let ranges = plausible(params, mistakes);
    let count = parts.map_or(shape.values(), |parts| parts.values);
    let (mark, sum) = (mark?, sum?);
    let stride = params.stride.unwrap_or(params.cell.size());
    if stride < params.cell.size() {
        let message = format!("values {} apart overlap: a value has {}", stride, amount(params, params.cell.size()));
        mistakes.push(Mistake::param("stride", message).help("leave it out for values without a gap"));
    }
    let is_header =
        matches!(params.frame, Framing::Sync | Framing::Reply | Framing::Datagram | Framing::Cobs | Framing::Slip);
    let header = if is_header { mark.len() + params.mark_at.unwrap_or(0) } else { 0 };
    let offset = params.offset.unwrap_or(if params.cell.is_text() { 0 } else { header });
    let end =
        (count - 1).checked_mul(stride).and_then(|step| step.checked_add(offset)?.checked_add(params.cell.size()));
    let end = end.filter(|end| *end <= MAX_LENGTH).or_else(|| {
        let message = format!("a frame is longer than {}", amount(params, MAX_LENGTH));
        mistakes.push(Mistake::param(if params.offset.is_some() { "offset" } else { "shape" }, message));
        None
    })?;
    let trailer = if params.frame == Framing::Trailer { mark.len() } else { 0 };
    let after = sum.as_ref().map_or(0, |(sum, _)| sum.size()) + trailer;
    let length = length(params, (end, after), mistakes)?;
    check_places(params, &length, after, mistakes);
    let check = sum.map(|(sum, order)| Check { sum, order, from: params.check_from, after: trailer });
    check_cover(params, &length, check.as_ref(), mistakes);
    let shortest = shortest(&length);
    let mark_at = params.mark_at.unwrap_or(shortest.saturating_sub(if trailer > 0 { trailer } else { shortest }));
    if mark_at + mark.len() > shortest && !params.cell.is_text() {
        mistakes.push(Mistake::param("mark_at", format!("the mark ends behind the frame, which has {shortest} bytes")));
    }
    (mistakes.len() == before).then_some(())?;
    let words = if params.cell.is_text() { shortest } else { 0 };
    let layout = Layout { cell: params.cell, bits, offset, stride, count, words, axes: shape.axes, plausible: ranges };
    let rule = Rule { mark, mark_at, length, check };
    Some(Frame { framer: framer(params, rule, words), decoder: Decoder::new(layout) })
}

fn framer(params: &Params, rule: Rule, words: usize) -> Framer {
    match params.frame {
        Framing::Sync | Framing::Trailer => Framer::Marked(Marked::new(rule)),
        Framing::Lines => Framer::Lines(Lines::new(params.mark.is_some().then_some(rule.mark), words * MAX_WORD)),
        Framing::Cobs => Framer::Packets(Packets::new(Coding::Cobs, rule)),
        Framing::Slip => Framer::Packets(Packets::new(Coding::Slip, rule)),
        Framing::Datagram => Framer::Messages(Messages::new((!params.cell.is_text()).then_some(rule))),
        Framing::Reply => Framer::Replies(Replies::new(rule)),
    }
}

/// Refuses keys that do not apply to the framing.
fn check_keys(params: &Params, address: Option<&Address>, mistakes: &mut Mistakes) {
    let is_text = params.cell.is_text();
    let takes_text = matches!(params.frame, Framing::Lines | Framing::Datagram);
    if is_text && !takes_text {
        let message = "numbers in text need `frame = \"lines\"` or `frame = \"datagram\"`";
        mistakes
            .push(Mistake::param("cell", message).help("or write the type of the bytes, such as `cell = \"u16le\"`"));
    }
    if params.frame == Framing::Lines && !is_text {
        let message = "lines hold numbers in text: `cell` is `dec` or `hex`";
        mistakes.push(Mistake::param("cell", message).help("write `cell = \"dec\"`, or another `frame`"));
    }
    if params.frame == Framing::Datagram && address.is_some_and(|address| !address.has_messages()) {
        let message = format!("`{}` sends bytes without borders, and no datagrams", params.link);
        let help = "use `sync` or `trailer` with a `mark`, `lines`, `cobs` or `slip`";
        mistakes.push(Mistake::param("frame", message).help(help));
    }
    let no_mark = matches!(params.frame, Framing::Cobs | Framing::Slip | Framing::Trailer | Framing::Lines);
    if no_mark && params.mark_at.is_some() {
        mistakes.push(useless("mark_at", "with this `frame`", "leave it out"));
    }
    if is_text {
        let why = "for numbers in text";
        let set = [("check", params.check != "none"), ("mask", params.mask.is_some()), ("shift", params.shift > 0)];
        mistakes
            .extend(set.into_iter().filter(|(_, is_set)| *is_set).map(|(key, _)| useless(key, why, "leave it out")));
        if params.frame == Framing::Datagram && params.mark.is_some() {
            mistakes.push(useless("mark", why, "leave it out: each datagram is a frame"));
        }
    } else if (params.mask.is_some() || params.shift > 0) && !params.cell.has_bits() {
        let key = if params.mask.is_some() { "mask" } else { "shift" };
        mistakes.push(useless(key, "for a float", "leave it out, or write the type of a whole number as `cell`"));
    }
    if params.check == "none" {
        let set = [("check_from", params.check_from > 0), ("check_order", params.check_order.is_some())];
        let set = set.into_iter().filter(|(_, is_set)| *is_set);
        mistakes.extend(set.map(|(key, _)| useless(key, "without a `check`", "leave it out, or name the `check`")));
    }
}

/// Returns the bytes of the mark; none if the framing needs none.
fn mark(params: &Params, mistakes: &mut Mistakes) -> Option<Vec<u8>> {
    let needs = matches!(params.frame, Framing::Sync | Framing::Trailer);
    let Some(text) = &params.mark else {
        if !needs {
            return Some(Vec::new());
        }
        let what = if params.frame == Framing::Sync { "begins" } else { "ends" };
        let message = format!("`mark` is missing: the bytes with which each frame {what}");
        let mistake = Mistake::new(Code::MissingKey, At::Param("frame".into()), message);
        mistakes.push(mistake.help("write for example `mark = \"hex:AA55\"`"));
        return None;
    };
    if params.frame != Framing::Lines && is_bare_hex(text) {
        let message = format!("`{text}` is a text of {} bytes", text.len());
        mistakes.push(Mistake::param("mark", message).instead(text, &format!("hex:{text}")));
        return None;
    }
    match bytes_of(text) {
        Ok(bytes) if bytes.is_empty() && params.frame != Framing::Lines => {
            mistakes.push(Mistake::param("mark", "`mark` is empty").help("write for example `mark = \"hex:AA55\"`"));
            None
        }
        Ok(bytes) => Some(bytes),
        Err((message, help)) => {
            mistakes.push(Mistake::param("mark", message).help(help));
            None
        }
    }
}

type NamedSum = (Sum, crate::devices::stream::framing::check::ByteOrder);

fn sum(params: &Params, mistakes: &mut Mistakes) -> Option<Option<NamedSum>> {
    let Some(found) = Sum::of(&params.check) else {
        let known = names();
        let mistake = Mistake::param("check", format!("no checksum is called `{}`", params.check));
        mistakes.push(mistake.suggest(&params.check.to_lowercase(), known.iter().map(String::as_str), "checksums"));
        return None;
    };
    Some(found.map(|(sum, order)| (sum, params.check_order.unwrap_or(order))))
}

fn bits(params: &Params, mistakes: &mut Mistakes) -> Option<(u32, u32)> {
    let bits = 8 * params.cell.size() as u32;
    let widest = u64::MAX >> (64 - bits);
    if let Some(mask) = params.mask.filter(|mask| *mask == 0 || *mask > widest) {
        let message = format!("the mask {mask} is not from 1 to {widest}, the bits of the cell");
        mistakes.push(Mistake::param("mask", message));
        return None;
    }
    let mask = params.mask.unwrap_or(widest) as u32;
    (params.mask.is_some() || params.shift > 0).then_some((mask, params.shift as u32))
}

/// Returns the length of a frame from its last value, with a checksum and a trailer behind it.
fn length(params: &Params, (end, after): (usize, usize), mistakes: &mut Mistakes) -> Option<Length> {
    let parts = params.parts.as_ref().and_then(|parts| Some((parts.lengths.as_ref()?, parts.index?, parts.first)));
    if let Some((lengths, place, first)) = parts {
        let before = mistakes.len();
        for length in lengths.iter().filter(|length| **length < end + after || **length > MAX_LENGTH) {
            let message =
                format!("a part of {length} bytes is too short or too long: its last value ends at byte {end}");
            let help = format!("write from {} to {MAX_LENGTH}", end + after);
            mistakes.push(Mistake::param("parts.lengths", message).help(help));
        }
        let lengths = lengths.clone();
        return (mistakes.len() == before).then_some(Length::ByPart { place, first: first as u64, lengths });
    }
    let length = params.length.unwrap_or(end + after);
    if length < end + after {
        let behind = if after == 0 { String::new() } else { format!(", and {after} more follow it") };
        let message = format!("the last value ends after {}{behind}, but the length is {length}", amount(params, end));
        let help = format!("write `length = {}`, or leave it out", end + after);
        mistakes.push(Mistake::param("length", message).help(help));
        return None;
    }
    if length > MAX_LENGTH {
        mistakes.push(Mistake::param("length", format!("a frame has at most {}", amount(params, MAX_LENGTH))));
        return None;
    }
    Some(Length::One(length))
}

fn shortest(length: &Length) -> usize {
    match length {
        Length::One(length) => *length,
        Length::ByPart { lengths, .. } => lengths.iter().copied().min().unwrap_or(0),
    }
}

/// Checks that stamp, counter and the number of the part are in the frame.
fn check_places(params: &Params, length: &Length, after: usize, mistakes: &mut Mistakes) {
    let places = [
        ("clock.stamp", params.clock.stamp.map(|stamp| Place { offset: stamp.offset, cell: stamp.cell })),
        ("clock.counter", params.clock.counter),
        ("parts.index", params.parts.as_ref().and_then(|parts| parts.index)),
        ("parts.start", params.parts.as_ref().and_then(|parts| parts.start)),
    ];
    let end = shortest(length) - after;
    for (key, place) in places.into_iter().filter_map(|(key, place)| Some((key, place?))) {
        if place.cell.is_text() != params.cell.is_text() {
            let help = "write `dec` or `hex` for a number in text, and a type of bytes for a number in bytes";
            let message =
                format!("the values of the frame are {}", if params.cell.is_text() { "text" } else { "bytes" });
            mistakes.push(Mistake::param(format!("{key}.cell"), message).help(help));
        } else if place.offset.checked_add(place.cell.size()).is_none_or(|behind| behind > end) {
            let message = format!("it ends behind the frame, which has {}", amount(params, end));
            mistakes.push(Mistake::param(format!("{key}.offset"), message).help("offsets count from 0, with the mark"));
        }
    }
}

/// Checks that the checksum covers something.
fn check_cover(params: &Params, length: &Length, check: Option<&Check>, mistakes: &mut Mistakes) {
    let Some(check) = check else { return };
    let covered = shortest(length).saturating_sub(check.after + check.sum.size());
    if params.check_from >= covered {
        let message = format!("the checksum covers nothing: it stands at byte {covered}");
        mistakes.push(Mistake::param("check_from", message).help("write the first byte that it covers, from 0"));
    }
}

fn amount(params: &Params, count: usize) -> String {
    format!("{count} {}", if params.cell.is_text() { "values" } else { "bytes" })
}
