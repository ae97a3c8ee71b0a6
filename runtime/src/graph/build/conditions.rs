//! Resolves the exits of modes: each has one condition, and the port of that condition must support it.

use std::f64::consts::FRAC_PI_2;
use std::ops::Range;

use crate::graph::net::Net;
use crate::graph::plan::{Condition, PlannedExit, Test, WatchedPort};
use crate::graph::plan::{PlannedPort, PortRef};
use crate::graph::syntax::{Exit, ExitKind, ModeBlock, PortState};
use crate::node::Spanned;
use crate::signal::{Kind, Shape};
use crate::source::{Code, Diagnostic, Diagnostics};

/// What the exits of a mode refer to.
pub(crate) struct ExitContext<'a> {
    pub(crate) net: &'a Net<'a>,
    /// The names of the modes.
    pub(crate) modes: Vec<&'a str>,
    /// Returns a built port, or `None` if its node has mistakes.
    pub(crate) port: &'a dyn Fn(PortRef) -> Option<&'a PlannedPort>,
    /// The poses of the graph.
    pub(crate) poses: Vec<PortRef>,
    /// Default time after which a signal is lost [ns].
    pub(crate) lost_after: i64,
}

/// Resolves the exits of a mode; exits with a mistake are left out.
pub(crate) fn resolve_exits(
    mode: &ModeBlock,
    context: &ExitContext<'_>,
    diagnostics: &mut Diagnostics,
) -> Vec<PlannedExit> {
    let mut planned = Vec::new();
    for (kind, span, exit) in &mode.exits {
        let to = target(*kind, span, exit, context, diagnostics);
        let condition = condition(*kind, span, exit, context);
        diagnostics.extend(misplaced_key(*kind, span, exit));
        match condition {
            Ok(Some((condition, text))) => {
                let lasts = exit.for_ms.map_or(0, nanos);
                let priority = exit.priority.unwrap_or(0);
                if let Ok(to) = to {
                    planned.push(PlannedExit { kind: *kind, to, condition, lasts, priority, text, span: span.clone() });
                }
            }
            Ok(None) => {}
            Err(diagnostic) => diagnostics.push(*diagnostic),
        }
    }
    planned
}

fn nanos(ms: f64) -> i64 {
    (ms * 1e6).round() as i64
}

fn bad_condition(span: &Range<usize>, message: impl Into<String>) -> Diagnostic {
    Diagnostic::new(Code::BadCondition, span.clone(), message)
}

/// Returns the index of the target mode, or `None` if the exit ends the run.
fn target(
    kind: ExitKind,
    span: &Range<usize>,
    exit: &Exit,
    context: &ExitContext<'_>,
    diagnostics: &mut Diagnostics,
) -> Result<Option<usize>, ()> {
    let has_target = matches!(kind, ExitKind::Go | ExitKind::OnLost);
    let diagnostic = match (&exit.to, has_target) {
        (Some(to), true) => match context.modes.iter().position(|name| *name == to.value) {
            Some(mode) => return Ok(Some(mode)),
            None => Diagnostic::new(Code::UnknownMode, to.span.clone(), format!("there is no mode `{}`", to.value))
                .suggest(&to.value, context.modes.iter().copied(), "modes"),
        },
        (None, true) => bad_condition(span, format!("`{}` has no target mode", kind.key())).help("add `to = \"MODE\"`"),
        (None, false) => return Ok(None),
        (Some(to), false) => bad_condition(&to.span, format!("`{}` ends the run and has no target mode", kind.key()))
            .help("remove `to`, or use `go`"),
    };
    diagnostics.push(diagnostic);
    Err(())
}

