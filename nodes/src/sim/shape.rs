//! Geometry of objects, in their own frames. Every query is answered by `parry3d`.
//!
//! An ellipsoid is a unit ball in scaled space: a ray in unscaled space hits it after the same time, and normals scale
//! inversely. A cable is a chain of capsules along a spline.

use parry3d_f64::math::{Pose3, Rot3, Vec3};
use parry3d_f64::query::{PointQuery, PointQueryWithLocation, Ray, RayCast};
use parry3d_f64::shape::{Ball, Capsule, Compound, Cuboid, Cylinder, HalfSpace, Polyline, Shape, SharedShape, TriMesh};
use tactflow_runtime::signal::Pose;

/// The geometry of an object, in its own frame [m].
pub enum Geometry {
    /// The half space z >= 0; the sensor touches it along its z.
    Plane(HalfSpace),
    /// A ball centred at the origin.
    Ball(Ball),
    /// A box centred at the origin, with edges along the axes.
    Box(Cuboid),
    /// A cylinder with round ends along y, centred at the origin.
    Pen(Capsule),
    /// A cylinder with sharp rims along y, centred at the origin.
    Disc(Cylinder),
    /// An ellipsoid centred at the origin.
    Ellipsoid(Ellipsoid),
    /// A round cable.
    Cable(Cable),
}

/// An ellipsoid with its half axes.
pub struct Ellipsoid {
    axes: Vec3,
    /// For distances, which cannot be computed in unscaled space.
    mesh: TriMesh,
}

/// A chain of capsules.
pub struct Cable {
    capsules: Compound,
    line: Polyline,
    /// Directions of the curve at the corners of the line.
    along: Vec<Vec3>,
    radius: f64,
}

/// The point where a ray hits an object.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Hit {
    /// Distance along the ray, in lengths of its direction.
    pub time: f64,
    /// Outward unit normal of the object.
    pub normal: Vec3,
}

/// The line of an object: the axis of a pen, an edge of a box, a rim of a disc, the course of a cable.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObjectLine {
    /// Nearest point of the line.
    pub at: Vec3,
    /// Unit vector along the line at that point, in either direction.
    pub along: Vec3,
}

impl Geometry {
    /// Returns a half space whose outward normal is -z.
    #[must_use]
    pub fn plane() -> Self {
        Self::Plane(HalfSpace::new(-Vec3::Z))
    }

    /// Returns a cylinder with round ends, with a `length` between the centres of its ends [m].
    #[must_use]
    pub fn pen(radius: f64, length: f64) -> Self {
        let half = Vec3::new(0.0, length / 2.0, 0.0);
        Self::Pen(Capsule::new(-half, half, radius))
    }

    /// Returns an ellipsoid with these half axes [m].
    #[must_use]
    pub fn ellipsoid(axes: [f64; 3]) -> Self {
        // 96 x 48 facets: the error is 0.03 mm for half axes of 0.1 m.
        let (points, faces) = Ball::new(1.0).to_trimesh(96, 48);
        let axes = Vec3::from(axes);
        let points = points.into_iter().map(|point| point * axes).collect();
        let mesh = TriMesh::new(points, faces).expect("a ball has faces");
        Self::Ellipsoid(Ellipsoid { axes, mesh })
    }

    /// Returns a cable along a smooth curve through `points` [m].
    #[must_use]
    pub fn cable(radius: f64, points: &[[f64; 3]]) -> Self {
        let (points, along): (Vec<Vec3>, Vec<Vec3>) = smooth(points).into_iter().unzip();
        let capsule = |ends: &[Vec3]| (Pose3::IDENTITY, SharedShape::capsule(ends[0], ends[1], radius));
        let capsules = Compound::new(points.windows(2).map(capsule).collect());
        Self::Cable(Cable { capsules, line: Polyline::new(points, None), along, radius })
    }

    /// Returns the solid of the geometry library; an ellipsoid is a mesh.
    fn solid(&self) -> &dyn Shape {
        match self {
            Self::Plane(shape) => shape,
            Self::Ball(shape) => shape,
            Self::Box(shape) => shape,
            Self::Pen(shape) => shape,
            Self::Disc(shape) => shape,
            Self::Ellipsoid(Ellipsoid { mesh, .. }) => mesh,
            Self::Cable(cable) => &cable.capsules,
        }
    }

