//! The Bode plot of `tune`: each loop with its gains.
//!
//! A curve is L(f), and a dot is a measured frequency. Of a feature that answers one component, the curve goes through the
//! dots that noise hardly changes. Between and beyond them it has the shape of the fit. The phase of a dot is drawn next
//! to its curve.

use std::f64::consts::PI;

use nalgebra::Complex;
use tactflow_runtime::cli::svg::{INK, PlotAxis, STYLES, Svg};

use super::experiment::HALF;
use super::propose::TunedFeature;
use super::spectrum::Line;
use super::tuned::Tuned;
use crate::tool::control::digits::or_none;
use crate::tool::control::response::Loop;

/// Width of the picture [px].
const WIDTH: f64 = 760.0;
/// Left and right end of the curves [px].
const ACROSS: [f64; 2] = [72.0, 744.0];
/// Heights of the panels of magnitude and phase [px].
const PANELS: [f64; 2] = [200.0, 160.0];
/// Space between two panels, and below the last one of a feature [px].
const GAPS: [f64; 2] = [16.0, 56.0];
/// Height of a line of text [px].
const LINE: f64 = 18.0;

/// Range of the frequencies [Hz].
const HZ: [f64; 2] = [0.1, 20.0];
/// Number of points of a curve.
const POINTS: usize = 200;
/// Range of the magnitude [dB], and of the phase [deg].
const MAGNITUDE: [f64; 2] = [-50.0, 30.0];
const PHASE: [f64; 2] = [-360.0, 0.0];

/// Returns the picture of all features.
pub(super) fn svg(tuned: &Tuned) -> String {
    let heights = tuned.features.iter().map(|feature| {
        LINE * (feature.answers.len() + 1) as f64 + PANELS.iter().sum::<f64>() + 2.0 * GAPS[0] + GAPS[1]
    });
    let mut svg = Svg::new([WIDTH, 16.0 + heights.sum::<f64>()], &format!("Loops of the mode {}", tuned.mode));
    let mut top = 16.0;
    for feature in &tuned.features {
        top = block(&mut svg, feature, top);
    }
    svg.finish()
}

/// Draws one feature, and returns where the next one begins [px].
fn block(svg: &mut Svg, feature: &TunedFeature, top: f64) -> f64 {
    let [kp, ki, kd] = feature.new.unwrap_or(feature.old);
    let whose = if feature.new.is_some() { "the proposed gains" } else { "the gains of the graph" };
    svg.text([ACROSS[0], top + 12.0], "start", &format!("{}, with {whose}: kp {kp}, ki {ki}, kd {kd}", feature.name));
    let mut below = top + LINE;
    for (i, found) in feature.answers.iter().enumerate() {
        svg.text([ACROSS[0] + 44.0, below + 12.0], "start", &legend(feature, i));
        let line = [[ACROSS[0], below + 8.0], [ACROSS[0] + 36.0, below + 8.0]];
        if found.refused.is_none() {
            styled(svg, i, |svg| svg.polyline(line));
        }
        below += LINE;
    }
    let hz = PlotAxis::log(HZ[0], HZ[1], ACROSS);
    let middle = below + GAPS[0] + PANELS[0];
    let magnitude = PlotAxis::linear(MAGNITUDE[0], MAGNITUDE[1], [middle, below + GAPS[0]]);
    let bottom = middle + GAPS[0] + PANELS[1];
    let phase = PlotAxis::linear(PHASE[0], PHASE[1], [bottom, middle + GAPS[0]]);
    svg.axes(hz, magnitude, [None, Some("|L| [dB]")]);
    svg.axes(hz, phase, [Some("frequency [Hz]"), Some("phase of L [deg]")]);
    // Where the margins are read.
    for at in [magnitude.at(0.0), phase.at(-180.0)] {
        svg.group(&format!("fill=\"none\" stroke=\"{INK}\""), |svg| svg.polyline(ACROSS.map(|x| [x, at])));
    }
    let measured = feature.loops.iter().filter(|(i, _)| feature.answers[*i].refused.is_none());
    for (i, around) in measured {
        let curve = curve(around);
        draw(svg, *i, hz, [(magnitude, MAGNITUDE, 1), (phase, PHASE, 2)], &curve, &dots(feature, *i, around, &curve));
    }
    bottom + GAPS[1]
}

