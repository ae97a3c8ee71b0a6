//! The places of boxes, frames and arrows: layers from the top to the bottom, by the Sugiyama method of `dagre`.

use dagre::graph::{Graph, GraphOptions};
use dagre::{EdgeLabel, LayoutOptions, NodeLabel, RankDir, layout};

use super::picture::{Arrow, Picture, PictureBox};

/// Height of a line of text in a box, and on an arrow [px].
pub(super) const LINES: [f64; 2] = [17.0, 13.0];
/// Estimated width of a character of these lines [px].
const CHARACTERS: [f64; 2] = [7.6, 5.8];
/// Space around the text of a box [px].
const PADDING: [f64; 2] = [20.0, 12.0];
/// Space between an arrow and its text [px].
const BESIDE: f64 = 5.0;
/// Space around the picture [px].
const MARGIN: f64 = 24.0;

/// A rectangle: its centre and its size [px].
#[derive(Debug, Clone, Copy)]
pub(super) struct Rectangle {
    pub(super) centre: [f64; 2],
    pub(super) size: [f64; 2],
}

/// An arrow with its places [px].
pub(super) struct PlacedArrow {
    pub(super) points: Vec<[f64; 2]>,
    /// Centre of its text.
    pub(super) text: Option<[f64; 2]>,
}

/// The places of everything in a picture, in its order.
pub(super) struct Layout {
    pub(super) size: [f64; 2],
    pub(super) groups: Vec<Rectangle>,
    pub(super) boxes: Vec<Rectangle>,
    pub(super) arrows: Vec<PlacedArrow>,
}

/// Returns the places. The same picture has the same places.
pub(super) fn place(picture: &Picture) -> Layout {
    let mut graph: Graph<NodeLabel, EdgeLabel> =
        Graph::with_options(GraphOptions { directed: true, multigraph: true, compound: true });
    for (i, group) in picture.groups.iter().enumerate() {
        graph.set_node(frame(i), Some(NodeLabel::default()));
        if let Some(parent) = group.parent {
            graph.set_parent(&frame(i), Some(&frame(parent)));
        }
    }
    for (i, one) in picture.boxes.iter().enumerate() {
        let [width, height] = size(one);
        graph.set_node(name(i), Some(NodeLabel { width, height, ..NodeLabel::default() }));
        if let Some(group) = one.group {
            graph.set_parent(&name(i), Some(&frame(group)));
        }
    }
    for (i, arrow) in picture.arrows.iter().enumerate() {
        let [width, height] = text_size(&arrow.lines);
        let label = EdgeLabel {
            width,
            height,
            labelpos: dagre::layout::types::LabelPos::Right,
            label_offset: BESIDE,
            ..EdgeLabel::default()
        };
        graph.set_edge(name(arrow.from), name(arrow.to), Some(label), Some(&i.to_string()));
    }
    layout(
        &mut graph,
        Some(LayoutOptions {
            rankdir: RankDir::TB,
            nodesep: 26.0,
            edgesep: 12.0,
            ranksep: 36.0,
            marginx: MARGIN,
            marginy: MARGIN,
            ..LayoutOptions::default()
        }),
    );
    read(picture, &graph)
}

fn read(picture: &Picture, graph: &Graph<NodeLabel, EdgeLabel>) -> Layout {
    let rectangle = |name: String| {
        let node = graph.node(&name);
        let at = |value: fn(&NodeLabel) -> f64| node.map_or(0.0, value);
        Rectangle {
            centre: [at(|node| node.x.unwrap_or_default()), at(|node| node.y.unwrap_or_default())],
            size: [at(|node| node.width), at(|node| node.height)],
        }
    };
    let placed = |(i, arrow): (usize, &Arrow)| {
        let edge = graph.edge(&name(arrow.from), &name(arrow.to), Some(&i.to_string()));
        let points = edge.map(|edge| edge.points.iter().map(|point| [point.x, point.y]).collect());
        let text = edge.filter(|_| !arrow.lines.is_empty()).and_then(|edge| Some([edge.x?, edge.y?]));
        PlacedArrow { points: points.unwrap_or_default(), text }
    };
    let groups: Vec<Rectangle> = (0..picture.groups.len()).map(|i| rectangle(frame(i))).collect();
    let boxes: Vec<Rectangle> = (0..picture.boxes.len()).map(|i| rectangle(name(i))).collect();
    let arrows: Vec<PlacedArrow> = picture.arrows.iter().enumerate().map(placed).collect();
    let far = |axis: usize| {
        let ends = groups.iter().chain(&boxes).map(|one| one.centre[axis] + one.size[axis] / 2.0);
        let points = arrows.iter().flat_map(|arrow| &arrow.points).map(|point| point[axis]);
        let texts = picture.arrows.iter().zip(&arrows);
        let texts = texts.filter_map(|(arrow, place)| Some(place.text?[axis] + text_size(&arrow.lines)[axis] / 2.0));
        ends.chain(points).chain(texts).fold(0.0, f64::max) + MARGIN
    };
    Layout { size: [far(0), far(1)], groups, boxes, arrows }
}

fn name(number: usize) -> String {
    format!("box{number}")
}

fn frame(number: usize) -> String {
    format!("frame{number}")
}

fn size(one: &PictureBox) -> [f64; 2] {
    let longest = one.lines.iter().map(|line| line.chars().count()).max().unwrap_or(0);
    [longest as f64 * CHARACTERS[0] + PADDING[0], one.lines.len() as f64 * LINES[0] + PADDING[1]]
}

fn text_size(lines: &[String]) -> [f64; 2] {
    let longest = lines.iter().map(|line| line.chars().count()).max().unwrap_or(0);
    [longest as f64 * CHARACTERS[1], lines.len() as f64 * LINES[1]]
}
