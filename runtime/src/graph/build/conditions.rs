//! What ends a mode, looked up: each exit has one condition, on a port that can be what it asks for.

use std::f64::consts::FRAC_PI_2;
use std::ops::Range;

use crate::graph::net::Net;
use crate::graph::plan::{Condition, PlannedExit, Test, Watched};
use crate::graph::plan::{PlannedPort, PortRef};
use crate::graph::syntax::{Exit, Is, ModeBlock, Sort};
use crate::node::Word;
use crate::signal::{Kind, Shape};
use crate::source::{Code, Diagnostic};

/// What an exit is looked up in.
pub(crate) struct Lookup<'a> {
    pub(crate) net: &'a Net<'a>,
    /// Names of the modes.
    pub(crate) modes: Vec<&'a str>,
    /// A port that was built; none if its node has mistakes.
    pub(crate) port: &'a dyn Fn(PortRef) -> Option<&'a PlannedPort>,
    /// The poses of the graph.
    pub(crate) poses: Vec<PortRef>,
    /// After which time a signal is lost, unless a mode says another: five periods [ns].
    pub(crate) lost_after: i64,
}

/// The exits of a mode that are right; the others are told.
pub(crate) fn exits(mode: &ModeBlock, lookup: &Lookup<'_>, found: &mut Vec<Diagnostic>) -> Vec<PlannedExit> {
    let mut planned = Vec::new();
    for (sort, span, exit) in &mode.exits {
        let to = target(*sort, span, exit, lookup, found);
        let condition = condition(*sort, span, exit, lookup);
        let misplaced = misplaced(*sort, span, exit);
        found.extend(misplaced);
        match condition {
            Ok(Some((condition, text))) => {
                let lasts = exit.for_ms.map_or(0, |ms| nanos(*ms));
                let priority = exit.priority.unwrap_or(0);
                if let Ok(to) = to {
                    planned.push(PlannedExit { sort: *sort, to, condition, lasts, priority, text, span: span.clone() });
                }
            }
            Ok(None) => {}
            Err(diagnostic) => found.push(*diagnostic),
        }
    }
    planned
}

fn nanos(ms: f64) -> i64 {
    (ms * 1e6).round() as i64
}

type Wrong = Box<Diagnostic>;

fn bad(span: &Range<usize>, message: impl Into<String>) -> Diagnostic {
    Diagnostic::new(Code::BadCondition, span.clone(), message)
}

/// The mode that is gone to; nothing for what ends the run.
fn target(
    sort: Sort,
    span: &Range<usize>,
    exit: &Exit,
    lookup: &Lookup<'_>,
    found: &mut Vec<Diagnostic>,
) -> Result<Option<usize>, ()> {
    let goes = matches!(sort, Sort::Go | Sort::OnLost);
    let diagnostic = match (&exit.to, goes) {
        (Some(to), true) => match lookup.modes.iter().position(|name| *name == to.text) {
            Some(mode) => return Ok(Some(mode)),
            None => Diagnostic::new(Code::UnknownMode, to.span.clone(), format!("there is no mode `{}`", to.text))
                .suggest(&to.text, lookup.modes.iter().copied(), "modes"),
        },
        (None, true) => bad(span, format!("`{}` does not say where to go", sort.key())).help("add `to = \"MODE\"`"),
        (None, false) => return Ok(None),
        (Some(to), false) => bad(&to.span, format!("`{}` ends the run, so it goes nowhere", sort.key()))
            .help("take `to` out, or write `go`"),
    };
    found.push(diagnostic);
    Err(())
}

/// What an exit says that has no meaning beside its condition.
fn misplaced(sort: Sort, span: &Range<usize>, exit: &Exit) -> Option<Diagnostic> {
    let has_bound = exit.above.is_some() || exit.below.is_some() || exit.within.is_some();
    let is_on_port = exit.when.is_some();
    let cases = [
        (exit.is.is_some() && !is_on_port, "`is` speaks of a port: add `when = \"node.port\"`"),
        (has_bound && !is_on_port, "a bound speaks of a port: add `when = \"node.port\"`"),
        (exit.hysteresis.is_some() && !has_bound, "`hysteresis` belongs to `above`, `below` or `within`"),
        (exit.for_ms.is_some() && !is_on_port, "`for_ms` belongs to `when`"),
        (
            exit.for_ms.is_some_and(|ms| *ms > 0.0) && exit.is == Some(Is::New),
            "`new` is a moment and cannot last: take `for_ms` out",
        ),
        (
            exit.of.is_some() && sort != Sort::OnLost && exit.after_travel_mm.is_none(),
            "`of` belongs to `on_lost` or `after_travel_mm`",
        ),
        (exit.priority.is_some() && sort != Sort::Go, "`priority` decides between two `go`: others have their order"),
    ];
    let (_, message) = cases.into_iter().find(|(is_wrong, _)| *is_wrong)?;
    Some(bad(span, message))
}

