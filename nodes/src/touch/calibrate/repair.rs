//! Bad tactels: what is wrong with them, and how they are filled from the live ones at their sides.

/// What is wrong with a tactel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Flaw {
    /// It always reads 0.
    Dead,
    /// It always reads the same.
    Stuck(f32),
    /// Its noise is this, far above that of the pad.
    Noisy(f64),
    /// Its reading has changed by this from the first to the second half of the test.
    Drifting(f64),
}

impl Flaw {
    /// Whether its reading never changes.
    pub(super) const fn is_constant(self) -> bool {
        matches!(self, Self::Dead | Self::Stuck(_))
    }
}

/// A tactel that does not measure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BadTactel {
    pub(super) at: usize,
    pub(super) flaw: Flaw,
    /// The live tactels at its sides.
    pub(super) sides: [Option<u32>; 4],
}

/// Sets each bad tactel to the mean of the live ones at its sides, or to 0 if there is none. No bad tactel is at a side
/// of another.
pub(super) fn repair(bad: &[BadTactel], forces: &mut [f32]) {
    for tactel in bad {
        let (mut sum, mut count) = (0.0, 0.0);
        for side in tactel.sides.iter().flatten() {
            sum += forces[*side as usize];
            count += 1.0;
        }
        forces[tactel.at] = if count > 0.0 { sum / count } else { 0.0 };
    }
}
