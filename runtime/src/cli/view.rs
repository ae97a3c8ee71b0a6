//! What a run shows of its ports: the images as they were, and the numbers over time.

use std::fmt::Write;

use super::chart::{chart, time_axis};
use super::course::{Course, Point};
use super::picture::{Easel, Frame};
use super::prose::Look;
use super::summary::number;
use crate::engine::Engine;
use crate::node::{Bus, PortId};
use crate::record::{Column, Columns};
use crate::signal::{Freshness, Image, ImageShape, Scalar, Shape};

/// Points of a curve, at the most: at least two to a character where the page is as wide as it gets.
const ROOM: usize = 256;
/// The share of a run that the last mean and deviation are of.
const TAIL: f64 = 0.2;
/// Width of what is written beside a curve.
const PANEL: usize = 27;
/// A page that is narrower has it above the curve.
const NARROW: usize = 70;
/// Characters between two pictures.
const GAP: usize = 2;
/// As much room the words above a picture take.
const CAPTION: usize = 26;

/// Watches the ports that are shown, in bounded memory.
pub(super) struct View {
    films: Vec<Film>,
    plots: Vec<Plot>,
    columns: Columns,
    row: Vec<f64>,
    courses: Vec<Course>,
    /// Time of the first tick and of the last [ns].
    span: Option<[i64; 2]>,
}

/// A port that has curves.
struct Plot {
    /// As the graph file calls it.
    name: String,
    /// What the names of its columns begin with.
    port: String,
    count: usize,
}

impl Plot {
    /// What a column is called beside those of this and of other ports.
    fn title(&self, column: &Column, is_alone: bool) -> String {
        let part = column.name.strip_prefix(&self.port).unwrap_or_default().trim_start_matches('.');
        let name = match part {
            "" => self.name.clone(),
            part if is_alone => part.to_owned(),
            part => format!("{}.{part}", self.name),
        };
        format!("{name} [{}]", column.unit)
    }
}

/// The images of one port that are kept.
struct Film {
    name: String,
    id: PortId,
    shape: ImageShape,
    mark: Option<[PortId; 2]>,
    /// The first with a contact; the first of all where nothing tells.
    first: Option<Frame>,
    strongest: Option<Frame>,
    last: Option<Frame>,
}

impl View {
    pub(super) fn new(engine: &Engine) -> Self {
        let (mut films, mut plots, mut drawn) = (Vec::new(), Vec::new(), Vec::new());
        for (name, port, id) in &engine.display().ports {
            if let Shape::Image(shape) = &port.shape {
                let mark = engine.display().contact.filter(|_| films.is_empty());
                films.push(Film::new(name.clone(), *id, shape.clone(), mark));
            } else {
                plots.push(Plot { name: name.clone(), port: port.name.clone(), count: Columns::width(&port.shape) });
                drawn.push((port.clone(), *id));
            }
        }
        let columns = Columns::new(&drawn);
        let (row, courses) = (vec![f64::NAN; columns.list.len()], vec![Course::with_room(ROOM); columns.list.len()]);
        Self { films, plots, columns, row, courses, span: None }
    }

    /// Takes in the tick that the engine has just run.
    pub(super) fn add(&mut self, engine: &Engine) {
        let now = engine.now();
        self.span = Some([self.span.map_or(now, |[first, _]| first), now]);
        self.columns.read(engine.bus(), &mut self.row);
        for (course, value) in self.courses.iter_mut().zip(&self.row) {
            course.add(*value);
        }
        for film in &mut self.films {
            film.add(engine);
        }
    }

    /// The images at three moments, and the curves of the whole run.
    pub(super) fn page(&self, page: Look) -> String {
        let films = self.films.iter().map(|film| film.moments(page));
        films.chain(self.curves(page, 6)).collect::<Vec<_>>().join("\n")
    }

    /// The same while it runs, what is wanted first before the rest: the first image as it is now, and low curves.
    pub(super) fn live(&self, page: Look) -> Vec<String> {
        let film = self.films.first().map(|film| film.now(page));
        film.into_iter().chain(self.curves(page, 3)).collect()
    }

