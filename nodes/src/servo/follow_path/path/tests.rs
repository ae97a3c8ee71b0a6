//! Lengths, points and closest points.

use std::f64::consts::PI;

use nalgebra::{Rotation3, Vector3};
use proptest::prelude::*;

use super::{Path, Profile, Refusal, Station};

/// Points of a square of 40 mm in the plane z = 0, beginning in the middle of a side.
pub(crate) const SQUARE: [[f64; 3]; 5] =
    [[0.0, 0.0, 0.0], [0.02, 0.0, 0.0], [0.02, 0.04, 0.0], [-0.02, 0.04, 0.0], [-0.02, 0.0, 0.0]];

/// The distance of a place from that square with corners of a radius, across and along its plane [m].
///
/// The rounded square is what lies at most `radius` from a smaller square.
pub(crate) fn off_square(place: &Vector3<f64>, radius: f64) -> f64 {
    let inner = 0.02 - radius;
    let [x, y] = [place.x.abs() - inner, (place.y - 0.02).abs() - inner];
    let in_plane = x.max(0.0).hypot(y.max(0.0)) + x.max(y).min(0.0) - radius;
    in_plane.hypot(place.z)
}

fn vectors(points: &[[f64; 3]]) -> Vec<Vector3<f64>> {
    points.iter().map(|point| Vector3::from(*point)).collect()
}

/// Points of a path with steps of a fixed length, as its stations.
fn samples(path: &Path, step: f64) -> Vec<Station> {
    let count = (path.length / step).ceil() as usize;
    let mut station = Station::default();
    let mut samples = vec![station];
    for _ in 0..count {
        station = path.ahead(station, step);
        samples.push(station);
    }
    samples
}

#[test]
fn the_length_of_a_rounded_square_is_that_of_its_sides_and_one_circle() {
    for radius in [0.001, 0.005, 0.0199] {
        let exact = 4.0 * (0.04 - 2.0 * radius) + 2.0 * PI * radius;
        let path = Path::new(&vectors(&SQUARE), radius, true).unwrap();
        assert!((path.length - exact).abs() < 1e-15, "{radius}: {} against {exact}", path.length);
        assert!(path.point(Station::default()).norm() < 1e-15, "it begins in the middle of a side");
        let corners = Path::new(&vectors(&SQUARE[1..]), radius, true).unwrap();
        assert!((corners.length - exact).abs() < 1e-15, "{radius}: {} against {exact}", corners.length);
        for station in samples(&path, 1e-4) {
            assert!(off_square(&path.point(station), radius) < 1e-15, "{station:?}");
        }
    }
}

#[test]
fn an_open_path_keeps_its_ends() {
    let points = vectors(&[[0.0, 0.0, 0.0], [0.03, 0.0, 0.0], [0.03, 0.04, 0.0]]);
    let path = Path::new(&points, 0.01, false).unwrap();
    assert!((path.length - (0.02 + 0.03 + 0.5 * PI * 0.01)).abs() < 1e-15);
    let end = path.ahead(Station::default(), 1.0);
    assert!((path.point(end) - points[2]).norm() < 1e-15 && (path.way(end) - path.length).abs() < 1e-15);
    let straight = vectors(&[[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.03, 0.0, 0.0]]);
    assert_eq!(Path::new(&straight, 5.0, false).unwrap().length, 0.03, "without a turn, no corner needs room");
}

