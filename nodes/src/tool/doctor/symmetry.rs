//! The symmetry between where the corners of a pad are and where they are felt.

use nalgebra::{Matrix3, Rotation3};

use crate::devices::stream::Turn;

/// The corners of a pad as the signs of their x and y, counterclockwise.
pub(super) const CORNERS: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];

/// Distance from the middle of an axis from which a touch is in a corner, as a part of half the pad.
const MIN_OUT: f64 = 0.2;

/// A symmetry of a rectangle: it maps the true place of a touch to the place in the image, in x and y.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Symmetry([[i8; 2]; 2]);

impl Symmetry {
    pub(super) const IDENTITY: Self = Self([[1, 0], [0, 1]]);

    /// All eight symmetries.
    pub(super) fn all() -> impl Iterator<Item = Self> {
        let signs = [[1, 1], [-1, 1], [1, -1], [-1, -1]];
        signs.into_iter().flat_map(|[x, y]| [Self([[x, 0], [0, y]]), Self([[0, x], [y, 0]])])
    }

    /// Returns the symmetry that maps each of the [`CORNERS`] to where it was felt, in halves of the pad from its middle;
    /// `None` if there is none.
    pub(super) fn of(felt: &[[f64; 2]; 4]) -> Option<Self> {
        Self::all().find(|symmetry| {
            CORNERS.iter().zip(felt).all(|(corner, felt)| {
                let there = symmetry.apply(*corner);
                (0..2).all(|axis| there[axis] * felt[axis] >= MIN_OUT)
            })
        })
    }

    /// Returns where a place is mapped to.
    pub(super) fn apply(self, [x, y]: [f64; 2]) -> [f64; 2] {
        self.0.map(|[a, b]| f64::from(a) * x + f64::from(b) * y)
    }

    /// Returns the symmetry after which `next` is applied.
    pub(super) fn then(self, next: Self) -> Self {
        let Self(first) = self;
        Self(next.0.map(|[a, b]| [0, 1].map(|column| a * first[0][column] + b * first[1][column])))
    }

    pub(super) const fn inverse(self) -> Self {
        let Self([[a, b], [c, d]]) = self;
        Self([[a, c], [b, d]])
    }

    /// Whether it turns a right hand into a left one: no rotation of the pad does.
    pub(super) const fn is_mirrored(self) -> bool {
        let Self([[a, b], [c, d]]) = self;
        a * d - b * c < 0
    }

    /// Returns the rotation that maps x and y in the same way. It turns z around if the symmetry mirrors.
    pub(super) fn rotation(self) -> Rotation3<f64> {
        let Self([[a, b], [c, d]]) = self;
        let [xx, xy, yx, yy, zz] = [a, b, c, d, a * d - b * c].map(f64::from);
        Rotation3::from_matrix_unchecked(Matrix3::new(xx, xy, 0.0, yx, yy, 0.0, 0.0, 0.0, zz))
    }

    /// Returns what a turn of an image does.
    pub(super) const fn of_turn(turn: Turn) -> Self {
        Self(match turn {
            Turn::Transpose => [[0, 1], [1, 0]],
            Turn::FlipX => [[-1, 0], [0, 1]],
            Turn::FlipY => [[1, 0], [0, -1]],
            Turn::Rot90 => [[0, -1], [1, 0]],
        })
    }

    /// Returns the shortest list of turns that does the same.
    pub(super) fn turns(self) -> Vec<Turn> {
        let pairs = Turn::ALL.iter().flat_map(|first| Turn::ALL.iter().map(|second| vec![*first, *second]));
        let lists = std::iter::once(Vec::new()).chain(Turn::ALL.iter().map(|turn| vec![*turn])).chain(pairs);
        let mut lists = lists.filter(|list| Self::of_turns(list) == self);
        lists.next().expect("two turns make every symmetry")
    }

    /// Returns what turns do one after the other.
    pub(super) fn of_turns(turns: &[Turn]) -> Self {
        turns.iter().fold(Self::IDENTITY, |before, turn| before.then(Self::of_turn(*turn)))
    }