    /// Returns the first hit of a ray from outside, within `max_time` lengths of its direction.
    #[must_use]
    pub fn cast(&self, origin: Vec3, direction: Vec3, max_time: f64) -> Option<Hit> {
        let ray = Ray::new(origin, direction);
        let hit = match self {
            Self::Ellipsoid(Ellipsoid { axes, .. }) => {
                let ray = Ray::new(origin / *axes, direction / *axes);
                Ball::new(1.0).cast_local_ray_and_get_normal(&ray, max_time, true)
            }
            _ => self.solid().cast_local_ray_and_get_normal(&ray, max_time, true),
        }?;
        let normal = match self {
            Self::Ellipsoid(Ellipsoid { axes, .. }) => (hit.normal / *axes).normalize_or_zero(),
            _ => hit.normal,
        };
        // A ray that starts inside has no normal.
        let normal = if hit.time_of_impact > 0.0 { normal } else { -direction.normalize_or_zero() };
        Some(Hit { time: hit.time_of_impact, normal })
    }

    /// Returns a lower bound of the distance from a point to the object [m]; 0 inside.
    #[must_use]
    pub fn clearance(&self, point: Vec3) -> f64 {
        match self {
            Self::Cable(cable) => cable.line.distance_to_local_point(point, false) - cable.radius,
            Self::Ellipsoid(Ellipsoid { axes, .. }) => {
                Ball::new(1.0).distance_to_local_point(point / *axes, true) * axes.min_element()
            }
            _ => self.solid().distance_to_local_point(point, true),
        }
    }

    /// Returns the distance from a point to the surface, on either side [m].
    #[must_use]
    pub fn distance(&self, point: Vec3) -> f64 {
        match self {
            Self::Cable(_) => self.clearance(point).abs(),
            _ => self.solid().distance_to_local_point(point, false).abs(),
        }
    }

    /// Returns the distance from a point to the surface, which is negative inside [m], and the outward normal there.
    #[must_use]
    pub fn signed(&self, point: Vec3) -> (f64, Vec3) {
        let near = self.solid().project_local_point(point, false);
        let (way, sign) = (point - near.point, if near.is_inside { -1.0 } else { 1.0 });
        (sign * way.length(), sign * way.normalize_or_zero())
    }

    /// Returns the line of the object nearest to a point, or `None` if the object has no line.
    #[must_use]
    pub fn line(&self, point: Vec3) -> Option<ObjectLine> {
        match self {
            Self::Plane(_) | Self::Ball(_) | Self::Ellipsoid(_) => None,
            Self::Box(shape) => Some(edge(shape.half_extents, point)),
            Self::Pen(shape) => {
                let at = shape.segment.project_local_point(point, true).point;
                Some(ObjectLine { at, along: Vec3::Y })
            }
            Self::Disc(shape) => Some(rim(shape, point)),
            Self::Cable(cable) => {
                let (projected, (segment, place)) = cable.line.project_local_point_and_get_location(point, true);
                // The directions of the pieces would jump by 4 degrees in a bend of 44 mm radius.
                let [from, to] = cable.line.indices()[segment as usize].map(|end| cable.along[end as usize]);
                let [before, after] = place.barycentric_coordinates();
                Some(ObjectLine { at: projected.point, along: (from * before + to * after).normalize_or_zero() })
            }
        }
    }
}

/// Returns the edge of a box nearest to a point.
fn edge(half: Vec3, point: Vec3) -> ObjectLine {
    let edges = (0..3).flat_map(|axis| (0..4).map(move |corner| (axis, corner)));
    let lines = edges.map(|(axis, corner)| {
        let mut at = half;
        let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
        at[u] *= if corner & 1 == 0 { 1.0 } else { -1.0 };
        at[v] *= if corner & 2 == 0 { 1.0 } else { -1.0 };
        at[axis] = point[axis].clamp(-half[axis], half[axis]);
        let mut along = Vec3::ZERO;
        along[axis] = 1.0;
        ObjectLine { at, along }
    });
    lines.min_by(|a, b| a.at.distance(point).total_cmp(&b.at.distance(point))).expect("a box has edges")
}

