//! A serial chain of joints: forward kinematics and the spatial Jacobian in one pass.
//!
//! T(q) = F_1 M_1(q_1) … F_n M_n(q_n) F_tip, with fixed transforms F and the motion M of each joint. Column i of the
//! spatial Jacobian is the twist at the origin of the base for unit speed of joint i: `[p x w; w]` for a revolute joint
//! with axis w through p, and `[w; 0]` for a prismatic joint, both in the frame of the base (Lynch and Park, *Modern
//! Robotics*, section
//! 5.1.1). It does not depend on the links after the joint, nor on the mount.
//!
//! Numerics: a joint axis that is not an axis of its frame is rotated onto z, and the rotation is folded into the fixed
//! transforms. So a revolute joint changes two columns of a matrix only. Fixed rotations that are the identity are
//! skipped.

use nalgebra::{IsometryMatrix3, Matrix3, Rotation3, Translation3, Vector3};
use tactflow_runtime::signal::{Joint, Pose, Twist};

/// A serial chain from a base to a sensor.
#[derive(Debug, Clone)]
pub struct Chain {
    joints: Vec<Joint>,
    links: Box<[PreparedSegment]>,
    tip: IsometryMatrix3<f64>,
}

/// The kind of a joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum JointKind {
    /// The joint rotates about its axis.
    Revolute,
    /// The joint slides along its axis.
    Prismatic,
}

/// A joint and the fixed transform before it.
#[derive(Debug, Clone)]
pub struct ChainSegment {
    /// Transform from the frame after the previous joint to the frame of this joint.
    pub fixed: IsometryMatrix3<f64>,
    /// Unit vector of the axis in the frame of the joint.
    pub axis: Vector3<f64>,
    /// Kind of the joint.
    pub motion: JointKind,
    /// Name and limits of the joint.
    pub joint: Joint,
}

/// A segment in the form that [`Chain::forward`] needs.
#[derive(Debug, Clone)]
struct PreparedSegment {
    offset: [f64; 3],
    turn: Option<[[f64; 3]; 3]>,
    motion: JointKind,
    axis: FrameAxis,
    sign: f64,
}

/// An axis of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FrameAxis {
    X,
    Y,
    Z,
}

type Columns = [[f64; 3]; 3];

impl Chain {
    /// Returns the chain of these segments, with the fixed transform `tip` from the last joint to the sensor.
    #[must_use]
    pub fn new(segments: Vec<ChainSegment>, tip: IsometryMatrix3<f64>) -> Self {
        let mut folded = Rotation3::identity();
        let mut links = Vec::new();
        let mut joints = Vec::new();
        for segment in segments {
            let (axis, sign, aligned) = own_axis(&segment.axis);
            let offset = folded.inverse() * segment.fixed.translation.vector;
            let turn = folded.inverse() * segment.fixed.rotation * aligned;
            folded = aligned;
            let turn = (turn != Rotation3::identity()).then(|| (*turn.matrix()).into());
            links.push(PreparedSegment { offset: offset.into(), turn, motion: segment.motion, axis, sign });
            joints.push(segment.joint);
        }
        let back = IsometryMatrix3::from_parts(Translation3::identity(), folded.inverse());
        Self { joints, links: links.into(), tip: back * tip }
    }