/// The one condition of an exit, and it in words; nothing where what it looks at has mistakes of its own.
fn condition(
    sort: Sort,
    span: &Range<usize>,
    exit: &Exit,
    lookup: &Lookup<'_>,
) -> Result<Option<(Condition, String)>, Wrong> {
    if sort == Sort::OnLost {
        return lost(span, exit, lookup);
    }
    let given = [exit.when.is_some(), exit.after_ms.is_some(), exit.after_travel_mm.is_some(), exit.on.is_some()];
    match given.iter().filter(|is| **is).count() {
        1 => {}
        0 => {
            let help = "add `when = \"node.port\"`, `after_ms`, `after_travel_mm` or `on = \"WORD\"`";
            return Err(Box::new(bad(span, format!("`{}` has no condition", sort.key())).help(help)));
        }
        _ => {
            let help = "one condition each; several stand in a list: `[{ … }, { … }]`";
            return Err(Box::new(bad(span, format!("`{}` has two conditions", sort.key())).help(help)));
        }
    }
    if let Some(when) = &exit.when {
        return port_condition(when, span, exit, lookup);
    }
    if let Some(ms) = exit.after_ms {
        return Ok(Some((Condition::Elapsed(nanos(*ms)), format!("{} ms have passed", *ms))));
    }
    if let Some(mm) = exit.after_travel_mm {
        let source = pose(span, exit, lookup)?;
        let text = format!("the sensor has moved {} mm", *mm);
        return Ok(source.map(|source| (Condition::Travel(source, *mm * 1e-3), text)));
    }
    let word = exit.on.as_ref().expect("one of them is given");
    if word.text.trim() != word.text || word.text.is_empty() {
        return Err(Box::new(bad(&word.span, "a word from outside has letters, and no blanks around them")));
    }
    if ["stop", "resume"].contains(&word.text.as_str()) {
        let help = "`stop` and `resume` halt the run and let it go on: choose another word";
        return Err(Box::new(bad(&word.span, format!("`{}` is the runtime's own word", word.text)).help(help)));
    }
    Ok(Some((Condition::Sent(word.text.clone()), format!("`{}` was sent", word.text))))
}

fn lost(span: &Range<usize>, exit: &Exit, lookup: &Lookup<'_>) -> Result<Option<(Condition, String)>, Wrong> {
    let others = exit.when.is_some() || exit.after_travel_mm.is_some() || exit.on.is_some();
    let (Some(of), false) = (&exit.of, others) else {
        let help = "write `on_lost = { of = \"node.port\", after_ms = 100, to = \"MODE\" }`";
        return Err(Box::new(bad(span, "`on_lost` names the signal that it watches, and nothing else").help(help)));
    };
    let Some((watched, name)) = watched(of, lookup)? else { return Ok(None) };
    let after = exit.after_ms.map_or(lookup.lost_after, |ms| nanos(*ms));
    let text = format!("`{name}` is lost");
    Ok(Some((Condition::Lost(watched, after), text)))
}

/// The pose whose way is meant: the one that is named, or the only one.
fn pose(span: &Range<usize>, exit: &Exit, lookup: &Lookup<'_>) -> Result<Option<PortRef>, Wrong> {
    if let Some(of) = &exit.of {
        let source = lookup.net.resolve(0, of, 0)?;
        let is_pose = source.is_none_or(|source| lookup.net.port(source).kind == Kind::Pose);
        let message = format!("`{}` is no pose, and has no way", of.text);
        return if is_pose { Ok(source) } else { Err(Box::new(bad(&of.span, message))) };
    }
    match lookup.poses.as_slice() {
        [one] => Ok(Some(*one)),
        [] => Err(Box::new(bad(span, "there is no pose in the graph whose way could be measured"))),
        several => {
            let names: Vec<String> =
                several.iter().map(|source| format!("`{}`", lookup.net.port_name(*source))).collect();
            let help = format!("add `of = \"node.port\"`; poses here: {}", names.join(", "));
            Err(Box::new(bad(span, "there are several poses: it does not say whose way is meant").help(help)))
        }
    }
}

/// A port, or a feature of one, and its name; nothing if its node has mistakes of its own.
fn watched(word: &Word, lookup: &Lookup<'_>) -> Result<Option<(Watched, String)>, Wrong> {
    let (port, feature) = match word.text.match_indices('.').nth(1) {
        Some((at, _)) => (Word { text: word.text[..at].into(), span: word.span.clone() }, Some(&word.text[at + 1..])),
        None => (word.clone(), None),
    };
    let Some(source) = lookup.net.resolve(0, &port, 0)? else { return Ok(None) };
    // As the file calls it.
    let name = port.text.clone();
    let Some(feature) = feature else { return Ok(Some((Watched { source, feature: None }, name))) };
    let Some(planned) = (lookup.port)(source) else { return Ok(None) };
    let Shape::Features(shape) = &planned.shape else {
        let message = format!("`{name}` is {}, and has no features", planned.shape.kind().with_article());
        return Err(Box::new(Diagnostic::new(Code::UnknownPort, word.span.clone(), message)));
    };
    match shape.names().position(|known| known == feature) {
        Some(at) => Ok(Some((Watched { source, feature: Some(at) }, format!("{name}.{feature}")))),
        None => {
            let message = format!("`{name}` has no feature `{feature}`");
            Err(Box::new(Diagnostic::new(Code::UnknownPort, word.span.clone(), message).suggest(
                feature,
                shape.names(),
                "features",
            )))
        }
    }
}

