//! The result against the conditions of Karush, Kuhn and Tucker, which only the minimum of a convex problem meets.

use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

use super::*;

const DAMPING: f64 = 0.01;

/// A problem: the columns of the Jacobian, the twist, the intervals and the centre.
#[derive(Debug, Clone)]
struct Case {
    columns: Vec<[f64; 6]>,
    twist: [f64; 6],
    intervals: Vec<Interval>,
    centre: Vec<f64>,
}

fn solved(case: &Case) -> DVector<f64> {
    let mut velocity = case.centre.clone();
    LeastLost::new(velocity.len()).solve(&case.columns, &case.twist, &case.intervals, DAMPING, &mut velocity);
    DVector::from_vec(velocity)
}

/// The slope of the objective, and the row of the push.
fn slopes(case: &Case, velocity: &DVector<f64>) -> (DVector<f64>, DVector<f64>) {
    let weight = |i: usize| if i < 3 { 1.0 } else { LEVER };
    let count = case.columns.len();
    let jacobian = DMatrix::from_fn(6, count, |i, j| weight(i) * case.columns[j][i]);
    let twist = DVector::from_fn(6, |i, _| weight(i) * case.twist[i]);
    let centre = DVector::from_column_slice(&case.centre);
    let slope = jacobian.transpose() * (&jacobian * velocity - twist) + (velocity - centre) * (DAMPING * DAMPING);
    (slope, jacobian.row(PUSH).transpose())
}

fn any_case() -> impl Strategy<Value = Case> {
    let joint = (prop::array::uniform6(-1.0..1.0f64), 0.0..2.0f64, 0.0..2.0f64, -2.0..2.0f64, 0..4u8);
    let joints = prop::collection::vec(joint, 1..10);
    (joints, prop::array::uniform6(-1.0..1.0f64), any::<bool>(), any::<bool>()).prop_map(
        |(joints, mut twist, is_slide, is_singular)| {
            if is_slide {
                twist[PUSH] = 0.0;
            }
            let columns = joints.iter().map(|(column, ..)| {
                let [a, b, c, d, e, f] = *column;
                if is_singular { [a, b, a - b, d, e, d] } else { [a, b, c, d, e, f] }
            });
            // Every fourth joint is at its limit.
            let room = |kind: u8, room: f64| if kind == 0 { 0.0 } else { room };
            Case {
                columns: columns.collect(),
                twist,
                intervals: joints.iter().map(|(_, min, max, _, kind)| (-room(*kind, *min), *max)).collect(),
                centre: joints.iter().map(|(.., centre, _)| *centre).collect(),
            }
        },
    )
}

proptest! {
    #[test]
    fn the_result_is_the_minimum_within_the_constraints(case in any_case()) {
        let velocity = solved(&case);
        let (slope, row) = slopes(&case, &velocity);
        let push = row.dot(&velocity);
        let (least, most) = (case.twist[PUSH].min(0.0), case.twist[PUSH].max(0.0));
        prop_assert!(push > least - 1e-9 && push < most + 1e-9, "{} not in {}..{}", push, least, most);
        // The multiplier of the push is the one that a free joint needs; without one it is any that fits.
        let room = |i: usize| {
            let ((min, max), v) = (case.intervals[i], velocity[i]);
            (v - min, max - v)
        };
        let is_free = |i: usize| room(i).0 > 1e-9 && room(i).1 > 1e-9;
        let count = case.columns.len();
        let strongest = (0..count).filter(|i| is_free(*i)).max_by(|i, j| row[*i].abs().total_cmp(&row[*j].abs()));
        let multiplier = match strongest {
            Some(i) if row[i].abs() > 1e-9 => -slope[i] / row[i],
            _ => return Ok(()),
        };
        if push > least + 1e-9 {
            prop_assert!(multiplier > -1e-8, "held below: {}", multiplier);
        }
        if push < most - 1e-9 {
            prop_assert!(multiplier < 1e-8, "held above: {}", multiplier);
        }
        for i in 0..count {
            let ((below, above), growth) = (room(i), slope[i] + multiplier * row[i]);
            prop_assert!(below >= 0.0 && above >= 0.0, "joint {} is outside: {} and {}", i, below, above);
            prop_assert!(below < 1e-9 || growth < 1e-8 / row[strongest.unwrap()].abs(), "joint {}: {}", i, growth);
            prop_assert!(above < 1e-9 || growth > -1e-8 / row[strongest.unwrap()].abs(), "joint {}: {}", i, growth);
        }
    }

    #[test]
    fn a_small_change_changes_the_velocities_little(
        case in any_case(), change in prop::collection::vec(-1e-10..1e-10f64, 10), twist in prop::array::uniform6(-1e-10..1e-10f64),
    ) {
        let push: f64 = case.columns.iter().map(|column| column[PUSH] * column[PUSH]).sum();
        prop_assume!(push > 0.01);
        let mut near = case.clone();
        near.centre.iter_mut().zip(change).for_each(|(centre, change)| *centre += change);
        near.twist.iter_mut().zip(twist).for_each(|(entry, change)| *entry += change);
        // A strictly convex problem with the damping eps² amplifies a change of its linear term by 1/eps² at most.
        let off = (solved(&case) - solved(&near)).norm();
        prop_assert!(off < 1e-10 * 20.0 / (DAMPING * DAMPING), "{}", off);
    }
}