/// Returns the rim of a disc nearest to a point, with its tangent there.
fn rim(disc: &Cylinder, point: Vec3) -> ObjectLine {
    let away = Vec3::new(point.x, 0.0, point.z).try_normalize().unwrap_or(Vec3::X);
    let at = away * disc.radius + Vec3::Y * disc.half_height.copysign(point.y);
    ObjectLine { at, along: Vec3::Y.cross(away) }
}

/// Returns the corners of a polyline along the Catmull-Rom spline through `points`, and the direction of the spline at
/// each.
fn smooth(points: &[[f64; 3]]) -> Vec<(Vec3, Vec3)> {
    /// Segments of the polyline between two points.
    const PIECES: usize = 8;
    let points: Vec<Vec3> = points.iter().copied().map(Vec3::from).collect();
    let last = points.len() - 1;
    let mut curve = vec![(points[0], (points[1] - points[0]).normalize_or_zero())];
    for i in 0..last {
        let (before, from) = (points[i.saturating_sub(1)], points[i]);
        let (to, after) = (points[i + 1], points[(i + 2).min(last)]);
        let (start, end) = ((to - before) / 2.0, (after - from) / 2.0);
        for piece in 1..=PIECES {
            let t = piece as f64 / PIECES as f64;
            let (t2, t3) = (t * t, t * t * t);
            let (h0, h1) = (2.0 * t3 - 3.0 * t2 + 1.0, t3 - 2.0 * t2 + t);
            let (h2, h3) = (3.0 * t2 - 2.0 * t3, t3 - t2);
            let (d0, d1, d3) = (6.0 * t2 - 6.0 * t, 3.0 * t2 - 4.0 * t + 1.0, 3.0 * t2 - 2.0 * t);
            let along = (from - to) * d0 + start * d1 + end * d3;
            curve.push((from * h0 + start * h1 + to * h2 + end * h3, along.normalize_or_zero()));
        }
    }
    curve
}

