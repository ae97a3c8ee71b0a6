//! Resolves the exits of modes: each has one condition, and the port of that condition must support it.

use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;
use std::ops::Range;

use crate::graph::load::{Entity, MeasuredValues};
use crate::graph::net::{Net, Resolved};
use crate::graph::plan::{Condition, PlannedExit, PlannedPort, PortRef, Test, WatchedPort};
use crate::graph::syntax::{ExitKind, ExitTable, ModeBlock, ModeExit, PortState, WORDS, into_diagnostic};
use crate::node::Spanned;
use crate::signal::{Kind, Shape};
use crate::source::{Code, Diagnostic, Diagnostics, quoted};

/// What the exits of a mode refer to.
pub(crate) struct ExitContext<'a> {
    pub(crate) net: &'a Net<'a>,
    /// The task whose modes they are.
    pub(crate) task: usize,
    /// Index of each mode of the task by its name.
    pub(crate) modes: BTreeMap<&'a str, usize>,
    /// Returns a built port, or `None` if its node has mistakes.
    pub(crate) port: &'a dyn Fn(PortRef) -> Option<&'a PlannedPort>,
    /// The poses of the task that a sample can change.
    pub(crate) poses: Vec<PortRef>,
    /// Returns the default time after which the signal of a port is lost [ns].
    pub(crate) lost_after: &'a dyn Fn(PortRef) -> i64,
}

