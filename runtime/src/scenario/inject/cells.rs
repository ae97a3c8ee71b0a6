//! Draws the cells of a fault.

use crate::random::Random;

/// Draws `count` cells of an image with `rows` by `cols` cells. `taken` are the cells of all faults so far; the new ones
/// are added to them.
///
/// No two cells are neighbours, not even along a diagonal, as long as there is room: single cells of a pad break, and
/// two broken cells side by side are another fault, which a scenario lists itself.
pub(super) fn draw(count: usize, [rows, cols]: [usize; 2], taken: &mut Vec<usize>, random: &mut Random) -> Vec<usize> {
    let first = taken.len();
    for _ in 0..count {
        let is_near = |cell: usize, other: usize| {
            (cell / cols).abs_diff(other / cols) <= 1 && (cell % cols).abs_diff(other % cols) <= 1
        };
        let free: Vec<usize> = (0..rows * cols).filter(|cell| !taken.contains(cell)).collect();
        let apart = |cell: &usize| !taken.iter().any(|other| is_near(*cell, *other));
        let apart: Vec<usize> = free.iter().copied().filter(apart).collect();
        let room = if apart.is_empty() { &free } else { &apart };
        if room.is_empty() {
            break;
        }
        taken.push(room[random.below(room.len())]);
    }
    taken[first..].to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_apart_while_there_is_room_and_never_drawn_twice() {
        for seed in 0..200 {
            let mut taken = vec![0];
            let drawn = draw(20, [16, 16], &mut taken, &mut Random::new(seed, 0));
            assert_eq!((drawn.len(), taken.len()), (20, 21));
            for (i, cell) in taken.iter().enumerate() {
                for other in &taken[..i] {
                    let apart =
                        [cell / 16, cell % 16].iter().zip([other / 16, other % 16]).any(|(a, b)| a.abs_diff(b) > 1);
                    assert!(apart, "seed {seed}: {cell} and {other}");
                }
            }
        }
        let mut taken = Vec::new();
        let mut all = draw(9, [2, 3], &mut taken, &mut Random::new(1, 0));
        all.sort_unstable();
        assert_eq!(all, [0, 1, 2, 3, 4, 5]);
    }

    #[test]
    fn each_seed_draws_its_own_cells() {
        let draw = |seed| draw(4, [16, 16], &mut Vec::new(), &mut Random::new(seed, 0));
        assert_eq!(draw(1), draw(1));
        assert_ne!(draw(1), draw(2));
    }
}