/// Reports a key of an exit that its condition does not use.
fn misplaced_key(kind: ExitKind, span: &Range<usize>, exit: &Exit) -> Option<Diagnostic> {
    let has_bound = exit.above.is_some() || exit.below.is_some() || exit.within.is_some();
    let is_on_port = exit.when.is_some();
    let cases = [
        (exit.is.is_some() && !is_on_port, "`is` needs a port: add `when = \"node.port\"`"),
        (has_bound && !is_on_port, "a bound needs a port: add `when = \"node.port\"`"),
        (exit.hysteresis.is_some() && !has_bound, "`hysteresis` needs `above`, `below` or `within`"),
        (exit.for_ms.is_some() && !is_on_port, "`for_ms` needs `when`"),
        (
            exit.for_ms.is_some_and(|ms| ms > 0.0) && exit.is == Some(PortState::New),
            "`new` holds for one tick only: remove `for_ms`",
        ),
        (
            exit.of.is_some() && kind != ExitKind::OnLost && exit.after_travel_mm.is_none(),
            "`of` needs `on_lost` or `after_travel_mm`",
        ),
        (
            exit.priority.is_some() && kind != ExitKind::Go,
            "`priority` is only for `go`: other exits have a fixed order",
        ),
    ];
    let (_, message) = cases.into_iter().find(|(is_wrong, _)| *is_wrong)?;
    Some(bad_condition(span, message))
}

/// Returns the condition of an exit and its text, or `None` if its port has mistakes of its own.
fn condition(
    kind: ExitKind,
    span: &Range<usize>,
    exit: &Exit,
    context: &ExitContext<'_>,
) -> Result<Option<(Condition, String)>, Box<Diagnostic>> {
    if kind == ExitKind::OnLost {
        return lost_condition(span, exit, context);
    }
    let given = [exit.when.is_some(), exit.after_ms.is_some(), exit.after_travel_mm.is_some(), exit.on.is_some()];
    match given.iter().filter(|is| **is).count() {
        1 => {}
        0 => {
            let help = "add `when = \"node.port\"`, `after_ms`, `after_travel_mm` or `on = \"WORD\"`";
            return Err(Box::new(bad_condition(span, format!("`{}` has no condition", kind.key())).help(help)));
        }
        _ => {
            let help = "give each exit one condition, and several exits as a list: `[{ … }, { … }]`";
            return Err(Box::new(
                bad_condition(span, format!("`{}` has more than one condition", kind.key())).help(help),
            ));
        }
    }
    if let Some(when) = &exit.when {
        return port_condition(when, span, exit, context);
    }
    if let Some(ms) = exit.after_ms {
        return Ok(Some((Condition::Elapsed(nanos(ms)), format!("{} ms have passed", ms))));
    }
    if let Some(mm) = exit.after_travel_mm {
        let source = travel_pose(span, exit, context)?;
        let text = format!("the sensor has moved {} mm", mm);
        return Ok(source.map(|source| (Condition::Travel(source, mm * 1e-3), text)));
    }
    let word = exit.on.as_ref().expect("one of them is given");
    if word.value.trim() != word.value || word.value.is_empty() {
        return Err(Box::new(bad_condition(&word.span, "the word of `on` is empty, or starts or ends with a space")));
    }
    if ["stop", "resume"].contains(&word.value.as_str()) {
        let help = "`stop` halts the run and `resume` continues it: choose another word";
        return Err(Box::new(bad_condition(&word.span, format!("the word `{}` is reserved", word.value)).help(help)));
    }
    Ok(Some((Condition::Sent(word.value.clone()), format!("`{}` was sent", word.value))))
}

fn lost_condition(
    span: &Range<usize>,
    exit: &Exit,
    context: &ExitContext<'_>,
) -> Result<Option<(Condition, String)>, Box<Diagnostic>> {
    let others = exit.when.is_some() || exit.after_travel_mm.is_some() || exit.on.is_some();
    let (Some(of), false) = (&exit.of, others) else {
        let help = "write `on_lost = { of = \"node.port\", after_ms = 100, to = \"MODE\" }`";
        return Err(Box::new(
            bad_condition(span, "`on_lost` needs one signal in `of`, and no other condition").help(help),
        ));
    };
    let Some((watched, name)) = resolve_watched(of, context)? else { return Ok(None) };
    let after = exit.after_ms.map_or(context.lost_after, nanos);
    let text = format!("`{name}` is lost");
    Ok(Some((Condition::Lost(watched, after), text)))
}