    /// Says what is wrong with an image.
    pub(super) const fn fault(self) -> &'static str {
        match self.0 {
            [[1, _], [_, 1]] => "nothing is wrong",
            [[-1, _], [_, 1]] => "x is flipped",
            [[1, _], [_, -1]] => "y is flipped",
            [[-1, _], [_, -1]] => "the image is turned by 180°",
            [[_, 1], [1, _]] => "x and y are swapped",
            [[_, -1], [-1, _]] => "x and y are swapped and flipped",
            [[_, -1], [1, _]] => "the image is turned by 90° counterclockwise",
            _ => "the image is turned by 90° clockwise",
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::devices::stream::Grid;

    fn any_symmetry() -> impl Strategy<Value = Symmetry> {
        prop::sample::select(Symmetry::all().collect::<Vec<_>>())
    }

    fn any_turns() -> impl Strategy<Value = Vec<Turn>> {
        prop::collection::vec(prop::sample::select(Turn::ALL.to_vec()), 0..4)
    }

    /// Where the image of a grid has a cell of the frame, in halves of the image from its middle.
    fn place_of(cell: usize, grid: &Grid) -> [f64; 2] {
        let at = grid.places.iter().position(|place| *place == cell).expect("every cell has its place");
        let half = |at: usize, count: usize| 2.0 * at as f64 / (count - 1) as f64 - 1.0;
        [half(at % grid.cols, grid.cols), half(at / grid.cols, grid.rows)]
    }

    fn grid(rows: usize, cols: usize, turns: &[Turn]) -> Grid {
        turns.iter().fold(Grid::new(rows, cols), |grid, turn| grid.turned(*turn))
    }

    proptest! {
        #[test]
        fn every_symmetry_is_recognized_by_corners_that_are_not_exact(
            symmetry in any_symmetry(),
            off in prop::array::uniform4(prop::array::uniform2(-0.25..0.25_f64)),
        ) {
            // Nobody presses the last tactel.
            let pressed = |i: usize| [0, 1].map(|axis| 0.7 * CORNERS[i][axis] + off[i][axis]);
            let felt = [0, 1, 2, 3].map(|i| symmetry.apply(pressed(i)));
            prop_assert_eq!(Symmetry::of(&felt), Some(symmetry));
        }

        #[test]
        fn the_new_order_puts_every_corner_where_it_is(
            (rows, cols) in (2..6_usize, 2..6_usize), old in any_turns(), symmetry in any_symmetry(),
        ) {
            let before = grid(rows, cols, &old);
            let new = Symmetry::of_turns(&old).then(symmetry.inverse()).turns();
            let after = grid(rows, cols, &new);
            prop_assert!(new.len() <= 2);
            for corner in CORNERS {
                // The cell of the frame that shows the corner now.
                let cell = (0..rows * cols).find(|cell| place_of(*cell, &before) == symmetry.apply(corner));
                prop_assert_eq!(place_of(cell.expect("a corner has a cell"), &after), corner);
            }
        }

        #[test]
        fn turns_do_to_a_grid_what_they_do_to_places(
            (rows, cols) in (2..6_usize, 2..6_usize), turns in any_turns(), cell in 0..4_usize,
        ) {
            let (before, after) = (Grid::new(rows, cols), grid(rows, cols, &turns));
            let [there, expected] = [place_of(cell, &after), Symmetry::of_turns(&turns).apply(place_of(cell, &before))];
            prop_assert!((0..2).all(|axis| (there[axis] - expected[axis]).abs() < 1e-12), "{there:?}, {expected:?}");
        }
    }

    #[test]
    fn the_same_place_four_times_and_exchanged_corners_are_no_symmetry() {
        assert_eq!(Symmetry::of(&[[0.8, 0.8]; 4]), None);
        let [a, b, c, d] = CORNERS;
        assert_eq!(Symmetry::of(&[a, b, d, c]), None);
        assert_eq!(Symmetry::of(&[a, b, c, [-0.1, 0.9]]), None, "near the middle of an axis");
        assert_eq!(Symmetry::of(&[a, b, c, d]), Some(Symmetry::IDENTITY));
    }

    #[test]
    fn faults_have_names() {
        let of = |turns: &[Turn]| Symmetry::of_turns(turns);
        let cases = [
            (of(&[]), "nothing is wrong", false),
            (of(&[Turn::FlipX]), "x is flipped", true),
            (of(&[Turn::FlipY]), "y is flipped", true),
            (of(&[Turn::FlipX, Turn::FlipY]), "the image is turned by 180°", false),
            (of(&[Turn::Transpose]), "x and y are swapped", true),
            (of(&[Turn::Rot90, Turn::FlipX]), "x and y are swapped", true),
            (of(&[Turn::Rot90, Turn::FlipY]), "x and y are swapped and flipped", true),
            (of(&[Turn::Rot90]), "the image is turned by 90° counterclockwise", false),
            (of(&[Turn::Rot90; 3]), "the image is turned by 90° clockwise", false),
        ];
        for (symmetry, fault, is_mirrored) in cases {
            assert_eq!((symmetry.fault(), symmetry.is_mirrored()), (fault, is_mirrored), "{symmetry:?}");
        }
        let quarter = Rotation3::from_axis_angle(&nalgebra::Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
        assert!((of(&[Turn::Rot90]).rotation().matrix() - quarter.matrix()).norm() < 1e-15);
        let half = Rotation3::from_axis_angle(&nalgebra::Vector3::x_axis(), std::f64::consts::PI);
        assert!((of(&[Turn::FlipY]).rotation().matrix() - half.matrix()).norm() < 1e-15, "z turns around");
    }
}
