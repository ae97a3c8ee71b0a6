//! The images of a run: when contact begins, at its strongest, and at the end.

use crate::cli::text::number::seconds;
use crate::cli::text::picture::{Raster, Snapshot};
use crate::cli::text::prose::{PageStyle, break_at_semicolons};
use crate::engine::Engine;
use crate::node::{Bus, PortId};
use crate::signal::{Freshness, Image, ImageShape, Scalar};

/// Narrower pages have captions above the curves [characters].
pub(crate) const MIN_WIDE_PAGE: usize = 70;
/// Space between two pictures [characters].
const GAP: usize = 2;
/// Minimum width of a picture with its caption [characters].
const MIN_CAPTION: usize = 26;

/// Keeps the images of one port at some moments of the run.
pub(crate) struct ImageHistory {
    /// Name of the port in the graph file.
    pub(crate) name: String,
    pub(crate) shape: ImageShape,
    id: PortId,
    /// Ports of the position of the contact.
    mark: Option<[PortId; 2]>,
    /// The first image with a contact, or the first image if the graph has no `mark`.
    first: Option<Snapshot>,
    /// The image with the largest sum.
    pub(crate) strongest: Option<Snapshot>,
    /// The last image, if it is still present.
    last: Option<Snapshot>,
}

impl ImageHistory {
    pub(crate) fn new(name: String, id: PortId, shape: ImageShape, mark: Option<[PortId; 2]>) -> Self {
        Self { name, id, shape, mark, first: None, strongest: None, last: None }
    }

    /// Adds the image of the last tick of the engine.
    pub(crate) fn add(&mut self, engine: &Engine) {
        let bus = engine.bus();
        let mark = self.mark.and_then(|mark| position(bus, mark));
        let freshness = bus.mark(self.id).freshness(engine.ticks());
        if freshness != Freshness::New {
            self.last = self.last.take().filter(|_| freshness == Freshness::Held);
            return;
        }
        let cells = bus.slot::<Image>(self.id).cells();
        let sum = cells.iter().filter(|value| value.is_finite()).map(|value| f64::from(*value)).sum();
        let (time, is_first) = (engine.now(), mark.is_some() || self.mark.is_none());
        let keep = |snapshot: &mut Option<Snapshot>| {
            // The buffer of the previous snapshot is reused.
            let mut kept = snapshot.take().map(|snapshot| snapshot.cells).unwrap_or_default();
            cells.clone_into(&mut kept);
            *snapshot = Some(Snapshot { time, cells: kept, sum, mark });
        };
        if self.first.is_none() && is_first {
            keep(&mut self.first);
        }
        if self.strongest.as_ref().is_none_or(|strongest| sum > strongest.sum) {
            keep(&mut self.strongest);
        }
        keep(&mut self.last);
    }

    /// Returns at most `count` snapshots with their captions, in the order of time.
    fn snapshots(&self, count: usize) -> Vec<(&'static str, &Snapshot)> {
        let first = if self.mark.is_some() { "contact begins" } else { "first image" };
        let mut snapshots: Vec<(&str, &Snapshot)> = Vec::new();
        let is_over = self.mark.is_some() && self.last.as_ref().is_none_or(|last| last.mark.is_none());
        let (last, strongest, first) = (("end", &self.last), ("strongest", &self.strongest), (first, &self.first));
        // After a contact that has ended, the last image is empty.
        let order = if is_over { [strongest, last, first] } else { [last, strongest, first] };
        for (caption, snapshot) in order {
            let is_new = |snapshot: &&Snapshot| snapshots.iter().all(|(_, other)| other.time != snapshot.time);
            if let Some(snapshot) = snapshot.as_ref().filter(is_new).filter(|_| snapshots.len() < count) {
                snapshots.push((caption, snapshot));
            }
        }
        snapshots.sort_by_key(|(_, snapshot)| snapshot.time);
        snapshots
    }

    /// Draws the first image with a contact, the strongest and the last side by side.
    pub(crate) fn page(&self, style: PageStyle) -> String {
        let raster = |count: usize| {
            let width = (style.width - GAP * (count - 1)) / count;
            (count, width, Raster::new(&self.shape, width, style.has_colour))
        };
        let (.., one) = raster(1);
        // Pictures are not made coarser to fit more of them.
        let fits = |(_, width, raster): &(usize, usize, Raster<'_>)| *width >= MIN_CAPTION && raster.block == one.block;
        let (count, _, raster) = (1..=3).rev().map(raster).find(fits).unwrap_or((1, style.width, one));
        self.draw(raster, style.width, &self.snapshots(count))
    }

    /// Draws the current image.
    pub(crate) fn now(&self, style: PageStyle) -> String {
        let raster = Raster::new(&self.shape, style.width, style.has_colour);
        self.draw(raster, style.width, &self.last.iter().map(|snapshot| ("now", snapshot)).collect::<Vec<_>>())
    }

    fn draw(&self, raster: Raster<'_>, page: usize, snapshots: &[(&str, &Snapshot)]) -> String {
        if snapshots.is_empty() {
            return format!("{}: absent\n", self.name);
        }
        let mut text = break_at_semicolons(&format!("{}: {}", self.name, raster.describe()), page) + "\n";
        let scale = raster.scale(&snapshots.iter().map(|(_, snapshot)| *snapshot).collect::<Vec<_>>());
        let width = raster.width().max(MIN_CAPTION);
        let captions =
            snapshots.iter().map(|(caption, snapshot)| format!("{:.3} s: {caption}", seconds(snapshot.time)));
        text.push_str(&row(captions.map(|caption| (caption.chars().count(), caption)), width));
        let pictures: Vec<Vec<String>> = snapshots.iter().map(|(_, snapshot)| raster.lines(snapshot, scale)).collect();
        for i in 0..pictures[0].len() {
            text.push_str(&row(pictures.iter().map(|lines| (raster.width(), lines[i].clone())), width));
        }
        let has_mark = snapshots.iter().any(|(_, snapshot)| snapshot.mark.is_some());
        let mark = match has_mark {
            false => "",
            true if page < MIN_WIDE_PAGE => ";\n  >< centre of the contact",
            true => "; >< centre of the contact",
        };
        text + &raster.legend(scale, self.shape.unit) + mark + "\n"
    }
}

/// Puts texts side by side, each with its width on the terminal.
fn row(texts: impl Iterator<Item = (usize, String)>, width: usize) -> String {
    let padded = texts.map(|(seen, text)| text + &" ".repeat((width + GAP).saturating_sub(seen)));
    format!("{}\n", padded.collect::<String>().trim_end())
}

/// Returns the position of the contact [m], if there is one.
fn position(bus: &Bus, mark: [PortId; 2]) -> Option<[f64; 2]> {
    let [x, y] = mark.map(|id| bus.get::<Scalar>(id).copied());
    Some([x?, y?])
}
