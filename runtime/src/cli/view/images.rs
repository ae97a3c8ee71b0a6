//! The images of a run: when contact begins, at its strongest, and at the end.

use crate::cli::text::number::seconds;
use crate::cli::text::picture::{Raster, Snapshot};
use crate::cli::text::prose::{PageStyle, break_at_semicolons};
use crate::engine::Engine;
use crate::node::{Bus, PortId};
use crate::signal::{Freshness, Image, ImageShape, Kind, Scalar, VectorImage};

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
    /// The port, and its kind: an image or a vector image.
    id: PortId,
    kind: Kind,
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
    pub(crate) fn new(name: String, (id, kind): (PortId, Kind), shape: ImageShape, mark: Option<[PortId; 2]>) -> Self {
        Self { name, id, kind, shape, mark, first: None, strongest: None, last: None }
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
        // The buffers of the snapshots before are reused.
        let mut newest = self.last.take().unwrap_or_default();
        (newest.time, newest.mark) = (engine.now(), mark);
        newest.read(bus, self.id, self.kind);
        let is_first = mark.is_some() || self.mark.is_none();
        if self.first.is_none() && is_first {
            self.first = Some(newest.clone());
        }
        if self.strongest.as_ref().is_none_or(|strongest| newest.sum > strongest.sum) {
            self.strongest.get_or_insert_default().copy_from(&newest);
        }
        self.last = Some(newest);
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
        let drag = match self.kind {
            Kind::VectorImage => "\n  arrows: x and y of the tactels, where they are not small",
            _ => "",
        };
        text + &raster.legend(scale, self.shape.unit) + mark + drag + "\n"
    }
}

impl Snapshot {
    /// Reads the values of the image, or of the vector image, in a port.
    fn read(&mut self, bus: &Bus, id: PortId, kind: Kind) {
        self.cells.clear();
        self.drag.clear();
        if kind == Kind::VectorImage {
            let vectors = bus.slot::<VectorImage>(id).cells();
            self.cells.extend(vectors.iter().map(|[.., z]| *z));
            self.drag.extend(vectors.iter().map(|[x, y, _]| [*x, *y]));
        } else {
            self.cells.extend_from_slice(bus.slot::<Image>(id).cells());
        }
        self.sum = self.cells.iter().filter(|value| value.is_finite()).map(|value| f64::from(*value)).sum();
    }

    /// Copies another one into its own buffers.
    fn copy_from(&mut self, other: &Self) {
        let Self { time, cells, drag, sum, mark } = self;
        (*time, *sum, *mark) = (other.time, other.sum, other.mark);
        cells.clone_from(&other.cells);
        drag.clone_from(&other.drag);
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
