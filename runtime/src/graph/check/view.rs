//! Checks `show` and `mark` in the section [graph], and selects the ports that a run shows.

use std::collections::{BTreeMap, BTreeSet};
use std::iter::successors;
use std::ops::Range;

use crate::graph::load::Task;
use crate::graph::net::{Net, report};
use crate::graph::plan::{PlannedNode, PlannedPort, PlannedShow, PlannedView, PortRef, Producer};
use crate::graph::syntax::GraphTable;
use crate::node::Spanned;
use crate::signal::{Kind, Unit};
use crate::source::{Code, Diagnostic, Diagnostics};

/// The ports of `show` and `mark`.
pub(crate) struct RequestedView {
    /// The ports of `show`, or `None` without that key.
    ports: Option<Vec<PlannedShow>>,
    /// The ports of `mark` in the graph itself, for a graph without `show`.
    mark: Option<[PortRef; 2]>,
    /// All ports of `mark`.
    marks: Vec<(PortRef, Range<usize>)>,
}

/// Resolves the ports of `show` and `mark`, and reports those that cannot be shown.
///
/// A graph without `show` shows the ports of its parts that are tasks, with their prefix.
pub(crate) fn check(net: &Net<'_>, diagnostics: &mut Diagnostics) -> RequestedView {
    let has_show = |task: &Task| task.table.as_ref().is_some_and(|table| table.show.is_some());
    let is_shown = |task: usize| {
        let around = successors(net.flat.tasks[task].parent, |task| net.flat.tasks[*task].parent);
        !around.into_iter().any(|task| has_show(&net.flat.tasks[task]))
    };
    let mut view = RequestedView { ports: None, mark: None, marks: Vec::new() };
    for (number, task) in net.flat.tasks.iter().enumerate() {
        let (shown, mark) = check_task(net, task, &mut view.marks, diagnostics);
        if number == 0 {
            view.mark = mark;
        }
        if let Some(shown) = shown.filter(|_| is_shown(number)) {
            view.ports.get_or_insert_default().extend(shown);
        }
    }
    view
}

/// Resolves the ports of `show` and `mark` of one task. The first image is marked.
fn check_task(
    net: &Net<'_>,
    task: &Task,
    marks: &mut Vec<(PortRef, Range<usize>)>,
    diagnostics: &mut Diagnostics,
) -> (Option<Vec<PlannedShow>>, Option<[PortRef; 2]>) {
    let Some(table) = &task.table else { return (None, None) };
    let mut seen: BTreeSet<PortRef> = BTreeSet::new();
    let mut show = |word: &Spanned<String>| {
        let source = report(net.resolve(task.scope, word), diagnostics)?;
        let kind = net.port(source).kind;
        let diagnostic = |code: Code, message: String| Diagnostic::new(code, word.span.clone(), message);
        if !can_be_shown(kind) {
            let message = format!("`{}` is {}: only images and numbers can be shown", word.value, kind.with_article());
            let help = "show the image from which it is computed, or a port with numbers";
            diagnostics.push(diagnostic(Code::KindMismatch, message).help(help));
        }
        if !seen.insert(source) {
            let message = format!("`{}` is listed twice", word.value);
            diagnostics.push(diagnostic(Code::BadValue, message).help("remove it"));
        }
        Some(PlannedShow { name: format!("{}{}", task.prefix, word.value), source, mark: None })
    };
    let mut ports: Option<Vec<PlannedShow>> =
        table.show.as_ref().map(|words| words.iter().filter_map(&mut show).collect());
    let mark = table.mark.as_ref().map_or(&[][..], |mark| &mark[..]);
    let mark = mark.iter().filter_map(|word| {
        let source = report(net.resolve(task.scope, word), diagnostics)?;
        let kind = net.port(source).kind;
        if kind != Kind::Scalar {
            let message = format!("`{}` is {}, but `mark` takes scalars", word.value, kind.with_article());
            diagnostics.push(Diagnostic::new(Code::KindMismatch, word.span.clone(), message));
        }
        marks.push((source, word.span.clone()));
        Some(source)
    });
    let mark: Option<[PortRef; 2]> = mark.collect::<Vec<_>>().try_into().ok();
    let is_image = |shown: &&mut PlannedShow| net.port(shown.source).kind.is_picture();
    let image = ports.iter_mut().flatten().find(is_image);
    let marked = mark.into_iter().flatten().chain(image.iter().map(|image| image.source));
    diagnostics.extend(mark.and_then(|_| of_two_sensors(net, table, marked)));
    if let Some(image) = image {
        image.mark = mark;
    }
    (ports, mark)
}