    /// Returns the joints from the base to the tip.
    #[must_use]
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// Returns the pose of the sensor in the base at joint positions `q` [rad; m for a prismatic joint], and writes the
    /// columns of the spatial Jacobian.
    ///
    /// # Panics
    /// If `q` or `columns` does not have one entry per joint.
    pub fn forward(&self, q: &[f64], columns: &mut [Twist]) -> Pose {
        assert_eq!((q.len(), columns.len()), (self.links.len(), self.links.len()), "one entry per joint");
        let mut turn: Columns = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut position = [0.0; 3];
        for ((link, q), column) in self.links.iter().zip(q).zip(columns) {
            position = plus(position, times(&turn, link.offset));
            if let Some(fixed) = &link.turn {
                turn = [times(&turn, fixed[0]), times(&turn, fixed[1]), times(&turn, fixed[2])];
            }
            let axis = scaled(turn[link.axis as usize], link.sign);
            match link.motion {
                JointKind::Revolute => {
                    let v = cross(position, axis);
                    column.0 = [v[0], v[1], v[2], axis[0], axis[1], axis[2]].into();
                    let (sin, cos) = libm::sincos(*q);
                    turn = turned(turn, link.axis, link.sign * sin, cos);
                }
                JointKind::Prismatic => {
                    column.0 = [axis[0], axis[1], axis[2], 0.0, 0.0, 0.0].into();
                    position = plus(position, scaled(axis, *q));
                }
            }
        }
        let rotation = Rotation3::from_matrix_unchecked(Matrix3::from(turn));
        Pose(IsometryMatrix3::from_parts(Translation3::from(position), rotation) * self.tip)
    }
}

/// Returns the frame axis that `axis` lies on, its sign and the identity; or z, 1 and a rotation that takes z to
/// `axis`.
fn own_axis(axis: &Vector3<f64>) -> (FrameAxis, f64, Rotation3<f64>) {
    let own = match [axis.x != 0.0, axis.y != 0.0, axis.z != 0.0] {
        [true, false, false] => Some((FrameAxis::X, axis.x)),
        [false, true, false] => Some((FrameAxis::Y, axis.y)),
        [false, false, true] => Some((FrameAxis::Z, axis.z)),
        _ => None,
    };
    if let Some((own, along)) = own {
        return (own, along.signum(), Rotation3::identity());
    }
    // The frame axis furthest from `axis` gives the best conditioned cross product.
    let away = if axis.x.abs() <= axis.y.abs().min(axis.z.abs()) {
        Vector3::x()
    } else if axis.y.abs() <= axis.z.abs() {
        Vector3::y()
    } else {
        Vector3::z()
    };
    let y = axis.cross(&away).normalize();
    let basis = Matrix3::from_columns(&[y.cross(axis), y, *axis]);
    (FrameAxis::Z, 1.0, Rotation3::from_matrix_unchecked(basis))
}

#[inline]
fn plus(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline]
fn scaled(a: [f64; 3], by: f64) -> [f64; 3] {
    [a[0] * by, a[1] * by, a[2] * by]
}

#[inline]
fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[inline]
fn times(m: &Columns, v: [f64; 3]) -> [f64; 3] {
    let mut out = [0.0; 3];
    for i in 0..3 {
        out[i] = m[0][i] * v[0] + m[1][i] * v[1] + m[2][i] * v[2];
    }
    out
}

