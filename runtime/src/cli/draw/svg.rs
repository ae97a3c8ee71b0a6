//! A picture as SVG, readable on light and on dark pages.

use super::layout::{LINES, Layout, PlacedArrow, Rectangle, place};
use super::picture::{Arrow, Look, Picture, PictureBox, PictureGroup};
use crate::cli::text::svg::{INK, Svg};

/// Colour of what is outside of the graph. Boxes, frames and arrows have that of text.
const OUTER: &str = "#3d85c6";

/// Returns the picture as a document.
pub(super) fn text(picture: &Picture) -> String {
    let Layout { size, groups, boxes, arrows } = place(picture);
    let mut svg = Svg::new(size, &picture.title);
    svg.put(format_args!(
        "<defs><marker id=\"head\" viewBox=\"0 0 8 8\" refX=\"8\" refY=\"4\" markerWidth=\"8\" markerHeight=\"8\" \
         orient=\"auto\"><path d=\"M0 0L8 4L0 8z\" fill=\"{INK}\"/></marker></defs>"
    ));
    for (group, place) in picture.groups.iter().zip(groups) {
        draw_group(&mut svg, group, place);
    }
    for (arrow, place) in picture.arrows.iter().zip(&arrows) {
        draw_arrow(&mut svg, arrow, place);
    }
    for (one, place) in picture.boxes.iter().zip(boxes) {
        draw_box(&mut svg, one, place);
    }
    svg.finish()
}

fn draw_group(svg: &mut Svg, group: &PictureGroup, place: Rectangle) {
    rectangle(svg, place, &format!("rx=\"4\" stroke=\"{INK}\" stroke-dasharray=\"4 4\" fill=\"none\""));
    let [left, top] = corner(place);
    svg.text([left + 4.0, top - 5.0], "start", &group.name);
}

fn draw_box(svg: &mut Svg, one: &PictureBox, place: Rectangle) {
    let (colour, round) = match one.look {
        Look::Outer => (OUTER, 12),
        Look::Inner => (INK, 3),
    };
    let style =
        format!("rx=\"{round}\" stroke=\"{colour}\" stroke-width=\"1.5\" fill=\"{colour}\" fill-opacity=\"0.12\"");
    rectangle(svg, place, &style);
    let first = place.centre[1] - LINES[0] * (one.lines.len() as f64 - 1.0) / 2.0 + 4.5;
    for (i, line) in one.lines.iter().enumerate() {
        svg.text([place.centre[0], first + LINES[0] * i as f64], "middle", line);
    }
}

fn draw_arrow(svg: &mut Svg, arrow: &Arrow, place: &PlacedArrow) {
    let dashes = if arrow.is_dashed { " stroke-dasharray=\"6 4\"" } else { "" };
    let style = format!("fill=\"none\" stroke=\"{INK}\" stroke-opacity=\"0.8\" marker-end=\"url(#head)\"{dashes}");
    svg.group(&style, |svg| svg.polyline(place.points.iter().copied()));
    let Some([x, y]) = place.text else { return };
    let first = y - LINES[1] * (arrow.lines.len() as f64 - 1.0) / 2.0 + 3.5;
    svg.group("font-size=\"10\"", |svg| {
        for (i, line) in arrow.lines.iter().enumerate() {
            svg.text([x, first + LINES[1] * i as f64], "middle", line);
        }
    });
}

fn rectangle(svg: &mut Svg, place: Rectangle, style: &str) {
    let ([left, top], [width, height]) = (corner(place), place.size);
    svg.put(format_args!("<rect x=\"{left:.1}\" y=\"{top:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" {style}/>"));
}

fn corner(place: Rectangle) -> [f64; 2] {
    [0, 1].map(|axis| place.centre[axis] - place.size[axis] / 2.0)
}
