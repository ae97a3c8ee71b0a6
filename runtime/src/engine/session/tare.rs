//! `tare`: the zeros of the sensors are taken anew, while nothing moves and nothing touches them.

use super::engine::Engine;
use crate::source::quoted;

/// The word.
pub(super) const TARE: &str = "tare";

impl Engine {
    /// Takes the zeros of all sensors anew. Returns the nodes that do, in words. Nothing moves meanwhile: the tasks are
    /// halted, and their sensors give no samples until the new zeros are known.
    ///
    /// # Errors
    /// Why no zero changes: a task is not halted, an arm is not at rest, no node keeps a zero, or one of them refuses, as
    /// something touches its sensor.
    pub fn tare(&mut self) -> Result<String, String> {
        if let Some(task) = self.tasks.iter().find(|task| task.is_awaited() && !task.is_halted()) {
            let name = task.name();
            let (what, stop) = if name.is_empty() {
                ("the task".into(), "stop".into())
            } else {
                (format!("`{name}`"), format!("{name}.stop"))
            };
            return Err(format!("`{TARE}` has no effect while {what} runs: send `{stop}` first"));
        }
        if let Some(device) = self.devices.iter().find(|device| !device.rests()) {
            return Err(format!("`{TARE}` has no effect yet: `{}` is not at rest; send it again", device.name));
        }
        // Up to here a replay, which has no arm, may see another state.
        if let Some(log) = &mut self.inputs {
            log.word(TARE);
        }
        let mut keepers = Vec::new();
        for at in 0..self.names.len() {
            match self.core.can_tare(at) {
                None => {}
                Some(Ok(())) => keepers.push(at),
                Some(Err(why)) => return Err(format!("`{TARE}` is refused: `{}`: {why}", self.names[at].0)),
            }
        }
        if keepers.is_empty() {
            return Err(format!("`{TARE}` has no effect: no node of the graph keeps a zero"));
        }
        keepers.iter().for_each(|at| self.core.tare(*at));
        let names: Vec<&str> = keepers.iter().map(|at| self.names[*at].0.as_str()).collect();
        let tared = format!("the zeros of {} are taken anew", quoted(&names));
        tracing::info!("{tared}");
        Ok(tared)
    }
}