    /// The curves, none higher than that, with the axis of time below them.
    fn curves(&self, page: Look, most: usize) -> Option<String> {
        let [first, last] = self.span.filter(|_| !self.courses.is_empty())?.map(|nanos| nanos as f64 * 1e-9);
        let height = match self.courses.len() {
            1 => 6,
            2 => 5,
            3 => 4,
            _ => 3,
        };
        let is_narrow = page.width < NARROW;
        let panel = if is_narrow { 0 } else { PANEL };
        let width = page.width - panel;
        let names: Vec<&str> = self.plots.iter().map(|plot| plot.name.as_str()).collect();
        let tail = (last - first) * TAIL;
        let title = format!("{} over time; mean ± deviation of the last {tail:.3} s", names.join(", "));
        let mut text = wrapped(&title, page.width) + "\n";
        let mut columns = self.columns.list.iter().zip(&self.courses).zip(&self.row);
        for plot in &self.plots {
            for ((column, course), value) in columns.by_ref().take(plot.count) {
                let title = plot.title(column, self.plots.len() == 1);
                let lines = chart(course.points(), width, height.min(most));
                text.push_str(&captioned(&title, &said(*value, &course.tail(TAIL)), &lines, is_narrow));
            }
        }
        for line in time_axis(width, first, last).lines() {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{:panel$}{line}", "");
        }
        Some(text)
    }
}

/// The last value, and mean and deviation at the end.
fn said(last: f64, tail: &Point) -> [String; 2] {
    let last = if last.is_nan() { "absent at the end".to_owned() } else { format!("last {}", number(last)) };
    let mean = match tail.is_there() {
        true => format!("mean {} ± {}", number(tail.mean), number(tail.deviation())),
        false => String::new(),
    };
    [last, mean]
}

/// A curve with its title and its numbers on the left, or above where there is no room.
fn captioned(title: &str, said: &[String; 2], lines: &[String], is_narrow: bool) -> String {
    if is_narrow {
        let mut words: Vec<&str> = vec![title];
        words.extend(said.iter().map(String::as_str).filter(|text| !text.is_empty()));
        return format!("{}\n{}\n", words.join("\n  "), lines.join("\n"));
    }
    let mut text = String::new();
    // A long title has a line of its own.
    let (above, title) = if title.chars().count() < PANEL { ("", title) } else { (title, "") };
    if !above.is_empty() {
        text = format!("{above}\n");
    }
    let panel = [title, &format!("  {}", said[0]), &format!("  {}", said[1])].map(str::trim_end).map(str::to_owned);
    for (i, line) in lines.iter().enumerate() {
        let left = panel.get(i).map_or("", String::as_str);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{}", format!("{left:PANEL$}{line}").trim_end());
    }
    text
}

impl Film {
    fn new(name: String, id: PortId, shape: ImageShape, mark: Option<[PortId; 2]>) -> Self {
        Self { name, id, shape, mark, first: None, strongest: None, last: None }
    }

    fn add(&mut self, engine: &Engine) {
        let bus = engine.bus();
        let mark = self.mark.and_then(|mark| place(bus, mark));
        match bus.mark(self.id).freshness(engine.ticks()) {
            Freshness::New => {}
            Freshness::Held => return,
            Freshness::Lost | Freshness::Absent => {
                self.last = None;
                return;
            }
        }
        let cells = bus.slot::<Image>(self.id).cells();
        let sum = cells.iter().filter(|value| value.is_finite()).map(|value| f64::from(*value)).sum();
        let (time, is_touched) = (engine.now(), mark.is_some() || self.mark.is_none());
        let keep = |frame: &mut Option<Frame>| {
            // The buffer of the frame before is written over.
            let mut kept = frame.take().map(|frame| frame.cells).unwrap_or_default();
            kept.clear();
            kept.extend_from_slice(cells);
            *frame = Some(Frame { time, cells: kept, sum, mark });
        };
        if self.first.is_none() && is_touched {
            keep(&mut self.first);
        }
        if self.strongest.as_ref().is_none_or(|strongest| sum > strongest.sum) {
            keep(&mut self.strongest);
        }
        keep(&mut self.last);
    }