impl ExitContext<'_> {
    /// Resolves the exits of a mode; exits with a mistake are left out.
    pub(crate) fn resolve(
        &self,
        mode: &ModeBlock,
        measured: &mut MeasuredValues,
        diagnostics: &mut Diagnostics,
    ) -> Vec<PlannedExit> {
        let mut planned = Vec::new();
        for exit in &mode.exits {
            let ModeExit { kind, span, table } = exit;
            diagnostics.extend(misplaced_key(exit));
            let settled = self.in_port_unit(exit, measured, diagnostics);
            match (self.target(exit), settled.and_then(|exit| self.condition(&exit))) {
                (Ok(to), Ok((condition, text))) => planned.push(PlannedExit {
                    kind: *kind,
                    to,
                    condition,
                    lasts: table.for_ms.map_or(0, nanos),
                    priority: table.priority.unwrap_or(0),
                    text,
                    span: span.clone(),
                }),
                (to, condition) => {
                    let found = [to.err(), condition.err()].into_iter().flatten().flatten();
                    diagnostics.extend(found.map(|diagnostic| *diagnostic));
                }
            }
        }
        planned
    }

    /// Returns an exit with its bounds in the unit of the port that it watches.
    fn in_port_unit(
        &self,
        exit: &ModeExit,
        measured: &mut MeasuredValues,
        diagnostics: &mut Diagnostics,
    ) -> Resolved<ModeExit> {
        let mut exit = exit.clone();
        if !exit.table.amounts_mut().any(|amount| amount.has_unit()) {
            return Ok(exit);
        }
        let Some(when) = exit.table.when.clone() else { return Ok(exit) };
        let (watched, _) = self.watched(&when)?;
        let unit = match (&(self.port)(watched.source).ok_or(None)?.shape, watched.feature) {
            (Shape::Scalar(shape), None) => shape.unit,
            (Shape::Features(shape), Some(feature)) => shape.features[feature].unit,
            // A bound on another port has its own diagnostic.
            _ => return Ok(exit),
        };
        let mut numbers = Vec::new();
        let wrong = exit.table.amounts_mut().filter_map(|amount| amount.settle(Some(unit), &mut numbers).err());
        let wrong: Vec<_> = wrong.map(into_diagnostic).collect();
        measured.add(None, numbers);
        if wrong.is_empty() {
            return Ok(exit);
        }
        diagnostics.extend(wrong);
        Err(None)
    }

    /// Returns the index of the target mode, or `None` if the exit ends the run.
    fn target(&self, ModeExit { kind, span, table }: &ModeExit) -> Resolved<Option<usize>> {
        let has_target = matches!(kind, ExitKind::Go | ExitKind::OnLost);
        match (&table.to, has_target) {
            (Some(to), true) => {
                let mode = self.modes.get(to.value.as_str()).copied();
                if mode.is_some() {
                    return Ok(mode);
                }
                let known = self.net.flat.mode_names(self.task);
                Diagnostic::unknown(Code::UnknownMode, "mode", &to.value, &to.span, known).into_err()
            }
            (None, true) => {
                let message = format!("`{}` has no target mode", kind.key());
                bad_condition(span, message).help("write the mode in `to`").into_err()
            }
            (None, false) => Ok(None),
            (Some(to), false) => {
                let message = format!("`{}` ends the run and has no target mode", kind.key());
                bad_condition(&to.span, message).help("remove `to`, or use `go`").into_err()
            }
        }
    }

    /// Returns the condition of an exit and its text.
    fn condition(&self, exit: &ModeExit) -> Resolved<(Condition, String)> {
        let ModeExit { kind, span, table } = exit;
        if *kind == ExitKind::OnLost {
            return self.lost_condition(span, table);
        }
        match (&table.when, table.after_ms, table.after_travel_mm, &table.on) {
            (Some(when), None, None, None) => self.port_condition(when, exit),
            (None, Some(ms), None, None) => Ok((Condition::Elapsed(nanos(ms)), format!("{ms} ms have passed"))),
            (None, None, Some(mm), None) => {
                let pose = self.travel_pose(span, table)?;
                Ok((Condition::Travel(pose, mm * 1e-3), format!("the sensor has moved {mm} mm")))
            }
            (None, None, None, Some(word)) => sent_condition(word),
            (None, None, None, None) => {
                let help = "write a condition: `when` with a port, `after_ms`, `after_travel_mm` or `on` with a word";
                bad_condition(span, format!("`{}` has no condition", kind.key())).help(help).into_err()
            }
            _ => {
                let help = "give each exit one condition, and write several exits as a list";
                bad_condition(span, format!("`{}` has more than one condition", kind.key())).help(help).into_err()
            }
        }
    }

    fn lost_condition(&self, span: &Range<usize>, table: &ExitTable) -> Resolved<(Condition, String)> {
        let others = table.when.is_some() || table.after_travel_mm.is_some() || table.on.is_some();
        let (Some(of), false) = (&table.of, others) else {
            let help = "write `on_lost = { of = \"node.port\", after_ms = 100, to = \"MODE\" }`";
            let message = "`on_lost` needs one signal in `of`, and no other condition";
            return bad_condition(span, message).help(help).into_err();
        };
        let (watched, name) = self.watched(of)?;
        let after = table.after_ms.map_or_else(|| (self.lost_after)(watched.source), nanos);
        Ok((Condition::Lost(watched, after), format!("`{name}` is lost")))
    }

    /// Returns the pose whose travel is measured: the one in `of`, or the only one in the graph.
    fn travel_pose(&self, span: &Range<usize>, table: &ExitTable) -> Resolved<PortRef> {
        if let Some(of) = &table.of {
            let source = self.net.resolve(self.scope(), of)?;
            let is_pose = self.net.port(source).kind == Kind::Pose;
            if is_pose && self.net.roles_of(source.producer).next().is_some() {
                return Ok(source);
            }
            let is = if is_pose { "descends from no role, so it never moves" } else { "is not a pose" };
            let message = format!("`after_travel_mm` measures a pose, but `{}` {is}", of.value);
            return bad_condition(&of.span, message).into_err();
        }
        match self.poses.as_slice() {
            [one] => Ok(*one),
            [] => bad_condition(
                span,
                "`after_travel_mm` needs a measured pose, but the graph has none: use `after_ms` instead",
            )
            .into_err(),
            several => {
                let names = quoted(several.iter().map(|source| self.net.port_name(*source)));
                let help = format!("name one in `of`; poses here: {names}");
                bad_condition(span, "the graph has several poses: `of` must name one").help(help).into_err()
            }
        }
    }

    /// Resolves a port or a feature of one, with its name as written.
    fn watched(&self, word: &Spanned<String>) -> Resolved<(WatchedPort, String)> {
        let resolve = |name: &str| {
            self.net.resolve(self.scope(), &Spanned { value: name.to_owned(), span: word.part(0..name.len()) })
        };
        // The last name may be that of a port, or that of a feature of the port before it.
        let (name, feature, source) = match word.value.rsplit_once('.').filter(|(name, _)| name.contains('.')) {
            None => (word.value.as_str(), None, resolve(&word.value)?),
            Some((name, feature)) => match (resolve(name), resolve(&word.value)) {
                (_, Ok(source)) => (word.value.as_str(), None, source),
                (Err(_), Err(found)) if self.is_path(word) => return Err(found),
                (source, Err(_)) => (name, Some(feature), source?),
            },
        };
        let Some(feature) = feature else { return Ok((WatchedPort { source, feature: None }, name.to_owned())) };
        let unknown = |message: String| Diagnostic::new(Code::UnknownPort, word.span.clone(), message);
        let shape = &(self.port)(source).ok_or(None)?.shape;
        let Shape::Features(features) = shape else {
            let kind = shape.kind().with_article();
            return unknown(format!("`{name}` is {kind} and has no features")).into_err();
        };
        let Some(at) = features.names().position(|known| known == feature) else {
            let message = format!("`{name}` has no feature `{feature}`");
            let at = word.part(name.len() + 1..word.value.len());
            return Diagnostic::new(Code::UnknownPort, at, message)
                .suggest(feature, features.names(), "features")
                .into_err();
        };
        Ok((WatchedPort { source, feature: Some(at) }, format!("{name}.{feature}")))
    }

    /// Returns whether a word is the path of a port in a part, such as `left.modes.servo`, and no feature of an export.
    fn is_path(&self, word: &Spanned<String>) -> bool {
        let scopes = &self.net.flat.scopes;
        let mut names = word.value.split('.');
        let part = names.next().and_then(|part| scopes[self.scope()].names.get(part));
        let Some((_, Entity::Part(inner))) = part else { return false };
        names.next().is_some_and(|port| scopes[*inner].exports.position(port).is_none())
    }

    fn scope(&self) -> usize {
        self.net.flat.tasks[self.task].scope
    }

    fn port_condition(&self, when: &Spanned<String>, exit: &ModeExit) -> Resolved<(Condition, String)> {
        let ModeExit { span, table, .. } = exit;
        let (watched, name) = self.watched(when)?;
        let kind = self.net.port(watched.source).kind;
        let is_bounded = [table.above.is_some() || table.below.is_some(), table.within.is_some()];
        if is_bounded.into_iter().chain([table.is.is_some()]).filter(|is| *is).count() > 1 {
            let help = "`above` and `below` can be combined, `within` and `is` cannot";
            return bad_condition(span, "the condition has more than one test").help(help).into_err();
        }
        let is_number = kind == Kind::Scalar || watched.feature.is_some();
        let bad = |what: &str| bad_condition(&when.span, format!("`{name}` is {}{what}", kind.with_article()));
        let state = match table.is {
            Some(PortState::True | PortState::False) if kind != Kind::Flag => {
                return bad(": only a flag is true or false").into_err();
            }
            Some(state) => state,
            None if is_number => return self.number_condition(when, &name, watched, table),
            None if is_bounded.contains(&true) => {
                let help = "a bound needs a scalar, or one feature of a vector, as in `node.port.feature`";
                return bad(" and cannot be compared with a bound").help(help).into_err();
            }
            None if kind == Kind::Flag => PortState::True,
            None => {
                let help = "write `is = \"new\"`, `\"absent\"` or `\"present\"`";
                return bad(": the condition needs `is`").help(help).into_err();
            }
        };
        Ok((Condition::Port(watched, Test::Is(state)), format!("`{name}` is {}", state.word())))
    }

    /// Returns the condition of a bound, which must be neither always nor never true in the range of the port.
    fn number_condition(
        &self,
        when: &Spanned<String>,
        name: &str,
        watched: WatchedPort,
        table: &ExitTable,
    ) -> Resolved<(Condition, String)> {
        let [within, above, below, hysteresis] = [&table.within, &table.above, &table.below, &table.hysteresis]
            .map(|amount| amount.as_ref().map(|amount| amount.number));
        let out_of_range = |message: String| Diagnostic::new(Code::BoundOutOfRange, when.span.clone(), message);
        let (min, max, text) = match (within, above, below) {
            (Some(size), ..) => (-size, size, format!("within {size}")),
            (_, Some(min), None) => (min, f64::INFINITY, format!("above {min}")),
            (_, None, Some(max)) => (f64::NEG_INFINITY, max, format!("below {max}")),
            (_, Some(min), Some(max)) if min >= max => {
                return out_of_range(format!("no number is above {min} and below {max}")).into_err();
            }
            (_, Some(min), Some(max)) => (min, max, format!("between {min} and {max}")),
            (None, None, None) => {
                let message = format!("`{name}` is a number: the condition needs a bound or `is`");
                let help = "write `above`, `below` or `within`, or `is = \"new\"`, `\"absent\"` or `\"present\"`";
                return bad_condition(&when.span, message).help(help).into_err();
            }
        };
        if let Shape::Scalar(shape) = &(self.port)(watched.source).ok_or(None)?.shape {
            let unit = shape.unit;
            let [low, high] = if unit.is_axial() { [-FRAC_PI_2, FRAC_PI_2] } else { shape.range };
            let (never, always) = (min >= high || max <= low, min < low && max > high);
            if (never || always) && low < high {
                let what = if never { "never" } else { "always" };
                let range = format!("{} to {} {unit}", rounded(low), rounded(high));
                return out_of_range(format!("`{name}` is {what} {text}: its range is {range}")).into_err();
            }
        }
        let test = Test::Between { min, max, hysteresis: hysteresis.unwrap_or(0.0) };
        Ok((Condition::Port(watched, test), format!("`{name}` is {text}")))
    }
}