fn port_condition(
    when: &Word,
    span: &Range<usize>,
    exit: &Exit,
    lookup: &Lookup<'_>,
) -> Result<Option<(Condition, String)>, Wrong> {
    let Some((watched, name)) = watched(when, lookup)? else { return Ok(None) };
    let kind = lookup.net.port(watched.source).kind;
    let bounds = [exit.above.is_some() || exit.below.is_some(), exit.within.is_some(), exit.is.is_some()];
    if bounds.iter().filter(|is| **is).count() > 1 {
        let help = "`above` and `below` go together; `within` and `is` stand alone";
        return Err(Box::new(bad(span, "a condition asks one thing of its port").help(help)));
    }
    let is_number = kind == Kind::Scalar || watched.feature.is_some();
    let test = match exit.is {
        Some(Is::New) => Test::New,
        Some(Is::Absent) => Test::Absent,
        Some(Is::Present) => Test::Present,
        Some(is @ (Is::True | Is::False)) if kind == Kind::Flag => Test::Flag(is == Is::True),
        Some(Is::True | Is::False) => {
            let message = format!("`{name}` is {}, and neither true nor false", kind.with_article());
            return Err(Box::new(bad(&when.span, message)));
        }
        None if is_number => return number(when, &name, watched, exit, lookup),
        None if bounds[0] || bounds[1] => {
            let message = format!("`{name}` is {}, and has no size to compare", kind.with_article());
            return Err(Box::new(bad(&when.span, message).help("a bound takes a scalar, or one feature of a vector")));
        }
        None if kind == Kind::Flag => Test::Flag(true),
        None => {
            let message = format!("`{name}` is {}: it does not say what of it", kind.with_article());
            return Err(Box::new(bad(&when.span, message).help("add `is = \"new\"`, `\"absent\"` or `\"present\"`")));
        }
    };
    let text = match test {
        Test::New => format!("`{name}` is new"),
        Test::Absent => format!("`{name}` is absent"),
        Test::Present => format!("`{name}` is there"),
        Test::Flag(true) => format!("`{name}` is set"),
        _ => format!("`{name}` is not set"),
    };
    Ok(Some((Condition::Port(watched, test), text)))
}

/// A bound to four places, for a message.
fn short(bound: f64) -> f64 {
    (bound * 1e4).round() / 1e4
}

/// A bound on a number, which its declared range has to leave open.
fn number(
    when: &Word,
    name: &str,
    watched: Watched,
    exit: &Exit,
    lookup: &Lookup<'_>,
) -> Result<Option<(Condition, String)>, Wrong> {
    let (least, greatest) = match exit.within {
        Some(size) => (-*size, *size),
        None => (exit.above.unwrap_or(f64::NEG_INFINITY), exit.below.unwrap_or(f64::INFINITY)),
    };
    if exit.within.is_none() && exit.above.is_none() && exit.below.is_none() {
        let message = format!("`{name}` is a number: it does not say which");
        let help = "add `above`, `below` or `within`, or `is = \"new\"`, `\"absent\"` or `\"present\"`";
        return Err(Box::new(bad(&when.span, message).help(help)));
    }
    if least >= greatest && exit.within.is_none() {
        let message = format!("nothing is above {least} and below {greatest}");
        return Err(Box::new(Diagnostic::new(Code::BoundOutOfRange, when.span.clone(), message)));
    }
    let text = match (exit.within, exit.above, exit.below) {
        (Some(size), ..) => format!("within {}", *size),
        (_, Some(above), None) => format!("above {above}"),
        (_, None, Some(below)) => format!("below {below}"),
        _ => format!("between {least} and {greatest}"),
    };
    let Some(planned) = (lookup.port)(watched.source) else { return Ok(None) };
    if let Shape::Scalar(shape) = &planned.shape {
        let unit = shape.unit;
        let [low, high] = if unit.is_axial() { [-FRAC_PI_2, FRAC_PI_2] } else { shape.range };
        let (never, always) = (least >= high || greatest <= low, least < low && greatest > high);
        if (never || always) && low < high {
            let what = if never { "never" } else { "always" };
            let message = format!("`{name}` is {what} {text}: it is from {} to {} {unit}", short(low), short(high));
            return Err(Box::new(Diagnostic::new(Code::BoundOutOfRange, when.span.clone(), message)));
        }
    }
    let (hysteresis, text) = (exit.hysteresis.map_or(0.0, |by| *by), format!("`{name}` is {text}"));
    Ok(Some((Condition::Port(watched, Test::Between { least, greatest, hysteresis }), text)))
}