/// Returns `m` rotated about one of its own axes.
#[inline]
fn turned([x, y, z]: Columns, axis: FrameAxis, sin: f64, cos: f64) -> Columns {
    let mix = |a: [f64; 3], b: [f64; 3]| (plus(scaled(a, cos), scaled(b, sin)), plus(scaled(b, cos), scaled(a, -sin)));
    match axis {
        FrameAxis::X => {
            let (y, z) = mix(y, z);
            [x, y, z]
        }
        FrameAxis::Y => {
            let (z, x) = mix(z, x);
            [x, y, z]
        }
        FrameAxis::Z => {
            let (x, y) = mix(x, y);
            [x, y, z]
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{Matrix4, Unit};
    use proptest::prelude::*;

    use super::*;

    fn segment(xyz: [f64; 3], rpy: [f64; 3], axis: [f64; 3], motion: JointKind) -> ChainSegment {
        let fixed = crate::motion::pose::pose_of(xyz, rpy);
        ChainSegment { fixed, axis: Vector3::from(axis).normalize(), motion, joint: Joint::default() }
    }

    /// Returns T(q) as the product of the transforms of nalgebra.
    fn product(segments: &[ChainSegment], tip: &IsometryMatrix3<f64>, q: &[f64]) -> IsometryMatrix3<f64> {
        let mut pose = IsometryMatrix3::identity();
        for (segment, q) in segments.iter().zip(q) {
            let moved = match segment.motion {
                JointKind::Revolute => {
                    let turn = Rotation3::from_axis_angle(&Unit::new_unchecked(segment.axis), *q);
                    IsometryMatrix3::from_parts(Translation3::identity(), turn)
                }
                JointKind::Prismatic => {
                    IsometryMatrix3::from_parts(Translation3::from(segment.axis * *q), Rotation3::identity())
                }
            };
            pose = pose * segment.fixed * moved;
        }
        pose * tip
    }

    /// Returns the spatial twist of (dT/dq_i) T^-1 by central differences.
    fn difference(chain: &Chain, q: &[f64], i: usize) -> Twist {
        const STEP: f64 = 1e-6;
        let mut columns = vec![Twist::default(); q.len()];
        let mut at = |by: f64| {
            let mut q = q.to_vec();
            q[i] += by;
            chain.forward(&q, &mut columns).0.to_homogeneous()
        };
        let rate: Matrix4<f64> = (at(STEP) - at(-STEP)) / (2.0 * STEP);
        let twist = rate * at(0.0).try_inverse().unwrap();
        let linear = Vector3::new(twist[(0, 3)], twist[(1, 3)], twist[(2, 3)]);
        Twist::new(linear, Vector3::new(twist[(2, 1)], twist[(0, 2)], twist[(1, 0)]))
    }

    fn any_segment() -> impl Strategy<Value = ChainSegment> {
        let three = || prop::array::uniform3(-1.0..1.0f64);
        let axes = vec![[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, 0.0, -3.0]];
        let skew = three().prop_filter("an axis", |axis| Vector3::from(*axis).norm() > 0.1);
        let turn = prop_oneof![Just([0.0; 3]), three()];
        let motion = prop_oneof![3 => Just(JointKind::Revolute), 1 => Just(JointKind::Prismatic)];
        (three(), turn, prop_oneof![prop::sample::select(axes), skew], motion)
            .prop_map(|(xyz, rpy, axis, motion)| segment(xyz, rpy, axis, motion))
    }

    proptest! {
        #[test]
        fn any_chain_agrees_with_the_product_of_transforms(
            segments in prop::collection::vec(any_segment(), 1..9),
            q in prop::array::uniform8(-3.0..3.0f64),
            tip in prop::array::uniform6(-1.0..1.0f64),
        ) {
            let q = &q[..segments.len()];
            let tip = crate::motion::pose::pose_of([tip[0], tip[1], tip[2]], [tip[3], tip[4], tip[5]]);
            let chain = Chain::new(segments.clone(), tip);
            let mut columns = vec![Twist::default(); q.len()];
            let pose = chain.forward(q, &mut columns).0.to_homogeneous();
            prop_assert!((pose - product(&segments, &tip, q).to_homogeneous()).norm() < 1e-12);
            for (i, column) in columns.iter().enumerate() {
                prop_assert!((column.0 - difference(&chain, q, i).0).norm() < 1e-7, "column {}", i);
            }
        }
    }

    #[test]
    fn a_skew_axis_is_the_z_of_its_basis() {
        for axis in [[1.0, 2.0, 3.0], [3.0, -1.0, 2.0], [1e-9, 1.0, 0.0], [-1.0, -1.0, -1.0]] {
            let axis = Vector3::from(axis).normalize();
            let (own, sign, basis) = own_axis(&axis);
            assert_eq!((own, sign), (FrameAxis::Z, 1.0));
            assert!((basis * Vector3::z() - axis).norm() < 1e-15);
            assert!((basis.matrix().determinant() - 1.0).abs() < 1e-14);
        }
    }

    #[test]
    #[should_panic(expected = "one entry per joint")]
    fn too_few_positions_panic() {
        let chain =
            Chain::new(vec![segment([0.0; 3], [0.0; 3], [1.0, 0.0, 0.0], JointKind::Revolute)], Default::default());
        chain.forward(&[], &mut [Twist::default()]);
    }
}
