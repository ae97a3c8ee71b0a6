//! `tare`: the zeros of the sensors are taken anew, while nothing moves and nothing touches them.

use super::engine::Engine;
use super::quiet::Unquiet;
use crate::source::quoted;

/// The word.
pub(super) const TARE: &str = "tare";

impl Engine {
    /// Takes the zeros of all sensors anew. Returns the nodes that do, in words. Nothing moves meanwhile: the tasks are
    /// halted, and their sensors give no samples until the new zeros are known.
    ///
    /// # Errors
    /// Why no zero changes: the run is not [quiet](Self::check_quiet).
    pub fn tare(&mut self) -> Result<String, String> {
        let refusal = |why: Unquiet| format!("`{TARE}` has no effect: {why}");
        self.check_still().map_err(refusal)?;
        // Up to here a replay, which has no arm, may see another state.
        if let Some(log) = &mut self.inputs {
            log.word(TARE);
        }
        let keepers = self.check_untouched().map_err(refusal)?;
        keepers.iter().for_each(|at| self.core.tare(*at));
        let names: Vec<&str> = keepers.iter().map(|at| self.names[*at].0.as_str()).collect();
        let tared = format!("the zeros of {} are taken anew", quoted(&names));
        tracing::info!("{tared}");
        Ok(tared)
    }
}