#[test]
fn points_that_make_no_path_are_refused() {
    let line = [[0.0, 0.0, 0.0], [0.04, 0.0, 0.0]];
    let cases: [(&str, Vec<[f64; 3]>, bool, Refusal); 7] = [
        ("none", vec![], false, Refusal::TooFew),
        ("one", vec![[0.0; 3]], false, Refusal::TooFew),
        ("a closed line", line.to_vec(), true, Refusal::TooFew),
        ("twice the same", vec![[0.0; 3], [0.0; 3]], false, Refusal::Repeated(0)),
        ("the last is the first", [&SQUARE[..], &SQUARE[..1]].concat(), true, Refusal::Repeated(5)),
        ("there and back", vec![line[0], line[1], line[0]], false, Refusal::TurnsBack(1)),
        ("back at the first", vec![line[0], line[1], [0.04, 0.04, 0.0], [0.02, 0.0, 0.0]], true, Refusal::TurnsBack(0)),
    ];
    for (what, points, is_closed, expected) in cases {
        let found = Path::new(&vectors(&points), 0.001, is_closed);
        assert_eq!(found, Err(expected), "{what}");
    }
}

#[test]
fn the_largest_radius_that_fits_is_named_with_its_corner() {
    // At both ends of a leg of 4 mm, a right angle takes r of the leg: 2 mm fit.
    let points = vectors(&[[0.0, 0.0, 0.0], [0.03, 0.0, 0.0], [0.03, 0.004, 0.0], [0.0, 0.004, 0.0]]);
    let Err(Refusal::Corner { from, leg_m, fits_m, .. }) = Path::new(&points, 0.005, false) else { panic!() };
    assert_eq!(from, 1);
    assert!((leg_m - 0.004).abs() < 1e-15 && (fits_m - 0.002).abs() < 1e-15, "{leg_m} {fits_m}");
    assert!(Path::new(&points, 0.002, false).is_ok() && Path::new(&points, 0.00201, false).is_err());
    // At the end of the path nothing else takes of the leg: tan(45°) r = 4 mm.
    let open = vectors(&[[0.0, 0.0, 0.0], [0.03, 0.0, 0.0], [0.03, 0.004, 0.0]]);
    let Err(Refusal::Corner { from, corner, fits_m, .. }) = Path::new(&open, 0.005, false) else { panic!() };
    assert_eq!((from, corner), (1, 1));
    assert!((fits_m - 0.004).abs() < 1e-15);
}

/// A path without sharp turns, in space.
fn a_path() -> impl Strategy<Value = Path> {
    let turn = prop::array::uniform3(-0.8..0.8_f64);
    prop::collection::vec((turn, 0.02..0.05_f64), 2..8).prop_map(|legs| {
        let mut along = Vector3::x();
        let mut points = vec![Vector3::new(0.1, -0.2, 0.3)];
        for (turn, leg) in legs {
            along = Rotation3::new(Vector3::from(turn)) * along;
            points.push(points[points.len() - 1] + along * leg);
        }
        Path::new(&points, 0.004, false).expect("the corners are gentle and the legs long")
    })
}

