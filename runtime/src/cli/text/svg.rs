//! A small writer of SVG: lines, text and axes that are readable on light and on dark pages.

use std::fmt::{Display, Write};

/// Colour of axes and text: of middle brightness, since a picture has no background of its own.
pub const INK: &str = "#888888";

/// Maximum number of ticks of an axis.
const MAX_TICKS: usize = 11;

/// The colour and the dashes of each curve: colours that differ for colour-blind readers, and dashes for grey prints.
pub const STYLES: [(&str, &str); 6] = [
    ("#3d85c6", ""),
    ("#d9730d", "9 4"),
    ("#009e73", "3 3"),
    ("#c2558f", "9 3 2 3"),
    ("#8a8a00", "15 4"),
    ("#c8553d", "2 5"),
];

/// An SVG document under construction.
#[derive(Debug, Clone)]
pub struct Svg {
    text: String,
}

impl Svg {
    /// How a document begins.
    pub const START: &str = "<svg ";

    /// Starts a document of that width and height [px].
    #[must_use]
    pub fn new([width, height]: [f64; 2], title: &str) -> Self {
        let mut svg = Self { text: String::new() };
        svg.put(format_args!(
            "{}xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" font-family=\"sans-serif\" \
             font-size=\"13\">",
            Self::START
        ));
        svg.put(format_args!("<title>{}</title>", escaped(title)));
        svg
    }

    /// Adds an element as it is written.
    pub fn put(&mut self, element: impl Display) {
        writeln!(self.text, "{element}").expect("writing to a string cannot fail");
    }

    /// Adds a group with those attributes, and what `content` adds to it.
    pub fn group(&mut self, attributes: &str, content: impl FnOnce(&mut Self)) {
        self.put(format_args!("<g {attributes}>"));
        content(self);
        self.put("</g>");
    }

    /// Adds a line of text; `anchor` is the end of the text at that point: `start`, `middle` or `end`.
    pub fn text(&mut self, [x, y]: [f64; 2], anchor: &str, text: &str) {
        let text = escaped(text);
        self.put(format_args!("<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" fill=\"{INK}\">{text}</text>"));
    }

    /// Adds a line through those points [px].
    pub fn polyline(&mut self, points: impl IntoIterator<Item = [f64; 2]>) {
        let points: Vec<String> = points.into_iter().map(|[x, y]| format!("{x:.1},{y:.1}")).collect();
        self.put(format_args!("<polyline points=\"{}\"/>", points.join(" ")));
    }

    /// Adds two axes with ticks, numbers, grid lines and titles. Without a title, the x axis has no numbers either.
    pub fn axes(&mut self, x: PlotAxis, y: PlotAxis, [x_title, y_title]: [Option<&str>; 2]) {
        let ([left, right], [bottom, top]) = (x.pixels, y.pixels);
        self.group(&format!("stroke=\"{INK}\" fill=\"none\""), |svg| {
            svg.put(format_args!("<path d=\"M{left} {top}V{bottom}H{right}\"/>"));
            x.ticks().iter().for_each(|tick| svg.put(format_args!("<path d=\"M{:.1} {bottom}v5\"/>", x.at(*tick))));
            for at in y.ticks().iter().map(|tick| y.at(*tick)) {
                svg.put(format_args!("<path d=\"M{left} {at:.1}h-5\"/>"));
                svg.put(format_args!("<path stroke-opacity=\"0.25\" d=\"M{left} {at:.1}H{right}\"/>"));
            }
        });
        y.ticks().iter().for_each(|tick| self.text([left - 9.0, y.at(*tick) + 4.5], "end", &number(*tick)));
        if let Some(title) = x_title {
            x.ticks().iter().for_each(|tick| self.text([x.at(*tick), bottom + 19.0], "middle", &number(*tick)));
            self.text([0.5 * (left + right), bottom + 42.0], "middle", title);
        }
        let widest = y.ticks().iter().map(|tick| number(*tick).chars().count()).max().unwrap_or(0);
        let beside = (19.0 + 7.2 * widest as f64).max(46.0);
        let turn = format!("translate({:.1} {:.1}) rotate(-90)", left - beside, 0.5 * (top + bottom));
        let title = escaped(y_title.unwrap_or_default());
        self.put(format_args!("<text text-anchor=\"middle\" transform=\"{turn}\" fill=\"{INK}\">{title}</text>"));
    }

    /// Ends the document.
    #[must_use]
    pub fn finish(self) -> String {
        self.text + "</svg>\n"
    }
}

/// An axis of a plot.
#[derive(Debug, Clone, Copy)]
pub struct PlotAxis {
    /// Value at the start.
    from: f64,
    /// Value at the end.
    to: f64,
    /// Position of both ends [px].
    pixels: [f64; 2],
    is_log: bool,
}

impl PlotAxis {
    /// Returns a linear axis from one value to another, with the positions of both [px].
    #[must_use]
    pub const fn linear(from: f64, to: f64, pixels: [f64; 2]) -> Self {
        Self { from, to, pixels, is_log: false }
    }