/// Reports a mark whose ports, or whose image, descend from different sensors.
fn of_two_sensors(net: &Net<'_>, table: &GraphTable, marked: impl Iterator<Item = PortRef>) -> Option<Diagnostic> {
    let marked: Vec<PortRef> = marked.collect();
    let sensors = |port: &PortRef| net.roles_of(port.producer).collect::<BTreeSet<usize>>();
    let of_x = sensors(marked.first()?);
    let is_other = |port: &&PortRef| !of_x.is_empty() && !sensors(port).is_empty() && of_x.is_disjoint(&sensors(port));
    let other = marked.iter().find(is_other)?;
    let [x, other] = [&marked[0], other].map(|port| net.port_name(*port));
    let message = format!("`{x}` and `{other}` are of different sensors");
    let place = table.mark.as_ref()?[0].span.clone();
    let help = "`mark` takes the x and the y of one contact, in the first image of `show`";
    Some(Diagnostic::new(Code::ForeignInput, place, message).help(help))
}

impl RequestedView {
    /// Returns the ports of `show`.
    pub(crate) fn sources(&self) -> impl Iterator<Item = PortRef> {
        self.ports.iter().flatten().map(|shown| shown.source)
    }

    /// Reports ports of `mark` that are not in metres, once the units are known.
    pub(crate) fn check_units(&self, ports: &BTreeMap<PortRef, PlannedPort>, diagnostics: &mut Diagnostics) {
        for (source, span) in &self.marks {
            let Some(port) = ports.get(source) else { continue };
            if let Some(unit) = port.shape.unit().filter(|unit| *unit != Unit::METRE) {
                let message = format!("`{}` is in {unit}, but `mark` expects a position in m", port.name);
                diagnostics.push(Diagnostic::new(Code::UnitMismatch, span.clone(), message));
            }
        }
    }

    /// Plans the view: the ports of `show`, or a default selection.
    pub(crate) fn plan(
        self,
        net: &Net<'_>,
        nodes: &[PlannedNode],
        ports: &BTreeMap<PortRef, PlannedPort>,
    ) -> PlannedView {
        let named = |source: PortRef| {
            let name = net.name_in(0, source).unwrap_or(&ports[&source].name).to_owned();
            PlannedShow { name, source, mark: None }
        };
        let default = || {
            let mut shown: Vec<PlannedShow> = default_ports(nodes, ports).into_iter().map(named).collect();
            let image = shown.iter_mut().find(|shown| net.port(shown.source).kind == Kind::Image);
            image.into_iter().for_each(|image| image.mark = self.mark);
            shown
        };
        PlannedView { ports: self.ports.unwrap_or_else(default) }
    }
}

const fn can_be_shown(kind: Kind) -> bool {
    !matches!(kind, Kind::Mask | Kind::Regions | Kind::Jacobian)
}

/// Returns the ports shown without `show`: the images of the roles, and the first ports of one numeric kind.
fn default_ports(nodes: &[PlannedNode], ports: &BTreeMap<PortRef, PlannedPort>) -> Vec<PortRef> {
    /// Maximum number of curves, unless the first port alone has more.
    const MAX_CURVES: usize = 6;
    const KINDS: [Kind; 6] = [Kind::Features, Kind::Scalar, Kind::Twist, Kind::Joints, Kind::Pose, Kind::Flag];
    let is_role = |source: &PortRef| matches!(source.producer, Producer::Role(_));
    let of_kind = |kind: Kind| move |source: &PortRef| ports.get(source).is_some_and(|port| port.shape.kind() == kind);
    let roles: Vec<PortRef> = ports.keys().copied().filter(is_role).collect();
    let of_nodes = nodes.iter().flat_map(PlannedNode::outputs).map(|(source, _)| source);
    let all: Vec<PortRef> = of_nodes.chain(roles.iter().copied()).collect();
    let mut shown: Vec<PortRef> = roles.iter().copied().filter(of_kind(Kind::Image)).collect();
    let Some(kind) = KINDS.into_iter().find(|kind| all.iter().any(of_kind(*kind))) else { return shown };
    let mut count = 0;
    shown.extend(all.into_iter().filter(of_kind(kind)).take_while(|source| {
        let is_first = count == 0;
        count += ports[source].shape.scalars().len();
        is_first || count <= MAX_CURVES
    }));
    shown
}