proptest! {
    #[test]
    fn the_length_is_that_of_a_fine_polygon_and_the_direction_is_its_slope(path in a_path()) {
        let stations = samples(&path, 1e-4);
        let mut sum = 0.0;
        for pair in stations.windows(2) {
            let way = path.way(pair[1]) - path.way(pair[0]);
            let chord = path.point(pair[1]) - path.point(pair[0]);
            prop_assert!(chord.norm() <= way + 1e-15, "a chord is not longer than its arc");
            prop_assert!((chord - path.direction(pair[0]) * way).norm() < 1e-4 * 1e-4 / 0.004, "{:?}", pair[0]);
            sum += chord.norm();
        }
        // A chord of length c on an arc of radius r is shorter than the arc by c³ / (24 r²).
        prop_assert!((sum - path.length).abs() < 1e-4 * path.length, "{sum} against {}", path.length);
    }

    #[test]
    fn the_closest_point_is_that_of_the_samples(
        path in a_path(), share in 0.0..1.0, ahead in 0.0..0.004, off in prop::array::uniform3(-0.001..0.001),
    ) {
        let from = path.ahead(Station::default(), share * path.length);
        let place = path.point(path.ahead(from, ahead)) + Vector3::from(off);
        let found = path.follow(from, &place);
        let step = 2e-6;
        let nearest = (0..3500).map(|i| path.ahead(from, f64::from(i) * step));
        let nearest = nearest.min_by(|a, b| {
            (path.point(*a) - place).norm().total_cmp(&(path.point(*b) - place).norm())
        }).unwrap();
        let (found_m, nearest_m) = ((path.point(found) - place).norm(), (path.point(nearest) - place).norm());
        prop_assert!(path.way(found) >= path.way(from) - 1e-15);
        let limit = path.way(from) + 0.005;
        if path.way(nearest) <= limit - step {
            prop_assert!(found_m <= nearest_m + 1e-12, "{found_m} against {nearest_m}");
            prop_assert!((path.way(found) - path.way(nearest)).abs() < 1e-4);
        } else {
            prop_assert!(path.way(found) <= limit + 1e-12);
        }
    }

    #[test]
    fn the_profile_keeps_both_accelerations(path in a_path(), a in 0.001..0.1_f64) {
        let profile = Profile::new(&path, a);
        for pair in samples(&path, 1e-4).windows(2) {
            let [v, next] = [profile.speed(&path, pair[0]), profile.speed(&path, pair[1])];
            let way = path.way(pair[1]) - path.way(pair[0]);
            prop_assert!(v * v - next * next <= 2.0 * a * way + 1e-12, "braking from {v} to {next} in {way}");
            let (element, _) = path.rest_of_element(pair[0]);
            let lateral = path.elements()[element].radius().map_or(0.0, |radius| v * v / radius);
            prop_assert!(lateral <= a * (1.0 + 1e-12), "{lateral} across, {a} allowed");
        }
        let end = path.ahead(Station::default(), 10.0);
        prop_assert!(profile.speed(&path, end) < 1e-6);
    }
}

#[test]
fn a_path_that_crosses_itself_is_not_cut_short() {
    // A loop: the last leg crosses the first one at the origin.
    let points =
        vectors(&[[-0.04, 0.0, 0.0], [0.04, 0.0, 0.0], [0.04, 0.04, 0.0], [0.0, 0.04, 0.0], [0.0, -0.04, 0.0]]);
    let path = Path::new(&points, 0.005, false).unwrap();
    let mut station = Station::default();
    let mut way = 0.0;
    for i in 0..=1000 {
        let along = path.ahead(Station::default(), path.length * f64::from(i) / 1000.0);
        let beside = path.point(along) + Vector3::new(3e-4, -2e-4, 0.0);
        station = path.follow(station, &beside);
        assert!(path.way(station) >= way && (path.way(station) - path.way(along)).abs() < 1e-3, "{i}: {station:?}");
        way = path.way(station);
    }
}

#[test]
fn arcs_that_meet_have_no_line_between_them() {
    let mut tried = 0;
    for millimetres in [6.0, 10.0, 20.0, 30.0] {
        for corner in [[-0.02, 0.0, 0.0], [0.4, 0.1, 0.3], [0.123, -0.4, 0.05]] {
            let side: f64 = millimetres * 1e-3;
            let from = Vector3::from(corner);
            let points = [[0.0, 0.0], [side, 0.0], [side, side], [0.0, side]];
            let points = points.map(|[x, y]| from + Vector3::new(x, y, 0.0));
            // Rounding may leave no room for the radius itself.
            let Ok(path) = Path::new(&points, 0.5 * side * (1.0 - 1e-15), true) else { continue };
            let length = 2.0 * std::f64::consts::PI * 0.5 * side;
            assert!((path.length - length).abs() < 1e-9, "{side} m at {from}: {}", path.length);
            for station in samples(&path, 1e-4) {
                let vectors = [path.point(station), path.direction(station), path.curvature(station)];
                assert!(vectors.iter().flatten().all(|value| value.is_finite()), "{side} m at {from}");
            }
            tried += 1;
        }
    }
    assert!(tried >= 4, "{tried} circles");
}