    /// Returns a logarithmic axis from one positive value to a larger one, with the positions of both [px].
    #[must_use]
    pub const fn log(from: f64, to: f64, pixels: [f64; 2]) -> Self {
        Self { from, to, pixels, is_log: true }
    }

    /// Returns the position of a value [px].
    #[must_use]
    pub fn at(&self, value: f64) -> f64 {
        let [start, end] = self.pixels;
        let share = match self.is_log {
            true => libm::log(value / self.from) / libm::log(self.to / self.from),
            false => (value - self.from) / (self.to - self.from),
        };
        start + share * (end - start)
    }

    /// Returns four to eleven round numbers along the axis, or fewer if it is shorter than 200 px. On a logarithmic axis
    /// they are 1, 2 and 5 times the powers of ten, or only powers of ten where these are too many.
    #[must_use]
    pub fn ticks(&self) -> Vec<f64> {
        // Parsed, since a product of tens is not exact.
        let powers = (-12..12).filter_map(|k| format!("1e{k}").parse::<f64>().ok());
        if self.is_log {
            let [least, most] = [self.from * (1.0 - 1e-9), self.to * (1.0 + 1e-9)];
            let is_on = |tick: &f64| (least..=most).contains(tick);
            let all = powers.clone().flat_map(|power| [power, 2.0 * power, 5.0 * power]);
            let all: Vec<f64> = all.filter(is_on).collect();
            if all.len() <= MAX_TICKS {
                return all;
            }
            let powers: Vec<f64> = powers.filter(is_on).collect();
            let every = powers.len().div_ceil(MAX_TICKS).max(1);
            return powers.into_iter().step_by(every).collect();
        }
        let length = (self.pixels[1] - self.pixels[0]).abs();
        let raw = (self.to - self.from) / if length < 200.0 { 2.0 } else { 5.0 };
        let power = powers.take_while(|power| *power <= raw).last().unwrap_or(raw);
        let step = [5.0, 2.0, 1.0].into_iter().map(|by| by * power).find(|step| *step <= raw).unwrap_or(power);
        let first = (self.from / step).ceil() as i64;
        (first..).map(|k| k as f64 * step).take_while(|tick| *tick <= self.to + 1e-9 * step).collect()
    }
}

/// Formats a number without the rounding errors of binary fractions.
fn number(value: f64) -> String {
    if value == 0.0 || (1e-3..1e6).contains(&value.abs()) {
        return format!("{}", (value * 1e9).round() / 1e9 + 0.0);
    }
    let text = format!("{value:.3e}");
    let (digits, power) = text.split_once('e').unwrap_or((&text, "0"));
    let digits = digits.trim_end_matches('0').trim_end_matches('.');
    format!("{digits}e{power}")
}

/// Escapes the characters that have a meaning in XML.
#[must_use]
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_not_too_many() {
        for (from, to, first, step) in [
            (0.0, 5.2, 0.0, 1.0),
            (0.0, 4095.0, 0.0, 500.0),
            (-3.0, 0.9, -3.0, 0.5),
            (310.0, 340.0, 310.0, 5.0),
            (0.0, 1e-5, 0.0, 2e-6),
        ] {
            let ticks = PlotAxis::linear(from, to, [0.0, 400.0]).ticks();
            assert!((4..=11).contains(&ticks.len()), "{from}..{to}: {ticks:?}");
            assert!((ticks[0] - first).abs() < 1e-9 && (ticks[1] - ticks[0] - step).abs() < 1e-9 * step, "{ticks:?}");
            let few = PlotAxis::linear(from, to, [100.0, 0.0]).ticks();
            assert!((1..=5).contains(&few.len()), "{from}..{to}: {few:?}");
        }
    }

    #[test]
    fn an_axis_ends_where_its_pixels_end() {
        let axis = PlotAxis::linear(10.0, 30.0, [424.0, 24.0]);
        assert_eq!([axis.at(10.0), axis.at(20.0), axis.at(30.0)], [424.0, 224.0, 24.0]);
        let axis = PlotAxis::log(0.1, 10.0, [0.0, 200.0]);
        assert_eq!([axis.at(0.1), axis.at(1.0), axis.at(10.0)].map(f64::round), [0.0, 100.0, 200.0]);
        assert_eq!(axis.ticks(), [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0]);
        assert_eq!(PlotAxis::log(1e-2, 1e3, [0.0, 200.0]).ticks(), [0.01, 0.1, 1.0, 10.0, 100.0, 1000.0]);
        assert!(PlotAxis::log(1e-12, 1e11, [0.0, 200.0]).ticks().len() <= MAX_TICKS);
    }

    #[test]
    fn numbers_are_short_at_every_size() {
        let cases =
            [(0.1 + 0.2, "0.3"), (-4.0, "-4"), (2e-5, "2e-5"), (3.0 * 2e-6, "6e-6"), (0.0, "0"), (2.5e7, "2.5e7")];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn text_is_escaped() {
        let mut svg = Svg::new([1.0, 1.0], "a<b & \"c\"");
        svg.text([0.0, 0.0], "start", "x > y");
        let text = svg.finish();
        assert!(text.contains("<title>a&lt;b &amp; &quot;c&quot;</title>") && text.contains(">x &gt; y<"), "{text}");
    }
}