/// Returns the pose whose travel is measured: the one in `of`, or the only one in the graph.
fn travel_pose(
    span: &Range<usize>,
    exit: &Exit,
    context: &ExitContext<'_>,
) -> Result<Option<PortRef>, Box<Diagnostic>> {
    if let Some(of) = &exit.of {
        let source = context.net.resolve(0, of)?;
        let is_pose = source.is_none_or(|source| context.net.port(source).kind == Kind::Pose);
        let message = format!("`{}` is not a pose, and only a pose has a travel", of.value);
        return if is_pose { Ok(source) } else { Err(Box::new(bad_condition(&of.span, message))) };
    }
    match context.poses.as_slice() {
        [one] => Ok(Some(*one)),
        [] => Err(Box::new(bad_condition(span, "`after_travel_mm` needs a pose, and the graph has none"))),
        several => {
            let names: Vec<String> =
                several.iter().map(|source| format!("`{}`", context.net.port_name(*source))).collect();
            let help = format!("add `of = \"node.port\"`; poses here: {}", names.join(", "));
            Err(Box::new(bad_condition(span, "the graph has several poses: `of` must name one").help(help)))
        }
    }
}

/// Resolves a port or a feature of one, with its name; returns `None` if its node has mistakes of its own.
fn resolve_watched(
    word: &Spanned<String>,
    context: &ExitContext<'_>,
) -> Result<Option<(WatchedPort, String)>, Box<Diagnostic>> {
    let (port, feature) = match word.value.match_indices('.').nth(1) {
        Some((at, _)) => {
            (Spanned { value: word.value[..at].into(), span: word.span.clone() }, Some(&word.value[at + 1..]))
        }
        None => (word.clone(), None),
    };
    let Some(source) = context.net.resolve(0, &port)? else { return Ok(None) };
    // The name as written in the file.
    let name = port.value.clone();
    let Some(feature) = feature else { return Ok(Some((WatchedPort { source, feature: None }, name))) };
    let Some(planned) = (context.port)(source) else { return Ok(None) };
    let Shape::Features(shape) = &planned.shape else {
        let message = format!("`{name}` is {} and has no features", planned.shape.kind().with_article());
        return Err(Box::new(Diagnostic::new(Code::UnknownPort, word.span.clone(), message)));
    };
    match shape.names().position(|known| known == feature) {
        Some(at) => Ok(Some((WatchedPort { source, feature: Some(at) }, format!("{name}.{feature}")))),
        None => {
            let message = format!("`{name}` has no feature `{feature}`");
            let diagnostic = Diagnostic::new(Code::UnknownPort, word.span.clone(), message);
            Err(Box::new(diagnostic.suggest(feature, shape.names(), "features")))
        }
    }
}