/// Returns the name of a contact with its margins.
fn legend(feature: &TunedFeature, i: usize) -> String {
    let found = &feature.answers[i];
    match (&found.refused, feature.margins[i].as_ref()) {
        (Some(_), _) => format!("{}: not measured", found.object),
        (None, None) => found.object.clone(),
        (None, Some(margins)) => {
            format!(
                "{}: phase margin {}, gain margin {}, peak of the sensitivity {:.2}",
                found.object,
                or_none(margins.phase_deg, "deg", 1),
                or_none(margins.gain_db, "dB", 1),
                margins.peak_sensitivity
            )
        }
    }
}

/// A point of a curve: frequency [Hz], magnitude [dB] and phase [deg].
type Point = [f64; 3];

/// Returns the curve of a loop. Its phase has no jumps.
fn curve(around: &Loop) -> Vec<Point> {
    let ratio = HZ[1] / HZ[0];
    let mut last = -90.0;
    let point = |k: usize| {
        let hz = HZ[0] * libm::pow(ratio, k as f64 / (POINTS - 1) as f64);
        let point = point(hz, around.open(2.0 * PI * hz), last);
        last = point[2];
        point
    };
    (0..POINTS).map(point).collect()
}

fn point(hz: f64, open: Complex<f64>, near: f64) -> Point {
    let phase = open.arg().to_degrees();
    [hz, 20.0 * libm::log10(open.norm()), phase + 360.0 * ((near - phase) / 360.0).round()]
}

/// Returns the measured frequencies of a contact, with the gains of its loop. Each component that moves the feature was
/// measured alone, with half of the gains of the graph and without the factor of a schedule.
fn dots(feature: &TunedFeature, i: usize, around: &Loop, curve: &[Point]) -> Vec<Point> {
    let Some(first) = feature.answers[i].lines.first() else { return Vec::new() };
    let scale = around.kp / (HALF * feature.old[0]);
    let all = |k: usize| feature.answers[i].lines.iter().filter_map(move |lines: &Vec<Line>| lines.get(k));
    let counts = |k: &usize| all(*k).all(Line::counts);
    let dot = |k: usize| {
        let hz = first[k].omega / (2.0 * PI);
        let open = all(k).map(|line| line.open).sum::<Complex<f64>>() * scale;
        let far = |at: &&Point| libm::log(at[0] / hz).abs();
        let near = curve.iter().min_by(|a, b| far(a).total_cmp(&far(b))).map_or(-90.0, |at| at[2]);
        point(hz, open, near)
    };
    (0..first.len()).filter(counts).map(dot).collect()
}

/// Draws the curve and the dots of a contact, in each panel as far as its range goes.
fn draw(
    svg: &mut Svg,
    i: usize,
    hz: PlotAxis,
    panels: [(PlotAxis, [f64; 2], usize); 2],
    curve: &[Point],
    dots: &[Point],
) {
    for (axis, [low, high], value) in panels {
        let is_inside = |point: &&Point| (low..=high).contains(&point[value]);
        let place = |point: &Point| [hz.at(point[0]), axis.at(point[value])];
        styled(svg, i, |svg| svg.polyline(curve.iter().filter(is_inside).map(place)));
        for [x, y] in dots.iter().filter(is_inside).map(place) {
            svg.put(format_args!(
                "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"3.5\" fill=\"{}\"/>",
                STYLES[i % STYLES.len()].0
            ));
        }
    }
}

fn styled(svg: &mut Svg, i: usize, content: impl FnOnce(&mut Svg)) {
    let (colour, dashes) = STYLES[i % STYLES.len()];
    let attributes = format!("fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\" stroke-dasharray=\"{dashes}\"");
    svg.group(&attributes, content);
}
