//! What a run shows on the terminal: `show` and `mark` in the section [graph], looked up like wires.

use std::collections::BTreeMap;
use std::ops::Range;

use crate::graph::net::Net;
use crate::graph::plan::{PlannedNode, PlannedShow, PlannedView};
use crate::graph::plan::{PlannedPort, PortRef, Producer};
use crate::node::Word;
use crate::signal::{Kind, Unit};
use crate::source::{Code, Diagnostic};

/// What the section [graph] says of it, looked up.
pub(crate) struct Shown {
    /// None if the graph does not say.
    ports: Option<Vec<PlannedShow>>,
    mark: Vec<(PortRef, Range<usize>)>,
}

impl Shown {
    /// Looks up every port, and whether it is of a kind that can be shown.
    pub(crate) fn new(net: &Net<'_>, found: &mut Vec<Diagnostic>) -> Self {
        let table = net.flat.table.as_ref();
        let words = table.and_then(|table| table.show.as_ref());
        let mut seen: Vec<PortRef> = Vec::new();
        let mut show = |word: &Word| {
            let source = source(net, word, found)?;
            let kind = net.port(source).kind;
            if !can_be_shown(kind) {
                let help = "show the image behind it, or anything that `--out` records";
                let message =
                    format!("`{}` is {}, and only images and numbers can be shown", word.text, kind.with_article());
                found.push(Diagnostic::new(Code::KindMismatch, word.span.clone(), message).help(help));
            }
            if seen.contains(&source) {
                let message = format!("`{}` is shown already", word.text);
                found.push(Diagnostic::new(Code::BadValue, word.span.clone(), message).help("take it out"));
            }
            seen.push(source);
            Some(PlannedShow { name: word.text.clone(), source })
        };
        let ports = words.map(|words| words.iter().filter_map(&mut show).collect());
        let mark = table.and_then(|table| table.mark.as_ref()).map_or(&[][..], |mark| &mark[..]);
        let mark = mark.iter().filter_map(|word| {
            let source = source(net, word, found)?;
            let kind = net.port(source).kind;
            if kind != Kind::Scalar {
                let message = format!("`{}` is {}, but `mark` takes scalars", word.text, kind.with_article());
                found.push(Diagnostic::new(Code::KindMismatch, word.span.clone(), message));
            }
            Some((source, word.span.clone()))
        });
        Self { mark: mark.collect(), ports }
    }

    /// The ports that are shown because the graph says so.
    pub(crate) fn sources(&self) -> impl Iterator<Item = PortRef> {
        self.ports.iter().flatten().map(|shown| shown.source)
    }

    /// What is no length of the place of the contact, now that the units are known.
    pub(crate) fn check_units(&self, ports: &BTreeMap<PortRef, PlannedPort>, found: &mut Vec<Diagnostic>) {
        for (source, span) in &self.mark {
            let Some(port) = ports.get(source) else { continue };
            if let Some(unit) = port.shape.unit().filter(|unit| *unit != Unit::METRE) {
                let message = format!("`{}` is in {unit}, but `mark` takes m", port.name);
                found.push(Diagnostic::new(Code::UnitMismatch, span.clone(), message));
            }
        }
    }

    /// What is shown of a graph without mistakes: what it says, or what is likely to be wanted.
    pub(crate) fn view(
        self,
        net: &Net<'_>,
        nodes: &[PlannedNode],
        ports: &BTreeMap<PortRef, PlannedPort>,
    ) -> PlannedView {
        let mark: Vec<PortRef> = self.mark.iter().map(|(source, _)| *source).collect();
        let named = |source: PortRef| {
            let name = net.name_in(0, source).unwrap_or_else(|| ports[&source].name.clone());
            PlannedShow { name, source }
        };
        let usual = || usual(nodes, ports).into_iter().map(named).collect();
        PlannedView { ports: self.ports.unwrap_or_else(usual), mark: mark.try_into().ok() }
    }
}

fn source(net: &Net<'_>, word: &Word, found: &mut Vec<Diagnostic>) -> Option<PortRef> {
    net.resolve(0, word, 0).unwrap_or_else(|diagnostic| {
        found.push(*diagnostic);
        None
    })
}

const fn can_be_shown(kind: Kind) -> bool {
    !matches!(kind, Kind::Mask | Kind::Regions | Kind::Jacobian)
}

/// What is shown of a graph that does not say: the images of its roles, and the first numbers of one kind, feature
/// vectors before all others.
fn usual(nodes: &[PlannedNode], ports: &BTreeMap<PortRef, PlannedPort>) -> Vec<PortRef> {
    /// As many numbers are shown, unless one port has more.
    const MOST: usize = 6;
    const KINDS: [Kind; 6] = [Kind::Features, Kind::Scalar, Kind::Twist, Kind::Joints, Kind::Pose, Kind::Flag];
    let is_role = |source: &PortRef| matches!(source.producer, Producer::Role(_));
    let of_kind = |kind: Kind| move |source: &PortRef| ports.get(source).is_some_and(|port| port.shape.kind() == kind);
    let roles: Vec<PortRef> = ports.keys().copied().filter(is_role).collect();
    let of_node = |node: &PlannedNode| {
        let producer = Producer::Node(node.index);
        (0..node.ports.len()).map(move |port| PortRef { producer, port })
    };
    let all: Vec<PortRef> = nodes.iter().flat_map(of_node).chain(roles.iter().copied()).collect();
    let mut shown: Vec<PortRef> = roles.iter().copied().filter(of_kind(Kind::Image)).collect();
    let Some(kind) = KINDS.into_iter().find(|kind| all.iter().any(of_kind(*kind))) else { return shown };
    let mut count = 0;
    shown.extend(all.into_iter().filter(of_kind(kind)).take_while(|source| {
        let is_first = count == 0;
        count += ports[source].shape.scalars().len();
        is_first || count <= MOST
    }));
    shown
}
