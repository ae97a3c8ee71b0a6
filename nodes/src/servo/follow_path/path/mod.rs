//! A path through points, with rounded corners: its length, its points, and the closest one to a place.
//!
//! A corner with the angle a between its legs is an arc of radius r that is tangent to both. It begins and ends at the
//! distance r tan(a / 2) from the corner.

mod element;
mod profile;

use nalgebra::Vector3;

use element::Element;
pub(super) use profile::Profile;

/// Points that are closer than this are at the same place [m].
const MIN_LEG_M: f64 = 1e-9;
/// A turn by less than this is no corner [rad].
const MIN_TURN: f64 = 1e-9;
/// A turn by more than this is a turn back, which no arc rounds [rad].
const MAX_TURN: f64 = 3.1;
/// Largest advance of one search for the closest point [m]. A place that is further ahead is not on the next part of
/// the path.
const MAX_ADVANCE_M: f64 = 0.005;
/// Largest number of elements that one search looks at, so that its time is bounded.
const MAX_SEARCH: usize = 64;

/// A path with rounded corners.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Path {
    elements: Vec<Element>,
    /// For each element, the way from the beginning of the path to that of the element [m].
    begins: Vec<f64>,
    /// Its length [m].
    pub(super) length: f64,
}

/// Why points make no path.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Refusal {
    /// Fewer than two points, or than three of a closed path.
    TooFew,
    /// A point is at the same place as the next one. It has this index.
    Repeated(usize),
    /// The path turns back at the point with this index.
    TurnsBack(usize),
    /// The corners do not fit the leg after the point with this index.
    Corner {
        /// Index of the point at the beginning of the leg.
        from: usize,
        /// Index of the corner that takes more of the leg.
        corner: usize,
        /// Length of the leg [m].
        leg_m: f64,
        /// The largest radius that fits all legs [m].
        fits_m: f64,
    },
}

/// A place on a path: an element and the way in it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Station {
    element: usize,
    way: f64,
}

/// The turn at a point: the angle between its legs, and its tangent of half.
#[derive(Debug, Clone, Copy)]
struct Turn {
    angle: f64,
    half_tangent: f64,
}

impl Turn {
    /// No corner.
    const NONE: Self = Self { angle: 0.0, half_tangent: 0.0 };
}

impl Path {
    /// Returns the path through points, with corners of a radius [m]. A closed path returns to the first point, and
    /// begins behind the corner there.
    pub(super) fn new(points: &[Vector3<f64>], radius: f64, is_closed: bool) -> Result<Self, Refusal> {
        let count = points.len();
        if count < if is_closed { 3 } else { 2 } {
            return Err(Refusal::TooFew);
        }
        let legs = if is_closed { count } else { count - 1 };
        let ways: Vec<Vector3<f64>> = (0..legs).map(|i| points[(i + 1) % count] - points[i]).collect();
        if let Some(i) = ways.iter().position(|way| way.norm() < MIN_LEG_M) {
            return Err(Refusal::Repeated(i));
        }
        let turn_at = |i: usize| match is_closed || (1..legs).contains(&i) {
            true => turn(&ways[(i + legs - 1) % legs], &ways[i % legs]).ok_or(Refusal::TurnsBack(i % count)),
            false => Ok(Turn::NONE),
        };
        let turns: Vec<Turn> = (0..=legs).map(turn_at).collect::<Result<_, _>>()?;
        check_fit(&ways, &turns, radius, count)?;
        Ok(Self::rounded(points, &ways, &turns, radius))
    }

    /// Returns the path of legs whose corners fit. `turns` has one more entry than there are legs.
    fn rounded(points: &[Vector3<f64>], ways: &[Vector3<f64>], turns: &[Turn], radius: f64) -> Self {
        let mut elements = Vec::new();
        for (i, way) in ways.iter().enumerate() {
            let (leg, along) = (way.norm(), way.normalize());
            let [before, after] = [turns[i], turns[i + 1]].map(|turn| turn.half_tangent * radius);
            let end = points[i] + along * (leg - after);
            // Two arcs that meet have no line between them; rounding may leave one without a direction.
            if leg - before - after > MIN_LEG_M {
                elements.push(Element::line(points[i] + along * before, end));
            }
            if turns[i + 1].angle > 0.0 {
                let next = ways[(i + 1) % ways.len()].normalize();
                elements.push(Element::arc(end, along, next, radius, turns[i + 1].angle));
            }
        }
        let mut length = 0.0;
        let begins = elements.iter().map(|element| {
            let begin = length;
            length += element.length;
            begin
        });
        let begins = begins.collect();
        Self { elements, begins, length }
    }