fn diagonal(values: [f64; 6]) -> Vec<[f64; 6]> {
    (0..6).map(|i| std::array::from_fn(|j| if i == j { values[i] } else { 0.0 })).collect()
}

#[test]
fn within_the_limits_nothing_is_lost() {
    let case = Case {
        columns: diagonal([0.5; 6]),
        twist: [0.1, -0.2, 0.3, -0.1, 0.2, -0.3],
        intervals: vec![(-1.0, 1.0); 6],
        centre: vec![0.2, -0.4, 0.6, -0.2, 0.4, -0.6],
    };
    let off = solved(&case) - DVector::from_column_slice(&case.centre);
    assert!(off.norm() < 1e-12, "{off}");
}

#[test]
fn a_joint_at_its_limit_stops_only_its_own_part() {
    let mut case = Case {
        columns: diagonal([1.0; 6]),
        twist: [0.5, 0.5, 0.0, 0.0, 0.0, 0.0],
        intervals: vec![(-1.0, 1.0); 6],
        centre: vec![0.5, 0.5, 0.0, 0.0, 0.0, 0.0],
    };
    case.intervals[0] = (-1.0, 0.0);
    assert!((solved(&case) - DVector::from_column_slice(&[0.0, 0.5, 0.0, 0.0, 0.0, 0.0])).norm() < 1e-15);
}

#[test]
fn a_slide_stops_rather_than_push_where_its_plane_is_lost() {
    // Only motions along (1, 0, 1) are left of the plane of x and z.
    let mut columns = diagonal([0.3; 6]);
    columns[0] = [0.3, 0.0, 0.3, 0.0, 0.0, 0.0];
    columns[2] = [0.0; 6];
    let (intervals, centre) = (vec![(-1.0, 1.0); 6], vec![0.2, 0.0, 0.0, 0.0, 0.0, 0.0]);
    let case = Case { columns, twist: [0.1, 0.0, 0.0, 0.0, 0.0, 0.0], intervals, centre };
    assert!(solved(&case).norm() < 1e-12, "{}", solved(&case));
    // A twist that pushes as much as it slides is followed.
    let twist = [0.1, 0.0, 0.1, 0.0, 0.0, 0.0];
    assert!((solved(&Case { twist, ..case })[0] - 1.0 / 3.0).abs() < 1e-3);
}

#[test]
fn an_input_that_is_nan_ends() {
    let case = Case {
        columns: vec![[f64::NAN; 6]; 7],
        twist: [1.0; 6],
        intervals: vec![(-1.0, 1.0); 7],
        centre: vec![0.0; 7],
    };
    assert_eq!(solved(&case).len(), 7);
}