fn nanos(ms: f64) -> i64 {
    (ms * 1e6).round() as i64
}

/// Rounds a bound to four decimal places, for a message.
fn rounded(bound: f64) -> f64 {
    (bound * 1e4).round() / 1e4
}

fn bad_condition(span: &Range<usize>, message: impl Into<String>) -> Diagnostic {
    Diagnostic::new(Code::BadCondition, span.clone(), message)
}

/// Reports a key of an exit that its condition does not use.
fn misplaced_key(ModeExit { kind, span, table: exit }: &ModeExit) -> Option<Diagnostic> {
    let has_bound = exit.above.is_some() || exit.below.is_some() || exit.within.is_some();
    let is_on_port = exit.when.is_some();
    let cases = [
        (exit.is.is_some() && !is_on_port, "`is` needs a port: add `when = \"node.port\"`"),
        (has_bound && !is_on_port, "a bound needs a port: add `when = \"node.port\"`"),
        (exit.hysteresis.is_some() && !has_bound, "`hysteresis` needs `above`, `below` or `within`"),
        (exit.for_ms.is_some() && !is_on_port, "`for_ms` needs a port: add `when = \"node.port\"`"),
        (
            exit.for_ms.is_some_and(|ms| ms > 0.0) && exit.is == Some(PortState::New),
            "`new` holds for one tick only: remove `for_ms`",
        ),
        (
            exit.of.is_some() && *kind != ExitKind::OnLost && exit.after_travel_mm.is_none(),
            "`of` needs `on_lost` or `after_travel_mm`",
        ),
        (
            exit.priority.is_some() && *kind != ExitKind::Go,
            "`priority` is only for `go`: other exits have a fixed order",
        ),
    ];
    let (_, message) = cases.into_iter().find(|(is_wrong, _)| *is_wrong)?;
    Some(bad_condition(span, message))
}

fn sent_condition(word: &Spanned<String>) -> Resolved<(Condition, String)> {
    if word.value.trim() != word.value || word.value.is_empty() {
        return bad_condition(
            &word.span,
            "the word of `on` is empty, or starts or ends with a space: write for example `on = \"next\"`",
        )
        .into_err();
    }
    if WORDS.contains(&word.value.as_str()) {
        let help = "`stop` halts the run, `resume` continues it, and `tare` takes the zeros of its sensors anew: choose another word";
        return bad_condition(&word.span, format!("the word `{}` is reserved", word.value)).help(help).into_err();
    }
    Ok((Condition::Sent(word.value.clone()), format!("`{}` was sent", word.value)))
}