    /// The frames that are worth a look, in the order of time, as many as fit.
    fn frames(&self, most: usize) -> Vec<(&'static str, &Frame)> {
        let first = if self.mark.is_some() { "contact begins" } else { "first image" };
        let mut frames: Vec<(&str, &Frame)> = Vec::new();
        let is_over = self.mark.is_some() && self.last.as_ref().is_none_or(|last| last.mark.is_none());
        let (last, strongest, first) = (("end", &self.last), ("strongest", &self.strongest), (first, &self.first));
        // Of a contact that is over the end shows nothing.
        let order = if is_over { [strongest, last, first] } else { [last, strongest, first] };
        for (what, frame) in order {
            let is_new = |frame: &&Frame| frames.iter().all(|(_, other)| other.time != frame.time);
            if let Some(frame) = frame.as_ref().filter(is_new).filter(|_| frames.len() < most) {
                frames.push((what, frame));
            }
        }
        frames.sort_by_key(|(_, frame)| frame.time);
        frames
    }

    /// The first image with a contact, the strongest and the last, side by side.
    fn moments(&self, page: Look) -> String {
        let easel = |count: usize| {
            let width = (page.width - GAP * (count - 1)) / count;
            (count, width, Easel::new(&self.shape, width, page.has_colour))
        };
        let (.., one) = easel(1);
        // No picture becomes coarser so that more of them fit.
        let fits = |(_, width, easel): &(usize, usize, Easel<'_>)| *width >= CAPTION && easel.block == one.block;
        let (count, _, easel) = (1..=3).rev().map(easel).find(fits).unwrap_or((1, page.width, one));
        self.draw(easel, page.width, &self.frames(count))
    }

    /// The image as it is now.
    fn now(&self, page: Look) -> String {
        let easel = Easel::new(&self.shape, page.width, page.has_colour);
        self.draw(easel, page.width, &self.last.iter().map(|frame| ("now", frame)).collect::<Vec<_>>())
    }

    fn draw(&self, easel: Easel<'_>, page: usize, frames: &[(&str, &Frame)]) -> String {
        if frames.is_empty() {
            return format!("{}: absent\n", self.name);
        }
        let mut text = wrapped(&format!("{}: {}", self.name, easel.about()), page) + "\n";
        let scale = easel.scale(&frames.iter().map(|(_, frame)| *frame).collect::<Vec<_>>());
        let width = easel.width().max(CAPTION);
        let captions = frames.iter().map(|(what, frame)| format!("{:.3} s: {what}", frame.time as f64 * 1e-9));
        text.push_str(&row(captions.map(|caption| (caption.chars().count(), caption)), width));
        let pictures: Vec<Vec<String>> = frames.iter().map(|(_, frame)| easel.lines(frame, scale)).collect();
        for i in 0..pictures[0].len() {
            text.push_str(&row(pictures.iter().map(|lines| (easel.width(), lines[i].clone())), width));
        }
        let has_mark = frames.iter().any(|(_, frame)| frame.mark.is_some());
        let mark = match has_mark {
            false => "",
            true if page < NARROW => ";\n  >< centre of the contact",
            true => "; >< centre of the contact",
        };
        text + &easel.legend(scale, self.shape.unit) + mark + "\n"
    }
}

/// A text whose parts, which `;` divides, go to lines of their own where there is no room.
fn wrapped(text: &str, width: usize) -> String {
    let (mut lines, mut room) = (String::new(), width);
    for (i, part) in text.split("; ").enumerate() {
        let length = part.chars().count() + 2;
        let (between, indent) = match i {
            0 => ("", 0),
            _ if length <= room => ("; ", 0),
            _ => (";\n  ", 2),
        };
        room = if indent > 0 { width } else { room };
        room = room.saturating_sub(length + indent);
        lines.push_str(between);
        lines.push_str(part);
    }
    lines
}

/// Texts side by side, each with how wide it is seen to be.
fn row(texts: impl Iterator<Item = (usize, String)>, width: usize) -> String {
    let padded = texts.map(|(seen, text)| text + &" ".repeat((width + GAP).saturating_sub(seen)));
    format!("{}\n", padded.collect::<String>().trim_end())
}

/// Where the contact is, if there is one [m].
fn place(bus: &Bus, mark: [PortId; 2]) -> Option<[f64; 2]> {
    let [x, y] = mark.map(|id| bus.get::<Scalar>(id).copied());
    Some([x?, y?])
}