    /// Returns the elements.
    fn elements(&self) -> &[Element] {
        &self.elements
    }

    /// Returns the way from the beginning of the path to a station [m].
    pub(super) fn way(&self, station: Station) -> f64 {
        self.begins[station.element] + station.way
    }

    /// Returns the way from a station to the end of its element [m], and the index of the element.
    fn rest_of_element(&self, station: Station) -> (usize, f64) {
        (station.element, self.elements[station.element].length - station.way)
    }

    /// Returns the point at a station.
    pub(super) fn point(&self, station: Station) -> Vector3<f64> {
        self.elements[station.element].point(station.way)
    }

    /// Returns the direction at a station, a unit vector.
    pub(super) fn direction(&self, station: Station) -> Vector3<f64> {
        self.elements[station.element].direction(station.way)
    }

    /// Returns the curvature vector at a station [1/m].
    pub(super) fn curvature(&self, station: Station) -> Vector3<f64> {
        self.elements[station.element].curvature(station.way)
    }

    /// Returns the station that is a way [m] further, at most the end.
    pub(super) fn ahead(&self, station: Station, way: f64) -> Station {
        let Station { mut element, way: mut at } = station;
        at += way;
        while at > self.elements[element].length
            && element + 1 < self.elements.len()
            && element < station.element + MAX_SEARCH
        {
            at -= self.elements[element].length;
            element += 1;
        }
        Station { element, way: at.min(self.elements[element].length) }
    }

    /// Returns the station from `from` on where the distance to a place stops falling.
    ///
    /// The search never goes back, and at most 5 mm ahead. A path that crosses itself is therefore not cut short.
    pub(super) fn follow(&self, from: Station, place: &Vector3<f64>) -> Station {
        let mut best = from;
        let mut distance = f64::INFINITY;
        for element in (from.element..self.elements.len()).take(MAX_SEARCH) {
            let least = if element == from.element { from.way } else { 0.0 };
            let foot = self.elements[element].closest(place, least);
            let to_place = (foot.point - place).norm();
            if to_place > distance || element > from.element && foot.way == 0.0 {
                break;
            }
            (best, distance) = (Station { element, way: foot.way }, to_place);
            if foot.way < self.elements[element].length {
                break;
            }
        }
        let most = self.way(from) + MAX_ADVANCE_M;
        if self.way(best) > most { self.ahead(from, MAX_ADVANCE_M) } else { best }
    }
}

/// Returns the turn from one leg to the next, or `None` if it turns back.
fn turn(way: &Vector3<f64>, next: &Vector3<f64>) -> Option<Turn> {
    // Of unit vectors, so that no product underflows.
    let (along, next) = (way.normalize(), next.normalize());
    let angle = libm::atan2(along.cross(&next).norm(), along.dot(&next));
    if angle > MAX_TURN {
        return None;
    }
    Some(if angle < MIN_TURN { Turn::NONE } else { Turn { angle, half_tangent: libm::tan(0.5 * angle) } })
}

/// Refuses corners that do not fit their legs, at the leg that needs the smallest radius.
fn check_fit(ways: &[Vector3<f64>], turns: &[Turn], radius: f64, count: usize) -> Result<(), Refusal> {
    let fit = |i: usize| ways[i].norm() / (turns[i].half_tangent + turns[i + 1].half_tangent);
    let tightest = (0..ways.len()).min_by(|a, b| fit(*a).total_cmp(&fit(*b)));
    let Some(from) = tightest.filter(|i| fit(*i) < radius * (1.0 - 1e-9)) else { return Ok(()) };
    let corner = if turns[from + 1].half_tangent > turns[from].half_tangent { from + 1 } else { from };
    Err(Refusal::Corner { from, corner: corner % count, leg_m: ways[from].norm(), fits_m: fit(from) })
}

#[cfg(test)]
pub(super) mod tests;