/// Converts a pose of the runtime to one of the geometry library.
#[must_use]
pub fn pose3(pose: &Pose) -> Pose3 {
    let quaternion = nalgebra::UnitQuaternion::from_rotation_matrix(&pose.0.rotation);
    let rotation = Rot3::from_xyzw(quaternion.i, quaternion.j, quaternion.k, quaternion.w);
    Pose3::from_parts(Vec3::from(<[f64; 3]>::from(pose.0.translation.vector)), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn v(x: f64, y: f64, z: f64) -> Vec3 {
        Vec3::new(x, y, z)
    }

    #[test]
    fn rays_along_z_hit_each_shape_as_its_equation_predicts() {
        let cable = Geometry::cable(0.003, &[[0.0, -0.1, 0.0], [0.0, 0.0, 0.0], [0.0, 0.1, 0.0]]);
        let cases = [
            (Geometry::plane(), v(0.01, 0.02, -0.05), 0.05, v(0.0, 0.0, -1.0)),
            (Geometry::Ball(Ball::new(0.05)), v(0.03, 0.0, -0.1), 0.06, v(0.6, 0.0, -0.8)),
            (Geometry::Box(Cuboid::new(v(0.1, 0.1, 0.02))), v(0.05, -0.05, -0.05), 0.03, v(0.0, 0.0, -1.0)),
            (Geometry::pen(0.005, 0.1), v(0.003, 0.02, -0.05), 0.046, v(0.6, 0.0, -0.8)),
            (Geometry::Disc(Cylinder::new(0.02, 0.05)), v(0.03, 0.01, -0.1), 0.06, v(0.6, 0.0, -0.8)),
            (cable, v(0.0018, 0.02, -0.05), 0.0476, v(0.6, 0.0, -0.8)),
        ];
        for (shape, origin, time, normal) in cases {
            let hit = shape.cast(origin, Vec3::Z, 1.0).unwrap();
            assert!((hit.time - time).abs() < 1e-9, "{hit:?}");
            // The library finds a cylinder by iteration.
            let within = if matches!(shape, Geometry::Disc(_)) { 1e-4 } else { 1e-6 };
            assert!(hit.normal.distance(normal) < within, "{hit:?}");
            assert_eq!(shape.cast(origin, -Vec3::Z, 1.0), None);
            assert_eq!(shape.cast(origin, Vec3::Z, 0.9 * time), None, "beyond the range of the ray");
        }
    }

    #[test]
    fn a_ray_hits_an_ellipsoid_on_its_surface_with_its_gradient_as_normal() {
        let axes = [0.08, 0.05, 0.03];
        let shape = Geometry::ellipsoid(axes);
        for (x, y) in [(0.0, 0.0), (0.03, 0.01), (-0.05, 0.02), (0.0, -0.04)] {
            let z = -axes[2] * (1.0 - (x / axes[0]).powi(2) - (y / axes[1]).powi(2)).sqrt();
            let hit = shape.cast(v(x, y, -0.1), Vec3::Z, 1.0).unwrap();
            assert!((hit.time - (z + 0.1)).abs() < 1e-12, "{hit:?}");
            let gradient = v(x / axes[0].powi(2), y / axes[1].powi(2), z / axes[2].powi(2)).normalize();
            assert!(hit.normal.distance(gradient) < 1e-9, "{hit:?}");
            assert!(shape.distance(v(x, y, z)) < 1e-4, "{}", shape.distance(v(x, y, z)));
            assert!((shape.distance(v(x, y, z) + gradient * 0.01) - 0.01).abs() < 1e-4);
        }
    }

    #[test]
    fn clearance_is_a_lower_bound_of_the_distance() {
        let shapes = [
            Geometry::plane(),
            Geometry::Ball(Ball::new(0.05)),
            Geometry::Box(Cuboid::new(v(0.1, 0.1, 0.02))),
            Geometry::pen(0.005, 0.1),
            Geometry::Disc(Cylinder::new(0.02, 0.05)),
            Geometry::ellipsoid([0.08, 0.05, 0.03]),
            Geometry::cable(0.003, &[[0.0, -0.1, 0.0], [0.02, 0.0, 0.0], [0.0, 0.1, 0.0]]),
        ];
        for shape in &shapes {
            for i in 0..1000 {
                let t = f64::from(i);
                let point = v(0.15 * (t * 0.7).sin(), 0.15 * (t * 1.3).cos(), -0.1 - 0.05 * (t * 2.1).sin());
                assert!(shape.clearance(point) <= shape.distance(point) + 1e-4);
            }
        }
    }

    #[test]
    fn pens_boxes_discs_and_cables_have_lines() {
        let pen = Geometry::pen(0.005, 0.1);
        let line = pen.line(v(0.01, 0.02, -0.01)).unwrap();
        assert!(line.at.distance(v(0.0, 0.02, 0.0)) < 1e-12 && line.along == Vec3::Y, "{line:?}");
        let block = Geometry::Box(Cuboid::new(v(0.1, 0.1, 0.02)));
        let line = block.line(v(0.08, 0.03, -0.03)).unwrap();
        assert_eq!((line.at, line.along), (v(0.1, 0.03, -0.02), Vec3::Y));
        let disc = Geometry::Disc(Cylinder::new(0.02, 0.05));
        let line = disc.line(v(0.04, -0.01, -0.03)).unwrap();
        assert!(
            line.at.distance(v(0.04, -0.02, -0.03)) < 1e-12 && line.along.distance(v(-0.6, 0.0, -0.8)) < 1e-12,
            "{line:?}"
        );
        let circle: Vec<[f64; 3]> =
            (0..=20).map(|i| f64::from(i) * 0.05).map(|a| [0.2 * a.sin(), -0.2 * a.cos(), 0.0]).collect();
        let cable = Geometry::cable(0.003, &circle);
        let line = cable.line(v(0.1, -0.15, 0.01)).unwrap();
        assert!((line.at.length() - 0.2).abs() < 2e-5, "{line:?}");
        for i in 0..100 {
            let angle = 0.3 + 0.001 * f64::from(i);
            let line = cable.line(v(0.19 * angle.sin(), -0.19 * angle.cos(), 0.01)).unwrap();
            assert!(line.along.dot(line.at.normalize()).abs() < 1e-3, "{line:?}");
        }
        assert_eq!(Geometry::plane().line(Vec3::ZERO), None);
    }
}