fn port_condition(
    when: &Spanned<String>,
    span: &Range<usize>,
    exit: &Exit,
    context: &ExitContext<'_>,
) -> Result<Option<(Condition, String)>, Box<Diagnostic>> {
    let Some((watched, name)) = resolve_watched(when, context)? else { return Ok(None) };
    let kind = context.net.port(watched.source).kind;
    let bounds = [exit.above.is_some() || exit.below.is_some(), exit.within.is_some(), exit.is.is_some()];
    if bounds.iter().filter(|is| **is).count() > 1 {
        let help = "`above` and `below` can be combined, `within` and `is` cannot";
        return Err(Box::new(bad_condition(span, "the condition has more than one test").help(help)));
    }
    let is_number = kind == Kind::Scalar || watched.feature.is_some();
    let test = match exit.is {
        Some(PortState::New) => Test::New,
        Some(PortState::Absent) => Test::Absent,
        Some(PortState::Present) => Test::Present,
        Some(is @ (PortState::True | PortState::False)) if kind == Kind::Flag => Test::Flag(is == PortState::True),
        Some(PortState::True | PortState::False) => {
            let message = format!("`{name}` is {}: only a flag is true or false", kind.with_article());
            return Err(Box::new(bad_condition(&when.span, message)));
        }
        None if is_number => return number_condition(when, &name, watched, exit, context),
        None if bounds[0] || bounds[1] => {
            let message = format!("`{name}` is {} and cannot be compared with a bound", kind.with_article());
            return Err(Box::new(
                bad_condition(&when.span, message).help("a bound needs a scalar, or one feature of a vector"),
            ));
        }
        None if kind == Kind::Flag => Test::Flag(true),
        None => {
            let message = format!("`{name}` is {}: the condition needs `is`", kind.with_article());
            return Err(Box::new(
                bad_condition(&when.span, message).help("add `is = \"new\"`, `\"absent\"` or `\"present\"`"),
            ));
        }
    };
    let text = match test {
        Test::New => format!("`{name}` is new"),
        Test::Absent => format!("`{name}` is absent"),
        Test::Present => format!("`{name}` is present"),
        Test::Flag(true) => format!("`{name}` is true"),
        _ => format!("`{name}` is false"),
    };
    Ok(Some((Condition::Port(watched, test), text)))
}

/// Rounds a bound to four decimal places, for a message.
fn rounded(bound: f64) -> f64 {
    (bound * 1e4).round() / 1e4
}

/// Returns the condition of a bound, which must be neither always nor never true in the range of the port.
fn number_condition(
    when: &Spanned<String>,
    name: &str,
    watched: WatchedPort,
    exit: &Exit,
    context: &ExitContext<'_>,
) -> Result<Option<(Condition, String)>, Box<Diagnostic>> {
    let (min, max) = match exit.within {
        Some(size) => (-size, size),
        None => (exit.above.unwrap_or(f64::NEG_INFINITY), exit.below.unwrap_or(f64::INFINITY)),
    };
    if exit.within.is_none() && exit.above.is_none() && exit.below.is_none() {
        let message = format!("`{name}` is a number: the condition needs a bound or `is`");
        let help = "add `above`, `below` or `within`, or `is = \"new\"`, `\"absent\"` or `\"present\"`";
        return Err(Box::new(bad_condition(&when.span, message).help(help)));
    }
    if min >= max && exit.within.is_none() {
        let message = format!("no number is above {min} and below {max}");
        return Err(Box::new(Diagnostic::new(Code::BoundOutOfRange, when.span.clone(), message)));
    }
    let text = match (exit.within, exit.above, exit.below) {
        (Some(size), ..) => format!("within {}", size),
        (_, Some(above), None) => format!("above {above}"),
        (_, None, Some(below)) => format!("below {below}"),
        _ => format!("between {min} and {max}"),
    };
    let Some(planned) = (context.port)(watched.source) else { return Ok(None) };
    if let Shape::Scalar(shape) = &planned.shape {
        let unit = shape.unit;
        let [low, high] = if unit.is_axial() { [-FRAC_PI_2, FRAC_PI_2] } else { shape.range };
        let (never, always) = (min >= high || max <= low, min < low && max > high);
        if (never || always) && low < high {
            let what = if never { "never" } else { "always" };
            let message =
                format!("`{name}` is {what} {text}: its range is {} to {} {unit}", rounded(low), rounded(high));
            return Err(Box::new(Diagnostic::new(Code::BoundOutOfRange, when.span.clone(), message)));
        }
    }
    let (hysteresis, text) = (exit.hysteresis.map_or(0.0, |by| by), format!("`{name}` is {text}"));
    Ok(Some((Condition::Port(watched, Test::Between { min, max, hysteresis }), text)))
}
