//! Whether the zero of a pad sinks during a task: the readings then hide a force from the ceilings.
//!
//! Nothing that presses on a pad lowers a reading. A pad that sinks shows in the tactels that nothing touches, however
//! hard others are pressed.

use tactflow_runtime::node::State;

/// The pad is looked at in one of so many new frames.
const EVERY: u32 = 8;
/// The pad has sunk if more than a quarter of its live tactels are below their zeros...
const SHARE: usize = 4;
/// ...in so many looks in a row.
const LOOKS: u32 = 3;

/// What was seen of the readings below their zeros.
#[derive(Debug, State)]
pub(super) struct Sinking {
    /// Number of new frames so far.
    frames: u32,
    /// Number of looks in a row at which the pad had sunk.
    looks: u32,
}

impl Sinking {
    /// Looks at a new frame that counts. `is_dead` are the tactels that the calibration excludes. Returns whether the pad
    /// has sunk by more than `bound` below the zeros.
    pub(super) fn look(&mut self, cells: &[f32], zeros: &[f32], bound: f64, is_dead: impl Fn(usize) -> bool) -> bool {
        self.frames = (self.frames + 1) % EVERY;
        if self.frames == 0 {
            let bound = bound as f32;
            let (mut below, mut live) = (0, 0);
            for (_, (cell, zero)) in cells.iter().zip(zeros).enumerate().filter(|(i, _)| !is_dead(*i)) {
                live += 1;
                below += usize::from(zero - cell > bound);
            }
            self.looks = if below * SHARE > live { self.looks + 1 } else { 0 };
        }
        self.looks >= LOOKS
    }
}

#[cfg(test)]
mod tests {
    use tactflow_runtime::harness::NodeRig;
    use tactflow_runtime::signal::{Image, ImageShape, Shape, Unit};

    use super::super::Calibrate;

    /// A pad of eight tactels with a zero of 100 after its self-test.
    fn tested(params: &str) -> NodeRig {
        let image: Shape = ImageShape { rows: 2, cols: 4, pitch: [0.005; 2], unit: Unit::RAW }.into();
        let params = format!("offset = 100.0\nrest_frames = 8\n{params}");
        let mut rig = NodeRig::new::<Calibrate>(&params, &[("image", image)]).unwrap();
        show(&mut rig, [0.0; 8], 8);
        assert!(rig.get::<Image>("image").is_some());
        rig
    }

    /// Shows frames with a shift of each reading. Returns in how many of them there is an image.
    fn show(rig: &mut NodeRig, shift: [f32; 8], frames: usize) -> usize {
        let mut seen = 0;
        for i in 0..frames {
            let noise = [1.0, -1.0][i % 2];
            rig.set("image", Image::from_cells(4, &shift.map(|shift| 100.0 + shift + noise)));
            rig.step_ms(4.0);
            seen += usize::from(rig.get::<Image>("image").is_some());
        }
        seen
    }

    /// So many tactels are lower by 60, and the others are pressed.
    fn sunk(count: usize) -> [f32; 8] {
        std::array::from_fn(|i| if i < count { -60.0 } else { 2000.0 })
    }

    #[test]
    fn a_pad_that_sinks_ends_the_task_also_under_a_load() {
        let mut rig = tested("tare_bound = 50.0");
        assert_eq!(show(&mut rig, [-45.0; 8], 100), 100, "within the bound");
        assert_eq!(show(&mut rig, sunk(2), 100), 100, "a quarter of the tactels");
        assert_eq!(show(&mut rig, sunk(3), 16), 16, "not for long");
        assert_eq!(show(&mut rig, [0.0; 8], 16), 16);
        assert!(show(&mut rig, sunk(3), 32) < 32);
        assert_eq!(rig.get::<bool>("failed"), Some(&true));
        assert!(rig.found().unwrap().contains("have sunk below their zeros"), "{:?}", rig.found());
        assert_eq!(show(&mut rig, [0.0; 8], 8), 0, "it stays out of use");
    }

    #[test]
    fn dead_tactels_do_not_count() {
        let mut rig = tested("tare_bound = 50.0\ndead = [[1, 0], [1, 1], [1, 2], [1, 3]]");
        assert_eq!(show(&mut rig, sunk(1), 100), 100, "a quarter of the live ones");
        assert!(show(&mut rig, sunk(2), 32) < 32);
    }

    #[test]
    fn the_zeros_of_the_last_tare_count() {
        let image: Shape = ImageShape { rows: 2, cols: 4, pitch: [0.005; 2], unit: Unit::RAW }.into();
        let params = "offset = 100.0\nrest_frames = 8\ntare_bound = 50.0\ntare_window = 8\ntare_at_start = true";
        let mut rig = NodeRig::new::<Calibrate>(params, &[("image", image)]).unwrap();
        show(&mut rig, [40.0; 8], 8);
        show(&mut rig, [-40.0; 8], 16);
        assert_eq!(show(&mut rig, [-75.0; 8], 100), 100, "less than 50 below the tare, and 115 below the self-test");
        assert!(show(&mut rig, [-95.0; 8], 32) < 32);
    }

    #[test]
    fn without_a_bound_nothing_is_compared() {
        assert_eq!(show(&mut tested(""), [-90.0; 8], 100), 100);
    }
}
